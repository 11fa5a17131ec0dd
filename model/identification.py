"""The paper's identification (section III): eqs. (LdLq) to (saturation4q), small linear least
squares, as printed.

First-order formulas, so biased at rated currents even on perfect data (experiments/results holds
the table); `model.exact_fit` is the unbiased one.  Checked: planted data that obey the first-order
formulas are recovered exactly, the bias on exact data, the printed uncertainties (tests/model,
experiments).
"""

from __future__ import annotations

import math

import numpy as np

from model.array_types import Array
from model.errors import BadInput
from model.levels import NAMES, NONE, D, Fit, Levels, Q, require_information, resistance_of


def first_order_estimate(levels: Levels, slope: Array) -> Array:
    """Return L_d, L_q and the five alphas (in NAMES' order) by the paper's split least squares, as
    printed; slope: (levels, 2), 1/H. BadInput where an axis has no level at zero current."""
    i_d, i_q = levels.current.T
    zero_d, zero_q = levels.pick(D, None), levels.pick(Q, None)
    for rows, axis in ((zero_d, "d"), (zero_q, "q")):
        if rows.size == 0:
            raise BadInput(
                f"no level at zero current with injection on {axis}: eq. (LdLq) cannot give "
                f"inductance_{axis}; record one"
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
    """Fit by the paper's method; `current_uncertainty` (A, one standard deviation on the ripple's
    peak) if given.

    Errors of the levels are taken as independent and propagated through the whole estimate, its L
    included.
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
    return Fit(
        "first_order",
        NAMES,
        values,
        covariance,
        float(np.sqrt(np.mean(left[rows] ** 2))),
        math.nan,
        {},
        left,
    )


def sensitivity(levels: Levels) -> Array:
    """Return the derivatives (7, 2n) of the first-order estimate by every slope, by central
    differences."""
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
