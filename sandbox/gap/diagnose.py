"""A campaign diagnosed: where the gap lies, which effect causes it, how far it shrinks.

    diagnosis = diagnosis_of("campaign-folder")
    diagnosis.best.effects, diagnosis.best.probability

Only the campaign folder is read; everything follows from it and the nominal model in it.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from model.effects import library
from model.errors import PhysicsError
from sandbox.gap.evidence.fit import NEAR, Fit, Task, attempted, fit, normalised
from sandbox.gap.evidence.gap_size import Size, rms, size_of
from sandbox.gap.evidence.map_modes import missed, with_modes
from sandbox.gap.evidence.noise import PLAUSIBLE, Noise, noise_caution, noise_of
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint, counted, normal
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.excerpts import begun, excerpted
from sandbox.gap.posterior.estimates import Estimate, Held, estimates, held_ordinary
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.gap.posterior.holdout import held_out, weights_of
from sandbox.gap.posterior.hypotheses import LISTED, UNKNOWN, Hypothesis, hypotheses
from sandbox.gap.posterior.inference import Inference, infer
from sandbox.gap.posterior.remainder import Remainder, remainder
from sandbox.gap.posterior.search import Problem
from sandbox.gap.settings import USUAL as USUAL_SETTINGS
from sandbox.gap.unstated.drifting import Drifting, drifting
from sandbox.gap.unstated.first_look import first_look
from sandbox.gap.unstated.more_than_ordinary import chance_of_effect
from sandbox.gap.unstated.pwm_counts import Counted
from sandbox.gap.unstated.unstated import Unstated
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, CampaignRecording, read_folder
from sandbox.replay.map_error import same_map
from sandbox.replay.memory import USUAL, spare
from sandbox.replay.replay import prepare
from sandbox.replay.unread_start import with_starts

CREDIBLE = 0.95
OF_ENCODER = {"angle", "offset"}  # ports of the plant through which it reads
NINE_IN_TEN = 600  # simulations within which nine in ten diagnoses end: what a progress bar expects


@dataclass(frozen=True)
class Drift:
    """Offsets that differ between recordings as an effect: its chance, and the campaign with these
    differences in its readings: at the nominal model, after refitting ordinary deviations to all
    recordings, and to those that were not held out; without: all recordings' equations where the
    differences are taken off."""

    chance: float
    nominal: NormalEquations
    whole: Fit
    before: Fit
    without: NormalEquations


@dataclass(frozen=True)
class Diagnosis:
    """All that a diagnosis found; `sandbox.gap.report.diagnosis_json.document` puts it into
    `diagnosis.json`.

    nominal, before, after: the campaign at the nominal model, after refitting ordinary deviations
    only, and with the best hypothesis.  hypotheses: the most probable first.  variance: that
    estimates meet in currents, in units of the noise's, mean over readings; 1 where the best set
    leaves nothing beside noise.
    """

    campaign: Campaign
    start: ParameterPoint
    nominal: NormalEquations
    before: Fit
    after: Fit
    held_out: tuple[int, ...]
    evaluated: tuple[EvaluatedModel, ...]
    hypotheses: tuple[Hypothesis, ...]
    parameters: tuple[dict[str, Estimate], ...]  # of each hypothesis
    variance: float
    remainder: Remainder
    size: Size
    simulations: int
    seconds: float
    excluded: tuple[str, ...] = ()
    caution: str = ""  # about the stated noise
    # effects that are no candidates as no recording can show them
    out_of_sight: tuple[str, ...] = ()
    noise: Noise | None = None  # stated, seen, used
    drifting: Drifting | None = None  # how offsets of current sensors differed, which was taken off
    # ordinary deviations of the best hypothesis that are as large as they may be
    at_bound: tuple[Held, ...] = ()
    # counts that duties are rounded to, which [drive] does not state
    counted: Counted | None = None
    drift: Drift | None = None  # what was taken off, where it may be more than ordinary

    @property
    def best(self) -> Hypothesis:
        """The most probable hypothesis."""
        return self.hypotheses[0]

    @property
    def held_by(self) -> float:
        """Resistance (ohm) by which readings hold all replays, 0 where they go by their voltages
        (`first_look`)."""
        return max(r.hold for r in self.start.prepared.recordings)

    @property
    def offsets_named(self) -> bool:
        """Whether offsets that differ between recordings are named as an effect."""
        return self.drift is not None and library.drifting().name in self.best.effects

    @property
    def ambiguity_set(self) -> tuple[Hypothesis, ...]:
        """The smallest list of hypotheses that holds 95 % of the probability."""
        total, out = 0.0, []
        for h in self.hypotheses:
            out.append(h)
            total += h.probability
            if total >= CREDIBLE:
                break
        return tuple(out)


def diagnosis_of(
    campaign: str | Path | Campaign,
    *,
    exclude: Sequence[str] = (),
    rivals: Sequence[tuple[str, ...]] = (),
    workers: int = 2,
    memory: float = USUAL,
    report: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Return the diagnosis of a campaign (a folder, or read already).

    exclude: effects that are no candidates; rivals: sets that are fitted and weighed whatever else
    is (those that an earlier diagnosis left); workers: threads; memory: GB it may take, what slopes
    are beyond that wait in a file; report: called with a few words before each stage.
    BadInput for a campaign that cannot be read or replayed, or that is too long for so much memory.
    """
    began = time.perf_counter()
    report("reading")
    own = begun(campaign if isinstance(campaign, Campaign) else read_folder(campaign))
    spent: list[float] = []
    with counted(spent.append):
        d = _diagnosed(own, exclude, rivals, workers, memory, report)
    return replace(d, simulations=round(sum(spent)), seconds=time.perf_counter() - began)


