"""Samples taken beside the centre of the zero vector, one phase after another, and their jitter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import quantity
from model.parameters import Converter, Motor

# of the PWM period, that one phase is sampled after another: converters take some microseconds
USUAL = 0.02


@inlined
def taken(delay, jitter):
    """Return by how much samples are taken late (s) and the variance of their jitter (s^2)."""
    return delay, jitter * jitter


@inlined
def apart(channel_lag):
    """Return by how much later (s) each phase is sampled than the one before it."""
    return channel_lag


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how far from its instant a sample may be."""
    half = 0.5 * converter.update_period
    yield Limit(
        "current_sampling.delay",
        abs(v["current_sampling.delay"]),
        half,
        "s, half the sampling period",
    )
    yield Limit(
        "current_sampling.channel_lag",
        2.0 * v["current_sampling.channel_lag"],
        half,
        "s from the first to the last phase, half the sampling period",
    )
    yield Limit(
        "current_sampling.jitter",
        6.0 * v["current_sampling.jitter"],
        half,
        "s in six sigma, half the PWM period",
    )


def otherwise(
    v: Mapping[str, float], width: float, motor: Motor, converter: Converter
) -> dict[str, float]:
    """Return phases that are sampled one after another in place of all at once, or the other way
    round."""
    lag = 0.0 if v["current_sampling.channel_lag"] else USUAL * converter.sampling_period
    return {"current_sampling.channel_lag": lag}


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    late, jitter = v["current_sampling.delay"], v["current_sampling.jitter"]
    way = "earlier" if late > 0.0 else "later"
    shift = [f"trigger the current samples {quantity(abs(late), 's')} {way}"] if late else []
    shake = (
        [f"take a trigger from the PWM counter: samples jitter by {quantity(jitter, 's')} rms"]
        if jitter
        else []
    )
    lag = v["current_sampling.channel_lag"]
    apart = [f"sample all phases at once: they come {quantity(lag, 's')} apart"] if lag else []
    return "; ".join([*shift, *apart, *shake])


CARD = Effect(
    name="current_sampling",
    summary="samples taken beside the centre of the zero vector, one phase after another, and "
    "their jitter",
    subsystem="sensor",
    equation=(
        "reading = i(t_k + delay + jitter x normal): within the zero vector no voltage acts, "
        "i(psi - s R i, theta + s omega); phase b is read channel_lag after a, c as much after b, "
        "along the current's course in the zero vector; jitter is noise: simulated sample by "
        "sample, never predicted - a replay leaves it in the residual as jitter x slope of the "
        "current, above the sensors' noise"
    ),
    formulas=(r"i_\text{read} = i(t_k + t_d + \sigma\,\xi), \qquad \xi \sim \mathcal N(0, 1)",),
    source=(
        "Blasko, Kaura, Niewiadomski, Sampling of discontinuous voltage and current signals in "
        "electrical drives: a system approach, IEEE Trans. Ind. Appl. 34 (1998) 1123"
    ),
    parameters=(
        Parameter("delay", "s", 0.0, -1e-2, 1e-2, 5e-6, title="delay of current sampling"),
        Parameter(
            "channel_lag",
            "s",
            0.0,
            0.0,
            1e-3,
            0.0,
            "PWM period",
            fit="log",
            spread=1.0,
            change=USUAL,
            title="lag of each phase's sampling behind the one before",
        ),
        Parameter(
            "jitter",
            "s rms",
            0.0,
            0.0,
            1e-3,
            0.0,
            fit="fixed",
            predicted=False,
            title="jitter of current sampling",
        ),
    ),
    axis="along the current's slope in the zero vector",
    order="1 at speed, no injection band within the zero vector",
    region="grows with speed (back-EMF) and current",
    confused_with=("current_filter", "pwm_delay", "encoder_offset"),
    separated_by=(
        "driven rotor at high speed under current, both directions, with the DC link nearly used "
        "up, which shortens the zero vector"
    ),
    trace=0.3,
    at=(
        At("instant", taken, ("delay", "jitter")),
        At("channels", apart, ("channel_lag",)),
    ),
    limits=limits,
    do=do,
    otherwise=otherwise,
)
