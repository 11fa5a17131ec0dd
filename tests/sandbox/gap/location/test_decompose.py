"""Decomposition of residuals: patterns whose shares follow in closed form, white noise beside
them."""

import math

import numpy as np
import pytest

from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.location.decompose import CHANNELS, VARIANCE, decompose
from sandbox.plant.sets import complete
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import Residual, prepare, replay
from tests.sandbox.gap.conftest import DRIVE, small_campaign

SIZE = 4.0  # noise floors: amplitude of a planted space vector


@pytest.fixture(scope="module")
def point():
    return ParameterPoint(
        prepare(small_campaign({}), steps=1), complete(DRIVE.motor, DRIVE.converter)
    )


def residual_of(point, vector, seed=0):
    """Return white noise plus a stationary space vector vector(recording) (n,) in noise floors, or
    (n, 3) phases."""
    rng, out = np.random.default_rng(seed), []
    for r in point.prepared.recordings:
        own = vector(r)
        phases = own if own.ndim == 2 else np.stack([own.real, own.imag], axis=1) @ LEGS.T
        current = rng.standard_normal((r.samples, 3)) + phases
        angle = rng.standard_normal((r.samples, 1)) if r.rotor == "driven" else None
        out.append(Residual(r.file, r.rotor, current[:, :, None], None, angle))
    return out


def turning(point):
    return [r for r in point.prepared.recordings if r.rotor == "driven"]


def test_variance_of_a_space_vector_of_white_readings():
    z = (2 / 3) * np.random.default_rng(0).standard_normal((200_000, 3)) @ LEGS
    # 3 s.e. of a chi^2 mean
    assert 1.5 * np.mean(np.sum(z**2, axis=1)) == pytest.approx(VARIANCE, rel=0.01)


def test_white_noise_has_no_excess(point):
    part = decompose(point, residual_of(point, lambda r: np.zeros(r.samples, complex)))
    count = sum((4 if r.rotor == "driven" else 3) * r.samples for r in point.prepared.recordings)
    # each recording clipped at 0
    assert part.excess < 4 * math.sqrt(2 * count) * len(point.prepared.recordings)


@pytest.mark.parametrize("order", [-2, -1, 0, 6, -6, 18, -24])
def test_order_in_the_rotor_frame(point, order):
    """z = SIZE exp(j (order + 1) theta) on turning recordings: all of the excess 1.5 SIZE^2 n
    there."""
    plant = lambda r: SIZE * np.exp(1j * (order + 1) * r.motion.angle) * (r.rotor == "driven")  # noqa: E731
    part = decompose(point, residual_of(point, plant))
    samples = sum(r.samples for r in turning(point))
    assert part.excess == pytest.approx(1.5 * SIZE**2 * samples, rel=0.03)
    # only whole pairs of turns are looked at: 2 of 2.9 turns of one recording, 16 of 17.2 of the
    # other, 0.81 in all
    assert 0.75 < part.electrical[order] < 1.03
    assert sum(v for n, v in part.electrical.items() if n != order) < 0.05
    assert part.channels["currents"] > 0.98
    assert set(part.channels) == set(CHANNELS)


def test_recordings_share_the_excess_by_their_squares(point):
    first, second = (r.file for r in point.prepared.recordings[:2])
    size = {first: 2.0 * SIZE, second: SIZE}
    part = decompose(
        point, residual_of(point, lambda r: size.get(r.file, 0.0) * np.ones(r.samples, complex))
    )
    assert part.recordings[first] == pytest.approx(0.8, abs=0.02)
    assert part.recordings[second] == pytest.approx(0.2, abs=0.02)
    assert part.speeds["at standstill"] > 0.97


def test_ripple_of_the_injection(point):
    n = round(1 / DRIVE.injection.frequency / DRIVE.converter.sampling_period)

    def plant(r):
        return SIZE * np.cos(2 * np.pi * np.arange(r.samples) / n) * np.exp(1j * r.motion.angle)

    part = decompose(point, residual_of(point, plant))
    assert part.injection == pytest.approx(1.0, abs=0.1)
    assert (
        decompose(point, residual_of(point, lambda r: SIZE * np.exp(1j * r.motion.angle))).injection
        < 0.05
    )


def test_fixed_frequency_at_locked_rotor(point):
    period = DRIVE.converter.sampling_period

    def plant(r):
        tone = np.exp(2j * np.pi * 173.0 * period * np.arange(r.samples))
        return SIZE * tone * (r.rotor == "locked")

    part = decompose(point, residual_of(point, plant))
    assert part.line is not None
    assert part.line[0] == pytest.approx(173.0, abs=0.5 / (1024 * period))
    assert part.line[1] > 0.7


@pytest.mark.parametrize(
    ("values", "direction"),
    [
        ({"stator_resistance.resistance": 1.15 * DRIVE.motor.resistance}, "along the current"),
        ({"dead_time.time": 2e-6}, "along the current"),
        ({"dc_link_error.gain_error": 0.03}, "along the voltage command"),
        ({"magnet_flux.magnet_flux": 1.1 * DRIVE.motor.magnet_flux}, "on the q axis"),
    ],
)
def test_direction_of_the_missing_voltage(point, values, direction):
    """Voltages whose direction the effect's equation states, as the replay makes currents of
    them."""
    base = replay(point.prepared, [point.values]).currents
    moved = replay(point.prepared, [{**point.values, **values}]).currents
    change = {
        r.file: (b - a)[:, :, 0] / point.prepared.noise_std
        for r, a, b in zip(point.prepared.recordings, base, moved, strict=True)
    }
    part = decompose(point, residual_of(point, lambda r: change[r.file]))
    print(values, part.directions)
    assert part.direction[0] == direction
    assert part.direction[1] > 0.8


def test_resistance_grows_with_current_and_dead_time_does_not(point):
    ratio = {}
    for name, value in (
        ("stator_resistance.resistance", 1.15 * DRIVE.motor.resistance),
        ("dead_time.time", 2e-6),
    ):
        base, moved = (
            replay(point.prepared, [{**point.values, **v}]).currents for v in ({}, {name: value})
        )
        change = {
            r.file: (b - a)[:, :, 0] / point.prepared.noise_std
            for r, a, b in zip(point.prepared.recordings, base, moved, strict=True)
        }
        seen = decompose(point, residual_of(point, lambda r, c=change: c[r.file])).amplitude
        row = seen[0][np.isfinite(seen[0])]
        ratio[name] = row[-1] / row[0]
    print(ratio)
    assert ratio["stator_resistance.resistance"] > 1.7 > 1.4 > ratio["dead_time.time"]
