"""Dry friction, with Stribeck's hump."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import on_q, quantity
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
# of the time in which friction brings the rotor to rest within its width, in one step
LARGEST_RUB = 0.5


@inlined
def drag(torque, width, stribeck_torque, stribeck_speed, omega_mech):
    """Return the torque (N m) against a mechanical speed (rad/s)."""
    slow = omega_mech / stribeck_speed
    level = torque + stribeck_torque * fading(-slow * slow)
    e = fading(-2.0 * abs(omega_mech) / width)
    size = level * (1.0 - e) / (1.0 + e)  # tanh
    return size if omega_mech >= 0.0 else -size


def rate(v: Mapping[str, float]) -> float:
    """Return how fast dry friction pulls a free rotor to rest within its width, 1/s."""
    level = v["coulomb_friction.torque"] + v["coulomb_friction.stribeck_torque"]
    return (
        level / (v["coulomb_friction.width"] * motor_inertia(v)) if motor_inertia(v) > 0.0 else 0.0
    )


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how steep friction may be at standstill."""
    what = (
        "1/s, torque over width and inertia: the steps that resolve it would be too short "
        "(give a wider one)"
    )
    yield Limit("coulomb_friction.width", rate(v), STEEPEST / converter.sampling_period, what)


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    torque, more = v["coulomb_friction.torque"], v["coulomb_friction.stribeck_torque"]
    slow = ""
    if more:
        slow = (
            f", and {quantity(more, 'N m')} more well below "
            f"{quantity(v['coulomb_friction.stribeck_speed'], 'rad/s')}"
        )
    return (
        f"add {quantity(torque, 'N m')}{on_q(torque, motor)} to the torque's reference "
        f"in the sense of rotation{slow}; "
        "much more than on the first day: look at bearings, brake and seals"
    )


CARD = Effect(
    name="coulomb_friction",
    summary="dry friction, with Stribeck's hump",
    subsystem="mechanics",
    equation=(
        "torque [T_c + T_s exp(-(w/w_s)^2)] tanh(w/width) against the motion, w "
        "mechanical, on the motor's side"
    ),
    formulas=(r"T \;\text{-=}\; \Bigl[T_c + T_s\,e^{-(w / w_s)^2}\Bigr] \,\tanh\,\frac{w}{w_0}",),
    source=(
        "Armstrong-Helouvry, Dupont, Canudas de Wit, A survey of models, analysis tools and "
        "compensation methods for the control of machines with friction, Automatica 30 (1994) 1083"
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
    ),
    axis="motion (and i_q under speed control)",
    order="0",
    region="free rotor: constant drag, steps at reversals",
    confused_with=("viscous_friction", "inertia", "cogging_torque"),
    separated_by="coasting down to standstill: straight line against exponential; reversal",
    at=(At("friction", drag, ("torque", "width", "stribeck_torque", "stribeck_speed")),),
    switches=("torque", "stribeck_torque"),
    limits=limits,
    longest=lambda v, motor, omega: LARGEST_RUB / rate(v),
    do=do,
)
