"""The one further recording that would tell the hypotheses of an ambiguity set apart best, by
simulation.

Hypothesis a, at its fit, predicts an experiment's readings.  How well a hypothesis j, with what the
campaign left it (a Gaussian of covariance C around its fit), predicts them with their noise is in
the mean

    1/2 (r'r - g' (A + C^-1)^-1 g) + 1/2 [log det(1 + C A) - tr A (A + C^-1)^-1],

r, g, A the residual and normal equations of j's simulation: what it cannot follow, and how widely
it had to spread its bets.  That of b less that of a is the log evidence for a over b that the
experiment is expected to bring if a is true; estimates meet the variance that the misfit of the
recordings so far gives.

What a simulator misses of its bench leans, by chance, to one of the two: it counts as noise beside
the recording's own.  `unknown` predicts nothing, so no recording parts it from the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from model.array_types import Array
from model.effects import library
from model.errors import BadInput, PhysicsError
from sandbox.gap.diagnose import CREDIBLE
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.gap.evidence.priors import OF_POINT, STEPS
from sandbox.gap.planning.menu import Entry, recording_of, settings, shaft, usual_seconds
from sandbox.gap.planning.within import allowed
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.plant.sets import batch_of, complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import readings_off, with_columns
from sandbox.replay.replay import Prepared, prepare, replay

Rivals = Sequence[tuple[float, EvaluatedModel]]
LEAST_POWER, SURE = 0.5, 0.95
# What a simulator may miss of a recording that is not there yet: of its readings' squares, and of
# the gap that effects make in it.  More than fits leave (`evidence/misfit.py`), as nothing was
# fitted to it.
MISSED, SHARE = 0.012, 3e-4
# correlation of what a simulator misses with the difference of two hypotheses; a choice, not
# measured
LEANS = 0.3
LONGER = (2.0, 4.0)  # times a menu's duration that a recording may take, where its own does not do
RIVALS, CLOSER = 4, 3  # hypotheses looked at; entries that all of them are tried on
DRAWS = 4000


@dataclass(frozen=True)
class Tried:
    """An entry with what it is expected to bring for the hypothesis of a row, if true, over that of
    a column: log evidence (n, n), the part (n, n) of it that readings bring which the other cannot
    follow, and that (n,) of what the simulator misses."""

    entry: Entry
    evidence: Array
    apart: Array
    missed: Array

    def longer(self, times: float) -> Tried:
        """Return the same for a recording so many times as long, as if that brought as much
        more."""
        return replace(
            self,
            evidence=times * self.evidence,
            apart=times * self.apart,
            missed=times * self.missed,
        )


@dataclass(frozen=True)
class Next:
    """A recommended recording: the menu's name for it, description, seconds it takes, the
    hypotheses it separates, expected log evidence (least between two of them), probability that it
    leaves the true one of them alone."""

    entry: str
    description: str
    seconds: float
    separates: tuple[tuple[str, ...], ...]
    gain: float
    power: float


def simulate_experiment(
    campaign: Campaign, entry: Entry, a: EvaluatedModel
) -> tuple[Campaign, dict[str, float]]:
    """Return an experiment as a campaign with the readings that a hypothesis predicts, without
    noise, and its set."""
    drive = campaign.drive
    motion = shaft(a.fit.point.values, drive)
    fitted = {k: v for k, v in a.fit.point.values.items() if v == v}
    planned = encoded(recording_of(campaign, entry, motion), fitted)
    read = replay(prepare(planned, fitted, steps=1), [fitted]).currents[0][:, :, 0]
    columns = {
        **planned.recordings[0].columns,
        **{f"i_{p}": read[:, k].copy() for k, p in enumerate("abc")},
    }
    return replace(planned, recordings=(replace(planned.recordings[0], columns=columns),)), fitted


def expected_evidence(
    campaign: Campaign,
    entry: Entry,
    a: EvaluatedModel,
    others: Sequence[EvaluatedModel],
    variance: float,
    workers: int = 1,
) -> tuple[Array, Array, float]:
    """Return the log evidence (n,) for a over each of the others that an experiment is expected to
    bring if a is true, its part (n,) that they cannot follow, and that of what the simulator misses
    of a's effects."""
    recorded, truth = simulate_experiment(campaign, entry, a)
    (own, wide), *rest = (_surprise(recorded, truth, j, variance, workers) for j in (a, *others))
    apart = np.array([q - own for q, _ in rest])
    return (
        apart + np.array([w - wide for _, w in rest]),
        apart,
        _missed(recorded, truth, a) / variance,
    )


