"""The sensors' part of a gap is told in amperes: a planted constant offset is constant, at every
speed."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location import where
from sandbox.gap.location.decompose import decompose
from sandbox.gap.location.readings import Readings, described
from sandbox.gap.location.where import of_readings, sentences
from sandbox.gap.words import amperes
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, small_campaign

OFFSET = 0.05  # A, in phase a; a salient motor at standstill, 10 and 60 rad/s


@pytest.fixture(scope="module")
def part():
    """What the true model leaves of recordings with an offset, taken apart."""
    campaign = small_campaign({}, CASES)
    moved = [
        dataclasses.replace(r, columns={**r.columns, "i_a": r.columns["i_a"] + OFFSET})
        for r in campaign.recordings
    ]
    prepared = prepare(dataclasses.replace(campaign, recordings=tuple(moved)))
    point = ParameterPoint(prepared, complete(DRIVE.motor, DRIVE.converter))
    return decompose(point, shown(point))


def test_an_offset_is_constant_in_its_phase(part):
    """Floor 4 mA, 4800 samples: a mean is known to 0.06 mA, and the replay with hidden angles errs
    by 0.3 floors."""
    r = part.readings
    assert r.means["a"] == pytest.approx(OFFSET, abs=0.3 * 0.004)
    assert abs(r.means["b"]) < 0.3 * 0.004
    assert r.rms == pytest.approx(OFFSET / np.sqrt(3.0), rel=0.03)  # of one of three phases
    assert r.constant["a"] > 0.95
    cells = r.amplitude[np.isfinite(r.amplitude)]
    assert len(cells) > 2
    assert cells == pytest.approx(np.full(len(cells), OFFSET / np.sqrt(3.0)), rel=0.1)


def test_an_offset_is_told_without_a_trend(part):
    said = next(sentences("sensor", 1.0, part, of_readings=True)).text
    assert "an error of the measured currents, 29 mA rms a phase" in said
    assert "+50 mA in a" in said
    assert "Where currents are not near zero, its rms does not depend on speed or current." in said
    assert "voltage" not in said
    assert "grows" not in said


def test_what_is_wrong_with_the_angle_is_told_as_a_voltage(part):
    """Readings are right where the encoder is not: the same residual, of an angle that is off."""
    said = next(sentences("sensor", 1.0, part)).text
    assert "voltage" in said
    assert "measured currents" not in said
    assert said.endswith("This points to the sensors.")


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ([("current_offset",)], True),
        ([("current_gain", "current_filter", "current_sampling", "inertia")], True),
        ([("encoder_offset",)], False),
        # the first that names any
        ([("dead_time",), ("encoder_offset",), ("current_offset",)], False),
        ([("unknown",), ("dead_time",)], True),  # shown by readings whose sum is not zero
    ],
)
def test_which_effects_act_on_current_readings(told, expected):
    assert (
        of_readings(SimpleNamespace(ambiguity_set=[SimpleNamespace(effects=e) for e in told]))
        == expected
    )


@pytest.mark.parametrize(("offset", "disc"), [(9.0, 4.0), (4.0, 9.0)])
def test_of_both_kinds_the_one_that_explains_more_is_told(monkeypatch, offset, disc):
    """A constant offset beside an eccentric disc is told as a current where it is the larger part
    of the two."""
    lost = {("current_offset",): offset, ("encoder_eccentricity",): disc}
    monkeypatch.setattr(where, "_lost", lambda judged, effects: lost[tuple(effects)])
    h = SimpleNamespace(
        effects=("current_offset", "dead_time", "encoder_eccentricity", "unknown"), evaluated=None
    )
    assert of_readings(SimpleNamespace(ambiguity_set=[h])) == (offset > disc)


def test_an_error_that_is_not_constant_is_told_by_its_size():
    r = Readings(
        0.017, dict.fromkeys("abc", 0.0), dict.fromkeys("abc", 0.1), np.full((4, 4), np.nan)
    )
    assert described(r) == "an error of the measured currents, 17 mA rms a phase"
    most = dataclasses.replace(r, constant=dict.fromkeys("abc", 0.2))
    assert described(most).endswith("; 60 % of it is constant (+0 A in a, +0 A in b, +0 A in c)")


@pytest.mark.parametrize(
    ("x", "sign", "text"),
    [
        (0.0174, False, "17 mA"),
        (-0.0174, True, "−17 mA"),
        (2.0, True, "+2 A"),
        (0.00185, False, "1.9 mA"),
    ],
)
def test_currents_are_written_as_people_do(x, sign, text):
    assert amperes(x, sign=sign) == text
