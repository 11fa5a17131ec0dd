"""Maps over the current plane: incremental inductances, cross-saturation angle and gain, exact and
to first order."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from model.array_types import Array
from model.energy import Energy, flux_newton, hessian, is_convex_to
from model.errors import BadInput
from model.first_order import inductances as first_inductances
from model.mapped import held_by_data
from model.parameters import Motor
from model.saliency import tracking_sign


@dataclass(frozen=True, repr=False)
class Maps:
    """Arrays (n, n) over i_d (first axis) and i_q, NaN where the model is not valid.

    inductances in H; angle: cross-saturation error e of a q-null estimator, rad; gain: slope of its
    null relative to zero current.  `first_order` holds the same by the paper's formulas, NaN for a
    motor without alphas.
    """

    motor: str
    rated_current: float  # A
    i_d: Array  # (n,) A
    i_q: Array
    l_dd: Array
    l_dq: Array
    l_qq: Array
    angle: Array
    gain: Array
    first_order: dict[str, Array]

    def __repr__(self) -> str:
        return (
            f"<Maps: {self.motor}, {self.i_d.size} x {self.i_q.size} currents up to "
            f"{self.i_d[-1]:.4g} A>"
        )

    def arrays(self) -> dict[str, Array]:
        """Return everything by name, as written to an .npz; first-order maps carry the prefix
        `first_`."""
        names = ("i_d", "i_q", "l_dd", "l_dq", "l_qq", "angle", "gain")
        return {n: getattr(self, n) for n in names} | {
            f"first_{k}": v for k, v in self.first_order.items()
        }

    def shown(self) -> list[tuple[str, str, float, Array]]:
        """Return name, unit a person reads, factor to it and values of each map."""
        mh = [(name, "mH", 1e3, getattr(self, name)) for name in ("l_dd", "l_dq", "l_qq")]
        return [*mh, ("angle", "°", 180.0 / math.pi, self.angle), ("gain", "", 1.0, self.gain)]

    def at(self, values: Array, i_q: float) -> float:
        """Return a map's value at i_d = 0 (or nearest to it) and a current i_q (A); NaN outside
        plane or domain."""
        if abs(i_q) > self.i_q[-1] * (1.0 + 1e-9):
            return math.nan
        return float(np.interp(i_q, self.i_q, values[int(np.argmin(np.abs(self.i_d)))]))

    def summary(self) -> dict[str, float | None]:
        """Return the share of valid points and the largest errors of first order (H, rad) over
        them."""
        valid = np.isfinite(self.l_dd)
        out: dict[str, float | None] = {"valid_share": float(valid.mean())}
        for name in ("l_dd", "l_dq", "l_qq", "angle"):
            error = np.abs(self.first_order[name] - getattr(self, name))[valid]
            out[f"first_order_error_{name}"] = (
                float(error.max()) if np.isfinite(error).any() else None
            )
        return out


def maps(motor: Motor, radius: float | None = None, points: int = 61) -> Maps:
    """Return the maps on a square of half-width `radius` (A; default 180 % of rated current),
    `points` a side; BadInput for a radius or a number of points that is none."""
    radius = 1.8 * motor.rated_current if radius is None else radius
    if not (math.isfinite(radius) and radius > 0) or points < 3:
        raise BadInput(
            f"radius = {radius} A, points = {points}; give a radius > 0 and at least 3 "
            "points a side"
        )
    m, sign = motor.energy, tracking_sign(motor.energy)
    i = np.linspace(-radius, radius, points)
    x, y = np.meshgrid(i, i, indexing="ij")
    gamma = np.full((3, points, points), np.nan)
    held = held_by_data(motor, x, y)
    for k in np.ndindex(x.shape):
        if not held[k]:
            continue
        d, q, outside = flux_newton(m, float(x[k]), float(y[k]), 0.0, 0.0)
        if not outside and is_convex_to(m, d, q):
            gamma[(slice(None), *k)] = hessian(m, d, q)
    dd, dq, qq = gamma
    det = dd * qq - dq * dq
    zero = abs(m.gamma_d - m.gamma_q)
    if isinstance(m, Energy):
        f_dd, f_dq, f_qq = first_inductances(m, x, y)
    else:  # a flux map has no alphas
        f_dd, f_dq, f_qq = np.full((3, *x.shape), np.nan)
    f_det = f_dd * f_qq - f_dq**2
    first = {"l_dd": f_dd, "l_dq": f_dq, "l_qq": f_qq}
    first["angle"] = 0.5 * np.arctan2(2 * sign * f_dq, sign * (f_qq - f_dd))
    first["gain"] = np.hypot(f_qq - f_dd, 2 * f_dq) / np.abs(f_det) / zero
    angle, gain = (
        0.5 * np.arctan2(-2 * sign * dq, sign * (dd - qq)),
        np.hypot(dd - qq, 2 * dq) / zero,
    )
    return Maps(
        motor.name, motor.rated_current, i, i, qq / det, -dq / det, dd / det, angle, gain, first
    )
