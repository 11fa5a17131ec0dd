"""Friction as a free curve: its kernel against the curve, and what simpler forms make of it."""

import json
import re

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.friction_torque import CARD, CORNERS, TORQUES, curve, drag, places, rate, said
from model.errors import BadInput

DRIVE = load_drive("ipm_exchanged")
RATED = DRIVE.motor.rated_omega / DRIVE.motor.pole_pairs


def completed(**torques):
    """Return completed values of an effect with some terms (N m)."""
    return library.complete(
        DRIVE.motor, DRIVE.converter, {f"friction_torque.{k}": x for k, x in torques.items()}
    )


@pytest.mark.parametrize("reference", [0.0, 20.0])
def test_the_kernel_is_the_curve(reference):
    """Clipped terms one by one against a sum of `np.clip`, both senses and beyond the last
    corner."""
    sizes = np.random.default_rng(1).normal(size=len(TORQUES))
    v = completed(**dict(zip(TORQUES, sizes, strict=True)), reference=reference)
    own = reference or RATED
    speeds = own * np.array([-3.0, -0.7, -0.02, -1e-3, 0.0, 1e-3, 0.03, 0.2, 0.9, 2.0, 3.0])
    got = [drag(*sizes, own, w) for w in speeds]
    np.testing.assert_allclose(
        got, curve(v, DRIVE.motor, DRIVE.converter, speeds), rtol=1e-12, atol=1e-14
    )


def test_dry_and_viscous_friction_are_told_as_these():
    """The smallest corner lies below all speeds that are looked at; the largest is a viscous
    friction up to 2.5 times rated speed."""
    viscous = 2e-3
    v = completed(t_1=0.05, t_7=viscous * CORNERS[-1] * RATED)
    text = said(v, DRIVE.motor, DRIVE.converter)
    assert "50 mN·m" in text
    assert "0.0020 N·m·s/rad" in text
    assert "100 %" in text


def test_the_curve_that_it_proposes_is_the_curve():
    v = completed(t_2=0.04, t_4=-0.03, t_6=0.02)
    told = re.search(r"N m: (\[.*\])\)", CARD.do(v, DRIVE.motor, DRIVE.converter)).group(1)
    points = np.array(json.loads(f"[[0, 0], {told}]"))
    w = np.linspace(0.0, 2.4, 97) * RATED  # three digits are given
    np.testing.assert_allclose(
        np.interp(w, *points.T),
        curve(v, DRIVE.motor, DRIVE.converter, w),
        atol=5e-3 * np.abs(points[:, 1]).max(),
    )
    assert np.allclose(points[1:, 0], places(v, DRIVE.motor)[1:], rtol=5e-3)


def test_a_curve_too_steep_for_the_rotor_is_refused():
    """A torque over a hundredth of rated speed and the inertia: 1e6 1/s at the bound."""
    v = completed(t_1=0.1)
    steep = 0.1 / (CORNERS[0] * RATED * DRIVE.motor.inertia)
    assert rate(v, DRIVE.motor) == pytest.approx(steep)
    assert rate(completed(t_1=-0.1), DRIVE.motor) == 0.0
    with pytest.raises(BadInput, match="slope at standstill"):
        completed(t_1=0.1 * 2e6 / steep)
