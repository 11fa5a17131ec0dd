"""An angle that wraps, at a turn or at several."""

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.recordings.angle.turning import unwrapped

COUNTS = 4096.0  # a turn


def path(n=4000):
    """Counts of a rotor that goes forth and back over some hundred turns."""
    k = np.arange(n)
    return np.round(200_000.0 * np.sin(2.0 * np.pi * k / n) + 60_000.0 * np.sin(k / 97.0))


@pytest.mark.parametrize("many", [1, 2, 16, 25])
def test_a_counter_of_whole_turns_is_unwrapped(many):
    notes = []
    found = unwrapped("a.csv", "pos", path() % (many * COUNTS), COUNTS, notes)
    np.testing.assert_array_equal(np.diff(found), np.diff(path()))
    assert f"jumps by {'a turn' if many == 1 else f'{many} turns'}" in notes[0].text


def test_a_counter_of_other_turns_is_refused():
    """65536 counts wrap, a turn of 6000 is stated: 10.9 turns."""
    with pytest.raises(BadInput, match="jumps back by 6"):
        unwrapped("a.csv", "pos", path() % 65536.0, 6000.0, [])


def test_counts_taken_for_turns_are_refused():
    with pytest.raises(BadInput, match="are these counts"):
        unwrapped("a.csv", "pos", path() % 65536.0, 1.0, [])
