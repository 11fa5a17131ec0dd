"""Places in arrays of state: none stands for two things."""

import pytest

from sandbox.drive import control, loop
from sandbox.switched import bench_state
from sandbox.switched.bench_state import MOST_READINGS, ROOM, Slot

# what has several numbers, by the first of its places
SEVERAL = {
    bench_state.Slot: {
        **dict.fromkeys(("LAST_DUTY", "LEVEL", "WANTED", "CARRIED", "SHIFT", "LAST_SHIFT"), 3),
        **{
            "CORES": 3,
            "SAMPLES": 6,
            "EDGES": 3 * ROOM,
            "MODES": 14,
            "READINGS": 1 + 2 * MOST_READINGS,
        },
    },
    control.Slot: dict.fromkeys(("RING_D", "RING_Q"), control.MAX_PERIOD),
    loop.Memory: {"ENCODER": 3},
}
SIZES = {Slot: bench_state.SIZE, control.Slot: control.SIZE, loop.Memory: loop.MEMORY}


@pytest.mark.parametrize("slots", SIZES, ids=["bench", "controller", "loop"])
def test_each_place_holds_one_thing_and_none_is_left_over(slots):
    taken = [
        place + k
        for name, place in slots._asdict().items()
        for k in range(SEVERAL[slots].get(name, 1))
    ]
    assert sorted(taken) == list(range(SIZES[slots]))
