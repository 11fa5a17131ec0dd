"""Samples taken beside the centre of the zero vector, and their jitter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import quantity
from model.parameters import Converter, Motor


@inlined
def taken(delay, jitter):
    """Return by how much samples are taken late (s) and the variance of their jitter (s^2)."""
    return delay, jitter * jitter


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
        "current_sampling.jitter",
        6.0 * v["current_sampling.jitter"],
        half,
        "s in six sigma, half the PWM period",
    )


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
    return "; ".join([*shift, *shake])


CARD = Effect(
    name="current_sampling",
    summary="samples taken beside the centre of the zero vector, and their jitter",
    subsystem="sensor",
    equation=(
        "reading = i(t_k + delay + jitter x normal): within the zero vector no voltage acts, "
        "i(psi - s R i, theta + s omega); jitter is noise: simulated sample by sample, never "
        "predicted - a replay leaves it in the residual as jitter x slope of the current, above "
        "the sensors' noise"
    ),
    formulas=(r"i_\text{read} = i(t_k + t_d + \sigma\,\xi), \qquad \xi \sim \mathcal N(0, 1)",),
    source=(
        "Blasko, Kaura, Niewiadomski, Sampling of discontinuous voltage and current signals in "
        "electrical drives: a system approach, IEEE Trans. Ind. Appl. 34 (1998) 1123"
    ),
    parameters=(
        Parameter("delay", "s", 0.0, -1e-2, 1e-2, 5e-6, title="delay of current sampling"),
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
    at=(At("instant", taken, ("delay", "jitter")),),
    limits=limits,
    do=do,
)
