"""The nominal motor that a campaign states, with rated values from the recordings where it states
none."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from model.parameters import Motor, build, finite
from model.ratings import largest_torque, run_up_inertia

SLOWEST, FASTEST = 10.0, 1e5  # rpm, of a speed that the link stands in for
RATED = ("rated_current", "rated_torque", "rated_speed_rpm")


class Reached(NamedTuple):
    """How far recordings go: largest current (A), largest mean speed (rad/s electrical), whether a
    rotor is free."""

    current: float
    speed: float
    free: bool


def nominal_motor(
    stated: Mapping[str, Any],
    flux_map: Mapping[str, Any] | None,
    reached: Reached | None,
    folder: Path,
    link: float,
) -> tuple[Motor, tuple[str, ...]]:
    """Return the nominal motor (a quartic's, or one with a flux map), and which values stand in.

    stated: its name and [motor]; flux_map: [flux_map], whose file lies in `folder` or in a data
    set; link: V, nominal. A rated value that is not stated is the largest one `reached` (None:
    nothing was recorded); the torque is what rated current gives; a speed that no recording reached
    is what the link gives; an inertia where no rotor is free is that of `run_up_inertia`. BadInput
    for wrong values.
    """
    values = dict(stated)
    found = _rated(values, reached or Reached(0.0, 0.0, False))
    if reached is not None and not reached.free:
        found["inertia"] = 1.0  # until rated values are known
    missing = tuple(k for k in found if k not in values)
    values = {**values, **{k: found[k] for k in missing}}
    if flux_map is None:
        motor = build(Motor, values, "motor")
    else:
        from model.mapped import mapped_motor, stand_in

        stand_in(values, flux_map)  # says what is wrong before a file is touched
        motor = mapped_motor(values, flux_map, folder)
        if "rated_torque" in missing:  # the map alone knows the magnet flux and the saliency
            motor = dataclasses.replace(
                motor, rated_torque=largest_torque(motor) or values["rated_torque"]
            )
    if "rated_speed_rpm" in missing and not (reached and reached.speed):
        motor = dataclasses.replace(motor, rated_speed_rpm=base_speed(motor, link))
    if "inertia" in missing:
        own = run_up_inertia(motor.rated_torque, motor.rated_speed_rpm)
        motor = dataclasses.replace(motor, inertia=own)
    return motor, missing


def base_speed(motor: Motor, link: float) -> float:
    """Return the speed (rpm) at which rated current on q takes all that a link (V) gives,
    resistance aside."""
    flux = math.hypot(motor.magnet_flux, motor.inductance_q * motor.rated_current)
    omega = link / math.sqrt(3.0) / flux if flux > 0.0 else math.inf
    return min(max(omega * 30.0 / math.pi / motor.pole_pairs, SLOWEST), FASTEST)


def _rated(values: Mapping[str, Any], reached: Reached) -> dict[str, float]:
    """Return the rated values that recordings tell: largest current (A), its torque (N m), largest
    mean speed (rpm)."""
    stated = (values.get("pole_pairs"), values.get("magnet_flux"))
    pairs, flux = (max(finite(x) or 0.0, 0.0) for x in stated)  # Motor says what is wrong
    rated = max(finite(values.get("rated_current")) or 0.0, 0.0) or reached.current
    return {
        "rated_current": reached.current or 1.0,
        "rated_torque": 1.5 * pairs * flux * rated or 1.0,
        "rated_speed_rpm": reached.speed * 30.0 / math.pi / (pairs or 1.0) or SLOWEST,
    }
