"""Intervals of shares: none where the recordings do not show one, so no interval of width zero
stands on a page."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.pages.listed import rows
from sandbox.gap.report.shares import Share, shares_of

NOISE = 1000.0  # readings a recording


def set_of(a, b):
    """Return the shares of two effects that add `a` and `b`, squares a recording, to the noise,
    each by itself."""
    left = {("a", "b"): a + b, ("a",): a, ("b",): b, (): 0.0 * a}
    noise = NOISE + 0.0 * a
    return shares_of(("a", "b"), lambda gone: noise + left[tuple(gone)], noise, 1.0)


def test_shares_of_effects_that_add_are_their_squares():
    """Of six recordings of one gap each, a has 0.5 to 1.0: the mean is 0.75, that of six draws is
    off by 0.07 (standard deviation 0.171 over the root of six), so that 95 % lie within 0.14."""
    size = np.full(6, NOISE)
    found = set_of(np.linspace(0.5, 1.0, 6) * size, np.linspace(0.5, 0.0, 6) * size)
    assert found["a"].value == pytest.approx(0.75)
    # of 400 draws, in steps of 1/60
    assert found["a"].ci95 == pytest.approx([0.75 - 0.14, 0.75 + 0.14], abs=0.03)
    assert found["b"].ci95 == pytest.approx([0.25 - 0.14, 0.25 + 0.14], abs=0.03)


@pytest.mark.parametrize(
    ("count", "showing", "there"), [(1, 1, False), (12, 1, False), (12, 2, False), (12, 4, True)]
)
def test_few_recordings_with_the_gap_give_no_interval(count, showing, there):
    """Of twelve, (11/12)^12 = 35 % of the draws miss the one that has it, (10/12)^12 = 11 % miss
    two, and (8/12)^12 = 0.8 % miss four: above and below one in twenty."""
    size = np.zeros(count)
    size[:showing] = NOISE
    found = set_of(0.55 * size, 0.45 * size)
    assert found["a"].value == pytest.approx(0.55)
    assert (found["a"].ci95 is not None) == there


def test_effects_that_take_nothing_off_have_no_interval_and_no_warning(recwarn):
    """No draw has a share of nothing: numpy's "All-NaN slice" once reached the terminal."""
    found = set_of(np.zeros(6), np.zeros(6))
    assert found["a"].ci95 is None
    assert not recwarn.list


def test_a_share_without_interval_stands_alone_in_the_list():
    r = SimpleNamespace(
        inclusion=SimpleNamespace(chances={"dead_time": 1.0}),
        sizes=lambda e: {},
        unknown=0.0,
        shares=SimpleNamespace(of={"dead_time": Share(0.55, math.nan, math.nan, 0.5)}),
    )
    assert rows(r)[0][2] == "55.0 %"
