"""What an average lacks inside the PWM period: closed forms from the pulses, against both plants
that have pulses.

The averaged plant is this bench's machine fed with the mean voltage; formulas as in
sandbox/switched/AVERAGING.md.
"""

from functools import cache

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.switched.advance import MODES, replay, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import duties, integrate
from sandbox.switched.phase_machine import current_and_torque
from tests.sandbox.plant.exact import exact

N = 600


def clarke(legs):
    return (2 * legs[0] - legs[1] - legs[2]) / 3 + 1j * (legs[1] - legs[2]) / np.sqrt(3)


def phases(z):
    return np.array(
        [z.real, -z.real / 2 + np.sqrt(0.75) * z.imag, -z.real / 2 - np.sqrt(0.75) * z.imag]
    )


def gamma(b, psi, theta, d_psi):
    """Return the inverse incremental inductance (stationary frame) applied to a flux vector."""
    if d_psi == 0:
        return 0j
    s = 1e-6 / abs(d_psi)
    high, low = (current_and_torque(b, psi + x * s * d_psi, theta)[0] for x in (1, -1))
    return (high - low) / (2 * s)


def ripple_lag(b, duty, tau):
    """Return what one period's flux ripple leaves in a lag tau at its end, per leg: q of
    AVERAGING.md."""
    t = b.period
    tail = np.exp(-0.5 * (1 - duty) * t / tau) - np.exp(-0.5 * (1 + duty) * t / tau)
    tail *= np.exp(b.pwm_delay / tau)
    return b.link_voltage * tau * (duty * (1 - np.exp(-t / tau)) - tail)


def dead_time_delays(b, duty, psi, i, theta, omega):
    """Return how late each leg rises and falls: edges in order of time, each seeing the flux of
    those before."""
    rise, fall, t_s = 0.5 * (1 - duty) * b.period, 0.5 * (1 + duty) * b.period, b.period
    late, lost = np.zeros((2, 3)), 0j
    for t, leg, falling in sorted(
        (e[k], k, f) for f, e in enumerate((rise, fall)) for k in range(3)
    ):
        flux = (
            b.link_voltage * clarke(np.clip(t - rise, 0, duty * t_s)) + lost - t * b.resistance * i
        )
        at_edge = phases(current_and_torque(b, psi + flux, theta + omega * t)[0])[leg]
        sign = np.clip(at_edge / b.soft_current, -1, 1)
        late[falling, leg] = 0.5 * b.dead_time * (1 - sign if falling else 1 + sign)
        lost += (
            b.link_voltage * late[falling, leg] * clarke(np.eye(3)[leg]) * (1 if falling else -1)
        )
    return late


def averaged(b, u, u_dc, theta, speed, correct):
    """Return the samples of the averaged plant, with (correct) or without what the pulses add."""
    plain = b._replace(dead_time=0.0)
    state, out, omega = start(b, theta[0], speed), [], b.pole_pairs * speed
    filtered = core_lag = 0j
    for k in range(len(u)):
        state[6], state[7] = theta[k], speed
        duty = np.array(duties(u[k].real, u[k].imag, u_dc))
        mean = b.link_voltage * clarke(duty)
        psi, i = (
            complex(*state[Slot.PSI_ALPHA : Slot.PSI_ALPHA + 2]),
            complex(*state[Slot.I_ALPHA : Slot.I_ALPHA + 2]),
        )
        magnetising = current_and_torque(b, psi, theta[k])[0]
        reading = i
        if correct and b.core_conductance:
            reading -= core_lag * b.core_conductance / b.core_time
        if b.filter_time:
            reading = complex(*state[Slot.FILTER_ALPHA : Slot.FILTER_ALPHA + 2])
            reading += gamma(b, psi, theta[k], filtered) if correct else 0.0
            if correct and b.core_conductance:
                reading -= (
                    (core_lag - filtered) * b.core_conductance / (b.core_time - b.filter_time)
                )
        if b.sampling_delay:
            flux = b.sampling_delay * ((0.0 if correct else mean) - b.resistance * i)
            reading = current_and_torque(b, psi + flux, theta[k] + omega * b.sampling_delay)[0]
        out.append(reading)
        acting, late_by = mean, b.pwm_delay
        if b.dead_time:
            late = dead_time_delays(b, duty, psi, magnetising, theta[k], omega)
            if not correct:
                sign = np.clip(phases(magnetising) / b.soft_current, -1, 1)
                late = 0.5 * b.dead_time * np.stack([1 + sign, 1 - sign])
            acting = mean - b.link_voltage / b.period * clarke(late[0] - late[1])
            late_by += 0.5 * b.dead_time
        if correct and late_by:
            middle = (
                psi + 0.5 * b.period * (mean - b.resistance * i),
                theta[k] + 0.5 * b.period * omega,
            )
            acting = acting + b.resistance * late_by * gamma(b, *middle, mean)
        integrate(
            state, plain, MODES["driven"], complex(acting / b.link_voltage), 0.0, b.period, 0.0, 0.0
        )
        state[Slot.TIME] += b.period
        if b.filter_time:
            filtered = np.exp(-b.period / b.filter_time) * filtered + clarke(
                ripple_lag(b, duty, b.filter_time)
            )
        if b.core_conductance:
            core_lag = np.exp(-b.period / b.core_time) * core_lag + clarke(
                ripple_lag(b, duty, b.core_time)
            )
    return np.array(out)


