"""The one further recording that would tell the hypotheses of an ambiguity set apart best, by simulation.

Hypothesis a predicts an experiment's readings.  How well a hypothesis j, with what the campaign left it (a Gaussian of
covariance C around its fit), foretells them is

    surprise_j = 1/2 (r'r - g' (A + C^-1)^-1 g) + 1/2 log det(1 + C A),

r, g, A the residual and normal equations of j's simulation: what it cannot follow, and how widely it would have had to
spread its bets.  surprise_b - surprise_a is the log evidence for a over b that the experiment is expected to bring if a
is true; the data counts for as much less as the temperature says.

What a simulator misses of its bench (`remainder`) leans, by chance, to one of the two: it counts as noise beside the
recording's own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput, PhysicsError
from sandbox.campaign import Campaign
from sandbox.gap.menu import Entry, menu, recording_of, shaft
from sandbox.gap.normal import Point, normal
from sandbox.gap.remainder import FLOOR, SHARE
from sandbox.gap.search import Judged
from sandbox.replay.kernel import GAIN_ANGLE, GAIN_SPEED, READ, SCALE
from sandbox.replay.replay import Prepared, prepare, replay
from sandbox.replay.sets import complete

Array = NDArray[np.float64]
CREDIBLE = 0.95  # probability from which on a hypothesis stands alone
LEAST_POWER, SURE = 0.5, 0.95
LEANS = 0.3  # correlation of what a simulator misses with the difference of two hypotheses
LENGTHS = (1.0, 2.0, 4.0)  # times a menu's duration that a recording may take
RIVALS, CLOSER = 4, 3  # hypotheses looked at; entries that all of them are tried on


@dataclass(frozen=True)
class Tried:
    """An entry with the log evidence (n, n) that it is expected to bring for the hypothesis of a row, if true, over
    that of a column (infinite on the diagonal), and that (n,) of what the simulator misses then."""

    entry: Entry
    told: Array
    missed: Array

    def longer(self, times: float) -> Tried:
        """Return the same for a recording so many times as long."""
        return replace(self, told=times * self.told, missed=times * self.missed)


@dataclass(frozen=True)
class Next:
    """A recommended recording: the menu's name for it, description, seconds it takes, the hypotheses it separates,
    expected log evidence (least between two of them), probability that it leaves the true one alone."""

    entry: str
    description: str
    seconds: float
    separates: tuple[tuple[str, ...], ...]
    gain: float
    power: float


def expected_evidence(
    campaign: Campaign, entry: Entry, a: Judged, others: Sequence[Judged], temperature: float, workers: int = 1
) -> tuple[Array, float]:
    """Return the log evidence (n,) for a over each of the others that an experiment is expected to bring if a is true,
    and that of what the simulator misses of a's gap."""
    drive = campaign.drive
    motion = shaft(a.fit.point.values, float(drive.motor.pole_pairs), drive.converter.sampling_period)
    planned = recording_of(campaign, entry, motion)
    truth = {k: v for k, v in a.fit.point.values.items() if v == v}
    planned = encoded(planned, truth)
    read = replay(prepare(planned, truth, steps=1), [truth]).currents[0][:, :, 0]
    columns = {**planned.recordings[0].columns, **{f"i_{p}": read[:, k].copy() for k, p in enumerate("abc")}}
    told = replace(planned, recordings=(replace(planned.recordings[0], columns=columns),))
    own, *rest = (_surprise(told, truth, j, temperature, workers) for j in (a, *others))
    return np.array(rest) - own, _missed(told, truth) / temperature


def _missed(told: Campaign, truth: Mapping[str, float]) -> float:
    """Return half the squares of what a simulator misses of a recording, by its gap from the nominal model."""
    nominal = complete(told.drive.motor, told.drive.converter)
    n = normal(Point(as_predicted(prepare(told, nominal, steps=1), truth), nominal), ())
    count = sum(float(s.n.sum()) for s in n.segments)
    return 0.5 * (FLOOR * count + SHARE * n.summed()[2])


def _surprise(told: Campaign, truth: Mapping[str, float], j: Judged, temperature: float, workers: int) -> float:
    """Return how badly a hypothesis foretells a recording that a truth has told."""
    belief = dict(j.fit.point.values)
    point = Point(as_predicted(prepare(told, belief, steps=1), truth), belief)
    own = [c for c in j.normal.coordinates if c.form not in ("turn", "share")]
    n = normal(point, own, workers=workers)
    a, g, rr = n.summed()
    place = {c.label: k for k, c in enumerate(j.normal.coordinates)}
    known = j.equations.a / temperature + np.diag(np.where(j.prior.deviation > 0.0, j.prior.deviation, 1e-12) ** -2)
    inside = [place[c.label] for c in own]
    prior = np.diag([c.deviation**-2 for c in n.coordinates])
    prior[: len(own), : len(own)] = np.linalg.inv(np.linalg.inv(known)[np.ix_(inside, inside)])
    return surprise(a / temperature, g / temperature, rr / temperature, prior)


