"""Fuzzing in child processes: a crash and a hang are escapes at their input, what was counted
before stays."""

import os
import signal
import time

import pytest

from experiments.fuzz import Count, in_child
from tests.fuzz.doors import Outcome

GOOD = Outcome("refused", "a sentence", 0.01)


def crash(count):
    """Two inputs, then a signal that no Python code sees."""
    count.add(GOOD)
    count.add(GOOD)
    os.kill(os.getpid(), signal.SIGKILL)


def hang(count):
    """One input, then silence."""
    count.add(GOOD)
    time.sleep(60.0)


def hungry(count):
    """More memory than an input may take ends in MemoryError, not in a machine without memory."""
    try:
        bytearray(8_000_000_000)
    except MemoryError:
        count.add(Outcome("refused", "no memory", 0.0))


@pytest.mark.parametrize(
    ("work", "kinds", "why"),
    [(crash, (2, 1), "exit code -9"), (hang, (1, 1), "heard no alarm"), (hungry, (1, 0), "")],
)
def test_what_becomes_of_a_child(work, kinds, why):
    found = in_child(work, Count({"next": 10}), silent=10.0)
    assert (found.kinds["refused"], found.kinds["escaped"]) == kinds
    assert found.next == 10 + sum(kinds)
    assert [e["number"] for e in found.escapes.values()] == ([10 + kinds[0]] if why else [])
    assert all(why in e["why"] for e in found.escapes.values())
