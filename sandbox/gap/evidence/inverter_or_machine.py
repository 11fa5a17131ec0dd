"""Does what remains look like an inverter's doing, or like a machine's?

Two free regressions of the residual, each by functions that one of the two can bring about, none of
them an effect of the library.  An inverter's voltage error hangs on its legs: on their currents one
by one, on pulses and gaps that are short, on the link (the current drawn from it, now and in the
periods before) and on how fast the command changes (what lies between the legs and the terminals).
A machine's hangs on the currents in the rotor's frame, the speed and the angle
(`regression.scalars`).  Each is judged by what it predicts of recordings left out in turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.effects.library import true_motor
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.regression import RIDGE, SIGN, component, regressors, ridged
from sandbox.gap.evidence.response import added_current
from sandbox.replay.inputs import LEGS, Inputs
from sandbox.replay.replay import replay, residuals

Complex = NDArray[np.complex128]
MEMORY = 8  # periods back in which the link's current may act
# shares of a period below which a pulse, or a vector, may be lost
SHORT = (0.004, 0.008, 0.016, 0.032, 0.064)
VECTORS = LEGS[:, 0] + 1j * LEGS[:, 1]


def explained(point: ParameterPoint) -> tuple[float, float]:
    """Return which shares of what currents show above noise functions of an inverter, and of a
    machine, predict."""
    turned = point.turned()
    prediction = replay(turned, [point.values])
    shown = residuals(point.prepared, prediction)
    currents = [c[:, :, 0] for c in prediction.currents]
    parts = [p for p in regressors(point, currents) if p.channel == "current"]
    y = [component(p, shown[p.recording]) for p in parts]
    excess = sum(float(np.sum(v**2)) for v in y) - sum(v.size for v in y)
    if excess <= 0.0 or len(parts) < 2:
        return 0.0, 0.0
    machine, kinds = [p.x for p in parts], parts[0].kinds
    own = machines(machine[0].shape[2])
    inverter = of_size_one(
        [_response(point, r, c) for r, c in zip(turned.recordings, currents, strict=True)]
    )
    by_machine = _predicted([x[:, :, own] for x in machine], y, kinds[own])
    by_inverter = _predicted(inverter, y, np.zeros(inverter[0].shape[2], dtype=np.int64))
    return min(1.0, by_inverter / excess), min(1.0, by_machine / excess)


def machines(count: int) -> NDArray[np.int64]:
    """Return the places of a machine's functions among so many regressors: the same for d and then
    for q, the last three of each an inverter's."""
    half = count // 2
    return np.r_[0 : half - 3, half : 2 * half - 3]


def of_size_one(responses: Sequence[Array]) -> list[Array]:
    """Return responses (n, 2, p) of all recordings, each of the p functions over its rms of
    vectors; zeros stay."""
    size = np.sqrt(
        sum(np.einsum("ncp,ncp->p", x, x) for x in responses) / sum(len(x) for x in responses)
    )
    return [x / np.where(size > 0.0, size, 1.0) for x in responses]


def _response(point: ParameterPoint, r: Inputs, read: Array) -> Array:
    """Return the currents (n, 2, p), rotor's frame, that an inverter's voltage errors would add in
    a recording."""
    drive = point.prepared.campaign.drive
    motor = true_motor(drive.motor, dict(point.values), keep_map=True)
    theta = r.motion.angle
    z = (2.0 / 3.0) * (read @ LEGS)
    dq = (z[:, 0] + 1j * z[:, 1]) * np.exp(-1j * theta)
    vectors = (
        np.stack(list(voltages(r, read / drive.motor.rated_current)), axis=1)
        * np.exp(-1j * theta)[:, None]
    )
    pair = np.ascontiguousarray(np.stack([vectors.real, vectors.imag], axis=-1))
    period = drive.converter.sampling_period
    currents = np.column_stack([dq.real, dq.imag])
    return np.asarray(
        added_current(motor.energy, motor.resistance, period, currents, theta, pair).transpose(
            0, 2, 1
        )
    )


def voltages(r: Inputs, read: Array) -> Iterator[Complex]:
    """Yield an inverter's voltage errors as vectors of the stationary frame (n,); read: currents
    (n, 3) over rated."""
    duty = r.duty()
    mean = r.mean_duty()
    u = mean[:, 0] + 1j * mean[:, 1]
    step = u - _before(u, 1)
    bend = step - _before(step, 1)
    for x in (u, step, bend, _before(bend, 1)):
        yield x
        yield 1j * x
    for leg, i in zip(VECTORS, read.T, strict=True):
        yield leg * np.tanh(i / SIGN)
        yield leg * np.abs(i)
        yield leg * i
    drawn = np.sum(duty * read, axis=1)
    for k in range(MEMORY):
        yield u * _before(drawn, k)
    for width in SHORT:
        for a, b in ((0, 1), (1, 2), (2, 0)):
            yield (VECTORS[a] - VECTORS[b]) * _short(duty[:, a] - duty[:, b], width)
        for leg, d in zip(VECTORS, duty.T, strict=True):
            yield leg * (_short(d, width) - _short(1.0 - d, width))


def _before(x: NDArray, periods: int) -> NDArray:
    """Return a signal some periods earlier, zero before it began."""
    return np.concatenate([np.zeros(periods, x.dtype), x])[: len(x)]


def _short(x: Array, width: float) -> Array:
    """Return x over a width where it is shorter than that, else 0: what is lost with a pulse."""
    return np.where(np.abs(x) < width, x / width, 0.0)


def _predicted(x: Sequence[Array], y: Sequence[Array], kinds: NDArray[np.int64]) -> float:
    """Return by how much ridge regression lowers the squares of recordings left out in turn, at
    best.

    Kinds of functions (p,) enter one after another.
    """
    a = [np.einsum("ncp,ncq->pq", v, v, optimize=True) for v in x]
    g = [np.einsum("ncp,nc->p", v, w) for v, w in zip(x, y, strict=True)]
    whole, goal, rows = np.sum(a, axis=0), np.sum(g, axis=0), [v.shape[0] for v in x]
    best = 0.0
    for most in range(int(kinds.max()) + 1):
        own = np.flatnonzero(kinds <= most)
        for ridge in RIDGE:
            gain = 0.0
            for part, aim, n in zip(a, g, rows, strict=True):
                c = ridged(
                    (whole - part)[np.ix_(own, own)], ridge * (sum(rows) - n), (goal - aim)[own]
                )
                gain += float(2.0 * c @ aim[own] - c @ part[np.ix_(own, own)] @ c)
            best = max(best, gain)
    return best
