"""Gain errors of the three current sensors."""

from __future__ import annotations

from model.compiled import kernel
from model.effects.card import Effect, Parameter

CARD = Effect(
    name="current_gain",
    summary="gain errors of the three current sensors",
    subsystem="sensor",
    equation=(
        "reading = gain x i, phase by phase; common part scales the current, mismatch adds its mirror image g_2 i*"
    ),
    source=(
        "Chung, Sul, Analysis and compensation of current measurement error in vector-controlled AC motor"
        " drives, IEEE Trans. Ind. Appl. 34 (1998) 340"
    ),
    parameters=(
        Parameter("gain_a", "", 1.0, 0.2, 5.0, 1.02),
        Parameter("gain_b", "", 1.0, 0.2, 5.0, 0.99),
        Parameter("gain_c", "", 1.0, 0.2, 5.0, 1.0, fit="fixed"),
    ),
    axis="both",
    order="0 (common) and 2 (mismatch)",
    region="grows with current",
    confused_with=("winding_asymmetry", "saturation", "stator_resistance"),
    separated_by=(
        "slow turn under constant current: order 2 in the readings' sum and in the current, not in the voltage"
    ),
)


@kernel
def read(current, gain, offset):
    """Return what a sensor makes of a phase current (A) before noise and counts."""
    return gain * current + offset
