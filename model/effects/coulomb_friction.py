"""Dry friction, with Stribeck's hump, and with bristles that bend before it slides."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import angle, on_q, quantity
from model.effects.shaft_compliance import motor_inertia
from model.lanes import fading
from model.parameters import Converter, Motor

# a sampling period: steps that resolve more would be too short
STEEPEST = 100.0
# of rated speed: where dry friction changes its sign, as in a log of motion alone
# (`sandbox.gap.motion.shaft`), and where Stribeck's hump ends: beyond the width, or nobody sees
# it; 1.6 and 6.3 rad/s of a servo for 3000 rpm
WIDTH, HUMP = 0.005, 0.02
# standard deviation of their logarithms: 0.1 to 4 % of rated speed, 0.3 to 15 %
SPREAD = 1.0
LEAST = 1e-9  # of the largest torque: what bristles slide at, at least
# of the time in which friction brings the rotor to rest within its width, in one step
LARGEST_RUB = 0.5
# rad of a rotor's swing on bristles, in one step: the plant's steps let a swing without damping
# grow by x^3/8 of itself a radian, 1.6e-5
LARGEST_SWING = 0.05
# rad: a bend to begin from, and the standard deviation of its logarithm: asperities of bearings
# give by some micrometres at radii of millimetres, grease, seals and gears by ten times that
BENT, BENT_SPREAD = 3e-3, 1.5
# likewise the damping ratio of a rotor that swings on bristles: from none that shows to 1; 0.5 is
# what simulations usually take (sigma_1 = sqrt(sigma_0 J))
STUCK = 0.1

SLIDING = ("torque", "width", "stribeck_torque", "stribeck_speed")


@inlined
def drag(torque, width, stribeck_torque, stribeck_speed, presliding, omega_mech):
    """Return the torque (N m) against a mechanical speed (rad/s), of friction without bristles."""
    if presliding > 0.0:
        return 0.0
    return sliding(torque, width, stribeck_torque, stribeck_speed, omega_mech)


@inlined
def sliding(torque, width, stribeck_torque, stribeck_speed, omega_mech):
    """Return the torque (N m) of friction that slides at any speed (rad/s, mechanical)."""
    slow = omega_mech / stribeck_speed
    level = torque + stribeck_torque * fading(-slow * slow)
    e = fading(-2.0 * abs(omega_mech) / width)
    size = level * (1.0 - e) / (1.0 + e)  # tanh
    return size if omega_mech >= 0.0 else -size


@inlined
def bristles(
    torque, width, stribeck_torque, stribeck_speed, presliding, presliding_damping, omega, inertia
):
    """Return of bristles their stiffness (N m/rad), damping (N m s/rad), the torque (N m) at which
    they slide at a mechanical speed (rad/s), and the one with which they begin there."""
    most = torque + stribeck_torque
    if not (presliding > 0.0 and most > 0.0):
        return 0.0, 0.0, 0.0, 0.0
    slow = omega / stribeck_speed
    level = max(torque + stribeck_torque * fading(-slow * slow), LEAST * most)
    stiffness = most / presliding
    damping = 2.0 * presliding_damping * math.sqrt(stiffness * inertia)
    begun = sliding(torque, width, stribeck_torque, stribeck_speed, omega)
    return stiffness, damping, level, begun


def rate(v: Mapping[str, float]) -> float:
    """Return how fast dry friction pulls a free rotor to rest within its width, 1/s; one on
    bristles, how fast it swings (rad/s)."""
    inertia, bent = motor_inertia(v), v["coulomb_friction.presliding"]
    level = v["coulomb_friction.torque"] + v["coulomb_friction.stribeck_torque"]
    if not inertia > 0.0:
        return 0.0
    if bent:
        return math.sqrt(level / (bent * inertia))
    return level / (v["coulomb_friction.width"] * inertia)


def longest(v: Mapping[str, float], motor: Motor, omega: float) -> float:
    """Return the longest step (s) of a closed loop: of bristles, also one in which the speed stays
    on Stribeck's hump."""
    if not v["coulomb_friction.presliding"]:
        return LARGEST_RUB / rate(v)
    inertia, hump = motor_inertia(v), v["coulomb_friction.stribeck_torque"]
    level = hump + v["coulomb_friction.torque"]
    step = LARGEST_SWING / rate(v)
    across = v["coulomb_friction.stribeck_speed"] * inertia / level
    return min(step, LARGEST_RUB * across) if hump else step


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how steep friction may be at standstill."""
    bent = v["coulomb_friction.presliding"] > 0.0
    name, more = ("presliding", "a larger one") if bent else ("width", "a wider one")
    form = "swing on bristles (rad/s)" if bent else "1/s, torque over width and inertia"
    most = STEEPEST * (LARGEST_SWING / LARGEST_RUB if bent else 1.0)
    what = f"{form}: the steps that resolve it would be too short (give {more})"
    yield Limit(f"coulomb_friction.{name}", rate(v), most / converter.sampling_period, what)


def otherwise(
    v: Mapping[str, float], width: float, motor: Motor, converter: Converter
) -> dict[str, float]:
    """Return bristles in place of none, or none in place of some."""
    bent, ratio = (0.0, 0.0) if v["coulomb_friction.presliding"] else (BENT, STUCK)
    return {"coulomb_friction.presliding": bent, "coulomb_friction.presliding_damping": ratio}


def idle(v: Mapping[str, float]) -> tuple[str, ...]:
    """Return what means nothing: beside bristles the width, but where a rotor turns at first."""
    return ("width",) if v["coulomb_friction.presliding"] else ()


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    torque, more = v["coulomb_friction.torque"], v["coulomb_friction.stribeck_torque"]
    slow = ""
    if more:
        slow = (
            f", and {quantity(more, 'N m')} more well below "
            f"{quantity(v['coulomb_friction.stribeck_speed'], 'rad/s')}"
        )
    stuck = v["coulomb_friction.presliding"]
    if stuck:
        slow += (
            f"; at rest the shaft gives by up to {quantity(stuck, 'rad')} ({angle(stuck)}) like a "
            "spring before it breaks away"
        )
    return (
        f"add {quantity(torque, 'N m')}{on_q(torque, motor)} to the torque's reference "
        f"in the sense of rotation{slow}; "
        "much more than on the first day: look at bearings, brake and seals"
    )


CARD = Effect(
    name="coulomb_friction",
    summary="dry friction, with Stribeck's hump, with or without presliding",
    subsystem="mechanics",
    equation=(
        "torque [T_c + T_s exp(-(w/w_s)^2)] tanh(w/width) against the motion, w "
        "mechanical, on the motor's side. With presliding it is that of bristles: s_0 z + s_1 "
        "dz/dt, dz/dt = w - s_0 |w| z/g, g = T_c + T_s exp(-(w/w_s)^2), s_0 = (T_c + "
        "T_s)/presliding, s_1 = 2 zeta sqrt(s_0 J)"
    ),
    formulas=(
        r"T \;\text{-=}\; g(w) \,\tanh\,\frac{w}{w_0}, \qquad g(w) = T_c + T_s\,e^{-(w / w_s)^2}",
        r"T \;\text{-=}\; \sigma_0\,z + \sigma_1\,\frac{d z}{d t}, \qquad \frac{d z}{d t} = w - "
        r"\sigma_0\,\frac{|w|}{g(w)}\,z, \qquad \sigma_0 = \frac{T_c + T_s}{z_0}, \qquad "
        r"\sigma_1 = 2\zeta\sqrt{\sigma_0 J}",
    ),
    source=(
        "Armstrong-Helouvry, Dupont, Canudas de Wit, A survey of models, analysis tools and "
        "compensation methods for the control of machines with friction, Automatica 30 (1994) "
        "1083; Canudas de Wit, Olsson, Astrom, Lischinsky, A new model for control of systems "
        "with friction, IEEE Trans. Autom. Control 40 (1995) 419 (bristles)"
    ),
    parameters=(
        Parameter(
            "torque", "N m", 0.0, 0.0, 1e5, 0.03, "rated torque", title="dry friction torque"
        ),
        Parameter(
            "width",
            "rad/s",
            WIDTH,
            1e-6,
            1e3,
            WIDTH,
            "rated speed",
            fit="log",
            spread=SPREAD,
            starts=(0.25, 1.0, 4.0),
            title="speed width of dry friction",
            neutral_relative_to="rated speed",
        ),
        Parameter(
            "stribeck_torque",
            "N m",
            0.0,
            0.0,
            1e5,
            0.0,
            "rated torque",
            change=0.01,
            title="Stribeck torque",
        ),
        Parameter(
            "stribeck_speed",
            "rad/s",
            HUMP,
            1e-6,
            1e3,
            HUMP,
            "rated speed",
            fit="log",
            spread=SPREAD,
            title="Stribeck speed",
            neutral_relative_to="rated speed",
        ),
        Parameter(
            "presliding",
            "rad",
            0.0,
            0.0,
            1.0,
            0.0,
            change=BENT,
            fit="log",
            spread=BENT_SPREAD,
            title="angle by which bristles bend before they slide",
        ),
        Parameter(
            "presliding_damping",
            "",
            0.0,
            0.0,
            1.0,
            0.0,
            change=STUCK,
            fit="log",
            spread=BENT_SPREAD,
            title="damping ratio of a rotor on bristles",
        ),
    ),
    axis="motion (and i_q under speed control)",
    order="0",
    region="free rotor: constant drag, steps at reversals",
    confused_with=("viscous_friction", "inertia", "cogging_torque"),
    separated_by="coasting down to standstill: straight line against exponential; reversal",
    at=(
        At("friction", drag, (*SLIDING, "presliding")),
        At("bristles", bristles, (*SLIDING, "presliding", "presliding_damping"), ("presliding",)),
    ),
    switches=("torque", "stribeck_torque"),
    limits=limits,
    longest=longest,
    otherwise=otherwise,
    idle=idle,
    do=do,
)
