"""What workers compile to begin with: each kernel by one of them, however many there are."""

from __future__ import annotations

import pytest

from sandbox.replay.grouping import ROOMS
from tests import balance


def test_shares_hold_the_loops_and_every_room_of_both_kinds_of_motor_once():
    tasks = [task for share in balance.SHARES for task in share]
    replays = [task.args for task in tasks if task is not balance.compile_loops]
    rooms = sorted((mapped, room) for mapped, some in replays for room in ROOMS[some])
    assert rooms == [(mapped, room) for mapped in (False, True) for room in ROOMS]
    assert tasks.count(balance.compile_loops) == 1


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_each_share_is_compiled_by_one_worker(workers, monkeypatch):
    called = []
    monkeypatch.setattr(balance, "SHARES", tuple((lambda k=k: called.append(k),) for k in "ab"))
    for worker in range(workers):
        balance.compile_share(worker, workers)
    assert sorted(called) == ["a", "b"]
