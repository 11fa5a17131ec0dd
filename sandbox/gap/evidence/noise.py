"""Whether the noise that a campaign states is that of its sensors: all that follows is in units of
it.

Three phase currents of one star sum to zero, so what is left of their sum is the sensors' own.
Second differences of the sum's third take out offsets and slow gains: their mean square is twice
one sensor's variance.  What of a gain's mismatch is left makes that too large, never too small, so
quiet blocks count: their 10th percentile.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from model.errors import BadInput
from sandbox.gap.two_sensors import two_sensors
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import noise_floor

# samples: the 10th percentile of white noise's blocks lies 6 % below its rms, by chance alone
BLOCK = 400
ROUNDING = (
    # of the largest reading: float32 rounds by at most 2^-24 = 6e-8 of it, a second difference by
    # four times
    1e-6
)
# 25th percentile of blocks' rms of white noise: 0.674 deviations of sqrt(2 x 1.944 / BLOCK) / 2
# lower
QUARTER = 0.967
# relative error of the seen floor: 1.0 % scatter on twelve campaigns, 0.5 % by counting blocks
VOTE = 0.015
PLAUSIBLE = 1.5  # stated over seen, or seen over stated, up to which the seen one votes
TOO_LARGE = 2.0  # stated over seen from which nothing could be seen


class Noise(NamedTuple):
    """One sensor's noise (A rms): as stated, as seen (None where it cannot be), and the floor that
    is used."""

    stated: float
    seen: float | None
    used: float
    # part of it that stands for commands between the rows of a slow log, estimated
    unseen: float = 0.0


def seen(campaign: Campaign) -> float | None:
    """Return one sensor's noise (A rms) as quiet blocks show it; None where readings sum to zero,
    rounded.

    That is two sensors, the third reading made of theirs; or counts so coarse that most blocks
    never change.
    """
    return _of_blocks(campaign, 10.0)


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
    return Noise(stated, shown, math.hypot(voted(stated, shown), campaign.unseen), campaign.unseen)


def voted(stated: float, shown: float | None) -> float:
    """Return the floor (A rms) that both votes make."""
    if shown is None:
        return stated
    away = math.log(shown / stated)
    if abs(away) > math.log(PLAUSIBLE):
        return stated
    return stated * math.exp(away * -math.expm1(-0.5 * (away / VOTE) ** 2))


def _quarter(campaign: Campaign) -> float | None:
    """Return one sensor's noise (A rms) as the quieter quarter of blocks shows it, known to VOTE;
    of two sensors by `two_sensors`; None where neither can be seen."""
    found = _of_blocks(campaign, 25.0)
    if found is None:
        return None if counted(campaign) else two_sensors(campaign)
    return found / QUARTER


def _of_blocks(campaign: Campaign, percentile: float) -> float | None:
    blocks = []
    for r in campaign.recordings:
        total = (r.i_a + r.i_b + r.i_c) / 3.0
        second = total[2:] - 2.0 * total[1:-1] + total[:-2]
        count = max(1, len(second) // BLOCK)
        blocks += [float(np.mean(part**2)) for part in np.array_split(second, count) if part.size]
    if not blocks or np.median(blocks) <= (ROUNDING * largest(campaign)) ** 2:
        return None
    return float(np.sqrt(np.percentile(blocks, percentile) / 2.0))


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
    """Return a sentence on a stated noise that is overruled by the one seen, or stands against it;
    else ""."""
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
