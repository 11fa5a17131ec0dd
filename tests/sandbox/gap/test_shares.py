"""Intervals of shares: none where the recordings do not show one, so no interval of width zero stands on a page."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.pages.listed import rows
from sandbox.gap.report import shares
from sandbox.gap.report.shares import Share, of_set

NOISE = 1000.0  # readings a recording


def set_of(monkeypatch, a, b):
    """The shares of two effects that add `a` and `b`, squares a recording, to the noise, each by itself."""
    left = {("a", "b"): a + b, ("a",): a, ("b",): b, (): 0.0 * a}
    monkeypatch.setattr(shares, "_replayed", lambda j, gone: NOISE + left[tuple(sorted(gone))])
    monkeypatch.setattr(shares, "_left", lambda n: NOISE + 0.0 * a)
    monkeypatch.setattr(shares, "_counts", lambda n: NOISE + 0.0 * a)
    return of_set(SimpleNamespace(effects=("a", "b"), fit=SimpleNamespace(normal=None)), 1.0)


def test_shares_of_effects_that_add_are_their_squares(monkeypatch):
    """Three to one in each of six recordings, so in each draw of them, too."""
    size = np.linspace(1.0, 2.0, 6) * NOISE
    found = set_of(monkeypatch, 0.75 * size, 0.25 * size)
    assert found["a"].value == pytest.approx(0.75)
    assert found["b"].ci95 == pytest.approx([0.25, 0.25])


@pytest.mark.parametrize("count", [1, 12])
def test_one_recording_with_the_gap_gives_no_interval(monkeypatch, count):
    """Of twelve, (11/12)^12 = 35 % of the draws miss the one that has it."""
    size = np.zeros(count)
    size[0] = NOISE
    found = set_of(monkeypatch, 0.55 * size, 0.45 * size)
    assert found["a"].value == pytest.approx(0.55)
    assert found["a"].ci95 is None


def test_a_share_without_interval_stands_alone_in_the_list():
    r = SimpleNamespace(
        inclusion=SimpleNamespace(chances={"dead_time": 1.0}), sizes=lambda e: {}, unknown=0.0,
        shares=SimpleNamespace(of={"dead_time": Share(0.55, math.nan, math.nan, 0.5)}),
    )  # fmt: skip
    assert rows(r)[0][2] == "55.0 %"
