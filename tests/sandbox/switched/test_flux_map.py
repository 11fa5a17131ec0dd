"""The switched bench shares no physics with the plant: its own flux-map evaluation, and what it may
import."""

import ast
from pathlib import Path

import numpy as np
import pytest

from model import spline
from model.spline import SplineEnergy
from sandbox.switched.flux_map import flux_map_of, map_currents, map_energy, map_stiffness

FOLDER = Path(__file__).resolve().parents[3] / "sandbox" / "switched"
MAY_BE_USED = {  # names, numbers and machinery, no equation of a plant
    "model.compiled",
    "model.effects.library",
    "model.errors",
    "model.parameters",
}


def imported(path):
    """Return every project module that a file imports, `from a import b` as a.b where that is a
    module."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            root = FOLDER.parents[1]
            names |= {n for n in inner if (root / (n.replace(".", "/") + ".py")).is_file()} or {
                node.module
            }
    return {n for n in names if n.partition(".")[0] in ("model", "sandbox", "estimators")}


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda p: p.name)
def test_no_physics_of_the_plant_is_imported(path):
    assert {n for n in imported(path) if not n.startswith("sandbox.switched")} <= MAY_BE_USED


def random_map(seed):
    """Return a map of 4 x 3 cells with random coefficients: no two cells have anything in
    common."""
    cells = np.random.default_rng(seed).standard_normal((4, 3, 5, 5))
    return SplineEnergy(cells, -0.31, -0.2, 7.0, 11.0, 20.0, 30.0)


def places(m, seed):
    """Return fluxes (n, 2) in Wb inside every cell of a map, none nearer to a boundary than a
    hundredth of a cell."""
    rng = np.random.default_rng(seed)
    inside = rng.uniform(0.01, 0.99, (40, 2)) + np.stack(
        [rng.integers(0, n, 40) for n in m.cells.shape[:2]], axis=1
    )
    return inside / [m.per_d, m.per_q] + [m.low_d, m.low_q]


def test_a_map_is_read_as_the_plants_own_code_reads_it():
    """Both are sums of 25 products of order one: 1e-12 of the largest is rounding (seen: below
    1e-14)."""
    m = random_map(1)
    own = flux_map_of(m)
    at = places(m, 2)
    for theirs, ours in ((spline.currents, map_currents), (spline.hessian, map_stiffness)):
        expected = np.array([theirs(m, d, q) for d, q in at])
        found = np.array([ours(own, d, q) for d, q in at])
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
        # they differ from place to place
        assert np.abs(expected).min() < 0.5 * np.abs(expected).max()
    energies = np.array([spline.energy(m, d, q) for d, q in at])
    assert np.array([map_energy(own, d, q) for d, q in at]) == pytest.approx(
        energies, abs=1e-12 * np.abs(energies).max()
    )


def test_beyond_the_map_currents_go_straight_on_as_the_plants():
    m = random_map(3)
    own = flux_map_of(m)
    high_d, high_q = m.low_d + 4 / 7.0, m.low_q + 3 / 11.0
    for d, q in (
        (high_d + 0.1, 0.01),
        (m.low_d - 0.2, 0.03),
        (0.02, high_q + 0.05),
        (high_d + 0.1, m.low_q - 0.3),
    ):
        expected = spline.currents(m, d, q)
        assert map_currents(own, d, q) == pytest.approx(expected, rel=1e-11)
        assert map_stiffness(own, d, q) == pytest.approx(spline.hessian(m, d, q), rel=1e-11)
    edge = (
        map_energy(own, high_d, 0.01),
        *map_currents(own, high_d, 0.01),
        map_stiffness(own, high_d, 0.01),
    )
    far = edge[0] + 0.1 * edge[1] + 0.5 * 0.1**2 * edge[3][0]
    assert map_energy(own, high_d + 0.1, 0.01) == pytest.approx(far, rel=1e-11)


def test_current_and_stiffness_are_the_energys_derivatives():
    """Central differences of the bench's own energy: 1e-6 of a cell's size squared, times third
    derivatives."""
    m = random_map(4)
    own = flux_map_of(m)
    h = 1e-5 / 11.0
    for d, q in places(m, 5)[:10]:
        by_energy = [
            (map_energy(own, d + x, q + y) - map_energy(own, d - x, q - y)) / (2 * h)
            for x, y in ((h, 0.0), (0.0, h))
        ]
        assert map_currents(own, d, q) == pytest.approx(by_energy, rel=1e-6, abs=1e-6)
        dd, dq, qq = map_stiffness(own, d, q)
        along = np.subtract(map_currents(own, d + h, q), map_currents(own, d - h, q)) / (2 * h)
        across = np.subtract(map_currents(own, d, q + h), map_currents(own, d, q - h)) / (2 * h)
        assert [*along, *across] == pytest.approx([dd, dq, dq, qq], rel=1e-6, abs=1e-4)


def test_an_energy_without_cells_has_no_map():
    class Quartic:
        gamma_q = 1.0

    assert flux_map_of(Quartic()) is None
