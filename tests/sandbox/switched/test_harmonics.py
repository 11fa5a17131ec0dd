"""Harmonics of any orders on the switched bench: one energy behind current and torque, nothing lost
or gained."""

import cmath
import math

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.switched.advance import MODES, flux_for, replay, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.harmonics import (
    CoggingHarmonic,
    FluxHarmonic,
    InductanceHarmonic,
    harmonics,
    largest_swing,
)
from sandbox.switched.inverter import advance
from sandbox.switched.phase_machine import (
    accelerations,
    current_and_torque,
    least_stiffness,
    stored_energy,
)
from tests.sandbox.switched.all_effects import ALL_ON, commands, unaccounted

IPM = load_drive("ipm")
MOTOR, POLES = IPM.motor, IPM.motor.pole_pairs
FLUX = (
    FluxHarmonic(6.0, 0.003, -0.002, 0.4, 0.8),
    FluxHarmonic(12.0, 0.001, 0.0015, -1.1, -0.5),
    FluxHarmonic(2.0, 0.001, 0.002, 0.2),
)
INDUCTANCE = (
    InductanceHarmonic(6.0, 0.5, 0.2, 0.3),
    InductanceHarmonic(-12.0, 0.3, 0.0, 1.0),
    InductanceHarmonic(18.0, 0.1, -0.1, -1.0, 0.25, 2.0, -3.0, 4.0, 1.5),
)
COGGING = (CoggingHarmonic(36.0, 0.02, 0.5), CoggingHarmonic(24.0, 0.01, -1.0))
LISTS = harmonics(MOTOR, FLUX, INDUCTANCE, COGGING)
BENCH = quiet(bench(MOTOR, IPM.converter))
RICH = BENCH._replace(harmonics=LISTS)


def energy(psi, theta):
    """Return H (J) as `harmonics` writes it, in the rotor frame on the paper's polynomial (eq.
    EnerSat)."""
    m = MOTOR
    rated_2 = m.inductance_d * m.inductance_q * m.rated_current**2
    z_0 = psi * cmath.exp(-1j * theta) - m.magnet_flux
    z = z_0
    for f in FLUX:
        x = f.order * theta + f.phase
        amplitude = 1.0 + f.growth * abs(z_0) ** 2 / rated_2
        z -= amplitude * complex(f.psi_d * math.cos(x), f.psi_q * math.sin(x))
    d, q = z.real, z.imag
    h = (
        d * d / (2 * m.inductance_d)
        + q * q / (2 * m.inductance_q)
        + m.alpha_30 * d**3
        + m.alpha_12 * d * q * q
    )
    h += m.alpha_40 * d**4 + m.alpha_22 * d * d * q * q + m.alpha_04 * q**4
    for g in INDUCTANCE:
        x = g.order * theta + g.phase
        h += 0.5 * g.gamma * ((d * d - q * q) * math.cos(x) + 2.0 * d * q * math.sin(x))
        h += 0.5 * g.back * ((d * d - q * q) * math.cos(x) - 2.0 * d * q * math.sin(x))
        h += 0.5 * g.pulse * (d * d + q * q) * math.cos(x)
        h += (g.alpha_30 * d**3 + g.alpha_12 * d * q * q) * math.cos(x)
        h += (g.alpha_21 * d * d * q + g.alpha_03 * q**3) * math.sin(x)
    return h


@pytest.mark.parametrize(
    ("psi", "theta"), [(0.09 + 0.06j, 0.37), (-0.12 + 0.05j, 2.9), (0.02 - 0.11j, -1.3)]
)
def test_current_and_torque_derive_from_one_energy(psi, theta):
    """Gradient and -3/2 p dH/dtheta by central differences of step 1e-6 (1e-12 of third
    derivatives, 1e-8 rounding)."""
    h = 1e-6
    i, torque = current_and_torque(RICH, psi, theta)
    slope = (energy(psi + h, theta) - energy(psi - h, theta)) / (2 * h)
    across = (energy(psi + 1j * h, theta) - energy(psi - 1j * h, theta)) / (2 * h)
    assert stored_energy(RICH, psi, theta) == pytest.approx(energy(psi, theta), rel=1e-12)
    assert i == pytest.approx(complex(slope, across), rel=1e-7)
    turn = (energy(psi, theta + h) - energy(psi, theta - h)) / (2 * h)
    assert torque == pytest.approx(-1.5 * POLES * turn, rel=1e-6)
    plain, plain_torque = current_and_torque(BENCH, psi, theta)
    assert abs(i - plain) > 0.01 * MOTOR.rated_current
    assert abs(torque - plain_torque) > 0.01 * MOTOR.rated_torque


