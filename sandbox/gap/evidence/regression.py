"""How much of what remains a free regression could still close: a bound that names no effect.

After the best hypothesis the residual is regressed on functions of (i_d, i_q, speed, angle):
products of low powers, harmonics of the angle, the signs of currents.  Each may act as a current
itself (what a sensor or a flux would add) and as a voltage (what an inverter or a resistance would
add: its response through the motor's own equations).  Ridge regression on the recordings that were
not held out; which kinds of functions enter, and how hard they are held back, is chosen by leaving
each of these out in turn; what counts is what it predicts of those held out, so fitting noise
closes nothing.  The regressors come from predicted currents: noise of a reading cannot explain
itself.  Where few recordings resemble each other it finds little: then it bounds what such a
regression closes, not what could be
closed.

Whether what it finds is structure is told by the same computation on residuals whose sign is turned
block by block (Wu, Annals of Statistics 14 (1986) 1261): that keeps how samples of a block resemble
each other and breaks their tie to the operating point.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from model.array_types import Array
from model.effects.library import true_motor
from sandbox.gap.evidence.normal import BLOCK, ParameterPoint
from sandbox.gap.evidence.response import added_current
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import Prepared, Residual, replay, residuals

DEGREE = 3  # of the powers of currents
# electrical orders, rotor frame: offsets, asymmetries, a three-phase machine's harmonics
ANGULAR = (1, 2, 6)
SIGN = 0.02  # of rated current: width of a sign
RIDGE = 10.0 ** np.arange(-6.0, 1.1)  # of the columns' mean square
DRAWS = 200
STRUCTURE = 0.01  # chance below which structure is not the noise's


@dataclass(frozen=True)
class Remains:
    """What remains on the recordings held out, and what a free regression could still close of it.

    excess: J^2 - 1 after the best hypothesis.  closable: what the regression takes off it (None:
    nothing stands above the noise), of_gap: the same as a share of the gap before.  chance: that
    residuals without structure let it close as much.  alike: variance of sums over blocks of 50 ms
    over that of white noise of the same size; 1 is white.
    """

    excess: float
    closable: float | None
    closable_ci95: tuple[float, float] | None
    of_gap: float | None
    chance: float
    alike: float

    @property
    def structure(self) -> bool:
        """Whether the regression predicts more of the recordings held out than noise would let
        it."""
        return self.chance < STRUCTURE

    def as_json(self) -> dict[str, object]:
        """Return what `diagnosis.json` says under gap.remains."""
        keys = ("excess", "closable", "closable_ci95", "of_gap", "chance", "alike", "structure")
        return {key: getattr(self, key) for key in keys}


@dataclass(frozen=True)
class ChannelRegressors:
    """One channel of one recording: regressors x (n, c, p), c components a sample, of which kind
    (p,), where blocks begin, the angle."""

    recording: int
    channel: str
    x: Array
    kinds: NDArray[np.int64]
    starts: NDArray[np.int64]
    theta: Array


def remains(point: ParameterPoint, held_out: Sequence[int], before: float) -> Remains | None:
    """Return what remains at a point and what could be closed; None where nothing was held out.

    before: the normalised rms before the best hypothesis, on the recordings held out.
    """
    if not held_out:
        return None
    prediction = replay(point.turned(), [point.values])
    shown = residuals(point.prepared, prediction)
    return judged(
        regressors(point, [c[:, :, 0] for c in prediction.currents]), shown, held_out, before
    )


def judged(
    parts: Sequence[ChannelRegressors],
    shown: Sequence[Residual],
    held_out: Sequence[int],
    before: float,
    seed: int = 0,
) -> Remains:
    """Return what residuals leave and what regressors could close of it, on the recordings held
    out."""
    rng = np.random.default_rng(seed)
    y = [component(p, shown[p.recording]) for p in parts]
    signs = [rng.choice((-1.0, 1.0), (len(p.starts), DRAWS)) for p in parts]
    for s in signs:
        s[:, 0] = 1.0  # the residual itself
    gain, blocks = np.zeros(DRAWS), []
    for channel in dict.fromkeys(p.channel for p in parts):
        own = [k for k, p in enumerate(parts) if p.channel == channel]
        drawn, each = _gains(
            [parts[k] for k in own], [y[k] for k in own], [signs[k] for k in own], held_out
        )
        gain += drawn
        blocks.append(each)
    total = [(np.sum(_squares(x)), _squares(x).size) for k, x in enumerate(shown) if k in held_out]
    squares, count = (float(sum(t)) for t in zip(*total, strict=True))
    excess, closed = squares / count - 1.0, max(0.0, float(gain[0])) / count
    each = np.concatenate(blocks)
    pick = rng.integers(len(each), size=(400, len(each)))
    low, high = np.percentile(each[pick].sum(1) / count, [2.5, 97.5])
    own_gap = before**2 - 1.0
    return Remains(
        excess,
        closed / excess if excess > 0.0 else None,
        (float(low / excess), float(high / excess)) if excess > 0.0 and closed > 0.0 else None,
        closed / own_gap if own_gap > 0.0 else None,
        float(np.mean(gain >= gain[0])) if closed > 0.0 else 1.0,
        _alike(parts, y, held_out),
    )


def _squares(x: Residual) -> Array:
    channels = (x.current, x.motion, x.angle)
    return np.concatenate([c.ravel() ** 2 for c in channels if c is not None])


def component(part: ChannelRegressors, x: Residual) -> Array:
    """Return what a part's regressors are to predict (n, c): d and q with unit variance, or the
    channel itself."""
    if part.channel == "current":
        return in_rotor_frame(x.current[:, :, 0], part.theta)
    own = x.motion if part.channel == "motion" else x.angle
    assert own is not None
    return np.asarray(own)


def in_rotor_frame(phases: Array, theta: Array) -> Array:
    """Return three phases' values (n, 3) along d and q (n, 2), scaled so that white noise keeps its
    variance."""
    z = (2.0 / 3.0) * phases @ LEGS
    turned = math.sqrt(1.5) * (z[:, 0] + 1j * z[:, 1]) * np.exp(-1j * theta)
    return np.column_stack([turned.real, turned.imag])


def regressors(point: ParameterPoint, currents: Sequence[Array]) -> list[ChannelRegressors]:
    """Return every channel's regressors, each of mean square 1; currents: predicted readings (n, 3)
    in A of every recording."""
    turned = point.turned()
    out = [p for k, read in enumerate(currents) for p in unscaled(turned, point.values, k, read)]
    _scale(out)
    return out


def unscaled(
    prepared: Prepared, values: Mapping[str, float], k: int, read: Array
) -> list[ChannelRegressors]:
    """Return the regressors of recording k, a part for each of its channels; read: predicted
    readings (n, 3) in A."""
    r, drive = prepared.recordings[k], prepared.campaign.drive
    motor = true_motor(drive.motor, dict(values), keep_map=True)
    period, rated = drive.converter.sampling_period, drive.motor.rated_current
    top = max(1e-9, *(float(np.max(np.abs(x.motion.speed))) for x in prepared.recordings))
    cut = max(1, round(BLOCK / period))
    theta, speed = r.motion.angle, r.motion.speed * np.ones(len(read))
    z = (2.0 / 3.0) * read @ LEGS
    z = (z[:, 0] + 1j * z[:, 1]) * np.exp(-1j * theta)
    dq = np.column_stack([z.real, z.imag])
    own = list(scalars(dq / rated, speed / top, theta))
    functions, kind = np.column_stack([f for f, _ in own]), np.array([x for _, x in own])
    starts = np.arange(0, max(1, len(read) - cut // 2), cut)
    vectors = np.concatenate([_on_both_axes(functions), _leg_signs(read / rated, theta)], axis=1)
    driven = added_current(
        motor.energy, motor.resistance, period, dq, theta, np.ascontiguousarray(vectors)
    )
    kinds = np.tile([*kind, *kind, 0, 0, 0], 2)
    x = np.concatenate([vectors, driven], axis=1).transpose(0, 2, 1)
    out = [ChannelRegressors(k, "current", x, kinds, starts, theta)]
    for channel in [c for c, of in (("motion", "free"), ("angle", "driven")) if r.rotor == of]:
        out.append(ChannelRegressors(k, channel, functions[:, None, :].copy(), kind, starts, theta))
    return out


def scalars(i: Array, speed: Array, theta: Array) -> Iterator[tuple[Array, int]]:
    """Yield the functions of the operating point and their kinds: of currents only (0), of the
    angle (1), of speed (2).

    i (n, 2) over rated current, speed (n,) over the campaign's top speed, theta (n,) electrical
    rad.
    """
    one = np.ones(len(i))
    for a, b in itertools.product(range(DEGREE + 1), repeat=2):
        if a + b <= DEGREE:
            yield i[:, 0] ** a * i[:, 1] ** b, 0
            yield i[:, 0] ** a * i[:, 1] ** b * speed, 2
    yield speed**2, 2
    for n in ANGULAR:
        for factor, kind in ((one, 1), (i[:, 0], 1), (i[:, 1], 1), (speed, 2)):
            yield factor * np.cos(n * theta), kind
            yield factor * np.sin(n * theta), kind
    for x, kind in ((i[:, 0], 0), (i[:, 1], 0), (10.0 * SIGN * speed, 2)):
        yield np.tanh(x / (5.0 * SIGN)), kind


def _on_both_axes(functions: Array) -> Array:
    """Return each function (n, s) along d and along q, (n, 2 s, 2)."""
    n, s = functions.shape
    out = np.zeros((n, 2 * s, 2))
    out[:, :s, 0], out[:, s:, 1] = functions, functions
    return out


def _leg_signs(read: Array, theta: Array) -> Array:
    """Return the signs of the three phase currents as vectors of the rotor's frame (n, 3, 2)."""
    z = (LEGS[:, 0] + 1j * LEGS[:, 1]) * np.tanh(read / SIGN) * np.exp(-1j * theta)[:, None]
    return np.stack([z.real, z.imag], axis=-1)


