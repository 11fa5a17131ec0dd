"""What to record on a bench that does not exist yet: experiments within its limits, and what each
would tell.

The menu is that of `next_recording`; each experiment is simulated with the nominal motor, and the
effects whose typical size stands clear of noise and ordinary deviations are listed (`visible`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from model.compiled import WATCH
from model.drive_files import ASSUMED
from model.errors import BadInput, PhysicsError
from model.parameters import Drive, Limits
from sandbox.gap.planning.menu import Entry, recording_of, settings, shaft
from sandbox.gap.planning.visible import CLEAR, Visible, visible
from sandbox.gap.planning.within import allowed, of_link
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.replay import prepare, replay

DIGITS = "%.7g"  # of a setpoint
ENCODER = 4096  # counts a turn, where the motor's file names none


@dataclass(frozen=True)
class Planned:
    """An experiment with its settings in words and what it would tell; adds: effects that those
    before it do not."""

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
    limits: Limits

    @property
    def link(self) -> str:
        """What the experiments take the DC link to be, in words."""
        return of_link((p.entry for p in self.experiments), self.drive, self.limits)

    @property
    def adds(self) -> tuple[str, ...]:
        """Effects that stand clear in all experiments together, but in none of them alone."""
        alone = {e for p in self.experiments for e in p.tells}
        return tuple(e for e, z in self.together.sizes.items() if z >= CLEAR and e not in alone)


def plan(
    drive: Drive,
    limits: Limits,
    *,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """Return experiments within a bench's limits, each the one that adds most to those before it,
    until none adds any.

    progress: called with the share of the time that is over, as far as what is done tells (`over`).
    BadInput where the limits leave no experiment.
    """
    began, compiled, ends = time.monotonic(), WATCH.seconds, list[float]()
    if drive.converter.encoder_counts is None:
        drive = with_encoder(drive)
    entries = allowed(drive, limits)
    if not entries:
        raise BadInput(
            "no experiment of the menu is within these limits; allow more current, speed or voltage"
        )
    shown: list[tuple[Entry, Visible]] = []
    simulated: dict[str, Campaign] = {}
    for k, entry in enumerate(entries):
        if progress is not None:
            ends += [time.monotonic() - began] * (k > 0)
            progress(over(ends, WATCH.seconds - compiled, len(entries) + 1))
        try:
            simulated[entry.name] = _simulated(drive, entry)
            shown.append((entry, visible(simulated[entry.name], workers=workers)))
        except (BadInput, PhysicsError):  # the nominal motor cannot do it
            continue
    chosen = ordered(drive, shown)
    if not chosen:
        raise BadInput(
            "within these limits no effect of typical size stands clear of the noise; "
            "allow more current"
        )
    recordings = tuple(r for p in chosen for r in simulated[p.entry.name].recordings)
    whole = replace(simulated[chosen[0].entry.name], recordings=recordings)
    return Plan(drive, tuple(chosen), visible(whole, workers=workers), limits)


def with_encoder(drive: Drive) -> Drive:
    """Return a drive with an encoder that its file does not state, as its provenance says."""
    said = [x for x in (drive.provenance.get(ASSUMED), "encoder_counts") if x]
    return replace(
        drive,
        converter=replace(drive.converter, encoder_counts=ENCODER),
        provenance={**drive.provenance, ASSUMED: ", ".join(said)},
    )


def over(ends: Sequence[float], compiling: float, pieces: int) -> float:
    """Return the share of the time that is over when some of the pieces have ended (s), 0 before
    the first has.

    The first compiles what all others need (s); how long those take is known once there are two.
    """
    if not ends:
        return 0.0
    done, last = len(ends), ends[-1]
    each = (last - ends[0]) / (done - 1) if done > 1 else max(last - compiling, 0.0)
    return last / (last + each * max(pieces - done, 0)) if last > 0.0 else done / pieces


def ordered(drive: Drive, shown: Sequence[tuple[Entry, Visible]]) -> list[Planned]:
    """Return the experiments that add effects, the one that adds most first."""
    seen: set[str] = set()
    rest, out = list(shown), list[Planned]()
    while rest:
        news = [
            tuple(e for e, z in v.sizes.items() if z >= CLEAR and e not in seen) for _, v in rest
        ]
        k = int(np.argmax([len(n) for n in news]))
        if not news[k]:
            return out
        entry, view = rest.pop(k)
        out.append(Planned(entry, settings(entry, drive), view, news[k]))
        seen |= set(news[k])
    return out


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
    """Return an experiment's setpoints every millisecond, as a person reads them: s, A, rpm;
    injected square wave (V) and link (V)."""
    step = max(1, round(1e-3 / drive.converter.sampling_period))
    rpm = 60.0 / math.tau / drive.motor.pole_pairs
    rows = [
        {
            "t_s": k * drive.converter.sampling_period,
            "i_d_A": float(entry.i_d[k]),
            "i_q_A": float(entry.i_q[k]),
            "speed_rpm": float(entry.speed[k]) * rpm,
            "injected_d_V": entry.injection[0],
            "injected_q_V": entry.injection[1],
            "link_V": entry.link * drive.converter.dc_bus_voltage,
        }
        for k in range(0, len(entry.i_d), step)
    ]
    return [{name: float(DIGITS % x) for name, x in row.items()} for row in rows]
