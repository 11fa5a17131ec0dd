"""Unbiased identification: every steady level at once through the exact periodic solution of
`model.ripple`.

Neither large alphas nor a finite injection frequency bias it.  Free beside the motor's eight
parameters: the inverter's voltage error (threshold and width), its delay against the reading, the
error of the lock angle, and, with stated standard deviations,
gains and offsets of the current sensors.

Checked: recovery of planted motors, coverage of the intervals, bench campaigns (tests/model,
tests/sandbox). Not in the model, and told by `Fit.misfit` only: iron loss, current filters, a
saturation the quartic cannot follow.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.energy import flux_from_current
from model.errors import BadInput, PhysicsError
from model.exact_residuals import MOTOR, BenchUnknowns, MotorUnknowns, Problem
from model.identification import first_order_estimate
from model.levels import NAMES, NONE, D, Fit, Levels, Q, require_information, resistance_of
from model.parameters import Motor

# of the largest current: the sign of a phase current goes linearly through zero within it
WIDTH = 0.01
WIDTH_SD = 0.7  # of its logarithm
ANGLE_SD = 0.1  # rad, weak prior on the error of the lock angle; symmetry in i_q finds it
# of the sampling period, prior on pulses later than the reading amid their zero vector
DELAY_SD = 0.2
SINGULAR = 1e-10
# numbers that any fit takes from the levels: those of the motor and the inverter's threshold
FREE = MOTOR + 1
# numbers that voltages tell: resistance, threshold and width of the inverter's error
OF_VOLTAGES = 3
OF_SLOPES = 7  # numbers that slopes tell: inductances and alphas
ALPHAS = NAMES[3:]


class _Solution(NamedTuple):
    """A minimum: sum of squares, scaled unknowns, derivatives of the residuals by those that are
    free."""

    cost: float
    x: Array
    jacobian: Array


def exact(levels: Levels, nominal: Motor, background: dict[str, float] | None = None) -> Fit:
    """Fit all levels jointly through the exact periodic solution; `nominal` is a start value only.

    `background`: standard deviations `current_gain` (relative) and `current_offset` (A) of the
    sensors; absent or zero they are taken as perfect.  Raises PhysicsError if no start value leads
    to a valid model.
    """
    require_information(levels)
    background = background or {}
    angles, locks = np.unique(np.round(levels.theta, 4), return_inverse=True)
    gain, offset = background.get("current_gain", 0.0), background.get("current_offset", 0.0)
    drawn = BenchUnknowns(
        math.inf,
        gain,
        gain,
        gain,
        offset,
        offset,
        WIDTH_SD,
        DELAY_SD * levels.period,
        np.full(len(angles), ANGLE_SD),
    )
    prior = np.hstack(drawn)
    free = np.concatenate([np.ones(MOTOR, bool), prior > 0])
    biggest = float(np.max(np.hypot(*levels.current.T)))
    minima: list[tuple[_Solution, Problem]] = []
    for start in _starts(levels, nominal):
        alphas = np.maximum(np.abs(start.alphas), 0.1 * np.abs(_natural(start, biggest)))
        steps = np.hstack(drawn._replace(voltage_threshold=0.01 * start.resistance * biggest))
        scale = np.concatenate(
            [np.hstack(start._replace(alphas=alphas)), np.where(steps > 0, steps, 1.0)]
        )
        problem = Problem(levels, scale, locks, np.where(prior > 0, prior, np.inf), WIDTH * biggest)
        found = _levenberg(
            problem.residuals,
            np.concatenate([np.hstack(start), np.zeros(len(prior))]) / scale,
            free,
        )
        if found and all(abs(found.cost / other.cost - 1.0) > 1e-3 for other, _ in minima):
            minima.append((found, problem))
        if found and found.cost < 3.0 * len(levels.axis) * 4:
            break
    if not minima:
        raise PhysicsError(
            "no start value gives a model valid at every level (strictly convex energy); "
            "the levels reach currents "
            "where the quartic energy cannot hold, or voltages and currents do not belong together"
        )
    best = min((_reweighted(free, *m) for m in minima), key=_negative_log_likelihood)
    fit = _finish(levels, free, *best)
    # raises where the way there from zero leaves the convex domain
    flux_from_current(fit.energy, *levels.current.T)
    return fit


def _reweighted(
    free: NDArray[np.bool_], found: _Solution, problem: Problem
) -> tuple[_Solution, Problem]:
    """Refit with voltages and slopes each weighted by their own misfit: an imperfect inverter model
    then costs the resistance precision, not the inductances accuracy."""
    for _ in range(4):
        r = problem.residuals(found.x)
        assert r is not None
        voltages, slopes = problem.parted(r)
        misfit = [_variance(voltages, OF_VOLTAGES), _variance(slopes, OF_SLOPES)]
        inflate = tuple(
            float(max(1.0, a * math.sqrt(m))) for a, m in zip(problem.inflate, misfit, strict=True)
        )
        if max(abs(a / b - 1.0) for a, b in zip(inflate, problem.inflate, strict=True)) < 0.02:
            break
        heavier = replace(problem, inflate=(inflate[0], inflate[1]))
        again = _levenberg(heavier.residuals, found.x, free)
        if again is None:
            break
        found, problem = again, heavier
    return found, problem


def _negative_log_likelihood(minimum: tuple[_Solution, Problem]) -> float:
    """Return that of a reweighted minimum, less a constant: of voltages and slopes whose noise is
    so much larger than stated.  Costs alone cannot be compared, each is over its own noise."""
    found, problem = minimum
    r = problem.residuals(found.x)
    assert r is not None
    sizes = (part.size for part in problem.parted(r))
    return 0.5 * found.cost + sum(
        n * math.log(a) for n, a in zip(sizes, problem.inflate, strict=True)
    )


def _variance(r: Array, used: int) -> float:
    return float(r @ r) / max(1, r.size - used)


def _natural(start: MotorUnknowns, current: float) -> Array:
    """Return alphas whose terms would equal the linear one at a current (A), to scale unknowns
    by."""
    l_d, l_q = start.inductance_d, start.inductance_q
    d, q = l_d * current, l_q * current
    return np.array([1 / l_d / d, 1 / l_q / d, 1 / l_d / d**2, 1 / l_q / d**2, 1 / l_q / q**2]) / 6


def _starts(levels: Levels, nominal: Motor) -> list[MotorUnknowns]:
    """Return start values to try: alphas nominal, first-order and none, with R and L read off the
    levels."""
    r, _ = resistance_of(levels)
    near_zero = np.argsort(np.hypot(*levels.current.T))
    l_d, l_q = (
        1.0 / levels.slope[next(k for k in near_zero if levels.axis[k] == a), a] for a in (D, Q)
    )
    if not (r > 0 and l_d > 0 and l_q > 0):
        raise BadInput(
            f"the levels give R = {r:.3g} ohm, L_d = {l_d:.3g} H, L_q = {l_q:.3g} H, which must be "
            "> 0: currents do not follow the voltages; check the order of the phases and the signs"
        )
    alphas = [np.array([getattr(nominal, name) for name in ALPHAS])]
    with contextlib.suppress(BadInput):  # no level at zero current: the exact fit does not need one
        _, _, *found = first_order_estimate(levels, levels.slope)
        alphas.append(np.array(found))
    alphas += [0.5 * alphas[0], np.zeros(5)]
    return [MotorUnknowns(r, l_d, l_q, a) for a in alphas]


def _levenberg(
    residuals: Callable[[Array], Array | None], x: Array, free: NDArray[np.bool_]
) -> _Solution | None:
    """Minimise a sum of squares by Levenberg-Marquardt; return its minimum, None if x is
    invalid."""
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
            return _Solution(float(r @ r), x, j)
        gained, moved = r @ r - new @ new, np.max(np.abs(trial - x))
        x, r, damping = trial, new, max(1e-12, 0.1 * damping)
        if moved < 1e-9 or (gained < 1e-9 * (new @ new) and damping <= 1e-6):
            break
    j = _jacobian(residuals, x, r, columns)
    return None if j is None else _Solution(float(r @ r), x, j)


def _jacobian(
    f: Callable[[Array], Array | None], x: Array, r: Array, columns: NDArray[np.int64]
) -> Array | None:
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


def _finish(levels: Levels, free: NDArray[np.bool_], found: _Solution, problem: Problem) -> Fit:
    h = found.jacobian.T @ found.jacobian
    spread = np.sqrt(np.diag(h))
    if np.min(np.linalg.eigvalsh(h / np.outer(spread, spread))) < SINGULAR:
        raise BadInput(
            "the levels do not tell the parameters apart (singular fit); add levels on both axes"
        )
    scale = problem.scale[free]
    covariance = np.linalg.inv(h) * np.outer(scale, scale)
    rows = levels.axis != NONE
    unknowns = found.x * problem.scale
    r = problem.residuals(found.x)
    assert r is not None
    voltages, slopes = problem.parted(r)
    numbers = max(1, voltages.size + slopes.size - FREE)
    misfit = max(1e-300, found.cost * float(np.max(problem.inflate)) ** 2 / numbers)
    peak = np.max(np.abs(levels.flux), axis=1)[rows, None]
    left = np.full((len(levels.axis), 2), np.nan)
    left[rows] = slopes.reshape(-1, 2) * problem.inflate[1] * levels.slope_sd[rows] * peak
    bench, is_free = BenchUnknowns.of(unknowns), BenchUnknowns.of(free)
    names = NAMES + tuple(k for k, f in is_free._asdict().items() if k != "angles" and f)
    names += tuple(f"angle_{k}" for k in range(int(is_free.angles.sum())))
    stated = {k: float(v) for k, v in bench._asdict().items() if k != "angles"}
    nuisance = stated | {
        "width": problem.width * math.exp(bench.width),
        "angle_error": float(np.mean(bench.angles)),
    }
    values = dict(zip(NAMES, unknowns[:MOTOR].tolist(), strict=True))
    residual_rms = float(np.sqrt(np.nanmean(left**2)))
    return Fit("exact", names, values, covariance, residual_rms, misfit, nuisance, left)
