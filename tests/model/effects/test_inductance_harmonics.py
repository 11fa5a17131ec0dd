"""The energy of inductance harmonics: current and torque as its slopes, and where it stops being
convex."""

import dataclasses
import math
import re

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.inductance_harmonics import SIZES, inside, of_order, softened
from model.energy import flux_from_current
from model.errors import BadInput

SIZE = {
    "gamma": 0.7,
    "back": -0.4,
    "pulse": 0.3,
    "alpha_30": 5.0,
    "alpha_12": -8.0,
    "alpha_21": 6.0,
    "alpha_03": 3.0,
}
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
@pytest.mark.parametrize(
    ("theta", "d", "q"), [(0.37, 0.03, 0.08), (-2.1, -0.06, 0.05), (1.2, 0.04, -0.1)]
)
def test_current_and_torque_are_slopes_of_one_energy(sizes, theta, d, q):
    """Central differences over 1e-5: 1e-10 of third derivatives (up to 60 in fluxes, 18^3 in the
    angle times an energy of 0.01), 1e-11 of rounding; so 1e-6 beside values near 0.1."""
    v, h, order, phase = {**dict.fromkeys(SIZES, 0.0), **sizes}, 1e-5, 18.0, 0.5
    i_d, i_q, turning = of_order(*v.values(), order, phase, math.cos(theta), math.sin(theta), d, q)
    at = (order, phase, theta, d, q)

    def slope(place):
        """Return the energy's slope by the angle (2), d (3) or q (4)."""
        ahead, behind = (
            energy(v, *(x + s * (k == place) for k, x in enumerate(at))) for s in (h, -h)
        )
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
        (
            {"2.alpha_30": 9.0, "2.phase": 0.5 * math.pi},
            54.0 * MOTOR.inductance_d**2 * MOTOR.rated_current,
        ),
    ],
)
def test_how_much_softer_the_energy_gets(given, share):
    """By hand: second derivatives gamma, pulse, 6 alpha_30 d, 6 alpha_03 q, over those of 1/L on
    the same axis, at the flux of rated current; L_q > L_d here.  An extreme lies within a quarter
    of a degree of an angle looked at: three degrees of order 12, 1 - cos 3 degrees = 1.4e-3."""
    values = library.complete(
        MOTOR, DRIVE.converter, {f"inductance_harmonics.{n}": x for n, x in given.items()}
    )
    assert softened(values, MOTOR) == pytest.approx(share, rel=1.4e-3)


def test_softer_where_both_fluxes_are():
    """alpha_12 alone: 2 alpha d on q and 2 alpha q across, so half of the first and the root of
    squares, by hand at the eight angles of the current."""
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
    """A hundredth of the scales by which second derivatives are compared (card: typical sizes), all
    seven together."""
    for scale in (0.3, 1.0, 4.0):
        motor = dataclasses.replace(MOTOR, inductance_q=scale * MOTOR.inductance_d)
        part = library.load_effect("inductance_harmonics").part(2)
        sizes = {
            p.name: p.typical_for(motor, DRIVE.converter)
            for p in part.parameters
            if p.name in SIZES
        }
        values = {f"inductance_harmonics.2.{n}": x for n, x in sizes.items()}
        assert np.isfinite(softened(library.complete(motor, DRIVE.converter, values), motor))
        assert softened(library.complete(motor, DRIVE.converter, values), motor) < 0.5


def least_over_all(motor, values, times):
    """Return the least eigenvalue (1/H) of the quartic with so many times the harmonics, over 180
    directions and 24 sizes of the current up to 250 % of rated and 720 angles, from numbers alone
    (eq. EnerSat and the card's equation, both differentiated twice by hand); the fluxes are the
    library's, tested elsewhere."""
    around, least = (np.arange(180) + 0.5) * (math.tau / 180), math.inf
    for size in np.linspace(0.0, 2.5 * motor.rated_current, 25):
        d, q = (
            x[:, None]
            for x in flux_from_current(motor.energy, size * np.cos(around), size * np.sin(around))
        )
        least = min(least, least_at(motor, values, times, d, q))
    return least


def least_at(motor, values, times, d, q):
    """Return the same at fluxes (n, 1) in Wb."""
    theta, m = np.arange(720) * (math.tau / 720), motor
    dd = (
        1.0 / m.inductance_d
        + 6.0 * m.alpha_30 * d
        + 12.0 * m.alpha_40 * d * d
        + 2.0 * m.alpha_22 * q * q
    )
    dq = 2.0 * m.alpha_12 * q + 4.0 * m.alpha_22 * d * q
    qq = (
        1.0 / m.inductance_q
        + 2.0 * m.alpha_12 * d
        + 2.0 * m.alpha_22 * d * d
        + 12.0 * m.alpha_04 * q * q
    )
    for k in range(2, 7):
        v = {n: times * values[f"inductance_harmonics.{k}.{n}"] for n in SIZES}
        x = (
            values[f"inductance_harmonics.{k}.order"] * theta
            + values[f"inductance_harmonics.{k}.phase"]
        )
        if any(v.values()):
            c, s, even = np.cos(x), np.sin(x), v["gamma"] + v["back"]
            dd = (
                dd + c * (even + v["pulse"] + 6.0 * v["alpha_30"] * d) + s * 2.0 * v["alpha_21"] * q
            )
            dq = (
                dq
                + c * 2.0 * v["alpha_12"] * q
                + s * (v["gamma"] - v["back"] + 2.0 * v["alpha_21"] * d)
            )
            qq = (
                qq + c * (v["pulse"] - even + 2.0 * v["alpha_12"] * d) + s * 6.0 * v["alpha_03"] * q
            )
    gamma_6 = times * values["inductance_harmonics.gamma_6"]
    c, s = np.cos(6.0 * theta), np.sin(6.0 * theta)
    dd, dq, qq = dd + gamma_6 * c, dq + gamma_6 * s, qq - gamma_6 * c
    return np.min(0.5 * (dd + qq) - np.sqrt(0.25 * (dd - qq) ** 2 + dq * dq))