@pytest.mark.parametrize("psi", [0.09 + 0.06j, 0.14 - 0.1j])
def test_least_stiffness_is_the_smaller_eigenvalue(psi):
    theta, h = 0.37, 1e-6
    slope = [
        (current_and_torque(RICH, psi + s, theta)[0] - current_and_torque(RICH, psi - s, theta)[0])
        / (2 * h)
        for s in (h, 1j * h)
    ]
    jacobian = np.array([[z.real for z in slope], [z.imag for z in slope]])
    assert jacobian[0, 1] == pytest.approx(jacobian[1, 0], rel=1e-5)  # reciprocal
    found = least_stiffness(RICH, psi, theta)
    assert found == pytest.approx(np.linalg.eigvalsh(jacobian)[0], rel=1e-6)
    assert abs(found - least_stiffness(BENCH, psi, theta)) > 1e-3 * found


def test_a_list_of_the_sixth_alone_is_the_library_s_single_order():
    """The same equation written twice; 1e-13: rounding of cos 6 theta by another path."""
    effects = {
        "flux_harmonics.psi_d6": 0.003,
        "flux_harmonics.psi_q6": -0.002,
        "inductance_harmonics.gamma_6": 0.5,
    }
    effects |= {
        "cogging_torque.amplitude": 0.02,
        "cogging_torque.order_mech": 36.0,
        "cogging_torque.phase": 0.5,
    }
    single = quiet(bench(MOTOR, IPM.converter, effects))
    lists = harmonics(
        MOTOR,
        [FluxHarmonic(6.0, 0.003, -0.002)],
        [InductanceHarmonic(6.0, 0.5)],
        [CoggingHarmonic(36.0, 0.02, 0.5)],
    )
    listed = BENCH._replace(harmonics=lists)
    for theta in (0.1, 2.0, -3.0):
        i, torque = current_and_torque(listed, 0.1 + 0.05j, theta)
        expected = current_and_torque(single, 0.1 + 0.05j, theta)
        assert i == pytest.approx(expected[0], rel=1e-13)
        assert torque == pytest.approx(expected[1], rel=1e-12)
        a, b = (accelerations(x, 0.1, 0.05, theta, 3.0, 3.0, 0.0)[0] for x in (listed, single))
        assert a == pytest.approx(b, rel=1e-12)
    # the lists stand beside the first entry, they do not replace it
    both = single._replace(harmonics=lists)
    twice = quiet(bench(MOTOR, IPM.converter, {k: 2.0 * v for k, v in effects.items() if "6" in k}))
    i = current_and_torque(both._replace(cogging=0.0), 0.1 + 0.05j, 0.7)[0]
    assert i == pytest.approx(current_and_torque(twice, 0.1 + 0.05j, 0.7)[0], rel=1e-12)


def test_flux_for_a_current_is_found_with_growing_harmonics():
    i = 0.8 - 0.5j
    assert current_and_torque(RICH, flux_for(RICH, i, 1.2), 1.2)[0] == pytest.approx(i, rel=1e-10)


def test_growth_is_the_share_at_rated_current_s_flux():
    """Along d: z = z_0 - psi_d (1 + growth) at z_0 = sqrt(L_d L_q) I_rated, on a linear energy."""
    rated = math.sqrt(MOTOR.inductance_d * MOTOR.inductance_q) * MOTOR.rated_current
    lists = harmonics(MOTOR, [FluxHarmonic(6.0, 0.002, 0.0, 0.0, 0.7)])
    zeros = dict.fromkeys((f"saturation.alpha_{n}" for n in ("30", "12", "40", "22", "04")), 0.0)
    b = quiet(bench(MOTOR, IPM.converter, zeros))._replace(harmonics=lists)
    stored = stored_energy(b, complex(MOTOR.magnet_flux + rated), 0.0)
    assert stored == pytest.approx(
        (rated - 0.002 * 1.7) ** 2 / (2.0 * MOTOR.inductance_d), rel=1e-12
    )


