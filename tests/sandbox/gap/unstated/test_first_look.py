"""A first look far from the nominal model, on the switched bench."""

import dataclasses
import math

import pytest

from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.evidence.fit import NEAR, fit, normalised, rms_of
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.report.answers import held_text
from sandbox.gap.unstated import first_look as looking
from sandbox.gap.unstated.first_look import first_look
from sandbox.gap.unstated.pwm_counts import Counted
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, small_campaign

# 1/40 of the drive's resistance: one tenth of a volt makes ten times the noise of a current
LOW = dataclasses.replace(
    DRIVE, motor=dataclasses.replace(DRIVE.motor, resistance=DRIVE.motor.resistance / 40.0)
)
WEAK = tuple((name, rotor, speed, 0.1 * size) for name, rotor, speed, size in CASES)
DELAYS = ("pwm_delay", "current_sampling", "current_filter")
ORDINARY = {"dead_time": 1e-7}  # s: what is known of a compensated dead time
LATE = -2e-7  # two deviations


def start_of(campaign):
    """Return a campaign's nominal point."""
    return ParameterPoint(
        prepare(campaign), complete(campaign.drive.motor, campaign.drive.converter)
    )


def campaign(late, counts):
    """Return one of a motor of small resistance whose dead time is `late` (s) more than stated."""
    own = small_campaign({"dead_time.time": late}, WEAK, drive=LOW, counts=counts)
    return dataclasses.replace(own, background={**own.background, **ORDINARY})


def looked(own):
    """Return the first look at a campaign, and the fit of ordinary deviations alone behind it."""
    at, alone = start_of(own), weights_of(len(own.recordings))
    look = first_look(at, None, normalised(normal(at, ()), alone))
    return look, fit(dataclasses.replace(look.start, values=look.values), (), alone)


@pytest.mark.parametrize("late", [LATE, -LATE])
def test_counts_and_ordinary_deviations_are_found_from_far(late):
    """The nominal model leaves a hundred times the noise.  The number of counts itself; the dead
    time far within what is ordinary of it (a twentieth); J of 14 400 independent readings scatters
    by 1/sqrt(2 x 14 400).  Only legs that give volts back are held, by twice what they give beyond
    the winding: late link / (period zone) as the card of dead_time has it."""
    look, found = looked(campaign(late, 1000))
    assert look.known.counts.value == 1000
    assert look.values["dead_time.time"] == pytest.approx(late, abs=5e-9)
    assert rms_of(found) == pytest.approx(1.0, abs=3.0 / math.sqrt(2.0 * 14_400.0))
    c, zone = LOW.converter, look.values["bench.soft_current"]
    given = -look.values["dead_time.time"] * c.dc_bus_voltage / (c.sampling_period * zone)
    excess = max(0.0, given - LOW.motor.resistance)
    for r in look.start.prepared.recordings:
        assert r.hold == pytest.approx(2.0 * excess)


def test_counts_that_a_fit_does_not_confirm_are_not_stated(monkeypatch):
    """Nothing is rounded here, and whoever looks for counts names 1000 of them."""
    own, asked = campaign(LATE, None), []

    def named(point):
        asked.append(point)
        return Counted(1000, 1000, 1000, 8e6, 1.0, 20.0)

    monkeypatch.setattr(looking, "keeps_more", lambda *_: True)
    monkeypatch.setattr(looking, "pwm_counts", named)
    look, found = looked(own)
    assert asked
    assert not look.known
    assert rms_of(found) == pytest.approx(1.0, abs=3.0 / math.sqrt(2.0 * 14_400.0))


def test_near_the_noise_there_is_nothing_to_look_for():
    """The nominal model's own point, the same object."""
    at = start_of(campaign(0.0, None))
    look = first_look(at, None, NEAR)
    assert look.start is at
    assert look.values is at.values
    assert not look.known


def test_the_answer_says_that_readings_hold():
    """Only where legs give volts back; the longest memory is L over the resistance that holds, in
    samples of the drive."""
    held, free = (
        diagnosis_of(campaign(late, None), exclude=DELAYS, workers=1) for late in (LATE, -LATE)
    )
    assert free.held_by == 0.0
    assert held_text(free) == ""
    longest = max(LOW.motor.inductance_d, LOW.motor.inductance_q) / held.held_by
    samples = max(1, round(longest / LOW.converter.sampling_period))
    assert f"forget within some {samples} samples" in held_text(held)
