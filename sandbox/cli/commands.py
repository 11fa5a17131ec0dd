"""The commands that need no campaign: each reads its arguments, calls the page `sandbox`, saves and
prints the result.

Their signatures and texts are the options and the help of the command line.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

import sandbox
from estimators.registry import LIBRARIES
from model.errors import BadInput
from sandbox.cli import arguments as take
from sandbox.output.tables import print_list, print_prose, progress_bar, rate_bar

MOST_PERCENT = 50.0  # of a belief's parameters
USUAL_PERCENT = "5,10,20"
USUAL_ESTIMATORS = ("qnull", "inversion", "ekf")
ANCHORS = Path("../shared/anchors")
Plants = Literal["exact", "switched", "averaged"]  # older scripts may say averaged for exact
Kind = Literal["motors", "effects", "estimators", "scenarios", "datasets", "presets", "tests"]


def compare(
    *,
    motor: take.Motor = "ipm_exchanged",
    scenario: take.Scenario = "staircase",
    estimators: Annotated[
        take.Names | None, take.listed("estimators"), take.usual(",".join(USUAL_ESTIMATORS))
    ] = None,
    estimator: take.Estimators = (),
    estimator_library: take.Libraries = (),
    effects: take.Effects = "",
    effects_from: take.EffectsFrom = (),
    no_trace: take.Flag = False,
    tolerances: take.Percents = None,
    draws: Annotated[take.Count | None, take.usual("64")] = None,
    quiet_below: take.QuietBelow = None,
    loss_below: take.LossBelow = None,
    dask: take.Dask = None,
    output: take.NoisyParallel = take.NoisyParallel(),
) -> None:
    """Position error of a saturated against a linear belief (the main job).

    Parameters
    ----------
    estimators
        names or files, separated by commas
    no_trace
        write no .rrd
    tolerances
        also run with the belief's parameters off by up to so many percent (5,10,20 if no numbers
        are given)
    draws
        draws of these parameters at each tolerance
    """
    folder = output.checked("compare")
    percent = percents(tolerances, draws, estimator_library)
    if dask is not None and percent is None:
        raise BadInput(f"--dask {dask} belongs to --tolerances, which is not given; add it")
    named = asked_for(estimators, estimator, () if estimator_library else USUAL_ESTIMATORS)
    with progress_bar("comparing", output.quiet) as progress:
        result = sandbox.compare(
            motor,
            scenario,
            [*named, *map(library, estimator_library)],
            effects=effects,
            seed=output.seed,
            jobs=output.jobs,
            progress=progress,
            quiet_below=quiet_below,
            loss_below=loss_below,
        )
    output.finish(result, folder, trace=not no_trace)
    if percent is None:
        return
    with rate_bar("tolerances", output.quiet) as progress:
        found = sandbox.tolerances(
            motor,
            scenario,
            named,
            percent=percent,
            draws=draws or 64,
            effects=effects,
            seed=output.seed,
            jobs=output.jobs,
            cluster=dask,
            progress=progress,
        )
    output.finish(found, folder)
    replace(result, tolerances=found).save(folder, csv=output.csv, trace=not no_trace)


def asked_for(
    estimators: take.Words | None, one_by_one: take.Words, usual: take.Words
) -> list[str]:
    """Return the estimators of --estimators and --estimator, the usual ones where neither is
    given."""
    return list(
        usual if estimators is None and not one_by_one else (*(estimators or ()), *one_by_one)
    )


def library(path: Path) -> Any:
    """Return a shared library as it is named, which a result can tell; as an object where its
    suffix is another."""
    return str(path) if path.suffix in LIBRARIES else sandbox.load_estimator_library(path)


def percents(
    given: take.Words | None, draws: int | None, libraries: tuple[Path, ...]
) -> list[float] | None:
    """Return tolerances in percent, None where none are asked for; BadInput for what cannot be
    drawn."""
    if given is None:
        if draws is not None:
            raise BadInput(f"--draws {draws} belongs to --tolerances, which is not given; add it")
        return None
    text = given[0] if given else USUAL_PERCENT
    try:
        found = [take.number(part.strip()) for part in text.split(",") if part.strip()]
    except ValueError:
        found = []
    if not found or not all(0.0 <= x <= MOST_PERCENT for x in found):
        raise BadInput(
            f"--tolerances {text[:40]} are no percentages from 0 to {MOST_PERCENT:g}; "
            "write them as 5,10,20"
        )
    if libraries:
        raise BadInput(
            "--tolerances runs in processes that are told names and Python files; leave "
            "the library away"
        )
    return found


def simulate(
    *,
    motor: take.Motor = "ipm_exchanged",
    scenario: take.Scenario = "staircase",
    estimator: take.Estimator = None,
    estimator_library: take.Library = None,
    belief: take.Belief = "saturated",
    open: take.Flag = False,
    duration: Annotated[
        take.Number | None, take.usual("all of it; an hour takes 4 GB", "S")
    ] = None,
    effects: take.Effects = "",
    effects_from: take.EffectsFrom = (),
    no_trace: take.Flag = False,
    plant: Annotated[Plants, Parameter(metavar="exact|switched", show_choices=False)] = "exact",
    json_only: take.Flag = False,
    record: Annotated[Path | None, Parameter(metavar="DIR")] = None,
    output: take.Noisy = take.Noisy(),
) -> None:
    """One run of one estimator.

    Parameters
    ----------
    estimator
        what finds the position: a name of `sensorless list estimators`, or a file
    open
        the encoder controls, the estimator only watches
    duration
        s of the scenario to run
    no_trace
        write no .rrd
    plant
        exact: edge by edge; switched: the second simulator
    json_only
        write simulate.json alone, no trace, page, figure or table
    record
        write the run as a campaign (a new folder)
    """
    from sandbox.public.runs import check_new_folder

    if estimator is not None and estimator_library is not None:
        raise BadInput("--estimator and --estimator-library are two estimators; give one of them")
    folder = output.checked("simulate")
    if record is not None:
        check_new_folder(record, folder)
    result = sandbox.simulate(
        motor,
        scenario,
        library(estimator_library) if estimator_library else estimator or "qnull",
        belief=belief,
        closed_loop=not open,
        duration=duration,
        effects=effects,
        plant=plant,
        seed=output.seed,
        record=record,
    )
    more = not json_only
    said = "" if record is None else f"the run as a campaign in {record}"
    output.finish(result, folder, said, trace=more and not no_trace, figure=more, table=more)


def sweep(
    file: Path,
    /,
    *,
    dask: take.Dask = None,
    yes: take.Flag = False,
    again: take.Flag = False,
    effects_from: take.EffectsFrom = (),
    output: take.Parallel = take.Parallel(),
) -> None:
    """Many runs: grids and random draws; goes on after a stop (sandbox/evaluation/sweep/README.md).

    Parameters
    ----------
    file
        SWEEP.toml: what is the same in all runs, what is combined, what is drawn
    yes
        run it, however many runs it has
    again
        forget what an earlier call has finished in the folder
    """
    folder = output.checked("sweep")
    with rate_bar("sweep", output.quiet) as progress:
        result = sandbox.sweep(
            file, folder, jobs=output.jobs, cluster=dask, yes=yes, again=again, progress=progress
        )
    output.finish(result, folder)


def kept(folder: Path, again: bool) -> str:
    """Return what an interrupted sweep has kept, and how it goes on."""
    from sandbox.evaluation.sweep.store import counts

    done, total = counts(folder)
    if not done:
        return "no run is kept yet; nothing half-written"
    return (
        f"{done} of {total} runs are kept; the same "
        f"command{' without --again' if again else ''} goes on"
    )


def protocol(
    *,
    estimators: Annotated[
        take.Names | None, take.listed("estimators"), take.usual("every compiled one")
    ] = None,
    estimator: take.Estimators = (),
    estimator_library: take.Libraries = (),
    motors: Annotated[
        take.Names | None,
        take.listed("motors"),
        take.usual("three, and `baldor_pmsyrm` where its map is at hand"),
    ] = None,
    tests: Annotated[take.Names | None, take.listed("tests"), take.usual("all")] = None,
    quiet_below: take.QuietBelow = None,
    loss_below: take.LossBelow = None,
    dask: take.Dask = None,
    peer: take.Peer = False,
    anchors: take.Anchors = ANCHORS,
    peer_python: take.PeerPython = None,
    output: take.NoisyParallel = take.NoisyParallel(),
) -> None:
    """The standard evaluation: the same tests for every estimator and belief, on several motors.

    Parameters
    ----------
    estimators
        names or files, separated by commas
    motors
        names or files, separated by commas
    tests
        names of `sensorless list tests`, separated by commas
    """
    from sandbox.evaluation.protocol_names import ESTIMATORS, LINES, usual_motors

    folder = output.checked("protocol")
    named = asked_for(estimators, estimator, () if estimator_library else tuple(ESTIMATORS))
    if peer:
        from sandbox.evaluation.peer_python import check_peer

        peer_python = check_peer(anchors, peer_python)
    with progress_bar("protocol", output.quiet) as progress:
        result = sandbox.protocol(
            [*named, *map(library, estimator_library)],
            usual_motors() if motors is None else motors,
            LINES if tests is None else tests,
            seed=output.seed,
            jobs=output.jobs,
            keep=folder,
            cluster=dask,
            progress=progress,
            quiet_below=quiet_below,
            loss_below=loss_below,
        )
    if peer:
        from sandbox.evaluation.protocol import with_motulator

        result = replace(result, protocol=with_motulator(result.protocol, anchors, peer_python))
    output.finish(result, folder)


def bench(
    *,
    peer: take.Peer = False,
    anchors: take.Anchors = ANCHORS,
    peer_python: take.PeerPython = None,
    output: take.Output = take.Output(),
) -> None:
    """What a step of the plant and a simulated second in closed loop cost on this machine."""
    folder = output.checked("bench")
    output.finish(sandbox.bench(anchors if peer else None, peer_python), folder)


def verify(
    result: take.Result,
    /,
    *,
    tolerance: take.Share = 1e-6,
    output: take.Tableless = take.Tableless(),
) -> int:
    """Make a result once more, by the call that it keeps, and compare every number.

    Parameters
    ----------
    tolerance
        relative difference up to which numbers agree (on the machine that made it, 0)
    """
    folder = output.checked("verify")
    found = sandbox.verify(result, tolerance)
    output.finish(found, folder)
    return 0 if found.same else 1


def audit(
    motor: take.Motor, /, *, radius: take.Radius = None, output: take.Output = take.Output()
) -> None:
    """Up to which current a motor's model is valid: convexity, saliency, cross-saturation angle.

    Parameters
    ----------
    radius
        up to which current to look, in A
    """
    of_motor("audit", motor, radius, output)


def maps(
    motor: take.Motor, /, *, radius: take.Radius = None, output: take.Output = take.Output()
) -> None:
    """Inductances, cross-saturation angle and gain over the current plane.

    Parameters
    ----------
    radius
        half width of the plane of currents, in A
    """
    of_motor("maps", motor, radius, output)


def of_motor(name: str, motor: str, radius: float | None, output: take.Output) -> None:
    """Save what a motor's model says; the result of another motor in the same folder is kept under
    its name."""
    from sandbox.public.result import keep_other

    folder = output.checked(name)
    result = getattr(sandbox, name)(motor, radius)
    kept_one = keep_other(folder, name, result.as_json()["motor"])
    output.finish(result, folder, kept_one)


def motor(
    *stated: Annotated[str, Parameter(name="FILE|KEY=VALUE")],
    name: Annotated[str, Parameter(metavar="NAME")] = "motor",
    output: take.Tableless = take.Tableless(),
) -> None:
    """A motor's file from a configuration (VESC, ODrive, moteus, SimpleFOC) and values of data
    sheets, converted.

    Parameters
    ----------
    stated
        paths of configurations, and values with units: kv=300 resistance_ll=0.1ohm current='20 A
        rms'
    name
        the motor's name
    """
    folder = output.checked("motor")
    output.finish(sandbox.convert_motor(stated, name), folder)


def export_estimator(
    name: Annotated[str, Parameter(metavar="NAME")],
    /,
    *,
    motor: take.Motor = "ipm_exchanged",
    belief: take.Belief = "saturated",
    output: take.Tableless = take.Tableless(),
) -> None:
    """An estimator as C99 for a firmware, with a motor's constants.

    Parameters
    ----------
    name
        qnull, inversion or ekf
    """
    folder = output.checked("export-estimator")
    output.finish(sandbox.export_estimator(name, motor, belief), folder)


def export_drive(
    *,
    motor: take.Motor = "ipm_exchanged",
    effects: take.Effects = "",
    effects_from: take.EffectsFrom = (),
    top_speed: take.Speed = None,
    no_fmu: take.Flag = False,
    output: take.Tableless = take.Tableless(),
) -> None:
    """Motor, inverter and effects as C99 and as FMUs (FMI 2.0 and 3.0), for a test rig or another
    simulator.

    Parameters
    ----------
    top_speed
        of the shaft, up to which the plant's steps are short enough
    no_fmu
        write the C files alone
    """
    folder = output.checked("export-drive")
    output.finish(
        sandbox.export_drive(motor, effects, top_speed_rpm=top_speed, fmu=not no_fmu), folder
    )


def include() -> None:
    """The folder of the C header for an estimator of your own: cc -I "$(sensorless include)" ..."""
    print_prose(sandbox.get_include())


def list_names(
    kind: Annotated[Kind, Parameter(metavar="KIND")],
    name: Annotated[str | None, take.listed("KIND")] = None,
    /,
    *,
    effects_from: take.EffectsFrom = (),
) -> None:
    """Names and one line each of motors, effects and so on.

    Parameters
    ----------
    kind
        what to list
    name
        of an effect, estimator, motor or scenario: its card is printed
    """
    from sandbox.public.catalogue import card_of

    if name is not None:
        print_prose(card_of(kind, name))
    else:
        print_list(getattr(sandbox, f"list_{kind}")())


def view(file: Path, /, *, web: take.Flag = False) -> None:
    """Open the rerun viewer on a trace.

    Parameters
    ----------
    file
        a trace (.rrd) that a command has written
    web
        in a browser, on this machine or another
    """
    sandbox.view(file, web=web)


def show(result: take.Result, /) -> None:
    """Open what a result holds: its page in the browser, its trace in the viewer."""
    print_prose(sandbox.show(result))
