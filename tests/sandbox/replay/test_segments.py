"""Whitened residuals against the covariance that they are of; slopes that come in stretch by
stretch."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from sandbox.replay.inputs import Start
from sandbox.replay.memory import Spill
from sandbox.replay.segments import ChannelSlopes, Gathering, loudest, predictors, whiten
from sandbox.replay.stretches import Stretch, blocks, side_by_side

MIXED = tuple(0.5 * 0.8**h for h in range(1, 7))  # half white, half behind a filter


def covariance_of(colour, n):
    """Return the covariance (n, n) of noise whose further autocorrelations follow from these as an
    autoregression's do."""
    r, weights = [1.0, *colour], np.linalg.solve(toeplitz([1.0, *colour[:-1]]), colour)
    while len(r) < n:
        r.append(float(weights @ r[: -len(colour) - 1 : -1]))
    return toeplitz(r[:n])


@pytest.mark.parametrize("colour", [(), (0.5,), (-0.3,), (0.9, 0.81), (0.5, 0.1, 0.3), MIXED])
def test_squares_are_those_of_the_inverse_covariance(colour):
    """Errors go together within a block, none from one to the next: x' C^-1 x, and the products of
    two columns, by a dense inverse.  Two stretches give what one does."""
    n, cut = 35, 10
    x = np.random.default_rng(1).standard_normal((n, 3, 2))
    covariance = np.eye(n)
    for first, last in blocks(n, cut) if colour else ():
        covariance[first:last, first:last] = covariance_of(colour, last - first)
    exact = np.einsum("kci,km,mcj->ij", x, np.linalg.inv(covariance), x)
    whole, parts = x.copy(), [x[:20].copy(), x[20:].copy()]
    whiten(whole, colour, Stretch(0, 0, n, n), cut)
    for own, s in zip(parts, (Stretch(0, 0, 20, n), Stretch(0, 20, n, n)), strict=True):
        whiten(own, colour, s, cut)
    np.testing.assert_allclose(np.einsum("kci,kcj->ij", whole, whole), exact, rtol=1e-9)
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_what_no_noise_can_have_counts_up_to_where_some_can():
    """Partial correlations, by hand: of 0.5 and -0.45 (-0.45 - 0.25)/0.75 = -0.93; of 0.9 and -0.9
    (-0.9 - 0.81)/0.19 = -9."""
    assert len(predictors((0.5, -0.45))) == 3
    assert len(predictors((0.9, -0.9, 0.1))) == 2


def test_stretches_side_by_side_by_hand():
    """Two recordings at a time, the shorter one is done first; one that is to stay whole does."""
    found = side_by_side([25, 40, 10], [10.0, np.inf, 10.0], 10, 2)
    assert found == [
        [(0, 0, 10, 25), (1, 0, 40, 40)],
        [(0, 10, 25, 25)],
        [(2, 0, 10, 10)],
    ]


@pytest.mark.parametrize("colour", [(), (0.5, 0.1)])
@pytest.mark.parametrize("waits", [False, True])
def test_an_unread_start_is_taken_off_whatever_the_stretches_are(colour, waits):
    """Slopes and residuals of one recording in three stretches, the start's answers longer than the
    first: squares as of all at once, where a dense projection takes off the answers first."""
    draw, n, cut, p, m = np.random.default_rng(2), 40, 10, 3, 17
    j, r = draw.standard_normal((n, 3, p)), draw.standard_normal((n, 3))
    shape = np.linalg.qr(draw.standard_normal((3 * m, 2)))[0].reshape(m, 3, 2)
    start = Start(shape, np.array([0.9, 0.4]))
    spill = Spill(8.0 * n * 3 * p) if waits else None
    own = Gathering(0, p, 3 * n, colour, start)
    scale = np.array([2.0, 1.0, -1.0])
    for first, last in ((0, 10), (10, 30), (30, 40)):
        part = ChannelSlopes(
            "current",
            j[first:last].copy(),
            r[first:last].copy(),
            np.arange(p),
            scale,
            np.arange(p),
        )
        own.add(part, spill, Stretch(0, first, last, n), cut)
    segment, rows = own.squared(0, part, spill, cut)
    whole = np.concatenate([j * scale, r[:, :, None]], axis=2)
    along = shape.reshape(-1, 2)
    flat = whole[:m].reshape(3 * m, -1)
    whole[:m] -= (along * start.share @ (along.T @ flat)).reshape(m, 3, -1)
    whiten(whole, colour, Stretch(0, 0, n, n), cut)
    blockwise = whole.reshape(4, 30, p + 1)
    squares = np.einsum("bki,bkj->bij", blockwise, blockwise)
    np.testing.assert_allclose(segment.a, squares[:, :p, :p], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(segment.g, squares[:, :p, p], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(segment.ssr, squares[:, p, p], rtol=1e-12)
    np.testing.assert_allclose(np.asarray(rows), whole[:, :, :p].reshape(-1, p), atol=1e-12)


@pytest.mark.parametrize("rho", [0.8, -0.3])
def test_errors_are_loudest_where_their_autoregression_has_most_power(rho):
    """x_k = rho x_k-1 + e has the power (1 - rho^2)/|1 - rho exp(-j w)|^2, at most (1 + |rho|)/(1 -
    |rho|): at w = 0, for a negative one at pi."""
    most = (1.0 + abs(rho)) / (1.0 - abs(rho))
    assert loudest(tuple(rho**h for h in range(1, 7))) == pytest.approx(most, rel=1e-9)
    assert loudest(()) == 1.0
