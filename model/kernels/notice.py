"""One line for whoever waits, "compiling once, ...", when a kernel is compiled and not read from
the cache.

It goes to the logger `sensorless`, which Python prints to stderr unless it is told otherwise.  It
is said once compiling has taken SHORT, with what is known: the processor's time that the functions
of the same command took on this machine, as far as the cache does not hold them.  Other programs
hardly change it, as they do the time on the clock.  Where they take much, it is said what that
comes to with what compiling gets of the processor just now.
"""

from __future__ import annotations

import atexit
import json
import logging
import sys
import threading
import time
from pathlib import Path
from typing import Any

from numba.core import event

from model.kernels.cache import KernelCache
from model.kernels.sources import ROOMS

SHORT = 2.0  # s: less is not worth a word
BUSY = 1.5  # times the processor's time on the clock, from which that is said, too
KEPT = 0.9  # of what it took before: a shorter time may be of one signature of several
LOGGER = logging.getLogger("sensorless")


class Watch(event.Listener):
    """Hears of every function that numba compiles.

    Each is kept with its own time, without that of functions compiled inside it, and by what was
    called: a run that finds a part in the cache says nothing of the rest.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.call = " ".join([Path(sys.argv[0]).name, *sys.argv[1:2]])
        self.heard = self.said = False
        self.seconds = 0.0  # on the clock, in which at least one thread compiled
        # s of the processor of each function, by its module and name
        self.processor: dict[str, float] = {}
        # of a thread: for each level of nested functions, its processor's time where it began, and
        # what of it went into functions inside
        self.own = threading.local()
        self.lock = threading.Lock()
        # threads that compile; since when, by both clocks
        self.active, self.begun, self.used = 0, 0.0, 0.0

    def on_start(self, event: Any) -> None:
        """Say it once, when a function of our own is compiled and this has taken a while."""
        function = event.data["dispatcher"].py_func
        if function.__module__.partition(".")[0] not in ROOMS:
            return
        stack, now = self._stack(), time.perf_counter()
        stack.append([time.thread_time(), 0.0])
        with self.lock:
            if len(stack) == 1:
                if not self.active:
                    self.begun, self.used = now, time.process_time()
                self.active += 1
            late = not self.said and self.seconds + now - self.begun >= SHORT
            self.said = self.said or late
        if not self.heard:
            self.heard = True
            atexit.register(self.remember)
        if late:
            LOGGER.warning("%s", self.sentence(now))

    def sentence(self, now: float) -> str:
        """Return what is said at an instant (s) while something is compiled."""
        expected = sum(s for name, s in self.known().get(self.call, {}).items() if not kept(name))
        if expected <= 2.0 * SHORT:
            return (
                "compiling once, half a minute to some minutes (the next time it is known how long)"
            )
        text = f"compiling once, up to about {expected:.0f} s of the processor"
        with self.lock:
            used, passed = time.process_time() - self.used, now - self.begun
        busy = passed / used if used > 0.0 and passed > 0.5 * SHORT else 1.0
        return text if busy < BUSY else f"{text}, {busy * expected:.0f} s as busy as it is now"

    def on_end(self, event: Any) -> None:
        """Add up the time."""
        stack, now = self._stack(), time.perf_counter()
        function = event.data["dispatcher"].py_func
        if not stack or function.__module__.partition(".")[0] not in ROOMS:
            return
        since, inside = stack.pop()
        took, name = time.thread_time() - since, f"{function.__module__}:{function.__qualname__}"
        if stack:
            stack[-1][1] += took
        with self.lock:
            self.processor[name] = self.processor.get(name, 0.0) + took - inside
            if not stack:
                self.active -= 1
                self.seconds += 0.0 if self.active else now - self.begun

    def _stack(self) -> list[list[float]]:
        """Return the levels of functions that this thread compiles."""
        if not hasattr(self.own, "stack"):
            self.own.stack = []
        found: list[list[float]] = self.own.stack
        return found

    def known(self) -> dict[str, dict[str, float]]:
        """Return the processor's seconds of each function at earlier times, by what was called."""
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))
            return {
                str(call): {str(name): float(seconds) for name, seconds in of.items()}
                for call, of in found.items()
            }
        except (OSError, ValueError, TypeError, AttributeError, OverflowError, RecursionError):
            return {}

    def remember(self) -> None:
        """Keep what it took for the next time."""
        try:
            known = self.known()
            own = known.setdefault(self.call, {})
            for name, took in self.processor.items():
                own[name] = round(max(took, KEPT * own.get(name, 0.0)), 3)
            self.path.write_text(json.dumps(known), encoding="utf-8")
        except OSError:
            return  # a read-only home


def kept(name: str) -> bool:
    """Return whether the cache holds a function (`module:name`), False where that is not known."""
    module, _, of_module = name.partition(":")
    cache = getattr(getattr(sys.modules.get(module), of_module, None), "_cache", None)
    return isinstance(cache, KernelCache) and cache.holds_any()


def watch(folder: Path) -> Watch:
    """Begin to listen; what compiling took is kept in a folder."""
    own = Watch(folder / "compile-seconds-of-functions.json")
    event.register("numba:compile", own)
    return own