def _missed(recorded: Campaign, truth: Mapping[str, float], a: EvaluatedModel) -> float:
    """Return half the squares of what a simulator misses of a recording, by the gap that a's
    effects make."""
    neutral = library.neutral(recorded.drive.motor)
    gone = tuple(f"{e}." for e in a.effects)
    without = {**truth, **{k: v for k, v in neutral.items() if k.startswith(gone)}}
    n = normal(
        ParameterPoint(as_predicted(prepare(recorded, without, steps=1), truth), without), ()
    )
    count = sum(float(s.n.sum()) for s in n.segments)
    return 0.5 * (MISSED * count + SHARE * n.summed().ssr)


def _surprise(
    recorded: Campaign, truth: Mapping[str, float], j: EvaluatedModel, variance: float, workers: int
) -> tuple[float, float]:
    """Return how badly a hypothesis predicts a recording of a truth: what it cannot
    follow, its spread."""
    belief = dict(j.fit.point.values)
    point = ParameterPoint(as_predicted(prepare(recorded, belief, steps=1), truth), belief)
    own = [c for c in j.normal.coordinates if c.form not in (*OF_POINT, *STEPS)]
    n = normal(point, own, workers=workers)
    a, g, ssr = n.summed()
    place = {c.label: k for k, c in enumerate(j.normal.coordinates)}
    known = j.equations.a / variance + np.diag(
        np.where(j.prior.deviation > 0.0, j.prior.deviation, 1e-12) ** -2
    )
    inside = [place[c.label] for c in own]
    prior = np.diag([c.deviation**-2 for c in n.coordinates])
    prior[: len(own), : len(own)] = np.linalg.inv(np.linalg.inv(known)[np.ix_(inside, inside)])
    return surprise(a / variance, g / variance, ssr / variance, prior)


def surprise(a: Array, g: Array, ssr: float, prior: Array) -> tuple[float, float]:
    """Return minus the log density of noisy data that a Gaussian belief predicts, up to what all
    beliefs share: what it cannot follow, and its spread in the mean over noise.

    a (p, p), g (p,), rr: normal equations of the data without noise at the belief's mean; prior (p,
    p): inverse of its covariance.
    """
    follow, share = np.linalg.solve(a + prior, g), np.trace(np.linalg.solve(a + prior, a))
    wider = np.linalg.slogdet(a + prior)[1] - np.linalg.slogdet(prior)[1]
    return float(0.5 * (ssr - g @ follow)), float(0.5 * (wider - share))


def encoded(planned: Campaign, truth: Mapping[str, float]) -> Campaign:
    """Return a campaign of one recording whose driven rotor is read by an encoder as eccentric as a
    truth has it."""
    r, pairs = planned.recordings[0], planned.drive.motor.pole_pairs
    if r.rotor != "driven":
        return planned
    off = np.zeros((len(r.theta), 1))
    drive = planned.drive
    values = complete(drive.motor, drive.converter, truth)
    readings_off(batch_of(drive.motor, drive.converter, [values], 1), r.theta / pairs, off)
    read = r.theta + off[:, 0]
    return replace(planned, recordings=(replace(r, columns={**r.columns, "theta": read}),))


def as_predicted(prepared: Prepared, truth: Mapping[str, float]) -> Prepared:
    """Return recordings as a truth would read them on their motion: its currents, and the angle
    that its torque gives.

    The wanted motion is that of wanted currents; the predicted ones turn a free rotor otherwise.
    An innovation of the motion filter without correction is the reading less that free run, so
    taking it off leaves the truth none.
    """
    free_run = []
    for r in prepared.recordings:
        none = np.zeros(r.samples)
        track = with_columns(
            r.track, {"gain_angle": none, "gain_speed": none, "scale": np.ones(r.samples)}
        )
        free_run.append(replace(r, track=track))
    found = replay(replace(prepared, recordings=tuple(free_run)), [truth])
    out = []
    for r, current, miss in zip(prepared.recordings, found.currents, found.motion, strict=True):
        track = (
            r.track
            if miss is None
            else with_columns(r.track, {"read": r.track["read"] - miss[:, 0]})
        )
        out.append(replace(r, read=np.ascontiguousarray(current[:, :, 0]), track=track))
    return replace(prepared, recordings=tuple(out))


