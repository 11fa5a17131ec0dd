"""The command line: exit codes, Ctrl-C, one sentence for a wrong call; the commands themselves call
`sandbox`."""

from __future__ import annotations

import errno
import io
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from inspect import BoundArguments
from pathlib import Path
from typing import Any, NamedTuple

from cyclopts import CycloptsError

import sandbox.cli.blas  # noqa: F401 (before numpy)
from model.errors import BadInput, PhysicsError, sentence
from sandbox.cli import commands
from sandbox.cli.application import application
from sandbox.cli.arguments import Output
from sandbox.cli.refusals import sentence_of
from sandbox.output.files import discard

OFFLINE = "SENSORLESS_OFFLINE"  # as model.datasets reads it
FULL = (errno.ENOSPC, errno.EDQUOT)


class Call(NamedTuple):
    """A command as it was called."""

    name: str  # of the command, empty for the program itself
    run: Callable[..., Any]
    bound: BoundArguments

    def given(self, name: str, usual: Any = None) -> Any:
        """Return an argument, `usual` where the command has none of that name."""
        return self.bound.arguments.get(name, usual)

    @property
    def output(self) -> Output | None:
        """What is asked of the results; None of a command that has none."""
        found = self.given("output")
        return found if isinstance(found, Output) else None

    @property
    def place(self) -> Path | None:
        """Where the command writes."""
        return self.output.folder(self.name) if self.output else self.given("folder")

    @property
    def quiet(self) -> bool:
        """Whether nothing but errors is printed."""
        return bool(self.output.quiet if self.output else self.given("quiet"))


def parse(words: Sequence[str]) -> Call:
    """Return the command that words call; CycloptsError, or BadInput, where they call none."""
    app = application()
    chain, _, _ = app.parse_commands(words)
    run, bound, _ = app.parse_args(words, print_error=False, exit_on_error=False)
    bound.apply_defaults()
    name = " ".join(chain)
    if run.__name__ == "help_print" and not {*app.help_flags} & {*words}:  # nothing was asked for
        raise BadInput(
            f"a command is missing; see `{' '.join(filter(None, ('sensorless', name)))} --help`"
        )
    return Call(name, run, bound)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code (0 done, 1 `verify` found a difference, 2 bad input, 3
    the physics failed).

    The work is done in a thread, so that Ctrl-C is answered at once while a kernel runs (exit code
    130).
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 (open as long as the process)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # a terminal without our letters still gets the rest
            stream.reconfigure(errors="replace")
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        call = parse(words)
    except CycloptsError as error:
        return _refuse(" ".join(error.command_chain or ()), sentence_of(error))
    except BadInput as error:
        return _refuse("", str(error))
    # not even that something is compiled
    logging.getLogger("sensorless").setLevel(logging.ERROR if call.quiet else logging.NOTSET)
    codes: list[int] = []
    worker = threading.Thread(target=lambda: codes.append(attempt(call)), daemon=True)
    worker.start()
    try:
        with _ended_politely():
            while worker.is_alive():
                worker.join(0.2)
    except KeyboardInterrupt as stop:
        from sandbox.engine.processes import end_processes

        end_processes()
        said = "nothing half-written"
        if call.place is not None:
            discard(call.place)
            said = commands.kept(call.place, call.given("again")) if call.name == "sweep" else said
        print(f"sensorless {call.name}: interrupted; {said}", file=sys.stderr, flush=True)
        os._exit(143 if isinstance(stop, Ended) else 130)  # the kernel would run on to its end
    return codes[0] if codes else 1


class Ended(KeyboardInterrupt):
    """SIGTERM, answered as Ctrl-C is."""


@contextmanager
def _ended_politely() -> Iterator[None]:
    """Raise KeyboardInterrupt on the first Ctrl-C and Ended on the first SIGTERM, where this is the
    main thread.

    Whatever comes after it is ignored, so that a second Ctrl-C does not stop the clearing up.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard = [
        n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) is not signal.SIG_IGN
    ]

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


def attempt(call: Call) -> int:
    """Run a command; turn what a user can cause into one sentence and an exit code."""
    before, code = os.environ.get(OFFLINE), 0
    try:
        if call.output and call.output.offline:
            os.environ[OFFLINE] = "--offline"  # also of the processes that a command starts
        if files := call.given("effects_from"):
            from model.effects.adopt import adopt  # brings in numba

            for file in files:
                adopt(file)
        if cluster := call.given("dask"):
            from sandbox.engine.processes import client_of

            with client_of(cluster):  # it answers, before any work
                pass
        code = call.run(*call.bound.args, **call.bound.kwargs) or 0
        sys.stdout.flush()
    except (BadInput, PhysicsError) as error:
        code = _refuse(call.name, str(error), error.exit_code)
        for note in getattr(error, "__notes__", ()):
            print(sentence(note), file=sys.stderr)
        return code
    except BrokenPipeError:  # the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        remedy = (
            "make room there, or give another place"
            if error.errno in FULL
            else "mend that, or give another place"
        )
        place = error.filename or call.place or "standard output"
        return _refuse(call.name, f"'{place}': {error.strerror or error}; {remedy}")
    except MemoryError:
        return _refuse(
            call.name,
            "not enough memory for this run; shorten the scenario or compare fewer estimators",
        )
    finally:
        if before is None:
            os.environ.pop(OFFLINE, None)
        else:
            os.environ[OFFLINE] = before
    return int(code)


def _refuse(command: str, text: str, code: int = 2) -> int:
    print(sentence(f"{' '.join(filter(None, ('sensorless', command)))}: {text}"), file=sys.stderr)
    return code
