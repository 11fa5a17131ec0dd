"""Whether the noise that a campaign states is that of its sensors: all that follows is in units of
it.

What readings show comes from the sum of three of them (`sensor_noise`); of two sensors from
neighbouring readings of locked rotors (`two_sensors`).  It votes beside the stated one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from model.errors import BadInput
from sandbox.gap.evidence.sensor_noise import SensorNoise, counted, sensor_noise, still
from sandbox.gap.two_sensors import two_sensors
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import stated_noise_std
from sandbox.replay.segments import Colour

# relative error of the noise that two sensors show: 1.0 % of scatter on 75 opened campaigns, 0.9 %
# too large in the mean
OF_TWO = 0.015
# Stated over seen, or seen over stated, up to which the seen one votes: noise that was measured in
# ten times, or a tenth of, the sensors' band.
PLAUSIBLE = 3.0
TOO_LARGE = 3.0  # stated over seen from which nothing could be seen


class Noise(NamedTuple):
    """One sensor's noise (A rms): as stated, as seen (None where it cannot be), and the one that
    is used; colour: autocorrelations of a reading's errors, none of white noise."""

    stated: float
    seen: float | None
    used: float
    colour: Colour = ()
    # part of it that stands for commands between the rows of a slow log, estimated
    unseen: float = 0.0
    error: float = OF_TWO  # relative, of the seen one


def noise_std_of(campaign: Campaign, stated: float) -> float:
    """Return the noise (A rms) that the stated one and the one seen agree on: both vote.

    Where they differ by what the seen one errs the stated one stands; the further they part, the
    more the seen one counts.  Beyond PLAUSIBLE, as `noise_caution` says, or where none is seen, the
    stated one stands alone.  What a slow log leaves open (`Campaign.unseen`) comes on top.
    """
    return math.hypot(voted(stated, _shown(campaign)), campaign.unseen)


def noise_of(campaign: Campaign) -> Noise:
    """Return the noise that a campaign states, that its readings show, and the one that
    is used."""
    stated, shown = stated_noise_std(campaign.drive.converter), _shown(campaign)
    used = math.hypot(voted(stated, shown), campaign.unseen)
    if shown is None:
        return Noise(stated, None, used, (), campaign.unseen)
    return Noise(stated, shown.size, used, shown.colour, campaign.unseen, shown.error)


def voted(stated: float, shown: SensorNoise | None) -> float:
    """Return the noise (A rms) that both votes make."""
    if shown is None:
        return stated
    away = math.log(shown.size / stated)
    if abs(away) > math.log(PLAUSIBLE):
        return stated
    return stated * math.exp(away * -math.expm1(-0.5 * (away / shown.error) ** 2))


def _shown(campaign: Campaign) -> SensorNoise | None:
    """Return one sensor's noise as readings show it; None where they cannot."""
    if found := sensor_noise(campaign):
        return found
    size = None if counted(campaign) else two_sensors(campaign)
    return None if size is None else SensorNoise(size, (), OF_TWO)


def noise_caution(campaign: Campaign, own: Noise) -> str:
    """Return a sentence where stated noise and readings part: which of them counts, or that counts
    hide it; else "".  own: what `noise_of` says of the campaign.

    BadInput where no current ever changes, or the stated noise is far larger than what the sensors
    show and no coarse counts explain it.
    """
    if all(np.ptp(c) == 0.0 for r in campaign.recordings for c in (r.i_a, r.i_b, r.i_c)):
        raise BadInput(
            "no current of any recording ever changes; record the three current sensors "
            "with the drive on"
        )
    hidden, resolution = counted(campaign), campaign.drive.converter.current_resolution
    if hidden and own.seen is not None and any(still(campaign)):
        return (
            f"Current readings at rest hardly change, since a count of {resolution:.3g} A hides "
            f"the noise there: everything here is in units of {own.used:.3g} A, that of readings "
            "that change."
        )
    if not hidden and own.seen is not None and own.stated > TOO_LARGE * own.seen:
        raise BadInput(
            f"[drive] current_noise and current_resolution state {own.stated:.3g} A of noise, the "
            f"readings scatter by {own.seen:.3g} A; nothing could be seen below the stated noise: "
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
