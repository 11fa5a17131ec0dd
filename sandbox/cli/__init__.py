"""The command line: arguments, exit codes, Ctrl-C; the commands themselves call the page `sandbox`."""

from __future__ import annotations

import argparse
import errno
import io
import logging
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import sandbox.cli.blas  # noqa: F401 (before numpy)
from model.errors import BadInput, PhysicsError, sentence
from sandbox.cli.arguments import Parser, add_own_effects, folder_of, positive_int, seed_number
from sandbox.cli.groups import Run, add_common, add_export, add_judging, add_looking, add_motor, add_recorded, add_runs
from sandbox.cli.sweeping import add_sweep
from sandbox.cli.withholding import add_withheld
from sandbox.output.files import discard, version

OFFLINE = "SENSORLESS_OFFLINE"  # as model.datasets reads it
FULL = (errno.ENOSPC, errno.EDQUOT)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code (0 done, 1 `verify` found a difference, 2 bad input, 3 the physics failed).

    The work is done in a thread, so that Ctrl-C is answered at once while a kernel runs (exit code 130).
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 (open as long as the process)
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
        from sandbox.engine.processes import end_processes

        end_processes()
        discard(folder_of(options))
        kept = options.kept(options) if hasattr(options, "kept") else "nothing half-written"
        print(f"sensorless {options.command}: interrupted; {kept}", file=sys.stderr, flush=True)
        os._exit(143 if isinstance(stop, Ended) else 130)  # the kernel would run on to its end
    return codes[0] if codes else 1


class Ended(KeyboardInterrupt):
    """SIGTERM, answered as Ctrl-C is."""


@contextmanager
def _ended_politely() -> Iterator[None]:
    """Raise KeyboardInterrupt on the first Ctrl-C and Ended on the first SIGTERM, where this is the main thread.

    Whatever comes after it is ignored, so that a second Ctrl-C does not stop the clearing up.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard = [n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) is not signal.SIG_IGN]

    def end(number: int, *_: object) -> None:
        """Raise what the signal stands for, and ignore further ones."""
        for other in heard:
            signal.signal(other, signal.SIG_IGN)
        raise Ended if number == signal.SIGTERM else KeyboardInterrupt

    before = {n: signal.signal(n, end) for n in heard}
    try:
        yield
    except KeyboardInterrupt:
        raise  # still ignoring: the process ends
    else:
        for number, handler in before.items():
            signal.signal(number, handler)


def attempt(options: argparse.Namespace) -> int:
    """Run a command; turn what a user can cause into one sentence and an exit code."""
    before, code = os.environ.get(OFFLINE), 0
    try:
        if getattr(options, "offline", False):
            os.environ[OFFLINE] = "--offline"  # also of the processes that a command starts
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
        writes = hasattr(options, "out") or hasattr(options, "folder")
        place = getattr(options, "folder", None) or folder_of(options) if writes else "standard output"
        remedy = "make room there, or give another place" if error.errno in FULL else "mend that, or give another place"
        return _refuse(options, f"'{error.filename or place}': {error.strerror or error}; {remedy}")
    except MemoryError:
        return _refuse(options, "not enough memory for this run; shorten the scenario or compare fewer estimators")
    finally:
        if before is None:
            os.environ.pop(OFFLINE, None)
        else:
            os.environ[OFFLINE] = before
    return int(code)


def _refuse(options: argparse.Namespace, text: str, code: int = 2) -> int:
    print(sentence(f"sensorless {options.command}: {text}"), file=sys.stderr)
    return code


def build_parser() -> Parser:
    """Return the parser of all commands."""
    parser = Parser(prog="sensorless", description="Sandbox for sensorless control of saturated PM motors.")
    parser.add_argument("--version", action="version", version=f"sensorless {version()}")
    every = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)

    def add(name: str, run: Run, text: str, writes: bool = True) -> Parser:
        """Return the parser of a new command, with the arguments of all that write."""
        command: Parser = every.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        if writes:
            add_common(command, name)
        return command

    add_runs(add)
    add_own_effects(add_sweep(add))
    add_judging(add)
    add_motor(add)
    add_recorded(add)
    add_withheld(every, Parser, positive_int, seed_number)
    add_export(add)
    add_looking(add)
    return parser