def _diagnosed(
    own: Campaign,
    exclude: Sequence[str],
    rivals: Sequence[tuple[str, ...]],
    workers: int,
    memory: float,
    report: Callable[[str], None],
) -> Diagnosis:
    """Return the diagnosis of a campaign, what it took left out.  What recordings' offsets differ
    by is looked for at the nominal model already, where it misses little else."""
    noise = noise_of(own)
    caution = noise_caution(own, noise)
    start, nominal = _nominal(own, noise, memory, workers)
    drifts = Unstated(drifting=drifting(start, shown(start)))
    if drifts:
        start = drifts.at(start)
    hidden, count = out_of_sight(own), len(own.recordings)
    start = with_modes(start, missed(start.prepared.campaign))
    asked = tuple(s for s in rivals if not set(s) & set(hidden))
    problem = Problem(
        start, weights_of(count), (*exclude, *hidden), asked, USUAL_SETTINGS, workers, report
    )
    problem = _looked_at(replace(problem, known=drifts), normalised(nominal, problem.fitted))
    found = infer(problem)
    if found.known or problem.start is not start:
        own, start = found.known.in_campaign(own), found.start
        nominal = normal(start, (), workers=workers)
    report("measuring the gap")
    left = held_out(found.linear)
    before = _without(found.null, start, left, workers)
    ranked = hypotheses(found, misstated(noise), workers=workers)
    named, after = passing_holdout(
        ranked, before, lambda fit: _without(fit, start, left, workers), left
    )
    best = named[0].evaluated
    rest = remainder(found.null, best.fit, misstated(noise))
    size = sized(own, start, nominal, before, after, left)
    return Diagnosis(
        campaign=own,
        start=start,
        nominal=nominal,
        before=before,
        after=after,
        held_out=left,
        evaluated=tuple(found.evaluated.values()),
        hypotheses=tuple(named),
        parameters=tuple({} if h.effects == (UNKNOWN,) else estimates(h.evaluated) for h in named),
        variance=found.mean_variance,
        remainder=rest,
        size=size,
        simulations=0,
        seconds=0.0,
        excluded=tuple(exclude),
        caution=caution,
        out_of_sight=hidden,
        noise=noise,
        drifting=found.known.drifting,
        at_bound=tuple(held_ordinary(best)),
        counted=found.known.counts,
        drift=None if library.drifting().name in exclude else _drift(found, own, left, workers),
    )


