"""The integrator against closed forms, an independent integrator, its own order, and the balance of
energy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments.testbench import plant
from experiments.testbench.design import (
    fixed,
    inverter,
    losses,
    magnetics,
    mechanics,
    nominal_design,
    sensors,
)
from experiments.testbench.drives import DRIVES
from experiments.testbench.types import FLOATING, FREE, HIGH, LOCKED, LOW, World

DRIVE = next(d for d in DRIVES if d.name == "ipm_2kw")
STILL = ((0.0, 1.0, 0.0), (0.0, 2.0, 0.0))


def _parts(change=lambda d: None, drive=DRIVE):
    d = nominal_design(drive, None)
    change(d)
    return d, (magnetics(d), losses(d), inverter(d), mechanics(d), sensors(d))


def _advance(parts, y, end, step, legs, world=None, memory=None):
    mag, loss, inv, mech, sens = parts
    n = y.size
    work = tuple(np.zeros(n) for _ in range(5))
    world = world or World(LOCKED, 0.0, 0.0, 0.0, 0.0, STILL)
    memory = np.zeros(3) if memory is None else memory
    plant.advance(
        0.0, end, y, step, work, np.zeros(n), legs, mag, loss, inv, mech, sens, world, memory
    )
    return y


def _linear(d):
    """No saturation and equal inductances, so that a phase is R and L in series."""
    for key in d.true:
        if key.startswith("alpha"):
            d.true[key] = 0.0
    d.true["inductance_q"] = d.true["inductance_d"]


def _start(d, theta=0.0):
    y = np.zeros(plant.STATES)
    y[0], y[1], y[2] = (
        d.true["magnet_flux"] * np.cos(theta),
        d.true["magnet_flux"] * np.sin(theta),
        theta,
    )
    y[6] = d.drive.link
    return y


def test_current_rise_is_the_exponential_of_r_and_l():
    """Leg a high, b and c low, rotor locked, linear: i_a = 2/3 U/R (1 - exp(-R t/L)); RK4 leaves
    h^4."""
    d, parts = _parts(_linear)
    legs = np.array([[HIGH, LOW, LOW], [0, 0, 0]])
    t = 2e-3
    y = _advance(parts, _start(d), t, 1e-5, legs)
    i, _, _ = plant.currents(parts[0], parts[1], y, np.zeros(3))
    r, ell = d.true["resistance"], d.true["inductance_d"]
    assert i == pytest.approx(2 / 3 * DRIVE.link / r * -np.expm1(-r * t / ell), rel=1e-10)


def _free_run(parts, d, step):
    """4 ms without switching, with all that is smooth: saturation, core loss, skin effect, filter,
    cogging."""
    legs = np.array([[HIGH, LOW, HIGH], [0, 0, 0]])
    y = _start(d, 0.3)
    y[3] = 40.0
    return _advance(parts, y, 4e-3, step, legs, World(FREE, 1.0, 0.0, 0.0, 0.0, STILL))


def _rich(d):
    d.loss["eddy"][0] = 1e-3, 2e-4
    d.loss["skin"][0] = 1.0, 1.5e-4
    d.sens["filter"] = np.array([2.0, 1e-4, 0.7])
    d.mech["cogging"] = np.array([[1.0, 36.0, 0.2]])
    d.mag["harmonics"] = np.array([[6.0, 5e-3, 1e-3, 0.0, 5e-3]])
    d.mag["saliency"] = np.array([0.5, 0.2, 1.0])
    d.inv["drop_ideal"] = np.array([0.0, 0.1])


def test_fourth_order_convergence():
    """Halving the step divides the error by 2^4: the rate between two halvings is within 12 to
    20."""
    d, parts = _parts(_rich)
    best = _free_run(parts, d, 2.5e-6)
    errors = [np.abs(_free_run(parts, d, h) - best)[[0, 1, 2, 3, 11, 12]] for h in (4e-5, 2e-5)]
    assert 12 < np.linalg.norm(errors[0]) / np.linalg.norm(errors[1]) < 20


def test_the_same_run_by_an_independent_integrator():
    """The same equations written anew, phase quantities in complex form, by DOP853 with 1e-11."""
    d, parts = _parts(_rich)
    t, drive = d.true, d.drive
    ours = _free_run(parts, d, 1e-5)
    p, magnet = drive.pole_pairs, t["magnet_flux"]

    def energy_gradient(f_d, f_q):
        i_d = f_d / t["inductance_d"] + 3 * t["alpha_30"] * f_d**2 + t["alpha_12"] * f_q**2
        i_d += 4 * t["alpha_40"] * f_d**3 + 2 * t["alpha_22"] * f_d * f_q**2
        i_q = (
            f_q / t["inductance_q"]
            + 2 * t["alpha_12"] * f_d * f_q
            + 2 * t["alpha_22"] * f_d**2 * f_q
        )
        return i_d, i_q + 4 * t["alpha_04"] * f_q**3

    def energy(f, theta):
        """H of the saliency's harmonics, for a derivative by differences."""
        q = [g * np.real(np.exp(-1j * k * theta) * f**2) for g, k in ((0.5, 6), (0.2, 12))]
        return 0.5 * sum(q) / (1 + abs(f) ** 2)

    def right(_, y):
        psi, theta, w, eddy, skin = y[0] + 1j * y[1], y[2], y[3], y[4] + 1j * y[5], y[6] + 1j * y[7]
        turn = np.exp(1j * theta)
        harmonic = (
            5e-3 * np.cos(6 * theta) + 1e-3 * np.sin(6 * theta) + 1j * 5e-3 * np.sin(6 * theta)
        )
        slope = 6 * (
            -5e-3 * np.sin(6 * theta) + 1e-3 * np.cos(6 * theta) + 1j * 5e-3 * np.cos(6 * theta)
        )
        f = psi / turn - magnet - harmonic
        i_d, i_q = energy_gradient(f.real, f.imag)
        h = 1e-6
        i_d += (energy(f + h, theta) - energy(f - h, theta)) / (2 * h)
        i_q += (energy(f + 1j * h, theta) - energy(f - 1j * h, theta)) / (2 * h)
        pull = -(energy(f, theta + h) - energy(f, theta - h)) / (2 * h)
        i = (i_d + 1j * i_q) * turn
        torque = (np.conj(psi) * i).imag + (np.conj(i_d + 1j * i_q) * slope).real + pull
        i = i + eddy
        drop = i * (t["resistance"] + 0.1) + 1.0 * (i - skin)
        v = 2 / 3 * drive.link * (1 + np.exp(4j * np.pi / 3)) - drop
        d_eddy, d_skin = (1e-3 * v - eddy) / 2e-4, (i - skin) / 1.5e-4
        friction = t["viscous_friction"] * w
        cogging = 1.0 * np.sin(36 * theta / p + 0.2)
        dw = (1.5 * p * torque - friction + cogging - 1.0) / t["inertia"]
        return [v.real, v.imag, p * w, dw, d_eddy.real, d_eddy.imag, d_skin.real, d_skin.imag]

    start = [magnet * np.cos(0.3), magnet * np.sin(0.3), 0.3, 40.0, 0, 0, 0, 0]
    theirs = solve_ivp(right, (0, 4e-3), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(ours[[0, 1, 2, 3, 15, 16, 21, 22]], theirs, rtol=2e-6, atol=1e-6)


def test_a_floating_leg_slews_at_the_current_over_its_capacitance():
    """L so large that the current is constant: v falls from U by i t/C, and is clamped at 0 at
    t = C U / i.

    Four periods of the slew are asked for; the event must be found to 1e-7 of the link.
    """

    def big(d):
        _linear(d)
        d.true["inductance_d"] = d.true["inductance_q"] = 1e3
        d.true["resistance"] = 0.0
        d.inv["dead_time"], d.inv["capacitance"] = 2e-6, 1e-9

    d, parts = _parts(big)
    y = _start(d)
    current = 3.0
    y[0] += 1e3 * current  # i_alpha = i_a
    legs = np.array([[HIGH, LOW, LOW], [0, 0, 0]])
    mag, loss, inv, _, _ = parts
    plant.switch(0, FLOATING, 0.0, y, legs, mag, loss, inv, np.zeros(3))
    assert legs[1, 0] == 0
    full = inv.capacitance * d.drive.link / current
    half = _advance(parts, y.copy(), 0.5 * full, 1e-5, legs.copy())
    assert half[8] == pytest.approx(0.5 * d.drive.link, rel=1e-6)
    _advance(parts, y, 4 * full, 1e-5, legs)
    assert legs[1, 0] == -1
    # volt-seconds after the gate: U full/2, then nothing; the flux of a linear machine shows it
    # (2/3 of leg a acts on alpha; magnitudes of V s against 1e3 H * 3 A in the same double: 1e-12
    # relative)
    gained = y[0] - (d.true["magnet_flux"] + 1e3 * current)
    assert gained == pytest.approx(2 / 3 * 0.5 * d.drive.link * full, rel=2e-5)


def test_small_currents_leave_the_leg_unclamped_until_it_is_switched_hard():
    """Below C U / t_d the leg does not reach the rail; a current into the leg is taken by the upper
    diode at once."""

    def small(d):
        _linear(d)
        d.true["inductance_d"] = d.true["inductance_q"] = 10.0
        d.inv["dead_time"], d.inv["capacitance"] = 2e-6, 1e-8

    d, parts = _parts(small)
    mag, loss, inv, _, _ = parts
    for current, clamp in ((0.5, 0), (-0.5, 1)):
        y = _start(d)
        y[0] += 10.0 * current
        legs = np.array([[HIGH, LOW, LOW], [0, 0, 0]])
        plant.switch(0, FLOATING, 0.0, y, legs, mag, loss, inv, np.zeros(3))
        _advance(parts, y, 2e-6, 1e-5, legs)
        assert legs[1, 0] == clamp
        if clamp == 0:
            assert y[8] == pytest.approx(d.drive.link - current * 2e-6 / 1e-8, rel=1e-3)
        plant.switch(0, LOW, 2e-6, y, legs, mag, loss, inv, np.zeros(3))
        assert legs[0, 0] == LOW


def test_a_diode_lets_go_where_its_current_ends():
    """A clamped leg whose current falls through zero floats from then on: found within the dead
    time."""

    def quick(d):
        _linear(d)
        d.true["resistance"] = 0.0
        d.inv["dead_time"], d.inv["capacitance"] = 40e-6, 1e-8

    d, parts = _parts(quick)
    ell = d.true["inductance_d"]
    y = _start(d)
    current = 0.02
    y[0] += ell * current
    # lower diode of a carries; b, c drive the current down
    legs = np.array([[FLOATING, HIGH, HIGH], [-1, 0, 0]])
    y[8] = 0.0
    _advance(parts, y, 40e-6, 1e-5, legs)
    assert y[8] > 1.0, "the leg has left the lower rail"
    # i_a falls by 2/3 U / L: after current / that the diode's current is zero
    assert current / (2 / 3 * d.drive.link / ell) < 4e-6


def test_energy_is_balanced():
    """1.5 (i . v) dt = heat + work of torque + magnetic energy, with a lossless shaft and no core
    loss.

    The magnetic energy is the quartic H; integrals by the trapezoid over 1 us leave 1e-5 of the
    power.
    """
    d, parts = _parts()
    t = d.true
    legs = np.array([[HIGH, LOW, LOW], [0, 0, 0]])
    y = _start(d, 0.4)
    y[3] = 60.0
    world = World(FREE, 0.0, 0.0, 0.0, 0.0, STILL)

    def stored(y):
        c, s = np.cos(y[2]), np.sin(y[2])
        f_d, f_q = c * y[0] + s * y[1] - t["magnet_flux"], c * y[1] - s * y[0]
        h = f_d**2 / (2 * t["inductance_d"]) + f_q**2 / (2 * t["inductance_q"])
        h += t["alpha_30"] * f_d**3 + t["alpha_12"] * f_d * f_q**2 + t["alpha_40"] * f_d**4
        return 1.5 * (h + t["alpha_22"] * f_d**2 * f_q**2 + t["alpha_04"] * f_q**4)

    first, kinetic = stored(y), 0.5 * t["inertia"] * y[3] ** 2
    h, powers = 1e-6, []
    for k in range(2001):
        i_a, i_b, _ = plant.currents(parts[0], parts[1], y, np.zeros(3))
        taken = 1.5 * (2 / 3 * d.drive.link * i_a)  # v_beta = 0
        powers.append(
            taken - 1.5 * t["resistance"] * (i_a**2 + i_b**2) - t["viscous_friction"] * y[3] ** 2
        )
        if k < 2000:
            _advance(parts, y, h, h, legs, world)
    put_in = np.trapezoid(powers, dx=h)
    held = stored(y) - first + 0.5 * t["inertia"] * y[3] ** 2 - kinetic
    assert put_in == pytest.approx(held, rel=1e-5)


def test_vector_play_follows_at_its_threshold():
    """On a circle much larger than the threshold the state lags; its distance is the threshold
    exactly."""
    x, y = 0.0, 0.0
    for a in np.linspace(0, 6, 400):
        x, y = plant.play(x, y, np.cos(a), np.sin(a), 0.1)
    assert np.hypot(np.cos(6) - x, np.sin(6) - y) == pytest.approx(0.1, rel=1e-9)
    assert plant.play(0.0, 0.0, 0.05, 0.0, 0.1) == (0.0, 0.0)


def test_bristle_ends_at_the_stribeck_curve():
    """At constant speed sigma_0 z -> g(w): the friction is g(w) + viscous, whatever the step."""

    def lugre(d):
        d.mech["lugre"] = np.array([0.5, 0.8, 2.0, 250.0, 0.0])

    d, parts = _parts(lugre)
    mech = parts[3]
    memory = np.zeros(3)
    for _ in range(50):
        plant.relax_bristle(mech, 1.5, 1e-3, memory)
    g = 0.5 + 0.3 * np.exp(-((1.5 / 2) ** 2))
    assert plant.friction(mech, 1.5, memory[0]) == pytest.approx(
        g + 1.5 * d.true["viscous_friction"], rel=1e-12
    )


def test_a_bench_without_extras_reads_no_state_that_it_lacks():
    """The short state is a view whose next element is not a number: read beyond its end and all
    currents are lost."""
    d, parts = _parts()
    backing = np.full(plant.STATES, np.nan)
    y = backing[: plant.FEW]
    y[:] = _start(d)[: plant.FEW]
    legs = np.array([[HIGH, LOW, FLOATING], [0, 0, -1]])
    out = np.zeros(plant.FEW)
    world = World(LOCKED, 0.0, 0.0, 0.0, 0.0, STILL)
    plant.slopes(0.0, y, out, legs, *parts, world, np.zeros(3))
    assert np.all(np.isfinite(out))


def test_neutral_parts_are_tuples():
    """What the compiler sees must not change its type with the draw: else it compiles anew for each
    campaign."""
    assert fixed(np.zeros((2, 2))) == ((0.0, 0.0), (0.0, 0.0))
    _, one = _parts()
    _, two = _parts(_rich)
    for a, b in zip(one, two, strict=True):
        for x, z in zip(a, b, strict=True):
            assert type(x) is type(z)
            assert np.shape(x) == np.shape(z)
