"""Unsaturated inductances other than nominal."""

from __future__ import annotations

from collections.abc import Mapping

from model.effects.card import Effect, Ordinary, Parameter
from model.effects.said import added_to_map, percent, stated
from model.parameters import Converter, Motor


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    scales = {x: v[f"inductance.scale_{x}"] for x in "dq" if v[f"inductance.scale_{x}"] != 1.0}
    if motor.has_map:
        return added_to_map(
            ", ".join(f"L_{x} {percent(s - 1.0)} at zero current" for x, s in scales.items())
        )
    changes = (
        (
            f"{stated(f'inductance_{x}', s * getattr(motor, f'inductance_{x}'), 'H')} "
            f"({percent(s - 1.0)})"
        )
        for x, s in scales.items()
    )
    return f"set {' and '.join(changes)} in the motor's file, the estimator and the current control"


CARD = Effect(
    name="inductance",
    summary="unsaturated inductances other than nominal",
    subsystem="machine",
    equation="Gamma_d = 1/(scale_d L_d), Gamma_q = 1/(scale_q L_q) in the energy",
    formulas=(r"\Gamma_d = \frac{1}{k_d L_d}, \qquad \Gamma_q = \frac{1}{k_q L_q}",),
    source=(
        "Jebai, Malrait, Martin, Rouchon, Estimation of Saturation of Permanent-Magnet "
        "Synchronous Motors Through an Energy-Based Model, IEEE IEMDC 2011, eq. (EnerSat)"
    ),
    parameters=tuple(
        Parameter(
            f"scale_{axis}",
            "",
            1.0,
            0.2,
            5.0,
            typical,
            scales=f"inductance_{axis}",
            ordinary=Ordinary(f"inductance_{axis}", 0.03, of_motor=True),
            title=f"factor on L_{axis}",
        )
        for axis, typical in (("d", 0.9), ("q", 1.1))
    ),
    axis="d and q, each its own",
    order="0 and the injection band",
    region="slopes of current steps and ripple at low current; omega L i at speed",
    confused_with=("saturation", "skin_effect", "current_filter"),
    separated_by="injection along d, then along q, at locked rotor and small bias",
    do=do,
)
