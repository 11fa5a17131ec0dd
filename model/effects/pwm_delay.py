"""The applied voltage changes later than the recording says."""

from __future__ import annotations

from model.effects.card import Effect, Parameter

CARD = Effect(
    name="pwm_delay",
    summary="the applied voltage changes later than the recording says",
    subsystem="inverter",
    equation=(
        "pulses shifted by d: up to the zero vector's length the volt-seconds between samples stay, only "
        "the mean flux moves by -d u (current sample higher by about d u/L); beyond, volt-seconds pass to"
        " the next period"
    ),
    source=(
        "Bae, Sul, A compensation method for time delay of full-digital synchronous frame current "
        "regulator of PWM AC drives, IEEE Trans. Ind. Appl. 39 (2003) 802"
    ),
    parameters=(Parameter("delay", "s", 0.0, 0.0, 1e-2, 0.08, "PWM period"),),
    axis="along the commanded voltage, R d Gamma u",
    order="0 and the injection band",
    region="grows with voltage and its changes",
    confused_with=("current_sampling", "current_filter", "encoder_offset"),
    separated_by="injection with steps of large amplitude, at two PWM frequencies",
    rows=lambda v, motor: {"delay": v["pwm_delay.delay"]},
)
