"""What the plant is looked at with: every effect at typical and double size, ten pairs, several
orders at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from model.effects import library
from model.effects.iron_loss import USUAL
from model.parameters import Drive
from model.spline import SplineEnergy

OUT = Path(__file__).parent / "results" / "plant"
PAIRS = (
    ("dead_time", "pwm_delay"),
    ("dead_time", "iron_loss"),
    ("dead_time", "device_drop"),
    ("dead_time", "current_filter"),
    ("iron_loss", "current_filter"),
    ("pwm_delay", "current_filter"),
    ("flux_harmonics", "inductance_harmonics"),
    ("skin_effect", "current_sampling"),
    ("dc_link_error", "dc_link_ripple"),
    ("dc_link_error", "pwm_delay"),
    ("encoder_eccentricity", "cogging_torque"),
)
SEVERAL = {
    "flux_harmonics.2": ("psi_d", "psi_q"),
    "inductance_harmonics.2": ("gamma",),
    "cogging_torque.2": ("amplitude",),
}
SATURATED = ("alpha_30", "alpha_12", "alpha_21", "alpha_03")  # of an inductance harmonic
OF_QUARTIC = ("cross_saturation", "inductance", "saturation")
TEETH_PHASE = 0.5  # rad: neither sine nor cosine alone
# of rated current, half-width of dead time's own zone, a tanh: about what is measured on a small
# drive
ZONE = 0.1


def sizes(name: str, drive: Drive, times: float) -> dict[str, float]:
    """Return an effect at so many times its typical size; what says how, not how much, stays (no
    jitter)."""
    card, motor = library.load_effect(name), drive.motor
    out = library.typical(name, motor, drive.converter)
    for p in card.parameters:
        value, neutral = out[f"{name}.{p.name}"], p.neutral_for(motor)
        if p.name in (card.switches or [q.name for q in card.parameters]):
            out[f"{name}.{p.name}"] = (
                value / times if np.isinf(neutral) else neutral + times * (value - neutral)
            )
    return {k: v for k, v in out.items() if not k.endswith("jitter")}


def core_loss(drive: Drive) -> dict[str, float]:
    """Return eddy currents at typical size, with excess loss and hysteresis as a core usually has
    beside them."""
    own = USUAL * drive.motor.rated_current
    return sizes("iron_loss", drive, 1.0) | {
        "iron_loss.excess_current": own,
        "iron_loss.hysteresis_current": own,
    }


def cases(drive: Drive) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield title and parameters of every run."""
    yield "none", {}
    for name in library.effect_names():
        for times in (1.0, 2.0):
            yield f"{name} x {times:g}", sizes(name, drive, times)
    second = {f"{part}.{n}" for part, names in SEVERAL.items() for n in names}
    motor, known = drive.motor, library.parameters()
    more = {name: known[name].typical_for(motor, drive.converter) for name in sorted(second)}
    firsts = {
        k: v for part in SEVERAL for k, v in sizes(part.partition(".")[0], drive, 1.0).items()
    }
    yield (
        "sixth and twelfth orders",
        firsts | more | {"cogging_torque.2.order_mech": 2.0 * motor.pole_pairs},
    )
    teeth = {f"inductance_harmonics.2.{n}" for n in SATURATED}
    yield (
        "twelfth order of saturated teeth",
        {name: known[name].typical_for(motor, drive.converter) for name in sorted(teeth)}
        | {"inductance_harmonics.2.phase": TEETH_PHASE},
    )
    yield (
        "dead_time x 1 in its own zone",
        sizes("dead_time", drive, 1.0)
        | {"dead_time.zone_width": ZONE * motor.rated_current, "dead_time.zone_shape": 1.0},
    )
    yield "core loss in three parts", core_loss(drive)
    yield "dead_time + core loss in three parts", core_loss(drive) | sizes("dead_time", drive, 1.0)
    for pair in PAIRS:
        yield " + ".join(pair), {k: v for name in pair for k, v in sizes(name, drive, 1.0).items()}


def of_quartic(drive: Drive, title: str) -> bool:
    """Return whether a case changes coefficients of the quartic and the motor has a flux map, which
    stays as it is."""
    return isinstance(drive.motor.energy, SplineEnergy) and title.partition(" ")[0] in OF_QUARTIC
