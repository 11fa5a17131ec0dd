"""The A-weighting against the table that IEC 61672-1 prints, and its use on signals of known
size."""

from __future__ import annotations

import numpy as np
import pytest

from sandbox.evaluation.sound import CORNERS, a_weight, loudest, weighted_power

PRINTED = {  # Hz (nominal third octaves): dB, IEC 61672-1:2013, table 3
    10.0: -70.4,
    20.0: -50.5,
    31.5: -39.4,
    63.0: -26.2,
    125.0: -16.1,
    250.0: -8.6,
    500.0: -3.2,
    1000.0: 0.0,
    2000.0: 1.2,
    4000.0: 1.0,
    8000.0: -1.1,
    16000.0: -6.6,
    20000.0: -9.3,
}


def test_corners_are_those_of_the_standard():
    """Its annex E prints 20.60, 107.7, 737.9 and 12 194 Hz."""
    assert [f"{f:.4g}" for f in CORNERS] == ["20.6", "107.7", "737.9", "1.219e+04"]
    assert CORNERS[3] == pytest.approx(12194.0, abs=1.0)


@pytest.mark.parametrize(("nominal", "decibels"), PRINTED.items())
def test_weights_are_those_of_the_table(nominal, decibels):
    """Exact mid-frequencies are 10^(n/10) Hz; the table is rounded to 0.1 dB."""
    exact = 10.0 ** (round(10.0 * np.log10(nominal)) / 10.0)
    assert 20.0 * np.log10(a_weight(exact)) == pytest.approx(decibels, abs=0.05 + 1e-9)


def weighted_rms(signal, rate):
    return float(np.sqrt(np.sum(weighted_power(signal, rate))))


def test_a_tone_is_loud_alone_and_noise_is_not():
    rate, n = 48e3, 4800
    t = np.arange(n) / rate
    tone = weighted_power(np.sin(2.0 * np.pi * 1000.0 * t), rate)
    assert loudest(tone) == pytest.approx(0.5, rel=2e-3)
    noise = weighted_power(np.random.default_rng(2).standard_normal(n), rate)
    # three of 2400 lines hold 1/800 of evenly spread power; of exponentially distributed ones the
    # largest ln(800) + 2
    assert (
        loudest(noise)
        < (np.log(800.0) + 6.0) / 800.0 * float(np.max(a_weight(np.arange(1e3, 5e3)))) ** 2
    )


def test_sine_has_its_rms_times_its_weight():
    rate = 48e3
    t = np.arange(4800) / rate
    for f in (500.0, 1000.0, 6000.0):  # whole periods: all of a Hann window's three lines are in
        found = weighted_rms(3.0 + np.sqrt(2.0) * np.sin(2.0 * np.pi * f * t), rate)
        # the two outer lines have weights of their own
        assert found == pytest.approx(float(a_weight(f)), rel=2e-3)
    assert weighted_rms(np.sin(2.0 * np.pi * 22e3 * t), rate) < 1e-6  # unheard
    assert weighted_rms(np.full(4800, 7.0), rate) == 0.0


def test_white_noise_has_the_integral_of_the_weights():
    rate, noise = 40e3, np.random.default_rng(1).standard_normal(400_000)
    f = np.linspace(0.0, 20e3, 200_001)
    expected = np.sqrt(np.mean(a_weight(f) ** 2))
    assert weighted_rms(noise, rate) == pytest.approx(
        expected, rel=4.0 * np.sqrt(1.5 / 2.0 / 200_000.0)
    )
