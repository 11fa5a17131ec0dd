"""The menu's experiments as a bench may run them: shrunk into its limits of current, speed and link
voltage.

What counts is what the motor is predicted to do, not what is asked for: an injection's ripple adds
to the current, and a free rotor's speed follows from the torque.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from model.energy import currents, flux_from_current
from model.errors import PhysicsError
from model.parameters import Drive, Limits
from sandbox.gap.planning.menu import HALF_WAVE, LARGEST_SHARE, Entry, demand, menu, shaft
from sandbox.plant.sets import complete

# of rated speed: what a free rotor may reach where no limit is stated, as the menu's driven ones do
FASTEST = 1.2
LEAST = 0.05  # of an experiment's own currents; with less there is nothing to see
# of shrinking; of a limit, at which it aims where the first proportion was not enough
TRIES, MARGIN = 12, 0.99
# times a limit (or no number, where the motor cannot have such currents): halved until it comes
# near
FAR = 20.0
ROUNDING = 1.0 + 1e-9
STEP = 1e-3  # s between the instants that are looked at


@dataclass(frozen=True)
class Peaks:
    """Largest current (A, with an injection's ripple), speed (rad/s electrical) and voltage (V) of
    an experiment."""

    current: float
    speed: float
    voltage: float

    def over(self, room: Peaks) -> float:
        """Return how many times the room these are, the worst of the three."""
        return max(
            self.current / room.current, self.speed / room.speed, self.voltage / room.voltage
        )


def allowed(drive: Drive, limits: Limits, seconds: float | None = None) -> list[Entry]:
    """Return the menu's experiments that a bench can do, within its limits; seconds: as `menu`."""
    return [e for e in (within(x, drive, limits) for x in menu(drive, seconds)) if e is not None]


def within(entry: Entry, drive: Drive, limits: Limits) -> Entry | None:
    """Return an experiment with its link, speeds and currents shrunk into the limits, None where
    the bench cannot do it, or where less than LEAST of its currents would remain.

    An imposed speed is shrunk into the limit of speed, and further only where the voltage does not
    suffice.
    """
    if entry.rotor not in limits.can or (limits.fixed_link and entry.link != 1.0):
        return None
    bus = drive.converter.dc_bus_voltage
    if limits.voltage is not None and limits.voltage < bus:
        entry = replace(entry, link=entry.link * limits.voltage / bus)
    room = room_for(entry, drive, limits)
    if room == Peaks(math.inf, math.inf, math.inf):
        return entry
    fastest = float(np.max(np.abs(entry.speed)))
    slower = replace(entry, speed=min(1.0, room.speed / max(fastest, 1e-9)) * entry.speed)
    share, turning, found = 1.0, 1.0, slower
    for _ in range(TRIES):
        peaks = _peaks(found, drive)
        over = peaks.over(room)
        if over <= ROUNDING:
            return found
        step = (1.0 if share == 1.0 else MARGIN) / (over if over < FAR else 2.0)
        share *= step
        turning *= step if peaks.voltage > ROUNDING * room.voltage else 1.0
        if share < LEAST:
            return None
        found = replace(
            slower, i_d=share * entry.i_d, i_q=share * entry.i_q, speed=turning * slower.speed
        )
    return None


def of_link(entries: Iterable[Entry], drive: Drive, limits: Limits) -> str:
    """Return what experiments take the DC link to be: fixed or not, and stiff."""
    bus = drive.converter.dc_bus_voltage
    stiff = "within an experiment it is taken as stiff: it stays, whatever current is drawn"
    if limits.fixed_link:
        return (
            f"the DC link is taken as fixed at {min(limits.voltage or bus, bus):.4g} V: "
            f"experiments that ask for another voltage are left out; {stiff}"
        )
    others = [f"{e.name} {e.link * bus:.4g} V" for e in entries if abs(e.link - 1.0) > 1e-9]
    if not others:
        return f"all experiments run at a DC link of {bus:.4g} V; {stiff}"
    return (
        f"the DC link is taken as adjustable ({', '.join(others)}); where yours stays at "
        f"{bus:.4g} V, give --fixed-link, or [limits] fixed_link = true in the motor's file; "
        f"{stiff}"
    )


def room_for(entry: Entry, drive: Drive, limits: Limits) -> Peaks:
    """Return what an experiment may reach, infinite where nothing is stated."""
    motor = drive.motor
    current = math.inf if limits.current is None else limits.current
    speed = FASTEST * motor.rated_omega if entry.rotor == "free" else math.inf
    speed = (
        speed if limits.speed_rpm is None else motor.pole_pairs * limits.speed_rpm * math.pi / 30.0
    )
    link = math.inf if limits.voltage is None else entry.link * drive.converter.voltage_limit
    return Peaks(current, speed, LARGEST_SHARE * link)


def _peaks(entry: Entry, drive: Drive) -> Peaks:
    """Return an experiment's peaks, looked at every STEP; infinite where the motor cannot have such
    currents."""
    every = max(1, round(STEP / drive.converter.sampling_period))
    slow = replace(
        drive,
        converter=replace(
            drive.converter,
            sampling_period=every * drive.converter.sampling_period,
            pwm_frequency=None,
        ),
    )
    thin = replace(
        entry, i_d=entry.i_d[::every], i_q=entry.i_q[::every], speed=entry.speed[::every]
    )
    try:
        motion = shaft(complete(slow.motor, slow.converter), slow)
        speed, u_d, u_q = demand(thin, slow, motion)[1:]
        current = largest_current(entry, drive)
    except PhysicsError:
        return Peaks(math.inf, math.inf, math.inf)
    return Peaks(current, float(np.max(np.abs(speed))), float(np.max(np.hypot(u_d, u_q))))


def largest_current(entry: Entry, drive: Drive) -> float:
    """Return the largest current (A peak) of an experiment, with its injection's ripple on the
    motor's own map.

    The wave starts with a whole half period, so that the flux at first swings to one side.
    PhysicsError where the motor cannot have these currents.
    """
    asked = np.hypot(entry.i_d, entry.i_q)
    if not any(entry.injection):
        return float(np.max(asked))
    energy, most = drive.motor.energy, 0.0
    swing = HALF_WAVE * drive.converter.sampling_period * np.array(entry.injection)
    levels = np.unique(np.round(np.column_stack([entry.i_d, entry.i_q]), 9), axis=0)
    d, q = flux_from_current(energy, levels[:, 0], levels[:, 1])
    for sign in (-1.0, 1.0):
        for x, y in zip(d + sign * swing[0], q + sign * swing[1], strict=True):
            most = max(most, math.hypot(*currents(energy, float(x), float(y))))
    return max(most, float(np.max(asked)))
