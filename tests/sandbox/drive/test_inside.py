"""Readings inside the PWM period, pulses shifted: exact plant against switched bench under the same
commands."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from estimators.registry import load_estimator
from experiments.spline_twin import twin
from model.drive_files import load_drive
from sandbox.drive.inside import inside_of, shift_pulses
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.drive.switched_loop import gather
from sandbox.switched.advance import MODES, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import advance
from tests.sandbox.plant.exact import Exact

LARGEST = 2e-5  # of rated current, rms: what issue 15 asks of the plant against the bench
# With a late pattern one plant begins that much later than the other, a driven magnet having turned
# on meanwhile: of that 0.94 is left a period (R h/L), 1e-4 after SETTLED.
PERIODS, SETTLED, THETA = 250, 150, 0.3
DRIVES = {"ipm": load_drive("ipm"), "ipm_exchanged": load_drive("ipm_exchanged")}
DRIVES["map"] = twin(DRIVES["ipm_exchanged"])
RUNS = {"locked": 0.0, "driven": 120.0, "driven fast": 600.0, "free": 0.0}  # rad/s electrical
SENSORS = {
    "current_gain.gain_a": 1.01,
    "current_gain.gain_c": 0.98,
    "current_offset.offset_a": 0.01,
    "current_filter.time_constant": 1e-5,
    "current_sampling.delay": 5e-6,
}
# the first reading is early
LATE = {"pwm_delay.delay": 2e-5, "current_sampling.delay": -5e-6, "dead_time.time": 1e-6}


def commands(drive, speed, rotor):
    """Return voltages (V, n) that hold or swing half of rated current, with injection; as
    `plant_against_bench`."""
    k, period, motor = np.arange(PERIODS), drive.converter.sampling_period, drive.motor
    drop = motor.resistance * motor.rated_current
    if rotor == "free":
        return drop * (0.7 + 0.35 * np.sin(k / 50.0)).astype(complex)
    turn = np.exp(1j * (THETA + speed * period * (k + 0.5)))
    size = (
        drop * complex(-0.1, 0.5) + 1j * speed * motor.magnet_flux
        if speed
        else 0.8 * drop * np.sin(k / 20.0)
    )
    return (size + drive.injection.amplitude * np.where(k % 8 < 4, 1, -1)) * turn


def on_exact(drive, effects, rotor, speed, u):
    """Return readings (periods, n, 4) inside the periods of the exact plant."""
    inside = inside_of(drive.converter)
    plant = Exact(
        effects, drive.motor, rotor, THETA, speed / drive.motor.pole_pairs, drive.converter, inside
    )
    found = []
    for v in u:
        plant.advance(v)
        found.append(inside.readings.copy())
    return np.array(found)


def on_switched(drive, effects, rotor, speed, u):
    """Return the same of the switched bench."""
    b, inside = quiet(bench(drive.motor, drive.converter, effects)), inside_of(drive.converter)
    x, link, found, rng = (
        start(b, THETA),
        drive.converter.dc_bus_voltage,
        [],
        np.random.default_rng(0),
    )
    x[Slot.SPEED], x[Slot.READINGS] = speed / drive.motor.pole_pairs, len(inside.readings)
    for k, v in enumerate(u):
        shift_pulses(x[Slot.SHIFT :], k, inside.shift)
        advance(x, b, MODES[rotor], v.real, v.imag, link, 0.0, 0.0)
        gather(x, b, (v.real, v.imag), link, rng, inside)
        found.append(inside.readings.copy())
    return np.array(found)


def apart(name, run, effects):
    """Return the rms difference of currents read inside the period, over rated current; the
    volt-seconds are equal."""
    drive, speed, rotor = DRIVES[name], RUNS[run], run.partition(" ")[0]
    u = commands(drive, speed, rotor)
    ours, theirs = (on(drive, effects, rotor, speed, u) for on in (on_exact, on_switched))
    assert np.abs(ours[:, :, 2:] - theirs[:, :, 2:]).max() < 1e-12  # V s of up to 0.1: rounding
    # there is a ripple to read
    assert np.ptp(theirs[:, :, :2], axis=1).mean() > 0.01 * drive.motor.rated_current
    off = (ours - theirs)[SETTLED:, :, :2]
    miss = float(np.sqrt(np.mean(np.sum(off**2, axis=2)))) / drive.motor.rated_current
    print(f"{name}, {run}: {miss * 1e6:.2f} ppm")
    return miss


@pytest.mark.parametrize("run", list(RUNS))
@pytest.mark.parametrize("name", list(DRIVES))
def test_same_readings_inside_on_both_plants(name, run):
    assert apart(name, run, {}) < LARGEST


@pytest.mark.parametrize("effects", [SENSORS, LATE], ids=["sensors", "late"])
@pytest.mark.parametrize("run", ["locked", "driven"])
def test_same_readings_with_effects(run, effects):
    """Gains, offset, filter, late and early sampling, a late pattern, dead time: on readings inside
    as on samples."""
    assert apart("ipm_exchanged", run, effects) < LARGEST


def test_reading_inside_leaves_the_plant_alone():
    """Samples with readings, pulses not shifted, and without: the same steps, their sums ordered
    otherwise (1e-12)."""
    drive = DRIVES["ipm_exchanged"]
    u = commands(drive, 0.0, "locked")
    rooms = inside_of(drive.converter)._replace(shift=0.0), None
    plants = [
        Exact(None, drive.motor, converter=drive.converter, inside=inside) for inside in rooms
    ]
    samples = [[plant.advance(v) for v in u] for plant in plants]
    assert np.abs(np.subtract(*samples)).max() < 1e-12 * drive.motor.rated_current


# degrees: LARGEST over the ripple's share of rated current that shifted pulses make at rest (0.02
# and more), which turns with half the angle
SAME = np.degrees(LARGEST / (0.02 * 0.5))


@pytest.mark.parametrize("noise", [0.0, 1.0], ids=["quiet", "noisy"])
def test_pwm_ripple_finds_the_same_angle_on_both_plants(noise):
    """Rated load at standstill; both plants draw the same noise. Without counts: one of them may
    fall either way."""
    drive = DRIVES["ipm_exchanged"]
    sensors = {"current_noise": noise * drive.converter.current_noise, "current_resolution": 0.0}
    drive = dataclasses.replace(drive, converter=dataclasses.replace(drive.converter, **sensors))
    scene = Scenario("x", (Segment(0.3, 1.0, ramp=0.05),), start_up=False)
    runs = [
        simulate(drive, scene, load_estimator("pwm_ripple"), seed=3, plant=p)
        for p in ("exact", "switched")
    ]
    exact, switched = (np.degrees(run.recording.between(0.1, 0.3).error) for run in runs)
    print(
        f"{exact.mean():.5f} +- {exact.std():.5f} degrees, off {np.abs(exact - switched).max():.1e}"
    )
    assert np.abs(exact - switched).max() < SAME
    assert (exact.std() > SAME) == (noise > 0.0)  # noise of one's own would show
