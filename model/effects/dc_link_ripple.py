"""Ripple of the DC link that the reading does not show."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import INF, At, Effect, Limit, Parameter
from model.effects.said import quantity
from model.lanes import sine_cosine
from model.parameters import Converter, Motor


@inlined
def ripple(amplitude, frequency, phase, time):
    """Return the ripple (V) at an instant of the recording (s)."""
    sine, _ = sine_cosine(math.tau * frequency * time + phase)
    return amplitude * sine


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how large a ripple may be."""
    yield Limit(
        "dc_link_ripple.amplitude",
        v["dc_link_ripple.amplitude"],
        converter.dc_bus_voltage,
        "V, the DC link",
    )


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    size, frequency = v["dc_link_ripple.amplitude"], v["dc_link_ripple.frequency"]
    return (
        "let the control divide by the link voltage measured in each period: it ripples "
        f"by {quantity(size, 'V')} at "
        f"{frequency:.4g} Hz; or add capacitance, or look at the supply's phases"
    )


CARD = Effect(
    name="dc_link_ripple",
    summary="ripple of the DC link that the reading does not show",
    subsystem="inverter",
    equation=(
        "true link voltage += amplitude sin(2 pi f t + phase), t from the recording's start; a leg "
        "delivers D T_s [V + A sin(w t_mid + phase) sinc(w D T_s/2)]"
    ),
    formulas=(
        r"u_\text{dc} \;\text{+=}\; A \sin(2\pi f\,t + \varphi)",
        r"\int u_\text{leg}\,dt = D\,T_s \Bigl[V + A \sin(2\pi f\,t_\text{mid} + "
        r"\varphi)\,\operatorname{sinc}(\pi f\,D\,T_s)\Bigr]",
    ),
    source=(
        "rectified mains: six (two) times its frequency; volt-seconds of a centred pulse "
        "integrated exactly"
    ),
    parameters=(
        Parameter("amplitude", "V", 0.0, 0.0, 1e3, 0.02, "DC link", title="ripple of the DC link"),
        Parameter(
            "frequency",
            "Hz",
            300.0,
            0.0,
            1e5,
            300.0,
            spread=1.0,
            scan=(20.0, 1500.0, 0.0),
            resolved_by="time",
            title="frequency of the DC link ripple",
        ),
        Parameter(
            "phase", "rad", 0.0, -INF, INF, 0.0, change=1.0, title="phase of the DC link ripple"
        ),
    ),
    axis="along the commanded voltage",
    order="a fixed frequency, whatever the speed",
    region="grows with voltage",
    confused_with=("cogging_torque", "flux_harmonics"),
    separated_by="constant large voltage at standstill, long enough to resolve the line",
    polar=("amplitude", "phase"),
    at=(At("link", ripple, ("amplitude", "frequency", "phase")),),
    switches=("amplitude",),
    limits=limits,
    do=do,
)