@cache
def courses(items, speed):
    """Return samples (n,) over rated current of a driven motor with injection on top: averaged
    without and with what the pulses add, switched, exact."""
    effects = dict(items)
    motor, converter = load_drive("ipm").motor, load_drive("ipm").converter
    b = quiet(bench(motor, converter, effects))
    k, omega = np.arange(N), motor.pole_pairs * speed
    theta = 0.3 + omega * b.period * k
    middle = theta + 0.5 * omega * b.period
    u = (12.0 + 0.6 * speed) * 1j * np.exp(1j * (middle + 0.03)) + 30.0 * np.where(
        k % 8 < 4, 1, -1
    ) * np.exp(1j * middle)
    out = replay(b, "driven", u.real, u.imag, 400.0, theta=theta, speed=speed)
    switched = clarke(np.stack([out["i_a"], out["i_b"], out["i_c"]]))
    plain, corrected = (averaged(b, u, 400.0, theta, speed, correct) for correct in (False, True))
    plants = switched, exact(effects, u, motor, 0.3, speed)
    return [x / motor.rated_current for x in (plain, corrected, *plants)]


def rms(x, settled=80):
    """Return the rms after settling."""
    return float(np.sqrt(np.mean(np.abs(x[settled:]) ** 2)))


# effect, bound without and with the correction (share of rated current); the noise is 1.7e-3
CASES = [
    ({"pwm_delay.delay": 3e-5}, 5e-3, 1e-4),
    ({"current_sampling.delay": 5e-6}, 2e-3, 2e-4),
    ({"current_sampling.delay": -5e-6}, 2e-3, 2e-4),
    ({"current_filter.time_constant": 5e-6}, 2e-3, 2e-4),
    ({"current_filter.time_constant": 3e-5}, 5e-3, 2e-4),
    ({"current_filter.time_constant": 1e-4}, 2e-3, 2e-4),
    ({"iron_loss.core_resistance": 2000.0, "iron_loss.time_constant": 1e-4}, 8e-4, 2.5e-4),
    ({"iron_loss.core_resistance": 2000.0, "iron_loss.time_constant": 2e-5}, 2e-3, 4e-4),
    ({"pwm_delay.delay": 2e-5, "current_filter.time_constant": 3e-5}, 5e-3, 4e-4),
    (
        {
            "iron_loss.core_resistance": 2e3,
            "iron_loss.time_constant": 1e-4,
            "current_filter.time_constant": 3e-5,
        },
        2e-3,
        4e-4,
    ),
    ({"dead_time.time": 2e-6}, 3e-3, 5e-4),
]


@pytest.mark.parametrize("speed", [20.0, 100.0])
@pytest.mark.parametrize("plant", [2, 3], ids=["switched", "exact"])
def test_without_effects_the_mean_voltage_is_enough(plant, speed):
    found = courses((), speed)
    # what averaging can give: below 0.1 % of rated current
    assert rms(found[0] - found[plant]) < 2e-4


@pytest.mark.parametrize("speed", [20.0, 100.0])
@pytest.mark.parametrize("plant", [2, 3], ids=["switched", "exact"])
@pytest.mark.parametrize(
    ("effects", "naive", "corrected"), CASES, ids=lambda x: str(x) if isinstance(x, dict) else ""
)
def test_closed_form_brings_an_average_to_the_plants(effects, naive, corrected, plant, speed):
    found = courses(tuple(effects.items()), speed)
    off, on = (rms(found[k] - found[plant]) for k in (0, 1))
    print(f"{effects} {speed:g} rad/s: averaged {off:.1e}, corrected {on:.1e} of rated current")
    assert on < corrected
    assert off > naive
    assert off > 4 * on


@pytest.mark.parametrize("speed", [20.0, 100.0])
@pytest.mark.parametrize("effects", [{}, *(c[0] for c in CASES)], ids=str)
def test_the_plants_agree(effects, speed):
    _, _, switched, exact = courses(tuple(effects.items()), speed)
    # ten time constants: a delayed plant begins with its pattern, without current
    left = rms(exact - switched, 300)
    print(f"{effects} {speed:g} rad/s: exact less switched {left:.1e} of rated current")
    assert left < 2e-5  # the bound set for the plant: a hundredth of the sensors' noise
