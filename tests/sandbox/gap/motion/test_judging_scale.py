"""A drive of another size gives the same answers, scaled; a linear axis (radians are metres) is
told as it is."""

import numpy as np
import pytest

from sandbox.gap.motion.judging import judge
from sandbox.recordings.motion_log import MotionCampaign, MotionRecording

# kg, N s/m, N, N: about those of the EMPS benchmark's axis
MASS, VISCOUS, DRY, OFFSET = 95.0, 203.0, 20.0, -3.0
COUNT = 5e-8  # m: what the axis resolves


def axis(time=1.0, force=1.0, noise=0.3):
    """Return a linear axis that goes to and fro over 0.25 m at 0.125 m/s at most, faster and
    stronger by factors."""
    t = np.arange(8000) * 1e-3
    swing = np.tanh(6.0 * np.sin(1.5 * t))
    speed = 0.125 * swing * (0.8 + 0.2 * np.cos(0.7 * t))
    place = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 1e-3)])
    push = MASS * np.gradient(speed, t) + VISCOUS * speed + DRY * np.tanh(speed / 5e-4) + OFFSET
    push += noise * np.random.default_rng(1).standard_normal(len(t))
    read = COUNT * np.round(place / COUNT)
    recording = MotionRecording("axis", t * time, read, push * force, np.zeros(len(t)))
    return MotionCampaign("axis", 1.0, None, 0.0, {}, None, 0.0, (recording,), (), "no voltages")


@pytest.fixture(scope="module")
def told():
    return judge(axis())


def test_a_linear_axis_has_its_four_numbers_and_nothing_else(told):
    """Within 5 %: of the published numbers of the measured axis this is asked, too."""
    s = told.best.shaft
    assert set(told.best.effects) == {"coulomb_friction", "viscous_friction"}
    assert s.terms.orders == ()
    for name, value in (("inertia", MASS), ("viscous", VISCOUS), ("dry", DRY)):
        assert s.value(name) == pytest.approx(value, rel=0.05), name
    assert abs(s.value("offset")) == pytest.approx(abs(OFFSET), rel=0.05)


@pytest.mark.parametrize(("time", "force"), [(2.0**-6, 2.0**-10), (2.0, 4.0)])
def test_answers_scale_digit_by_digit(told, time, force):
    """Powers of two scale without rounding; what is left of it is that of the solvers, 1e-9.  Sizes
    stay in bounds."""
    other = judge(axis(time, force))
    assert [w.effects for w in other.weighed] == [w.effects for w in told.weighed]
    assert [w.probability for w in other.weighed] == pytest.approx(
        [w.probability for w in told.weighed], abs=1e-9
    )
    for name, unit in (
        ("inertia", force * time**2),
        ("viscous", force * time),
        ("dry", force),
        ("lag", time),
    ):
        assert other.best.shaft.value(name) == pytest.approx(
            told.best.shaft.value(name) * unit, rel=1e-9
        ), name
    assert other.after == pytest.approx(told.after, rel=1e-9)