def test_energy_balance_closes_with_all_lists_and_a_fan():
    """Electrical in = losses + mechanical out + change of what is stored, as with the library's
    effects alone."""
    b = quiet(bench(MOTOR, IPM.converter, ALL_ON))._replace(audit=1.0, harmonics=LISTS, fan=2e-5)
    b = b._replace(
        one_sided=0.3, link_rate=3000.0, link_impedance=4.0, link_damping=0.2, least_pulse=8e-6
    )
    state = start(b, theta=0.2, speed=60.0)

    before, peak = unaccounted(b, state), 0.0
    u_alpha, u_beta = commands(800, amplitude=60.0)
    for k in range(800):
        advance(state, b, MODES["free"], u_alpha[k], u_beta[k], 398.0, 0.15, 0.0)
        peak = max(peak, abs(unaccounted(b, state) - before))
    assert state[Slot.LOSS] > 5.0
    assert peak < 2e-5 * state[Slot.LOSS]


def test_back_emf_has_the_orders_of_the_list():
    """A driven rotor behind a winding of 1000 ohm: current is -dpsi/dt / R; order n of flux gives
    n -+ 1 in phases.

    u = j omega (phi_m + sum of both senses): the rotor-frame line at n omega is (n + 1) (psi_d +
    psi_q) / 2, that at -n omega (n - 1) (psi_q - psi_d) / 2 times omega, beside omega phi_m.  5e-3:
    the drop of the inductance.
    """
    lists = harmonics(MOTOR, [FluxHarmonic(12.0, 0.002, 0.001, 0.3)])
    b = quiet(bench(MOTOR, IPM.converter, {"stator_resistance.resistance": 900.0}))._replace(
        harmonics=lists
    )
    n, h = 4000, IPM.converter.sampling_period
    omega = 2.0 * math.pi * 5 / (n * h)
    theta = omega * h * np.arange(2 * n)
    out = replay(
        b, "driven", np.zeros(2 * n), np.zeros(2 * n), 400.0, theta=theta, speed=omega / POLES
    )
    i = (2 * out["i_a"] - out["i_b"] - out["i_c"]) / 3 + 1j * (out["i_b"] - out["i_c"]) / math.sqrt(
        3
    )
    lines = np.fft.fft((i * np.exp(-1j * theta))[n:]) / n * 900.0 / omega
    assert abs(lines[0]) == pytest.approx(MOTOR.magnet_flux, rel=5e-3)
    assert abs(lines[60]) == pytest.approx(13 * 0.0015, rel=5e-3)
    assert abs(lines[-60]) == pytest.approx(11 * 0.0005, rel=5e-3)
    assert np.abs(lines[[30, -30, 61]]).max() < 1e-5


@pytest.mark.parametrize("size", [0.0, 0.003])
def test_the_closed_loop_takes_a_bench_with_lists(size, monkeypatch):
    """Of no amplitude they leave every channel as it is, by the bit; with one they show."""
    scene, effects = Scenario("short", (Segment(0.05, 0.3, 0.1),), "driven", start_up=False), {}

    def listed(motor, converter, effects=None):
        return bench(motor, converter, effects)._replace(
            harmonics=harmonics(
                motor,
                [FluxHarmonic(12.0, size, 0.0, 0.2)],
                [InductanceHarmonic(6.0, 0.0, 0.0, 0.4)],
            )
        )

    plain = simulate(
        IPM, scene, load_estimator("qnull"), effects=effects, plant="switched", seed=1
    ).recording
    monkeypatch.setattr("sandbox.switched.bench_numbers.bench", listed)
    found = simulate(
        IPM, scene, load_estimator("qnull"), effects=effects, plant="switched", seed=1
    ).recording
    assert np.array_equal(found.table, plain.table) == (size == 0.0)


