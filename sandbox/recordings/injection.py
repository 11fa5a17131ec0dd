"""The injected waveform on the sampling grid: f on each interval, its zero-mean primitive F at each
sample."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.contract import MAX_PERIOD
from model.errors import BadInput
from model.parameters import Converter, Injection

FEWEST = {"square": 2, "sine": 4, "random": 8}


class Carrier(NamedTuple):
    """One period of the injection: f (-, on the interval from each sample) and F (s, at each
    sample), both (N,)."""

    waveform: NDArray[np.float64]
    primitive: NDArray[np.float64]
    lag: float  # s^2, weight of the (R Gamma)^2 correction, see `second_order_lag`


def samples_per_period(injection: Injection, converter: Converter) -> int:
    """Return N = sampling frequency / injection frequency; BadInput where the sampling cannot carry
    the waveform."""
    sampling = 1.0 / converter.sampling_period
    ratio = sampling / injection.frequency
    n, fewest = round(ratio), FEWEST[injection.waveform]
    if n < fewest or abs(ratio - n) > 1e-6 * ratio or n > MAX_PERIOD or n % 2:
        better = sampling / min(max(fewest, 2 * round(ratio / 2)), MAX_PERIOD)
        raise BadInput(
            f"injection frequency {injection.frequency:g} Hz does not fit sampling at {sampling:g} "
            f"Hz (ratio {ratio:.4g}): a {injection.waveform} wave needs an even number of samples "
            f"a period, {fewest} to {MAX_PERIOD}; inject at {better:.12g} Hz"
        )
    return n


def carrier(injection: Injection, converter: Converter) -> Carrier:
    """Return the carrier of an injection on a converter's sampling grid (voltages held over each
    interval)."""
    n, h = samples_per_period(injection, converter), converter.sampling_period
    f = waveform_of(injection.waveform, n)
    return Carrier(f, primitive_of(injection.waveform, n, h), second_order_lag(f, h))


def waveform_of(waveform: str, n: int) -> NDArray[np.float64]:
    """Return f on the n intervals of a period, held over each: `square`, `sine`, or `random` signs.

    The second half is the first one negated, whatever the shape: demodulation counts on it.
    """
    k = np.arange(n)
    if waveform == "random":
        half = _random_signs(n // 2)
        return np.concatenate([half, -half])
    return (
        np.where(k < n // 2, 1.0, -1.0)
        if waveform == "square"
        else np.sin(2.0 * math.pi * (k + 0.5) / n)
    )


def _random_signs(n: int) -> NDArray[np.float64]:
    """Return n signs of a shift register's maximum-length sequence, x^5 + x^2 + 1, 31 signs
    long."""
    bits = [1, 0, 0, 1, 0]
    while len(bits) < n:
        bits.append(bits[-3] ^ bits[-5])
    return np.where(np.array(bits[:n]) == 1, 1.0, -1.0)


def primitive_of(waveform: str, n: int, h: float) -> NDArray[np.float64]:
    """Return the zero-mean primitive F (s) at the n samples of a period, h seconds apart."""
    return _periodic(waveform_of(waveform, n) * h)


def second_order_lag(f: NDArray[np.float64], h: float) -> float:
    """Return c >= 0 such that the in-phase ripple is (Gamma - c (R Gamma)^2 Gamma) U to second
    order in R.

    The periodic flux ripple of dx/dt = f - a x expands in zero-mean primitives F1 - a F2 + a^2
    F3 - ...; projected on the sampled F1, F2 vanishes by symmetry and F3 leaves -c.  Primitives of
    a voltage held over intervals of h seconds are polynomials on each, so sample values follow in
    closed form.
    """
    one = _periodic(f * h)
    two = _periodic(h * one + h**2 / 2 * f)
    # continuous mean: F2 must have none before F3
    mean_two = np.mean(two + h * one / 2 + h**2 * f / 6)
    two -= mean_two
    three = _periodic(h * two + h**2 / 2 * one + h**3 / 6 * f)
    return float(
        -np.dot(three - three.mean(), one - one.mean()) / np.dot(one - one.mean(), one - one.mean())
    )


def _periodic(increments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values at the samples of a periodic primitive, given its increments, with zero
    sample mean."""
    values = np.concatenate([[0.0], np.cumsum(increments)[:-1]])
    return np.asarray(values - values.mean())
