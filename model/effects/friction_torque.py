"""Friction against the speed, as a free curve: for friction that is neither dry nor viscous.

The curve is odd, a sum of torques that saturate: each goes straight through zero and is constant
beyond its corner.  Corners come in steps of 2.5, from a hundredth of a speed of reference to 2.5
times it.  So dry friction and a viscous one are each mostly one term; Stribeck's hump, a fan and
lubrication that thins are sums of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from model.array_types import Array
from model.compiled import inlined
from model.effects.card import At, Curve, Effect, Limit, Parameter
from model.effects.coulomb_friction import LARGEST_RUB, STEEPEST
from model.effects.said import on_q, quantity
from model.effects.shaft_compliance import motor_inertia
from model.parameters import Converter, Motor

# of the speed of reference
CORNERS = (0.01, 0.025, 0.064, 0.16, 0.4, 1.0, 2.5)
# of rated torque: a term in a diagnosis, and one of a run with typical terms
USUAL, TYPICAL = 0.03, 0.005
TORQUES = tuple(f"t_{k + 1}" for k in range(len(CORNERS)))


@inlined
def drag(t_1, t_2, t_3, t_4, t_5, t_6, t_7, reference, omega_mech):
    """Return the torque (N m) against a mechanical speed (rad/s)."""
    x = abs(omega_mech) / max(reference, 1e-30)
    size = (
        t_1 * min(100.0 * x, 1.0)
        + t_2 * min(40.0 * x, 1.0)
        + t_3 * min(15.625 * x, 1.0)
        + t_4 * min(6.25 * x, 1.0)
        + t_5 * min(2.5 * x, 1.0)
        + t_6 * min(x, 1.0)
        + t_7 * min(0.4 * x, 1.0)
    )
    return size if omega_mech >= 0.0 else -size


def reference(v: Mapping[str, float], motor: Motor) -> float:
    """Return the speed of reference (rad/s, mechanical), by completed values."""
    return v["friction_torque.reference"] or motor.rated_omega / motor.pole_pairs


def places(v: Mapping[str, float], motor: Motor) -> Array:
    """Return the speeds (rad/s) at which the curve is shown: its corners, and 0."""
    return np.append(0.0, reference(v, motor) * np.array(CORNERS))


def curve(v: Mapping[str, float], motor: Motor, converter: Converter, speed: Array) -> Array:
    """Return the friction's torque (N m, any shape) at mechanical speeds (rad/s), by completed
    values."""
    x = np.asarray(speed, dtype=float) / reference(v, motor)
    torques = [v[f"friction_torque.{n}"] for n in TORQUES]
    return np.asarray(
        sum(t * np.clip(x / c, -1.0, 1.0) for t, c in zip(torques, CORNERS, strict=True))
    )


def rate(v: Mapping[str, float], motor: Motor) -> float:
    """Return how fast the curve pulls a slow free rotor to rest, 1/s."""
    steep = sum(v[f"friction_torque.{n}"] / c for n, c in zip(TORQUES, CORNERS, strict=True))
    inertia = motor_inertia(v) * reference(v, motor)
    return max(0.0, steep) / inertia if inertia > 0.0 else 0.0


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how steep friction may be at standstill."""
    what = (
        "1/s, the curve's slope at standstill over the inertia: the steps that resolve it would be "
        "too short (give a higher speed of reference)"
    )
    steepest = STEEPEST / converter.sampling_period
    yield Limit("friction_torque.reference", rate(v, motor), steepest, what)


def longest(v: Mapping[str, float], motor: Motor, omega: float) -> float:
    """Return the longest step (s) of a closed loop."""
    fast = rate(v, motor)
    return LARGEST_RUB / fast if fast > 0.0 else math.inf


def said(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what dry and viscous friction make of the curve up to rated speed, as least squares
    fit them."""
    w = reference(v, motor) * np.linspace(0.02, 1.0, 50)
    torque = curve(v, motor, converter, w)
    forms = np.stack([np.ones_like(w), w], axis=1)
    (dry, viscous), *_ = np.linalg.lstsq(forms, torque, rcond=None)
    left = torque - forms @ (dry, viscous)
    share = 1.0 - float(left @ left) / max(float(torque @ torque), 1e-300)
    return (
        f"Dry friction of {quantity(dry, 'N m')} and {quantity(viscous, 'N m s/rad')} of a viscous "
        f"one explain {100.0 * share:.3g} % of it (of squares, up to the speed of reference)."
    )


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    speeds = places(v, motor)[1:]
    points = [
        f"[{w:.3g}, {t:.3g}]"
        for w, t in zip(speeds, curve(v, motor, converter, speeds), strict=True)
    ]
    most = float(np.max(np.abs(curve(v, motor, converter, speeds))))
    return (
        f"add this curve (rad/s, N m: {', '.join(points)}) to the torque's reference in the sense "
        f"of rotation{on_q(most, motor)} at most; far from the first day's: look at bearings, "
        "seals and fan"
    )


CARD = Effect(
    name="friction_torque",
    summary="friction against the speed, as a free curve",
    subsystem="mechanics",
    equation=(
        "torque sum of t_k clip(w/(c_k w_0)) against the motion, corners c_k = 0.01, 0.025, 0.064, "
        "0.16, 0.4, 1, 2.5 of a speed of reference w_0: odd, straight between corners, constant "
        "beyond the last; beside the other frictions"
    ),
    formulas=(
        r"T \;\text{-=}\; \sum_{k=1}^{7} t_k\,\operatorname{clip}\frac{w_\text{mech}}{c_k\,w_0}",
    ),
    source=(
        "measured curves of this kind: Armstrong-Helouvry, Dupont, Canudas de Wit, A survey of "
        "models, analysis tools and compensation methods for the control of machines with "
        "friction, Automatica 30 (1994) 1083"
    ),
    parameters=(
        *(
            Parameter(
                n,
                "N m",
                0.0,
                -1e5,
                1e5,
                TYPICAL,
                "rated torque",
                change=USUAL,
                title=f"torque that saturates at {c:g} of the reference",
            )
            for n, c in zip(TORQUES, CORNERS, strict=True)
        ),
        Parameter(
            "reference",
            "rad/s",
            0.0,
            0.0,
            1e6,
            1.0,
            "rated speed",
            fit="fixed",
            title="speed of reference of the curve (0: rated speed)",
        ),
    ),
    axis="motion (and i_q under speed control)",
    order="0",
    region="free rotor, wherever the curve bends",
    confused_with=("coulomb_friction", "viscous_friction", "iron_loss"),
    separated_by=(
        "dry and viscous friction are points of it: they are named where their form explains as "
        "much; coasting down from the highest speed in both directions shows the curve"
    ),
    at=(At("friction", drag, (*TORQUES, "reference")),),
    switches=TORQUES,
    limits=limits,
    longest=longest,
    do=do,
    free=True,
    curve=Curve("speed", "rad/s", "friction's torque", "N m", places, curve, said),
)
