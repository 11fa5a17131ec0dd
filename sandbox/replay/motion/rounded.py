"""Straight ramps behind rounded readings: no reading is farther than half a count from the motion.

Errors of rounding are neither independent nor normal.  Where a steady speed is close to a simple
fraction of counts a sample (13.000, 19.5), they repeat, and least squares put the motion up to half
a count aside.  But each reading bounds the angle on both sides.  The motion whose largest error is
least is sought by linear programming, corners moving by Newton's method (bounded errors: Milanese,
Belforte, IEEE Trans. Autom. Control 27 (1982) 408).  Of pieces between corners, those stand at
constant speed that may do so within the counts.  Of all motions that the counts leave, the analytic
centre is taken, where the product of all distances to the bounds is largest (Bai, Ye, Tempo,
Bounded error parameter estimation: a sequential analytic center approach, IEEE Trans. Autom.
Control 44 (1999)
1107).
"""

from __future__ import annotations

import math
from collections.abc import Set
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from model.array_types import Array
from sandbox.replay.motion.free_rotor import on_counts
from sandbox.replay.motion.ramps import Ramps, inside

HALF = 0.5 * (1.0 + 1e-3)  # count; a thousandth for what corners that still move leave
MOVES = 8  # of the corners: Newton's steps, each a linear program
# of what the largest error lies beyond HALF: a step that leaves more leads nowhere, Newton's are
# better
CLOSER = 0.5
FARTHEST = 0.05  # of the recording that a corner moves at most in a step
BLOCKS = 2000  # of a long recording, of which the linear program takes two readings each
STEPS, HALVINGS = 30, 20  # to the centre, and how often a step that leaves the bounds is halved
# of the sum of logarithms: a step that gains less ends it; 1 is e times as large a product
GAINED = 1e-3


class Pieces(NamedTuple):
    """Ramps by pieces: corners (c,) as shares of the recording; unknowns: angle and speed at the
    start, acceleration of each piece that is not `still`, an encoder's sine and cosine."""

    corners: Array
    still: frozenset[int]
    unknowns: Array


class Counts(NamedTuple):
    """Readings: tau (n,) time over the whole length, theta (n,) rad, columns (n, 0 or 2) of an
    encoder's sine, size of a count (rad)."""

    tau: Array
    theta: Array
    sine: Array
    size: float


def within_counts(theta: Array, found: Ramps, pole_pairs: float, count: float) -> Ramps:
    """Return ramps within half a count of every reading, near those of least squares; these where
    they are so already, or where no ramps with such corners are (the readings hold more than
    rounding, or are not rounded).

    theta: (n,) rad electrical, equally spaced in time; count: rad, electrical.
    """
    n, exact = len(theta), on_counts(theta, count)
    if exact is None or np.abs(exact - found.angle - found.sine).max() <= HALF * count:
        return found
    theta = exact
    mechanical = (theta - found.sine) / pole_pairs
    sine = (
        np.column_stack([np.sin(mechanical), np.cos(mechanical)])
        if found.sine.any()
        else np.empty((n, 0))
    )
    read = Counts(np.arange(n) / n, theta, sine, count)
    best = nearest(read, found.corners, frozenset())
    if best is None:
        return found
    for k in range(len(found.corners) + 1):
        steady = nearest(read, best.corners, best.still | {k})
        best = best if steady is None else steady
    return as_ramps(read, centred(read, best))


def nearest(read: Counts, corners: Array, still: Set[int]) -> Pieces | None:
    """Return ramps within the counts, corners near those given, by steps to the least largest
    error; None where there are none.

    still: pieces (from 0) of constant speed.
    """
    x = np.linalg.lstsq(columns(read, corners, still)[0], read.theta, rcond=None)[0]
    at, largest = Pieces(corners, frozenset(still), np.asarray(x)), math.inf
    reach = np.append(np.full(len(x), math.inf), np.full(len(corners), FARTHEST))
    for _ in range(MOVES):
        e = errors(read, at)
        rows = extremes(e)
        step = least_largest(slopes(read, at)[rows], e[rows], reach)
        if step is None:
            return None
        at = stepped(read, at, step)
        before, largest = largest, float(np.abs(errors(read, at)).max())
        if largest <= HALF:
            return at
        if largest - HALF > CLOSER * (before - HALF):
            return None
    return None


