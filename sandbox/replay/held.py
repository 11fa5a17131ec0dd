"""Replays that readings hold: what one misses is forgotten within some samples.

A replay by voltages alone adds up what it misses for L/R.  Where resistance is small, a fraction of
a volt makes currents of many times the noise, and where legs give volts back
(`negative_resistance`) errors grow.  Readings that hold a replay, as an observer's do, add in each
sample a share

    g = h T / (L + h T)

of the difference to it, T from reading to reading: as a resistance h would, were the current read
the one that flows.  What is missed for long then shows as it stands, in proportion, and is
forgotten after L/(h T) samples.  The reading's noise n comes back: differences are (1 - z)/(1 - (1
- g) z) n, z one sample back, whose variance is 2/(2 - g) of the noise's (Parseval's theorem, white
noise; coloured noise is whitened alike before and after).  What all three phases have in common, a
third of the square of three sensors' noise, is no current and does not come back.
In the literature: prediction errors in place of simulation errors (Ljung, System Identification,
2nd ed., 1999, section 3.2), and observers that make an objective smooth (Vyasarayani et al.,
Nonlinear Dynamics 67 (2012) 455).  Checked: tests/sandbox/replay/test_held.py.
"""

from __future__ import annotations

import math
from dataclasses import replace

from model.parameters import Drive
from sandbox.replay.replay import Prepared
from sandbox.replay.unread_start import with_starts


def held(prepared: Prepared, ohms: float) -> Prepared:
    """Return a campaign whose replays are held by readings as by a resistance of so many ohms; its
    noise is as much larger as comes back."""
    own = replace(
        prepared,
        recordings=tuple(replace(r, hold=ohms) for r in prepared.recordings),
        noise_std=_released_noise(prepared) * wider(prepared.campaign.drive, ohms),
    )
    return with_starts(own)


def released(prepared: Prepared) -> Prepared:
    """Return the same whose replays go by their voltages, from starts that count as known."""
    own = tuple(replace(r, hold=0.0, start=None) for r in prepared.recordings)
    return replace(prepared, recordings=own, noise_std=_released_noise(prepared))


def remembering(drive: Drive, samples: float) -> float:
    """Return the ohms with which a replay forgets what it missed within so many samples."""
    return _least_inductance(drive) / (samples * drive.converter.sampling_period)


def wider(drive: Drive, ohms: float) -> float:
    """Return the differences' standard deviation over that of the readings' noise, mean square of
    both axes at no current and of what three phases have in common."""
    taken = ohms * drive.converter.sampling_period
    correction = taken / (1.0 + taken / _least_inductance(drive))
    own = [correction / x for x in (drive.motor.inductance_d, drive.motor.inductance_q)]
    return math.sqrt((1.0 + sum(2.0 / (2.0 - g) for g in own)) / 3.0)


def _released_noise(prepared: Prepared) -> float:
    """Return the standard deviation of the readings' noise itself, A."""
    return prepared.noise_std / wider(prepared.campaign.drive, prepared.recordings[0].hold)


def _least_inductance(drive: Drive) -> float:
    """Return the smaller inductance at no current, H."""
    return min(drive.motor.inductance_d, drive.motor.inductance_q)
