"""An angle of Hall states or of counted commutation steps: sixths of an electrical turn, smooth
between changes.

Three sensors 120 degrees apart give the states 1 to 6, 60 degrees apart also 0 and 7.  Which state
is where, and which way they count, is the wiring's; here they count forwards from the first of a
list.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, PchipInterpolator, make_smoothing_spline

from model.array_types import Array
from model.errors import BadInput

STEP = math.pi / 3.0
# rad from a sixth's middle: an angle on its edge would be in the next one
WITHIN = 0.5 * STEP * (1.0 - 1e-9)
APART_120, APART_60 = (1, 3, 2, 6, 4, 5), (0, 1, 3, 7, 6, 4)
SENSORS = ("hall_a", "hall_b", "hall_c")
FEWEST = 5  # changes that tell how far a speed is off between them
SLOWEST = 1e-3  # of a sixth a row: a slower speed tells no place better than that
MISPLACED = (
    # squared deviations of six sensors' places from which they are off (chance: 5 degrees of
    # freedom, 1e-4)
    25.0
)
# decimal logarithms of what a curve's bending costs, in changes and their deviations
BENDING = (-6.0, 10.0)
RARE = 0.01  # of the rows: states of no use are taken for disturbed readings


def state_names(found: Mapping[str, object]) -> tuple[str, ...] | None:
    """Return the columns that tell a sixth of a turn: Hall states, three sensors, or counted steps;
    None without."""
    for names in (("hall",), SENSORS, ("steps",)):
        if all(n in found for n in names):
            return names
    return None


def states_angle(
    file: str, found: Mapping[str, Array], own: Mapping[str, str], turned: Array | None = None
) -> tuple[Array, float]:
    """Return the angle (n,), rad electrical, unwrapped, of a log's states, and between what its
    readings lie (rad).

    turned: rad (n,) by the log's speed, which is followed from change to change.  BadInput for
    numbers that are no states.
    """
    names = state_names(found) or ()
    said = ", ".join(own.get(n, n) for n in names)
    whole = [np.round(found[n]) for n in names]
    off = next(
        (
            int(k)
            for n, x in zip(names, whole, strict=True)
            for k in np.flatnonzero(x != found[n])[:1]
        ),
        None,
    )
    if off is not None:
        raise BadInput(
            f"{file}: row {off} of column '{said}' is no whole number; map states or counted steps"
        )
    if names == ("steps",):
        sectors = whole[0]
    else:
        code = whole[0] if len(whole) == 1 else whole[0] + 2.0 * whole[1] + 4.0 * whole[2]
        sectors = _sectors(file, said, code)
    return (between(sectors), STEP) if turned is None else along(sectors, turned)


def _sectors(file: str, said: str, code: Array) -> Array:
    """Return whole sixths of a turn (n,), unwrapped, of Hall codes; a disturbed reading repeats the
    one before."""
    # which two states never occur: 0 and 7, or 2 and 5
    order = APART_60 if np.isin(code, (0, 7)).mean() > np.isin(code, (2, 5)).mean() else APART_120
    place = np.full(8, -1)
    place[list(order)] = np.arange(6)
    inside = (code >= 0) & (code <= 7)
    found = np.where(inside, place[np.where(inside, code, 0).astype(int)], -1)
    lost = np.flatnonzero(found < 0)
    if lost.size > RARE * len(code) or lost.size == len(code):
        k = int(lost[0])
        raise BadInput(
            f"{file}: row {k} of column '{said}' is {code[k]:g}, no state of three Hall "
            f"sensors ({lost.size} such "
            "rows); states are 1 to 6, or 0, 1, 3, 4, 6, 7 of sensors 60 degrees apart"
        )
    good = np.flatnonzero(found >= 0)
    held = good[np.maximum(np.searchsorted(good, np.arange(len(code)), side="right") - 1, 0)]
    step = np.mod(np.diff(found[held]) + 2, 6) - 2  # -2 .. 3
    far = np.flatnonzero(step == 3)
    if far.size:
        k = int(far[0]) + 1
        raise BadInput(
            f"{file}: row {k} of column '{said}' is half a turn from the row before "
            f"({far.size} such rows): which way "
            "the rotor turned is not known; log faster, or map the log's speed in place of it"
        )
    return np.concatenate([[0.0], np.cumsum(step)])


def along(sectors: Array, turned: Array) -> tuple[Array, float]:
    """Return angles (n,) rad of counted sixths that follow a speed, integrated (n,) rad, and
    between what they lie (rad, rms of the rows): by what the speed is off from change to change, a
    sixth at most.

    A change is known to a row, so a curve through all of them would move as the rows fall: what the
    speed is off by is as smooth as that leaves it.  Sensors that stand off their places, the same
    in each turn, are measured.  Where the speed leaves the sixth that the states show, it tells no
    more than they do.
    """
    (rows, at, edge) = _changes(sectors)
    by_speed = np.interp(at, rows, turned)
    sense = 1.0 if float(np.diff(edge) @ np.diff(by_speed)) >= 0.0 else -1.0
    if len(at) < FEWEST:
        return between(sectors), STEP
    off = edge - sense * by_speed
    moved = np.diff(turned)
    known = _least(np.interp(at, rows[:-1] + 0.5, moved)) / math.sqrt(12.0)
    sector = np.round(edge / STEP).astype(int) % 6
    place = _places(off, sector, known)
    off = off - place[sector]
    stray = float(np.std(off[1:-1] - 0.5 * (off[2:] + off[:-2]))) / math.sqrt(1.5)
    curve = _smooth(at, off, known)
    angle, left = _inside(
        sense * turned + curve(np.clip(rows, at[0], at[-1])),
        sectors,
        place,
        _least(np.append(moved, moved[-1])),
    )
    count = min(math.sqrt(12.0) * stray, STEP)
    return angle, math.sqrt(count**2 + left * (STEP**2 - count**2))


def _least(moved: Array) -> Array:
    """Return how far angles go in a row (n,), rad, at least what tells a place."""
    return np.maximum(np.abs(moved), SLOWEST * STEP)


def _inside(angle: Array, sectors: Array, place: Array, a_row: Array) -> tuple[Array, float]:
    """Return angles (n,) rad within the sixths that states show, and the share of the rows in which
    they were not.

    place: (6,) rad by which a sixth begins earlier than its number says; a_row: (n,) rad, to which
    a change is known. An angle that leaves its sixth by more was off before, too: all rows up to
    the next change are held in it.
    """
    first = sectors.astype(int)
    low, high = STEP * first - place[first % 6], STEP * (first + 1) - place[(first + 1) % 6]
    middle, half = 0.5 * (low + high), WITHIN / STEP * (high - low)
    stretch = np.append(0, np.cumsum(np.diff(first) != 0))
    out = np.bincount(stretch, np.abs(angle - middle) > half + a_row)[stretch] > 0.0
    return np.where(out, np.clip(angle, middle - half, middle + half), angle), float(np.mean(out))


def _places(off: Array, sector: NDArray[np.int64], known: Array) -> Array:
    """Return by what changes (n,) are off because a sensor stands off its place: (6,) rad, 0 where
    that is not sure.

    Over the six changes of a turn such errors are taken to sum to zero: their mean is the angle's
    zero.
    """
    if len(off) < 3 * 6:
        return np.zeros(6)
    turn = np.convolve(
        np.pad(off, 3, mode="edge"), np.array([0.5, 1, 1, 1, 1, 1, 0.5]) / 6.0, "valid"
    )
    own = (off - turn)[3:-3]
    count = np.bincount(sector[3:-3], minlength=6)
    if np.any(count < 2):
        return np.zeros(6)
    mean = np.bincount(sector[3:-3], own, 6) / count
    spread = np.sqrt((np.var(own - mean[sector[3:-3]]) + float(np.mean(known**2))) / count)
    sure = float(np.sum((mean / spread) ** 2)) > MISPLACED
    return np.asarray(mean - mean.mean() if sure else np.zeros(6))


def _smooth(at: Array, off: Array, known: Array) -> Callable[[Array], Array]:
    """Return the smoothest curve of values (n,) at some places that misses them by their standard
    deviations, rms."""
    gap, usual = float(at[-1] - at[0]) / (len(at) - 1), float(np.median(known))

    def curve(bending: float) -> BSpline:
        """Return the curve of a bending."""
        return make_smoothing_spline(at / gap, off, (usual / known) ** 2, lam=10.0**bending)

    low, high = BENDING
    best = curve(low)
    for _ in range(16):
        middle = 0.5 * (low + high)
        tried = curve(middle)
        if float(np.mean(((off - tried(at / gap)) / known) ** 2)) <= 1.0:
            low, best = middle, tried
        else:
            high = middle
    return lambda x: np.asarray(best(x / gap))


def _changes(sectors: Array) -> tuple[Array, Array, Array]:
    """Return rows (n,), and of each change its place half way between two rows, and the angle there
    (rad)."""
    changes = np.flatnonzero(np.diff(sectors))
    edge = STEP * (0.5 * (sectors[changes] + sectors[changes + 1]) + 0.5)
    return np.arange(len(sectors), dtype=np.float64), np.asarray(changes + 0.5), edge


def between(sectors: Array) -> Array:
    """Return angles (n,) rad of counted sixths: at a change half way between both, smooth and
    rising or falling from change to change, and before the first one and after the last one as
    beside them, within the sixth."""
    middle, (rows, at, edge) = STEP * (sectors + 0.5), _changes(sectors)
    if len(at) < 2:
        return np.asarray(middle)
    angle = PchipInterpolator(at, edge)(np.clip(rows, at[0], at[-1]))
    first, last = (edge[1] - edge[0]) / (at[1] - at[0]), (edge[-1] - edge[-2]) / (at[-1] - at[-2])
    angle = angle + np.minimum(rows - at[0], 0.0) * first + np.maximum(rows - at[-1], 0.0) * last
    return np.asarray(np.clip(angle, middle - WITHIN, middle + WITHIN))
