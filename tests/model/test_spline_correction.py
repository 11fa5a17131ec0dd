"""Energies that may be added to a flux map's: against the cells they are written as, and those
against the coarse ones.

Gradients of the basis are SciPy's; `model.spline` evaluates cells by its own code, checked against
SciPy elsewhere.
"""

import numpy as np
import pytest

from model.spline import SplineEnergy, currents, energy
from model.spline_correction import Basis, refined

LOW_D, LOW_Q, PER_D, PER_Q = -0.1, -0.15, 20.0, 20.0
FLUX = np.random.default_rng(1).uniform([LOW_D, LOW_Q], [0.2, 0.15], size=(60, 2))


def a_map() -> SplineEnergy:
    """Return cells of 6 along d and 6 along q, polynomials that have nothing to do with each
    other."""
    cells = np.random.default_rng(0).normal(size=(6, 6, 5, 5))
    return SplineEnergy(cells, LOW_D, LOW_Q, PER_D, PER_Q)


@pytest.mark.parametrize("parts", [(2, 1), (3, 2)])
def test_finer_cells_hold_the_same_energy(parts):
    coarse = a_map()
    fine = refined(coarse, *parts)
    assert fine.cells.shape[:2] == (6 * parts[0], 6 * parts[1])
    for d, q in FLUX:
        assert energy(fine, d, q) == pytest.approx(energy(coarse, d, q), rel=1e-10, abs=1e-10)
        assert currents(fine, d, q) == pytest.approx(currents(coarse, d, q), rel=1e-9, abs=1e-8)


def test_the_basis_is_what_its_cells_say_and_even_in_q():
    basis = Basis(refined(a_map(), 2, 1))
    chosen = np.random.default_rng(2).choice(basis.size, 12, replace=False)
    cells = basis.cells(np.eye(basis.size)[chosen])
    found, mirrored = basis.gradients(FLUX, chosen), basis.gradients(FLUX * [1.0, -1.0], chosen)
    for k in range(len(chosen)):
        own = basis.of._replace(cells=np.ascontiguousarray(cells[..., k]))
        got = np.array([currents(own, d, q) for d, q in FLUX])
        np.testing.assert_allclose(found[:, k], got, rtol=1e-9, atol=1e-9 * PER_D)
    np.testing.assert_allclose(mirrored, found * [1.0, -1.0], rtol=1e-9, atol=1e-9 * PER_D)


def test_energies_that_are_there_are_those_that_move_a_current():
    basis = Basis(a_map())
    found = np.isin(np.arange(basis.size), basis.there(FLUX[:2]))
    moves = np.any(basis.gradients(FLUX[:2], np.arange(basis.size)) != 0.0, axis=(0, 2))
    assert not np.any(moves & ~found)
    # an energy that is flat at each of the fluxes
    assert found.sum() <= moves.sum() + 4 < basis.size


def test_energies_tell_their_sizes():
    """A sum of all energies, known at a basis' own places, gives its sizes back."""
    basis = Basis(refined(a_map(), 2, 1))
    sizes = np.random.default_rng(3).normal(size=(basis.size, 1))
    whole = basis.of._replace(cells=np.ascontiguousarray(basis.cells(sizes.T)[..., 0]))
    d, q = (basis.places(axis) for axis in (0, 1))
    flux = np.array([(x, y) for x in d for y in q if y >= 0.0])
    inside = np.nextafter(flux, 0.0)  # of the box' edge
    own = np.array([[energy(whole, x, y)] for x, y in inside])
    np.testing.assert_allclose(basis.sizes(own), sizes, rtol=1e-6, atol=1e-8)