def _scale(parts: Sequence[ChannelRegressors]) -> None:
    """Give the columns of each channel mean square 1 over all recordings, in place."""
    for channel in {p.channel for p in parts}:
        own = [p.x for p in parts if p.channel == channel]
        mean = sum(np.einsum("ncp,ncp->p", x, x) for x in own) / sum(
            x.shape[0] * x.shape[1] for x in own
        )
        for x in own:
            x *= np.where(mean > 0.0, mean, 1.0) ** -0.5


def _gains(
    parts: Sequence[ChannelRegressors],
    y: Sequence[Array],
    signs: Sequence[Array],
    held_out: Sequence[int],
) -> tuple[Array, Array]:
    """Return how much a channel's regression lowers the squares held out: each draw's (d,), the
    first's by block."""
    flat = [p.x.reshape(-1, p.x.shape[2]) for p in parts]
    a = [x.T @ x for x in flat]
    g = [
        np.add.reduceat(np.einsum("ncp,nc->np", p.x, v), p.starts, axis=0).T @ s
        for p, v, s in zip(parts, y, signs, strict=True)
    ]
    kept = [k for k, p in enumerate(parts) if p.recording not in held_out]
    left = [k for k, p in enumerate(parts) if p.recording in held_out]
    draws = signs[0].shape[1]
    if len(kept) < 2 or not left:
        return np.zeros(draws), np.zeros(sum(len(parts[k].starts) for k in left))
    rows = [flat[k].shape[0] for k in kept]
    x = _chosen([a[k] for k in kept], [g[k] for k in kept], rows, parts[0].kinds)
    gain = sum((_lowered(a[k], g[k], x) for k in left), np.zeros(draws))
    each = []
    for k in left:
        predicted = parts[k].x @ x[:, 0]
        each.append(
            np.add.reduceat(np.sum(y[k] ** 2 - (y[k] - predicted) ** 2, axis=1), parts[k].starts)
        )
    return gain, np.concatenate(each)


