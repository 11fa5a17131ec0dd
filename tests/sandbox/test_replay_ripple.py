"""What the flux ripple inside a period costs: against the switched bench, quadrature, and the lag's own equation."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from model.effects.current_filter import sample_weights
from model.parameters import load_drive
from sandbox.campaign import Campaign, CampaignRecording
from sandbox.plant.sets import cubic_weight, parabola_weights
from sandbox.replay import lanes, memory
from sandbox.replay.inputs import LEGS, edge_table, ripple_moments
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

    Bound: what the delay leaves by itself, and 8 % of what dead time does (without that flux: 16 and 57 %).
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
    assert left < alone + 0.08 * without


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


def row(w, name):
    """Return a row of lane 0."""
    return w[getattr(lanes, name) * lanes.LANES]


@pytest.mark.parametrize("delay", [0.0, 2e-5, 9e-5])
@pytest.mark.parametrize("tau", [3e-6, 6e-5, 1e-3])
def test_ripple_in_the_filter_is_that_of_its_equation_by_quadrature(tau, delay):
    """tau df/dt = x - f over one period after another, for x: the ripple, by age, by age and time till then, and the
    ripple's square; midpoint rule, off by 1/n of an edge's share."""
    n, period, link = 100000, 2.5e-4, 400.0
    duty = np.array([[0.62, 0.31, 0.48], [0.31, 0.62, 0.55]])
    w = np.zeros(lanes.ROWS * lanes.LANES)
    t = (np.arange(n) + 0.5) / n * period
    last = np.abs(t[:, None] + period - delay - 0.5 * period) < 0.5 * duty[0] * period
    now = np.abs(t[:, None] - delay - 0.5 * period) < 0.5 * duty[1] * period
    on = 1.0 * (last | now)
    mean = on.mean(axis=0)
    values = {"FILTER_TIME": tau, "FILTER_INV": 1.0 / tau, "FILTER_KEEP": np.exp(-period / tau), "LATE": delay}
    values |= {"LINK_A": link} | dict(zip(("PATTERN_A", "PATTERN_B"), (2.0 / 3.0) * link * mean @ LEGS, strict=True))
    for name, value in values.items():
        k = getattr(lanes, name) * lanes.LANES
        w[k : k + lanes.LANES] = value
    edges, means = edge_table(duty, period), (2.0 / 3.0) * duty @ LEGS
    six = [tuple(e) for e in edges[1]]
    if delay > 0.0:
        memory.keep_late_ripple(w, *duty[1], *duty[0], *means[1], *six, period)
        memory.carry(w, edges[0], *duty[0], *means[0], period)
    else:
        memory.keep_filter_ripple(w, *means[1], *six, period)
    rho = np.cumsum(on - mean, axis=0) * period / n - 0.5 * (on - mean) * period / n
    rho = (2.0 / 3.0) * link * rho @ LEGS
    age = (1.0 - t / period)[:, None]
    weight = np.exp((t - period) / tau)[:, None] * period / n / tau
    largest = np.abs(weight * rho).sum(axis=0).max()
    for name, x in (("NOW", rho), ("EARLY", age * rho), ("CURVED", age * (1.0 - age) * rho)):
        told = [row(w, name + "_A"), row(w, name + "_B")]
        assert told == pytest.approx(np.sum(weight * x, axis=0), abs=1e-4 * largest)
    square = link**2 * np.array([row(w, "BENT_" + x) for x in ("AA", "AB", "BB")])
    a, b = rho.T
    expected = np.sum(weight * np.stack([a * a, a * b, b * b], axis=1), axis=0)
    assert square == pytest.approx(expected, abs=1e-4 * expected.max())


@pytest.mark.parametrize("tau", [1e-6, 3e-5, 1e-4, 3e-3])
def test_a_filter_follows_a_cubic_of_which_the_slope_is_known(tau):
    """From rest in the far past a lag answers t^3 by t^3 - 3 tau t^2 + 6 tau^2 t - 6 tau^3."""
    step = 1e-4
    decay, _, mid, new = parabola_weights(step, tau)
    share = cubic_weight(step, tau)
    first, last = -6.0 * tau**3, step**3 - 3.0 * tau * step**2 + 6.0 * tau**2 * step - 6.0 * tau**3
    told = decay * first + (mid - 4.0 * share) * step**3 / 8.0 + (new + share) * step**3  # value and slope at 0 are 0
    assert told == pytest.approx(last, abs=1e-9 * max(step, tau) ** 3)


@pytest.mark.parametrize("speed", [0.0, 20.0, 100.0])
@pytest.mark.parametrize("tau", [5e-6, 3e-5, 6e-5, 1.2e-4])
def test_a_filter_leaves_a_seventieth_of_the_noise(tau, speed):
    """A seventieth of the sensors' noise (one inductance for all of the filter's memory: 2.3e-4, locked 7e-5)."""
    left = remainder({"current_filter.time_constant": tau}, speed=speed, size=20.0 + 0.5 * speed)
    print(f"filter {tau:g} s, {speed:g} rad/s: {left:.2e}")
    assert left < 1.7e-3 / 70.0


def test_a_filter_behind_late_pulses_is_of_third_order():
    """Halving the period, delay and time constant gains 2^3 or nearly so."""
    whole = remainder({"current_filter.time_constant": 6e-5, "pwm_delay.delay": 3e-5})
    half = remainder({"current_filter.time_constant": 3e-5, "pwm_delay.delay": 1.5e-5}, 1.25e-4)
    print(f"remainder {whole:.2e} at 4 kHz, {half:.2e} at 8 kHz")
    assert whole < 1.7e-3 / 50.0
    assert whole > 6.0 * half
