"""What to record on a bench that does not exist yet: experiments within its limits, and what each would tell.

The menu is that of `next_recording`; each experiment is simulated with the nominal motor, and the effects whose typical
size stands clear of noise and ordinary deviations are listed (`visible`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from model.errors import BadInput, PhysicsError, unknown
from model.parameters import Drive
from sandbox.gap.planning.menu import Entry, menu, recording_of, settings, shaft
from sandbox.gap.planning.visible import CLEAR, Visible, visible
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import ROTORS, Campaign
from sandbox.replay.replay import prepare, replay

LEAST_LINK = 1.05  # of the voltage that an experiment needs: a bench's link must have as much
ENCODER = 4096  # counts a turn, where the motor's file names none


@dataclass(frozen=True)
class Limits:
    """What a bench may do: A peak, rpm and V at the most (None: the motor's rated values and link), kinds of rotor."""

    current: float | None = None
    speed_rpm: float | None = None
    voltage: float | None = None
    can: tuple[str, ...] = ROTORS


@dataclass(frozen=True)
class Planned:
    """An experiment with its settings in words and what it would tell; adds: effects that those before it do not."""

    entry: Entry
    settings: str
    visible: Visible
    adds: tuple[str, ...]

    @property
    def tells(self) -> tuple[str, ...]:
        """Effects whose typical size stands clear."""
        return tuple(e for e, z in self.visible.sizes.items() if z >= CLEAR)


@dataclass(frozen=True)
class Plan:
    """Experiments in their order, and what all of them together would tell."""

    drive: Drive
    experiments: tuple[Planned, ...]
    together: Visible


def plan(drive: Drive, limits: Limits, *, workers: int = 1) -> Plan:
    """Return experiments within a bench's limits, each the one that adds most to those before it, until none adds any.

    BadInput where the limits leave no experiment.
    """
    for kind in limits.can:
        if kind not in ROTORS:
            raise unknown("kind of rotor", kind, ROTORS)
    if drive.converter.encoder_counts is None:
        drive = replace(drive, converter=replace(drive.converter, encoder_counts=ENCODER))
    entries = [e for e in (_within(e, drive, limits) for e in menu(drive)) if e is not None]
    if not entries:
        raise BadInput("no experiment of the menu is within these limits; allow more current, speed or voltage")
    told: list[tuple[Entry, Visible]] = []
    simulated: dict[str, Campaign] = {}
    for entry in entries:
        try:
            simulated[entry.name] = _simulated(drive, entry)
            told.append((entry, visible(simulated[entry.name], workers=workers)))
        except (BadInput, PhysicsError):  # the nominal motor cannot do it
            continue
    chosen = _ordered(drive, told)
    if not chosen:
        raise BadInput("within these limits no effect of typical size stands clear of the noise; allow more current")
    recordings = tuple(r for p in chosen for r in simulated[p.entry.name].recordings)
    whole = replace(simulated[chosen[0].entry.name], recordings=recordings)
    return Plan(drive, tuple(chosen), visible(whole, workers=workers))


def _ordered(drive: Drive, told: Sequence[tuple[Entry, Visible]]) -> list[Planned]:
    """Return the experiments that add effects, the one that adds most first."""
    seen: set[str] = set()
    rest, out = list(told), list[Planned]()
    while rest:
        news = [tuple(e for e, z in v.sizes.items() if z >= CLEAR and e not in seen) for _, v in rest]
        k = int(np.argmax([len(n) for n in news]))
        if not news[k]:
            return out
        entry, view = rest.pop(k)
        out.append(Planned(entry, settings(entry, drive), view, news[k]))
        seen |= set(news[k])
    return out


def _within(entry: Entry, drive: Drive, limits: Limits) -> Entry | None:
    """Return an experiment with its currents and speeds shrunk into the limits, None where the bench cannot do it."""
    if entry.rotor not in limits.can:
        return None
    rpm = 60.0 / math.tau / drive.motor.pole_pairs
    current = float(np.max(np.hypot(entry.i_d, entry.i_q)))
    speed = float(np.max(np.abs(entry.speed))) * rpm
    by_current = min(1.0, limits.current / current) if limits.current and current > 0.0 else 1.0
    by_speed = min(1.0, limits.speed_rpm / speed) if limits.speed_rpm and speed > 0.0 else 1.0
    if limits.voltage is not None and entry.link * drive.converter.dc_bus_voltage > limits.voltage:
        return None
    return replace(entry, i_d=by_current * entry.i_d, i_q=by_current * entry.i_q, speed=by_speed * entry.speed)


def _simulated(drive: Drive, entry: Entry) -> Campaign:
    """Return an experiment as a campaign with the readings of the nominal motor, without noise."""
    values = complete(drive.motor, drive.converter)
    campaign = Campaign(drive.name, drive, (), {}, {}, False)
    planned = recording_of(campaign, entry, shaft(values, drive))
    truth = {k: v for k, v in values.items() if v == v}
    read = replay(prepare(planned, truth, steps=1), [truth]).currents[0][:, :, 0]
    r = planned.recordings[0]
    columns = {**r.columns, **{f"i_{p}": read[:, k].copy() for k, p in enumerate("abc")}}
    own = replace(r, file=f"{entry.name}.parquet", columns=columns)
    return replace(planned, recordings=(own,))


def setpoints(entry: Entry, drive: Drive) -> list[dict[str, float]]:
    """Return an experiment's setpoints every millisecond: s, A, rpm; injected square wave (V) and link (V)."""
    step = max(1, round(1e-3 / drive.converter.sampling_period))
    rpm = 60.0 / math.tau / drive.motor.pole_pairs
    return [
        {"t_s": k * drive.converter.sampling_period, "i_d_A": float(entry.i_d[k]), "i_q_A": float(entry.i_q[k]),
         "speed_rpm": float(entry.speed[k]) * rpm, "injected_d_V": entry.injection[0],
         "injected_q_V": entry.injection[1], "link_V": entry.link * drive.converter.dc_bus_voltage}
        for k in range(0, len(entry.i_d), step)
    ]  # fmt: skip
