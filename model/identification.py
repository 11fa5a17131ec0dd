"""A motor's parameters from its steady levels at locked rotor: the paper's least squares, and an unbiased joint fit.

A level is a stretch with constant bias current and periodic injected voltage; what is read of it are the bias
voltage and current and the slopes S (1/H), the ripple current per unit of flux ripple (see `model.ripple`).

`first_order`: section III of the paper, eqs. (LdLq) to (saturation4q), split into small linear least squares.
`exact`: all levels and both ripple components at once through the exact periodic solution, so that neither large
alphas nor a finite frequency bias it; with the inverter's voltage error, the error of the lock angle and (with
stated standard deviations) gains and offsets of the current sensors as free nuisance parameters.

Checked: recovery of planted motors, coverage of the intervals, bench campaigns (tests/model, tests/sandbox).
Not checked: motors whose saturation the quartic energy does not follow (their residual tells).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from model.compiled import kernel
from model.energy import Energy
from model.errors import BadInput, PhysicsError
from model.frames import rotate
from model.parameters import Motor
from model.ripple import flux_ripple, periodic, slopes

Array = NDArray[np.float64]
NAMES = (
    "resistance", "inductance_d", "inductance_q", "alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04",
)  # fmt: skip
UNITS = dict(zip(NAMES, ("ohm", "H", "H", "A/Wb^2", "A/Wb^2", "A/Wb^3", "A/Wb^3", "A/Wb^3"), strict=True))
D, Q, NONE = 0, 1, -1
ON_AXIS = 0.08  # of the largest current: how far a level may lie from an axis to count as on it
WIDTH = 0.01  # of the largest current: the sign of a phase current goes linearly through zero within it
WIDTH_SD = 0.7  # of its logarithm
ANGLE_SD = 0.1  # rad, weak prior on the error of the lock angle; symmetry in i_q finds it
SINGULAR = 1e-10


@dataclass(frozen=True)
class Levels:
    """Steady levels, n of them, in the rotor frame the encoder gives; arrays lead with n, second axis d, q."""

    period: float  # sampling period, s
    axis: NDArray[np.int64]  # injected axis: D, Q or NONE
    voltage: Array  # (n, 2) V, mean command
    current: Array  # (n, 2) A, mean reading
    slope: Array  # (n, 2) 1/H, ripple per unit of flux ripple along the injected axis
    voltage_sd: Array
    slope_sd: Array
    waveform: Array  # (n, N, 2) V, command over one injection period less its mean
    theta: Array  # (n,) rad, lock angle
    source: tuple[str, ...] = field(default=())  # (n,) recording

    @property
    def flux(self) -> Array:
        """Sampled flux ripple (n, N) along the injected axis, V s."""
        return np.array(
            [flux_ripple(w[:, max(a, 0)], self.period) for w, a in zip(self.waveform, self.axis, strict=True)]
        )

    def pick(self, axis: int, bias: int | None) -> NDArray[np.int64]:
        """Return the indices of levels injected on an axis with bias on `bias` alone (zero included), or at zero."""
        near = ON_AXIS * np.max(np.hypot(*self.current.T))
        off = np.hypot(*self.current.T) if bias is None else np.abs(self.current[:, 1 - bias])
        return np.flatnonzero((self.axis == axis) & (off <= near))


@dataclass(frozen=True)
class Fit:
    """Estimated parameters: values and standard deviations by name (SI), covariance in the order of `names`."""

    method: str
    names: tuple[str, ...]
    values: dict[str, float]
    covariance: Array
    residual_rms: float  # A, peak of the ripple left unexplained
    misfit: float  # how many times its noise the worse of voltages and ripples leaves, 1 where noise explains all
    nuisance: dict[str, float]

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations by name."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    def ci95(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a parameter."""
        half = 1.959964 * self.sd[name]
        return self.values[name] - half, self.values[name] + half

    @property
    def energy(self) -> Energy:
        """The magnetic model found."""
        v = self.values
        return Energy(1.0 / v["inductance_d"], 1.0 / v["inductance_q"], *(float(v[n]) for n in NAMES[3:]))


