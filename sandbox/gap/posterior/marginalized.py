"""A free regression fitted beside the effects, so that what no effect takes up does not bend them.

The regressors of `regression` join the equations of a hypothesis with a Gaussian prior of their own
and are integrated out: what stays are equations of the same coordinates, A - B' (C + ridge)^-1 B,
from which effects
are weighed and estimated as ever.  Which kinds of regressors enter, and how hard they are held
back, is what predicts recordings left out in turn best.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from model.array_types import Array
from model.errors import BadInput
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.normal import NormalEquations, block_length, normal, simulated
from sandbox.gap.evidence.regression import (
    RIDGE,
    ChannelRegressors,
    component,
    in_rotor_frame,
    scalars,
    unscaled,
)
from sandbox.gap.posterior.linear_model import LinearModel
from sandbox.replay.replay import replay, residuals
from sandbox.replay.segments import colour_of, whiten
from sandbox.replay.stretches import Stretch

Label = tuple[str, str, int]  # channel, what a regressor acts as, its kind
FOLDS = 12  # times that recordings are left out: with more of them, several at a time
NESTED = 6  # folds that what is chosen is judged on: more of them cost by their square
RIDGES = RIDGE[::2]
KINDS = ("currents", "angle", "speed")  # what a kind of functions hangs on
ACTS = {"motion": "torque", "angle": "encoder"}


@dataclass(frozen=True)
class Described:
    """One kind of functions of what no effect explains: what it acts as (current, voltage, torque,
    encoder), what it hangs on (currents, angle, speed), the share of what the regression explains
    that is lost without it."""

    acts_as: str
    hangs_on: str
    share: float


@dataclass(frozen=True)
class MarginalizedRegression:
    """Equations with the regression integrated out; worth: share of the excess of recordings left
    out in turn that it closes beyond the effects, chosen without them, too (None with fewer than
    three recordings); what it consists of, the largest share first."""

    equations: Algebra
    worth: float | None
    described: tuple[Described, ...]


@dataclass(frozen=True)
class Joint:
    """Equations of p coordinates and q regressors, recordings summed fold by fold: m (folds, p + q,
    p + q), v (folds, p + q), rows behind each regressor (folds, p + q); on the diagonal, and
    pulling, what priors add to coordinates (p + q,); labels of the regressors."""

    m: Array
    v: Array
    rows: Array
    held: Array
    pull: Array
    labels: tuple[Label, ...]

    @property
    def p(self) -> int:
        """Number of coordinates."""
        return self.v.shape[1] - len(self.labels)

    def solved(
        self, m: Array, v: Array, rows: Array, columns: NDArray[np.int64], ridge: float
    ) -> Array:
        """Return the most probable values (p + q,) of some columns, 0 for all others."""
        # a channel may be in one recording alone
        columns = columns[(columns < self.p) | (rows[columns] > 0.0)]
        own = m[np.ix_(columns, columns)] + np.diag((self.held + ridge * rows)[columns])
        out = np.zeros(len(v))
        out[columns] = cho_solve(
            cho_factor(own, check_finite=False), (v + self.pull)[columns], check_finite=False
        )
        return out

    def predicted(self, columns: NDArray[np.int64], ridge: float) -> float:
        """Return by how much folds left out in turn are explained by the others."""
        return sum(self.gained(k, self.without([k], columns, ridge)) for k in range(len(self.m)))

    def without(self, gone: Sequence[int], columns: NDArray[np.int64], ridge: float) -> Array:
        """Return the most probable values (p + q,) by all folds but some."""
        m, v, rows = (x.sum(0) - x[list(gone)].sum(0) for x in (self.m, self.v, self.rows))
        return self.solved(m, v, rows, columns, ridge)

    def gained(self, fold: int, z: Array) -> float:
        """Return by how much values (p + q,) explain a fold."""
        return float(2.0 * z @ self.v[fold] - z @ self.m[fold] @ z)

    def merged(self, folds: int) -> Joint:
        """Return the same with at most so many folds."""
        place = np.arange(len(self.m)) % folds
        m, v, rows = (
            np.stack([x[place == k].sum(0) for k in range(max(place) + 1)])
            for x in (self.m, self.v, self.rows)
        )
        return Joint(m, v, rows, self.held, self.pull, self.labels)

    def explained(self, columns: NDArray[np.int64], ridge: float) -> float:
        """Return by how much all recordings together are explained, priors taken off."""
        m, v, rows = self.m.sum(0), self.v.sum(0), self.rows.sum(0)
        z = self.solved(m, v, rows, columns, ridge)
        return float(z @ (v + self.pull))

    def of(self, coordinates: NDArray[np.int64], kinds: int) -> NDArray[np.int64]:
        """Return coordinates and the regressors of the first so many kinds, as columns."""
        there = self.rows.sum(0) > 0.0
        own = [self.p + k for k, x in enumerate(self.labels) if x[2] < kinds and there[self.p + k]]
        return np.array([*coordinates, *own], dtype=np.int64)


def marginalized(
    table: LinearModel, prior: Prior, *, workers: int = 1
) -> MarginalizedRegression | None:
    """Return a regression beside the effects of a table under a prior.

    None where it predicts nothing of recordings left out, where there are fewer than two of them,
    or where a slope is taken beyond what a drive can be (no flux for a current).
    """
    try:
        n = normal(table.point, [c for c in table.coordinates if not c.of_point], workers=workers)
    except BadInput:
        return None
    excess = sum(float(s.ssr.sum() - s.n.sum()) for s in n.segments)
    joint = joined(n, table, prior)
    if joint is None or excess <= 0.0:
        return None
    free = np.flatnonzero(prior.deviation > 0.0)
    alone = joint.predicted(free, 0.0)
    options = itertools.product(range(1, len(KINDS) + 1), RIDGES)
    best, kinds, ridge = max((joint.predicted(joint.of(free, k), r), k, r) for k, r in options)
    if best <= alone:
        return None
    gain = predicted_share(joint.merged(NESTED), free)
    return MarginalizedRegression(
        integrated_out(joint, n, joint.of(free[:0], kinds), ridge),
        None if gain is None else min(1.0, max(0.0, gain / excess)),
        _described(joint, free, kinds, ridge),
    )


def predicted_share(joint: Joint, free: NDArray[np.int64]) -> float | None:
    """Return by how much more than coordinates alone a regression explains folds that neither its
    fit nor the choice of its kinds and of its ridge has seen: for each fold the choice is what
    predicts the others in
    turn best (Stone, J. R. Stat. Soc. B 36 (1974) 111).  None with fewer than three folds."""
    count = len(joint.m)
    if count < 3:
        return None
    regressions = itertools.product(range(1, len(KINDS) + 1), RIDGES)
    options = [
        (free, 0.0),
        *((joint.of(free, kinds), float(ridge)) for kinds, ridge in regressions),
    ]
    outer, inner = np.zeros((2, len(options), count))
    for k, (columns, ridge) in enumerate(options):
        for i in range(count):
            outer[k, i] = joint.gained(i, joint.without([i], columns, ridge))
        for i, j in itertools.combinations(range(count), 2):
            z = joint.without([i, j], columns, ridge)
            inner[k, i] += joint.gained(j, z)
            inner[k, j] += joint.gained(i, z)
    chosen = inner.argmax(axis=0)
    return float(sum(outer[chosen[i], i] - outer[0, i] for i in range(count)))


def joined(n: NormalEquations, table: LinearModel, prior: Prior) -> Joint | None:
    """Return the joint equations of a point's coordinates and regressors; None with fewer than two
    recordings."""
    prepared, values = table.point.turned(), table.point.values
    prediction = replay(prepared, [values])
    simulated(1.0)
    shown = residuals(prepared, prediction)
    count = len(prepared.recordings)
    if count < 2:
        return None
    p, labels = len(n.x), _labels()
    place = {
        c: np.array([p + k for k, x in enumerate(labels) if x[0] == c]) for c in ("current", *ACTS)
    }
    size = p + len(labels)
    folds = min(FOLDS, count)
    m, v, rows = np.zeros((folds, size, size)), np.zeros((folds, size)), np.zeros((folds, size))
    for k, read in enumerate(prediction.currents):
        fold = k % folds
        for part in unscaled(prepared, values, k, read[:, :, 0]):
            y, colour = component(part, shown[k]).copy(), colour_of(prepared, part.channel)
            for x in (part.x, y):
                whiten(x, colour, Stretch(k, 0, len(x), len(x)), block_length(prepared))
            _add(m[fold], v[fold], rows[fold], n, part, y, place[part.channel])
        for s in n.segments:
            if s.recording == k:
                m[fold][np.ix_(s.places, s.places)] += s.a.sum(0)
                v[fold][s.places] += s.g.sum(0)
    scale = np.ones(size)
    own, total = np.diagonal(m.sum(0))[p:], rows.sum(0)[p:]
    scale[p:] = np.sqrt(np.divide(total, own, out=np.zeros_like(own), where=own > 0.0))
    held, pull = np.zeros(size), np.zeros(size)
    moves = np.flatnonzero(prior.deviation > 0.0)
    held[moves] = prior.deviation[moves] ** -2
    pull[moves] = (prior.mean - n.x)[moves] * held[moves]
    return Joint(m * scale[:, None] * scale, v * scale, rows, held, pull, labels)


def _labels() -> tuple[Label, ...]:
    """Return the labels of all regressors in their order: those of currents, of motion, of the
    encoder."""
    one = np.zeros(1)
    kinds = [kind for _, kind in scalars(np.zeros((1, 2)), one, one)]
    currents = [
        ("current", acts, kind)
        for acts in ("current", "voltage")
        for kind in (*kinds, *kinds, 0, 0, 0)
    ]
    return (*currents, *((channel, acts, kind) for channel, acts in ACTS.items() for kind in kinds))


def _add(
    m: Array,
    v: Array,
    rows: Array,
    n: NormalEquations,
    part: ChannelRegressors,
    y: Array,
    place: NDArray[np.int64],
) -> None:
    """Add one channel of one recording to the equations of its fold, in place."""
    x = part.x.reshape(-1, part.x.shape[2])
    m[np.ix_(place, place)] += x.T @ x
    v[place] += x.T @ y.ravel()
    rows[place] += len(x)
    for s, j in zip(n.segments, n.rows, strict=True):
        if (s.recording, s.channel) == (part.recording, part.channel):
            cross = x.T @ (_turned(j, part.theta) if part.channel == "current" else j)
            m[np.ix_(place, s.places)] += cross
            m[np.ix_(s.places, place)] += cross.T


def _turned(j: Array, theta: Array) -> Array:
    """Return slopes of three phases (n 3, q) along d and q (n 2, q)."""
    each = j.reshape(len(theta), 3, -1)
    return np.stack(
        [in_rotor_frame(each[:, :, k], theta) for k in range(each.shape[2])], axis=2
    ).reshape(2 * len(theta), -1)


def integrated_out(
    joint: Joint, n: NormalEquations, columns: NDArray[np.int64], ridge: float
) -> Algebra:
    """Return the equations of coordinates with regressors (columns) integrated out; n: the same
    with none."""
    p, m, v, rows = joint.p, joint.m.sum(0), joint.v.sum(0), joint.rows.sum(0)
    kept = m[np.ix_(columns, columns)] + np.diag(ridge * rows[columns])
    across, own = m[np.ix_(columns, np.arange(p))], v[columns]
    solved = cho_solve(
        cho_factor(kept, check_finite=False), np.column_stack([across, own]), check_finite=False
    )
    ssr = sum(float(s.ssr.sum()) for s in n.segments)
    return Algebra(
        m[:p, :p] - across.T @ solved[:, :p],
        v[:p] - across.T @ solved[:, p],
        ssr - float(own @ solved[:, p]),
        n.x,
    )


def _described(
    joint: Joint, free: NDArray[np.int64], kinds: int, ridge: float
) -> tuple[Described, ...]:
    """Return what the regression consists of: what is lost without each kind of functions, all else
    refitted."""
    columns = joint.of(free, kinds)
    whole = joint.explained(columns, ridge)
    groups: dict[tuple[str, str], list[int]] = {}
    for c in columns[len(free) :]:
        _, acts, kind = joint.labels[c - joint.p]
        groups.setdefault((acts, KINDS[kind]), []).append(int(c))
    lost = {
        g: max(0.0, whole - joint.explained(np.setdiff1d(columns, own), ridge))
        for g, own in groups.items()
    }
    total = sum(lost.values())
    shares = [Described(acts, on, x / total) for (acts, on), x in lost.items()] if total else []
    return tuple(sorted(shares, key=lambda x: -x.share))