def _chosen(
    a: Sequence[Array], g: Sequence[Array], rows: Sequence[int], kinds: NDArray[np.int64]
) -> Array:
    """Return coefficients (p, d) of each draw; 0 at the most.

    Which kinds of functions enter, and how hard they are held back, is what leaving each recording
    out in turn says.
    """
    best, chosen = np.zeros(g[0].shape[1]), np.zeros_like(g[0])
    for most in range(int(kinds.max()) + 1):
        own = np.flatnonzero(kinds <= most)
        parts, goals = [x[np.ix_(own, own)] for x in a], [x[own] for x in g]
        whole, goal, count = np.sum(parts, axis=0), np.sum(goals, axis=0), sum(rows)
        for ridge in RIDGE:
            score = np.zeros(len(best))
            for part, aim, n in zip(parts, goals, rows, strict=True):
                x = ridged(whole - part, ridge * (count - n), goal - aim)
                score += _lowered(part, aim, x)
            better = np.flatnonzero(score > best)
            if better.size:
                chosen[:, better] = 0.0
                x = ridged(whole, ridge * count, goal[:, better])
                chosen[np.ix_(own, better)] = x
                best[better] = score[better]
    return chosen


def ridged(a: Array, ridge: float, g: Array) -> Array:
    """Return x of (a + ridge) x = g, a (p, p) symmetric and not negative; by Cholesky's factors."""
    held = a.copy()
    held.flat[:: len(a) + 1] += ridge
    return np.asarray(
        cho_solve(cho_factor(held, overwrite_a=True, check_finite=False), g, check_finite=False)
    )


def _lowered(a: Array, g: Array, x: Array) -> Array:
    """Return by how much coefficients x (p, d) lower the sum of squares."""
    return np.asarray(2.0 * np.sum(x * g, axis=0) - np.sum(x * (a @ x), axis=0))


def _alike(
    parts: Sequence[ChannelRegressors], y: Sequence[Array], held_out: Sequence[int]
) -> float:
    """Return the mean square of sums over blocks, over the sum of squares."""
    sums = squares = 0.0
    for p, v in zip(parts, y, strict=True):
        if p.recording in held_out:
            sums += float(np.sum(np.add.reduceat(v, p.starts, axis=0) ** 2))
            squares += float(np.sum(v**2))
    return sums / squares if squares else 1.0
