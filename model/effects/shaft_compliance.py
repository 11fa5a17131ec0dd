"""A shaft that twists between motor and load, with a gap that it crosses freely."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import INF, At, Effect, Limit, Parameter
from model.effects.said import angle, quantity
from model.errors import BadInput
from model.parameters import Converter, Motor

# of the twist under rated torque: a backlash to begin from.  With it a swing of a third of that
# torque sees half the stiffness, by the describing function of a dead zone, 1 - 2 (asin x + x
# sqrt(1 - x^2))/pi = 1/2 at x = 0.40 = (gap/2)/(gap/2 + twist/3)
SHARE = 0.45


def motor_inertia(v: Mapping[str, float]) -> float:
    """Return the inertia (kg m^2) on the motor's side: all of it where the shaft is rigid."""
    load = (
        v["shaft_compliance.load_inertia"]
        if math.isfinite(v["shaft_compliance.stiffness"])
        else 0.0
    )
    return v["inertia.inertia"] - load


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how much of the inertia the load may have, and how fast the shaft may swing; it takes
    two numbers, and backlash stands between them."""
    total, load, k = (
        v["inertia.inertia"],
        v["shaft_compliance.load_inertia"],
        v["shaft_compliance.stiffness"],
    )
    yield Limit("shaft_compliance.load_inertia", load, total, "kg m^2, the total inertia")
    if math.isfinite(k) != (load > 0.0):
        alone = "stiffness" if math.isfinite(k) else "load_inertia"
        raise BadInput(
            f"shaft_compliance.{alone} alone does nothing; give "
            "shaft_compliance.stiffness and .load_inertia together"
        )
    if v["shaft_compliance.backlash"] > 0.0 and not load > 0.0:
        raise BadInput(
            "shaft_compliance.backlash alone does nothing; give "
            "shaft_compliance.stiffness and .load_inertia, too"
        )
    if load > 0.0:
        swing = math.sqrt(k * (1.0 / load + 1.0 / (total - load)))
        what = "rad/s, half the sampling frequency (give stiffness = inf for a rigid shaft)"
        yield Limit("shaft_compliance resonance", swing, math.pi / converter.sampling_period, what)


@inlined
def two_masses(stiffness, load_inertia, damping_ratio, inertia):
    """Return the load's inertia (kg m^2), and rate (rad/s) and damping ratio of the swing of both
    masses, of an inertia in all (kg m^2); none of them behind a rigid shaft."""
    if not (math.isfinite(stiffness) and load_inertia > 0.0):
        return 0.0, 0.0, 0.0
    return (
        load_inertia,
        math.sqrt(stiffness * inertia / ((inertia - load_inertia) * load_inertia)),
        damping_ratio,
    )


@inlined
def gap(backlash):
    """Return how far (rad) the shaft turns freely."""
    return backlash


def otherwise(
    v: Mapping[str, float], width: float, motor: Motor, converter: Converter
) -> dict[str, float]:
    """Return a backlash of a SHARE of the twist under rated torque in place of none, or none in
    place of one."""
    twist = motor.rated_torque / v["shaft_compliance.stiffness"]
    return {
        "shaft_compliance.backlash": 0.0 if v["shaft_compliance.backlash"] > 0.0 else SHARE * twist
    }


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    k, load = v["shaft_compliance.stiffness"], v["shaft_compliance.load_inertia"]
    total = v["inertia.inertia"]
    swing = (
        math.sqrt(k * (1.0 / load + 1.0 / (total - load))) / math.tau
        if 0.0 < load < total
        else math.nan
    )
    free = v["shaft_compliance.backlash"]
    if free > 0.0:
        return (
            f"take out the play of {quantity(free, 'rad')} ({angle(free)}) between motor and load: "
            "key, coupling, gear; or hold a torque on the shaft that never changes its sign. Keep "
            f"the speed control below {quantity(0.3 * swing, 'Hz')}: closed, the shaft swings at "
            f"{quantity(swing, 'Hz')}, and across the play at any rate below"
        )
    return (
        f"keep the speed control below {quantity(0.3 * swing, 'Hz')}, or put a notch at "
        f"{quantity(swing, 'Hz')} into it: shaft and load swing there; or take a stiffer coupling"
    )


CARD = Effect(
    name="shaft_compliance",
    summary="a shaft that twists between motor and load, with or without play",
    subsystem="mechanics",
    equation=(
        "two masses, total inertia unchanged: J_m dw/dt = ... - shaft, J_l dw_l/dt = shaft - "
        "load, shaft = K twist + D (w - w_l), D = 2 zeta sqrt(K J_m J_l/(J_m + J_l)); resonance "
        "sqrt(K (1/J_m + 1/J_l)). With a backlash the twist counts from the gap's edge: shaft = K "
        "(twist less its clip to +-backlash/2) + D (w - w_l), none of both inside the gap"
    ),
    formulas=(
        r"J_m\,\frac{d w}{d t} = T - T_\text{friction} - T_\text{shaft}, \qquad "
        r"J_l\,\frac{d w_l}{d t} = T_\text{shaft} - T_\text{load}, \qquad J_m + J_l = J",
        r"T_\text{shaft} = K\,(\theta_m - \theta_l) + D\,(w - w_l), \qquad D = 2\zeta "
        r"\sqrt{\frac{K J_m J_l}{J_m + J_l}}, \qquad w_\text{res} = \sqrt{K "
        r"\Bigl(\frac{1}{J_m} + \frac{1}{J_l}\Bigr)}",
        r"\theta_m - \theta_l \to (\theta_m - \theta_l) - \operatorname{clip}(\theta_m - "
        r"\theta_l,\ \pm b/2), \qquad T_\text{shaft} = 0 \ \text{for}\ |\theta_m - \theta_l| < "
        r"b/2",
    ),
    source=(
        "Ellis, Lorenz, Resonant load control methods for industrial servo drives, IEEE "
        "IAS Annual Meeting 2000; Nordin, Gutman, Controlling mechanical systems with backlash: a "
        "survey, Automatica 38 (2002) 1633 (dead zone)"
    ),
    parameters=(
        Parameter(
            "stiffness",
            "N m/rad",
            INF,
            1e-3,
            INF,
            0.25,
            "inertia x (2 pi 100 Hz)^2",
            fit="log",
            spread=1.5,
            secant=1.0,  # at infinite stiffness a slope says nothing
            starts=tuple(0.05 * 1.4**k for k in range(14)),
            title="stiffness of the shaft",
        ),
        Parameter(
            "load_inertia",
            "kg m^2",
            0.0,
            0.0,
            1e4,
            0.5,
            "inertia",
            fit="log",
            spread=0.7,
            starts=(0.6, 1.0, 1.4),
            title="inertia behind the shaft",
        ),
        Parameter(
            "damping_ratio",
            "",
            0.01,
            0.0,
            1.0,
            0.01,
            fit="log",
            spread=0.7,
            title="damping ratio of the shaft",
        ),
        Parameter(
            "backlash",
            "rad",
            0.0,
            0.0,
            1.0,
            0.0,
            "rated torque / (inertia x (2 pi 100 Hz)^2)",
            fit="log",
            spread=1.0,
            change=1.0,
            title="backlash of the shaft",
        ),
    ),
    axis="motion",
    order="a fixed frequency",
    region="free rotor after steps of load or torque",
    confused_with=("inertia", "cogging_torque", "dc_link_ripple"),
    separated_by="free rotor, step of load or torque, sampled for several periods of the resonance",
    at=(
        At("shaft", two_masses, ("stiffness", "load_inertia", "damping_ratio")),
        At("backlash", gap, ("backlash",)),
    ),
    switches=("stiffness", "backlash"),
    limits=limits,
    do=do,
    otherwise=otherwise,
)