def _drift(found: Inference, own: Campaign, left: Sequence[int], workers: int) -> Drift | None:
    """Return what was taken off as an effect; None where it surely is none."""
    known, start = found.known.drifting, found.start
    chance = chance_of_effect(known, own) if known is not None and known.named else 0.0
    if known is None or chance < LISTED:
        return None
    begun = Unstated(drifting=known.put_back()).at(start)
    whole = fit(begun, (), weights_of(len(own.recordings)), workers=workers)
    before = _without(whole, begun, left, workers)
    nominal = normal(begun, (), workers=workers)
    return Drift(chance, nominal, whole, before, found.null.normal)


def sized(
    own: Campaign,
    start: ParameterPoint,
    nominal: NormalEquations,
    before: Fit,
    after: Fit,
    left: Sequence[int],
) -> Size:
    """Return how large the gap is, recordings in the campaign's order."""
    size = size_of(nominal, before, after, left, [r.file for r in start.prepared.recordings])
    place = {r.file: k for k, r in enumerate(own.recordings)}
    return replace(size, recordings=tuple(sorted(size.recordings, key=lambda r: place[r.file])))


def passing_holdout(
    ranked: list[Hypothesis], before: Fit, without: Callable[[Fit], Fit], left: Sequence[int]
) -> tuple[list[Hypothesis], Fit]:
    """Return hypotheses whose first one predicts recordings that were not fitted at least as well
    as ordinary deviations alone do, and its fit without these; each that does not passes its
    probability to `unknown` alone.

    before: the fit of ordinary deviations alone; without: a fit made anew without the recordings
    `left`.  A name that makes the prediction worse is not given: what it explains elsewhere it
    imitates.
    """
    while ranked[0].evaluated.effects:
        after = without(ranked[0].evaluated.fit)
        if not left or rms(after.normal, left) <= rms(before.normal, left):
            return ranked, after
        ranked = _passed(ranked)
    return ranked, before


def _passed(ranked: list[Hypothesis]) -> list[Hypothesis]:
    """Return hypotheses without the first one's set, whose probability goes to something outside
    the library alone."""
    gone = ranked[0].evaluated.effects
    lost = sum(h.probability for h in ranked if h.evaluated.effects == gone)
    rest = [h for h in ranked if h.evaluated.effects != gone]
    none = min(rest, key=lambda h: len(h.evaluated.effects)) if rest else ranked[0]
    kept = [h for h in rest if h.effects != (UNKNOWN,)]
    alone = lost + sum(h.probability for h in rest if h.effects == (UNKNOWN,))
    return sorted(
        [*kept, Hypothesis((UNKNOWN,), alone, none.evaluated)],
        key=lambda h: (-h.probability, h.effects),
    )


def misstated(noise: Noise) -> float:
    """Return by how much of itself the noise's square may be misstated: twice what the one that
    is used differs from the noise that readings show, and what that is known to where it is
    coloured; nothing where the stated one stands alone; what is estimated for a slow log, all."""
    if noise.unseen:
        return (noise.unseen / noise.used) ** 2
    if noise.seen is None:
        return 0.0
    apart = abs(math.log(noise.used / noise.seen))
    known = noise.error if noise.colour else 0.0
    return 0.0 if apart > math.log(PLAUSIBLE) else 2.0 * math.hypot(apart, known)


def _nominal(
    own: Campaign, noise: Noise, memory: float, workers: int
) -> tuple[ParameterPoint, NormalEquations]:
    """Return a campaign at its nominal model; PhysicsError where that predicts nothing finite."""
    left_over = spare(memory, sum(len(r.t) for r in own.recordings))
    prepared = prepare(in_order(own))
    prepared = replace(prepared, noise_std=noise.used, colour=noise.colour, spare=left_over)
    prepared = with_starts(prepared)
    start = ParameterPoint(prepared, complete(own.drive.motor, own.drive.converter))
    nominal = normal(start, (), workers=workers)
    if not np.isfinite(rms(nominal, range(len(prepared.recordings)))):
        raise PhysicsError(
            "the nominal model predicts no finite currents for these voltages; check [motor] "
            "(units, alphas: `sensorless audit` shows where an energy stops being convex)"
        )
    return start, nominal