def require_information(levels: Levels) -> None:
    """Raise BadInput naming the axis or the level without which parameters cannot be identified."""
    cases = (
        (D, D, "d", "d", "inductance_d, alpha_30 and alpha_40"),
        (D, Q, "d", "q", "alpha_12 and alpha_22"),
        (Q, Q, "q", "q", "inductance_q and alpha_04"),
    )
    scale = float(np.max(np.hypot(*levels.current.T), initial=0.0))
    for axis, bias, injected, biased, names in cases:
        rows = levels.pick(axis, bias)
        if rows.size == 0:
            raise BadInput(
                f"no steady level with injection on {injected} and bias on {biased}: {names} cannot be identified; "
                f"record a bias staircase on {biased} with injection on {injected}"
            )
        i = levels.current[rows, bias]
        if scale == 0.0 or np.ptp(i) < 0.2 * scale or len(_distinct(i, ON_AXIS * scale)) < 3:
            found = ", ".join(f"{x:.3g}" for x in _distinct(i, ON_AXIS * scale))
            raise BadInput(
                f"the staircase on {biased} with injection on {injected} has levels at {found} A only: {names} need at "
                "least three, well apart; add levels"
            )
        if axis == D and bias == D and not (i.min() < -ON_AXIS * scale and i.max() > ON_AXIS * scale):
            side = "negative" if i.min() >= -ON_AXIS * scale else "positive"
            raise BadInput(
                f"the staircase on d with injection on d has no level at {side} i_d (range {i.min():.3g} to "
                f"{i.max():.3g} A): alpha_30 and alpha_40 cannot be told apart; add levels of both signs"
            )


def _distinct(values: Array, apart: float) -> list[float]:
    kept: list[float] = []
    for x in np.sort(values):
        if not kept or x - kept[-1] > apart:
            kept.append(float(x))
    return kept


def resistance_of(levels: Levels) -> tuple[float, float]:
    """Return R and its standard deviation (ohm) from the bias levels, u = R i + u_0 sign(i) along each level."""
    i = np.hypot(*levels.current.T)
    big = i > 0.15 * i.max()
    if big.sum() < 3 or np.ptp(i[big]) < 0.1 * i.max():
        raise BadInput("the bias levels do not differ in current: resistance cannot be identified; add levels")
    along = np.sum(levels.voltage * levels.current, axis=1)[big] / i[big]
    a = np.column_stack([i[big], np.ones(big.sum())])
    x, *_ = np.linalg.lstsq(a, along, rcond=None)
    spread = np.sum((along - a @ x) ** 2) / max(1, big.sum() - 2) + np.mean(levels.voltage_sd**2)
    return float(x[0]), math.sqrt(spread * np.linalg.inv(a.T @ a)[0, 0])


def first_order_estimate(levels: Levels, slope: Array) -> Array:
    """Return L_d, L_q and the five alphas (in NAMES' order) by the paper's split least squares, as printed."""
    i_d, i_q = levels.current.T
    zero_d, zero_q = levels.pick(D, None), levels.pick(Q, None)
    for rows, axis in ((zero_d, "d"), (zero_q, "q")):
        if rows.size == 0:
            raise BadInput(
                f"no level at zero current with injection on {axis}: eq. (LdLq) cannot give inductance_{axis}; record one"
            )
    l_d, l_q = 1.0 / slope[zero_d, D].mean(), 1.0 / slope[zero_q, Q].mean()  # (LdLq)
    s1, s3, s4 = levels.pick(D, D), levels.pick(D, Q), levels.pick(Q, Q)
    a = np.column_stack([6 * l_d * i_d[s1], 12 * l_d**2 * i_d[s1] ** 2])
    (a30, a40), *_ = np.linalg.lstsq(a, slope[s1, D] - 1 / l_d, rcond=None)  # (saturation1)
    a22 = _ratio(2 * l_q**2 * i_q[s3] ** 2, slope[s3, D] - 1 / l_d)  # (saturation3d)
    both = np.concatenate([s3, s4])
    cross = np.concatenate([slope[s3, Q], slope[s4, D]])
    a12 = _ratio(2 * l_q * i_q[both], cross)  # (saturation3q), (saturation4d)
    a04 = _ratio(12 * l_q**2 * i_q[s4] ** 2, slope[s4, Q] - 1 / l_q)  # (saturation4q)
    return np.array([l_d, l_q, a30, a12, a40, a22, a04])


def _ratio(x: Array, y: Array) -> float:
    return float(x @ y / (x @ x))


