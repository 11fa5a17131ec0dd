"""A whole run on several workers: which of them compiles what to begin with."""

from __future__ import annotations

import importlib
from pathlib import Path


def compile_replays(rooms: slice) -> None:
    """Have the replay's kernels for some of the numbers of sets that run side by side."""
    from sandbox.replay.grouping import ROOMS
    from sandbox.replay.replay import replay
    from tests.sandbox.plant.told import DRIVE, duties, told, turning

    prepared = told(DRIVE, duties(4), *turning(4))
    for count in ROOMS[rooms]:
        replay(prepared, [{}] * count)


def compile_wide() -> None:
    """Have the replays of some sets and of many."""
    compile_replays(slice(1, None))


def compile_narrow() -> None:
    """Have the closed loops on both plants, compiled when they are imported, and the replay of one set, which shares
    most of its functions with them."""
    for name in ("loop", "switched_loop"):
        importlib.import_module(f"sandbox.drive.{name}")
    compile_replays(slice(1))


FIRST = (compile_wide, compile_narrow)  # about as long as each other


def compile_share(worker: int, workers: int) -> None:
    """Compile one worker's share of what every worker needs, so that two do not compile the same side by side."""
    for task in FIRST[worker::workers]:
        task()


def is_whole(arguments: list[str]) -> bool:
    """Return whether pytest was asked for all tests: a part of them may need no kernel at all."""
    return [Path(a).resolve() for a in arguments] == [Path(__file__).resolve().parent]
