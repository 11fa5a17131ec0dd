"""A shaft that twists between motor and load."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import INF, At, Effect, Limit, Parameter
from model.effects.said import quantity
from model.errors import BadInput
from model.parameters import Converter, Motor


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
    two numbers."""
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


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    k, load = v["shaft_compliance.stiffness"], v["shaft_compliance.load_inertia"]
    total = v["inertia.inertia"]
    swing = (
        math.sqrt(k * (1.0 / load + 1.0 / (total - load))) / math.tau
        if 0.0 < load < total
        else math.nan
    )
    return (
        f"keep the speed control below {quantity(0.3 * swing, 'Hz')}, or put a notch at "
        f"{quantity(swing, 'Hz')} into it: shaft and load swing there; or take a stiffer coupling"
    )


CARD = Effect(
    name="shaft_compliance",
    summary="a shaft that twists between motor and load",
    subsystem="mechanics",
    equation=(
        "two masses, total inertia unchanged: J_m dw/dt = ... - shaft, J_l dw_l/dt = shaft - "
        "load, shaft = K twist + D (w - w_l), D = 2 zeta sqrt(K J_m J_l/(J_m + J_l)); resonance "
        "sqrt(K (1/J_m + 1/J_l))"
    ),
    formulas=(
        r"J_m\,\frac{d w}{d t} = T - T_\text{friction} - T_\text{shaft}, \qquad "
        r"J_l\,\frac{d w_l}{d t} = T_\text{shaft} - T_\text{load}, \qquad J_m + J_l = J",
        r"T_\text{shaft} = K\,(\theta_m - \theta_l) + D\,(w - w_l), \qquad D = 2\zeta "
        r"\sqrt{\frac{K J_m J_l}{J_m + J_l}}, \qquad w_\text{res} = \sqrt{K "
        r"\Bigl(\frac{1}{J_m} + \frac{1}{J_l}\Bigr)}",
    ),
    source=(
        "Ellis, Lorenz, Resonant load control methods for industrial servo drives, IEEE "
        "IAS Annual Meeting 2000"
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
    ),
    axis="motion",
    order="a fixed frequency",
    region="free rotor after steps of load or torque",
    confused_with=("inertia", "cogging_torque", "dc_link_ripple"),
    separated_by="free rotor, step of load or torque, sampled for several periods of the resonance",
    at=(At("shaft", two_masses, ("stiffness", "load_inertia", "damping_ratio")),),
    switches=("stiffness",),
    limits=limits,
    do=do,
)
