"""Eccentric code disc or magnet ring."""

from __future__ import annotations

from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import INF, At, Effect, Parameter
from model.effects.said import angle, wave
from model.lanes import sine_cosine
from model.parameters import Converter, Motor


@inlined
def off(amplitude_mech, phase, turn, pairs):
    """Return the reading's error (rad, electrical) at a mechanical angle (rad)."""
    sine, _ = sine_cosine(turn + phase)
    return pairs * amplitude_mech * sine


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    size, phase = v["encoder_eccentricity.amplitude_mech"], v["encoder_eccentricity.phase"]
    correction = wave(f"{'−' if size < 0.0 else ''}{angle(size)}", 1, phase)
    return (
        f"centre the code disc or magnet ring, or subtract {correction}, x the shaft's angle, from "
        "the encoder's mechanical reading"
    )


CARD = Effect(
    name="encoder_eccentricity",
    summary="eccentric code disc or magnet ring",
    subsystem="sensor",
    equation="theta_read = theta + p A sin(theta_mech + phase)",
    formulas=(r"\theta_\text{read} = \theta + p\,A \sin(\theta_\text{mech} + \varphi)",),
    source="geometry of a disc off its centre; first harmonic",
    parameters=(
        Parameter(
            "amplitude_mech",
            "rad",
            0.0,
            -0.5,
            0.5,
            0.005,
            title="amplitude of the encoder's error (mechanical)",
        ),
        Parameter("phase", "rad", 0.0, -INF, INF, 0.5, title="phase of the encoder's error"),
    ),
    axis="d from q and q from d",
    order="1/p (once a mechanical turn)",
    region="all, position-bound",
    confused_with=("cogging_torque", "current_offset"),
    separated_by="slow driven turns at constant speed: angle against time, once a mechanical turn",
    polar=("amplitude_mech", "phase"),
    at=(At("angle", off, ("amplitude_mech", "phase")),),
    switches=("amplitude_mech",),
    do=do,
)
