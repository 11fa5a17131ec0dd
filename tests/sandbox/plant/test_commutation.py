"""Dead time with output capacitances: closed forms, an event-exact circuit, the readable
reference."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from model.commutation import lateness, quick, static_sign
from model.effects.dead_time import commutated, late
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import replay
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from tests.sandbox.plant.effect_motors import LINEAR
from tests.sandbox.plant.six_switches import Circuit
from tests.sandbox.plant.stated_duties import DRIVE, apart, finer, from_duties, reference, turning

MOTOR = dataclasses.replace(LINEAR, magnet_flux=0.1)
COIL = dataclasses.replace(DRIVE, motor=MOTOR)
TIME, LINK, PERIODS = 2e-6, 400.0, 12
NO_CAPACITANCE = 1e-15  # F: as good as none, and not the zone that stands for an unknown one
PPM = 50e-6  # of rated current: what the plant may differ from the circuit


@pytest.mark.parametrize("amps", [3.0, 0.2, 0.05, 1e-3, -1e-3, -0.05, -0.08, -0.2, -3.0])
def test_at_constant_current_an_edge_is_late_by_the_printed_curve(amps):
    """t_d kept; t_d - t_d^2 |i|/(4 C V) where the leg does not arrive; C V/|i| where it does
    (Zhang, Xu 2014)."""
    c = 100e-12
    arrives = 2.0 * c * LINK / TIME
    printed = TIME if amps > 0.0 else TIME - TIME**2 * -amps / (4.0 * c * LINK)
    printed = c * LINK / -amps if amps < -arrives else printed
    assert lateness(TIME, c, LINK, amps, -1e-9, 1e-9) == pytest.approx(printed, rel=1e-9)
    assert 0.5 * TIME * (1.0 + static_sign(amps, arrives)) == pytest.approx(printed, rel=1e-12)


# where between the rails the leg would rest
@pytest.mark.parametrize("rest", [-0.3, 0.2, 0.5, 0.9, 1.4])
# current, of what either scale of it says
@pytest.mark.parametrize("share", [-2.0, -0.7, -0.1, 0.0, 0.1, 0.6])
def test_a_current_that_changes_is_integrated_as_by_scipy(rest, share):
    """The leg's equations, clamped, by an adaptive integrator of SciPy; a clamp is met to one of
    400 pieces."""
    steep, c = 2.0 / 3.0 * LINK / 5e-3, 200e-12
    before, charge = -rest * steep, 2.0 * c * LINK
    hold = share * max(steep * TIME, charge / TIME)

    def slopes(t, y):
        x = min(max(y[0], 0.0), 1.0)
        kept = (y[0] <= 0.0 < y[1]) or (y[0] >= 1.0 and y[1] < 0.0)
        return [0.0 if kept else -y[1] / charge, before + steep * x, x]

    y = np.array([0.0, hold, 0.0])
    for _ in range(400):
        y = solve_ivp(slopes, (0.0, TIME / 400), y, rtol=1e-8, atol=1e-12).y[:, -1]
        y[0] = min(max(y[0], 0.0), 1.0)
    assert lateness(TIME, c, LINK, hold, before, before + steep) == pytest.approx(
        TIME - y[2], abs=TIME / 400
    )


def test_far_from_zero_the_quick_form_is_the_same():
    """To the square of slope times charge over current squared, a tenth of it (SMALL in the
    module)."""
    steep, c = 2.0 / 3.0 * LINK / 5e-3, 100e-12
    for amps in (-1.0, -0.5, 2.0):
        bent = steep * 2.0 * c * LINK / amps**2
        exact = lateness(TIME, c, LINK, amps, -0.5 * steep, 0.5 * steep)
        assert quick(
            TIME, 2.0 * c * LINK, amps, 1.0 / abs(amps), -0.5 * steep, 0.5 * steep
        ) == pytest.approx(exact, rel=0.1 * bent**2)


def volts_of(volts, angle, injected, speed):
    """Return the voltages (n,) complex, V, of a pattern."""
    k = np.arange(PERIODS)
    u = (volts + 6.4) * np.exp(1j * angle) + injected * np.where(k % 2, 1.0, -1.0)
    return u * np.exp(1j * speed * (k + 0.5) * COIL.converter.sampling_period)


def pattern(volts, angle, injected, speed):
    """Return duties (n, 3) of a constant and a square-wave voltage (V) that turn with the rotor,
    dead time made up."""
    u = volts_of(volts, angle, injected, speed) / LINK
    legs = np.stack([u.real, u.imag], axis=1) @ LEGS.T
    return 0.5 + legs - 0.5 * (legs.max(axis=1) + legs.min(axis=1))[:, None]


PATTERNS = {
    "two legs alike": (20.0, 0.0, 0.0, 0.0),
    "no current in a leg": (20.0, np.pi / 2, 0.0, 0.0),
    "injection": (20.0, np.pi / 2, 30.0, 0.0),
    "turning": (40.0, 1.6, 30.0, 600.0),
}


@pytest.mark.parametrize("capacitance", [0.0, 100e-12, 300e-12])
@pytest.mark.parametrize("name", PATTERNS)
def test_readings_are_those_of_six_switches(name, capacitance):
    """Of rated current; from no current at all on.  Seen: 0.1 to 1 ppm, 20 where three legs
    commutate at once with hardly any current (the first period): each leg is moved by the mean of
    what the others do meanwhile."""
    duty, speed, m = pattern(*PATTERNS[name]), PATTERNS[name][3], MOTOR
    by_circuit = Circuit(
        m.resistance,
        m.inductance_d,
        m.magnet_flux,
        speed,
        0.3,
        LINK,
        COIL.converter.sampling_period,
        TIME,
        capacitance,
    ).run(duty)
    values = {"dead_time.time": TIME, "dead_time.capacitance": capacitance or NO_CAPACITANCE}
    prepared = finer(from_duties(COIL, duty, *turning(PERIODS, speed, COIL)), 4)
    with_it, without = (replay(prepared, [v]).currents[0][:, :, 0] for v in (values, {}))
    found = apart(COIL, with_it, by_circuit)
    print(
        f"{name}, {capacitance * 1e12:g} pF: {found * 1e6:.2f} ppm; dead time "
        f"{apart(COIL, without, by_circuit):.3f}"
    )
    assert found < PPM
    assert apart(COIL, without, by_circuit) > 100.0 * PPM


@pytest.mark.parametrize("capacitance", [0.0, 300e-12])
def test_the_readable_reference_commutates_alike(capacitance):
    """It and the circuit share nothing: 1e-9 of rated current is what SciPy's integrator leaves."""
    duty, m = pattern(0.0, 1.57, 30.0, 200.0)[:6], MOTOR
    by_circuit = Circuit(
        m.resistance,
        m.inductance_d,
        m.magnet_flux,
        200.0,
        0.3,
        LINK,
        COIL.converter.sampling_period,
        TIME,
        capacitance,
    ).run(duty)
    values = {"dead_time.time": TIME, "dead_time.capacitance": capacitance or NO_CAPACITANCE}
    found = apart(COIL, reference(COIL, values, duty, 200.0)[0], by_circuit)
    print(f"{found * 1e6:.6f} ppm of rated current")
    assert found < 1e-8


