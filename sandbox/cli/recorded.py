"""The commands that read a campaign, and `plan`, which says what to record: arguments, progress,
files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import sandbox
from model.errors import BadInput
from sandbox.cli import arguments as take
from sandbox.output.tables import effort_bar, many, progress_bar


def identify(
    campaign: take.Campaign,
    /,
    *,
    columns: take.Columns = None,
    preset: take.Preset = None,
    output: take.Output = take.Output(),
) -> None:
    """The motor from recordings with locked rotor, by the paper's least squares and by an exact
    fit."""
    folder = output.checked("identify")
    output.finish(sandbox.identify(campaign, columns, preset), folder)


def settings(
    result: Annotated[Path, Parameter(metavar="RESULT")],
    /,
    *,
    config: Annotated[Path, Parameter(metavar="FILE")],
    bandwidth: Annotated[
        take.Number | None, take.usual("what the configuration means", "HZ")
    ] = None,
    output: take.Tableless = take.Tableless(),
) -> None:
    """A drive's settings (VESC, ODrive, moteus, SimpleFOC) beside what identify or diagnose found:
    values and gains.

    Parameters
    ----------
    result
        folder that identify or diagnose has written
    config
        the drive's configuration
    bandwidth
        of the current loop
    """
    folder = output.checked("settings")
    output.finish(sandbox.check_settings(result, config, bandwidth), folder)


def check(
    campaign: take.Campaign,
    /,
    *,
    columns: take.Columns = None,
    preset: take.Preset = None,
    mistakes_only: take.Flag = False,
    effects_from: take.EffectsFrom = (),
    output: take.Short = take.Short(),
) -> None:
    """Mistakes in a campaign before it is diagnosed, and which effects its recordings could show.

    Parameters
    ----------
    mistakes_only
        do not work out which effects the recordings could show
    """
    folder = output.checked("check")
    found = sandbox.check(
        campaign, columns=columns, preset=preset, effects=not mistakes_only, jobs=output.jobs
    )
    output.finish(found, folder)
    if not found.ok:
        count = len([n for n in found.noticed if n.level == "refused"])
        sentence = f"{many(count, 'finding')} stop{'s' if count == 1 else ''} this campaign"
        first = next(n.finding.text for n in found.noticed if n.level == "refused")
        raise BadInput(f"{sentence}: {first}" if output.quiet else sentence)  # else it stands above


def plan(
    *,
    motor: take.Motor = "ipm_exchanged",
    current: Annotated[take.Number | None, take.usual("rated", "A")] = None,
    speed: Annotated[take.Number | None, take.usual("rated", "RPM")] = None,
    voltage: Annotated[take.Number | None, take.usual("the drive's", "V")] = None,
    can: Annotated[take.Names | None, take.usual("locked,driven,free")] = None,
    fixed_link: take.Flag = False,
    effects_from: take.EffectsFrom = (),
    output: take.Short = take.Short(),
) -> None:
    """What to record on a bench: experiments, setpoints, and which effects they will show.

    Parameters
    ----------
    current
        largest current, A peak
    speed
        largest speed, rpm
    voltage
        largest voltage of the DC link, V
    can
        what the bench can do with the rotor
    fixed_link
        the link's voltage cannot be changed
    """
    folder = output.checked("plan")
    with progress_bar("planning", output.quiet) as progress:
        found = sandbox.plan(
            motor,
            current=current,
            speed_rpm=speed,
            voltage=voltage,
            can=can,
            fixed_link=fixed_link or None,
            jobs=output.jobs,
            progress=progress,
        )
    output.finish(found, folder)


def replay(
    campaign: take.Campaign,
    /,
    *,
    motor: Annotated[take.Motor | None, take.usual("the campaign's nominal motor")] = None,
    effects: take.Effects = "",
    columns: take.Columns = None,
    preset: take.Preset = None,
    effects_from: take.EffectsFrom = (),
    output: take.Short = take.Short(),
) -> None:
    """Simulate with the voltages of a campaign, and compare the currents with the measured ones."""
    folder = output.checked("replay")
    found = sandbox.replay(
        campaign, effects, motor=motor, columns=columns, preset=preset, jobs=output.jobs
    )
    output.finish(found, folder)


def diagnose(
    campaign: Annotated[take.Campaign | None, take.usual(False)] = None,
    /,
    *,
    example: take.Flag = False,
    nominal: Literal["linear"] | None = None,
    exclude: Annotated[
        take.Words,
        take.listed("effects"),
        take.several("EFFECT", "an effect that is no candidate (may be repeated)"),
    ] = (),
    columns: take.Columns = None,
    preset: take.Preset = None,
    earlier: Annotated[Path | None, Parameter(name="--continue", metavar="RESULT")] = None,
    memory: Annotated[take.Number | None, take.usual("8", "GB")] = None,
    samples: Annotated[
        take.Number | None, take.usual("all up to 250000, otherwise 100000", "N")
    ] = None,
    effects_from: take.EffectsFrom = (),
    output: take.Parallel = take.Parallel(),
) -> None:
    """Where recordings and simulation differ, which effect causes it, how far the gap shrinks.

    Parameters
    ----------
    example
        the sample campaign of the package instead of CAMPAIGN (about a minute)
    nominal
        diagnose against the nominal motor without its saturation
    earlier
        folder of an earlier diagnosis, to go on from with further recordings in CAMPAIGN
    memory
        most memory, at least 0.7 GB plus 0.7 kB a sample: what does not fit waits in a file in
        TMPDIR
    samples
        use at most N samples, from the parts that differ most; inf for all
    """
    if example == (campaign is not None):
        raise BadInput(
            "CAMPAIGN and --example are two campaigns; give one of them"
            if example
            else "no campaign is given; give CAMPAIGN, or --example"
        )
    from sandbox.gap.diagnose import NINE_IN_TEN
    from sandbox.gap.evidence.normal import counted
    from sandbox.recordings.campaign import EXAMPLE

    folder = output.checked("diagnose")
    names = [name for text in exclude for name in take.names_of(text)]
    with effort_bar("diagnosing", output.quiet, NINE_IN_TEN) as (progress, count), counted(count):
        found = sandbox.diagnose(
            campaign or EXAMPLE,
            exclude=names,
            nominal=nominal,
            columns=columns,
            preset=preset,
            earlier=earlier,
            jobs=output.jobs,
            memory=memory,
            samples=samples,
            progress=progress,
        )
        progress("writing")
        found.save(folder, csv=output.csv)
    output.say(found, folder)
