"""Many tasks on several processes: one that dies costs one item.  A process started imports this
file: it is light."""

import os

import pytest

from sandbox.engine.processes import ALONE, Workers, spread


def die_on_three(x):
    """Square a number; a process that meets 3 dies at once, without a word."""
    if x == 3:
        os._exit(9)
    return x * x


def test_a_process_that_dies_costs_one_item():
    assert sorted(spread(die_on_three, range(6), Workers(2), lambda x: -x)) == [-3, 0, 1, 4, 16, 25]
    with pytest.raises(RuntimeError, match="process"):  # BrokenProcessPool
        list(spread(die_on_three, range(6), Workers(2)))


def test_one_job_and_a_single_item_survive_it_too():
    """Without somebody to tell, a single job stays in this process: nothing to start."""
    assert sorted(spread(die_on_three, [2, 3, 4], ALONE, lambda x: -x)) == [-3, 4, 16]
    assert list(spread(die_on_three, [3], Workers(2), lambda x: -x)) == [-3]
    assert list(spread(lambda x: os.getpid(), [1, 2])) == [os.getpid()] * 2


def test_all_cores_work_where_no_number_is_asked_for(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert Workers.asked(None).jobs == 7
    assert Workers.asked(3) == Workers(3)
    assert not Workers.asked(1, "tcp://10.0.0.1:8786").alone
