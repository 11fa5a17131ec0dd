"""The commands' arguments, group by group: runs, judging, the motor alone, recordings, export, looking at results."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from sandbox.cli import commands
from sandbox.cli.arguments import Parser, add_own_effects, number, positive_int, seed_number
from sandbox.cli.diagnosing import PRESET, add_check, add_diagnose, add_plan, add_replay
from sandbox.cli.sweeping import add_tolerances, on_dask

PARALLEL = ("compare", "protocol", "diagnose", "sweep")  # use all cores, as threads or processes
SHORT = ("check", "plan", "replay")  # done before a second thread would pay, unless more are asked for
NOISY = ("compare", "simulate", "protocol")  # draw sensor noise
TABLELESS = ("verify", "export-estimator", "motor")  # write no table
MOTOR = "a motor of `sensorless list motors`, or a file of yours (ipm_exchanged)"
LIBRARY = "an estimator of your own in C, as a shared library (see estimators/c/README.md)"
EFFECTS = "what the plant has and the model lacks: effect.parameter=value,... or a file such as effects.toml"

Run = Callable[[argparse.Namespace], int | None]  # an exit code where it is not 0


class Add(Protocol):
    """Makes the parser of a new command; writes: whether it writes results."""

    def __call__(self, name: str, run: Run, text: str, writes: bool = True) -> Parser:
        """Return the parser."""


def add_common(command: Parser, name: str) -> None:
    """Add what every command that writes results takes; seed, jobs and csv are told where they do something."""
    jobs = "threads or processes (all cores)" if name in PARALLEL else argparse.SUPPRESS
    jobs = "threads (1)" if name in SHORT else jobs
    seed = "seed of the sensors' noise (0)" if name in NOISY else argparse.SUPPRESS
    command.add_argument("--out", type=Path, help=f"folder for results (./sensorless-out/{name})")
    command.add_argument("--jobs", type=positive_int, help=jobs)
    command.add_argument("--seed", type=seed_number, default=0, help=seed)
    table = argparse.SUPPRESS if name in TABLELESS else "the table as CSV, too"
    command.add_argument("--csv", action="store_true", help=table)
    command.add_argument("--quiet", action="store_true", help="print nothing but errors")
    text = "download nothing: say which file is missing and where to put it (or SENSORLESS_OFFLINE=1)"
    command.add_argument("--offline", action="store_true", help=text)


def add_runs(add: Add) -> None:
    """Add `compare` and `simulate`."""
    c = add("compare", commands.run_compare, "position error of a saturated against a linear belief (the main job)")
    _which(c)
    text = "names or files, separated by commas (qnull,inversion,ekf)"
    c.add_argument("--estimators", default="qnull,inversion,ekf", help=text)
    _own(c)
    _plant(c)
    add_tolerances(c, positive_int)
    c = add("simulate", commands.run_simulate, "one run of one estimator")
    _which(c)
    one = c.add_mutually_exclusive_group()
    text = "what finds the position: a name of `sensorless list estimators`, or a file FILE.py (qnull)"
    one.add_argument("--estimator", default="qnull", metavar="NAME", help=text)
    one.add_argument("--estimator-library", type=Path, metavar="FILE.so", help=LIBRARY)
    _belief(c)
    c.add_argument("--open", action="store_true", help="the encoder controls, the estimator only watches")
    c.add_argument("--duration", type=number, help="s of the scenario to run (all of it; an hour takes 4 GB)")
    _plant(c)
    text = "exact: edge by edge; switched: the second simulator (exact); older scripts may say averaged for exact"
    choices = ("exact", "switched", "averaged")
    c.add_argument("--plant", choices=choices, default="exact", metavar="{exact,switched}", help=text)
    c.add_argument(
        "--json-only", action="store_true", help="write simulate.json alone, no trace, page, figure or table"
    )
    c.add_argument("--record", type=Path, metavar="DIR", help="write the run as a campaign (a new folder)")


def add_judging(add: Add) -> None:
    """Add `protocol`, `bench` and `verify`."""
    text = "the standard evaluation: the same tests for every estimator and belief, on several motors"
    c = add("protocol", commands.run_protocol, text)
    c.add_argument("--estimators", metavar="A,B", help="names or files, separated by commas (every compiled one)")
    _own(c)
    text = "names or files, separated by commas (three, and `baldor_pmsyrm` where its map is at hand)"
    c.add_argument("--motors", metavar="A,B", help=text)
    c.add_argument("--tests", metavar="A,B", help="names of `sensorless list tests`, separated by commas (all)")
    on_dask(c)
    _peers(c)
    text = "what a step of the plant and a simulated second in closed loop cost on this machine"
    _peers(add("bench", commands.run_bench, text))
    text = "make a result once more, by the call that it keeps, and compare every number"
    c = add("verify", commands.run_verify, text)
    c.add_argument("result", type=Path, metavar="RESULT", help="folder that a command has written, or its JSON")
    text = "relative difference up to which numbers agree (1e-6; on the machine that made it, 0)"
    c.add_argument("--tolerance", type=number, default=1e-6, metavar="SHARE", help=text)


def add_motor(add: Add) -> None:
    """Add `audit`, `maps` and `motor`, which need no run."""
    text = "up to which current a motor's model is valid: convexity, saliency, cross-saturation angle"
    c = add("audit", commands.run_audit, text)
    c.add_argument("motor", metavar="MOTOR", help="name or TOML file")
    c.add_argument("--radius", type=number, help="up to which current to look, in A (180 %% of rated)")
    c = add("maps", commands.run_maps, "inductances, cross-saturation angle and gain over the current plane")
    c.add_argument("motor", metavar="MOTOR", help="name or TOML file")
    c.add_argument("--radius", type=number, help="half width of the plane of currents, in A (180 %% of rated)")
    text = "a motor's file from a configuration (VESC, ODrive, moteus, SimpleFOC) and values of data sheets, converted"
    c = add("motor", commands.run_motor, text)
    text = "paths of configurations, and values with units: kv=300 resistance_ll=0.1ohm current='20 A rms'"
    c.add_argument("stated", nargs="+", metavar="FILE|KEY=VALUE", help=text)
    c.add_argument("--name", default="motor", help="the motor's name (motor)")


def add_recorded(add: Add) -> None:
    """Add `identify`, `diagnose`, `check`, `plan` and `replay`."""
    text = "the motor from recordings with locked rotor, by the paper's least squares and by an exact fit"
    c = add("identify", commands.run_identify, text)
    c.add_argument("campaign", type=Path, metavar="CAMPAIGN", help="folder with campaign.toml and its tables")
    text = "names and units of recordings from elsewhere (see sandbox/recordings/IMPORTING.md)"
    c.add_argument("--columns", type=Path, metavar="FILE.toml", help=text)
    c.add_argument("--preset", metavar="PROGRAM", help=PRESET)
    add_own_effects(add_diagnose(add, number))
    add_own_effects(add_check(add))
    add_own_effects(add_plan(add, number))
    add_own_effects(add_replay(add, EFFECTS))


def add_export(add: Add) -> None:
    """Add `export-estimator`."""
    c = add("export-estimator", commands.run_export, "an estimator as C99 for a firmware, with a motor's constants")
    c.add_argument("name", metavar="NAME", help="qnull, inversion or ekf")
    c.add_argument("--motor", default="ipm_exchanged", metavar="NAME or FILE.toml", help=MOTOR)
    _belief(c)


def add_looking(add: Add) -> None:
    """Add `list`, `view` and `show`, which write nothing."""
    c = add("list", commands.run_list, "names and one line each of motors, effects and so on", writes=False)
    kinds = ("motors", "effects", "estimators", "scenarios", "datasets", "presets", "tests")
    c.add_argument("kind", choices=kinds, metavar="KIND", help=", ".join(kinds))
    c.add_argument("name", nargs="?", help="of an effect, estimator, motor or scenario: its card is printed")
    add_own_effects(c)
    c = add("view", commands.run_view, "open the rerun viewer on a trace", writes=False)
    c.add_argument("file", type=Path, metavar="FILE.rrd")
    c.add_argument("--web", action="store_true", help="in a browser, on this machine or another")
    text = "open what a result holds: its page in the browser, its trace in the viewer"
    c = add("show", commands.run_show, text, writes=False)
    c.add_argument("result", type=Path, metavar="RESULT", help="folder that a command has written")


def _which(command: Parser) -> None:
    command.add_argument("--motor", default="ipm_exchanged", metavar="NAME or FILE.toml", help=MOTOR)
    text = "what is asked of the drive, `sensorless list scenarios` (staircase)"
    command.add_argument("--scenario", default="staircase", metavar="NAME or FILE.toml", help=text)


def _belief(command: Parser) -> None:
    text = "the model of the motor inside the estimator (saturated)"
    command.add_argument("--belief", default="saturated", choices=("saturated", "linear"), help=text)


def _plant(command: Parser) -> None:
    command.add_argument("--no-trace", action="store_true", help="write no .rrd")
    command.add_argument("--effects", default="", metavar="NAME.PARAM=VALUE,... or FILE.toml", help=EFFECTS)
    add_own_effects(command)


def _own(command: Parser) -> None:
    text = "an estimator of your own, beside those of --estimators (may be repeated)"
    command.add_argument("--estimator", action="append", default=[], metavar="FILE.py", help=text)
    command.add_argument(
        "--estimator-library",
        action="append",
        default=[],
        type=Path,
        metavar="FILE.so",
        help=f"{LIBRARY} (may be repeated)",
    )


def _peers(command: Parser) -> None:
    command.add_argument("--peer", action="store_true", help="measure the reference programs in the same run, too")
    where, text = Path("../shared/anchors"), "folder of the reference programs"
    command.add_argument("--anchors", type=Path, default=where, help=text)
    command.add_argument("--peer-python", default=sys.executable, help="Python >= 3.12 that has motulator 0.18")
