"""A leg's voltage error as a free curve: its mean over a current's way, what simpler forms make of
it."""

import json

import numpy as np
import pytest
from scipy.integrate import quad

from model.drive_files import load_drive
from model.effects import dead_time, device_drop, library
from model.effects.card import Legs
from model.effects.leg_voltage import CARD, CORNERS, VOLTS, curve, leg_slope, lost, said, whole

DRIVE = load_drive("ipm_exchanged")


def completed(**volts):
    """Return completed values of an effect with some terms (V)."""
    return library.complete(
        DRIVE.motor, DRIVE.converter, {f"leg_voltage.{k}": x for k, x in volts.items()}
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    "ends",
    [
        (0.3, 1.2),
        (-0.1, 0.7),
        (-3.0, -2.0),
        (-0.001, 0.005),
        (0.02, 0.02),
        (-0.7, -0.7),
        (5.0, -5.0),
    ],
)
def test_the_mean_is_that_of_the_curve_on_the_way(ends, sign):
    """Means over pieces that end where the curve bends, each straight: the trapezoidal rule is
    exact there."""
    sizes = sign * np.random.default_rng(1).normal(size=len(VOLTS))
    v, (x, y) = completed(**dict(zip(VOLTS, sizes, strict=True))), ends
    places = np.array([s * c for c in CORNERS for s in (-1.0, 1.0)]) * DRIVE.motor.rated_current
    t = np.unique([x, y, *(p for p in (*places, 0.0) if min(ends) < p < max(ends))])
    found = curve(v, DRIVE.motor, t)
    mean = np.trapezoid(found, t) / abs(y - x) if x != y else found[0]
    assert lost(*sizes, DRIVE.motor.rated_current, x, y) == pytest.approx(mean, abs=1e-9)


def test_a_current_of_reference_of_its_own_moves_the_corners():
    """At twice the rated current all corners come at twice the currents."""
    own = completed(v_3=1.0)
    wide = completed(v_3=1.0, reference=2.0 * DRIVE.motor.rated_current)
    i = np.linspace(-1.0, 1.0, 7) * DRIVE.motor.rated_current
    assert np.allclose(curve(wide, DRIVE.motor, 2.0 * i), curve(own, DRIVE.motor, i), rtol=1e-15)


def test_a_drop_and_a_resistance_are_told_as_these():
    """The smallest corner lies below all currents that are looked at; the largest is a resistance
    up to twice rated."""
    ohm = 0.5 * DRIVE.motor.resistance
    v = completed(v_1=0.7, v_12=ohm * 2.0 * DRIVE.motor.rated_current)
    text = said(v, DRIVE.motor, DRIVE.converter)
    assert "A threshold of 700 mV" in text
    assert f"{ohm:.2g}" in text
    assert "100 %" in text


def test_the_table_that_it_proposes_is_the_curve():
    """What stands in [drive] inverter_table then: straight between corners, so the same
    everywhere."""
    v = completed(v_2=0.4, v_7=-0.3, v_9=1.1)
    found = CARD.do(v, DRIVE.motor, DRIVE.converter).partition("inverter_table = ")[2]
    points = np.array(json.loads(found))
    i = np.linspace(0.0, 3.0, 301) * DRIVE.motor.rated_current
    # three digits are given
    assert np.allclose(np.interp(i, *points.T), curve(v, DRIVE.motor, i), atol=5e-3 * 1.8)


@pytest.mark.parametrize(
    "terms", [{"v_1": -0.4}, {"v_1": 0.1, "v_3": -0.4, "v_4": -0.1, "v_6": 0.3}]
)
def test_what_it_gives_back_ends_where_the_curve_turns(terms):
    """The curve falls from zero on, by its slope there, to its least value, at a corner."""
    v, legs = completed(**terms), Legs(400.0, 1e-4, 0.1)
    i = DRIVE.motor.rated_current * np.append(0.0, CORNERS)
    falls = curve(v, DRIVE.motor, i)
    ohms, within = leg_slope(v, DRIVE.motor, legs)
    assert ohms == pytest.approx(falls[1] / i[1])
    assert within == pytest.approx(i[np.argmin(falls)])
    assert leg_slope(completed(v_2=0.3), DRIVE.motor, legs).within == 0.0
    assert leg_slope(completed(), DRIVE.motor, legs) == (0.0, 0.0)


@pytest.mark.parametrize(("capacitance", "center"), [(0.0, 0.0), (0.0, 0.8), (2e-10, -0.5)])
@pytest.mark.parametrize("current", [-2.0, -0.02, 0.0, 0.004, 0.05, 1.0])
def test_the_whole_curve_holds_dead_time_and_drop_as_the_plant_has_them(
    current, capacitance, center
):
    """At a constant current a leg that it keeps up rises late and falls at once: the difference of
    both latenesses, each by the plant's equations, times the link, once a period; the drop is the
    plant's mean at one current."""
    v = completed(v_3=0.4) | {
        "dead_time.time": 2e-6,
        "dead_time.capacitance": capacitance,
        "dead_time.residual": 1e-7,
        "device_drop.threshold": 1.5,
        "device_drop.on_resistance": 0.2,
        "bench.soft_current": 0.03,
        "bench.soft_shape": 0.25,
        "bench.soft_center": center,
    }
    link = DRIVE.converter.dc_bus_voltage
    numbers = (2e-6, capacitance, 1e-7, 0.03, 0.25, center)

    def edge(hold):
        ends = (hold, 0.0, 0.0, link)
        return dead_time.late(*numbers, *ends)[0] + dead_time.commutated(*numbers, *ends)

    lateness = edge(current) - edge(-current)
    own = link * lateness / DRIVE.converter.sampling_period
    x = current / 0.03
    drop = device_drop.lost(1.5, 0.0, x, x, 0.25) + 0.2 * current
    simple = float(curve(v, DRIVE.motor, np.array(current)))
    found = float(whole(v, DRIVE.motor, DRIVE.converter, np.array(current)))
    # 0.017 of the drop: `mean_of_tanh` is a fit of tanh
    assert found == pytest.approx(simple + own + drop, abs=0.25 * 0.017 * 1.5 + 1e-9)


@pytest.mark.parametrize("ends", [(0.0, 0.0), (0.02, 1.0), (-0.3, 0.7), (-2.0, -1.0), (0.4, 0.4)])
def test_a_drop_with_a_knee_is_its_mean_on_the_way_and_part_of_the_whole_curve(ends):
    """Against SciPy's quadrature of the exponential; none of it is left at the sharp threshold's
    port."""
    v = library.complete(
        DRIVE.motor,
        DRIVE.converter,
        {"device_drop.threshold": 1.5, "device_drop.knee_current": 0.2},
    )
    whole_way = quad(lambda i: device_drop.leg_loss(v, np.array(i)), *ends, points=[0.0])[0]
    (x, y), at = ends, float(device_drop.leg_loss(v, np.array(ends[0])))
    mean = whole_way / (y - x) if x != y else at
    assert device_drop.lost_at_knee(1.5, 0.2, x, y) == pytest.approx(mean, abs=1e-9)
    assert device_drop.lost(1.5, 0.2, x, y, 0.5) == 0.0
    assert at == pytest.approx(1.5 * np.sign(x) * (1.0 - np.exp(-abs(x) / 0.2)), abs=1e-15)
    assert float(whole(v, DRIVE.motor, DRIVE.converter, np.array(x))) == pytest.approx(at)
