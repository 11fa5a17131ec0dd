"""A menu of further recordings: what a bench can do in seconds, as commands and motion, before
anything is measured.

Voltages are those of the nominal model for the currents that a bench's control reaches and for the
speed (open loop), so any parameter set can be asked what it would read.  Currents are in units of
rated current, speeds of rated speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from model.array_types import Array
from model.energy import flux_from_current
from model.parameters import Drive
from sandbox.gap.planning.in_map import furthest_d, held
from sandbox.plant.mechanics import turned_by
from sandbox.plant.sets import batch_of, features_of
from sandbox.recordings.campaign import Campaign, CampaignRecording

DURATION, FULL_RATE = 1.0, 8000.0  # s; Hz: faster drives record shorter, as many samples
STEPS = 4  # a period, of a free rotor whose friction changes within it
SETTLE = 0.1  # s at the start, until open-loop currents stand
# s: how slowly a bench's current control follows what is wanted; no step asks for the whole link
FOLLOWS = 5e-3
HALF_WAVE = 4  # samples of half a period of what is injected
# of the voltage limit that an experiment's commands may reach; larger ones are cut
LARGEST_SHARE = 0.95
# of the voltage limit at the most (control needs the rest); least share of the link
FULL, TIGHTEST = 0.86, 0.25


@dataclass(frozen=True)
class Entry:
    """One experiment: a name that stays, what a person would do, kind of rotor, wanted i_d, i_q
    (n,) in A and speed (n,) in rad/s electrical, the link's share, voltages injected on d and q,
    length in seconds."""

    name: str
    description: str
    rotor: str
    i_d: Array
    i_q: Array
    speed: Array
    link: float = 1.0
    injection: tuple[float, float] = (0.0, 0.0)  # V on d and q, square wave
    seconds: float = DURATION


def ramp(t: Array, *points: tuple[float, float]) -> Array:
    """Return straight lines through (share of the duration, value); t (n,): shares of the
    duration."""
    return np.asarray(np.interp(t, [p[0] for p in points], [p[1] for p in points]))


def usual_seconds(drive: Drive) -> float:
    """Return how long an experiment takes on a drive."""
    return DURATION * min(1.0, FULL_RATE * drive.converter.sampling_period)


class Courses(NamedTuple):
    """What experiments are made of, over the share of the duration that has passed (n,): currents
    in units of rated current, speeds in rad/s electrical."""

    t: Array
    zero: Array
    fade: Array  # from 0 to 1 while currents settle
    around: Array  # an angle, two turns
    both: Array  # a speed one way, then the other
    pulse: float  # V that are injected


def courses(drive: Drive, seconds: float) -> Courses:
    """Return what experiments of so many seconds are made of."""
    n = round(seconds / drive.converter.sampling_period)
    t = np.linspace(0.0, 1.0, n, endpoint=False)
    return Courses(
        t,
        np.zeros_like(t),
        np.minimum(seconds * t / SETTLE, 1.0),
        math.tau * 2.0 * t,
        drive.motor.rated_omega * ramp(t, (0.0, 0.8), (0.35, 0.8), (0.65, -0.8), (1.0, -0.8)),
        drive.injection.amplitude or 0.07 * drive.converter.dc_bus_voltage,
    )


def menu(drive: Drive, seconds: float | None = None) -> list[Entry]:
    """Return the experiments for a drive; seconds: how long each takes (`usual_seconds`)."""
    seconds, rate = usual_seconds(drive) if seconds is None else seconds, drive.motor.rated_current
    c = courses(drive, seconds)
    out = [*_locked(c), *_driven(c, drive), *_free(c, drive)]
    scaled = (replace(e, i_d=rate * e.i_d, i_q=rate * e.i_q, seconds=seconds) for e in out)
    return [_in_map(e, drive) for e in scaled]


def _locked(c: Courses) -> Iterator[Entry]:
    def entry(name: str, description: str, i_d: Array, i_q: Array, **more: Any) -> Entry:
        """Return an experiment with a locked rotor."""
        return Entry(
            f"locked_{name}", f"locked rotor, {description}", "locked", i_d, i_q, c.zero, **more
        )

    crossing = 0.15 * np.sin(2.0 * c.around)
    small = crossing, crossing * np.cos(c.around)
    steps = np.where(np.sin(3.0 * c.around) > 0.0, 0.6, -0.6)
    stairs: Array = np.round(4.0 * ramp(c.t, (0.0, -1.0), (1.0, 1.0))) / 4.0
    slowly = "current slowly through zero"
    yield entry("low_current", slowly, *small)
    yield entry("low_current_half_link", f"{slowly} at half the DC-link voltage", *small, link=0.5)
    turning = c.fade * np.cos(c.around), c.fade * np.sin(c.around)
    yield entry("circle", "current slowly around the circle", *turning)
    yield entry("steps", "large steps along d and q", steps, np.roll(steps, len(steps) // 5))
    text = "injection along d over a staircase on q"
    yield entry("q_inject_d", text, c.zero, stairs, injection=(c.pulse, 0.0))
    text = "injection along q over a staircase on d"
    yield entry("d_inject_q", text, stairs, c.zero, injection=(0.0, c.pulse))


def _driven(c: Courses, drive: Drive) -> Iterator[Entry]:
    def entry(
        name: str, how: str, i_d: Array, i_q: Array, speed: Array, link: float = 1.0
    ) -> Entry:
        """Return an experiment with a driven rotor."""
        return Entry(f"driven_{name}", f"driven {how}", "driven", i_d, i_q, speed, link)

    zero, some = c.zero, 0.35 * c.fade
    yield entry("fast_q", "fast both ways, current on q", zero, c.fade, c.both)
    yield entry("fast_idle", "fast both ways without current", zero, zero, c.both)
    text = "both ways without current at half the DC-link voltage"
    yield entry("idle_half_link", text, zero, zero, 0.5 * c.both, 0.5)
    link, top, high = tight(drive)
    text = "both ways, current along d, the DC-link voltage nearly used up"
    speed = top * ramp(c.t, (0, 0.8), (0.35, 1.0), (0.45, 1.0), (0.65, -0.8), (1, -1.0))
    yield entry("tight_link", text, high * c.fade, zero, speed, link)
    turn = np.full_like(c.t, 0.04 * drive.motor.rated_omega)
    yield entry("slow_dq", "slowly, current on d and q", some, some, turn)


def _free(c: Courses, drive: Drive) -> Iterator[Entry]:
    def entry(name: str, how: str, i_q: Array) -> Entry:
        """Return an experiment with a free rotor."""
        return Entry(f"free_{name}", f"free rotor, {how}", "free", c.zero, i_q, c.zero)

    period = drive.converter.sampling_period
    coast = ramp(c.t, (0, 0), (0.02, 0.4), (0.25, 0.4), (0.27, 0.0), (1, 0))
    yield entry("coast", "accelerated and left to coast to standstill", coast)
    swing = 0.5 * np.sign(np.sin(math.tau * np.cumsum(5.0 + 75.0 * c.t) * period))
    yield entry("swing", "torque reversed faster and faster", swing)


def _in_map(entry: Entry, drive: Drive) -> Entry:
    """Return an entry with its currents cut to a motor's flux map, its injection's swing beside
    them."""
    half = HALF_WAVE * drive.converter.sampling_period
    i_d, i_q = held(
        entry.i_d,
        entry.i_q,
        drive.motor.energy,
        (half * entry.injection[0], half * entry.injection[1]),
    )
    return replace(entry, i_d=i_d, i_q=i_q)


def settings(entry: Entry, drive: Drive) -> str:
    """Return an entry's largest values in the drive's units, as a person sets them on a bench."""
    rpm = 60.0 / math.tau / drive.motor.pole_pairs
    parts = [
        f"i_{axis} {x.min():.3g} to {x.max():.3g} A"
        for axis, x in (("d", entry.i_d), ("q", entry.i_q))
        if x.any()
    ]
    if entry.rotor == "driven":
        parts.insert(0, f"{rpm * entry.speed.min():.0f} to {rpm * entry.speed.max():.0f} rpm")
    parts += [
        f"{u:.3g} V square wave on {axis}"
        for axis, u in zip("dq", entry.injection, strict=True)
        if u
    ]
    return ", ".join([*parts, f"DC link {entry.link * drive.converter.dc_bus_voltage:.4g} V"])


def tight(drive: Drive) -> tuple[float, float, float]:
    """Return share of the link, speed (rad/s electrical) and i_d over rated current that use up
    FULL of the voltage."""
    motor, limit = drive.motor, FULL * drive.converter.voltage_limit
    high = furthest_d(motor.energy, 0.4 * motor.rated_current) / motor.rated_current
    flux = flux_from_current(motor.energy, high * motor.rated_current, 0.0)[0] + motor.magnet_flux
    link = min(max(0.8 * motor.rated_omega * float(flux) / limit, TIGHTEST), 1.0)
    return link, min(link * limit / float(flux), 1.2 * motor.rated_omega), high


def reached(wanted: Array, period: float) -> Array:
    """Return the current (n,) that control reaches: the one wanted (n,) through a first-order
    lag."""
    from scipy.signal import lfilter

    decay = math.exp(-period / FOLLOWS)
    return np.asarray(lfilter([1.0 - decay], [1.0, -decay], wanted))


def demand(
    entry: Entry, drive: Drive, torque_to_motion: Callable[[Array], Array]
) -> tuple[Array, Array, Array, Array]:
    """Return an entry's angle (rad) and speed (rad/s, both electrical), and the voltages u_d, u_q
    (V) it needs, (n,).

    torque_to_motion: the motion (rad, electrical) that the wanted torque (n,) in N m gives a free
    rotor.
    """
    motor, period = drive.motor, drive.converter.sampling_period
    i_d, i_q = reached(entry.i_d, period), reached(entry.i_q, period)
    d, q = flux_from_current(motor.energy, i_d, i_q)
    if entry.rotor == "free":
        torque = 1.5 * motor.pole_pairs * ((d + motor.magnet_flux) * i_q - q * i_d)
        theta = torque_to_motion(torque)
        speed = np.gradient(theta, period)
    else:
        speed = entry.speed
        theta = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * period)]) + 0.3
    u_d = motor.resistance * i_d + np.gradient(d, period) - speed * q
    u_q = motor.resistance * i_q + np.gradient(q, period) + speed * (d + motor.magnet_flux)
    wave = injected_wave(len(d))
    return theta, speed, u_d + entry.injection[0] * wave, u_q + entry.injection[1] * wave


def injected_wave(n: int) -> Array:
    """Return the injected square wave of size 1 (n,)."""
    return np.where(np.arange(n) % (2 * HALF_WAVE) < HALF_WAVE, 1.0, -1.0)


def recording_of(
    campaign: Campaign, entry: Entry, torque_to_motion: Callable[[Array], Array]
) -> Campaign:
    """Return a campaign of one recording with an entry's commands and angles; its currents are
    still zero.

    torque_to_motion: as `demand`.
    """
    drive = campaign.drive
    period = drive.converter.sampling_period
    theta, speed, u_d, u_q = demand(entry, drive, torque_to_motion)
    half = theta + 0.5 * speed * period
    link = entry.link * drive.converter.dc_bus_voltage
    size = np.hypot(u_d, u_q)
    scale = np.minimum(1.0, LARGEST_SHARE * link / math.sqrt(3.0) / np.maximum(size, 1e-9))
    u_d, u_q = u_d * scale, u_q * scale
    co, si = np.cos(half), np.sin(half)
    columns: dict[str, Array] = {
        "t": np.linspace(0.0, len(theta) * period, len(theta), endpoint=False),
        "u_alpha": co * u_d - si * u_q,
        "u_beta": si * u_d + co * u_q,
        **{f"i_{phase}": np.zeros(len(theta)) for phase in "abc"},
        "theta": theta,
        "u_dc": np.full(len(theta), link),
    }
    one = CampaignRecording(
        "next.parquet", entry.rotor, "none", columns, None if entry.link == 1.0 else link
    )
    return replace(campaign, recordings=(one,))


def shaft(values: Mapping[str, float], drive: Drive) -> Callable[[Array], Array]:
    """Return how a free rotor moves from rest: angle (n,) rad electrical of torque (n,), by a
    parameter set's shaft."""
    features = features_of(drive.motor, values)

    def move(torque: Sequence[float] | Array) -> Array:
        """Return the angle (n,) in rad electrical of a torque (n,) in N m."""
        batch, out = batch_of(drive.motor, drive.converter, [values], 1), np.zeros(len(torque))
        for row in ("load_gain", "load_offset"):
            batch[row][:] = 0.0
        turned_by(
            batch,
            features,
            np.asarray(torque, dtype=float),
            drive.converter.sampling_period,
            STEPS,
            out,
        )
        return out

    return move
