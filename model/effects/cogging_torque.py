"""Torque of the magnets against the slots."""

from __future__ import annotations

from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import INF, At, Effect, Parameter
from model.effects.said import on_q, quantity, wave
from model.lanes import sine_cosine
from model.parameters import Converter, Motor


@inlined
def helping(amplitude, order_mech, phase, turn, omega):
    """Return the torque (N m) at a mechanical angle (rad), whatever the speed."""
    sine, _ = sine_cosine(order_mech * turn + phase)
    return amplitude * sine


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    parts = [f"cogging_torque.{k}" for k in ("", *(f"{k}." for k in range(2, CARD.repeats + 1)))]
    there = [p for p in parts if v[f"{p}amplitude"]]
    waves = (
        wave(quantity(v[f"{p}amplitude"], "N m"), v[f"{p}order_mech"], v[f"{p}phase"])
        for p in there
    )
    amps = on_q(max((abs(v[f"{p}amplitude"]) for p in there), default=0.0), motor)
    return (
        f"subtract {' and '.join(waves)}, x the shaft's angle, from the torque's reference{amps}; "
        "or keep it in the simulator: it comes with the motor"
    )


CARD = Effect(
    name="cogging_torque",
    summary="torque of the magnets against the slots",
    subsystem="mechanics",
    equation=(
        "torque A sin(n theta_mech + phase), from the potential A/n cos(n theta_mech + "
        "phase); further orders add up"
    ),
    formulas=(r"T \;\text{+=}\; \sum_n A_n \sin(n\,\theta_\text{mech} + \varphi_n)",),
    source=(
        "Zhu, Howe, Influence of design parameters on cogging torque in permanent magnet "
        "machines, IEEE Trans. Energy Conversion 15 (2000) 407"
    ),
    parameters=(
        Parameter("amplitude", "N m", 0.0, 0.0, 1e5, 0.03, "rated torque", title="cogging torque"),
        Parameter(
            "order_mech",
            "",
            6.0,
            1.0,
            1e4,
            6.0,
            "pole pairs",
            fit="fixed",
            scan=(1.0, 72.0, 1.0),
            # slots / gcd(slots, poles): 21 of 21 slots and 20 poles; most machines have 3 to 9
            scan_poles=21,
            resolved_by="turns",
            title="order of cogging",
        ),
        Parameter("phase", "rad", 0.0, -INF, INF, 0.0, change=1.0, title="phase of cogging"),
    ),
    axis="motion",
    order="n/p electrical (lcm of poles and slots)",
    region="free rotor at low speed, without current, too",
    confused_with=("flux_harmonics", "encoder_eccentricity", "inductance_harmonics"),
    separated_by="slow free run and coasting without current: ripple of speed bound to position",
    polar=("amplitude", "phase"),
    at=(At("torque", helping, ("amplitude", "order_mech", "phase")),),
    switches=("amplitude",),
    repeats=6,
    do=do,
)
