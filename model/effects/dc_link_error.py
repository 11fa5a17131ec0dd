"""The true DC-link voltage is not what the controller divides by."""

from __future__ import annotations

from model.compiled import kernel
from model.effects.card import Effect, Parameter

CARD = Effect(
    name="dc_link_error",
    summary="the true DC-link voltage is not what the controller divides by",
    subsystem="inverter",
    equation="delivered = command x (1 + gain_error) V_nominal / u_dc as read",
    source="derivation: duties are formed with the measured link voltage",
    parameters=(Parameter("gain_error", "", 0.0, -0.5, 0.5, 0.03),),
    axis="along the commanded voltage",
    order="0 and the injection band",
    region="grows with voltage: speed, steps and injection",
    confused_with=("iron_loss", "magnet_flux", "inductance", "stator_resistance"),
    separated_by=(
        "none by itself: it equals scaling R, all fluxes and L together; told apart by a trusted value of"
        " one of them, e.g. the magnet flux on open circuit"
    ),
)


@kernel
def link(nominal, gain_error):
    """Return the true mean link voltage (V)."""
    return (1.0 + gain_error) * nominal
