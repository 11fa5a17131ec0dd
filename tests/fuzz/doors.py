"""Every door of the project with whole files behind it, and what an input that was let in or
refused has to look like.

A door is a folder of whole files, which of them is damaged and how, and the call that reads it.
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import re
import resource
import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from model.errors import LONGEST_SENTENCE, BadInput, PhysicsError

LONGEST = 10.0  # processor s an input may take
STOPPED = 60.0  # processor s after which it is stopped
# s by the clock after which one is stopped that waits for something; a loaded machine takes its
# time
WAITED = 600.0
MEMORY = 2_000_000_000  # bytes beyond what the libraries have mapped


@dataclass(frozen=True)
class Door:
    """One way in: `make` writes whole files into a folder, `damage` makes new content of one of
    them, `read` reads."""

    name: str
    make: Callable[[Path], None]
    files: tuple[str, ...]
    damage: Callable[[bytes, random.Random], bytes]
    read: Callable[[Path], Any]


@dataclass(frozen=True)
class Outcome:
    """What became of an input: accepted, refused or escaped (why: exception and place, or what was
    wrong)."""

    kind: str
    why: str
    seconds: float  # of the processor


class Stopped(BaseException):
    """Raised by the alarm in an input that does not end."""


@contextlib.contextmanager
def alarm() -> Iterator[None]:
    """Stop what takes longer than STOPPED and WAITED (on the main thread, as soon as Python code
    runs there)."""

    def ring(*_: Any) -> None:
        """Raise Stopped."""
        raise Stopped

    timers = (
        (signal.ITIMER_PROF, signal.SIGPROF, STOPPED),
        (signal.ITIMER_REAL, signal.SIGALRM, WAITED),
    )
    before = [signal.signal(own, ring) for _, own, _ in timers]
    for timer, _, seconds in timers:
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for (timer, own, _), handler in zip(timers, before, strict=True):
            signal.setitimer(timer, 0.0)
            signal.signal(own, handler)


def limit_memory() -> None:
    """Let this process map MEMORY more than now; beyond, Python raises MemoryError."""
    import pyarrow

    # its pool reserves a gigabyte of addresses at its first use: no memory yet
    pyarrow.allocate_buffer(64)
    pages = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(
        resource.RLIMIT_AS, (pages + MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1])
    )


def judged(work: Callable[[], Any]) -> Outcome:
    """Run a call; return whether its input was let in, refused in one sentence, or escaped."""
    begun, kind, why = time.process_time(), "accepted", ""
    try:
        with alarm(), warnings.catch_warnings():
            # more lines
            warnings.filterwarnings(
                "error", category=RuntimeWarning, module="model|sandbox|estimators"
            )
            work()
    except (BadInput, PhysicsError) as error:
        kind, why = "refused", wrong_sentence(str(error))
    except Stopped:
        kind, why = (
            "escaped",
            f"did not end in {STOPPED:g} s of the processor or {WAITED:g} s by the clock",
        )
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)
        own = [
            f
            for f in place
            if "site-packages" not in f.filename and "/lib/python" not in f.filename
        ] or list(place)
        last = own[-1]
        kind, why = (
            "escaped",
            f"{type(error).__name__} in {Path(last.filename).name}:{last.name}: {error!s:.100}",
        )
    seconds = time.process_time() - begun
    if kind == "refused" and why:
        kind = "escaped"
    if kind != "escaped" and seconds > LONGEST:
        kind, why = "escaped", f"took {seconds:.0f} s"
    return Outcome(kind, why, seconds)


def wrong_sentence(text: str) -> str:
    """Return what is wrong with a sentence for people, '' where nothing is."""
    if not text.strip():
        return "an empty sentence"
    if not text.replace("\xa0", " ").isprintable():
        return f"a sentence with line breaks or control characters: {text[:60]!r}"
    if len(text) > LONGEST_SENTENCE:
        return f"a sentence of {len(text)} characters"
    return ""


def tried(door: Door, whole: dict[str, bytes], folder: Path, name: str, content: bytes) -> Outcome:
    """Put a damaged file among the whole ones, read, and take it away again; what is left behind is
    an escape."""
    (folder / name).write_bytes(content)
    before = listing(folder)
    outcome = judged(lambda: door.read(folder))
    if outcome.kind == "refused" and listing(folder) != before:
        outcome = Outcome(
            "escaped", f"left {sorted(listing(folder) ^ before)[:3]} behind", outcome.seconds
        )
    (folder / name).write_bytes(whole[name])
    return outcome


def listing(folder: Path) -> set[str]:
    """Return all that lies below a folder."""
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*")}


def damaged(door: Door, whole: dict[str, bytes], number: int) -> tuple[str, bytes]:
    """Return the file that input `number` of a door damages, and its content."""
    chance = random.Random(f"{door.name} {number}")
    name = chance.choice(door.files)
    return name, door.damage(whole[name], chance)


def called(arguments: list[str]) -> Outcome:
    """Call the command line in this process, its physics replaced; judge what it prints and its
    exit code."""
    from sandbox.cli import main

    out, err, codes = io.StringIO(), io.StringIO(), []

    def work() -> None:
        """Call, what is printed kept."""
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            codes.append(main(arguments))

    outcome = judged(work)
    said = err.getvalue()
    if outcome.kind == "escaped":
        return outcome
    if codes[0] == 0:
        return outcome
    if codes[0] not in (2, 3):
        last = re.findall(r"^(\w+(?:\.\w+)*(?:Error|Exception)?: .*)$", said, re.MULTILINE)
        return Outcome(
            "escaped", f"exit code {codes[0]}: {(last or [said[-100:]])[-1][:120]}", outcome.seconds
        )
    sentence = said.removesuffix("\n").removesuffix(")").partition(" (see `")[0]
    wrong = wrong_sentence(sentence.partition(": ")[2] or sentence)
    return Outcome("escaped" if wrong else "refused", wrong or sentence, outcome.seconds)


def as_text(content: bytes) -> Any:
    """Return a JSON document of the whole files."""
    return json.loads(content)