def _excerpts(start: ParameterPoint) -> Callable[[], ParameterPoint] | None:
    """Return what makes the nominal point of a campaign cut to excerpts, on which the search for
    effects begins; None where that would save little."""
    if start.prepared.samples <= 2 * USUAL_SETTINGS.samples:
        return None

    @cache
    def made() -> ParameterPoint:
        """Return that point, with what the motor's flux map may be off by."""
        own = start.prepared.campaign
        parts = begun(excerpted(own, USUAL_SETTINGS.samples))
        short = prepare(in_order(parts), steps=start.prepared.steps)
        known = {k: getattr(start.prepared, k) for k in ("noise_std", "colour", "spare")}
        short = same_map(with_starts(replace(short, **known)), start.prepared)
        return replace(start, prepared=short)

    return made


def in_order(campaign: Campaign) -> Campaign:
    """Return a campaign with its recordings in an order that follows from what they hold, so that
    neither their names nor their order in the file change a digit."""
    return replace(campaign, recordings=tuple(sorted(campaign.recordings, key=content)))


def content(r: CampaignRecording) -> tuple[str, str]:
    """Return what a recording is sorted by: its kind of rotor, and a digest of its columns."""
    digest = hashlib.sha256()
    for name in sorted(r.columns):
        digest.update(np.ascontiguousarray(r.columns[name]).tobytes())
    return r.rotor, digest.hexdigest()


def out_of_sight(campaign: Campaign) -> tuple[str, ...]:
    """Return the effects that recordings cannot show however large they are: those of mechanics,
    where no rotor is free (locked, or its speed imposed), and those of an encoder, where no angle
    was read."""
    gone = () if any(r.rotor == "free" for r in campaign.recordings) else ("mechanics",)
    own = [e for e in library.effect_names() if library.load_effect(e).subsystem in gone]
    if all(r.made is not None for r in campaign.recordings):
        cards = {e: library.load_effect(e) for e in library.effect_names()}
        own += [e for e, card in cards.items() if {a.port for a in card.at} & OF_ENCODER]
    return tuple(own)


def _looked_at(problem: Problem, left: float) -> Problem:
    """Return what is asked of a campaign with what a first look found; left: times the noise that
    the nominal model leaves."""
    problem.report("fitting ordinary deviations")
    look = first_look(problem.start, _excerpts(problem.start), left, workers=problem.workers)
    return replace(
        problem,
        start=look.start,
        excerpts=look.excerpts,
        known=problem.known.and_then(look.known),
        begun=look.values,
    )


def _without(whole: Fit, start: ParameterPoint, left: Sequence[int], workers: int) -> Fit:
    """Return a fit to all recordings made again without those that are held out; start: the nominal
    model.

    It begins where the whole fit ended, a few steps away: near the noise its end is the same (a
    test spoils the recording held out).  Far from the noise it could keep some of what the whole
    fit saw: there the best of two counts, the other begins at the nominal model with the effects
    alone; without effects that one alone.  Where neither can be made (no motor has the flux that a
    recording begins with), the whole fit stands.
    """
    if not left:
        return whole
    weights = weights_of(len(start.prepared.recordings), left)
    if not whole.effects and normalised(whole.normal, weights) > NEAR:
        return fit(start, (), weights, workers=workers)
    near = attempted(Task(whole.point, whole.effects, weights, workers))
    if near is not None and normalised(near.normal, weights) <= NEAR:
        return near
    own = {k: v for k, v in whole.point.values.items() if k.partition(".")[0] in whole.effects}
    begun = replace(start, values={**start.values, **own})
    leader = math.inf if near is None else near.objective
    task = Task(begun, whole.effects, weights, workers, leader=leader)
    other = attempted(task, smooth=True)
    found = [f for f in (near, other) if f is not None]
    return min(found, key=lambda f: f.objective, default=whole)


def verdict(d: Diagnosis) -> str:
    """Return "no_gap", "unknown" (at least half of the probability), "explained" or "ambiguous"."""
    if not d.best.effects:
        return "no_gap"
    alone = len(d.ambiguity_set) == 1
    if "unknown" in d.best.effects:
        outside = sum(h.probability for h in d.hypotheses if "unknown" in h.effects)
        return "unknown" if outside >= 0.5 else "ambiguous"
    return "explained" if alone else "ambiguous"
