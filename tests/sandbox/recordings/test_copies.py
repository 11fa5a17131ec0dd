"""Rows that stand in two recordings are found, whole or in part, and nothing else is."""

import numpy as np
import pytest

from sandbox.recordings.copies import WINDOW, Copied, copied, own_rows

RNG = np.random.default_rng(3)


def noisy(n):
    return RNG.normal(size=(2, n))


def test_a_whole_copy_is_found():
    a = noisy(900)
    assert copied([list(a), list(a.copy())]) == [Copied(1, 0, 0, 900, 0)]


@pytest.mark.parametrize("rows", [2 * WINDOW, 500])
def test_a_stretch_that_stands_elsewhere_is_found_to_the_row(rows):
    a, before, after = noisy(1000), noisy(301), noisy(77)
    b = np.concatenate([before, a[:, 444 : 444 + rows], after], axis=1)
    assert copied([list(a), list(b)]) == [Copied(1, 0, 301, 301 + rows, 444)]


@pytest.mark.parametrize("places", [2, 4])
def test_a_copy_with_other_digits_is_found(places):
    a = noisy(900)
    assert copied([list(a), list(np.round(a, places))]) == [Copied(1, 0, 0, 900, 0)]
    assert copied([list(a), list(a.astype(np.float32).astype(float))]) == [Copied(1, 0, 0, 900, 0)]


def test_one_experiment_twice_is_no_copy():
    """An injection that is the same in both, noise of a hundredth, digits coarser than that."""
    ripple = np.tile([1.0, 1.0, -1.0, -1.0], 225)
    one, two = (np.round(ripple + 0.01 * noisy(900), d) for d in (5, 2))
    assert copied([list(one), list(two)]) == []


def test_signals_at_rest_are_no_copies():
    rest = np.zeros((2, 2000))
    assert copied([list(rest), list(rest)]) == []


def test_other_noise_is_no_copy():
    assert copied([list(noisy(800)), list(noisy(800)), list(noisy(30))]) == []


def test_what_is_its_own_is_kept():
    assert own_rows(Copied(1, 0, 0, 900, 0), 900) is None
    assert own_rows(Copied(1, 0, 0, 300, 0), 900) == slice(300, 900)
    assert own_rows(Copied(1, 0, 500, 900, 0), 900) == slice(0, 500)
