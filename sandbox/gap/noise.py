"""Whether the noise that a campaign states is that of its sensors: all that follows is in units of it.

Three phase currents of one star sum to zero, so what is left of their sum is the sensors' own.  Second differences of
the sum's third take out offsets and slow gains: their mean square is twice one sensor's variance.  What of a gain's
mismatch is left makes that too large, never too small, so the quietest blocks count.
"""

from __future__ import annotations

import numpy as np

from model.errors import BadInput
from sandbox.campaign import Campaign
from sandbox.replay.inputs import noise_floor

BLOCK = 400  # samples: the quietest of many blocks lies a quarter below the mean, by chance alone
TOO_LARGE, TOO_SMALL = 2.0, 3.0  # stated over seen, seen over stated


def seen(campaign: Campaign) -> float | None:
    """Return one sensor's noise (A rms) as the quietest blocks show it; None where the readings sum to zero exactly."""
    blocks = []
    for r in campaign.recordings:
        total = (r.i_a + r.i_b + r.i_c) / 3.0
        second = total[2:] - 2.0 * total[1:-1] + total[:-2]
        count = max(1, len(second) // BLOCK)
        blocks += [float(np.mean(part**2)) for part in np.array_split(second, count) if part.size]
    scale = max((float(np.max(np.abs(r.i_a))) for r in campaign.recordings), default=0.0)
    if not blocks or np.median(blocks) <= (1e-12 * scale) ** 2:
        return None
    return float(np.sqrt(np.percentile(blocks, 10) / 2.0))


def noise_caution(campaign: Campaign) -> str:
    """Return a sentence where the sensors scatter more than the campaign states, or "".

    BadInput where no current ever changes, or the stated noise is far larger than what the sensors show.
    """
    if all(np.ptp(c) == 0.0 for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)):
        raise BadInput("no current of any recording ever changes; record the three current sensors with the drive on")
    stated, shown = noise_floor(campaign.drive.converter), seen(campaign)
    if shown is None:
        return ""
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
