"""Filters, late pulses and one period's ripple: replay against the switched bench at 4 and 8
kHz."""

import dataclasses

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.replay import prepare, replay
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet

DRIVE = load_drive("ipm")
SPEED = 100.0  # rad/s mechanical
EXACT = 2e-5  # of rated current


def remainder(effects, period=2.5e-4, size=70.0, speed=SPEED, of=None):
    """Return the rms difference of currents from the switched bench over rated current; 0.15 s at
    imposed speed."""
    converter = dataclasses.replace(
        DRIVE.converter, sampling_period=period, pwm_frequency=1.0 / period, encoder_counts=1 << 20
    )
    drive = dataclasses.replace(DRIVE, converter=converter)
    k, pairs = np.arange(round(0.15 / period)), DRIVE.motor.pole_pairs
    theta, middle = (0.3 + pairs * speed * period * (k + x) for x in (0.0, 0.5))
    wave = 30.0 * np.where(k * period % 2e-3 < 1e-3, 1, -1)
    u = (size * np.exp(1.6j) + wave) * np.exp(1j * middle)
    r = switched(
        quiet(bench(drive.motor, converter, effects)),
        "driven",
        u.real,
        u.imag,
        400.0,
        theta=theta,
        speed=speed,
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
    return (
        float(np.sqrt(np.mean(np.sum(miss[len(k) // 7 :] ** 2, axis=1) * 2.0 / 3.0)))
        / drive.motor.rated_current
    )


def test_without_effects_halving_the_period_gains_two_to_the_third():
    """Of third order but for inductances of the period's start; encoder counts take a little of a
    factor of eight."""
    whole, half = remainder({}), remainder({}, 1.25e-4)
    print(f"remainder {whole:.2e} at 4 kHz, {half:.2e} at 8 kHz")
    assert whole < EXACT
    assert whole > 6.0 * half


@pytest.mark.parametrize("delay", [6e-5, 9e-5])
def test_edges_see_what_late_pulses_of_the_last_period_still_bring(delay):
    """Nearly no current, pulses later than the zero vector (45 us): the sign at the edge needs the
    flux on its way."""
    back = DRIVE.motor.magnet_flux * DRIVE.motor.pole_pairs * SPEED
    late = {"pwm_delay.delay": delay}
    together = {"dead_time.time": 3e-8, **late}
    left, without = remainder(together, size=back), remainder(together, size=back, of=late)
    print(f"delay {delay}: {left:.2e}, dead time's part {without:.2e}")
    assert left < EXACT
    assert without > 5.0 * left


def test_a_short_filter_beside_early_sampling_changes_little():
    """A trace of a filter of tau moves the reading by tau times the slope, however early the sample
    is."""
    early = {"current_sampling.delay": -5e-6}
    beside = {**early, "current_filter.time_constant": 1e-8}
    assert remainder(beside, of=early) < EXACT + 2.0 * 1e-8 * 700.0 / DRIVE.motor.rated_current


@pytest.mark.parametrize("speed", [0.0, 20.0, 100.0])
@pytest.mark.parametrize("tau", [5e-6, 3e-5, 6e-5, 1.2e-4])
def test_a_filter_is_that_of_the_switched_bench(tau, speed):
    left = remainder({"current_filter.time_constant": tau}, speed=speed, size=20.0 + 0.5 * speed)
    print(f"filter {tau:g} s, {speed:g} rad/s: {left:.2e}")
    assert left < EXACT


def test_a_filter_behind_late_pulses_gains_as_much():
    """Halving the period, delay and time constant."""
    whole = remainder({"current_filter.time_constant": 6e-5, "pwm_delay.delay": 3e-5})
    half = remainder({"current_filter.time_constant": 3e-5, "pwm_delay.delay": 1.5e-5}, 1.25e-4)
    print(f"remainder {whole:.2e} at 4 kHz, {half:.2e} at 8 kHz")
    assert whole < EXACT
    assert whole > 6.0 * half
