"""Channels of recordings as segments: slopes and residuals cut into blocks of time and squared,
stretch by stretch.

Of current readings with coloured errors residuals and slopes are whitened: what the ones before
predict is taken off, and what is left is divided by its standard deviation (Durbin, Rev. Int.
Stat. Inst. 28 (1960) 233, whose recursion gives the coefficients from the errors'
autocorrelations).  Sums of squares are then those of the inverse covariance, of an autoregression.
A block begins anew, so that blocks stay independent.

Slopes that do not fit into memory wait in a file (`memory`); which of them act is known once all
stretches are in, so a segment is squared then, from the same numbers in the same blocks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.compiled import kernel
from sandbox.plant import additions
from sandbox.replay.grouping import ROOMS
from sandbox.replay.inputs import Inputs, Start
from sandbox.replay.map_error import Answers
from sandbox.replay.memory import SHARE, Kept, Spill, StartTaken, compact
from sandbox.replay.replay import Prepared, Residual, needs_of, residual_of
from sandbox.replay.sensitivity import Moves, Slopes, slopes
from sandbox.replay.stretches import Stretch, blocks, side_by_side

# Bytes of slopes that are worked on at once: they stay in a processor's second cache (1 to 2 MB
# today) from the plant's difference to their squares, and are written to memory once
AT_ONCE = 2e6
FREQUENCIES = 1024  # at which a colour's power is looked at: far more than its six readings bend
Colour = tuple[float, ...]  # autocorrelations over 1, 2, ... readings; () of white noise
Rows = Array | Kept  # slopes (n c, q) of a segment, in memory or in a file


@dataclass(frozen=True)
class Segment:
    """One channel of one recording: places (p,) of its columns; per block A (b, p, p), g (b, p),
    sums of squared residuals ssr (b,), n (b,)."""

    recording: int
    channel: str
    places: NDArray[np.int64]
    a: Array
    g: Array
    ssr: Array
    n: Array


def squared_slopes(
    prepared: Prepared, moves: Moves, cut: int, workers: int
) -> list[tuple[Segment, Rows]]:
    """Return all segments with their slopes, which stay in memory where they fit; cut: samples of a
    block."""
    map_modes = 0 if prepared.map_error is None else len(prepared.map_error.x)
    answers, moves = Answers(prepared, moves.at), replace(moves, map_modes=map_modes)
    width = len(moves.to) + map_modes
    room, size = (
        SHARE * prepared.spare,
        8.0 * width * sum(_readings(r) for r in prepared.recordings),
    )
    spill, at = None if size <= room else Spill(size), 0
    out: list[list[tuple[Segment, Rows]]] = [[] for _ in prepared.recordings]
    gathering: dict[int, list[Gathering]] = {}
    # a start that nobody has read is taken off once a recording is in
    known = tuple(replace(r, start=None) for r in prepared.recordings)
    bare = replace(prepared, recordings=known)
    groups = _groups(prepared, moves, room / (32.0 * (width + ROOMS[-1] * workers)), cut, workers)
    for s, found in slopes(prepared, moves, groups, workers=workers):
        if map_modes:
            found.current[:, :, len(moves.to) :] = answers.over(s)
        parts = channels_of(bare, s, found, len(moves.to) - 2)
        if not s.first:
            gathering[s.recording] = own = []
            start = prepared.recordings[s.recording].start
            for part in parts:
                own.append(
                    Gathering(
                        at,
                        part.j.shape[2],
                        s.n * part.j.shape[1],
                        colour_of(prepared, part.channel),
                        start if part.channel == "current" else None,
                    )
                )
                at += 8 * own[-1].width * own[-1].rows
        for part, each in zip(parts, gathering[s.recording], strict=True):
            each.add(part, spill, s, cut)
            if s.last == s.n:
                out[s.recording].append(each.squared(s.recording, part, spill, cut))
    return [x for own in out for x in own]


def _groups(
    prepared: Prepared, moves: Moves, room: float, cut: int, workers: int
) -> list[list[Stretch]]:
    """Return what is worked on at once: stretches of so many samples (room) at most, as short as
    caches want them (AT_ONCE); free rotors with a compliant shaft whole, whose start is taken off
    all of their first stretch."""
    drive, width = prepared.campaign.drive, len(moves.to) + moves.map_modes
    needs = (needs_of(drive.motor, drive.converter, v) for v in (moves.at, *moves.to))
    twists = any(need & additions.TWIST for need in needs)
    short = min(room, AT_ONCE / (32.0 * width))
    most = [room if twists and r.rotor == "free" else short for r in prepared.recordings]
    return side_by_side([r.samples for r in prepared.recordings], most, cut, workers)


def _readings(r: Inputs) -> int:
    """Return how many numbers a recording's residuals are."""
    return r.samples * (3 if r.rotor == "locked" else 4)


class ChannelSlopes(NamedTuple):
    """A channel over a stretch: slopes j (m, c, p + 2 and more) and residuals r (m, c); which
    columns act (q,), what they are multiplied by, and the places of their coordinates."""

    channel: str
    j: Array
    r: Array
    columns: NDArray[np.int64]
    scale: Array
    places: NDArray[np.int64]


