"""A whole run on several workers: which of them compiles what to begin with."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from model.drive_files import Drive


def on_a_map() -> Drive:
    """Return a drive with a flux map, which needs no data: kernels are compiled once more for
    maps."""
    from experiments.spline_twin import twin
    from model.drive_files import load_drive

    return twin(load_drive("ipm_exchanged"))


def compile_replays() -> None:
    """Have the replay's kernels for each number of sets that run side by side, of either motor;
    without a closed loop, which the other worker compiles."""
    from sandbox.replay.grouping import ROOMS
    from sandbox.replay.replay import replay
    from tests.sandbox.plant.stated_duties import DRIVE, duties, from_duties, turning

    for drive in (DRIVE, on_a_map()):
        prepared = from_duties(drive, duties(4), *turning(4))
        for count in ROOMS:
            replay(prepared, [{}] * count)


def compile_loops() -> None:
    """Have the closed loops on both plants: a quartic's are compiled when they are imported, then
    those of a motor with a flux map."""
    for name in ("loop", "switched_loop"):
        importlib.import_module(f"sandbox.drive.{name}")
    from estimators.registry import load_estimator
    from sandbox.drive.scenario import Scenario, Segment
    from sandbox.drive.simulate import simulate

    still = Scenario("still", (Segment(0.01),), start_up=False)
    for belief, plant in (("linear", "exact"), ("saturated", "exact"), ("saturated", "switched")):
        simulate(on_a_map(), still, load_estimator("qnull"), belief=belief, plant=plant)


FIRST = (compile_replays, compile_loops)  # about as long as each other


def compile_share(worker: int, workers: int) -> None:
    """Compile one worker's share of what every worker needs, so that two do not compile the same
    side by side."""
    for task in FIRST[worker::workers]:
        task()


def is_whole(arguments: list[str]) -> bool:
    """Return whether pytest was asked for all tests: a part of them may need no kernel at all."""
    return [Path(a).resolve() for a in arguments] == [Path(__file__).resolve().parent]
