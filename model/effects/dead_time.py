"""Blanking time of the legs: late edges, chosen by the current's sign."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Ordinary, Parameter
from model.effects.said import quantity
from model.lanes import soft_sign
from model.parameters import Converter, Motor


@inlined
def late(time, sign, side):
    """Return how late (s) an edge acts for the soft sign of its leg's current; side: 1 rises, -1 falls."""
    return 0.5 * (abs(time) + side * time * sign)


@inlined
def around_zero(zone_width, zone_shape, current, soft, sign):
    """Return what a zone of its own adds to the soft sign of a current (A); 1/soft: the zone's half-width (A) if 0."""
    given = zone_width > 0.0
    x = current / (zone_width if given else 1.0) if given else current * soft
    return soft_sign(x, zone_shape) - sign if given or zone_shape > 0.0 else 0.0


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how late an edge may be."""
    yield Limit(
        "dead_time.time", abs(v["dead_time.time"]), 0.5 * converter.sampling_period, "s, half the sampling period"
    )


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    time = v["dead_time.time"]
    if time < 0.0:
        return f"lower the drive's dead-time compensation by {quantity(-time, 's')}: it adds too much"
    return f"set the dead-time compensation to {quantity(time, 's')} (more than now by that, where there is one)"


CARD = Effect(
    name="dead_time",
    summary="blanking time of the legs: late edges, chosen by the current's sign",
    subsystem="inverter",
    equation=(
        "current out of the leg: its rising edge is late by t_d; into the leg: its falling edge; mean "
        "loss u_dc t_d/T_s times the vector of signs (fundamental 4/pi, lines 6k); sign linear within "
        "+-1.5 % of rated current, or (1 - shape) clip(i/width) + shape tanh(i/width) in a zone of its own width; the "
        "pattern is late by t_d/2 on average"
    ),
    formulas=(
        r"\overline{\Delta u} = -\,u_\text{dc}\,\frac{t_d}{T_s}\,\operatorname{sign}(i), "
        r"\qquad \operatorname{sign}(i) \to (1 - s)\,\operatorname{clip}\,\frac{i}{i_0} + s "
        r"\,\tanh\,\frac{i}{i_0}",
    ),
    source=(
        "Jeong, Park, The analysis and compensation of dead-time effects in PWM inverters, IEEE Trans. "
        "Ind. Electron. 38 (1991) 108"
    ),
    parameters=(
        Parameter("time", "s", 0.0, -5e-6, 5e-5, 2e-6, ordinary=Ordinary("dead_time", 5e-8), title="dead time"),
        Parameter(
            "zone_width",
            "A",
            0.0,
            0.0,
            1e5,
            0.0,
            "rated current",
            fit="fixed",
            change=0.1,
            title="width of the zone at zero current",
        ),
        Parameter(
            "zone_shape", "", 0.0, 0.0, 1.0, 0.0, fit="fixed", change=1.0, title="shape of the zone at zero current"
        ),
    ),
    axis="against the current",
    order="1 and 6k (5, 7 in phases)",
    region="steps where a phase current crosses zero; size independent of current and speed",
    confused_with=("device_drop", "flux_harmonics", "stator_resistance"),
    separated_by="slow zero crossings of each phase at two modulation depths or two PWM frequencies",
    at=(At("edge", late, ("time",)), At("sign", around_zero, ("zone_width", "zone_shape"))),
    switches=("time",),
    limits=limits,
    do=do,
)
