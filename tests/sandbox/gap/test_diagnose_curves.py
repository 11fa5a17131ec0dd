"""What no named effect of the library is, and a curve at its port is: sensors that bend, friction
of another form.  The switched bench has each in equations of its own."""

import numpy as np
import pytest

from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.location.curves import curves_found
from tests.sandbox.gap.conftest import CASES, DRIVE, TURNING, small_campaign

RATED = DRIVE.motor.rated_current
CUBIC = 0.02  # of rated current, at rated current


@pytest.fixture(scope="module")
def bent():
    """The diagnosis of a bench whose sensors read i (1 - k i^2)."""
    outside = {"curvature": CUBIC / RATED**2}
    return diagnosis_of(small_campaign({}, CASES + TURNING, outside=outside), workers=1)


def test_sensors_that_bend_are_a_curve(bent):
    """J scatters by 0.8 % (`test_five_at_once`); five deviations are allowed."""
    assert bent.best.effects == ("current_linearity",)
    assert bent.best.probability > 0.9
    assert bent.size.after == pytest.approx(1.0, abs=0.04)


def test_its_curve_is_the_cubic_up_to_the_largest_current(bent):
    """Its band holds the cubic, a common gain beside it apart: that no recording tells from one of
    the motor's own."""
    (c,) = curves_found(bent.best.evaluated)
    most = max(float(np.max(np.abs(r.i_a))) for r in bent.campaign.recordings)
    at = np.array(c.at)
    own = (at > 0.0) & (at <= most)
    true = -CUBIC * at * (at / RATED) ** 2
    line = np.polynomial.polynomial.polyfit(at[own], (np.array(c.value) - true)[own] / at[own], 0)
    assert abs(line[0]) < 0.01
    assert np.max(np.abs(np.array(c.value) - true - line[0] * at)[own]) < 0.1 * CUBIC * RATED
