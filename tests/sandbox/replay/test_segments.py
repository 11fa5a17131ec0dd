"""Whitened residuals against the covariance that they are of."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from sandbox.replay.segments import predictors, whiten
from sandbox.replay.stretches import Stretch, blocks

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
