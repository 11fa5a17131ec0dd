"""Whitened residuals against the covariance that they are of."""

import numpy as np
import pytest

from sandbox.replay.segments import blocks, whiten
from sandbox.replay.stretches import Stretch


@pytest.mark.parametrize("rho", [0.0, 0.5, -0.3, 0.9])
def test_squares_are_those_of_the_inverse_covariance(rho):
    """Errors of correlation rho^|k - m| within a block, none from one to the next: x' C^-1 x, and
    the products of two columns, by a dense inverse.  Two stretches give what one does."""
    n, cut = 35, 10
    x = np.random.default_rng(1).standard_normal((n, 3, 2))
    covariance = np.zeros((n, n))
    for first, last in blocks(n, cut):
        k = np.arange(first, last)
        covariance[np.ix_(k, k)] = rho ** np.abs(k[:, None] - k)
    exact = np.einsum("kci,km,mcj->ij", x, np.linalg.inv(covariance), x)
    whole, parts = x.copy(), [x[:20].copy(), x[20:].copy()]
    whiten(whole, rho, Stretch(0, 0, n, n), cut)
    for own, s in zip(parts, (Stretch(0, 0, 20, n), Stretch(0, 20, n, n)), strict=True):
        whiten(own, rho, s, cut)
    np.testing.assert_allclose(np.einsum("kci,kcj->ij", whole, whole), exact, rtol=1e-10)
    np.testing.assert_array_equal(np.concatenate(parts), whole)
