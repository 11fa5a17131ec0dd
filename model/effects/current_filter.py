"""Analogue low-pass between sensor and sampler."""

from __future__ import annotations

import math

from model.compiled import kernel
from model.effects.card import Effect, Parameter

FASTEST = 1e12  # 1/s


@kernel
def lag_weights(step, tau):
    """Return decay, weight of the old and of the new input for a step (s) of a lag with linear input between."""
    x = step / tau
    decay = math.exp(-x)
    mean = (1.0 - decay) / x if x > 1e-5 else 1.0 - 0.5 * x
    return decay, mean - decay, 1.0 - mean


@kernel
def sample_weights(s, tau):
    """Return the weights of a lag's output and input at t_k, and of its input s (s) later, for its output then.

    Before t_k (s < 0) the output lags its input's slope, and what it deviates from that grows backwards: by e at most,
    an older deviation has been forgotten by t_k and does not tell.  Continuous to the bare input for tau -> 0.
    """
    if s >= 0.0:
        return lag_weights(s, tau)
    growth, x = math.exp(min(-s / tau, 1.0)), s / tau
    mean = (1.0 - growth) / x if x < -1e-5 else 1.0 - 0.5 * x
    return growth, mean - growth, 1.0 - mean


@kernel
def after(filtered, start, end, s, tau):
    """Return the lag s (s, either sign) after it was `filtered`, its input going linearly from start to end."""
    decay, old, new = sample_weights(s, tau)
    return decay * filtered + old * start + new * end


def rate_of(time_constant: float) -> float:
    """Return the lag's rate (1/s); a filter without time constant has forgotten everything at once."""
    return min(1.0 / time_constant, FASTEST) if time_constant > 0.0 else FASTEST


CARD = Effect(
    name="current_filter",
    summary="analogue low-pass between sensor and sampler",
    subsystem="sensor",
    equation=(
        "tau df/dt = i - f before sampling; under centred pulses f carries the lagged flux ripple: for a "
        "short tau the reading is i + tau Gamma (e + R i), the slope of the zero vector"
    ),
    source=(
        "Blasko, Kaura, Niewiadomski, Sampling of discontinuous voltage and current signals in electrical"
        " drives: a system approach, IEEE Trans. Ind. Appl. 34 (1998) 1123; form under centred pulses: "
        "AVERAGING 3"
    ),
    parameters=(Parameter("time_constant", "s", 0.0, 0.0, 1e-2, 3e-5),),
    axis="along the current's slope",
    order="1 at speed and the injection band",
    region="grows with voltage and speed",
    confused_with=("current_sampling", "pwm_delay", "iron_loss"),
    separated_by=(
        "driven rotor with the DC link nearly used up: the zero vector is then shorter than the time constant, and "
        "late or early sampling reads otherwise"
    ),
    trace=0.3,
    rows=lambda v, motor: {"filter_rate": rate_of(v["current_filter.time_constant"])},
)
