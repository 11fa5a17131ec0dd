"""Analogue low-pass between sensor and sampler."""

from __future__ import annotations

import math
from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Parameter
from model.effects.said import quantity
from model.parameters import Converter, Motor


@inlined
def low_pass(time_constant):
    """Return the time constant (s) of tau df/dt = i - f."""
    return time_constant


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    tau = v["current_filter.time_constant"]
    return (
        f"tell the control a filter of {quantity(tau, 's')} "
        f"({quantity(1.0 / (math.tau * tau), 'Hz')}) before the "
        f"samplers, or count the currents as {quantity(tau, 's')} late"
    )


CARD = Effect(
    name="current_filter",
    summary="analogue low-pass between sensor and sampler",
    subsystem="sensor",
    equation=(
        "tau df/dt = i - f before sampling; under centred pulses f carries the lagged "
        "flux ripple: for a "
        "short tau the reading is i + tau Gamma (e + R i), the slope of the zero vector"
    ),
    formulas=(r"\tau\,\frac{d f}{d t} = i - f, \qquad i_\text{read} = f(t_k)",),
    source=(
        "Blasko, Kaura, Niewiadomski, Sampling of discontinuous voltage and current signals in "
        "electrical drives: a system approach, IEEE Trans. Ind. Appl. 34 (1998) 1123"
    ),
    parameters=(
        Parameter(
            "time_constant", "s", 0.0, 0.0, 0.5, 3e-5, title="time constant of the current filter"
        ),
    ),
    axis="along the current's slope",
    order="1 at speed and the injection band",
    region="grows with voltage and speed",
    confused_with=("current_sampling", "pwm_delay", "iron_loss"),
    separated_by=(
        "driven rotor with the DC link nearly used up: the zero vector is then shorter than the "
        "time constant, and late or early sampling reads otherwise"
    ),
    trace=0.3,
    at=(At("filter", low_pass, ("time_constant",)),),
    do=do,
)
