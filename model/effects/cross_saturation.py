"""Cross-saturation coefficients other than nominal."""

from __future__ import annotations

from collections.abc import Mapping

from model.effects.card import Effect, Parameter
from model.effects.said import model_for
from model.parameters import Converter, Motor


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    return model_for(motor, v, ("alpha_12", "alpha_22"))


CARD = Effect(
    name="cross_saturation",
    summary="cross-saturation coefficients other than nominal",
    subsystem="machine",
    equation="H += alpha_12 d q^2 + alpha_22 d^2 q^2; L_dq = L_qd != 0: the axis of injection "
    "leans",
    formulas=(
        r"H \;\text{+=}\; \alpha_{12}\,\phi_d\,\phi_q^2 + \alpha_{22}\,\phi_d^2\,\phi_q^2, "
        r"\qquad L_{dq} = L_{qd} \ne 0",
    ),
    source=(
        "Jebai, Malrait, Martin, Rouchon, Estimation of Saturation of Permanent-Magnet "
        "Synchronous Motors Through an Energy-Based Model, IEEE IEMDC 2011, eqs. (id), (iq)"
    ),
    parameters=(
        Parameter(
            "alpha_12",
            "A/Wb^2",
            None,
            -1e9,
            1e9,
            1.3,
            "neutral",
            "alpha_12",
            same_as="saturation.alpha_12",
            title="cross term alpha_12",
        ),
        Parameter(
            "alpha_22",
            "A/Wb^3",
            None,
            -1e12,
            1e12,
            1.3,
            "neutral",
            "alpha_22",
            same_as="saturation.alpha_22",
            title="cross term alpha_22",
        ),
    ),
    axis="d from q current and q from d current",
    order="0 and the injection band",
    region="where both fluxes, or q bias and d injection, are present",
    confused_with=("saturation", "encoder_offset", "inductance_harmonics"),
    separated_by="locked rotor, q bias staircase with injection along d",
    do=do,
)
