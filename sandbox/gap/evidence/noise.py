"""Whether the noise that a campaign states is that of its sensors: all that follows is in units of
it.

Three phase currents of one star sum to zero, so what is left of their sum is the sensors' own.
Second differences of the sum's third take out offsets and slow gains: their mean square is twice
one sensor's variance.  What of a gain's mismatch is left makes that too large, never too small, so
quiet blocks count: their 10th percentile.

Filters and slow amplifiers colour noise: a reading's error then goes on in the next one, and second
differences show little of it.  That there is such noise is told by differences over two readings,
which are larger than those over one, but by more than those over three are larger again: squares of
a course's differences grow faster and faster.  Its size is then the mean square itself, once each
recording's offset and drift are taken off, and what sensors that differ or bend leave in the sum.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from sandbox.gap.two_sensors import two_sensors
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.inputs import noise_floor
from sandbox.replay.segments import Colour

Array = NDArray[np.float64]
# samples: the 10th percentile of white noise's blocks lies 6 % below its rms, by chance alone
BLOCK = 400
ROUNDING = (
    # of the largest reading: float32 rounds by at most 2^-24 = 6e-8 of it, a second difference by
    # four times
    1e-6
)
# readings over which errors are seen to go together: of noise half of which is behind a filter that
# forgets 0.8 from reading to reading, 0.5^6 is left of how far an error foretells the next ones
LAGS = 6
LONG = 4000  # samples of a block of coloured noise, of which fewer are independent
# Relative error of its square: blocks of LONG scatter by 0.022 sqrt((1 + rho^2)/(1 - rho^2)), 0.05
# at 0.8, and the quarter of 24 of them by 1.36/sqrt(24) of that.
COLOURED = 0.015
LOWER = 0.674  # deviations that the 25th percentile of a Gaussian lies below its mean
# 25th percentile of blocks' rms of white noise: LOWER deviations of sqrt(2 x 1.944 / BLOCK) / 2
# lower
QUARTER = 0.967
# of neighbouring readings' errors: a smaller correlation changes what the noise hides by no more
# than what the floor is known to (sqrt((1 + rho)/(1 - rho)), twice VOTE)
WHITE = 0.03
# relative error of the seen floor: 1.0 % scatter on twelve campaigns, 0.5 % by counting blocks
VOTE = 0.015
# Stated over seen, or seen over stated, up to which the seen one votes: noise that was measured in
# ten times, or a tenth of, the sensors' band.
PLAUSIBLE = 3.0
TOO_LARGE = 3.0  # stated over seen from which nothing could be seen


class Noise(NamedTuple):
    """One sensor's noise (A rms): as stated, as seen (None where it cannot be), and the floor that
    is used; colour: autocorrelations of a reading's errors, none of white noise."""

    stated: float
    seen: float | None
    used: float
    colour: Colour = ()
    # part of it that stands for commands between the rows of a slow log, estimated
    unseen: float = 0.0


def seen(campaign: Campaign) -> float | None:
    """Return one sensor's noise (A rms) as quiet blocks show it; None where readings sum to zero,
    rounded.

    That is two sensors, the third reading made of theirs; or counts so coarse that most blocks
    never change.
    """
    own = coloured(campaign, 10.0)
    return _of_blocks(campaign, 10.0) if own is None else own[0]


def floor_of(campaign: Campaign, stated: float) -> float:
    """Return the noise floor (A rms) that the stated one and the one seen agree on: both vote.

    Where they differ by what the seen one errs (VOTE) the stated one stands; the further they part,
    the more the seen one counts.  Beyond PLAUSIBLE, as `noise_caution` says, or where none is seen,
    the stated one stands alone.  What a slow log leaves open (`Campaign.unseen`) comes on top.
    """
    return math.hypot(voted(stated, _quarter(campaign)), campaign.unseen)


def noise_of(campaign: Campaign) -> Noise:
    """Return the noise that a campaign states, that its readings show, and the floor that
    follows."""
    stated, shown = noise_floor(campaign.drive.converter), _quarter(campaign)
    used = math.hypot(voted(stated, shown), campaign.unseen)
    return Noise(stated, shown, used, colour_of(campaign), campaign.unseen)


