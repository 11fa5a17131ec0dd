"""Equations of more coordinates at a point where some are known."""

import numpy as np
import pytest

from sandbox.gap.evidence import extended as room
from sandbox.gap.evidence.extended import extended
from sandbox.gap.evidence.fit import coordinates_of
from sandbox.gap.evidence.normal import normal
from sandbox.gap.posterior.holdout import weights_of
from tests.sandbox.gap.conftest import start


def same(found, whole):
    """Whether equations are the same but for rounding: slopes are differences over 1e-4 of a
    deviation, of readings that stand to 1e-13, so they are off by 1e-9 of a reading for each
    deviation, which moves it by a thousandth and more: 1e-6 of a column."""
    size = np.sqrt(np.diag(whole.a))
    return (
        bool(np.all(np.abs(found.a - whole.a) <= 1e-6 * np.outer(size, size)))
        and bool(np.all(np.abs(found.g - whole.g) <= 1e-6 * size * np.sqrt(whole.ssr)))
        and found.ssr == pytest.approx(whole.ssr, rel=1e-12)
    )


def test_new_columns_beside_known_ones_are_those_of_all_at_once(small_folder, monkeypatch):
    """Columns that nobody asks for go, and only the new ones are simulated."""
    here, asked = start(small_folder), []
    known = normal(here, coordinates_of(here, ("dead_time", "current_gain")))
    wanted = coordinates_of(here, ("iron_loss", "dead_time"))
    whole = normal(here, wanted)

    def told(point, coordinates, *, workers=1):
        asked.extend(c.label for c in coordinates)
        return normal(point, coordinates, workers=workers)

    monkeypatch.setattr(room, "normal", told)
    found = extended(known, here, wanted)
    assert asked
    assert all(label.startswith("iron_loss.") for label in asked)
    assert found.coordinates == whole.coordinates
    np.testing.assert_array_equal(found.x, whole.x)
    weights = weights_of(len(here.prepared.recordings))
    assert same(found.summed(weights), whole.summed(weights))


def test_a_point_that_moves_meets_the_slopes_of_both(small_folder):
    """Products of another point's residuals with slopes that stand in two arrays."""
    here = start(small_folder)
    wanted = coordinates_of(here, ("iron_loss", "dead_time"))
    found = extended(normal(here, coordinates_of(here, ("dead_time",))), here, wanted)
    whole = normal(here, wanted)
    there = here.moved(
        wanted, whole.x[: len(wanted)] + 0.1 * np.array([c.deviation for c in wanted])
    )
    some = wanted[::2]
    for n in (found, found.of(some)):
        other = whole if n is found else whole.of(some)
        assert same(n.at(there).summed(), other.at(there).summed())
