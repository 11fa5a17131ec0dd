"""What of an unexplained voltage is one that each leg of the inverter loses: a gap, and no mistake.

At low currents dead time and the devices' drop take most of what was commanded, and a small factor
of the voltages would explain that nearly as well.
"""

from __future__ import annotations

import math

import numpy as np

from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import PHASES, Complex, window_of
from sandbox.recordings.checks.balance import balance as balance_of

# of the link: the most that a leg loses (chosen: 3 us of dead time at 16 kHz; a rest in another
# unit is far beyond)
MOST_LOST = 0.05


def lost_by_legs(current: Complex) -> Complex:
    """Return the voltage vector that legs lose, 1 V each with its current's sign."""
    turns = np.exp(2j * math.pi / 3.0 * np.arange(3))
    signs = (np.sign((current * np.conj(t)).real) * t for t in turns)
    return np.asarray((2.0 / 3.0) * sum(signs))


def left_by_legs(r: CampaignRecording, drive: Drive) -> float:
    """Return the share of a recording's voltage that stays unexplained once each leg loses the
    voltage that explains most, with its current's sign, up to MOST_LOST of the link."""
    size = window_of(r.columns)
    b = balance_of(r.columns, drive, size)
    phases = (0.5 * (r[n][1:] + r[n][:-1]) for n in PHASES)
    turns = np.exp(2j * math.pi / 3.0 * np.arange(3))
    signs = lost_by_legs(sum(2.0 / 3.0 * t * x for t, x in zip(turns, phases, strict=True)))
    total = np.concatenate([[0j], np.cumsum(signs)])
    shape = (total[b.rows + size] - total[b.rows]) / size
    energy = float(np.vdot(shape, shape).real)
    if energy == 0.0:
        return b.share
    most = MOST_LOST * float(np.median(r.u_dc))
    lost = min(max(float(np.vdot(shape, b.rest).real) / energy, 0.0), most)
    rest = b.rest - lost * shape
    return float(np.vdot(rest, rest).real) / max(float(np.vdot(b.voltage, b.voltage).real), 1e-300)
