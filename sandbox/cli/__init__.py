"""The command line: arguments, exit codes, Ctrl-C; the commands themselves call the page `sandbox`."""

from __future__ import annotations

import argparse
import io
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from model.errors import BadInput, PhysicsError, sentence
from sandbox.cli import commands
from sandbox.cli.arguments import Parser, add_own_effects, number, positive_int, seed_number
from sandbox.cli.diagnosing import add_diagnose
from sandbox.cli.sweeping import add_sweep, add_tolerances, on_dask
from sandbox.cli.withholding import add_withheld
from sandbox.output.files import discard, version

PARALLEL = ("compare", "protocol", "diagnose", "sweep")  # use threads, or processes
NOISY = ("compare", "simulate", "protocol")  # draw sensor noise


LIBRARY = "an estimator of your own in C, as a shared library (see estimators/c/README.md)"
OFFLINE = "SENSORLESS_OFFLINE"  # as model.datasets reads it


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code (0 done, 1 `verify` found a difference, 2 bad input, 3 the physics failed).

    The work is done in a thread, so that Ctrl-C is answered at once while a kernel runs (exit code 130).
    """
    options = build_parser().parse_args(arguments)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without our letters still gets the rest
    quiet = getattr(options, "quiet", False)  # not even that something is compiled
    logging.getLogger("sensorless").setLevel(logging.ERROR if quiet else logging.NOTSET)
    codes: list[int] = []
    worker = threading.Thread(target=lambda: codes.append(attempt(options)), daemon=True)
    worker.start()
    try:
        with _ended_politely():
            while worker.is_alive():
                worker.join(0.2)
    except KeyboardInterrupt as stop:
        print(f"sensorless {options.command}: interrupted; nothing half-written", file=sys.stderr, flush=True)
        discard(commands.folder_of(options))
        os._exit(143 if isinstance(stop, Ended) else 130)  # the kernel would run on to its end
    return codes[0] if codes else 1


class Ended(KeyboardInterrupt):
    """SIGTERM, answered as Ctrl-C is."""


@contextmanager
def _ended_politely() -> Iterator[None]:
    """Raise Ended on SIGTERM, where this is the main thread."""

    def end(*_: object) -> None:
        """Raise Ended."""
        raise Ended

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def attempt(options: argparse.Namespace) -> int:
    """Run a command; turn what a user can cause into one sentence and an exit code."""
    before, code = os.environ.get(OFFLINE), 0
    try:
        if getattr(options, "offline", False):
            os.environ[OFFLINE] = "1"  # also of the processes that a command starts
        if files := getattr(options, "effects_from", ()):
            from model.effects.adopt import adopt  # brings in numba

            for file in files:
                adopt(file)
        code = options.run(options) or 0
        sys.stdout.flush()
    except (BadInput, PhysicsError) as error:
        return _refuse(options, str(error), error.exit_code)
    except BrokenPipeError:  # the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        return _refuse(options, f"{error.filename or 'output'}: {error.strerror or error}")
    except MemoryError:
        return _refuse(options, "not enough memory for this run; shorten the scenario or compare fewer estimators")
    finally:
        if before is None:
            os.environ.pop(OFFLINE, None)
        else:
            os.environ[OFFLINE] = before
    return int(code)


def _refuse(options: argparse.Namespace, text: str, code: int = 2) -> int:
    print(f"sensorless {options.command}: {sentence(text)}", file=sys.stderr)
    return code


def build_parser() -> Parser:
    """Return the parser of all commands."""
    parser = Parser(prog="sensorless", description="Sandbox for sensorless control of saturated PM motors.")
    parser.add_argument("--version", action="version", version=f"sensorless {version()}")
    every = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)

    def add(name: str, run: Callable[[argparse.Namespace], int | None], text: str, writes: bool = True) -> Parser:
        """Return the parser of a new command, with the arguments of all that write."""
        command: Parser = every.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        if writes:
            seed, jobs = (
                "of the sensors' noise (0)",
                "threads or processes (all cores)",
            )  # taken by all, told where they do something
            command.add_argument("--out", type=Path, help=f"folder for results (./sensorless-out/{name})")
            command.add_argument("--jobs", type=positive_int, help=jobs if name in PARALLEL else argparse.SUPPRESS)
            command.add_argument(
                "--seed", type=seed_number, default=0, help=seed if name in NOISY else argparse.SUPPRESS
            )
            command.add_argument("--csv", action="store_true", help="the table as CSV, too")
            command.add_argument("--quiet", action="store_true", help="print nothing but errors")
            _offline(command)
        return command

    c = add("compare", commands.run_compare, "position error of a saturated against a linear belief (the main job)")
    _which(c)
    c.add_argument(
        "--estimators", default="qnull,inversion,ekf", help="names or files, by commas (qnull,inversion,ekf)"
    )
    _own(c)
    c.add_argument("--no-trace", action="store_true", help="write no .rrd")
    add_own_effects(c)
    text = "what the plant has and the model lacks: effect.parameter=value,... (see `sensorless list effects`)"
    c.add_argument("--effects", default="", metavar="NAME.PARAM=VALUE,...", help=text)
    add_tolerances(c, positive_int)
    c = add("simulate", commands.run_simulate, "one run of one estimator")
    _which(c)
    one = c.add_mutually_exclusive_group()
    one.add_argument("--estimator", default="qnull", metavar="NAME or FILE.py", help="(qnull)")
    one.add_argument("--estimator-library", type=Path, metavar="FILE.so", help=LIBRARY)
    c.add_argument("--belief", default="saturated", choices=("saturated", "linear"), help="(saturated)")
    c.add_argument("--open", action="store_true", help="the encoder controls, the estimator only watches")
    c.add_argument("--duration", type=number, help="s of the scenario to run (all of it)")
    c.add_argument("--no-trace", action="store_true", help="write no .rrd")
    c.add_argument("--effects", default="", metavar="NAME.PARAM=VALUE,...", help=text)
    c.add_argument("--plant", choices=("exact", "switched", "averaged"), help="(exact, or what the estimator needs)")
    add_own_effects(c)
    c.add_argument("--json-only", action="store_true", help="write simulate.json alone: no trace, figure or table")
    c.add_argument("--record", type=Path, metavar="DIR", help="write the run as a campaign (a new folder)")
    c = add("audit", commands.run_audit, "where a motor's model is valid: convexity, saliency, cross-saturation angle")
    c.add_argument("motor", metavar="MOTOR", help="name or TOML file")
    c.add_argument("--radius", type=number, help="A, of the audited disc of currents (180 %% of rated)")
    c = add(
        "identify",
        commands.run_identify,
        "the motor from a campaign's locked recordings: paper's least squares and exact fit",
    )
    c.add_argument("campaign", type=Path, metavar="CAMPAIGN", help="folder with campaign.toml and its tables")
    text = "names and units of recordings from elsewhere (see sandbox/recordings/IMPORTING.md)"
    c.add_argument("--columns", type=Path, metavar="FILE.toml", help=text)
    add_own_effects(add_diagnose(add))
    c = add("maps", commands.run_maps, "inductances, cross-saturation angle and gain over the current plane")
    c.add_argument("motor", metavar="MOTOR", help="name or TOML file")
    c.add_argument("--radius", type=number, help="A, half width of the plane (180 %% of rated)")
    add_withheld(every, Parser, positive_int, seed_number)
    c = add(
        "protocol", commands.run_protocol, "the standard evaluation of every estimator and belief on several motors"
    )
    c.add_argument("--estimators", metavar="A,B", help="names or files, separated by commas (every compiled one)")
    _own(c)
    c.add_argument(
        "--motors",
        metavar="A,B",
        help="names or files, separated by commas (three, and `baldor_pmsyrm` where its map is at hand)",
    )
    c.add_argument("--tests", metavar="A,B", help="names, separated by commas (all)")
    on_dask(c)
    _peers(c)
    c = add("export-estimator", commands.run_export, "an estimator as C99 for a target, with a motor's constants")
    c.add_argument("name", metavar="NAME", help="qnull, inversion or ekf")
    c.add_argument("--motor", default="ipm_exchanged", metavar="NAME or FILE.toml", help="(ipm_exchanged)")
    c.add_argument("--belief", default="saturated", choices=("saturated", "linear"), help="(saturated)")
    add_own_effects(add_sweep(add))
    c = add("bench", commands.run_bench, "cost per plant step and per closed-loop simulated second")
    _peers(c)
    c = add("verify", commands.run_verify, "make a result once more as it says it was made, and compare every number")
    c.add_argument("result", type=Path, metavar="RESULT", help="folder that a command has written, or its JSON")
    text = "relative difference up to which numbers agree (1e-6; on the machine that made it, 0)"
    c.add_argument("--tolerance", type=number, default=1e-6, metavar="SHARE", help=text)
    c = add("list", commands.run_list, "what there is", writes=False)
    c.add_argument("kind", choices=("motors", "effects", "estimators", "scenarios", "datasets"))
    c.add_argument("name", nargs="?", help="an effect or estimator, to print its card")
    add_own_effects(c)
    c = add("view", commands.run_view, "open the rerun viewer on a trace", writes=False)
    c.add_argument("file", type=Path, metavar="FILE.rrd")
    c.add_argument("--web", action="store_true", help="in a browser, on this machine or another")
    c = add("show", commands.run_show, "open what a result holds: its page in the browser, its trace in the viewer",
            writes=False)  # fmt: skip
    c.add_argument("result", type=Path, metavar="RESULT", help="folder that a command has written")
    return parser


def _offline(command: Parser) -> None:
    text = "download nothing: say which file is missing and where to put it (or SENSORLESS_OFFLINE=1)"
    command.add_argument("--offline", action="store_true", help=text)


def _which(command: Parser) -> None:
    command.add_argument("--motor", default="ipm_exchanged", metavar="NAME or FILE.toml", help="(ipm_exchanged)")
    command.add_argument("--scenario", default="staircase", metavar="NAME or FILE.toml", help="(staircase)")


def _own(command: Parser) -> None:
    text = "an estimator of your own, beside those of --estimators (may be repeated)"
    command.add_argument("--estimator", action="append", default=[], metavar="FILE.py", help=text)
    command.add_argument(
        "--estimator-library", action="append", default=[], type=Path, metavar="FILE.so", help=f"{LIBRARY} (repeated)"
    )


def _peers(command: Parser) -> None:
    command.add_argument("--peer", action="store_true", help="measure the reference programs in the same run, too")
    where, text = Path("../shared/anchors"), "folder of the reference programs"
    command.add_argument("--anchors", type=Path, default=where, help=text)
    command.add_argument("--peer-python", default=sys.executable, help="Python >= 3.12 that has motulator 0.18")
