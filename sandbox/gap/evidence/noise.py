"""Whether the noise that a campaign states is that of its sensors: all that follows is in units of it.

Three phase currents of one star sum to zero, so what is left of their sum is the sensors' own.  Second differences of
the sum's third take out offsets and slow gains: their mean square is twice one sensor's variance.  What of a gain's
mismatch is left makes that too large, never too small, so quiet blocks count: their 10th percentile.
"""

from __future__ import annotations

import math

import numpy as np

from model.errors import BadInput
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import noise_floor

BLOCK = 400  # samples: the 10th percentile of white noise's blocks lies 6 % below its rms, by chance alone
ROUNDING = (
    1e-6  # of the largest reading: float32 rounds by at most 2^-24 = 6e-8 of it, a second difference by four times
)
QUARTER = 0.967  # 25th percentile of blocks' rms of white noise: 0.674 deviations of sqrt(2 x 1.944 / BLOCK) / 2 lower
VOTE = 0.015  # relative error of the seen floor: 1.0 % scatter on twelve campaigns, 0.5 % by counting blocks
PLAUSIBLE = 1.5  # stated over seen, or seen over stated, up to which the seen one votes
TOO_LARGE, TOO_SMALL = 2.0, 3.0  # stated over seen, seen over stated


def seen(campaign: Campaign) -> float | None:
    """Return one sensor's noise (A rms) as quiet blocks show it; None where readings sum to zero, rounded.

    That is two sensors, the third reading made of theirs; or counts so coarse that most blocks never change.
    """
    return _of_blocks(campaign, 10.0)


def floor_of(campaign: Campaign, stated: float) -> float:
    """Return the noise floor (A rms) that the stated one and the one seen agree on: both vote.

    Where they differ by what the seen one errs (VOTE) the stated one stands; the further they part, the more the seen
    one counts.  Beyond PLAUSIBLE, as `noise_caution` says, or with two sensors, the stated one stands alone.
    """
    quarter = _of_blocks(campaign, 25.0)
    if quarter is None:
        return stated
    away = math.log(quarter / QUARTER / stated)
    if abs(away) > math.log(PLAUSIBLE):
        return stated
    return stated * math.exp(away * -math.expm1(-0.5 * (away / VOTE) ** 2))


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
    return max((float(np.max(np.abs(c))) for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)), default=0.0)


def counted(campaign: Campaign) -> bool:
    """Return whether counts coarser than the noise are stated and no two readings of a phase lie nearer than half one.

    Such readings need not scatter where the current rests.
    """
    converter, least = campaign.drive.converter, ROUNDING * largest(campaign)
    if converter.current_resolution <= converter.current_noise:
        return False
    steps = [np.abs(np.diff(c)) for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)]
    return all(np.min(s[s > least], initial=np.inf) >= 0.5 * converter.current_resolution for s in steps)


def noise_caution(campaign: Campaign) -> str:
    """Return a sentence where the sensors scatter more than the campaign states, or hide it in their counts, or "".

    BadInput where no current ever changes, or the stated noise is far larger than what the sensors show and no
    coarse counts explain it.
    """
    if all(np.ptp(c) == 0.0 for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)):
        raise BadInput("no current of any recording ever changes; record the three current sensors with the drive on")
    stated, shown = noise_floor(campaign.drive.converter), seen(campaign)
    if shown is None:
        return ""
    if stated > TOO_LARGE * shown and counted(campaign):
        resolution = campaign.drive.converter.current_resolution
        return (
            f"Current readings at rest scatter by {shown:.3g} A only, since a count of {resolution:.3g} A hides the "
            f"noise there: everything here is in units of {stated:.3g} A, that of readings that change."
        )
    if stated > TOO_LARGE * shown:
        raise BadInput(
            f"[drive] current_noise and current_resolution state {stated:.3g} A of noise, the readings scatter by "
            f"{shown:.3g} A; nothing could be seen below the stated noise: state what the sensors have (A, not mA)"
        )
    if shown > TOO_SMALL * stated:
        return (
            f"The current readings scatter by {shown:.3g} A, [drive] current_noise and current_resolution state "
            f"{stated:.3g} A: everything here is in units of the stated noise and may look larger than it is."
        )
    return ""
