"""Demodulation is exact for what it is built for: steady ripple on a linear trend, seen from a
turning frame."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimators.contract import Sample, Tuning
from estimators.demodulation import blank, demodulate
from model.drive_files import load_drive
from sandbox.drive.design import design
from sandbox.recordings.injection import primitive_of


def tuning(n, waveform="square", h=1e-4, amplitude=20.0) -> Tuning:
    base = design(load_drive("ipm_exchanged")).tuning
    primitive = primitive_of(waveform, n, h)
    return base._replace(
        period=n,
        sampling_period=h,
        amplitude=amplitude,
        power=float(primitive @ primitive),
        peak=float(abs(primitive).max()),
    )


def run(n, waveform, current, axis=0.0, omega=0.0):
    """Feed 3 n samples of i(k) and return the last result."""
    t, state, primitive = tuning(n, waveform), blank(), primitive_of(waveform, n, 1e-4)
    for k in range(3 * n + 1):
        i_alpha, i_beta = current(k, primitive[k % n])
        out = demodulate(
            state,
            Sample(i_alpha, i_beta, 0.0, 0.0, primitive[k % n]),
            axis + omega * k * 1e-4,
            omega,
            t,
        )
    return out


@pytest.mark.parametrize(
    ("n", "waveform"), [(2, "square"), (8, "square"), (8, "sine"), (20, "sine"), (64, "square")]
)
def test_exact_for_ripple_and_mean_on_a_trend(n, waveform):
    rise = 0.01  # A a sample
    out = run(n, waveform, lambda k, f: (0.7 + rise * k + 20.0 * 13.0 * f, -0.4 - 20.0 * 2.5 * f))
    middle = 3 * n - (0.75 * n - 0.5)  # centre of the window
    assert out == (
        pytest.approx(0.7 + rise * middle, rel=1e-12),
        pytest.approx(-0.4, rel=1e-12),
        pytest.approx(13.0, rel=1e-9),
        pytest.approx(-2.5, rel=1e-9),
    )


def test_frame_turns_with_the_estimated_speed():
    omega, axis = 60.0, 0.4

    def current(k, f):
        d, q, angle = 0.5 + 20.0 * 13.0 * f, 1.2 + 20.0 * 2.0 * f, axis + omega * k * 1e-4
        return d * math.cos(angle) - q * math.sin(angle), d * math.sin(angle) + q * math.cos(angle)

    assert run(8, "square", current, axis, omega) == (
        pytest.approx(0.5),
        pytest.approx(1.2),
        pytest.approx(13.0),
        pytest.approx(2.0),
    )


def test_noise_of_the_ripple():
    """White noise s on each sample gives s^2 sum (w F)^2 / (U sum F^2)^2; weights 1/2, 1, 1/2: 3/4
    of a period's."""
    t, rng, state = tuning(8), np.random.default_rng(1), blank()
    primitive = primitive_of("square", 8, 1e-4)
    found = []
    for k in range(40000):
        a, b = 0.01 * rng.standard_normal(2)
        found.append(demodulate(state, Sample(a, b, 0.0, 0.0, primitive[k % 8]), 0.0, 0.0, t)[3])
    expected = 0.01 / t.amplitude * math.sqrt(0.75 / t.power)
    # successive values share samples: about 40000/12 independent ones, 1.2 % each, three sigma
    assert np.std(found[100:]) == pytest.approx(expected, rel=0.04)
