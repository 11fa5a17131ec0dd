"""The one further recording that would tell two hypotheses apart best, by simulation.

Hypothesis A predicts an experiment's readings; hypothesis B, free to move as far as its own fit leaves it, tries to
follow.  What it cannot follow is the expected log evidence for A,

    gain = 1/2 (r'r - g' (A + C^-1)^-1 g),

C the covariance of B's fit, less what the recording's own preparation leaves of the truth itself; the data of both
count for as much less as the temperature says.  The smaller of both directions counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from model.errors import BadInput, PhysicsError
from sandbox.campaign import Campaign
from sandbox.gap.menu import Entry, menu, recording_of, shaft
from sandbox.gap.normal import Point, normal
from sandbox.gap.search import Judged
from sandbox.replay.kernel import GAIN_ANGLE, GAIN_SPEED, READ, SCALE
from sandbox.replay.replay import Prepared, prepare, replay

ODDS = math.log(19.0)  # log evidence for 95 %
LEAST_POWER = 0.5


@dataclass(frozen=True)
class Next:
    """A recommended recording: the menu's name for it, description, the two hypotheses, expected log evidence,
    probability of separating."""

    entry: str
    description: str
    separates: tuple[tuple[str, ...], tuple[str, ...]]
    gain: float
    power: float


def expected_evidence(campaign: Campaign, entry: Entry, a: Judged, b: Judged, temperature: float) -> float:
    """Return the log evidence for A over B that an experiment is expected to bring if A is true."""
    drive = campaign.drive
    motion = shaft(a.fit.point.values, float(drive.motor.pole_pairs), drive.converter.sampling_period)
    planned = recording_of(campaign, entry, motion)
    truth = {k: v for k, v in a.fit.point.values.items() if v == v}
    planned = encoded(planned, truth)
    read = replay(prepare(planned, truth, steps=1), [truth]).currents[0][:, :, 0]
    columns = {**planned.recordings[0].columns, **{f"i_{p}": read[:, k].copy() for k, p in enumerate("abc")}}
    told = replace(planned, recordings=(replace(planned.recordings[0], columns=columns),))
    belief = dict(b.fit.point.values)
    point = Point(as_predicted(prepare(told, belief, steps=1), truth), belief)
    itself = Point(as_predicted(prepare(told, truth, steps=1), truth), truth)
    left = normal(itself, ()).summed()[2] / temperature  # what the recording's own preparation leaves of the truth
    own = [c for c in b.normal.coordinates if c.form not in ("turn", "share")]
    n = normal(point, own)
    a_all, g_all, rr_all = (x / temperature for x in n.summed())
    place = {c.label: k for k, c in enumerate(b.normal.coordinates)}
    known = b.equations.a / temperature + np.diag(np.where(b.prior.deviation > 0.0, b.prior.deviation, 1e-12) ** -2)
    inside = [place[c.label] for c in own]
    covariance = np.linalg.inv(known)[np.ix_(inside, inside)]
    prior = np.diag([c.deviation**-2 for c in n.coordinates])
    prior[: len(own), : len(own)] = np.linalg.inv(covariance)
    follow = g_all @ np.linalg.solve(a_all + prior, g_all)
    return float(0.5 * (rr_all - follow - left))


def encoded(planned: Campaign, truth: Mapping[str, float]) -> Campaign:
    """Return a campaign of one recording whose driven rotor is read by an encoder as eccentric as a truth has it."""
    r, pairs = planned.recordings[0], planned.drive.motor.pole_pairs
    if r.rotor != "driven":
        return planned
    size, phase = (truth[f"encoder_eccentricity.{p}"] for p in ("amplitude_mech", "phase"))
    read = r.theta + pairs * size * np.sin(r.theta / pairs + phase)
    return replace(planned, recordings=(replace(r, columns={**r.columns, "theta": read}),))


def as_predicted(prepared: Prepared, truth: Mapping[str, float]) -> Prepared:
    """Return recordings as a truth would read them on their motion: its currents, and the angle that its torque gives.

    The wanted motion is that of wanted currents; the predicted ones turn a free rotor otherwise.  An innovation of the
    motion filter without correction is the reading less that free run, so taking it off leaves the truth none.
    """
    free_run = []
    for r in prepared.recordings:
        table = r.table.copy()
        table[:, GAIN_ANGLE], table[:, GAIN_SPEED], table[:, SCALE] = 0.0, 0.0, 1.0
        free_run.append(replace(r, table=table))
    found = replay(replace(prepared, recordings=tuple(free_run)), [truth])
    out = []
    for r, current, miss in zip(prepared.recordings, found.currents, found.motion, strict=True):
        table = r.table.copy()
        if miss is not None:
            table[:, READ] -= miss[:, 0]
        out.append(replace(r, read=np.ascontiguousarray(current[:, :, 0]), table=table))
    return replace(prepared, recordings=tuple(out))


def recommend(
    campaign: Campaign, candidates: Sequence[Judged], temperature: float, entries: Sequence[Entry] | None = None
) -> Next | None:
    """Return the recording that separates the two most probable of the candidates best.

    None with fewer than two, or where no experiment is likely to separate them (LEAST_POWER).
    """
    if len(candidates) < 2:
        return None
    a, b = candidates[0], candidates[1]
    found: list[tuple[float, str, str]] = []
    for entry in menu(campaign.drive) if entries is None else entries:
        try:
            both = [expected_evidence(campaign, entry, x, y, temperature) for x, y in ((a, b), (b, a))]
        except (BadInput, PhysicsError, np.linalg.LinAlgError):
            continue
        found.append((min(both), entry.name, entry.description))
    if not found:
        return None
    gain, name, description = max(found)
    # the log evidence is normal with variance twice its mean (a Gaussian likelihood ratio)
    power = 0.5 * math.erfc((ODDS - gain) / math.sqrt(4.0 * max(gain, 1e-12)))
    if power < LEAST_POWER:
        return None
    return Next(name, description, (a.effects, b.effects), gain, power)


def as_json(n: Next | None) -> Mapping[str, object] | None:
    """Return the contract's `next_recording`."""
    if n is None:
        return None
    return {
        "entry": n.entry, "description": n.description, "separates": [list(s) for s in n.separates], "gain": n.gain,
        "power": n.power,
    }  # fmt: skip
