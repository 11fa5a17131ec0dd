"""Where what a bench remembers stands in its state, one float array."""

from __future__ import annotations

from typing import NamedTuple

from sandbox.switched.layers import CIRCUITS

ROOM = 8  # edges that a leg may have at hand
MOST_READINGS = 32  # inside a period


class Slots(NamedTuple):
    """Places in the state; of what has several numbers the first one."""

    PSI_ALPHA: int = 0
    PSI_BETA: int = 1
    CORE_ALPHA: int = 2
    CORE_BETA: int = 3
    SKIN_ALPHA: int = 4
    SKIN_BETA: int = 5
    THETA: int = 6  # rad electrical
    SPEED: int = 7  # rad/s, mechanical, as the next
    LOAD_SPEED: int = 8
    TWIST: int = 9  # rad
    FILTER_ALPHA: int = 10  # lagged current, A
    FILTER_BETA: int = 11
    I_ALPHA: int = 12  # true terminal current, A
    I_BETA: int = 13
    HELD_ALPHA: int = 14  # Wb that hysteresis holds
    HELD_BETA: int = 15
    LOOP: int = 16  # A of shorted turns
    TIME: int = 17  # s, start of the coming period
    OFFSET: int = 18  # s from t_k to the next sample
    INPUT: int = 19  # audited energies, J: of the supply, lost, to the load
    LOSS: int = 20
    OUTPUT: int = 21
    DEVICES: int = 22  # J lost in the devices
    COMMANDED: int = 23  # J from the link without dead time
    LINK_SAG: int = 24  # V in this period
    LINK_DIP: int = 25
    LINK_FEED: int = 26  # the link's resonance
    LOAD: int = 27  # N m, the load torque that acts
    LAST_DUTY: int = 28  # three legs, as the next ones
    LEVEL: int = 31  # that acts
    WANTED: int = 34  # level commanded
    CARRIED: int = 37  # late edges
    SHIFT: int = 40  # three legs, s by which this period's pulse is late
    LAST_SHIFT: int = 43
    CORES: int = 46  # A, what three sensors' cores hold
    SAMPLES: int = 49  # current vectors of three channels, where read before t_k
    BENT: int = 55  # rad, bristles of dry friction
    EDGES: int = 56  # three legs of ROOM edge times relative to t_k
    MODES: int = 56 + 3 * ROOM  # current vectors of a winding's layers (`layers`)
    # number of readings inside a period, then the current vector of each (see `reading_due`)
    READINGS: int = 56 + 3 * ROOM + 2 * CIRCUITS


Slot = Slots()  # no enum: before 0.68 numba takes none as an index
SIZE = Slot.READINGS + 1 + 2 * MOST_READINGS
