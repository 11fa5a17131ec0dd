"""Gain errors of the three current sensors."""

from __future__ import annotations

from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Ordinary, Parameter
from model.parameters import Converter, Motor


@inlined
def scaled(gain_a, gain_b, gain_c, a, b, c):
    """Return three readings (A) times their sensors' gains."""
    return gain_a * a, gain_b * b, gain_c * c


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    wrong = {x: v[f"current_gain.gain_{x}"] for x in "abc" if v[f"current_gain.gain_{x}"] != 1.0}
    factors = ", ".join(f"phase {x} by {1.0 / g:.4g}" for x, g in wrong.items())
    return (
        f"multiply the current readings ({factors}): shunts, gain resistors or the scaling in "
        "the drive"
    )


CARD = Effect(
    name="current_gain",
    summary="gain errors of the three current sensors",
    subsystem="sensor",
    equation=(
        "reading = gain x i, phase by phase: g_0 i + g_2 i*, g_0 the mean gain, g_2 = "
        "(g_a + a^2 g_b + a g_c)/3 with "
        "a = exp(2j pi/3); i* turns backwards, which is order 2 seen from the rotor"
    ),
    formulas=(
        r"i_{k,\text{read}} = g_k\,i_k,\quad k = a, b, c",
        r"i_\text{read} = g_0\,i + g_2\,i^*, \qquad g_0 = \frac{g_a + g_b + g_c}{3}, \qquad "
        r"g_2 = \frac{g_a + a^2 g_b + a\,g_c}{3}, \qquad a = e^{2\pi j/3}",
    ),
    source=(
        "Chung, Sul, Analysis and compensation of current measurement error in vector-controlled "
        "AC motor drives, IEEE Trans. Ind. Appl. 34 (1998) 340"
    ),
    parameters=tuple(
        Parameter(
            f"gain_{phase}",
            "",
            1.0,
            0.2,
            5.0,
            typical,
            change=change,
            ordinary=Ordinary("current_gain", 0.002),
            title=f"gain of current sensor {phase}",
        )
        for phase, typical, change in (("a", 1.02, 0.0), ("b", 0.99, 0.0), ("c", 1.0, 0.013))
    ),
    axis="both",
    order="0 (common) and 2 (mismatch)",
    region="grows with current",
    confused_with=("winding_asymmetry", "saturation", "stator_resistance"),
    separated_by=(
        "slow turn under constant current: order 1 in the sum of the three readings, order 2 in "
        "the rotor-frame current that no voltage explains"
    ),
    at=(At("reading", scaled, ("gain_a", "gain_b", "gain_c")),),
    do=do,
)