def channels_of(prepared: Prepared, s: Stretch, found: Slopes, p: int) -> list[ChannelSlopes]:
    """Return the channels of a recording over a stretch, of p coordinates beside two turns and a
    map's modes."""
    r, shown = prepared.recordings[s.recording], residual_of(prepared, s, found.base)
    turn, sign = (p, 1.0) if r.rotor == "locked" else (p + 1, -1.0)
    modes = np.arange(found.current.shape[2] - p - 2)
    columns = np.array([*range(p), turn, *(p + 2 + modes)])
    places = np.array(
        [*range(p), p + prepared.angles.index(r.angle_name), *(p + len(prepared.angles) + modes)]
    )
    scale = np.array([*np.ones(p), sign, *np.ones(len(modes))])

    def part(name: str, j: Array, size: Array) -> ChannelSlopes:
        """Return one of them."""
        return ChannelSlopes(name, j, channel(shown, name), columns, size, places)

    out = [part("current", found.current, scale / prepared.noise_std)]
    if found.motion is not None:  # innovations are normalised already
        out.append(part("motion", found.motion[:, None, :], -scale))
    if found.angle is not None:
        # the reading turns with the angle itself, not with the encoder's offset
        found.angle[:, turn] = sign
        out.append(part("angle", found.angle[:, None, :], scale / r.angle_noise_std))
    return out


@dataclass
class Gathering:
    """A channel of one recording as its stretches come in: its place in the file, columns and rows
    of slopes; colour of errors; start of currents that nobody has read; which columns are not zero;
    residuals; slopes (rows, q) of the columns that are not zero so far, where they stay in memory;
    moved: how much of the start (2, width) each column goes along with."""

    at: int
    width: int
    rows: int
    colour: Colour
    start: Start | None = None
    acts: NDArray[np.bool_] | None = None
    residuals: list[Array] = field(default_factory=list)
    kept: Array | None = None
    moved: Array = field(init=False)

    def __post_init__(self) -> None:
        self.moved = np.zeros((2, self.width))

    def add(self, part: ChannelSlopes, spill: Spill | None, s: Stretch, cut: int) -> None:
        """Take in a stretch."""
        flat, wide = part.j.reshape(-1, self.width), part.j.shape[1]
        if self.start is not None:
            shape = self.start.shape.reshape(-1, 2)[s.first * wide : s.last * wide]
            add_products(shape, flat[: len(shape)], self.moved)
        whiten(part.j, self.colour, s, cut)
        before, here = self.acts, np.asarray(flat.any(axis=0))[part.columns]
        self.acts = here if before is None else before | here
        self.residuals.append(part.r)
        if spill is not None:
            spill.write(self.at + 8 * self.width * s.first * wide, flat)
            return
        if before is None or np.any(self.acts != before):
            self._widen(before, s.first * wide)
        assert self.kept is not None
        acts = np.flatnonzero(self.acts)
        own = self.kept[s.first * wide : s.last * wide]
        compact(flat, part.columns[acts], part.scale[acts], own)

    def _widen(self, before: NDArray[np.bool_] | None, done: int) -> None:
        """Make room for all columns that act so far; rows before these were 0 in the new ones."""
        assert self.acts is not None
        out = np.empty((self.rows, int(np.count_nonzero(self.acts))))
        if before is not None:
            assert self.kept is not None
            out[:done] = 0.0
            out[:done, before[self.acts]] = self.kept[:done]
        self.kept = out

    def squared(
        self, recording: int, part: ChannelSlopes, spill: Spill | None, cut: int
    ) -> tuple[Segment, Rows]:
        """Return the segment and the slopes (n c, q) of those coordinates that act on it; part: the
        last stretch."""
        assert self.acts is not None
        acts = np.flatnonzero(self.acts)
        columns, scale = part.columns[acts], part.scale[acts]
        r = np.concatenate(self.residuals)
        whole = Stretch(recording, 0, len(r), len(r))
        taken = None if self.start is None else self._taken(self.start, whole, cut, columns, scale)
        if self.start is not None:
            self.start.taken_off(r[:, :, None])
        whiten(r, self.colour, whole, cut)
        rows: Rows
        if spill is None:
            assert self.kept is not None
            rows = self.kept
        else:
            rows = Kept(spill, self.at, (self.rows, self.width), columns, scale, taken)
        own = taken if spill is None else None
        return _segment(recording, part.channel, rows, part.places[acts], r, cut, own), rows

    def _taken(
        self, start: Start, whole: Stretch, cut: int, columns: NDArray[np.int64], scale: Array
    ) -> StartTaken:
        """Return what the start explains of columns (q,), each times its scale."""
        answer = np.zeros((whole.n, *start.shape.shape[1:]))
        answer[: len(start.shape)] = start.share * start.shape
        whiten(answer, self.colour, whole, cut)
        return StartTaken(answer.reshape(-1, 2), self.moved[:, columns] * scale)


