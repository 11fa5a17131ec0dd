"""What injection sees: cross-saturation angle, saliency, and where in the current plane the model
is valid.

A pulsating voltage along the estimated d axis makes a ripple along the estimated q axis
proportional to
  y_q(e) = 1/2 (Gamma_dd - Gamma_qq) sin 2e + Gamma_dq cos 2e,     e = theta - theta_hat,
with Gamma the Hessian at the actual rotor-frame current.  A q-null estimator stands where y_q = 0
with the slope of the unsaturated motor; that zero is the cross-saturation error, 1/2 atan(2 L_dq /
(L_qq - L_dd)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from model.array_types import Array
from model.compiled import kernel
from model.energy import (
    AnyEnergy,
    boundary_on_ray,
    flux_from_current,
    flux_newton,
    hessian,
    is_convex_to,
    min_eigenvalue,
)
from model.energy import torque as torque_of
from model.errors import BadInput, PhysicsError
from model.parameters import Motor

LEAST_SALIENCY = 0.01  # relative difference of L_d and L_q below which injection finds nothing


@kernel
def null_angle(dd, dq, qq, sign):
    """Return the error e (rad) at which the q ripple vanishes with a slope of the given sign (+1
    or -1)."""
    return 0.5 * math.atan2(-2.0 * sign * dq, sign * (dd - qq))


@kernel
def ripple(dd, dq, qq, e):
    """Return the ripple (y_d, y_q) in 1/H per unit flux ripple along the estimated d axis, at error
    e (rad)."""
    c = math.cos(e)
    s = math.sin(e)
    # current ripple in the rotor frame, where the injection is (cos e, -sin e)
    r_d = dd * c - dq * s
    r_q = dq * c - qq * s
    return c * r_d - s * r_q, s * r_d + c * r_q


def tracking_sign(m: AnyEnergy) -> float:
    """Return the sign of L_q - L_d at zero current: the sense in which a q-null loop must turn;
    BadInput where there is no saliency."""
    if abs(m.gamma_d - m.gamma_q) < LEAST_SALIENCY * max(m.gamma_d, m.gamma_q):
        raise BadInput(
            f"inductance_d = {1 / m.gamma_d:.4g} H and inductance_q = {1 / m.gamma_q:.4g} H: no "
            f"saliency at zero current (less than {LEAST_SALIENCY:.0%}), so injection cannot find "
            "the rotor; use a motor whose L_d and L_q differ"
        )
    return 1.0 if m.gamma_d > m.gamma_q else -1.0


def null_turned(
    m: AnyEnergy, i_d: float, i_q: float, points: int = 60
) -> tuple[float, float] | None:
    """Return the current (A) on the straight way from zero to (i_d, i_q) at which L_qq - L_dd loses
    the sign it has at zero current, and the saliency left there, sqrt((G_dd - G_qq)^2 + 4 G_dq^2)
    over that at zero current.

    The null of the q ripple stands 45 degrees beside d there.  None where the sign is kept, or the
    model ends before.
    """
    sign, d, q = math.copysign(1.0, m.gamma_d - m.gamma_q), 0.0, 0.0
    for share in np.linspace(0.0, 1.0, points + 1)[1:]:
        d, q, status = flux_newton(m, float(share * i_d), float(share * i_q), d, q)
        if status or not is_convex_to(m, d, q):
            return None
        dd, dq, qq = hessian(m, d, q)
        if sign * (dd - qq) <= 0.0:
            left = math.hypot(dd - qq, 2.0 * dq) / abs(m.gamma_d - m.gamma_q)
            return float(share * math.hypot(i_d, i_q)), left
    return None


def local_angle(m: AnyEnergy, i_d: ArrayLike, i_q: ArrayLike) -> Array:
    """Return the cross-saturation angle e (rad) for actual rotor-frame currents in A (encoder
    controls)."""
    dd, dq, qq = hessian.py_func(m, *flux_from_current(m, i_d, i_q))
    s = tracking_sign(m)
    return np.asarray(0.5 * np.arctan2(-2.0 * s * dq, s * (dd - qq)))


def known_null_ends(m: AnyEnergy, i_d: float, i_q: float, points: int = 60) -> float | None:
    """Return the current (A) on the straight way from zero to (i_d, i_q) from which a q-null loop
    that takes the null's own angle at these currents into account finds no way back; None where it
    always does, or the model ends before.

    An error of the estimate turns the actual current, too. Where that turns the null further than
    the error is, the ripple across it has the wrong sign, however well the loop knows the motor.
    """
    sign, d, q, h = tracking_sign(m), 0.0, 0.0, 1e-4
    for share in np.linspace(0.0, 1.0, points + 1)[1:]:
        x, y = float(share * i_d), float(share * i_q)
        d, q, status = flux_newton(m, x, y, d, q)
        if status or not is_convex_to(m, d, q):
            return None
        null = null_angle(*hessian(m, d, q), sign)
        if sign * (_q_ripple(m, x, y, h, null) - _q_ripple(m, x, y, -h, null)) <= 0.0:
            return float(share * math.hypot(i_d, i_q))
    return None


def _q_ripple(m: AnyEnergy, i_d: float, i_q: float, e: float, offset: float = 0.0) -> float:
    """Return y_q where the reference (i_d, i_q) is applied in the frame that is estimated e off,
    and the injection so much (rad) beside its d; NaN outside the domain."""
    a, b = math.cos(e) * i_d + math.sin(e) * i_q, -math.sin(e) * i_d + math.cos(e) * i_q
    d, q, status = flux_newton(m, a, b, 0.0, 0.0)
    return math.nan if status else float(ripple.py_func(*hessian(m, d, q), e + offset)[1])


def self_consistent_angle(m: AnyEnergy, i_d: float, i_q: float, steps: int = 60) -> float:
    """Return e (rad) at which a q-null loop stands that also orients the current reference (i_d,
    i_q) A.

    The actual current is R(-e) times the reference, which moves the null: the zero is followed from
    zero current, NaN once it has vanished in a fold or lost its slope (no lock).
    """
    sign, e, h = tracking_sign(m), 0.0, 1e-5
    for s in np.linspace(0.0, 1.0, steps + 1)[1:]:
        x, y = float(s * i_d), float(s * i_q)
        for _ in range(20):
            slope = (_q_ripple(m, x, y, e + h) - _q_ripple(m, x, y, e - h)) / (2 * h)
            step = -_q_ripple(m, x, y, e) / slope if slope else math.nan
            if not (sign * slope > 0 and abs(step) < 0.3):
                return math.nan
            e += step
            if abs(step) < 1e-12:
                break
    return e


def current_for_torque(
    motor: Motor, torque: float, closed_loop: bool, steps: int = 40
) -> tuple[float, float]:
    """Return (i_q reference in A, error e in rad) at which a q-null drive with i_d reference 0
    gives a torque.

    Closed: the current is oriented by the erroneous estimate; open: by the encoder.  Raises
    PhysicsError where the torque (N m) is out of reach within six times rated current or lock is
    lost on the way.
    """
    from scipy.optimize import brentq

    m = motor.energy

    def at(i_q: float) -> tuple[float, float]:
        """Return the angle error (rad) and the torque (N m) where i_q (A) is asked for."""
        if i_q == 0.0:
            return 0.0, 0.0
        e = (
            self_consistent_angle(m, 0.0, i_q, 20)
            if closed_loop
            else float(local_angle(m, 0.0, i_q))
        )
        a = e if closed_loop else 0.0
        d, q = flux_from_current(m, math.sin(a) * i_q, math.cos(a) * i_q)
        return e, float(torque_of.py_func(m, d, q, motor.magnet_flux, motor.pole_pairs))

    previous = 0.0
    for i_q in (
        np.linspace(0.0, 6.0, steps + 1)[1:] * motor.rated_current * (1.0 if torque >= 0 else -1.0)
    ):
        e, t = at(float(i_q))
        if math.isnan(e):
            break
        if abs(t) >= abs(torque):
            root = (
                brentq(lambda x: at(x)[1] - torque, previous, float(i_q), xtol=1e-9)
                if torque
                else 0.0
            )
            return float(root), at(float(root))[0]
        previous = float(i_q)
    raise PhysicsError(
        f"torque {torque:.4g} N m is out of reach for motor '{motor.name}' (tried up to "
        f"i_q = {previous:.3g} A with "
        f"{'the estimate' if closed_loop else 'the encoder'} controlling); lower the load"
    )


@dataclass(frozen=True, repr=False)
class Audit:
    """Where a motor's model may be used; currents A, eigenvalues 1/H, angles rad over `load` (of
    rated i_q).

    valid_radius: up to which the model is convex (the audited radius where all of it is);
    saliency_radius: up to which L_qq - L_dd keeps its sign, so that q-null injection is feasible,
    likewise; slope: of the null, relative to zero current; grid_eigenvalue: over (i_q, i_d) of
    `grid`, NaN outside the domain.
    """

    motor: str
    rated_current: float
    radius: float
    valid_radius: float
    min_eigenvalue: float | None
    worst_current: tuple[float, float]
    violations: tuple[dict[str, float], ...]
    saliency_radius: float
    load: Array
    angle_local: Array
    angle_closed: Array
    slope: Array
    grid: Array
    grid_eigenvalue: Array

    def __repr__(self) -> str:
        return (
            f"<Audit: {self.motor}, valid up to {self.valid_radius:.4g} A of {self.radius:.4g} A>"
        )

    @property
    def passed(self) -> bool:
        """True where the energy is strictly convex over the whole disc of the audited radius."""
        return not self.violations


def audit(motor: Motor, radius: float | None = None, rays: int = 72, points: int = 60) -> Audit:
    """Audit the disc of a radius (A; default 180 % of rated current) in the plane of currents."""
    radius = 1.8 * motor.rated_current if radius is None else radius
    m = motor.energy
    violations, least, worst, lost = [], math.inf, (0.0, 0.0), math.inf
    sign = math.copysign(1.0, m.gamma_d - m.gamma_q)
    for angle in np.arange(rays) * 2.0 * np.pi / rays:
        d = q = 0.0
        for r in np.linspace(0.0, radius, points + 1):
            x, y = float(r * np.cos(angle)), float(r * np.sin(angle))
            d, q, status = flux_newton(m, x, y, d, q)
            if status or not is_convex_to(m, d, q):
                b_d, b_q, value = boundary_on_ray(m, x, y)
                violations.append({"i_d": b_d, "i_q": b_q, "eigenvalue": value})
                break
            dd, dq, qq = hessian(m, d, q)
            value = float(min_eigenvalue(dd, dq, qq))
            if value < least:
                least, worst = value, (x, y)
            if sign * (dd - qq) <= 0:
                lost = min(lost, float(r))
    if violations:
        v = min(violations, key=lambda p: math.hypot(p["i_d"], p["i_q"]))
        least, worst = v["eigenvalue"], (v["i_d"], v["i_q"])
    load = np.linspace(-1.8, 1.8, 37)
    local, closed, slope = _angles(motor, load)
    grid = np.linspace(-radius, radius, 61)
    return Audit(
        motor.name,
        motor.rated_current,
        radius,
        math.hypot(*worst) if violations else radius,
        least,
        worst,
        tuple(sorted(violations, key=lambda p: math.hypot(p["i_d"], p["i_q"]))),
        min(lost, radius),
        load,
        local,
        closed,
        slope,
        grid,
        _eigenvalues(m, grid),
    )


def _eigenvalues(m: AnyEnergy, grid: Array) -> Array:
    """Return the smallest eigenvalue over the plane of currents (i_q, i_d), NaN where there is no
    valid point."""
    values = np.full((grid.size, grid.size), np.nan)
    for (row, y), (column, x) in product(enumerate(grid), enumerate(grid)):
        d, q, status = flux_newton(m, x, y, 0.0, 0.0)
        if not status and is_convex_to(m, d, q):
            values[row, column] = min_eigenvalue(*hessian(m, d, q))
    return values


def _angles(motor: Motor, load: Array) -> tuple[Array, Array, Array]:
    """Return local and self-consistent angle and relative slope of the null, NaN where there is
    none."""
    m, n = motor.energy, load.size
    local, closed, slope = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    for k, i_q in enumerate(load * motor.rated_current):
        try:
            d, q = flux_from_current(m, 0.0, i_q)
            local[k], closed[k] = (
                local_angle(m, 0.0, i_q),
                self_consistent_angle(m, 0.0, float(i_q)),
            )
        except (BadInput, PhysicsError):
            continue
        dd, dq, qq = hessian.py_func(m, d, q)
        slope[k] = np.hypot(dd - qq, 2 * dq) / abs(m.gamma_d - m.gamma_q)
    return local, closed, slope