@pytest.mark.parametrize(
    ("kinds", "told"),
    [
        (([FluxHarmonic(6.0, math.nan)],), "FluxHarmonic: psi_d = nan"),
        (([FluxHarmonic(2e4, 0.001)],), "order = 20000.0 is out of range"),
        (
            ([FluxHarmonic(6.0, 0.06), FluxHarmonic(12.0, 0.06)],),
            "flux harmonics together: 0.12 is out of range",
        ),
        (((), [InductanceHarmonic(6.0, 1e3)]), "inductance harmonics together"),
        (((), (), [CoggingHarmonic(0.5, 0.1)]), "cogging harmonic of order 0.5 has no potential"),
    ],
)
def test_what_no_motor_has_is_refused(kinds, told):
    with pytest.raises(BadInput, match=told):
        harmonics(MOTOR, *kinds)


EXCHANGED = load_drive("ipm_exchanged").motor
FLUX_D, FLUX_Q = (
    x * EXCHANGED.rated_current for x in (EXCHANGED.inductance_d, EXCHANGED.inductance_q)
)


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        ({"alpha_03": 2.0}, 12.0 * FLUX_Q),  # 6 alpha_03 phi_q
        ({"alpha_30": -2.0}, 12.0 * FLUX_D),
        ({"gamma": 3.0, "pulse": -2.0}, 5.0),
        ({"gamma": 3.0, "back": 3.0}, 6.0),  # all of it on cos x (d^2 - q^2)
        ({"alpha_30": 2.0, "gamma": 3.0}, 12.0 * FLUX_D + 3.0),
    ],
)
def test_the_limit_is_of_the_largest_second_derivative(sizes, expected):
    """By hand; the flux of rated current is each axis' own (here L_q is twice L_d)."""
    assert largest_swing(InductanceHarmonic(6.0, phase=0.4, **sizes), EXCHANGED) == pytest.approx(
        expected, rel=1e-12
    )


def test_the_largest_second_derivative_is_that_of_the_bench():
    """Eigenvalues of differences of the bench's own current, with the harmonic and without, at 60
    directions of the current and 120 angles; a grid of directions 2.5 degrees apart, and these, are
    0.3 % from the largest."""
    one = InductanceHarmonic(18.0, 0.1, -0.1, -1.0, 0.25, 2.0, -3.0, 4.0, 1.5)
    listed = BENCH._replace(harmonics=harmonics(MOTOR, (), [one]))
    most, h = 0.0, 1e-5
    for angle in np.arange(60) * (math.tau / 60):
        z = MOTOR.rated_current * complex(
            MOTOR.inductance_d * math.cos(angle), MOTOR.inductance_q * math.sin(angle)
        )
        for theta in np.arange(120) * (math.tau / 120 / 18):
            turn = cmath.exp(1j * theta)

            def added(x, theta=theta, turn=turn):
                both = (
                    current_and_torque(b, (x + MOTOR.magnet_flux) * turn, theta)[0] / turn
                    for b in (listed, BENCH)
                )
                return next(both) - next(both)

            one_way, other = ((added(z + s) - added(z - s)) / (2.0 * h) for s in (h, 1j * h))
            matrix = [[one_way.real, other.real], [one_way.imag, other.imag]]
            most = max(most, float(np.abs(np.linalg.eigvalsh(matrix)).max()))
    assert largest_swing(one, MOTOR) == pytest.approx(most, rel=3e-3)


def test_alpha_03_beyond_the_limit_is_refused():
    """1.1 times 1/L_q over 6 phi_q; with the flux of sqrt(L_d L_q) it would be 0.8 of the limit."""
    size = 1.1 / (6.0 * EXCHANGED.inductance_q * FLUX_Q)
    with pytest.raises(BadInput, match="inductance harmonics together"):
        harmonics(EXCHANGED, (), [InductanceHarmonic(12.0, alpha_03=size)])
    harmonics(EXCHANGED, (), [InductanceHarmonic(12.0, alpha_03=0.9 * size)])
