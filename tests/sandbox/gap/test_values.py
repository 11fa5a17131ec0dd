"""Numbers of the diagnosis by hand: what its constants do to small equations that fit on a line."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from sandbox.gap.evidence.algebra import algebra, prior_of
from sandbox.gap.evidence.holdout import worst_share
from sandbox.gap.evidence.normal import Normal, Segment
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.search.estimates import estimates

US = 1e-6  # s


def equations(coordinates, *parts):
    """Return normal equations of (recording, A, g) each, one block, around zero."""
    p = len(coordinates)
    segments = tuple(
        Segment(k, "current", np.arange(p), np.array([a], dtype=float), np.array([g], dtype=float), np.zeros(1),
                np.ones(1)) for k, a, g in parts
    )  # fmt: skip
    return Normal(tuple(coordinates), np.zeros(p), segments, 1.0)


def dead_time(deviation=US):
    return Coordinate("dead_time.time", 0.0, deviation, "linear", ("dead_time.time",))


@pytest.mark.parametrize("moved", [0.0, 0.8])
def test_an_interval_by_hand(moved):
    """Curve 3, pull 6, prior deviation 1 (units of 1 us): value 6/(3 + 1) = 1.5, variance 1/4; scores that scatter less
    than that leave it.  Half the interval: the normal's 97.5 % point times the root of 1.15^2/4 and the square of half
    the 0.8 by which other effects' traces would move it."""
    own = equations([dead_time()], (0, [[3.0 / US**2]], [6.0 / US]))
    beside = equations([dead_time()], (0, [[3.0 / US**2]], [(6.0 - 4.0 * moved) / US]))  # at 1.5 - moved
    prior = prior_of(own.coordinates)
    fit = SimpleNamespace(normal=own, coordinates=own.coordinates, point=SimpleNamespace(values={}))
    j = SimpleNamespace(fit=fit, equations=algebra(beside), normal=beside, prior=prior, effects=("dead_time",))
    found = estimates(j)["dead_time.time"]
    half = norm.ppf(0.975) * np.sqrt(1.15**2 / 4.0 + (0.5 * moved) ** 2)
    assert found.value == pytest.approx(1.5 * US)
    assert (found.low, found.high) == (pytest.approx((1.5 - half) * US), pytest.approx((1.5 + half) * US))
    assert found.unit == "s"
    assert not found.at_bound


@pytest.mark.parametrize(("left", "share"), [((1,), 0.4), ((0,), 11.0 / 101.0), ((2,), 0.0)])
def test_what_holding_out_a_recording_costs(left, share):
    """One coordinate of deviation 1, A = 90, 10 and 0.  Without the second recording the fit keeps 91/101 of its
    variance and the check feels 10/100, which counts four times: 0.4.  Without the first the fit keeps 11/101 (and the
    check 4 times 0.9).  The third feels nothing."""
    own = [Coordinate("x", 0.0, 1.0, "linear", ("bench.x",))]
    n = equations(own, (0, [[90.0]], [0.0]), (1, [[10.0]], [0.0]), (2, [[0.0]], [0.0]))
    assert worst_share(n, left, [["x"]]) == pytest.approx(share)


def test_what_the_campaign_cannot_tell_spares_no_recording():
    """Information below 1 over the prior's variance: the group does not count; of no group the share is 0."""
    own = [Coordinate("x", 0.0, 1.0, "linear", ("bench.x",)), Coordinate("y", 0.0, 0.1, "linear", ("bench.y",))]
    n = equations(own, (0, np.diag([2.0, 99.0]), [0.0] * 2), (1, np.diag([2.0, 0.0]), [0.0] * 2))
    assert worst_share(n, (1,), [["x"], ["y"]]) == pytest.approx(3.0 / 5.0)
    assert worst_share(n, (1,), [["y"]]) == 0.0
