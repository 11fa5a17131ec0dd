"""A motor at standstill under large voltage steps: resistance, voltage error and flux map from the
recording alone.

  psi(t) = psi_0 + integral of (u - R i - V i/|i|) dt,    psi = f(i) odd on each axis

A wrong R or V makes the loops in the flux-current plane open and drift, so both follow, with f (a
cubic spline in a power of the current) and psi_0, from one linear least squares over the
single-axis tests; the delay of the current reading is scanned.  A cross test then adds flux points
off the axes.

Checked: a planted motor comes back (tests/model).  Not in it: hysteresis and eddy currents of the
iron, which a real recording shows as loops of finite width; they remain in the residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from model.compiled import kernel
from model.errors import BadInput
from model.spline import SplineEnergy, currents

Array = NDArray[np.float64]
PIECES = 8
POWER = 0.6  # knots are equal in |i| to this power: close together where saturation sets in
SMALL = 0.02  # of the largest current: width of sign(i) at zero
BLOCK = 25  # samples over which residuals count as one, for the standard deviations


@dataclass(frozen=True)
class StepTest:
    """Voltages (V) and currents (A) of one test at standstill, sampled at t (s), rotor frame, all
    (n,)."""

    t: Array
    u_d: Array
    u_q: Array
    i_d: Array
    i_q: Array

    def __post_init__(self) -> None:
        for name in ("t", "u_d", "u_q", "i_d", "i_q"):
            values = getattr(self, name)
            bad = np.flatnonzero(~np.isfinite(values))
            if values.shape != self.t.shape or bad.size:
                where = (
                    f"row {bad[0]} is {values[bad[0]]}"
                    if bad.size
                    else f"{values.size} rows, t has {self.t.size}"
                )
                raise BadInput(
                    f"standstill test: column {name}: {where}; give equal columns of finite numbers"
                )


@dataclass(frozen=True)
class StandstillFit:
    """R (ohm), voltage error V (V), delay of the currents (s), their standard deviations, residual
    of flux (Wb rms)."""

    resistance: float
    resistance_sd: float
    threshold: float
    threshold_sd: float
    delay: float
    residual: float


def _sign(i_d: Array, i_q: Array, largest: float) -> tuple[Array, Array]:
    """Return i/|i|, linear through zero."""
    size = np.maximum(np.hypot(i_d, i_q), SMALL * largest)
    return i_d / size, i_q / size


def _shifted(x: StepTest, delay: float) -> tuple[Array, Array]:
    return np.interp(x.t + delay, x.t, x.i_d), np.interp(x.t + delay, x.t, x.i_q)


def _integral(y: Array, h: float) -> Array:
    return np.asarray(h * np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]))]))


def _held(u: Array, h: float) -> Array:
    return np.asarray(h * np.concatenate([[0.0], np.cumsum(u[:-1])]))


def _odd_basis(i: Array, largest: float) -> Array:
    inner = np.linspace(0.0, 1.0, PIECES + 1)[1:-1]
    knots = np.concatenate([np.zeros(4), inner, np.ones(4)])
    x = np.minimum(np.abs(i) / largest, 1.0) ** POWER
    return np.asarray(BSpline(knots, np.eye(len(knots) - 4), 3)(x)[:, 1:] * np.sign(i)[:, None])


def _rows(test: StepTest, axis: int, delay: float) -> tuple[Array, Array, Array]:
    """Return the integral of u, that of (i, sign i), and the basis of the flux, of a single-axis
    test."""
    h = float(test.t[1] - test.t[0])
    i = _shifted(test, delay)[axis]
    largest = float(np.max(np.abs(i)))
    sign = _sign(i, np.zeros_like(i), largest)[0]
    u = (test.u_d, test.u_q)[axis]
    basis = np.column_stack([-np.ones(len(i)), _odd_basis(i, largest)])
    return _held(u, h), np.column_stack([_integral(i, h), _integral(sign, h)]), basis


def fit_axes(tests: Sequence[tuple[StepTest, int]], delays: Array | None = None) -> StandstillFit:
    """Fit R and V shared by single-axis tests (test, axis 0 = d, 1 = q); scans the delays (s), by
    default to 0.6 ms; BadInput where an axis has no test."""
    if {a for _, a in tests} != {0, 1}:
        missing = "d" if all(a == 1 for _, a in tests) else "q"
        raise BadInput(
            f"no single-axis test on {missing}: its flux cannot be identified; record "
            f"voltage steps on {missing}"
        )
    best: StandstillFit | None = None
    for delay in np.arange(0.0, 6.1e-4, 2.5e-5) if delays is None else delays:
        found = _at_delay(tests, float(delay))
        if best is None or found.residual < best.residual:
            best = found
    assert best is not None
    return best


def _at_delay(tests: Sequence[tuple[StepTest, int]], delay: float) -> StandstillFit:
    parts = [_rows(t, a, delay) for t, a in tests]
    width = sum(b.shape[1] for _, _, b in parts)
    rows, goal, at = [], [], 2
    for y, shared, basis in parts:
        a = np.zeros((len(y), 2 + width))
        a[:, :2], a[:, at : at + basis.shape[1]] = shared, basis
        at += basis.shape[1]
        rows.append(a)
        goal.append(y)
    a, y = np.concatenate(rows), np.concatenate(goal)
    x, *_ = np.linalg.lstsq(a, y, rcond=None)
    left = y - a @ x
    inverse = np.linalg.pinv(a.T @ a)
    # residuals are no white noise
    blocks = np.add.reduceat(a * left[:, None], np.arange(0, len(y), BLOCK), axis=0)
    covariance = inverse @ (blocks.T @ blocks) @ inverse
    sd = np.sqrt(np.diag(covariance)[:2])
    return StandstillFit(
        float(x[0]),
        float(sd[0]),
        float(x[1]),
        float(sd[1]),
        delay,
        float(np.sqrt(np.mean(left**2))),
    )


def flux_of(test: StepTest, fit: StandstillFit) -> tuple[Array, Array, Array, Array]:
    """Return psi_d, psi_q (Wb, mean removed so that the loop is centred) and the delayed currents
    of a test."""
    h = float(test.t[1] - test.t[0])
    i_d, i_q = _shifted(test, fit.delay)
    s_d, s_q = _sign(i_d, i_q, float(np.max(np.hypot(i_d, i_q))))
    psi = []
    for u, i, s in ((test.u_d, i_d, s_d), (test.u_q, i_q, s_q)):
        y = _held(u, h) - fit.resistance * _integral(i, h) - fit.threshold * _integral(s, h)
        largest = float(np.max(np.abs(i)))
        if largest > 0:  # psi_0: where the odd part of the loop is centred
            basis = np.column_stack([np.ones(len(i)), _odd_basis(i, largest)])
            y = y - np.linalg.lstsq(basis, y, rcond=None)[0][0]
        psi.append(y)
    return psi[0], psi[1], i_d, i_q


@kernel
def simulate(m: SplineEnergy, resistance, threshold, small, u_d, u_q, h, d, q, substeps, out):
    """Fill out (n, 2) with the currents under voltages held over h seconds, from flux (d, q),
    Euler-midpoint."""
    step = h / substeps
    for k in range(u_d.shape[0]):
        out[k, 0], out[k, 1] = currents(m, d, q)
        for _ in range(substeps):
            x, y = d, q
            for part in (0.5, 1.0):
                i_d, i_q = currents(m, x, y)
                size = max((i_d * i_d + i_q * i_q) ** 0.5, small)
                x = d + part * step * (u_d[k] - resistance * i_d - threshold * i_d / size)
                y = q + part * step * (u_q[k] - resistance * i_q - threshold * i_q / size)
            d, q = x, y
