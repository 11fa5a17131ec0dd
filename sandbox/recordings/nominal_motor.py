"""The nominal motor that a campaign states, with rated values from the recordings where it states none."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from model.parameters import Motor, build, finite
from model.ratings import largest_torque

if TYPE_CHECKING:
    from sandbox.recordings.campaign import CampaignRecording

UNUSED_INERTIA = 1e-3  # kg m^2, of a campaign in which no rotor is free and none is stated
RATED = ("rated_current", "rated_torque", "rated_speed_rpm")


def nominal_motor(
    stated: Mapping[str, Any], flux_map: Mapping[str, Any] | None, recordings: Sequence[CampaignRecording], folder: Path
) -> tuple[Motor, bool]:
    """Return the nominal motor (a quartic's, or one with a flux map), and whether rated values come from recordings.

    stated: its name and [motor]; flux_map: [flux_map], whose file lies in `folder` or in a data set.  A rated value
    that is not stated is the largest recorded one; the torque is what rated current gives.  BadInput for wrong values.
    """
    values = dict(stated)
    if "inertia" not in values and recordings and all(r.rotor != "free" for r in recordings):
        values["inertia"] = UNUSED_INERTIA
    missing = [k for k in RATED if k not in values]
    if missing:
        found = _recorded(values, recordings)
        values = {**values, **{k: found[k] for k in missing}}
    if flux_map is None:
        return build(Motor, values, "motor"), bool(missing)
    from model.mapped import mapped_motor, stand_in

    stand_in(values, flux_map)  # says what is wrong before a file is touched
    motor = mapped_motor(values, flux_map, folder)
    if "rated_torque" in missing:  # the map alone knows the magnet flux and the saliency
        motor = dataclasses.replace(motor, rated_torque=largest_torque(motor) or values["rated_torque"])
    return motor, bool(missing)


def _recorded(values: Mapping[str, Any], recordings: Sequence[CampaignRecording]) -> dict[str, float]:
    """Return the rated values that recordings tell: largest current (A), its torque (N m), largest mean speed (rpm)."""
    current = max((float(np.max(np.hypot(*r.current))) for r in recordings), default=0.0)
    moving = [r for r in recordings if r.rotor != "locked"]
    omega = max((float(np.ptp(r.theta) / np.ptp(r.t)) for r in moving), default=0.0)
    stated = (values.get("pole_pairs"), values.get("magnet_flux"))
    pairs, flux = (max(finite(x) or 0.0, 0.0) for x in stated)  # Motor says what is wrong
    rated = max(finite(values.get("rated_current")) or 0.0, 0.0) or current
    return {
        "rated_current": current or 1.0,
        "rated_torque": 1.5 * pairs * flux * rated or 1.0,
        "rated_speed_rpm": omega * 30.0 / math.pi / (pairs or 1.0) or 1.0,
    }