def voted(stated: float, shown: float | None) -> float:
    """Return the floor (A rms) that both votes make."""
    if shown is None:
        return stated
    away = math.log(shown / stated)
    if abs(away) > math.log(PLAUSIBLE):
        return stated
    return stated * math.exp(away * -math.expm1(-0.5 * (away / VOTE) ** 2))


def colour_of(campaign: Campaign) -> Colour:
    """Return the autocorrelations of a reading's errors; none where neighbouring ones go together
    by less than WHITE, or where that cannot be seen."""
    found = coloured(campaign, 25.0)
    return () if found is None else found[1]


def coloured(campaign: Campaign, percentile: float) -> tuple[float, Colour] | None:
    """Return the noise of one sensor (A rms), as a percentile of blocks shows it, and the
    autocorrelations of its errors; None of white noise, or where none is seen."""
    *over, squares = (np.concatenate(x) for x in zip(*_differing(campaign), strict=True))
    least = (ROUNDING * largest(campaign)) ** 2
    if not len(squares) or np.median(over[0]) <= least:
        return None
    some = over[0] > least
    times = np.array([float(np.median(x[some] / over[0][some])) for x in over])
    if abs(times[1] - 1.0) <= WHITE or abs(times[2] - times[1]) >= abs(times[1] - 1.0):
        return None
    square = float(np.percentile(squares, percentile))
    colour = tuple((1.0 - 0.5 * float(np.median(over[0])) / square * times).tolist())
    # rounding goes with the current: where it is half of the square, colour is no sensor's
    mostly = square > campaign.drive.converter.current_resolution**2 / 6.0
    return (math.sqrt(square), colour) if mostly and abs(colour[0]) < 1.0 - WHITE else None


def _quarter(campaign: Campaign) -> float | None:
    """Return one sensor's noise (A rms) as the quieter quarter of blocks shows it, known to VOTE;
    of two sensors by `two_sensors`; None where neither can be seen."""
    if own := coloured(campaign, 25.0):
        alike = 1.0 + 2.0 * float(np.sum(np.square(own[1])))
        return own[0] / math.sqrt(1.0 - LOWER * math.sqrt(2.0 * alike / LONG))
    found = _of_blocks(campaign, 25.0)
    if found is None:
        return None if counted(campaign) else two_sensors(campaign)
    return found / QUARTER


def _of_blocks(campaign: Campaign, percentile: float) -> float | None:
    """Return one sensor's white noise (A rms) as a percentile of blocks shows it."""
    blocks = []
    for r in campaign.recordings:
        total = (r.i_a + r.i_b + r.i_c) / 3.0
        second = total[2:] - 2.0 * total[1:-1] + total[:-2]
        blocks += _squares(second, BLOCK)
    if not blocks or np.median(blocks) <= (ROUNDING * largest(campaign)) ** 2:
        return None
    return float(np.sqrt(np.percentile(blocks, percentile) / 2.0))


def _differing(campaign: Campaign) -> list[list[list[float]]]:
    """Return by recording mean squares (A^2) of the sum of readings, as large as one sensor's
    noise, in blocks: of its differences over 1 to LAGS readings, and of itself.

    Each recording's offset and drift are taken off, and what gains and bends of the sensors leave
    of the sum, which are the same in all recordings.
    """
    most = largest(campaign) or 1.0
    steady = [
        _steady(np.stack([r.i_a + r.i_b + r.i_c, *_bends(r, most)])) for r in campaign.recordings
    ]
    cross = np.sum([x @ x.T for x in steady], axis=0)
    bends = np.linalg.lstsq(cross[1:, 1:], cross[1:, 0], rcond=None)[0]
    out = []
    for x in steady:
        left = (x[0] - bends @ x[1:]) / math.sqrt(3.0)
        over = [left[LAGS:] - left[LAGS - k : -k] for k in range(1, LAGS + 1)]
        out.append([*(_squares(x, BLOCK) for x in over), _squares(left, LONG)])
    return out


