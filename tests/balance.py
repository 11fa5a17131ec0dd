"""A whole run on several workers: which of them compiles what to begin with."""

from __future__ import annotations

import importlib
from functools import partial
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


def compile_replays(mapped: bool, rooms: slice) -> None:
    """Have the replay's kernels of a quartic motor, or of one with a flux map, for some of the
    numbers of sets that run side by side; without a closed loop."""
    from sandbox.replay.grouping import ROOMS
    from sandbox.replay.replay import replay
    from tests.sandbox.plant.stated_duties import DRIVE, duties, from_duties, turning

    prepared = from_duties(on_a_map() if mapped else DRIVE, duties(4), *turning(4))
    for count in ROOMS[rooms]:
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


# about as long as each other, as a worker that is done first waits for the other: 110 and 120 s of
# CPU on a busy machine, of which a quartic's replays take 85 s, the loops 85 s
SHARES = (
    (partial(compile_replays, False, slice(None)), partial(compile_replays, True, slice(2, None))),
    (compile_loops, partial(compile_replays, True, slice(2))),
)


def compile_share(worker: int, workers: int) -> None:
    """Compile one worker's share of what every worker needs, so that two do not compile the same
    side by side."""
    for share in SHARES[worker::workers]:
        for task in share:
            task()


def is_whole(arguments: list[str]) -> bool:
    """Return whether pytest was asked for all tests: a part of them may need no kernel at all."""
    return [Path(a).resolve() for a in arguments] == [Path(__file__).resolve().parent]
