"""Eddy currents and hysteresis of the core, as a resistance across the flux slope."""

from __future__ import annotations

from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import INF, At, Effect, Parameter, flux_scale
from model.effects.said import quantity
from model.parameters import Converter, Motor

LARGEST_LAG = 0.5  # of the time constant in one step: the current is no parabola over a longer one


@inlined
def branch(core_resistance, time_constant):
    """Return the branch's conductance (1/ohm) and its lag's time constant (s): tau
    di_c/dt = (dpsi_ab/dt)/R_c - i_c."""
    return 1.0 / core_resistance, time_constant


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    ohm = v["iron_loss.core_resistance"]
    loss = 1.5 * (motor.rated_omega * flux_scale(motor)) ** 2 / ohm
    return (
        f"count a core resistance of {quantity(ohm, 'ohm')} in (about {quantity(loss, 'W')} at "
        "rated speed without load) where torque or losses are worked out from currents"
    )


CARD = Effect(
    name="iron_loss",
    summary="eddy currents and hysteresis of the core, as a resistance across the flux slope",
    subsystem="machine",
    equation=(
        "terminal current = magnetising current + i_c, tau di_c/dt = (dpsi_ab/dt)/R_c - i_c; "
        "torque from the magnetising current; loss 3/2 R_c i_c^2"
    ),
    formulas=(
        r"i_\text{terminal} = i + i_c, \qquad \tau\,\frac{d i_c}{d t} = "
        r"\frac{1}{R_c}\,\frac{d\psi_{\alpha\beta}}{d t} - i_c, \qquad P = "
        r"\tfrac32\,R_c\,|i_c|^2",
    ),
    source=(
        "size of the losses: Mi, Slemon, Bonert, Modeling of iron losses of permanent-magnet "
        "synchronous motors, IEEE Trans. Ind. Appl. 39 (2003) 734; resistance across the flux "
        "slope: the usual equivalent circuit, its time constant (derivation) keeps i_c finite "
        "under pulses"
    ),
    parameters=(
        Parameter(
            "core_resistance",
            "ohm",
            INF,
            1.0,
            INF,
            20.0,
            "rated reactance",
            fit="reciprocal",
            title="core resistance",
        ),
        Parameter(
            "time_constant",
            "s",
            2e-4,
            1e-5,
            1e-2,
            2e-4,
            fit="log",
            spread=0.5,
            title="time constant of the iron",
        ),
    ),
    axis="q at speed, along the injected voltage in the injection band",
    order="0 and the injection band",
    region="grows with speed; with injection at standstill, too",
    confused_with=("dc_link_error", "current_filter", "skin_effect", "viscous_friction"),
    separated_by="driven idle at several speeds (drag current) together with injection at standstill",  # noqa: E501
    at=(At("iron", branch, ("core_resistance", "time_constant")),),
    switches=("core_resistance",),
    longest=lambda v, motor, omega: LARGEST_LAG * v["iron_loss.time_constant"],
    do=do,
)
