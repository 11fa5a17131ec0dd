"""Saturation coefficients other than nominal."""

from __future__ import annotations

from collections.abc import Mapping

from model.effects.card import Effect, Ordinary, Parameter
from model.effects.said import model_for
from model.parameters import Converter, Motor

CUBIC, QUARTIC = ("alpha_30", "alpha_12"), ("alpha_40", "alpha_22", "alpha_04")


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    return model_for(
        motor, v, [n for n in CUBIC + QUARTIC if v[f"saturation.{n}"] != getattr(motor, n)]
    )


CARD = Effect(
    name="saturation",
    summary="saturation coefficients other than nominal",
    subsystem="machine",
    equation=(
        "H += alpha_30 d^3 + alpha_12 d q^2 + alpha_40 d^4 + alpha_22 d^2 q^2 + alpha_04 q^4 (d, "
        "q: current-induced fluxes)"
    ),
    formulas=(
        r"H \;\text{+=}\; \alpha_{30}\,\phi_d^3 + \alpha_{12}\,\phi_d\,\phi_q^2 + "
        r"\alpha_{40}\,\phi_d^4 + \alpha_{22}\,\phi_d^2\,\phi_q^2 + \alpha_{04}\,\phi_q^4",
    ),
    source=(
        "Jebai, Malrait, Martin, Rouchon, Estimation of Saturation of Permanent-Magnet "
        "Synchronous Motors Through an Energy-Based Model, IEEE IEMDC 2011, eq. (EnerSat)"
    ),
    parameters=tuple(
        Parameter(
            n,
            unit,
            None,
            -bound,
            bound,
            1.3,
            "neutral",
            n,
            ordinary=Ordinary(n, 0.05, of_motor=True),
            title=f"saturation coefficient {n}",
        )
        for names, unit, bound in ((CUBIC, "A/Wb^2", 1e9), (QUARTIC, "A/Wb^3", 1e12))
        for n in names
    ),
    axis="both, coupled",
    order="0 and the injection band",
    region="second and third power of the bias flux; nothing at zero current",
    confused_with=("inductance", "cross_saturation", "current_gain"),
    separated_by=(
        "locked-rotor staircases of d and of q bias with injection on top, up to rated "
        "current and above"
    ),
    do=do,
)
