"""Intervals of parameters by hand: beside a free regression, and of the motor's own values."""

from types import SimpleNamespace

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.posterior import estimates
from sandbox.gap.posterior.estimates import Estimate, Spread

DRIVE = load_drive("ipm_exchanged")


def test_an_interval_beside_a_free_regression_by_hand(monkeypatch):
    """Curve 3, pull 6, prior deviation 1 (units of 1 us): 6/(3 + 1) = 1.5.  Without the regression
    the curve was 8: the plain deviation grows from 1/3 to 1/2, so the ordinary one of 0.6, traces
    and all, grows to 0.9."""
    us, far = 1e-6, np.full(1, np.inf)
    own = Coordinate("dead_time.time", 0.0, us, "linear", ("dead_time.time",))
    table = SimpleNamespace(coordinates=[own], point=SimpleNamespace(values={}))
    j = SimpleNamespace(
        model=table, prior=Prior(np.zeros(1), np.full(1, us), -far, far), effects=("dead_time",)
    )
    j.equations = Algebra(np.array([[8.0 / us**2]]), np.array([6.0 / us]), 0.0, np.zeros(1))
    sd = np.full(1, 0.6 * us)
    ordinary = Spread([own], {}, sd, sd, (sd, sd), np.ones(1, dtype=bool))
    monkeypatch.setattr(estimates, "spread", lambda j: ordinary)
    equations = Algebra(np.array([[3.0 / us**2]]), np.array([6.0 / us]), 0.0, np.zeros(1))
    found = estimates.estimates_with(j, equations)["dead_time.time"]
    half = 1.959964 * 0.9
    assert (found.value, found.low, found.high) == pytest.approx(
        ((1.5 * us), (1.5 - half) * us, (1.5 + half) * us)
    )


def test_values_of_the_motor_keep_both_ends(monkeypatch):
    """A resistance as it is, held at its bound; a magnet flux that no coordinate tells is not
    named; what multiplies a value is told in that value's unit."""
    share, field = next(iter(library.scaled().items()))
    names, size = ("stator_resistance.resistance", share), getattr(DRIVE.motor, field)
    own = [Coordinate(n, 1.0, 0.5, "linear", (n,)) for n in names]
    x, low, high = np.array([0.7, 1.2]), np.array([0.6, 1.1]), np.array([0.9, 1.4])
    spread = Spread(own, {}, x, np.ones(2), (low, high), np.array([False, True]))
    monkeypatch.setattr(estimates, "spread", lambda j: spread)
    point = SimpleNamespace(prepared=SimpleNamespace(campaign=SimpleNamespace(drive=DRIVE)))
    found = estimates.of_motor(SimpleNamespace(fit=SimpleNamespace(point=point, coordinates=own)))
    assert set(found) == {"resistance", field}
    assert found["resistance"] == Estimate(0.7, 0.6, 0.9, "ohm", True)
    assert (found[field].value, found[field].low, found[field].high) == pytest.approx(
        (1.2 * size, 1.1 * size, 1.4 * size)
    )
