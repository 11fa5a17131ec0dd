"""The command `diagnose`: arguments, progress, files; light to import."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from model.errors import BadInput
from sandbox.cli.arguments import checked_folder, finish
from sandbox.output.tables import effort_bar, many, print_prose

PRESET = "a program whose column names and units are known: `sensorless list presets`"


def add_diagnose(add: Callable[..., Any], number: Callable[[str], float]) -> Any:
    """Add the command to the command line by its own `add`; return its parser."""
    c = add(
        "diagnose",
        run_diagnose,
        "where recordings and simulation differ, which effect causes it, how far the gap shrinks",
    )
    which = c.add_mutually_exclusive_group(required=True)
    which.add_argument(
        "campaign", type=Path, nargs="?", metavar="CAMPAIGN", help="folder with campaign.toml and its tables"
    )
    which.add_argument("--example", action="store_true", help="the sample campaign of the package (about a minute)")
    c.add_argument("--nominal", choices=("linear",), help="diagnose against the nominal motor without its saturation")
    text = "an effect that is no candidate (may be repeated)"
    c.add_argument("--exclude", action="append", default=[], metavar="EFFECT", help=text)
    c.add_argument(
        "--columns", type=Path, metavar="FILE.toml", help="names and units (sandbox/recordings/IMPORTING.md)"
    )
    c.add_argument("--preset", metavar="PROGRAM", help=PRESET)
    text = "folder of an earlier diagnosis, to go on from with further recordings in CAMPAIGN"
    c.add_argument("--continue", type=Path, dest="earlier", metavar="RESULT", help=text)
    text = "most memory, in GB (8; at least 0.7 plus 0.7 kB a sample): what does not fit waits in a file in TMPDIR"
    c.add_argument("--memory", type=number, metavar="GB", help=text)
    text = "use at most N samples, inf for all (all up to 250000, otherwise 100000 from the parts that differ most)"
    c.add_argument("--samples", type=number, metavar="N", help=text)
    return c


def add_check(add: Callable[..., Any]) -> Any:
    """Add the command `check` to the command line by its own `add`; return its parser."""
    text = "mistakes in a campaign before it is diagnosed, and which effects its recordings could show"
    c = add("check", run_check, text)
    c.add_argument("campaign", type=Path, metavar="CAMPAIGN", help="folder with campaign.toml and its tables")
    c.add_argument(
        "--columns", type=Path, metavar="FILE.toml", help="names and units (sandbox/recordings/IMPORTING.md)"
    )
    c.add_argument("--preset", metavar="PROGRAM", help=PRESET)
    c.add_argument(
        "--mistakes-only", action="store_true", help="do not work out which effects the recordings could show"
    )
    return c


def add_plan(add: Callable[..., Any], number: Callable[[str], float]) -> Any:
    """Add the command `plan` to the command line by its own `add`; return its parser."""
    c = add("plan", run_plan, "what to record on a bench: experiments, setpoints, and which effects they will show")
    c.add_argument("--motor", default="ipm_exchanged", metavar="NAME or FILE.toml", help="the nominal model")
    c.add_argument("--current", type=number, help="largest current, A peak (rated)")
    c.add_argument("--speed", type=number, help="largest speed, rpm (rated)")
    c.add_argument("--voltage", type=number, help="largest voltage of the DC link, V (the drive's)")
    c.add_argument("--can", metavar="A,B", help="what the bench can do with the rotor (locked,driven,free)")
    return c


def add_replay(add: Callable[..., Any], effects: str) -> Any:
    """Add the command `replay` to the command line by its own `add`; return its parser.  effects: help of --effects."""
    text = "simulate with the voltages of a campaign, and compare the currents with the measured ones"
    c = add("replay", run_replay, text)
    c.add_argument("campaign", type=Path, metavar="CAMPAIGN", help="folder with campaign.toml and its tables")
    c.add_argument("--motor", metavar="NAME or FILE.toml", help="instead of the campaign's nominal motor")
    c.add_argument("--effects", default="", metavar="NAME.PARAM=VALUE,... or FILE.toml", help=effects)
    c.add_argument(
        "--columns", type=Path, metavar="FILE.toml", help="names and units (sandbox/recordings/IMPORTING.md)"
    )
    c.add_argument("--preset", metavar="PROGRAM", help=PRESET)
    return c


def run_replay(options: argparse.Namespace) -> None:
    """Replay a campaign; write replay.json, .png and .parquet."""
    import sandbox
    from sandbox.public.campaigns.replayed import print_replay

    folder = checked_folder(options)
    found = sandbox.replay(
        options.campaign, options.effects, motor=options.motor, columns=options.columns, preset=options.preset,
        jobs=options.jobs or 1,
    )  # fmt: skip
    finish(options, found, folder, lambda: print_replay(found))


def run_plan(options: argparse.Namespace) -> None:
    """Plan recordings; write plan.json and a table of setpoints each."""
    import sandbox
    from sandbox.public.campaigns.checked import print_plan

    folder = checked_folder(options)
    can = None if options.can is None else tuple(name.strip() for name in options.can.split(",") if name.strip())
    found = sandbox.plan(
        options.motor, current=options.current, speed_rpm=options.speed, voltage=options.voltage, can=can,
        jobs=options.jobs or 1,
    )  # fmt: skip
    finish(options, found, folder, lambda: print_plan(found))


def run_check(options: argparse.Namespace) -> None:
    """Check a campaign; write check.json; exit code 2 where something stops it."""
    import sandbox
    from sandbox.public.campaigns.checked import print_check

    folder = checked_folder(options)
    found = sandbox.check(
        options.campaign, columns=options.columns, preset=options.preset, effects=not options.mistakes_only,
        jobs=options.jobs or 1,
    )  # fmt: skip
    finish(options, found, folder, lambda: print_check(found))
    if not found.ok:
        count = len([n for n in found.noticed if n.level == "refused"])
        raise BadInput(f"{many(count, 'finding')} stop{'s' if count == 1 else ''} this campaign")


def run_diagnose(options: argparse.Namespace) -> None:
    """Diagnose a campaign; write diagnosis.json, report.html, diagnosis.rrd and what the simulator takes of it."""
    import sandbox
    from sandbox.gap.diagnose import NINE_IN_TEN
    from sandbox.gap.evidence.normal import counted
    from sandbox.gap.pages.page import print_answers
    from sandbox.public.campaigns.diagnosed import print_files
    from sandbox.public.campaigns.moved import MotionResult, print_motion
    from sandbox.recordings.campaign import EXAMPLE

    folder = checked_folder(options)
    exclude = [name.strip() for text in options.exclude for name in text.split(",") if name.strip()]
    with effort_bar("diagnosing", options.quiet, NINE_IN_TEN) as (progress, count), counted(count):
        found = sandbox.diagnose(
            EXAMPLE if options.example else options.campaign, exclude=exclude, nominal=options.nominal,
            columns=options.columns, preset=options.preset, earlier=options.earlier, jobs=options.jobs,
            memory=options.memory, samples=options.samples, progress=progress,
        )  # fmt: skip
        progress("writing")
        found.save(folder, csv=options.csv)
    if not options.quiet:
        if isinstance(found, MotionResult):
            print_motion(found.motion)
        else:
            print_answers(found.answers)
            print_files(found)
        print_prose(f"results in {folder}")
