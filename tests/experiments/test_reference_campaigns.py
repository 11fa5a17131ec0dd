"""Campaigns of other plants: both plants read the same where nothing but the step differs; truths
that are written."""

import numpy as np
import pytest

from experiments import reference_campaigns as rc
from experiments.other_simulator import CASES, INERTIA, LOAD_INERTIA


@pytest.mark.parametrize("run", [rc.RUNS[0], rc.RUNS[3]], ids=["locked", "driven"])
def test_events_and_fine_steps_read_the_same(monkeypatch, run):
    """40 samples of the reference, which shares no code with the plant, without effects: within
    three thousandths of the current: a count of the encoder, 2.3 mrad electrical, which the replay
    reads and the
    reference does not."""
    monkeypatch.setattr(rc, "SAMPLES", 40)
    d = rc.drive()
    r = rc.commanded(d, run)
    one, other = (plant(d, run, r, {}) for plant in (rc.events, rc.fine))
    assert one.shape == other.shape == (40, 3)
    assert np.max(np.abs(one - other)) < 3e-3 * np.max(np.abs(one))


def test_readings_are_in_counts_with_noise():
    d, rng = rc.drive(), np.random.default_rng(1)
    found = rc.read(d, np.zeros((4000, 3)), rng)
    noise, count = d.converter.current_noise, d.converter.current_resolution
    for i in found.values():
        assert np.std(i) == pytest.approx(np.hypot(noise, count / 12**0.5), rel=0.05)
        assert not count or np.allclose(np.round(i / count), i / count)


def test_truths_of_the_other_simulator():
    """A delay of half a carrier period of 250 us; two masses that swing at 90 Hz: w^2 = k (1/J_1 +
    1/J_2)."""
    assert CASES["control"].truth() == {}
    assert CASES["double"].truth() == {"dead_time": {"time": 2e-6}}
    assert CASES["delay_125"].truth() == {"pwm_delay": {"delay": 125e-6}}
    shaft = CASES["shaft_90"].truth()["shaft_compliance"]
    rate = shaft["stiffness"] * (1.0 / LOAD_INERTIA + 1.0 / (INERTIA - LOAD_INERTIA))
    assert rate == pytest.approx((2.0 * np.pi * 90.0) ** 2)
