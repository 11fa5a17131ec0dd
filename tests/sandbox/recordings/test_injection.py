"""The carrier on the sampling grid: closed forms, and the resistance's second-order weight against
exact response."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm

from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.recordings.injection import carrier, primitive_of, samples_per_period, waveform_of


def test_square_primitive_is_the_triangle():
    """Eight samples: F = -2 .. 2 in units of h, peak u/(4 f) per volt."""
    np.testing.assert_allclose(
        primitive_of("square", 8, 1.0), [-2, -1, 0, 1, 2, 1, 0, -1], atol=1e-15
    )
    assert np.abs(primitive_of("square", 8, 250e-6)).max() == pytest.approx(1 / (4 * 500.0))


@pytest.mark.parametrize("waveform", ["square", "sine", "random"])
@pytest.mark.parametrize("n", [4, 8, 20, 64])
def test_zero_mean(waveform, n):
    assert abs(waveform_of(waveform, n).sum()) < 1e-12
    assert abs(primitive_of(waveform, n, 1e-4).sum()) < 1e-12


def test_random_signs_are_a_sequence_of_maximum_length():
    """x^5 + x^2 + 1: 31 signs, 16 of one kind, whose product with themselves shifted sums to -1
    (Golomb)."""
    f = waveform_of("random", 64)
    np.testing.assert_array_equal(f[:32], -f[32:])
    np.testing.assert_array_equal(f[31], f[0])
    signs = f[:31]
    assert np.sum(signs) == 1.0
    assert {float(signs @ np.roll(signs, k)) for k in range(1, 31)} == {-1.0}


def test_random_signs_need_eight_samples():
    drive = load_drive("ipm")
    injection = dataclasses.replace(drive.injection, frequency=1000.0, waveform="random")
    with pytest.raises(
        BadInput,
        match="random wave needs an even number of samples a period, 8 to 64; inject at 500",
    ):
        samples_per_period(injection, drive.converter)


def test_continuous_normalisation_is_five_per_cent_off_at_eight_samples():
    """Peak of the fundamental of a triangle, 8/pi^2, against its peak sampled at eight points
    projected on itself."""
    f = primitive_of("square", 8, 250e-6)
    k = np.arange(8)
    sine = -np.cos(2 * np.pi * k / 8)
    sampled = f @ sine / (sine @ sine)
    continuous = 8 / np.pi**2 * np.abs(f).max()
    assert sampled / continuous - 1 == pytest.approx(0.053, abs=0.002)


@pytest.mark.parametrize(
    ("waveform", "n"),
    [("square", 2), ("square", 8), ("square", 16), ("sine", 8), ("sine", 16), ("random", 16)],
)
def test_lag_is_the_second_order_of_the_exact_response(waveform, n):
    """Periodic steady state of dx/dt = f - a x with f held, by matrix exponential; halving a
    divides the rest by 16."""
    h, f = 1e-4, waveform_of(waveform, n)
    drive = load_drive("ipm_exchanged")
    converter = dataclasses.replace(drive.converter, sampling_period=h, pwm_frequency=None)
    injection = dataclasses.replace(drive.injection, frequency=1 / (n * h), waveform=waveform)
    lag, primitive = carrier(injection, converter).lag, primitive_of(waveform, n, h)
    rest = []
    for a in (400.0, 200.0):
        pair = expm(np.array([[-a, 1.0], [0.0, 0.0]]) * h)
        decay, gain = pair[0, 0], pair[0, 1]
        x, samples = 0.0, []
        for _ in range(2):  # twice around: first to find the periodic start
            one = 0.0
            for v in f:
                one = decay * one + gain * v
            x = one / (1 - decay**n)
        for v in f:
            samples.append(x)
            x = decay * x + gain * v
        in_phase = np.dot(samples, primitive) / np.dot(primitive, primitive)
        rest.append(in_phase - (1 - lag * a * a))
    assert abs(rest[1]) < 1e-4
    assert rest[0] / rest[1] == pytest.approx(16.0, rel=0.15)


@pytest.mark.parametrize("frequency", [4000.0, 3000.0, 700.0, 800.0, 20.0])
def test_sampling_that_does_not_fit_is_refused(frequency):
    drive = load_drive("ipm")
    injection = dataclasses.replace(drive.injection, frequency=frequency)
    with pytest.raises(
        BadInput, match=rf"{frequency:g} Hz does not fit sampling at 4000 Hz.*2 to 64"
    ) as error:
        samples_per_period(injection, drive.converter)
    advice = float(str(error.value).split("inject at ")[1].split(" Hz")[0])
    assert (
        samples_per_period(dataclasses.replace(injection, frequency=advice), drive.converter) % 2
        == 0
    )