def _bends(r: CampaignRecording, most: float) -> list[Array]:
    """Return the courses (n,) that gains of two sensors and bends of three make, currents over the
    largest (A)."""
    phases = [x / most for x in (r.i_a, r.i_b, r.i_c)]
    return [*phases[:2], *(f for x in phases for f in (x * x, x * abs(x), x**3))]


def _steady(x: Array) -> Array:
    """Return courses (k, n) without their means and drifts."""
    line = np.stack([np.ones(x.shape[1]), np.linspace(-1.0, 1.0, x.shape[1])])
    return x - np.linalg.lstsq(line.T, x.T, rcond=None)[0].T @ line


def _squares(x: Array, length: int) -> list[float]:
    """Return the mean squares of blocks of about a length."""
    parts = np.array_split(x, max(1, len(x) // length))
    return [float(np.mean(part**2)) for part in parts if part.size]


def largest(campaign: Campaign) -> float:
    """Return the largest current reading (A) of all phases and recordings."""
    return max(
        (float(np.max(np.abs(c))) for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)),
        default=0.0,
    )


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


def noise_caution(campaign: Campaign) -> str:
    """Return a sentence where stated noise and readings part: which of them counts, or that counts
    hide it; else "".

    BadInput where no current ever changes, or the stated noise is far larger than what the sensors
    show and no coarse counts explain it.
    """
    if all(np.ptp(c) == 0.0 for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)):
        raise BadInput(
            "no current of any recording ever changes; record the three current sensors "
            "with the drive on"
        )
    own, quiet = noise_of(campaign), seen(campaign)
    if quiet is None:
        return parting(own)
    if own.stated > TOO_LARGE * quiet and counted(campaign):
        resolution = campaign.drive.converter.current_resolution
        return (
            f"Current readings at rest scatter by {quiet:.3g} A only, since a count of "
            f"{resolution:.3g} A hides the noise there: everything here is in units of "
            f"{own.used:.3g} A, that of readings that change."
        )
    if own.stated > TOO_LARGE * quiet:
        raise BadInput(
            f"[drive] current_noise and current_resolution state {own.stated:.3g} A of noise, the "
            f"readings scatter by {quiet:.3g} A; nothing could be seen below the stated noise: "
            "state what the sensors have (A, not mA)"
        )
    return parting(own)


def far_apart(own: Noise) -> bool:
    """Return whether stated noise and the one that readings show cannot both be right: PLAUSIBLE
    times and more."""
    return own.seen is not None and abs(math.log(own.seen / own.stated)) > math.log(PLAUSIBLE)


def parting(own: Noise) -> str:
    """Return what is to be said of noise that readings show: that it overrules the stated one or
    that both part, that it is coloured; else ""."""
    return " ".join(x for x in (_apart(own), _coloured(own)) if x)


def _coloured(own: Noise) -> str:
    """Return a sentence on noise whose neighbouring errors go together; else ""."""
    if not own.colour:
        return ""
    return (
        f"Neighbouring current readings err alike (correlation {own.colour[0]:.2f}), as behind a "
        "filter: slow parts of what is left count for less, fast ones for more."
    )


def _apart(own: Noise) -> str:
    """Return a sentence where the stated noise and the one seen part; else ""."""
    if own.seen is None:
        return ""
    overruled = not own.unseen and abs(math.log(own.used / own.seen)) < abs(
        math.log(own.used / own.stated)
    )
    if not overruled and not far_apart(own):
        return ""
    said = (
        f"[drive] current_noise and current_resolution state {own.stated:.4g} A of noise, the "
        f"current readings scatter by {own.seen:.4g} A"
    )
    if overruled:
        return (
            f"{said}: everything here is in units of {own.used:.4g} A, which follows the "
            "readings more than the file."
        )
    larger = "larger" if own.seen > own.stated else "smaller"
    return (
        f"{said}, too far apart for both to be right: everything here is in units of the "
        "stated noise and may look "
        f"{larger} than it is. Measure the noise with the drive on and no current, and state it."
    )
