"""Unbiased identification: every steady level at once through the exact periodic solution of `model.ripple`.

Neither large alphas nor a finite injection frequency bias it.  Free beside the motor's eight parameters: the
inverter's voltage error (threshold and width), its delay against the reading, the error of the lock angle, and,
with stated standard deviations,
gains and offsets of the current sensors.

Checked: recovery of planted motors, coverage of the intervals, bench campaigns (tests/model, tests/sandbox).
Not in the model, and told by `Fit.misfit` only: iron loss, current filters, a saturation the quartic cannot follow.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.compiled import kernel
from model.energy import Energy, flux_from_current
from model.errors import BadInput, PhysicsError
from model.frames import rotate
from model.identification import first_order_estimate
from model.levels import NAMES, NONE, Array, D, Fit, Levels, Q, require_information, resistance_of
from model.parameters import Motor
from model.ripple import periodic, slopes

WIDTH = 0.01  # of the largest current: the sign of a phase current goes linearly through zero within it
WIDTH_SD = 0.7  # of its logarithm
ANGLE_SD = 0.1  # rad, weak prior on the error of the lock angle; symmetry in i_q finds it
DELAY_SD = 0.2  # of the sampling period, prior on pulses later than the reading amid their zero vector
SINGULAR = 1e-10


@kernel
def _predict(m, resistance, threshold, width, error, theta, gain, offset, waveform, psi, current, h, delay, out):
    """Fill out (n, 4): mean voltage d, q (V) and slopes d, q (1/H) as the bench reads them; return 0 if solved."""
    n, samples = psi.shape
    v = np.empty((samples, 2))
    ripple = np.empty((samples, 2))
    for k in range(n):
        angle = theta[k] + error[k]
        a, b = rotate(current[k, 0], current[k, 1], theta[k])  # undo the sensors: true mean current
        a, b = a - offset[0], b - offset[1]
        det = gain[0, 0] * gain[1, 1] - gain[0, 1] * gain[1, 0]
        x = (gain[1, 1] * a - gain[0, 1] * b) / det
        y = (gain[0, 0] * b - gain[1, 0] * a) / det
        i_d, i_q = rotate(x, y, -angle)
        for j in range(samples):
            v[j, 0], v[j, 1] = rotate(waveform[k, j, 0], waveform[k, j, 1], -error[k])
        u_d, u_q, status = periodic(m, resistance, threshold, width, angle, v, h, delay, i_d, i_q, ripple)
        if status == 1:
            return 1
        for j in range(samples):
            a, b = rotate(ripple[j, 0], ripple[j, 1], angle)
            x, y = gain[0, 0] * a + gain[0, 1] * b, gain[1, 0] * a + gain[1, 1] * b
            ripple[j, 0], ripple[j, 1] = rotate(x, y, -theta[k])
        out[k, 0], out[k, 1] = rotate(u_d, u_q, error[k])
        out[k, 2], out[k, 3] = slopes(ripple, psi[k])
    return 0


def sensor_gain(a: float, b: float, c: float) -> Array:
    """Return the 2x2 alpha-beta matrix of phase gains 1 + a, 1 + b, 1 + c."""
    s = math.sqrt(3.0)
    return np.array([[1 + (4 * a + b + c) / 6, (c - b) * s / 6], [(c - b) / (2 * s), 1 + (b + c) / 2]])


@dataclass(frozen=True)
class _Problem:
    """Residuals of the exact fit as a function of the scaled unknowns (1 = start value, or prior sd)."""

    levels: Levels
    scale: Array
    locks: NDArray[np.int64]  # (n,) which lock angle a level belongs to
    prior: Array  # sd of the unknowns after the motor's own, inf where free
    width: float  # A
    inflate: tuple[float, float] = (1.0, 1.0)  # of the standard deviations of voltages and of slopes

    def residuals(self, x: Array) -> Array | None:
        """Return the weighted residuals, None where a level lies outside the model's valid domain."""
        lv, p = self.levels, x * self.scale
        if p[0] <= 0 or p[1] <= 0 or p[2] <= 0:
            return None
        m = Energy(1 / p[1], 1 / p[2], p[3], p[4], p[5], p[6], p[7])
        gain, offset = sensor_gain(p[9], p[10], p[11]), np.array([p[12], (p[12] + 2 * p[13]) / math.sqrt(3.0)])
        out = np.empty((len(lv.axis), 4))
        error = np.ascontiguousarray(p[16:][self.locks])
        width = self.width * math.exp(min(max(p[14], -5.0), 5.0))
        status = _predict(
            m, p[0], p[8], width, error, lv.theta, gain, offset, lv.waveform, lv.flux, lv.current, lv.period, p[15], out
        )
        if status:
            return None
        bias = (lv.voltage - out[:, :2]) / (lv.voltage_sd * self.inflate[0])
        rows = lv.axis != NONE
        ripple = ((lv.slope - out[:, 2:]) / (lv.slope_sd * self.inflate[1]))[rows]
        finite = np.isfinite(self.prior)
        return np.concatenate([bias.ravel(), ripple.ravel(), p[8:][finite] / self.prior[finite]])


