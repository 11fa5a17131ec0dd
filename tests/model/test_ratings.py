"""Ratings that cannot belong to one motor are cautioned; 3/2 p psi i = 1.06 N m is what the paper's motor states."""

import dataclasses

import pytest

from model.drive_files import load_drive, motor_names
from model.ratings import cautions, largest_torque


def changed(**values):
    """The paper's interior-magnet motor with other ratings."""
    own = load_drive("ipm_exchanged")
    return dataclasses.replace(own, motor=dataclasses.replace(own.motor, **values))


@pytest.mark.parametrize("name", motor_names())
def test_motors_of_the_package_have_ratings_that_go_together(name):
    assert cautions(load_drive(name)) == ()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"magnet_flux": 98.1}, ["gives 1059 N m", "a factor of 1000", "mWb"]),
        ({"rated_torque": 1060.0}, ["rated_torque is 1060 N m", "mN m"]),
        ({"rated_current": 1200.0}, ["mA or rms"]),
        ({"rated_speed_rpm": 188.5}, ["rad/s", "less than a tenth"]),  # 1800 rpm
        ({"rated_speed_rpm": 1800.0 * 60.0}, ["more than 5 times"]),
    ],
)
def test_a_value_in_another_unit_is_named(values, said):
    told = " ".join(cautions(changed(**values)))
    assert all(words in told for words in said), told


@pytest.mark.parametrize(
    "values", [{"rated_current": 1.2 * 2**0.5}, {"rated_torque": 3.0}, {"rated_speed_rpm": 9000.0}]
)
def test_what_a_motor_may_have_is_not_cautioned(values):
    """Rms for peak, a torque of three times what the magnet gives, field weakening to five times the base speed."""
    assert cautions(changed(**values)) == ()


def test_a_reluctance_motor_has_torque_without_a_magnet():
    """3/2 p (L_d - L_q)/2 i^2 at 45 degrees."""
    motor = dataclasses.replace(load_drive("ipm_exchanged").motor, magnet_flux=0.0)
    assert largest_torque(motor) == pytest.approx(9.0 * 0.5 * (0.0919 - 0.0458) * 1.2**2, rel=1e-3)
