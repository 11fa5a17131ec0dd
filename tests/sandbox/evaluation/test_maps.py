"""Maps agree with the point functions, are symmetric, and say where the model ends."""

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import inductances
from model.errors import BadInput
from model.saliency import local_angle
from sandbox.evaluation.maps import maps


def test_maps_are_the_point_functions():
    motor = load_drive("ipm_exchanged").motor
    m = maps(motor, points=9)
    k = (6, 2)
    at = (m.i_d[6], m.i_q[2])
    np.testing.assert_allclose(
        [m.l_dd[k], m.l_dq[k], m.l_qq[k]], inductances(motor.energy, *at), rtol=1e-12
    )
    assert m.angle[k] == pytest.approx(float(local_angle(motor.energy, *at)))
    np.testing.assert_allclose(m.l_dd, m.l_dd[:, ::-1], rtol=1e-9)  # even in i_q
    np.testing.assert_allclose(m.angle, -m.angle[:, ::-1], atol=1e-12)
    assert m.gain[4, 4] == pytest.approx(1.0)
    assert m.first_order["gain"][4, 4] == pytest.approx(1.0)


def test_rated_load_angle_is_that_of_the_notes():
    m = maps(load_drive("ipm_exchanged").motor, radius=1.2, points=3)
    # NOTES: -6.1 degrees at rated, i_d = 0
    assert np.degrees(m.angle[1, 2]) == pytest.approx(-6.1, abs=0.05)


def test_first_order_errors_are_no_small_corrections():
    assert (
        maps(load_drive("ipm").motor, radius=2.0, points=9).summary()["first_order_error_l_dd"]
        > 0.05
    )


def test_outside_the_valid_domain_is_nan():
    m = maps(load_drive("spm").motor, radius=4.0, points=17)
    assert np.isnan(m.l_dd[0, 8])
    assert np.isfinite(m.l_dd[12, 8])
    assert 0 < m.summary()["valid_share"] < 1
    with pytest.raises(BadInput, match="radius = -1"):
        maps(load_drive("spm").motor, radius=-1)
