"""One line for whoever waits, "compiling once, ...", when a kernel is compiled and not read from
the cache.

It goes to the logger `sensorless`, which Python prints to stderr unless it is told otherwise.  It
is said once compiling has taken SHORT, with the processor's time that all of it will take: what it
took before on this machine, or where this command was never called here, on another one (`usual`),
by as much longer or shorter as the kernels compiled so far took.  Other programs hardly change the
processor's time, as they do the time on the clock.  Where they take much, it is said what that
comes to with what compiling gets of the processor just now.
"""

from __future__ import annotations

import atexit
import logging
import multiprocessing
import sys
import threading
import time
from pathlib import Path
from typing import Any

from numba.core import event

from model.kernels.cache import ASKED, KernelCache, Name
from model.kernels.memory import Memory

SHORT = 2.0  # s: less is not worth a word
BUSY = 1.5  # times the processor's time on the clock, from which that is said, too
USUAL = Path(__file__).with_name("usual.json")  # by `python -m experiments.compile_seconds`
PROGRAM = ("sensorless", "__main__.py")
LOGGER = logging.getLogger("sensorless")


class Watch(event.Listener):
    """Hears of every kernel that is asked for, and how long one takes that is compiled: its own
    time, without that of kernels inside it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.command = command()
        self.said = False
        self.seconds = 0.0  # on the clock, in which at least one thread compiled
        # asked for by Python, in this order; of those compiled, the processor's time (s) and what
        # was asked for meanwhile; all that were asked for
        self.asked: dict[Name, None] = {}
        self.took: dict[Name, float] = {}
        self.inside: dict[Name, list[Name]] = {}
        self.met: set[Name] = set()
        # of a thread: for each level of nested kernels its name, the thread's processor time where
        # it began, and what of it went into kernels inside
        self.own = threading.local()
        self.lock = threading.Lock()
        # threads that compile; since when, by both clocks
        self.active, self.begun, self.used = 0, 0.0, 0.0

    def on_start(self, event: Any) -> None:
        """Note what is asked for; say it once, when a kernel is compiled and this has taken a
        while."""
        if event.kind == ASKED:
            self._note(event.data)
            return
        if (name := _name(event)) is None:
            return
        stack, now = self._stack(), time.perf_counter()
        stack.append([name, time.thread_time(), 0.0])
        with self.lock:
            self.inside.setdefault(name, [])
            if len(stack) == 1:
                if not self.active:
                    self.begun, self.used = now, time.process_time()
                self.active += 1
            late = not self.said and self.seconds + now - self.begun >= SHORT
            self.said = self.said or late
        if late:
            LOGGER.warning("%s", self.sentence(now))

    def _note(self, name: Name) -> None:
        """Note that a kernel is asked for, by another one or by Python."""
        stack = self._stack()
        with self.lock:
            if not self.met:
                atexit.register(self.remember)
            self.met.add(name)
            if stack:
                self.inside[stack[-1][0]].append(name)
            else:
                self.asked[name] = None

    def sentence(self, now: float) -> str:
        """Return what is said at an instant (s) while something is compiled."""
        expected = self.expected()
        if expected <= 2.0 * SHORT:
            return "compiling once (the next time it is known how long)"
        text = f"compiling once, about {expected:.0f} s of the processor"
        with self.lock:
            used, passed = time.process_time() - self.used, now - self.begun
        busy = passed / used if used > 0.0 and passed > 0.5 * SHORT else 1.0
        return text if busy < BUSY else f"{text}, {busy * expected:.0f} s as busy as it is now"

    def expected(self) -> float:
        """Return the processor's time (s) that this call's kernels take: what they took so far, and
        what those take that are left."""
        with self.lock:
            took, asked = dict(self.took), list(self.asked)
        known = self.known()
        for memory in (known, Memory.read(USUAL.read_text(encoding="utf-8"))):
            if course := memory.course_of(self.command, asked):
                return sum(took.values()) + memory.left([*course, *asked], took, known)
        return 0.0

    def on_end(self, event: Any) -> None:
        """Add up the time."""
        stack, now = self._stack(), time.perf_counter()
        if not stack or _name(event) is None:
            return
        name, since, inside = stack.pop()
        took = time.thread_time() - since
        if stack:
            stack[-1][2] += took
        with self.lock:
            self.took[name] = self.took.get(name, 0.0) + took - inside
            if not stack:
                self.active -= 1
                self.seconds += 0.0 if self.active else now - self.begun

    def _stack(self) -> list[list[Any]]:
        """Return the levels of kernels that this thread compiles."""
        if not hasattr(self.own, "stack"):
            self.own.stack = []
        found: list[list[Any]] = self.own.stack
        return found

    def known(self) -> Memory:
        """Return what is known of earlier times on this machine."""
        try:
            return Memory.read(self.path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return Memory()

    def remember(self) -> None:
        """Keep what it took, and what was asked for, for the next time."""
        memory = self.known()
        before = memory.courses.get(self.command, [()])[-1]
        if before == tuple(self.asked) and not self.took:
            return
        memory.keep(self.command, self.asked, self.inside, self.took, self.met)
        try:
            self.path.write_text(memory.text(), encoding="utf-8")
        except OSError:
            return  # a read-only home


def _name(event: Any) -> Name | None:
    """Return which kernel is compiled; None for functions that are not kept."""
    cache = event.data["dispatcher"]._cache
    return cache.named(event.data["args"]) if isinstance(cache, KernelCache) else None


def command() -> str:
    """Return what this process was called with: a command's name, else a script's; a part of it
    where another process has started this one."""
    script, *words = [Path(sys.argv[0]).name, *sys.argv[1:2]]
    own = "".join(words) if script in PROGRAM else script
    return own if multiprocessing.parent_process() is None else f"{own}, a part"


def watch(folder: Path) -> Watch:
    """Begin to listen; what compiling took is kept in a folder."""
    own = Watch(folder / "compiling.json")
    event.register("numba:compile", own)
    event.register(ASKED, own)
    return own
