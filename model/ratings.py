"""Whether a drive's stated ratings can belong to one motor: a value in another unit shows before
anything runs."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

from model.drive_files import ASSUMED
from model.mapped import MappedMotor
from model.parameters import Drive, Motor
from model.rating_pairs import link, mending, pairs_off, plain

# Torque at rated current against the rated one: cross-saturation takes a few percent, reluctance at
# most doubles it, sqrt 2 for rms and 2 for peak to peak stay below; units that are mistaken differ
# by 1000.
TORQUE_OFF = 3.0
# More torque than rated current gives at any angle is none that saturation adds: half way (in the
# logarithm) to an rms value that stands for an amplitude.
TORQUE_RMS = 2.0**0.25
# Voltage at rated speed over what the link gives.  Field weakening reaches four to five times its
# base speed; a motor that needs a tenth of its link is one whose speed stands in rad/s (9.5 times
# too low), or whose link is not stated.
VOLTAGE_HIGH, VOLTAGE_LOW = 5.0, 0.1
RUN_UP = 0.1  # s: assumed, in which rated torque brings an inertia that stands in to rated speed
STANDS_IN = f"rated torque brings it to rated speed in {RUN_UP:g} s"
UNIT_OF = {
    "sampling_period": "s",
    "dc_bus_voltage": "V",
    "current_noise": "A rms",
    "encoder_counts": "a turn",
}


class Off(NamedTuple):
    """What does not go together, in words, and what is asked where no single unit would mend all
    of it."""

    said: str
    asked: str


SAID, NAMED = 2, 3  # statements, and guesses, in a sentence
NOT_KNOWN = "one of these values is in another unit, or of another motor"


def cautions(drive: Drive) -> tuple[str, ...]:
    """Return a sentence for each rating that does not go with the others, and what a flux map says
    against itself."""
    return (*_ratings(drive), *map_notes(drive.motor))


def _ratings(drive: Drive) -> tuple[str, ...]:
    simple, pairs = (*_torque(drive.motor), *_speed(drive)), pairs_off(drive)
    said = [*(o.said for o in simple), *pairs]
    if not said:
        return ()
    names = mending(drive, lambda d: not _torque(d.motor) and not _speed(d))
    if names:
        return (f"{'; '.join(said[:SAID])}; no motor has that: {', or '.join(names[:NAMED])}?",)
    if simple:
        return tuple(f"{o.said}{o.asked}" for o in simple)
    return (f"{'; '.join(said[:SAID])}; no motor has that: {NOT_KNOWN}",)


def assumed(drive: Drive, unused: Collection[str] = ()) -> tuple[str, ...]:
    """Return a sentence on what [drive] does not state, with the usual values that stand in;
    nothing where it does. unused: keys that a result does not depend on."""
    keys = [k for k in drive.provenance.get(ASSUMED, "").split(", ") if k and k not in unused]
    if not keys:
        return ()
    own = ", ".join(f"{k} = {getattr(drive.converter, k):g} {UNIT_OF[k]}" for k in keys)
    return (f"[drive] does not state {_listing(keys)}; usual values stand in: {own}",)


def _listing(names: Sequence[str]) -> str:
    """Return names with commas, "and" before the last."""
    return " and ".join(x for x in (", ".join(names[:-1]), names[-1]) if x)


def map_notes(motor: Motor) -> tuple[str, ...]:
    """Return what the flux map of a motor says against itself, nothing of a motor without one."""
    return motor.origin.notes if isinstance(motor, MappedMotor) and motor.origin else ()


def _torque(m: Motor) -> list[Off]:
    magnet = 1.5 * m.pole_pairs * m.magnet_flux * m.rated_current
    most = largest_torque(m)
    if magnet > TORQUE_OFF * m.rated_torque:
        found, off = magnet, magnet / m.rated_torque
    elif most < m.rated_torque / TORQUE_OFF:
        found, off = most, m.rated_torque / most if most else math.inf
    elif most < m.rated_torque / TORQUE_RMS:
        return [_rms(m, most)]
    else:
        return []
    return [
        Off(
            f"rated_current gives {plain(found)} N m (3/2 pole_pairs x magnet_flux x "
            f"rated_current{'' if found == magnet else ', with reluctance'}), rated_torque is "
            f"{plain(m.rated_torque)} N m: a factor of {plain(off)}, where saturation and "
            f"reluctance explain less than {TORQUE_OFF:g}",
            "; is magnet_flux in mWb, rated_torque in mN m or worked out from kW, or rated_current "
            "in mA or rms?",
        )
    ]


def _rms(m: Motor, most: float) -> Off:
    return Off(
        f"rated_torque is {plain(m.rated_torque)} N m, {plain(m.rated_torque / most)} times the "
        f"{plain(most)} N m that rated_current gives at most (3/2 pole_pairs x magnet_flux x "
        "rated_current, with reluctance)",
        "; is rated_current or magnet_flux an rms value (multiply it by sqrt(2)), or rated_torque "
        "the peak one?",
    )


def run_up_inertia(rated_torque: float, rated_speed_rpm: float) -> float:
    """Return the inertia (kg m^2) that stands in where none is known: rated torque brings it to
    rated speed in RUN_UP."""
    return min(max(rated_torque * RUN_UP / (rated_speed_rpm * math.pi / 30.0), 1e-9), 1e4)


def largest_torque(m: Motor) -> float:
    """Return the largest torque (N m) of rated current at any angle to the magnet, without
    saturation."""
    i, gap = m.rated_current, m.inductance_d - m.inductance_q
    angles = (math.pi * k / 180.0 for k in range(181))
    flux = (m.magnet_flux * math.sin(a) + gap * i * math.sin(a) * math.cos(a) for a in angles)
    return 1.5 * m.pole_pairs * i * max(flux)


def _speed(drive: Drive) -> list[Off]:
    m, limit = drive.motor, drive.converter.voltage_limit
    back = m.rated_omega * m.magnet_flux
    loaded = m.rated_omega * math.hypot(m.magnet_flux, m.inductance_q * m.rated_current)
    if VOLTAGE_LOW * limit <= loaded and back <= VOLTAGE_HIGH * limit:
        return []
    high = back > VOLTAGE_HIGH * limit
    said = f"the back-EMF is {plain(back)} V" if high else f"rated current takes {plain(loaded)} V"
    unusual = (
        f"more than {VOLTAGE_HIGH:g} times that, field weakening included,"
        if high
        else "less than a tenth of that"
    )
    unit = "Hz or electrical" if high else "rad/s"
    return [
        Off(
            f"at rated_speed_rpm = {m.rated_speed_rpm:g} {said}, and {link(drive)} gives "
            f"{plain(limit)} V; {unusual} is not usual",
            f": is the speed in {unit}, magnet_flux in another unit, or [drive] dc_bus_voltage "
            "another one?",
        )
    ]