def centred(read: Counts, own: Pieces) -> Pieces:
    """Return the analytic centre of all ramps within the counts, from one of them: Newton's method
    on the sum of logarithms of distances to both bounds."""
    level = room(errors(read, own))
    for _ in range(STEPS):
        a, e = slopes(read, own), errors(read, own)
        size = np.abs(a).max(axis=0)
        size = np.where(size > 0.0, size, 1.0)
        above, below = 1.0 / (HALF - e), 1.0 / (HALF + e)
        curve = (a / size).T @ ((above**2 + below**2)[:, None] * (a / size))
        step = np.linalg.lstsq(curve, (a / size).T @ (above - below), rcond=None)[0] / size
        trials = (stepped(read, own, 0.5**k * step) for k in range(HALVINGS))
        better = next((t for t in trials if room(errors(read, t)) > level), None)
        if better is None:
            break
        gained, level, own = room(errors(read, better)) - level, room(errors(read, better)), better
        if gained < GAINED:
            break
    return own


def room(e: Array) -> float:
    """Return the sum of logarithms of errors' distances (counts) to both bounds; minus infinity
    beyond one."""
    return float(np.log(HALF**2 - e**2).sum()) if np.abs(e).max() < HALF else -math.inf


def errors(read: Counts, at: Pieces) -> Array:
    """Return (n,) how far readings lie above the motion, counts."""
    return np.asarray(
        (read.theta - columns(read, at.corners, at.still)[0] @ at.unknowns) / read.size
    )


def slopes(read: Counts, at: Pieces) -> Array:
    """Return (n, unknowns and corners) by how many counts each moves the angle."""
    own, late = columns(read, at.corners, at.still)
    accelerations = np.zeros(len(at.corners) + 1)
    accelerations[moving(at.corners, at.still)] = at.unknowns[2 : own.shape[1] - read.sine.shape[1]]
    return np.column_stack([own, -late[:, 1:] * np.diff(accelerations)]) / read.size


def stepped(read: Counts, at: Pieces, step: Array) -> Pieces:
    """Return ramps a step (unknowns, corners) away."""
    m = len(at.unknowns)
    return at._replace(
        unknowns=at.unknowns + step[:m], corners=inside(read.tau, at.corners + step[m:])
    )


def moving(corners: Array, still: Set[int]) -> list[int]:
    """Return the pieces that are not at constant speed."""
    return [k for k in range(len(corners) + 1) if k not in still]


def columns(read: Counts, corners: Array, still: Set[int]) -> tuple[Array, Array]:
    """Return what the unknowns move the readings by (n, unknowns), and the time behind each piece's
    begin (n, pieces).

    A piece of acceleration 1 from g to g' moves the angle by (max(0, t - g)^2 - max(0,
    t - g')^2)/2.
    """
    late = np.maximum(0.0, read.tau[:, None] - np.concatenate([[0.0], corners]))
    own = between(0.5 * late**2)[:, moving(corners, still)]
    return np.column_stack([np.ones_like(read.tau), read.tau, own, read.sine]), late


def between(x: Array) -> Array:
    """Return (n, pieces) what each piece adds, of what runs on behind its begin."""
    return x - np.column_stack([x[:, 1:], np.zeros(len(x))])


def extremes(e: Array) -> NDArray[np.intp]:
    """Return the places of the largest and the least of errors (n,) in each of BLOCKS blocks, or
    all: in a block the unknowns move all errors alike."""
    if len(e) <= 2 * BLOCKS:
        return np.arange(len(e))
    begins = np.linspace(0, len(e), BLOCKS + 1).astype(int)
    return np.array([k + f(e[k:m]) for k, m in pairwise(begins) for f in (np.argmax, np.argmin)])


def least_largest(a: Array, b: Array, reach: Array) -> Array | None:
    """Return the x (p,), |x| <= reach, with the least largest |b - a x|; None where the program
    finds none."""
    n, p = a.shape
    size = np.abs(a).max(axis=0)
    size = np.where(size > 0.0, size, 1.0)
    scaled, one = a / size, np.ones((n, 1))
    found = linprog(
        np.append(np.zeros(p), 1.0),
        A_ub=np.block([[scaled, -one], [-scaled, -one]]),
        b_ub=np.concatenate([b, -b]),
        bounds=[*zip(-reach * size, reach * size, strict=True), (0.0, None)],
        method="highs-ds",
    )
    return np.asarray(found.x[:p] / size) if found.status == 0 else None


def as_ramps(read: Counts, own: Pieces) -> Ramps:
    """Return pieces as ramps of angle (rad) and speed (rad a sample)."""
    a, late = columns(read, own.corners, own.still)
    m = a.shape[1] - read.sine.shape[1]
    speed = own.unknowns[1] + between(late)[:, moving(own.corners, own.still)] @ own.unknowns[2:m]
    left = read.theta - a @ own.unknowns
    sine = read.sine @ own.unknowns[m:]
    return Ramps(
        own.corners, a[:, :m] @ own.unknowns[:m], speed / len(read.tau), float(left @ left), sine
    )