def first_order(levels: Levels, current_uncertainty: float | None = None) -> Fit:
    """Fit by the paper's method; `current_uncertainty` (A, one standard deviation on the ripple's peak) if given.

    Errors of the levels are taken as independent and propagated through the whole estimate, its L included.
    """
    require_information(levels)
    r, r_sd = resistance_of(levels)
    x = first_order_estimate(levels, levels.slope)
    peak = np.max(np.abs(levels.flux), axis=1)
    sd = levels.slope_sd
    if current_uncertainty is not None:
        sd = np.repeat((current_uncertainty / np.where(peak > 0, peak, np.inf))[:, None], 2, axis=1)
    j = sensitivity(levels)
    covariance = np.zeros((8, 8))
    covariance[0, 0] = r_sd**2
    covariance[1:, 1:] = (j * sd.ravel() ** 2) @ j.T
    values = dict(zip(NAMES, [r, *x.tolist()], strict=True))
    left = (levels.slope - _first_order_slopes(levels, x)) * peak[:, None]
    rows = levels.axis != NONE
    return Fit("first_order", NAMES, values, covariance, float(np.sqrt(np.mean(left[rows] ** 2))), math.nan, {})


def sensitivity(levels: Levels) -> Array:
    """Return the derivatives (7, 2n) of the first-order estimate by every slope, by central differences."""
    j, size = [], 1e-6 * np.max(np.abs(levels.slope))
    for k in np.ndindex(levels.slope.shape):
        step = np.zeros_like(levels.slope)
        step[k] = size
        up, down = (first_order_estimate(levels, levels.slope + s) for s in (step, -step))
        j.append((up - down) / (2 * size))
    return np.array(j).T


def _first_order_slopes(levels: Levels, x: Array) -> Array:
    """Return eqs. (tid), (tiq) per unit of flux ripple."""
    l_d, l_q, a30, a12, a40, a22, a04 = x
    d, q = l_d * levels.current[:, 0], l_q * levels.current[:, 1]
    dd = 1 / l_d + 6 * a30 * d + 12 * a40 * d**2 + 2 * a22 * q**2
    dq = 2 * q * (a12 + 2 * a22 * d)
    qq = 1 / l_q + 2 * a12 * d + 2 * a22 * d**2 + 12 * a04 * q**2
    on_d = (levels.axis == D)[:, None]
    return np.where(on_d, np.column_stack([dd, dq]), np.column_stack([dq, qq]))


@kernel
def _predict(m, resistance, threshold, width, error, theta, gain, offset, waveform, psi, current, h, out):
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
        u_d, u_q, status = periodic(m, resistance, threshold, width, angle, v, h, i_d, i_q, ripple)
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
        error = np.ascontiguousarray(p[15:][self.locks])
        width = self.width * math.exp(min(max(p[14], -5.0), 5.0))
        status = _predict(
            m, p[0], p[8], width, error, lv.theta, gain, offset, lv.waveform, lv.flux, lv.current, lv.period, out
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
    prior = np.concatenate([[np.inf], 3 * [gain], 2 * [offset], [WIDTH_SD], len(angles) * [ANGLE_SD]])
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
    return _finish(levels, free, *_reweighted(levels, free, *best))


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
            f"the levels give R = {r:.3g} ohm, L_d = {l_d:.3g} H, L_q = {l_q:.3g} H, which must be > 0: currents do not "
            "follow the voltages; check the order of the phases and the signs"
        )
    e = nominal.energy
    alphas = [np.array(e[2:])]
    try:
        alphas.append(first_order_estimate(levels, levels.slope)[2:])
    except BadInput:  # no level at zero current: the exact fit does not need one
        pass
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
        if moved < 1e-9 or gained < 1e-9 * (new @ new) and damping <= 1e-6:
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
    left = r[bias : bias + 2 * int(rows.sum())].reshape(-1, 2) * levels.slope_sd[rows] * problem.inflate[1] * peak
    nuisance = {"voltage_threshold": float(p[8]), "gain_a": float(p[9]), "gain_b": float(p[10])}
    nuisance |= {
        "gain_c": float(p[11]),
        "offset_a": float(p[12]),
        "offset_b": float(p[13]),
        "width": problem.width * math.exp(p[14]),
    }
    nuisance |= {"angle_error": float(np.mean(p[15:]))}
    names = NAMES + tuple(k for k, f in zip([*nuisance][:-1], free[8:15], strict=True) if f)
    names += tuple(f"angle_{k}" for k in range(int(free[15:].sum())))
    return Fit(
        "exact", names, dict(zip(NAMES, p[:8].tolist(), strict=True)), covariance,
        float(np.sqrt(np.mean(left**2))), misfit, nuisance,
    )  # fmt: skip
