"""The energy of inductance harmonics: current and torque as its slopes, and where it stops being convex."""

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.inductance_harmonics import SIZES, of_order, softened
from model.errors import BadInput

SIZE = {
    "gamma": 0.7, "back": -0.4, "pulse": 0.3, "alpha_30": 5.0, "alpha_12": -8.0, "alpha_21": 6.0, "alpha_03": 3.0,
}  # fmt: skip
DRIVE = load_drive("ipm_exchanged")
MOTOR = DRIVE.motor


def energy(v, order, phase, theta, d, q):
    """Return the part of H (J) as the card's equation writes it."""
    x = order * theta + phase
    h = 0.5 * v["gamma"] * (math.cos(x) * (d * d - q * q) + 2.0 * math.sin(x) * d * q)
    h += 0.5 * v["back"] * (math.cos(x) * (d * d - q * q) - 2.0 * math.sin(x) * d * q)
    h += 0.5 * v["pulse"] * math.cos(x) * (d * d + q * q)
    h += math.cos(x) * (v["alpha_30"] * d**3 + v["alpha_12"] * d * q * q)
    return h + math.sin(x) * (v["alpha_21"] * d * d * q + v["alpha_03"] * q**3)


@pytest.mark.parametrize("sizes", [SIZE, *({n: SIZE[n]} for n in SIZES)])
@pytest.mark.parametrize(("theta", "d", "q"), [(0.37, 0.03, 0.08), (-2.1, -0.06, 0.05), (1.2, 0.04, -0.1)])
def test_current_and_torque_are_slopes_of_one_energy(sizes, theta, d, q):
    """Central differences over 1e-5: 1e-10 of third derivatives (up to 60 in fluxes, 18^3 in the angle times an energy
    of 0.01), 1e-11 of rounding; so 1e-6 beside values near 0.1."""
    v, h, order, phase = {**dict.fromkeys(SIZES, 0.0), **sizes}, 1e-5, 18.0, 0.5
    i_d, i_q, turning = of_order(*v.values(), order, phase, math.cos(theta), math.sin(theta), d, q)
    at = (order, phase, theta, d, q)

    def slope(place):
        """Return the energy's slope by the angle (2), d (3) or q (4)."""
        ahead, behind = (energy(v, *(x + s * (k == place) for k, x in enumerate(at))) for s in (h, -h))
        return (ahead - behind) / (2.0 * h)

    assert (turning, i_d, i_q) == pytest.approx((slope(2), slope(3), slope(4)), abs=1e-6)


def test_against_its_order_is_with_the_opposite_one():
    """Re(z^2 e^(jx)) is Re(z^2 e^(-jx')) of x' = -x."""
    back = of_order(0.0, 0.4, *[0.0] * 5, 12.0, 0.3, math.cos(0.7), math.sin(0.7), 0.05, -0.02)
    other = of_order(0.4, 0.0, *[0.0] * 5, -12.0, -0.3, math.cos(0.7), math.sin(0.7), 0.05, -0.02)
    assert back == pytest.approx(other, rel=1e-13)


@pytest.mark.parametrize(
    ("given", "share"),
    [
        ({"gamma_6": 4.0}, 4.0 * MOTOR.inductance_q),
        ({"2.pulse": 3.0, "3.pulse": 2.0, "3.order": 36.0}, 5.0 * MOTOR.inductance_q),
        ({"2.alpha_30": 9.0}, 54.0 * MOTOR.inductance_d**2 * MOTOR.rated_current),
        ({"2.alpha_03": 2.0, "2.order": 6.0}, 12.0 * MOTOR.inductance_q**2 * MOTOR.rated_current),
        ({"2.alpha_30": 9.0, "2.phase": 0.5 * math.pi}, 54.0 * MOTOR.inductance_d**2 * MOTOR.rated_current),
    ],
)
def test_how_much_softer_the_energy_gets(given, share):
    """By hand: second derivatives gamma, pulse, 6 alpha_30 d, 6 alpha_03 q, over those of 1/L on the same axis, at the
    flux of rated current; L_q > L_d here.  An extreme lies within a quarter of a degree of an angle looked at: three
    degrees of order 12, 1 - cos 3 degrees = 1.4e-3."""
    values = library.complete(MOTOR, DRIVE.converter, {f"inductance_harmonics.{n}": x for n, x in given.items()})
    assert softened(values, MOTOR) == pytest.approx(share, rel=1.4e-3)


def test_softer_where_both_fluxes_are():
    """alpha_12 alone: 2 alpha d on q and 2 alpha q across, so half of the first and the root of squares, by hand at the
    eight angles of the current."""
    angle, alpha = np.arange(8) * math.pi / 4.0, 4.0
    d = MOTOR.inductance_d * MOTOR.rated_current * np.cos(angle)
    q = MOTOR.inductance_q * MOTOR.rated_current * np.sin(angle)
    own, across = (
        2.0 * alpha * d * MOTOR.inductance_q,
        2.0 * alpha * q * math.sqrt(MOTOR.inductance_d * MOTOR.inductance_q),
    )
    values = library.complete(MOTOR, DRIVE.converter, {"inductance_harmonics.2.alpha_12": alpha})
    by_hand = np.max(0.5 * np.abs(own) + np.hypot(0.5 * own, across))
    assert softened(values, MOTOR) == pytest.approx(by_hand, rel=1.4e-3)


def test_an_energy_that_is_not_convex_is_refused():
    """6 alpha_30 L_d I beside 1/L_d: one at alpha_30 = 1/(6 L_d^2 I)."""
    limit = 1.0 / (6.0 * MOTOR.inductance_d**2 * MOTOR.rated_current)
    library.complete(MOTOR, DRIVE.converter, {"inductance_harmonics.4.alpha_30": 0.99 * limit})
    with pytest.raises(BadInput, match="not convex"):
        library.complete(MOTOR, DRIVE.converter, {"inductance_harmonics.4.alpha_30": 1.01 * limit})


def test_harmonics_of_the_card_s_sizes_leave_any_motor_convex():
    """A hundredth of the scales by which second derivatives are compared (card: typical sizes), all seven together."""
    for scale in (0.3, 1.0, 4.0):
        motor = dataclasses.replace(MOTOR, inductance_q=scale * MOTOR.inductance_d)
        part = library.load_effect("inductance_harmonics").part(2)
        sizes = {p.name: p.typical_for(motor, DRIVE.converter) for p in part.parameters if p.name in SIZES}
        values = {f"inductance_harmonics.2.{n}": x for n, x in sizes.items()}
        assert np.isfinite(softened(library.complete(motor, DRIVE.converter, values), motor))
        assert softened(library.complete(motor, DRIVE.converter, values), motor) < 0.5