@kernel
def add_products(shape, rows, out):
    """Add the products of two shapes (n, 2) with rows (n, p) to out (2, p)."""
    for k in range(len(rows)):
        for j in range(2):
            for i in range(rows.shape[1]):
                out[j, i] += shape[k, j] * rows[k, i]


def colour_of(prepared: Prepared, channel: str) -> Colour:
    """Return the colour of the errors of a channel's readings."""
    return prepared.colour if channel == "current" else ()


def whiten(x: Array, colour: Colour, s: Stretch, cut: int) -> None:
    """Whiten residuals or slopes (m, ...) over a stretch, block by block, in place; cut: samples of
    a block."""
    if not colour:
        return
    known = predictors(colour)
    weights = np.array([[*w, *np.zeros(len(known) - 1 - len(w))] for w, _ in known])
    deviations = np.array([deviation for _, deviation in known])
    wide = x.reshape(len(x), -1)
    for first, last in blocks(s.n, cut):
        if s.first <= first and last <= s.last:
            take_predicted(wide[first - s.first : last - s.first], weights, deviations)
    if not np.shares_memory(wide, x):
        x[:] = wide.reshape(x.shape)


@kernel
def take_predicted(x, weights, deviations):
    """Whiten a block (m, k) in place, the last reading first, as those before are still as read;
    weights (o, o - 1), deviations (o,): of `predictors`, the last of which serve all readings that
    have so many before them."""
    for k in range(len(x) - 1, -1, -1):
        order = min(k, len(deviations) - 1)
        for j in range(order):
            for i in range(x.shape[1]):
                x[k, i] -= weights[order, j] * x[k - 1 - j, i]
        for i in range(x.shape[1]):
            x[k, i] /= deviations[order]


@cache
def predictors(colour: Colour) -> list[tuple[Array, float]]:
    """Return weights of the readings before, the latest first, by which 0, 1, ... of them predict
    an error best, and the standard deviation of what they leave; up to the order from which no
    noise has such autocorrelations."""
    weights, square = np.zeros(0), 1.0
    out = [(weights, 1.0)]
    for k in range(len(colour)):
        more = float(colour[k] - weights @ np.array(colour[:k][::-1])) / square
        if not abs(more) < 1.0:
            break
        weights = np.append(weights - more * weights[::-1], more)
        square *= 1.0 - more * more
        out.append((weights, math.sqrt(square)))
    return out


def loudest(colour: Colour) -> float:
    """Return how much more power errors of a colour have than white ones at the frequency where
    they have most: of the autoregression that whitens them."""
    weights, deviation = predictors(colour)[-1]
    answer = np.fft.rfft(np.concatenate([[1.0], -weights]), FREQUENCIES)
    return float(np.max(deviation**2 / np.abs(answer) ** 2))


def channel(r: Residual, channel: str, k: int = 0) -> Array:
    """Return a channel's residuals of set k, (n, c)."""
    if channel == "current":
        return r.current[:, :, k]
    shown = r.motion if channel == "motion" else r.angle
    assert shown is not None
    return shown[:, k : k + 1]


def squared(
    each: Sequence[tuple[Array, Segment]], rows: Rows, colour: Colour, s: Stretch, cut: int
) -> None:
    """Write g and r'r of residuals (m, c) over a stretch into their segments, for slopes (n c, q)
    of all of it, whitened; colour: of the errors."""
    wide = each[0][0].shape[1]
    for r, _ in each:
        whiten(r, colour, s, cut)
    for b, (first, last) in enumerate(blocks(s.n, cut)):
        if first < s.first or last > s.last:
            continue
        part = slice(first * wide, last * wide)
        for r, own in each:
            rb = r[first - s.first : last - s.first].ravel()
            with np.errstate(over="ignore", invalid="ignore"):
                # of an absurd set: nothing is probable there
                own.g[b], own.ssr[b] = _products(rb, rows, part), rb @ rb


def _products(r: Array, rows: Any, part: slice) -> Array:
    """Return the products (q,) of residuals (n,) with slopes of some rows."""
    if isinstance(rows, np.ndarray | Kept):
        return np.asarray(r @ rows[part])
    return np.asarray(rows.products(r, part))


def _segment(
    k: int,
    channel: str,
    j: Rows,
    places: NDArray[np.int64],
    r: Array,
    cut: int,
    start: StartTaken | None,
) -> Segment:
    """Cut residuals r (n, c) and slopes j (n c, q) into blocks and square them; start: what is
    still to be taken off these."""
    wide, q = r.shape[1], len(places)
    cuts = blocks(len(r), cut)
    a, g = np.empty((len(cuts), q, q)), np.empty((len(cuts), q))
    ssr, count = np.empty(len(cuts)), np.empty(len(cuts))
    for b, (first, last) in enumerate(cuts):
        jb, rb = j[first * wide : last * wide], r[first:last].ravel()
        if start is not None:
            start.off(jb, first * wide)
        with np.errstate(over="ignore", invalid="ignore"):
            a[b], g[b] = jb.T @ jb, rb @ jb
            ssr[b], count[b] = rb @ rb, rb.size
    return Segment(k, channel, places, a, g, ssr, count)
