"""Readings inside the PWM period and shifted pulses: the switched bench against closed forms of the
edges; bounds."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from model.drive_files import load_drive
from model.errors import BadInput
from model.parameters import Converter
from sandbox.cli import main
from sandbox.drive.inside import Inside, shift_pulses, volt_seconds
from sandbox.drive.switched_loop import gather
from sandbox.evaluation.step_cost import pwm_ripple
from sandbox.switched.advance import MODES, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import advance, duties

DRIVE = load_drive("ipm_exchanged")
LINEAR = dataclasses.replace(
    DRIVE.motor,
    alpha_30=0.0,
    alpha_12=0.0,
    alpha_40=0.0,
    alpha_22=0.0,
    alpha_04=0.0,
    resistance=1e-5,
)
H, U_DC = DRIVE.converter.sampling_period, DRIVE.converter.dc_bus_voltage
VOLTAGE = st.tuples(st.floats(0.0, 0.99 * U_DC / math.sqrt(3.0)), st.floats(-math.pi, math.pi))
A = np.exp(2j * math.pi / 3)


def edges(u, k, shift):
    """The legs' edges of period k, written down leg by leg: centred pulse, moved as far as it stays
    inside."""
    legs = []
    for leg, (duty, turn) in enumerate(
        zip(duties(u.real, u.imag, U_DC), (1.0, A, A * A), strict=True)
    ):
        place = (leg - (k // 2) % 3) % 3  # 0: moves late in even periods, 1: early, 2: stays
        wanted = (1.0, -1.0, 0.0)[place] * (1.0 if k % 2 == 0 else -1.0) * shift
        room = 0.5 * (1.0 - duty) * H
        moved = max(-room, min(room, wanted))
        legs.append((room + moved, room + moved + duty * H, turn))
    return legs


def flux(legs, t):
    """Integral of the legs' voltage (V s, space vector) from the period's start to t."""
    return sum(2.0 / 3.0 * U_DC * turn * (min(t, fall) - min(t, rise)) for rise, fall, turn in legs)


@pytest.mark.parametrize("u", [0j, 12.0 + 5j, -60.0 + 90j])
def test_current_of_a_linear_motor_follows_the_edges(u):
    """Locked, no resistance: rotor-frame i = diag(1/L) (flux since t_0), nothing approximated but R
    (1e-5 ohm)."""
    n, theta, shift = 16, 0.4, 0.05 * H
    b = quiet(bench(LINEAR, DRIVE.converter))
    x, inside, psi_0 = start(b, theta), Inside(np.zeros((n, 4)), np.zeros((n, 2)), shift), 0j
    x[Slot.READINGS], room = n, inside.readings
    gamma = np.array([1.0 / LINEAR.inductance_d, 1.0 / LINEAR.inductance_q])
    for k in range(6):
        shift_pulses(x[Slot.SHIFT :], k, shift)
        advance(x, b, MODES["locked"], u.real, u.imag, U_DC, 0.0, 0.0)
        gather(x, b, (u.real, u.imag), U_DC, np.random.default_rng(0), inside)
        legs = edges(u, k, shift)
        for j in range(n):
            made = flux(legs, (j + 0.5) * H / n)
            assert complex(*room[j, 2:]) == pytest.approx(made, abs=1e-12)
            seen = (psi_0 + made) * np.exp(-1j * theta)
            i = complex(gamma[0] * seen.real, gamma[1] * seen.imag) * np.exp(1j * theta)
            # R i h/L: 1e-5 x 2 A x 1.5 ms / 0.05 H
            assert complex(*room[j, :2]) == pytest.approx(i, abs=1e-6)
        psi_0 += u * H
        seen = psi_0 * np.exp(-1j * theta)
        i = complex(gamma[0] * seen.real, gamma[1] * seen.imag) * np.exp(1j * theta)
        assert complex(x[Slot.I_ALPHA], x[Slot.I_BETA]) == pytest.approx(i, abs=1e-6)


@given(VOLTAGE, st.integers(0, 5), st.floats(0.01, 0.25))
def test_shifted_pulses_keep_the_mean_voltage(voltage, k, share):
    """Any voltage, any shift: every leg delivers its duty within the period."""
    u, shifts = voltage[0] * np.exp(1j * voltage[1]), np.zeros(3)
    shift_pulses(shifts, k, share * H)
    for n, duty in enumerate(duties(u.real, u.imag, U_DC)):
        assert volt_seconds(H, H, duty, shifts[n], U_DC) == pytest.approx(
            U_DC * duty * H, rel=1e-12
        )
        assert volt_seconds(0.0, H, duty, shifts[n], U_DC) == 0.0


def test_over_six_periods_the_ripple_has_every_direction_and_no_mean():
    """Zero voltage: moments of the volt-seconds' deviation, by the legs' edges; isotropic means sum
    f^2 = 0."""
    t = (np.arange(1000) + 0.5) * H / 1000
    rho = np.array([[flux(edges(0j, k, 0.05 * H), s) for s in t] for k in range(6)])
    power = np.mean(np.abs(rho) ** 2)
    assert abs(rho.mean()) < 1e-12 * math.sqrt(power)
    assert abs(np.mean(rho**2)) < 1e-12 * power


def test_reading_inside_leaves_the_plant_alone():
    """The same period with and without readings: more integration steps, nothing else (their error
    is below 1e-8)."""
    ends = []
    for n in (0, 16):
        b = quiet(bench(DRIVE.motor, DRIVE.converter))
        x = start(b, 0.3)
        x[Slot.READINGS] = n
        for k in range(40):
            advance(x, b, MODES["locked"], 20.0 * (-1) ** k, 9.0, U_DC, 0.0, 0.0)
        ends.append(complex(x[Slot.I_ALPHA], x[Slot.I_BETA]))
    assert abs(ends[0] - ends[1]) < 1e-8


def test_cost_of_the_ripple_is_that_of_the_bench():
    """Rms inside the period at the voltage that holds rated current: closed form against the
    bench's own readings."""
    drive = dataclasses.replace(
        DRIVE, motor=dataclasses.replace(LINEAR, resistance=DRIVE.motor.resistance)
    )
    b, theta = quiet(bench(drive.motor, drive.converter)), 0.4
    i = 1j * 1.2 * np.exp(1j * theta)
    u, n = drive.motor.resistance * i, 32
    x, square = start(b, theta, i_alpha=i.real, i_beta=i.imag), 0.0
    x[Slot.READINGS], inside = n, Inside(np.zeros((n, 4)), np.zeros((n, 2)), 0.05 * H)
    for k in range(24):
        shift_pulses(x[Slot.SHIFT :], k, inside.shift)
        advance(x, b, MODES["locked"], u.real, u.imag, U_DC, 0.0, 0.0)
        gather(x, b, (u.real, u.imag), U_DC, np.random.default_rng(0), inside)
        read = inside.readings[:, 0] + 1j * inside.readings[:, 1]
        square += np.mean(np.abs(read - read.mean()) ** 2) / 24
    gamma = (1.0 / drive.motor.inductance_d, 0.0, 1.0 / drive.motor.inductance_q)
    # R Gamma h = 6 % of decay within a period bends the ripple, 32 readings cut its corners
    assert pwm_ripple(drive, u, theta, gamma, 0.05 * H) == pytest.approx(
        math.sqrt(square), rel=0.05
    )


def test_recordings_are_of_centred_pulses(tmp_path, capsys):
    call = [
        "simulate",
        "--estimator",
        "pwm_ripple",
        "--duration",
        "0.05",
        "--record",
        str(tmp_path / "c"),
    ]
    assert main([*call, "--out", str(tmp_path / "o")]) == 2
    assert "recordings are of centred ones" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@given(
    st.one_of(st.none(), st.integers(), st.floats(), st.text()),
    st.one_of(st.none(), st.floats(), st.text()),
)
def test_readings_and_shift_are_checked(readings, shift):
    """Whatever is given, it is taken as it stands or refused with its name and bounds."""
    try:
        c = Converter(H, U_DC, 0.0, 0.0, readings=readings, pulse_shift=shift)
    except BadInput as error:
        assert "readings" in str(error) or "pulse_shift" in str(error)
        return
    assert c.readings is None or (4 <= c.readings <= 32 and c.readings == int(c.readings))
    assert c.pulse_shift is None or 0.01 <= c.pulse_shift <= 0.25
