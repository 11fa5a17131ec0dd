"""The applied voltage changes later than the recording says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import number, quantity
from model.parameters import Converter, Motor

LATEST = 3.0  # sampling periods: the latest that a recorded voltage may act


@inlined
def later(delay):
    """Return by how much all pulses come later (s)."""
    return delay


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how late a recorded voltage may come, and a simulated one, of which the control knows
    nothing."""
    delay, period = v["pwm_delay.delay"], converter.update_period
    yield Limit("pwm_delay.delay", delay, LATEST * period, f"s, {LATEST:g} sampling periods")
    late = delay + abs(v["dead_time.time"])
    what = "s, half the PWM period: a simulated drive's control takes its voltage for punctual"
    yield Limit("pwm_delay.delay + dead_time.time", late, 0.5 * period, what, simulated=True)


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    delay = v["pwm_delay.delay"]
    periods, rows = delay / converter.update_period, round(delay / converter.sampling_period)
    said = f"delay of {number(periods)} periods"
    if rows == 0:
        return f"{said}: count {quantity(delay, 's')} more into the angle of the commanded voltage"
    log = f"log the command {rows} row{'s' if rows > 1 else ''} later"
    return f"{said}: {log}, or set a delay of {quantity(delay, 's')} in the control"


CARD = Effect(
    name="pwm_delay",
    summary="the applied voltage changes later than the recording says",
    subsystem="inverter",
    equation=(
        "pulses shifted by d: up to the zero vector's length the volt-seconds between samples "
        "stay, only the mean flux moves by -d u (current sample higher by about d u/L); beyond, "
        "volt-seconds pass to the next period"
    ),
    formulas=(r"u(t) = u^*(t - t_d), \qquad \overline{\Delta\psi} = -\,t_d\,u",),
    source=(
        "Bae, Sul, A compensation method for time delay of full-digital synchronous frame current "
        "regulator of PWM AC drives, IEEE Trans. Ind. Appl. 39 (2003) 802"
    ),
    parameters=(Parameter("delay", "s", 0.0, 0.0, 1e-2, 0.08, "PWM period", title="PWM delay"),),
    axis="along the commanded voltage, R d Gamma u",
    order="0 and the injection band",
    region="grows with voltage and its changes",
    confused_with=("current_sampling", "current_filter", "encoder_offset"),
    separated_by="injection with steps of large amplitude, at two PWM frequencies",
    at=(At("delay", later, ("delay",)),),
    limits=limits,
    do=do,
)