def exact(levels: Levels, nominal: Motor, background: dict[str, float] | None = None) -> Fit:
    """Fit all levels jointly through the exact periodic solution; `nominal` is a start value only.

    `background`: standard deviations `current_gain` (relative) and `current_offset` (A) of the sensors; absent or
    zero they are taken as perfect.  Raises PhysicsError if no start value leads to a valid model.
    """
    require_information(levels)
    background = background or {}
    angles, locks = np.unique(np.round(levels.theta, 4), return_inverse=True)
    gain, offset = background.get("current_gain", 0.0), background.get("current_offset", 0.0)
    prior = np.concatenate(
        [[np.inf], 3 * [gain], 2 * [offset], [WIDTH_SD], [DELAY_SD * levels.period], len(angles) * [ANGLE_SD]]
    )
    free = np.concatenate([np.ones(9, bool), prior[1:] > 0])
    biggest = float(np.max(np.hypot(*levels.current.T)))
    best: tuple[float, Array, Array, _Problem] | None = None
    for start in _starts(levels, nominal):
        alphas = np.maximum(np.abs(start[3:]), 0.1 * np.abs(_natural(start, biggest)))
        scale = np.concatenate(
            [start[:3], alphas, [0.01 * start[0] * biggest], np.where(prior[1:] > 0, prior[1:], 1.0)]
        )
        problem = _Problem(levels, scale, locks, np.where(prior > 0, prior, np.inf), WIDTH * biggest)
        found = _levenberg(problem.residuals, np.concatenate([start, np.zeros(len(prior))]) / scale, free)
        if found and (best is None or found[0] < 0.999 * best[0]):
            best = (*found, problem)
        if best and best[0] < 3.0 * len(levels.axis) * 4:
            break
    if best is None:
        raise PhysicsError(
            "no start value gives a model valid at every level (strictly convex energy); the levels reach currents "
            "where the quartic energy cannot hold, or voltages and currents do not belong together"
        )
    fit = _finish(levels, free, *_reweighted(levels, free, *best))
    flux_from_current(fit.energy, *levels.current.T)  # raises where the way there from zero leaves the convex domain
    return fit


def _reweighted(
    levels: Levels, free: NDArray[np.bool_], cost: float, x: Array, j: Array, problem: _Problem
) -> tuple[float, Array, Array, _Problem]:
    """Refit with voltages and slopes each weighted by their own misfit: an imperfect inverter model then costs
    the resistance precision, not the inductances accuracy."""
    for _ in range(4):
        r = problem.residuals(x)
        assert r is not None
        bias, rows = levels.voltage.size, 2 * int((levels.axis != NONE).sum())
        misfit = [_variance(r[:bias], 3), _variance(r[bias : bias + rows], 7)]
        inflate = tuple(float(max(1.0, a * math.sqrt(m))) for a, m in zip(problem.inflate, misfit, strict=True))
        if max(abs(a / b - 1.0) for a, b in zip(inflate, problem.inflate, strict=True)) < 0.02:
            break
        problem = replace(problem, inflate=(inflate[0], inflate[1]))
        found = _levenberg(problem.residuals, x, free)
        if found is None:
            break
        cost, x, j = found
    return cost, x, j, problem


def _variance(r: Array, used: int) -> float:
    return float(r @ r) / max(1, r.size - used)


def _natural(start: Array, current: float) -> Array:
    """Return alphas whose terms would equal the linear one at a current (A), to scale unknowns by."""
    d, q = start[1] * current, start[2] * current
    return (
        np.array([1 / start[1] / d, 1 / start[2] / d, 1 / start[1] / d**2, 1 / start[2] / d**2, 1 / start[2] / q**2])
        / 6
    )


