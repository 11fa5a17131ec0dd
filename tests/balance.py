"""A whole run on several workers: which of them compiles what to begin with."""

from __future__ import annotations

import importlib
from pathlib import Path


def compile_replays() -> None:
    """Have the replay's kernels: for one set, for few and for many."""
    from sandbox.replay.grouping import ROOMS
    from sandbox.replay.replay import replay
    from tests.sandbox.plant.told import DRIVE, duties, told, turning

    prepared = told(DRIVE, duties(4), *turning(4))
    for count in ROOMS:
        replay(prepared, [{}] * count)


def compile_loops() -> None:
    """Have the closed loops on both plants, which are compiled when they are imported."""
    for name in ("loop", "switched_loop"):
        importlib.import_module(f"sandbox.drive.{name}")


FIRST = (compile_replays, compile_loops)  # about as long as each other


def compile_share(worker: int, workers: int) -> None:
    """Compile one worker's share of what every worker needs, so that two do not compile the same side by side."""
    for task in FIRST[worker::workers]:
        task()


def is_whole(arguments: list[str]) -> bool:
    """Return whether pytest was asked for all tests: a part of them may need no kernel at all."""
    return [Path(a).resolve() for a in arguments] == [Path(__file__).resolve().parent]