def surprise(a: Array, g: Array, rr: float, prior: Array) -> float:
    """Return minus the log density of data that a Gaussian belief foretells, up to what all beliefs share.

    a (p, p), g (p,), rr: normal equations at the belief's mean; prior (p, p): inverse of its covariance.
    """
    wider = np.linalg.slogdet(a + prior)[1] - np.linalg.slogdet(prior)[1]
    return float(0.5 * (rr - g @ np.linalg.solve(a + prior, g) + wider))


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
    campaign: Campaign, rivals: Sequence[tuple[float, Judged]], temperature: float,
    entries: Sequence[Entry] | None = None, workers: int = 1,
) -> Next | None:  # fmt: skip
    """Return the recording that is most likely to leave the true one of the rivals alone, no longer than it has to be.

    rivals: (probability, hypothesis), the most probable first.  Every entry is tried on the first two, the best ones on
    all; longer recordings bring evidence in proportion.  None with fewer than two, or where no experiment is likely to
    separate them (LEAST_POWER).
    """
    rivals = rivals[:RIVALS]
    if len(rivals) < 2:
        return None
    first = [_tried(campaign, e, rivals[:2], temperature, workers) for e in entries or menu(campaign.drive)]
    found = [x for x in first if x is not None]
    if len(rivals) > 2:
        found.sort(key=lambda x: (power(rivals[:2], x), x.told.min()), reverse=True)
        closer = [_tried(campaign, x.entry, rivals, temperature, workers) for x in found[:CLOSER]]
        found = [x for x in closer if x is not None]
    for length in LENGTHS if found else ():
        least = SURE if length < LENGTHS[-1] else LEAST_POWER
        best = _best(rivals, [x.longer(length) for x in found])
        if length > 1.0 and power(rivals, best) >= least:
            entries = menu(campaign.drive, length * best.entry.seconds)
            same = next(e for e in entries if e.name == best.entry.name)
            best = _tried(campaign, same, rivals, temperature, workers) or best
        reached = power(rivals, best)
        if reached >= least:
            separates, e = tuple(j.effects for _, j in rivals), best.entry
            return Next(e.name, e.description, e.seconds, separates, float(best.told.min()), reached)
    return None


def _best(rivals: Sequence[tuple[float, Judged]], found: Sequence[Tried]) -> Tried:
    """Return what is surely enough with the least evidence, as that has the least gap to explain; else the most
    telling."""
    enough = [x for x in found if power(rivals, x) >= SURE]
    if enough:
        return min(enough, key=lambda x: float(x.told.min()))
    return max(found, key=lambda x: (power(rivals, x), float(x.told.min())))


def _tried(
    campaign: Campaign, entry: Entry, rivals: Sequence[tuple[float, Judged]], temperature: float, workers: int
) -> Tried | None:
    """Return what an entry tells about rivals; None where it cannot be simulated."""
    judged = [j for _, j in rivals]
    told, missed = np.full((len(judged), len(judged)), np.inf), np.zeros(len(judged))
    try:
        for k, a in enumerate(judged):
            others = [m for m in range(len(judged)) if m != k]
            told[k, others], missed[k] = expected_evidence(
                campaign, entry, a, [judged[m] for m in others], temperature, workers
            )
    except (BadInput, PhysicsError, np.linalg.LinAlgError):
        return None
    return Tried(entry, told, missed)


def power(rivals: Sequence[tuple[float, Judged]], tried: Tried) -> float:
    """Return the probability that the true rival comes to stand alone.

    Log evidence between two is normal with variance twice its mean (a Gaussian likelihood ratio), and more by what the
    simulator misses; the least of the odds decides.
    """
    p = np.array([x for x, _ in rivals])
    need = math.log(CREDIBLE / (1.0 - CREDIBLE)) + math.log(len(p) - 1.0)
    out = 0.0
    for k, own in enumerate(p):
        spread = np.sqrt(np.maximum(tried.told[k], 1e-12) * (4.0 + 8.0 * LEANS**2 * tried.missed[k]))
        short = need - np.log(own / p) - tried.told[k]
        each = [0.5 * math.erfc(short[m] / spread[m]) for m in range(len(p)) if m != k]
        out += float(own / p.sum()) * min(each)
    return out


def as_json(n: Next | None) -> Mapping[str, object] | None:
    """Return the contract's `next_recording`."""
    if n is None:
        return None
    return {
        "entry": n.entry, "description": n.description, "seconds": n.seconds,
        "separates": [list(s) for s in n.separates], "gain": n.gain, "power": n.power,
    }  # fmt: skip
