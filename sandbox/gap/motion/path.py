"""The motion between rows: angle and speed at places from one row to the next.

A friction that changes its sign acts from the instant at which the rotor turns back.  Before it the
rotor slows down faster than it speeds up after it: a straight line between the speeds of two rows,
and any difference that spans the instant, turn back too late by some share of a row, which made an
inertia 0.4 % too large at rows 20 ms apart.  There the angle is two parabolas with one vertex.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sandbox.recordings.motion_log import MotionRecording

Array = NDArray[np.float64]
COUNT = 4  # places from row to row
PLACES = (np.arange(COUNT) + 0.5) / COUNT
TELLS = 3.0  # deviations of a speed from which its sign is believed
LEAST_STEP = 1e-9  # rad: below it two readings are the same
LONGEST = 24  # rows of which a speed, or one side of a turning back, is told
SHORTEST = 2  # rows of a side: two parabolas with one vertex take four
SHARP = 0.1  # of a row: how sharp a turning back is to be told
TRIED = np.linspace(0.0, 1.0, 41)  # of the time in which it may lie


def path_of(r: MotionRecording, jitter: float, count: float) -> tuple[Array, Array]:
    """Return mechanical angle (rad) and speed (rad/s) between rows (rows - 1, COUNT).

    jitter: s rms, of the stamps; count: rad of the encoder's, 0 where unknown.
    """
    h, turned = np.diff(r.t)[:, None], np.diff(r.angle)[:, None]
    moved = np.abs(turned[np.abs(turned) > LEAST_STEP])
    count = max(count, float(moved.min()) if moved.size else 0.0) / math.sqrt(12.0)
    speed, certain = _speeds(r.t, r.angle, jitter, count)
    if "speed" in r.further:
        speed = r.further["speed"]
    first, last = speed[:-1, None], speed[1:, None]
    angle = r.angle[:-1, None] + turned * PLACES
    angle -= 0.5 * h * (last - first) * PLACES * (1.0 - PLACES)
    path, at = first + (last - first) * PLACES, r.t[:-1, None] + h * PLACES
    for rows, instant, before, after in _turnings(r.t, r.angle, speed * certain, count):
        away = at[rows] - instant
        path[rows] = away * np.where(away < 0.0, before, after)
    return angle, path


def _speeds(t: Array, angle: Array, jitter: float, count: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the speed (rad/s) at rows, each over as few of them as tell its sign, and where any
    tells it.

    A longer difference is smoother, and turns back too late or too early.
    """
    reach = max(min(LONGEST, len(t) - 1) // 2, 1)
    out, tells = _difference(t, angle, reach)[0], np.zeros(len(t), bool)
    while reach:
        speed, span = _difference(t, angle, reach)
        certain = np.abs(speed) > TELLS * math.sqrt(2.0) * np.hypot(count, jitter * speed) / span
        out, tells = np.where(certain, speed, out), tells | certain
        reach //= 2
    return out, tells


def _difference(t: Array, angle: Array, reach: int) -> tuple[Array, Array]:
    """Return the slope of the parabola through a row and those `reach` before and after it (one
    side alone at the ends), and the time (s) between these."""
    rows = np.arange(len(t))
    before, after = np.maximum(rows - reach, 0), np.minimum(rows + reach, len(t) - 1)
    back, on = t - t[before], t[after] - t
    own = [
        np.divide(x, h, out=np.zeros_like(x), where=h > 0.0)
        for x, h in ((angle - angle[before], back), (angle[after] - angle, on))
    ]
    return (own[0] * on + own[1] * back) / (back + on), back + on


def _turnings(
    t: Array, angle: Array, speed: Array, count: float
) -> Iterator[tuple[slice, float, float, float]]:
    """Yield where the rotor turns back: rows, instant (s), acceleration (rad/s^2) before and after.

    speed: at rows, 0 where its sign is unknown; count: rad rms that the angle's readings scatter.
    """
    known = np.flatnonzero(speed)
    turns = np.flatnonzero(speed[known[1:]] * speed[known[:-1]] < 0.0)
    ends = np.concatenate([[0], known[turns + 1], [len(t)]])
    for n, k in enumerate(turns):
        first, last = int(known[k]), int(known[k + 1])
        span = t[last] - t[first]
        row = span / (last - first)
        slow = abs(speed[last] - speed[first]) / span  # rad/s^2
        side = math.ceil((3.0 * count / (SHARP * slow * row**2)) ** (2.0 / 3.0))
        side = min(max(side, SHORTEST), LONGEST)
        low, high = max(first - side + 1, int(ends[n])), min(last + side, int(ends[n + 2]))
        if last - first > side or min(first + 1 - low, high - last) < SHORTEST:
            continue  # it stands between, or turns back again at once
        rows = slice(low, high)
        found = _vertex(t[rows], angle[rows], t[first] - row, t[last] + row)
        if found is not None:
            yield slice(low, high - 1), *found


def _vertex(t: Array, angle: Array, low: float, high: float) -> tuple[float, float, float] | None:
    """Return the instant (s) of the vertex of two parabolas, between two, and the accelerations
    (rad/s^2) before and after it; None where they do not turn back."""
    at, y = low + (high - low) * TRIED, angle - angle.mean()
    for fine in (True, False):
        away = t - at[:, None]
        sides = 0.5 * np.stack([np.minimum(away, 0.0) ** 2, np.maximum(away, 0.0) ** 2], axis=2)
        sides -= sides.mean(axis=1, keepdims=True)
        normal, right = np.einsum("nki,nkj->nij", sides, sides), np.einsum("nki,k->ni", sides, y)
        normal += 1e-12 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(2)
        slopes = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
        best = int(np.argmax(np.einsum("ni,ni->n", slopes, right)))
        if fine:
            at = at[best] + (at[1] - at[0]) * (2.0 * TRIED - 1.0)
    before, after = (float(x) for x in slopes[best])
    # it turns back where it accelerates the same way on both sides
    return (float(at[best]), before, after) if before * after > 0.0 else None
