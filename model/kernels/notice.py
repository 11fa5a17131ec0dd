"""One line for whoever waits, "compiling once, ...", when a kernel is compiled and not read from
the cache.

It goes to the logger `sensorless`, which Python prints to stderr unless it is told otherwise.  It
is said once compiling has taken SHORT, with what is known: the processor's time that it took on
this machine when the same program was called with the same command, which other programs hardly
change, as they do the time on the clock.  Where they take much, it is said what that comes to with
what compiling gets of the processor just now.  Less is compiled, and it is over sooner, where some
of it is in the cache.
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

from model.kernels.sources import ROOMS

SHORT = 2.0  # s: less is not worth a word
BUSY = 1.5  # times the processor's time on the clock, from which that is said, too
KEPT = 0.9  # of what it took before: a shorter time may be of a part
LOGGER = logging.getLogger("sensorless")


class Watch(event.Listener):
    """Hears of every function that numba compiles; nested ones are part of the outermost."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.call = " ".join([Path(sys.argv[0]).name, *sys.argv[1:2]])
        self.heard = self.said = False
        self.seconds = 0.0  # on the clock, in which at least one thread compiled
        self.processor = 0.0  # s of the processor, of the threads that compiled
        # of a thread: level of nested functions, its processor's time where they began
        self.own = threading.local()
        self.lock = threading.Lock()
        # threads that compile; since when, by both clocks
        self.active, self.begun, self.used = 0, 0.0, 0.0

    def on_start(self, event: Any) -> None:
        """Say it once, when a function of our own is compiled and this has taken a while."""
        function = event.data["dispatcher"].py_func
        if function.__module__.partition(".")[0] not in ROOMS:
            return
        level, now = getattr(self.own, "level", 0), time.perf_counter()
        self.own.level = level + 1
        with self.lock:
            if level == 0:
                self.own.since = time.thread_time()
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
        expected = self.known().get(self.call, 0.0)
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
        level, now = getattr(self.own, "level", 0), time.perf_counter()
        if level and event.data["dispatcher"].py_func.__module__.partition(".")[0] in ROOMS:
            self.own.level = level - 1
            with self.lock:
                if level == 1:
                    self.active -= 1
                    self.processor += time.thread_time() - self.own.since
                if level == 1 and not self.active:
                    self.seconds += now - self.begun

    def known(self) -> dict[str, float]:
        """Return the processor's seconds of earlier times by what was called."""
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))
            return {str(name): float(seconds) for name, seconds in found.items()}
        except (OSError, ValueError, TypeError, AttributeError, OverflowError, RecursionError):
            return {}

    def remember(self) -> None:
        """Keep what it took for the next time."""
        try:
            before = self.known()
            took = max(self.processor, KEPT * before.get(self.call, 0.0))
            self.path.write_text(json.dumps(before | {self.call: round(took, 1)}), encoding="utf-8")
        except OSError:
            return  # a read-only home


def watch(folder: Path) -> Watch:
    """Begin to listen; what compiling took is kept in a folder."""
    own = Watch(folder / "compile-processor-seconds.json")
    event.register("numba:compile", own)
    return own
