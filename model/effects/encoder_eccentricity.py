"""Eccentric code disc or magnet ring, and further orders of the reading's error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import INF, At, Effect, EffectPart, Limit, Parameter
from model.effects.said import angle, wave
from model.lanes import sine_cosine
from model.parameters import Converter, Motor

PARTS = 4  # once a turn, and three of the orders 2 ... HIGHEST
# a ring that is no circle errs twice a turn, magnets on the shaft 1, 2 and 4 times (magnet's place,
# gains and offsets of two tracks, their clipping); a resolver of k pole pairs 2 k times where its
# windings are not square, and those of drives have 4 pole pairs at most as a rule
HIGHEST = 8
FURTHER = tuple(f"encoder_eccentricity.{k}" for k in range(2, PARTS + 1))


@inlined
def off(amplitude_mech, phase, turn, pairs):
    """Return the reading's error (rad, electrical) at a mechanical angle (rad)."""
    sine, _ = sine_cosine(turn + phase)
    return pairs * amplitude_mech * sine


@inlined
def of_order(amplitude_mech, order_mech, phase, turn, pairs):
    """Return the same of any order a mechanical turn."""
    sine, _ = sine_cosine(order_mech * turn + phase)
    return pairs * amplitude_mech * sine


def waves(v: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return amplitude (rad, mechanical), order and phase (rad) of every part that is there."""
    first = "encoder_eccentricity"
    own = [(v[f"{first}.amplitude_mech"], 1.0, v[f"{first}.phase"])]
    own += [(v[f"{k}.amplitude_mech"], v[f"{k}.order_mech"], v[f"{k}.phase"]) for k in FURTHER]
    return [x for x in own if x[0]]


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how steep the error may be: beyond 1 the reading turns back while the rotor turns on,
    and no angle belongs to it."""
    slope = sum(abs(size) * abs(order) for size, order, _ in waves(v))
    what = "rad per rad, amplitudes times orders together: the reading must grow with the angle"
    yield Limit("encoder_eccentricity.amplitude_mech", slope, 1.0, what)


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    there = waves(v)
    correction = " and ".join(
        wave(f"{'−' if size < 0.0 else ''}{angle(size)}", order, phase)
        for size, order, phase in there
    )
    centre = "centre the code disc or magnet ring, or " if _once(there) else ""
    return (
        f"{centre}subtract {correction}, x the shaft's angle, from the encoder's mechanical reading"
    )


def _once(there: list[tuple[float, float, float]]) -> bool:
    """Return whether most of the error comes once a turn, as of a disc off its centre."""
    return max(there, key=lambda x: abs(x[0]))[1] == 1.0


CARD = Effect(
    name="encoder_eccentricity",
    summary="eccentric code disc or magnet ring, and further orders of the reading's error",
    subsystem="sensor",
    equation=(
        "theta_read = theta + p A sin(theta_mech + phase); further orders: + p A_n sin(n "
        "theta_mech + phase_n)"
    ),
    formulas=(
        r"\theta_\text{read} = \theta + p\,A \sin(\theta_\text{mech} + \varphi) + p \sum_n A_n "
        r"\sin(n\,\theta_\text{mech} + \varphi_n)",
    ),
    source=(
        "geometry of a disc off its centre; Hanselman, Resolver signal requirements for high "
        "accuracy resolver-to-digital conversion, IEEE Trans. Industrial Electronics 37 (1990) 556"
    ),
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
    order="1/p (once a mechanical turn), n/p",
    region="all, position-bound",
    confused_with=("cogging_torque", "current_offset"),
    separated_by="slow driven turns at constant speed: angle against time, once a mechanical turn",
    polar=("amplitude_mech", "phase"),
    at=(At("angle", off, ("amplitude_mech", "phase")),),
    switches=("amplitude_mech",),
    limits=limits,
    repeats=PARTS,
    further=EffectPart(
        parameters=(
            Parameter(
                "amplitude_mech",
                "rad",
                0.0,
                -0.5,
                0.5,
                0.002,
                title="amplitude of a further order of the encoder's error (mechanical)",
            ),
            Parameter(
                "order_mech",
                "",
                2.0,
                1.0,
                float(HIGHEST),
                2.0,
                fit="fixed",
                scan=(2.0, float(HIGHEST), 1.0),
                whole=True,
                title="order of the encoder's error",
            ),
            Parameter(
                "phase",
                "rad",
                0.0,
                -INF,
                INF,
                0.5,
                title="phase of a further order of the encoder's error",
            ),
        ),
        at=(At("angle", of_order, ("amplitude_mech", "order_mech", "phase")),),
        switches=("amplitude_mech",),
        polar=("amplitude_mech", "phase"),
    ),
    do=do,
)
