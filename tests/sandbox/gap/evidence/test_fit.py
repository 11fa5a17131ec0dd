"""Fit of a set: what it does at the end of what a drive can have."""

import dataclasses
import math

import pytest

from model.errors import BadInput
from sandbox.gap.evidence import fit as fitted
from sandbox.gap.evidence.normal import normal
from sandbox.gap.posterior.holdout import weights_of
from tests.sandbox.gap.conftest import start


def test_slopes_stay_where_no_drive_stands_beside_a_point(small_folder, monkeypatch):
    """As where a difference makes the inductance so large that no flux has the first current read:
    the fit ends at what its first slopes reach, and is no error (one campaign of a second bench was
    answered with that sentence).  They reach most of it, as the dead time is nearly linear (a tenth
    is chosen: what is shown is that the fit ends at all)."""
    here, calls = start(small_folder), []

    def once(point, coordinates, *, workers=1):
        calls.append(point)
        if len(calls) > 1:
            raise BadInput("no flux of this motor gives the first reading")
        return normal(point, coordinates, workers=workers)

    weights = weights_of(len(here.prepared.recordings))
    whole = fitted.fit(here, ("dead_time",), weights)
    monkeypatch.setattr(fitted, "normal", once)
    found = fitted.fit(here, ("dead_time",), weights)
    assert len(calls) > 1
    assert math.isfinite(found.objective)
    time = "dead_time.time"
    assert found.point.values[time] == pytest.approx(whole.point.values[time], rel=0.1)


def test_a_step_moves_a_signs_width_and_shape_no_further_than_their_slopes_hold(
    small_folder, monkeypatch
):
    """From a zone four times as wide as usual: every point that is tried lies within `STRAIGHT` of
    the one before, and the zone gets there."""
    here, moves, of = start(small_folder), [], fitted.tried
    width = here.values["bench.soft_current"]

    def spied(n, trial, *rest):
        own = [k for k, c in enumerate(n.coordinates) if c.label in fitted.STRAIGHT]
        moves.append(
            {
                n.coordinates[k].label: abs(n.coordinates[k].value(trial.values) - n.x[k])
                for k in own
            }
        )
        return of(n, trial, *rest)

    monkeypatch.setattr(fitted, "tried", spied)
    wide = dataclasses.replace(here, values={**here.values, "bench.soft_current": 4.0 * width})
    found = fitted.fit(wide, ("dead_time",), weights_of(len(here.prepared.recordings)))
    for label, most in fitted.STRAIGHT.items():
        assert max(m[label] for m in moves) <= most + 1e-9, label
    assert max(m["bench.soft_current"] for m in moves) == pytest.approx(0.5)
    assert found.point.values["bench.soft_current"] < 2.0 * width
