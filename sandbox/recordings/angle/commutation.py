"""An angle of Hall states or of counted commutation steps: sixths of an electrical turn, smooth between changes.

Three sensors 120 degrees apart give the states 1 to 6, 60 degrees apart also 0 and 7.  Which state is where, and which
way they count, is the wiring's; here they count forwards from the first of a list.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from model.errors import BadInput

Array = NDArray[np.float64]
STEP = math.pi / 3.0
WITHIN = 0.5 * STEP * (1.0 - 1e-9)  # rad from a sixth's middle: an angle on its edge would be in the next one
APART_120, APART_60 = (1, 3, 2, 6, 4, 5), (0, 1, 3, 7, 6, 4)
SENSORS = ("hall_a", "hall_b", "hall_c")
FEWEST = 5  # changes that tell how far a speed is off between them
RARE = 0.01  # of the rows: states of no use are taken for disturbed readings


def state_names(found: Mapping[str, object]) -> tuple[str, ...] | None:
    """Return the columns that tell a sixth of a turn: Hall states, three sensors, or counted steps; None without."""
    for names in (("hall",), SENSORS, ("steps",)):
        if all(n in found for n in names):
            return names
    return None


def states_angle(
    file: str, found: Mapping[str, Array], own: Mapping[str, str], turned: Array | None = None
) -> tuple[Array, float]:
    """Return the angle (n,), rad electrical, unwrapped, of a log's states, and between what its readings lie (rad).

    turned: rad (n,) by the log's speed, which is followed from change to change.  BadInput for numbers that are no
    states.
    """
    names = state_names(found) or ()
    said = ", ".join(own.get(n, n) for n in names)
    whole = [np.round(found[n]) for n in names]
    off = next((int(k) for n, x in zip(names, whole, strict=True) for k in np.flatnonzero(x != found[n])[:1]), None)
    if off is not None:
        raise BadInput(f"{file}: row {off} of column '{said}' is no whole number; map states or counted steps")
    if names == ("steps",):
        sectors = whole[0]
    else:
        code = whole[0] if len(whole) == 1 else whole[0] + 2.0 * whole[1] + 4.0 * whole[2]
        sectors = _sectors(file, said, code)
    return (between(sectors), STEP) if turned is None else along(sectors, turned)


def _sectors(file: str, said: str, code: Array) -> Array:
    """Return whole sixths of a turn (n,), unwrapped, of Hall codes; a disturbed reading repeats the one before."""
    order = APART_60 if np.isin(code, (0, 7)).mean() > RARE else APART_120
    place = np.full(8, -1)
    place[list(order)] = np.arange(6)
    inside = (code >= 0) & (code <= 7)
    found = np.where(inside, place[np.where(inside, code, 0).astype(int)], -1)
    lost = np.flatnonzero(found < 0)
    if lost.size > RARE * len(code) or lost.size == len(code):
        k = int(lost[0])
        raise BadInput(
            f"{file}: row {k} of column '{said}' is {code[k]:g}, no state of three Hall sensors ({lost.size} such "
            "rows); states are 1 to 6, or 0, 1, 3, 4, 6, 7 of sensors 60 degrees apart"
        )
    good = np.flatnonzero(found >= 0)
    held = good[np.maximum(np.searchsorted(good, np.arange(len(code)), side="right") - 1, 0)]
    step = np.mod(np.diff(found[held]) + 2, 6) - 2  # -2 .. 3
    far = np.flatnonzero(step == 3)
    if far.size:
        k = int(far[0]) + 1
        raise BadInput(
            f"{file}: row {k} of column '{said}' is half a turn from the row before ({far.size} such rows): which way "
            "the rotor turned is not known; log faster, or map the log's speed in place of it"
        )
    return np.concatenate([[0.0], np.cumsum(step)])


def along(sectors: Array, turned: Array) -> tuple[Array, float]:
    """Return angles (n,) rad of counted sixths that follow a speed, integrated (n,) rad, from change to change, and
    between what they lie (rad): by what the speed is off from change to change, a sixth at most."""
    middle, (rows, at, edge) = STEP * (sectors + 0.5), _changes(sectors)
    by_speed = np.interp(at, rows, turned)
    sense = 1.0 if float(np.diff(edge) @ np.diff(by_speed)) >= 0.0 else -1.0
    if len(at) < FEWEST:
        return between(sectors), STEP
    off = edge - sense * by_speed
    stray = float(np.std(off[1:-1] - 0.5 * (off[2:] + off[:-2]))) / math.sqrt(1.5)
    angle = sense * turned + np.interp(rows, at, off)
    return np.asarray(np.clip(angle, middle - WITHIN, middle + WITHIN)), min(math.sqrt(12.0) * stray, STEP)


def _changes(sectors: Array) -> tuple[Array, Array, Array]:
    """Return rows (n,), and of each change its place half way between two rows, and the angle there (rad)."""
    changes = np.flatnonzero(np.diff(sectors))
    edge = STEP * (0.5 * (sectors[changes] + sectors[changes + 1]) + 0.5)
    return np.arange(len(sectors), dtype=np.float64), changes + 0.5, edge


def between(sectors: Array) -> Array:
    """Return angles (n,) rad of counted sixths: at a change half way between both, smooth and rising or falling from
    change to change, and before the first one and after the last one as beside them, within the sixth."""
    middle, (rows, at, edge) = STEP * (sectors + 0.5), _changes(sectors)
    if len(at) < 2:
        return np.asarray(middle)
    angle = PchipInterpolator(at, edge)(np.clip(rows, at[0], at[-1]))
    first, last = (edge[1] - edge[0]) / (at[1] - at[0]), (edge[-1] - edge[-2]) / (at[-1] - at[-2])
    angle = angle + np.minimum(rows - at[0], 0.0) * first + np.maximum(rows - at[-1], 0.0) * last
    return np.asarray(np.clip(angle, middle - WITHIN, middle + WITHIN))