SETS = [
    {"2.alpha_30": 1.0},
    {"2.alpha_12": -1.0, "2.phase": 0.4},
    {"3.alpha_21": 1.0, "3.order": 7.0},
    {"2.alpha_03": 1.0, "2.order": -18.0, "2.phase": 1.0},
    {
        "gamma_6": 1.0,
        "2.order": 6.0,
        "2.phase": 0.5 * math.pi,
        "2.gamma": -0.8,
        "2.back": 0.5,
        "2.alpha_12": 3.0,
    },
    {
        "2.pulse": 1.0,
        "2.alpha_30": 3.0,
        "3.order": 18.0,
        "3.alpha_03": 2.0,
        "3.alpha_21": 3.0,
        "3.phase": 2.2,
    },
]


@pytest.mark.parametrize("given", SETS, ids=str)
@pytest.mark.parametrize("name", ["ipm_exchanged", "spm_exchanged"])
def test_a_simulated_drive_is_convex_at_every_angle_and_current(name, given):
    """The bound is where another grid loses convexity: finer ones move what the card says by 0.4 %
    (RAYS), what this one has between its currents is of that size, and between its angles
    1 - cos(18 x 0.25 degrees) = 0.3 %."""
    drive = load_drive(name)
    motor, converter = drive.motor, drive.converter
    values = library.neutral(motor) | {f"inductance_harmonics.{n}": x for n, x in given.items()}
    (limit,) = inside(values, motor, converter)
    times = limit.bound / limit.size
    assert least_over_all(motor, values, 0.99 * times) > 0.0
    assert least_over_all(motor, values, 1.01 * times) < 0.0
    own = [
        n
        for n in values
        if n.startswith("inductance_harmonics.") and not n.endswith((".order", ".phase"))
    ]
    library.check_inside(motor, converter, values | {n: 0.999 * times * values[n] for n in own})
    with pytest.raises(BadInput, match="not convex at every angle"):
        library.check_inside(motor, converter, values | {n: 1.001 * times * values[n] for n in own})


def test_the_refusal_names_what_the_user_gave():
    """The reviewer's case: 0.99 of what a recording may have, 6 alpha_30 L_d^2 I = 0.99; at 250 %
    of rated current the second derivatives are 2.5 times as much less, beside nearly those of zero
    current."""
    alpha = 0.99 / (6.0 * MOTOR.inductance_d**2 * MOTOR.rated_current)
    effects = {"inductance_harmonics.4.alpha_30": -alpha, "inductance_harmonics.4.order": 18.0}
    values = library.complete(MOTOR, DRIVE.converter, effects)
    with pytest.raises(
        BadInput, match=r"^inductance_harmonics\.4\.alpha_30: .* below .* A/Wb\^2.*; lower it$"
    ) as got:
        library.check_inside(MOTOR, DRIVE.converter, values)
    bound = float(re.search(r"below ([\d.]+)", str(got.value)).group(1))
    assert 0.3 * alpha < bound < 0.5 * alpha
    assert f"{alpha:g}" in str(got.value)
    with pytest.raises(BadInput, match=r"^inductance_harmonics\.4\.alpha_30.* in proportion$"):
        library.check_inside(MOTOR, DRIVE.converter, values | {"inductance_harmonics.gamma_6": 0.1})


def test_saturation_that_effects_change_is_the_motor_s_own():
    """With alphas three times those of the motor, H is another energy: that of a motor that has
    them."""
    effects = {
        f"saturation.{n}": 3.0 * getattr(MOTOR, n) for n in ("alpha_40", "alpha_22", "alpha_04")
    }
    effects |= {"inductance.scale_d": 1.2}
    harmonic = {"inductance_harmonics.2.alpha_30": 5.0}
    stiffer = library.true_motor(MOTOR, library.complete(MOTOR, DRIVE.converter, effects))
    (limit,) = inside(
        library.complete(MOTOR, DRIVE.converter, effects | harmonic), MOTOR, DRIVE.converter
    )
    assert (limit,) == tuple(
        inside(library.complete(stiffer, DRIVE.converter, harmonic), stiffer, DRIVE.converter)
    )
    (plain,) = inside(library.complete(MOTOR, DRIVE.converter, harmonic), MOTOR, DRIVE.converter)
    assert abs(plain.bound / limit.bound - 1.0) > 0.1
