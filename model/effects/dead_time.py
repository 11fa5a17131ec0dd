"""Blanking time of the legs: late edges, chosen by the current's sign."""

from __future__ import annotations

from model.compiled import inlined
from model.effects.card import At, Effect, Ordinary, Parameter

SOFT_SIGN = 0.015  # of rated current: half the width in which sign(i) goes through zero


@inlined
def late(time, sign, side):
    """Return how late (s) an edge acts for the soft sign of its leg's current; side: 1 rises, -1 falls."""
    return 0.5 * (abs(time) + side * time * sign)


CARD = Effect(
    name="dead_time",
    summary="blanking time of the legs: late edges, chosen by the current's sign",
    subsystem="inverter",
    equation=(
        "current out of the leg: its rising edge is late by t_d; into the leg: its falling edge; mean "
        "loss u_dc t_d/T_s times the vector of signs (fundamental 4/pi, lines 6k); sign linear within "
        "+-1.5 % of rated current; the pattern is late by t_d/2 on average"
    ),
    source=(
        "Jeong, Park, The analysis and compensation of dead-time effects in PWM inverters, IEEE Trans. "
        "Ind. Electron. 38 (1991) 108; current at the edge: AVERAGING 5"
    ),
    parameters=(Parameter("time", "s", 0.0, -5e-6, 5e-5, 2e-6, ordinary=Ordinary("dead_time", 5e-8)),),
    axis="against the current",
    order="1 and 6k (5, 7 in phases)",
    region="steps where a phase current crosses zero; size independent of current and speed",
    confused_with=("device_drop", "flux_harmonics", "stator_resistance"),
    separated_by="slow zero crossings of each phase at two modulation depths or two PWM frequencies",
    at=(At("edge", late, ("time",)),),
)
