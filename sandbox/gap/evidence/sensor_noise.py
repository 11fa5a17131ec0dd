"""Size and colour of the current sensors' noise, from the sum of three readings.

Three phase currents of one star sum to zero, so what is left of the sum of readings is the sensors'
own: noise, and what gains, bends, cores and delays make of the currents.  Gains and bends are the
same in all recordings and are taken off by regression.  The rest goes with the currents, which
swing and turn: it stands in few frequencies and few blocks of time.  Noise stands in all.  So its
power at a frequency is the mean of periodograms (Welch, IEEE Trans. AU-15 (1967) 70) of all blocks
and of neighbouring frequencies, without those that are too large for noise.  A periodogram of noise
is an exponential variable: from the lower quarter follows a first mean, and those beyond CLIP means
are left out until it stays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.segments import Colour

ROUNDING = 1e-6  # of the largest reading: float32 rounds by at most 2^-24 = 6e-8 of it, three sum
BLOCK, SHORTEST = 512, 320  # samples of a block, half of them shared with the next one
# neighbouring frequencies on each side: 1.6 % of the sampling rate in all, within which the power
# behind a filter that forgets 0.8 from reading to reading changes by 2 %
EACH_SIDE = 4
# of the sampling rate: slower noise is taken to be as large as at it.  A sensor that shows currents
# has no filter below that; drifts and cores that remember are slower, and no noise.
SLOWEST = 1.0 / 64.0
CLIP = 5.0  # means: exp(-5) = 0.7 % of noise's own periodograms lie beyond
KEPT = 1.0 - CLIP * math.exp(-CLIP) / -math.expm1(-CLIP)  # mean of those below, in means
QUARTER = -math.log(0.75)  # lower quarter of an exponential variable, in means
# readings over which errors are seen to go together: of noise half of which is behind a filter that
# forgets 0.8 from reading to reading, 0.5^6 is left of how far an error predicts the next ones
LAGS = 6
# of neighbouring readings' errors: a smaller correlation changes what the noise hides by no more
# than what the noise is known to (sqrt((1 + rho)/(1 - rho)))
WHITE = 0.03
# Errors by chance, times the root of the number of blocks: of drawn noise, white and coloured, in
# 10, 50 and 200 blocks the size scatters by 0.04 to 0.07, the first autocorrelation by 0.05 to 0.08
SIZE_ERROR, COLOUR_ERROR = 0.07, 0.08
# relative error of the size that no number of blocks removes: 26 drawn campaigns of 150 to 980
# blocks, sizes misstated by up to 2, white and coloured, come out within 0.5 % (0.17 % rms)
BEYOND_CHANCE = 0.005


class SensorNoise(NamedTuple):
    """Noise of one current sensor: its rms (A), the autocorrelations of a reading's errors (none of
    white noise), and the relative error of the rms."""

    size: float
    colour: Colour
    error: float


def sensor_noise(campaign: Campaign) -> SensorNoise | None:
    """Return the noise of one sensor; None where readings sum to zero, rounded, or are too few.

    Readings sum to zero where the third one is made of two sensors, or where counts are so coarse
    that they hardly ever change: recordings without change do not count.
    """
    power = _periodograms(campaign)
    least = (ROUNDING * largest(campaign)) ** 2
    if not len(power) or np.median(power.mean(axis=1)) <= least:
        return None
    power = power[power.mean(axis=1) > least]
    auto = np.fft.irfft(_between_lines(power))
    root = math.sqrt(len(power))
    # rounding goes with the current: where it is half of the square, colour is no sensor's
    rounded = auto[0] <= campaign.drive.converter.current_resolution**2 / 6.0
    white = rounded or abs(auto[1] / auto[0]) <= max(WHITE, 3.0 * COLOUR_ERROR / root)
    colour = () if white else tuple((auto[1 : LAGS + 1] / auto[0]).tolist())
    return SensorNoise(math.sqrt(auto[0]), colour, math.hypot(BEYOND_CHANCE, SIZE_ERROR / root))


def counted(campaign: Campaign) -> bool:
    """Return whether counts coarser than the noise are stated and no two readings of a phase lie
    nearer than half one.

    Such readings need not scatter where the current rests.
    """
    converter, least = campaign.drive.converter, ROUNDING * largest(campaign)
    if converter.current_resolution <= converter.current_noise:
        return False
    steps = [np.abs(np.diff(c)) for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)]
    return all(
        np.min(s[s > least], initial=np.inf) >= 0.5 * converter.current_resolution for s in steps
    )


def still(campaign: Campaign) -> list[bool]:
    """Return by recording whether readings are counts and no phase moves by more than one, behind
    which noise can hide."""
    if not counted(campaign):
        return [False for _ in campaign.recordings]
    most = 1.5 * campaign.drive.converter.current_resolution
    return [all(np.ptp(c) < most for c in (r.i_a, r.i_b, r.i_c)) for r in campaign.recordings]


def largest(campaign: Campaign) -> float:
    """Return the largest current reading (A) of all phases and recordings."""
    return max(
        (float(np.max(np.abs(c))) for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)),
        default=0.0,
    )


def _periodograms(campaign: Campaign) -> Array:
    """Return periodograms (blocks, frequencies; A^2) of the sum of readings, as large as one
    sensor's noise; their mean over frequencies is its square."""
    rest = _sums(campaign)
    length = min(BLOCK, max((len(x) for x in rest), default=0)) // 2 * 2
    if length < SHORTEST:
        return np.empty((0, 0))
    window = np.sin(math.pi * np.arange(length) / length) ** 2
    window /= math.sqrt(float(window @ window))
    blocks = [
        x[first : first + length]
        for x in rest
        for first in range(0, len(x) - length + 1, length // 2)
    ]
    return np.array([np.abs(np.fft.rfft(window * (x - x.mean()))) ** 2 for x in blocks])


def _between_lines(power: Array) -> Array:
    """Return the mean power of noise at each frequency from periodograms (blocks, frequencies),
    those left out that are too large for it."""
    last = power.shape[1] - 1
    first = round(2.0 * SLOWEST * last)
    out = np.empty(last + 1)
    for k in range(first, last + 1):  # at the last one, half the sampling rate, it is a real number
        own = power[:, k - EACH_SIDE : min(last, k + EACH_SIDE + 1)].ravel()
        mean, before = float(np.quantile(own, 0.25)) / QUARTER, 0.0
        while abs(mean - before) > 1e-4 * mean:
            before, mean = mean, float(own[own < CLIP * mean].mean()) / KEPT
        out[k] = mean
    out[:first] = out[first]
    return out


def _sums(campaign: Campaign) -> list[Array]:
    """Return by recording the sum of readings over the root of three (A): as large as one sensor's
    noise.

    Each recording's offset and drift are taken off, and what gains and bends of the sensors leave
    of the sum, which are the same in all recordings.
    """
    most = largest(campaign) or 1.0
    steady = [
        _steady(np.stack([r.i_a + r.i_b + r.i_c, *_bends(r, most)]))
        for r, rests in zip(campaign.recordings, still(campaign), strict=True)
        if not rests
    ]
    if not steady:
        return []
    cross = np.sum([x @ x.T for x in steady], axis=0)
    bends = np.linalg.lstsq(cross[1:, 1:], cross[1:, 0], rcond=None)[0]
    return [(x[0] - bends @ x[1:]) / math.sqrt(3.0) for x in steady]


def _bends(r: CampaignRecording, most: float) -> list[Array]:
    """Return the courses (n,) that gains of two sensors and bends of three make, currents over the
    largest (A).

    A third of the sum is taken off each reading: noise that is alike in three sensors is then not
    the sum's, and a regression takes none of that for a gain.
    """
    rest = (r.i_a + r.i_b + r.i_c) / 3.0
    phases = [(x - rest) / most for x in (r.i_a, r.i_b, r.i_c)]
    return [*phases[:2], *(f for x in phases for f in (x * x, x * abs(x), x**3))]


def _steady(x: Array) -> Array:
    """Return courses (k, n) without their means and drifts."""
    line = np.stack([np.ones(x.shape[1]), np.linspace(-1.0, 1.0, x.shape[1])])
    return x - np.linalg.lstsq(line.T, x.T, rcond=None)[0].T @ line
