"""The drive with a flux map behind it: its identified energy, what is drawn and recorded, and where
it is left out."""

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import flux_from_current
from model.mapped import MappedMotor
from sandbox.replay.replay import prepare, replay, residuals
from sandbox.withheld.making import mapped_drive as mapped
from sandbox.withheld.making.case_list import Case, cases
from sandbox.withheld.making.draw import draw, outside_names
from sandbox.withheld.making.drives import family_drive, valid
from sandbox.withheld.making.make import campaign_of
from sandbox.withheld.making.outside_causes import OUTSIDE

here = pytest.mark.skipif(mapped.missing() is not None, reason=str(mapped.missing()))


def test_a_quartic_identifies_itself():
    motor = load_drive("ipm").motor
    found = mapped.identified(dataclasses.replace(motor))
    for name in (
        "inductance_d",
        "inductance_q",
        "alpha_30",
        "alpha_12",
        "alpha_40",
        "alpha_22",
        "alpha_04",
    ):
        assert getattr(found, name) == pytest.approx(getattr(motor, name), rel=1e-8), name


def test_a_map_is_drawn_only_where_its_data_are(monkeypatch):
    monkeypatch.setattr(mapped, "locate", lambda name: None)
    assert "SENSORLESS_DATA" in mapped.missing()
    assert outside_names() == list(OUTSIDE)
    listed = cases(300, 1, "mixed", "scored", [*OUTSIDE, mapped.FLUX_MAP])
    own = [c for c in listed if c.outside == mapped.FLUX_MAP]
    assert {(c.kind, c.family, c.sizes) for c in own} == {("outside", "mapped", (1.0,))}
    assert len(own) >= 3
    assert all(c.family != "mapped" for c in listed if c not in own)


@here
def test_the_identified_energy_follows_the_map_by_some_percent():
    """Relative to the largest current: 2.8 to 3.6 % rms for this map at 12 to 19 A (fit within 16 A
    here)."""
    motor = family_drive("mapped").motor
    assert isinstance(motor, MappedMotor)
    found = mapped.identified(motor)
    assert not isinstance(found, MappedMotor)
    assert valid(motor)
    assert valid(found)
    angle = np.linspace(0.0, math.tau, 25)
    size = mapped.USED * motor.rated_current
    i = size * np.cos(angle), size * np.sin(angle)
    rows = mapped.terms(*flux_from_current(motor.energy, *i))
    m = found.energy
    off = np.concatenate([r @ np.array(m) - x for r, x in zip(rows, i, strict=True)]) / size
    assert 0.01 < np.sqrt(np.mean(off**2)) < 0.1


@here
def test_its_campaign_has_a_gap_that_no_alphas_explain():
    drawn = draw(Case(0, "outside", "mapped", "scored", (), (1.0,), mapped.FLUX_MAP), 7)
    assert drawn.as_json()["effects"] == ["unknown"]
    assert "spline" not in drawn.as_json()["true_motor"]
    campaign = campaign_of(drawn, 0.1)
    assert campaign.drive.motor.alpha_40 != 0.0
    prepared = prepare(campaign)
    found = residuals(prepared, replay(prepared, [{}]))
    assert np.sqrt(np.mean([r.rms()[0] ** 2 for r in found])) > 5.0
