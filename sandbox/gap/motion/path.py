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

from model.array_types import Array
from sandbox.recordings.motion_log import MotionRecording

COUNT = 4  # places from row to row
PLACES = (np.arange(COUNT) + 0.5) / COUNT
TELLS = 3.0  # deviations of a speed from which its sign is believed
LEAST_STEP = 1e-9  # rad: below it two readings are the same
LONGEST = 24  # rows of which a speed, or one side of a turning back, is told
SHORTEST = 2  # rows of a side: two parabolas with one vertex take four
SHARP = 0.1  # of a row: how sharp a turning back is to be told
SIDE_BY_SIDE = 400_000  # numbers of turns that are looked at at once
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
    if not turns.size:
        return
    first, last = known[turns], known[turns + 1]
    span = t[last] - t[first]
    row = span / (last - first)
    slow = np.abs(speed[last] - speed[first]) / span  # rad/s^2
    side = np.ceil((3.0 * count / (SHARP * slow * row**2)) ** (2.0 / 3.0))
    side = np.clip(np.nan_to_num(side, nan=LONGEST), SHORTEST, LONGEST).astype(int)
    low = np.maximum(first - side + 1, np.concatenate([[0], last[:-1]]))
    high = np.minimum(last + side, np.concatenate([last[1:], [len(t)]]))
    # the others stand between, or turn back again at once
    clear = last - first <= side
    clear &= np.minimum(first + 1 - low, high - last) >= SHORTEST
    of = np.flatnonzero(clear)
    found = vertices(
        t, angle, np.stack([low, high])[:, of], np.stack([t[first] - row, t[last] + row])[:, of]
    )
    for k, (instant, before, after) in zip(of, found, strict=True):
        if before * after > 0.0:  # it turns back where it accelerates the same way on both sides
            yield slice(int(low[k]), int(high[k]) - 1), instant, before, after


def vertices(t: Array, angle: Array, rows: NDArray[np.int64], within: Array) -> Array:
    """Return of each turn, (n, 3), the instant (s) of the vertex of two parabolas, and the
    accelerations (rad/s^2) before and after it.

    rows: (2, n), from where to where a turn is; within: (2, n) s, between which its vertex lies.
    """
    out, length = np.empty((rows.shape[1], 3)), rows[1] - rows[0]
    order = np.argsort(length, kind="stable")
    while order.size:  # turns of about as many rows side by side
        count = max(SIDE_BY_SIDE // (len(TRIED) * int(length[order[-1]])), 1)
        now, order = order[-count:], order[:-count]
        out[now] = _padded(t, angle, rows[:, now], within[:, now])
    return out


def _padded(t: Array, angle: Array, rows: NDArray[np.int64], within: Array) -> Array:
    """Return `_vertices` of some turns, padded to the longest."""
    own = rows[0][:, None] + np.arange(int(np.max(rows[1] - rows[0])))
    mask = (own < rows[1][:, None]).astype(float)
    own, n = np.minimum(own, len(t) - 1), mask.sum(axis=1, keepdims=True)
    y = (angle[own] - np.sum(angle[own] * mask, axis=1, keepdims=True) / n) * mask
    at = within[0][:, None] + (within[1] - within[0])[:, None] * TRIED
    turn = np.arange(len(at))
    for fine in (True, False):
        away = t[own][:, None, :] - at[:, :, None]
        before, after = (
            0.5 * f(away, 0.0) ** 2 * mask[:, None, :] for f in (np.minimum, np.maximum)
        )
        before, after = (
            (x - x.sum(axis=2, keepdims=True) / n[:, :, None]) * mask[:, None, :]
            for x in (before, after)
        )
        aa, ab, bb = (
            np.einsum("ntk,ntk->nt", x, z)
            for x, z in ((before, before), (before, after), (after, after))
        )
        ya, yb = (np.einsum("ntk,nk->nt", x, y) for x in (before, after))
        least = 1e-12 * (aa + bb)
        aa, bb = aa + least, bb + least
        found = np.stack([bb * ya - ab * yb, aa * yb - ab * ya]) / (aa * bb - ab**2)
        best = np.argmax(np.nan_to_num(found[0] * ya + found[1] * yb, nan=-np.inf), axis=1)
        if fine:
            at = at[turn, best][:, None] + (at[:, 1] - at[:, 0])[:, None] * (2.0 * TRIED - 1.0)
    return np.stack([at[turn, best], *found[:, turn, best]], axis=1)