def recommend(
    campaign: Campaign,
    rivals: Rivals,
    variance: float,
    names: Sequence[str] | None = None,
    workers: int = 1,
) -> Next | None:
    """Return the recording that is most likely to leave the true one of the rivals alone, no longer
    than it has to be.

    rivals: (probability, hypothesis), the most probable first; names: of the entries to choose from
    (all).  Every entry is tried on the first two, the best ones on all; longer ones are tried where
    they promise to do.  None with fewer than two, or where no experiment is likely to separate them
    (LEAST_POWER).
    """
    rivals = rivals[:RIVALS]
    if len(rivals) < 2:
        return None
    campaign = replace(campaign, drive=campaign.drive.at_full_rate())
    entries = [
        e for e in allowed(campaign.drive, campaign.limits) if names is None or e.name in names
    ]
    if campaign.rated_from_data and all(r.rotor == "locked" for r in campaign.recordings):
        entries = [e for e in entries if e.rotor == "locked"]  # nothing says how fast it may turn
    found = [x for e in entries if (x := _tried(campaign, e, rivals[:2], variance, workers))]
    if len(rivals) > 2:
        found.sort(key=lambda x: (power(rivals[:2], x), x.evidence.min()), reverse=True)
        found = [
            x for y in found[:CLOSER] if (x := _tried(campaign, y.entry, rivals, variance, workers))
        ]
    known = list(found)
    for length in LONGER if found else ():
        if max(power(rivals, x) for x in known) >= SURE:
            break
        promising = max(
            found, key=lambda x: (power(rivals, x.longer(length)), float(x.evidence.min()))
        )
        if power(rivals, promising.longer(length)) >= LEAST_POWER:
            slower = allowed(
                campaign.drive, campaign.limits, length * usual_seconds(campaign.drive)
            )
            entries = [e for e in slower if e.name == promising.entry.name]
            known += [x for e in entries if (x := _tried(campaign, e, rivals, variance, workers))]
    best = _best(rivals, known)
    if best is None:
        return None
    entry, separates = best.entry, tuple(j.effects for _, j in rivals)
    gain, reached = float(best.evidence.min()), power(rivals, best)
    description = f"{entry.description} ({settings(entry, campaign.drive)})"
    return Next(entry.name, description, entry.seconds, separates, gain, reached)


def _best(rivals: Rivals, known: Sequence[Tried]) -> Tried | None:
    """Return what surely settles it with the least gap, as a larger one shows more of the
    simulator's own error; else the most telling; None below LEAST_POWER."""
    powers = [(power(rivals, x), x) for x in known]
    sure = [x for p, x in powers if p >= SURE]
    if sure:
        return min(sure, key=lambda x: float(x.missed.max()))
    likely = [(p, -x.entry.seconds, k) for k, (p, x) in enumerate(powers) if p >= LEAST_POWER]
    return known[max(likely)[2]] if likely else None


def _tried(
    campaign: Campaign, entry: Entry, rivals: Rivals, variance: float, workers: int
) -> Tried | None:
    """Return what an entry tells about rivals; None where it cannot be simulated, or not with
    finite currents."""
    judged = [j for _, j in rivals]
    evidence, apart, missed = (
        np.full((len(judged),) * 2, np.inf),
        np.zeros((len(judged),) * 2),
        np.zeros(len(judged)),
    )
    try:
        for k, a in enumerate(judged):
            others = [m for m in range(len(judged)) if m != k]
            evidence[k, others], apart[k, others], missed[k] = expected_evidence(
                campaign, entry, a, [judged[m] for m in others], variance, workers
            )
    except (BadInput, PhysicsError, np.linalg.LinAlgError):
        return None
    finite = (
        np.isfinite(evidence[~np.eye(len(judged), dtype=bool)]).all() and np.isfinite(apart).all()
    )
    return Tried(entry, evidence, apart, missed) if finite and np.isfinite(missed).all() else None


def power(rivals: Rivals, tried: Tried) -> float:
    """Return the probability that the true rival comes to stand alone among them (CREDIBLE), from
    DRAWS draws.

    Log evidence is normal (a Gaussian likelihood ratio): its variance is twice the part that the
    other cannot follow, and more by what the simulator misses; two rivals that lie on one side of
    the truth go together.
    """
    p = np.array([x for x, _ in rivals])
    draws = np.random.default_rng(0).standard_normal((DRAWS, len(p) - 1))
    out = 0.0
    for k, own in enumerate(p):
        others = [m for m in range(len(p)) if m != k]
        apart = np.maximum(tried.apart[k, others], 0.0)
        between = np.maximum(0.5 * (tried.apart + tried.apart.T)[np.ix_(others, others)], 0.0)
        shared = 0.5 * (apart[:, None] + apart[None, :] - between)  # by the cosine rule
        np.fill_diagonal(shared, apart)
        size, way = np.linalg.eigh(2.0 * (1.0 + 2.0 * LEANS**2 * tried.missed[k]) * shared)
        evidence = tried.evidence[k, others] + (draws * np.sqrt(np.maximum(size, 0.0))) @ way.T
        left = np.exp(np.clip(np.log(p[others] / own) - evidence, -700.0, 700.0)).sum(axis=1)
        out += float(own / p.sum() * np.mean(1.0 / (1.0 + left) >= CREDIBLE))
    return out


def as_json(n: Next | None) -> Mapping[str, object] | None:
    """Return `next_recording` of `diagnosis.json`."""
    if n is None:
        return None
    return {
        "entry": n.entry,
        "description": n.description,
        "seconds": n.seconds,
        "separates": [list(s) for s in n.separates],
        "gain": n.gain,
        "power": n.power,
    }