def _starts(levels: Levels, nominal: Motor) -> list[Array]:
    """Return start values to try: alphas nominal, first-order and none, with R and L read off the levels."""
    r, _ = resistance_of(levels)
    near_zero = np.argsort(np.hypot(*levels.current.T))
    l_d, l_q = (1.0 / levels.slope[next(k for k in near_zero if levels.axis[k] == a), a] for a in (D, Q))
    if not (r > 0 and l_d > 0 and l_q > 0):
        raise BadInput(
            f"the levels give R = {r:.3g} ohm, L_d = {l_d:.3g} H, L_q = {l_q:.3g} H, which must be > "
            "0: currents do not "
            "follow the voltages; check the order of the phases and the signs"
        )
    e = nominal.energy
    alphas = [np.array(e[2:])]
    with contextlib.suppress(BadInput):  # no level at zero current: the exact fit does not need one
        alphas.append(first_order_estimate(levels, levels.slope)[2:])
    alphas += [0.5 * alphas[0], np.zeros(5)]
    return [np.concatenate([[r, l_d, l_q], a]) for a in alphas]


def _levenberg(
    residuals: Callable[[Array], Array | None], x: Array, free: NDArray[np.bool_]
) -> tuple[float, Array, Array] | None:
    """Minimise a sum of squares by Levenberg-Marquardt; return it with x and the Jacobian, None if x is invalid."""
    r = residuals(x)
    if r is None:
        return None
    damping, columns = 1e-3, np.flatnonzero(free)
    for _ in range(60):
        j = _jacobian(residuals, x, r, columns)
        if j is None:
            return None
        g, h = j.T @ r, j.T @ j
        while damping < 1e12:
            trial = x.copy()
            trial[columns] -= np.linalg.solve(h + damping * np.diag(np.diag(h)), g)
            new = residuals(trial)
            if new is not None and new @ new < r @ r:
                break
            damping *= 10
        else:
            return float(r @ r), x, j
        gained, moved = r @ r - new @ new, np.max(np.abs(trial - x))
        x, r, damping = trial, new, max(1e-12, 0.1 * damping)
        if moved < 1e-9 or (gained < 1e-9 * (new @ new) and damping <= 1e-6):
            break
    j = _jacobian(residuals, x, r, columns)
    return None if j is None else (float(r @ r), x, j)


def _jacobian(f: Callable[[Array], Array | None], x: Array, r: Array, columns: NDArray[np.int64]) -> Array | None:
    j = np.empty((len(r), len(columns)))
    for n, k in enumerate(columns):
        for size in (1e-5, -1e-5):
            step = x.copy()
            step[k] += size
            new = f(step)
            if new is not None:
                j[:, n] = (new - r) / size
                break
        else:
            return None
    return j


def _finish(levels: Levels, free: NDArray[np.bool_], cost: float, x: Array, j: Array, problem: _Problem) -> Fit:
    h = j.T @ j
    spread = np.sqrt(np.diag(h))
    if np.min(np.linalg.eigvalsh(h / np.outer(spread, spread))) < SINGULAR:
        raise BadInput("the levels do not tell the parameters apart (singular fit); add levels on both axes")
    scale = problem.scale[free]
    covariance = np.linalg.inv(h) * np.outer(scale, scale)
    rows = levels.axis != NONE
    p = x * problem.scale
    r = problem.residuals(x)
    assert r is not None
    bias = levels.voltage.size
    misfit = max(1e-300, cost * float(np.max(problem.inflate)) ** 2 / max(1, bias + 2 * int(rows.sum()) - 9))
    peak = np.max(np.abs(levels.flux), axis=1)[rows, None]
    left = np.full((len(levels.axis), 2), np.nan)
    scaled = r[bias : bias + 2 * int(rows.sum())].reshape(-1, 2) * problem.inflate[1]
    left[rows] = scaled * levels.slope_sd[rows] * peak
    nuisance = {"voltage_threshold": float(p[8]), "gain_a": float(p[9]), "gain_b": float(p[10])}
    nuisance |= {
        "gain_c": float(p[11]),
        "offset_a": float(p[12]),
        "offset_b": float(p[13]),
        "width": problem.width * math.exp(p[14]),
    }
    nuisance |= {"delay": float(p[15])}
    nuisance |= {"angle_error": float(np.mean(p[16:]))}
    names = NAMES + tuple(k for k, f in zip([*nuisance][:-1], free[8:16], strict=True) if f)
    names += tuple(f"angle_{k}" for k in range(int(free[16:].sum())))
    return Fit(
        "exact", names, dict(zip(NAMES, p[:8].tolist(), strict=True)), covariance,
        float(np.sqrt(np.nanmean(left**2))), misfit, nuisance, left,
    )  # fmt: skip
