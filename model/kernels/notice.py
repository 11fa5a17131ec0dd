"""One line for whoever waits: "compiling once, up to about N s", when a kernel is compiled and not read from the cache.

It goes to the logger `sensorless`, which Python prints to stderr unless it is told otherwise.  It is said once
compiling has taken SHORT.  N is how long it went on, on this machine, the last time the same program was called with
the same command (time in which several threads compile, or wait for each other, counts once), or USUAL where that was
hardly anything.  Less is compiled, and it is over sooner, where some of it is in the cache.
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

USUAL = 30.0  # s on a machine where nothing has been compiled yet
SHORT = 2.0  # s: less is not worth a word
LOGGER = logging.getLogger("sensorless")


class Watch(event.Listener):
    """Hears of every function that numba compiles; nested ones are part of the outermost."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.call = " ".join([Path(sys.argv[0]).name, *sys.argv[1:2]])
        self.heard = self.said = False
        self.seconds = 0.0  # in which at least one thread compiled
        self.depth = threading.local()
        self.lock = threading.Lock()
        self.active, self.begun = 0, 0.0  # threads that compile, since when there is one

    def on_start(self, event: Any) -> None:
        """Say it once, when a function of our own is compiled and this has taken a while."""
        function = event.data["dispatcher"].py_func
        if function.__module__.partition(".")[0] not in ROOMS:
            return
        level, now = getattr(self.depth, "level", 0), time.perf_counter()
        self.depth.level = level + 1
        with self.lock:
            if level == 0:
                self.begun = self.begun if self.active else now
                self.active += 1
            late = not self.said and self.seconds + now - self.begun >= SHORT
            self.said = self.said or late
        if not self.heard:
            self.heard = True
            atexit.register(self.remember)
        if late:
            expected = self.known().get(self.call, USUAL)
            LOGGER.warning("compiling once, up to about %.0f s", expected if expected > 2.0 * SHORT else USUAL)

    def on_end(self, event: Any) -> None:
        """Add up the time."""
        level = getattr(self.depth, "level", 0)
        if level and event.data["dispatcher"].py_func.__module__.partition(".")[0] in ROOMS:
            self.depth.level = level - 1
            with self.lock:
                self.active -= level == 1
                if level == 1 and not self.active:
                    self.seconds += time.perf_counter() - self.begun

    def known(self) -> dict[str, float]:
        """Return the seconds of earlier times by what was called."""
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))
            return {str(name): float(seconds) for name, seconds in found.items()}
        except (OSError, ValueError, TypeError, AttributeError, OverflowError, RecursionError):
            return {}

    def remember(self) -> None:
        """Keep what it took for the next time."""
        try:
            self.path.write_text(json.dumps(self.known() | {self.call: round(self.seconds, 1)}), encoding="utf-8")
        except OSError:
            return  # a read-only home


def watch(folder: Path) -> None:
    """Begin to listen; what compiling took is kept in a folder."""
    event.register("numba:compile", Watch(folder / "compile-seconds.json"))
