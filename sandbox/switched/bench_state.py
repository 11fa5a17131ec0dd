"""Where what a bench remembers stands in its state, one float array."""

from __future__ import annotations

from enum import IntEnum

ROOM = 8  # edges that a leg may have at hand
MOST_READINGS = 32  # inside a period


class Slot(IntEnum):
    """Places in the state; of what has several numbers the first one."""

    PSI_ALPHA, PSI_BETA, CORE_ALPHA, CORE_BETA, SKIN_ALPHA, SKIN_BETA = range(6)
    THETA, SPEED, LOAD_SPEED, TWIST = range(6, 10)  # rad electrical; rad/s, rad mechanical
    FILTER_ALPHA, FILTER_BETA, I_ALPHA, I_BETA = range(10, 14)  # lagged, true terminal current, A
    HELD_ALPHA, HELD_BETA, LOOP = range(14, 17)  # Wb that hysteresis holds; A of shorted turns
    TIME = 17  # s, start of the coming period
    OFFSET = 18  # s from t_k to the next sample
    # audited energies, J: of the supply, lost, to the load; lost in the devices, from the link
    # without dead time
    INPUT, LOSS, OUTPUT, DEVICES, COMMANDED = range(19, 24)
    LINK_SAG, LINK_DIP, LINK_FEED = range(24, 27)  # V: in this period; the link's resonance
    LOAD = 27  # N m, the load torque that acts
    # three legs each: duty, level that acts, level commanded, late edges
    LAST_DUTY, LEVEL, WANTED, CARRIED = range(28, 40, 3)
    # three legs each: s by which this period's pulse is late, and the last one's
    SHIFT, LAST_SHIFT = range(40, 46, 3)
    CORES = 46  # A, what three sensors' cores hold
    SAMPLES = 49  # current vectors of three channels, where read before t_k
    EDGES = 55  # three legs of ROOM edge times relative to t_k
    # number of readings inside a period, then the current vector of each (see `reading_due`)
    READINGS = EDGES + 3 * ROOM


SIZE = Slot.READINGS + 1 + 2 * MOST_READINGS
