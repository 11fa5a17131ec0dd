"""Whether the current of a motion stands some rows off the angle beside it.

What torque the shaft's equation leaves is looked at for every number of rows by which the torque is
moved; the fewest rows that leave as little as any are the place.  A first-order filter is late in
the same way, but moved rows explain it worse than the lag does: what explains the log better by
more than the chance among all places that were tried, in the log's own scatter, is told.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from model.array_types import Array
from sandbox.gap.motion.shaft import (
    SHORT,
    USUAL_WIDTH,
    Design,
    Nominal,
    Shaft,
    Terms,
    design_of,
    fitted,
    reweighted,
)
from sandbox.gap.motion.windows import SAMPLES, averages
from sandbox.recordings.checks.balance import plain
from sandbox.recordings.checks.shifts import ALIKE, LATE
from sandbox.recordings.findings import Doubt, Finding
from sandbox.recordings.motion_log import MotionCampaign, MotionRecording

MOST_ROWS = 8192  # of a recording, those with most torque
MOST_MOVED = 1024  # by which torque is moved, and a quarter of the rows at most
WINDOWS = 1024  # at most that the places are compared on
LEFT = 0.5  # of the torque's energy: a place that explains less than it leaves is none
FREE = Nominal(None, 0.0, 0.0, 0.0)


def shifted(campaign: MotionCampaign) -> list[Finding]:
    """Return a finding where currents moved by some rows explain the motion better than they do
    where they stand, however much they are filtered there."""
    long = SHORT * SAMPLES
    own = [_busiest(r) for r in campaign.recordings if not r.sixth and len(r.t) >= 2 * long]
    if not own:
        return []
    most = min(MOST_MOVED, *((len(r.t) - long) // 4 for r in own))
    with np.errstate(all="ignore"):
        rows = _place(_curve(own, campaign, most))
        if not rows:
            return []
        there, here = (
            design_of([averages(moved(r, rows, by), campaign) for r in own]) for by in (rows, 0)
        )
        best, late, still = _fit(there, False), _fit(here, True), _fit(here, False)
    before, after, filtered = (float(np.mean(x.residual**2)) for x in (still, best, late))
    count = len(there.torque)
    gain = 2.0 * count / best.inflation * math.log(min(before, filtered) / after)
    size = float(np.mean(there.torque**2))
    if not gain > 2.0 * math.log((2 * most + 1) * count) or after > LEFT * size:
        return []
    shares = tuple(100.0 * math.sqrt(x / size) for x in (before, after))
    return [_finding(own[0], rows, there.step, shares)]


def _curve(own: Sequence[MotionRecording], campaign: MotionCampaign, most: int) -> Array:
    """Return the share of the torque's variance that the shaft's equation leaves with the torque
    moved up by -most to most rows (odd,), on windows that hold it everywhere."""
    parts = [averages(r, campaign) for r in own]
    every = -(-sum(len(a.torque) for a in parts) // WINDOWS)
    width, columns, kept = USUAL_WIDTH * design_of(parts).fastest, [], []
    for a, r in zip(parts, own, strict=True):
        inside = (a.place[:, 0] >= most) & (a.place[:, -1] < len(r.t) - most)
        chosen = np.flatnonzero(inside)[::every]
        dry = a.along(np.tanh(a.path_speed / width))
        columns.append(np.stack([a.acceleration, a.speed, dry, np.ones(len(dry))], 1)[chosen])
        kept.append((a.place[chosen], a.kernel[chosen], a.mean(r.load)[chosen], r.torque))
    q, _ = np.linalg.qr(np.concatenate(columns))
    left = np.empty(2 * most + 1)
    for k in range(-most, most + 1):
        y = np.concatenate([np.sum(w * t[at + k], axis=1) - load for at, w, load, t in kept])
        y -= y.mean()
        left[k + most] = 1.0 - float(np.sum((q.T @ y) ** 2)) / float(y @ y)
    return np.maximum(left, 1e-12)


def _place(left: Array) -> int:
    """Return how many rows to move: the least of the valley nearest to none, of those that leave as
    little as any; 0 where nothing finite is left."""
    if not np.all(np.isfinite(left)):
        return 0
    low = np.flatnonzero(left <= ALIKE * left.min())
    valleys = np.split(low, np.flatnonzero(np.diff(low) > 1) + 1)
    middle = len(left) // 2
    nearest = min(valleys, key=lambda v: int(np.min(np.abs(v - middle))))
    return int(nearest[np.argmin(left[nearest])]) - middle


def _fit(design: Design, lag: bool) -> Shaft:
    terms = Terms(inertia=True, viscous=True, dry=USUAL_WIDTH * design.fastest, lag=lag)
    shaft = fitted(design, terms, FREE)
    for _ in range(2):
        shaft = fitted(reweighted(design, shaft), terms, FREE)
    return shaft


def moved(r: MotionRecording, rows: int, by: int | None = None) -> MotionRecording:
    """Return a recording whose torque is moved up by some rows, without the rows that then lack
    one; by: 0 where it stays, without the same rows."""
    down, up = max(-rows, 0), max(rows, 0)
    stay = slice(down, len(r.t) - up)
    move = slice(up, len(r.t) - down) if by is None or by else stay
    further = {name: x[stay] for name, x in r.further.items()}
    return replace(
        r,
        t=r.t[stay],
        angle=r.angle[stay],
        torque=r.torque[move],
        load=r.load[stay],
        further=further,
    )


def _busiest(r: MotionRecording) -> MotionRecording:
    """Return the MOST_ROWS rows of a recording with most torque."""
    if len(r.t) <= MOST_ROWS:
        return r
    energy = np.concatenate([[0.0], np.cumsum(r.torque**2)])
    first = int(np.argmax(energy[MOST_ROWS:] - energy[:-MOST_ROWS]))
    own = slice(first, first + MOST_ROWS)
    further = {name: x[own] for name, x in r.further.items()}
    return replace(
        r, t=r.t[own], angle=r.angle[own], torque=r.torque[own], load=r.load[own], further=further
    )


def _finding(r: MotionRecording, rows: int, step: float, shares: tuple[float, ...]) -> Finding:
    count, late = abs(rows), rows > 0
    name = r.source.get("i_q", r.source.get("torque", "the currents"))
    many, by = ("one sample", "a row") if count == 1 else (f"{count} samples", f"{count} rows")
    drive = " (a drive that is late itself does that, too)" if count <= LATE else ""
    text = (
        f"{r.file}: column '{name}': currents are of {many} {'before' if late else 'after'} the "
        f"row in which they stand ({count * step:.3g} s): {plain(shares[0])} % of the torque is "
        f"unexplained, moved by {by} {plain(shares[1])} %, and a filter explains less; if the log "
        f"is shifted, move {name} {'up' if late else 'down'} by {by}{drive}"
    )
    return Doubt(r.file, "i_q", None, text)