@pytest.mark.parametrize("capacitance", [0.0, 100e-12, 300e-12])
def test_the_switched_bench_commutates_alike(capacitance):
    """Its legs slew in 64 steps a dead time, of second order."""
    own, m = PATTERNS["turning"], MOTOR
    by_circuit = Circuit(
        m.resistance,
        m.inductance_d,
        m.magnet_flux,
        own[3],
        0.3,
        LINK,
        COIL.converter.sampling_period,
        TIME,
        capacitance,
    ).run(pattern(*own))
    values, u, (angle, speed) = (
        {"dead_time.time": TIME, "dead_time.capacitance": capacitance or NO_CAPACITANCE},
        volts_of(*own),
        turning(PERIODS, own[3], COIL),
    )
    told_by_it = switched(
        quiet(bench(COIL.motor, COIL.converter, values)),
        "driven",
        u.real,
        u.imag,
        np.full(PERIODS, LINK),
        theta=angle,
        speed=speed / m.pole_pairs,
    )
    found = apart(COIL, np.array([told_by_it[f"i_{x}"] for x in "abc"]).T, by_circuit)
    print(f"{found * 1e6:.2f} ppm of rated current")
    assert found < PPM


@pytest.mark.parametrize("hold", [-1e-15, -1e-12, -1e-9, -1e-6, -1e-4, -1e-3, -1e-2, 1e-12, 1e-6])
@pytest.mark.parametrize("before", [-2e4, -1e2, 1e2, 2e4])
def test_the_two_parts_of_a_late_edge_add_up_at_currents_near_zero(hold, before):
    """What the effect says at first and what it adds when it is asked are `lateness` together, to
    rounding of the dead time: before, the first part had no bound, 1e9 s at 1 uA, in which what was
    added got lost, and an edge acted at once that should have waited 2 us."""
    c, after = 1e-9, before + 3e4
    at = (hold, before, after, LINK)
    first = late(TIME, c, 0.0, 0.0, 0.0, 0.0, *at)[0]
    assert first + commutated(TIME, c, 0.0, 0.0, 0.0, 0.0, *at) == pytest.approx(
        lateness(TIME, c, LINK, hold, before, after), abs=1e-15
    )


@pytest.mark.parametrize("residual", [5e-8, -5e-8])
@pytest.mark.parametrize("shape", [0.0, 1.0])
@pytest.mark.parametrize("hold", [-2.0, -0.03, 0.0, 0.01, 2.0])
def test_what_a_compensation_leaves_adds_to_real_commutation(residual, shape, hold):
    """A drive's compensation moves the command by a sign of the current with a zone; switches and
    diodes act behind it.  By its own formula: |r|/2 (1 + s) late, the other way round where it adds
    too much, s the linear sign of the current or its tanh; behind that the dead time with a
    capacitance as it is alone."""
    c, width, at = 1e-9, 0.02, (hold, 1e3, 4e4, LINK)

    def acts(time, left):
        return late(time, c, left, width, shape, 0.0, *at)[0] + commutated(
            time, c, left, width, shape, 0.0, *at
        )

    x = hold / width
    s = math.tanh(x) if shape else min(max(x, -1.0), 1.0)
    by_hand = 0.5 * abs(residual) + 0.5 * residual * s
    # tanh beyond ten half-widths is taken for 1, which is 4e-9 of it
    assert acts(0.0, residual) == pytest.approx(by_hand, abs=1e-8 * abs(residual))
    alone = lateness(TIME, c, LINK, *at[:3])
    assert acts(TIME, residual) == pytest.approx(alone + by_hand, abs=1e-8 * abs(residual) + 1e-15)


def test_without_a_capacitance_dead_time_and_what_is_left_of_it_are_one():
    """Both act by the same sign with the same zone: edges know their sum only."""
    at = (0.01, 1e3, 4e4, LINK)
    both = late(1e-6, 0.0, 3e-8, 0.02, 0.5, 0.3, *at)
    one = late(1e-6 + 3e-8, 0.0, 0.0, 0.02, 0.5, 0.3, *at)
    assert both == one
