"""What the flux ripple inside a period costs: against the switched bench, quadrature, and the lag's own equation."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from model.effects.current_filter import sample_weights
from model.parameters import load_drive
from sandbox.campaign import Campaign, CampaignRecording
from sandbox.replay.inputs import LEGS, ripple_moments
from sandbox.replay.replay import prepare, replay
from sandbox.switched.effects import bench, quiet
from sandbox.switched.simulate import replay as switched

DRIVE = load_drive("ipm")
SPEED = 100.0  # rad/s mechanical


def remainder(effects, period=2.5e-4, size=70.0, speed=SPEED, of=None):
    """Return the rms difference of currents from the switched bench over rated current; 0.15 s at imposed speed."""
    converter = dataclasses.replace(
        DRIVE.converter, sampling_period=period, pwm_frequency=1.0 / period, encoder_counts=1 << 20
    )
    drive = dataclasses.replace(DRIVE, converter=converter)
    k, pairs = np.arange(round(0.15 / period)), DRIVE.motor.pole_pairs
    theta, middle = (0.3 + pairs * speed * period * (k + x) for x in (0.0, 0.5))
    wave = 30.0 * np.where(k * period % 2e-3 < 1e-3, 1, -1)
    u = (size * np.exp(1.6j) + wave) * np.exp(1j * middle)
    r = switched(
        quiet(bench(drive.motor, converter, effects)), "driven", u.real, u.imag, 400.0, theta=theta, speed=speed
    )
    columns = {
        "t": k * period,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "theta": r["theta"],
        "u_dc": np.full(len(k), 400.0),
    }
    columns |= {name: r[name] for name in ("i_a", "i_b", "i_c")}
    recording = CampaignRecording("driven.parquet", "driven", "d", columns)
    prepared = prepare(Campaign("bench", drive, (recording,), {}, {}, False), effects, steps=1)
    predicted = replay(prepared, [effects if of is None else of]).currents[0][:, :, 0]
    miss = np.stack([recording.i_a, recording.i_b, recording.i_c], axis=1) - predicted
    return float(np.sqrt(np.mean(np.sum(miss[len(k) // 7 :] ** 2, axis=1) * 2.0 / 3.0))) / drive.motor.rated_current


def test_moments_are_those_of_the_ripple_by_quadrature():
    """rho(t) summed over a fine grid from the pulses themselves: midpoint rule, error (1/n)^2 of edges off the grid."""
    rng, n, period = np.random.default_rng(3), 40000, 2.5e-4
    duty = rng.uniform(0.0, 1.0, (6, 3))
    t = (np.arange(n) + 0.5) / n * period
    for d, told in zip(duty, ripple_moments(duty, period), strict=True):
        on = np.abs(t[:, None] - 0.5 * period) < 0.5 * d * period
        rho = np.cumsum(on - d, axis=0) * period / n - 0.5 * (on - d) * period / n
        vector = (2.0 / 3.0) * rho @ LEGS
        first = np.mean((t - 0.5 * period)[:, None] * vector, axis=0)
        square = vector.T @ vector / n
        expected = [*first, square[0, 0], square[0, 1], square[1, 1]]
        assert told == pytest.approx(expected, abs=2.0 / n * period**2)


def test_without_effects_the_remainder_is_of_third_order():
    """Averaging alone leaves T^2 (ripple against rotation and saturation); with the moments halving T gains 2^3,
    of which encoder counts take a little."""
    whole, half = remainder({}), remainder({}, 1.25e-4)
    print(f"remainder {whole:.2e} at 4 kHz, {half:.2e} at 8 kHz")
    assert whole < 1.7e-3 / 100.0  # a hundredth of the sensors' noise
    assert whole > 7.0 * half


@pytest.mark.parametrize("delay", [6e-5, 9e-5])
def test_edges_see_what_late_pulses_of_the_last_period_still_bring(delay):
    """Nearly no current, pulses later than the zero vector (45 us): the sign at the edge needs the flux on its way.

    Bound: what the delay leaves by itself, and 3 % of what dead time does (without that flux: 16 and 57 %).
    """
    back = DRIVE.motor.magnet_flux * DRIVE.motor.pole_pairs * SPEED
    late = {"pwm_delay.delay": delay}
    together = {"dead_time.time": 3e-8, **late}
    alone, left, without = (
        remainder(late, size=back),
        remainder(together, size=back),
        remainder(together, size=back, of=late),
    )
    print(f"delay {delay}: {left:.2e}, delay alone {alone:.2e}, dead time's part {without:.2e}")
    assert left < alone + 0.03 * without


@pytest.mark.parametrize("tau", [1e-9, 1e-6, 3e-5, 1e-3])
@pytest.mark.parametrize("s", [-2e-5, -1e-6, 1e-6, 2e-5])
def test_a_sample_beside_t_k_reads_the_filter_of_a_ramp(s, tau):
    """Output of tau df/dt = i - f for a ramp, which for an old enough filter is i - tau di/dt, at any instant."""
    slope, start = 700.0, 1.3
    decay, old, new = sample_weights(s, tau)
    told = decay * (start - tau * slope) + old * start + new * (start + s * slope)
    assert told == pytest.approx(start + s * slope - tau * slope, rel=1e-9)


@pytest.mark.parametrize("s", [-8e-6, 1.2e-5])
def test_a_sample_within_a_time_constant_follows_the_filters_equation(s):
    """Any output at t_k, integrated forwards and backwards by an adaptive method."""
    tau, slope, start, output = 2e-5, -400.0, 0.4, 0.9
    exact = solve_ivp(lambda t, f: (start + slope * t - f) / tau, (0.0, s), [output], rtol=1e-10, atol=1e-13)
    decay, old, new = sample_weights(s, tau)
    assert decay * output + old * start + new * (start + s * slope) == pytest.approx(exact.y[0, -1], rel=1e-8)


def test_a_short_filter_beside_early_sampling_changes_little():
    """A trace of a filter of tau moves the reading by tau times the slope, however early the sample is."""
    early = {"current_sampling.delay": -5e-6}
    beside = {**early, "current_filter.time_constant": 1e-8}
    assert remainder(beside, of=early) < 3.0 * remainder(early) + 2.0 * 1e-8 * 700.0 / DRIVE.motor.rated_current
