"""Phases of unequal resistance (contacts, repairs, turn faults)."""

from __future__ import annotations

from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import quantity
from model.errors import BadInput
from model.parameters import Converter, Motor


@inlined
def drop(delta_a, delta_b, i_alpha, i_beta):
    """Return the additional voltage drop (V) in the stationary frame."""
    v_a, v_b = delta_a * i_alpha, delta_b * (0.8660254037844386 * i_beta - 0.5 * i_alpha)
    return (2.0 * v_a - v_b) / 3.0, v_b * 0.5773502691896258


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> tuple[Limit, ...]:
    """Raise BadInput where a phase would have less than no resistance."""
    least = v["stator_resistance.resistance"] + min(
        v["winding_asymmetry.delta_a"], v["winding_asymmetry.delta_b"]
    )
    if least < 0.0:
        raise BadInput(
            f"winding_asymmetry leaves a phase {least:g} ohm; give more than minus the resistance"
        )
    return ()


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    a, b = v["winding_asymmetry.delta_a"], v["winding_asymmetry.delta_b"]
    least = min(a, b, 0.0)
    phases = ", ".join(
        f"{quantity(x - least, 'ohm')} in phase {p}"
        for p, x in zip("abc", (a, b, 0.0), strict=True)
        if x > least
    )
    return (
        f"look for what a phase has more than the others ({phases}): terminals, contactors, a "
        "repaired coil"
    )


CARD = Effect(
    name="winding_asymmetry",
    summary="phases of unequal resistance (contacts, repairs, turn faults)",
    subsystem="machine",
    equation=(
        "delta_a added to phase a, delta_b to phase b: drop (2 delta_a i_a - delta_b i_b)/3 along "
        "alpha, delta_b i_b/sqrt(3) along beta"
    ),
    formulas=(
        r"\Delta u_\alpha = \frac{2\,\delta_a i_a - \delta_b i_b}{3}, \qquad \Delta u_\beta "
        r"= \frac{\delta_b i_b}{\sqrt 3}",
    ),
    source="derivation: phase voltage equations seen through Clarke's transformation",
    parameters=(
        Parameter(
            "delta_a",
            "ohm",
            0.0,
            -1e3,
            1e3,
            0.03,
            "resistance",
            title="additional resistance of phase a",
        ),
        Parameter(
            "delta_b",
            "ohm",
            0.0,
            -1e3,
            1e3,
            -0.02,
            "resistance",
            title="additional resistance of phase b",
        ),
    ),
    axis="negative sequence: d and q alternating",
    order="2",
    region="grows with current; at standstill it depends on the angle",
    confused_with=("current_gain", "inductance_harmonics", "current_offset"),
    separated_by=(
        "locked rotor at several angles (or a slow turn): drop at order 2 in voltage, while "
        "current gain also acts where no voltage drops"
    ),
    at=(At("winding", drop, ("delta_a", "delta_b")),),
    limits=limits,
    do=do,
)
