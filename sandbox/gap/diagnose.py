"""A campaign diagnosed: where the gap lies, which effect causes it, how far it shrinks.

    diagnosis = diagnose("campaign-folder")
    diagnosis.best.effects, diagnosis.best.probability

Only the campaign folder is read; everything follows from it and the nominal model in it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from model.effects import library
from model.errors import PhysicsError
from sandbox.gap.evidence.discrepancy import Remainder, remainder, unlogged_counts
from sandbox.gap.evidence.fit import Fit, Weights, fit
from sandbox.gap.evidence.gap_size import Size, rms, size_of
from sandbox.gap.evidence.holdout import held_out, weights_of
from sandbox.gap.evidence.noise import floor_of, noise_caution
from sandbox.gap.evidence.normal import Normal, Point, normal
from sandbox.gap.search.estimates import Estimate, estimates
from sandbox.gap.search.forward import Judged, Search, search
from sandbox.gap.search.parts import with_parts
from sandbox.gap.search.points import unbent
from sandbox.gap.search.posterior import UNKNOWN, Hypothesis, tempered, with_unknown
from sandbox.gap.search.selection import widened
from sandbox.gap.search.stranger import beside_unknown
from sandbox.gap.search.unfitted import slight
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, read_campaign
from sandbox.replay.memory import USUAL, spare
from sandbox.replay.replay import prepare

CREDIBLE = 0.95
NINE_IN_TEN = 2000  # simulations within which 93 % of the diagnoses of the blind checks ended (sandbox/gap/README.md)


@dataclass(frozen=True)
class Diagnosis:
    """All that a diagnosis found; `sandbox.gap.report.diagnosis_json.contract` puts it into `diagnosis.json`.

    nominal, before, after: the campaign at the nominal model, after refitting ordinary deviations only, and with the
    best hypothesis.  hypotheses: the most probable first.  temperature: for how much less the data counted.
    """

    campaign: Campaign
    start: Point
    nominal: Normal
    before: Fit
    after: Fit
    held_out: tuple[int, ...]
    judged: tuple[Judged, ...]
    hypotheses: tuple[Hypothesis, ...]
    parameters: tuple[dict[str, Estimate], ...]  # of each hypothesis
    temperature: float
    remainder: Remainder
    size: Size
    simulations: int
    seconds: float
    excluded: tuple[str, ...] = ()
    caution: str = ""  # about the stated noise
    out_of_sight: tuple[str, ...] = ()  # effects that are no candidates as no recording can show them

    @property
    def best(self) -> Hypothesis:
        """The most probable hypothesis."""
        return self.hypotheses[0]

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


def diagnose(
    campaign: str | Path | Campaign,
    *,
    exclude: Sequence[str] = (),
    rivals: Sequence[tuple[str, ...]] = (),
    workers: int = 2,
    memory: float = USUAL,
    report: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Return the diagnosis of a campaign (a folder, or read already).

    exclude: effects that are no candidates; rivals: sets that are weighed whatever the search comes upon (those that an
    earlier diagnosis left); workers: threads; memory: GB it may take, what slopes are beyond that wait in a file;
    report: called with a few words before each stage.
    BadInput for a campaign that cannot be read or replayed, or that is too long for so much memory.
    """
    began = time.perf_counter()
    own = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    report("reading")
    left_over = spare(memory, sum(len(r.t) for r in own.recordings))
    caution = noise_caution(own)
    prepared = prepare(own)
    prepared = replace(prepared, floor=floor_of(own, prepared.floor), spare=left_over)
    motor, converter = own.drive.motor, own.drive.converter
    start = Point(prepared, complete(motor, converter))
    nominal = normal(start, (), workers=workers)
    if not np.isfinite(rms(nominal, range(len(prepared.recordings)))):
        raise PhysicsError(
            "the nominal model predicts no finite currents for these voltages; check [motor] (units, alphas: "
            "`sensorless audit` shows where an energy stops being convex)"
        )
    hidden = out_of_sight(own)
    barred = (*exclude, *hidden)
    left = held_out(start, barred, workers=workers)
    count = len(prepared.recordings)
    fitted, everything = weights_of(count, left), weights_of(count)
    found = search(start, everything, exclude=barred, workers=workers, report=report)
    raw = rms(nominal, range(count))
    found = with_parts(found, raw, everything, exclude=barred, workers=workers, report=report)
    found = widened(found, raw, everything, exclude=barred, workers=workers, report=report)
    found = _with_rivals(found, [s for s in rivals if not set(s) & set(hidden)], everything, workers)
    report("measuring the gap")
    judged, ranked, temperature, cost = _ranked(found, raw, everything, workers)
    before = fit(start, (), fitted, workers=workers)
    unlogged = unlogged_counts(prepared)
    rest = remainder(found.null, ranked[0][1].fit, unlogged)
    best, spent = beside_unknown(found, ranked[0][1], rest.unknown, temperature, everything, workers)
    if best is not ranked[0][1]:
        rest = replace(remainder(found.null, best.fit, unlogged), unknown=rest.unknown)
    after = fit(_with_effects(before.point, best), best.effects, fitted, workers=workers) if best.effects else before
    size = size_of(nominal, before, after, left, [r.file for r in prepared.recordings])
    hypotheses = tuple(with_unknown(ranked, rest.unknown, rest.explained, best))
    cost += nominal.simulations + before.simulations + (after.simulations if best.effects else 0) + spent
    return Diagnosis(
        own, start, nominal, before, after, left, judged, hypotheses,
        tuple({} if h.effects == (UNKNOWN,) else estimates(h.judged) for h in hypotheses), temperature, rest, size,
        round(cost), time.perf_counter() - began, tuple(exclude), caution, hidden,
    )  # fmt: skip


def out_of_sight(campaign: Campaign) -> tuple[str, ...]:
    """Return the effects that recordings cannot show however large they are: those of mechanics, where no rotor is
    free (locked, or its speed imposed)."""
    if any(r.rotor == "free" for r in campaign.recordings):
        return ()
    return tuple(e for e in library.effect_names() if library.load_effect(e).subsystem == "mechanics")


def _with_rivals(found: Search, rivals: Sequence[tuple[str, ...]], weights: Weights, workers: int) -> Search:
    """Return a search with sets judged that it has not come upon."""
    known = {j.effects for j in found.judged}
    more = [found.judge_also(key, weights, workers) for key in rivals if key not in known]
    own = [j for j in more if j is not None]
    cost = found.simulations + sum(j.simulations for j in own)
    fitted = found.fitted | {j.effects for j in own}
    return replace(found, judged=(*found.judged, *own), simulations=cost, fitted=fitted)


def _ranked(
    found: Search, raw: float, weights: Weights, workers: int
) -> tuple[tuple[Judged, ...], list[tuple[float, Judged]], float, float]:
    """Return what was judged, the same and slight effects with probabilities, the temperature, and simulations.

    A slight effect that comes out first is fitted before it is believed.
    """
    judged, cost = found.judged, found.simulations
    others = slight(judged, found.fitted)
    while True:
        ranked, temperature = tempered([*judged, *others], raw)
        best = ranked[0][1]
        if all(best is not j for j in others):
            return judged, ranked, temperature, cost
        others = [j for j in others if j is not best]
        fitted = found.judge_also(best.effects, weights, workers)
        if fitted is not None:
            judged, cost = (*judged, fitted), cost + fitted.simulations


def _with_effects(point: Point, best: Judged) -> Point:
    """Return a point without effects with the values of a fit to all recordings, for another fit to start from."""
    found = best.fit.point.values
    own = {k: v for k, v in found.items() if k.partition(".")[0] in best.effects}
    shared = {k.partition(".")[2] for k in own} & set(library.SHARED)
    own |= {k: v for k, v in found.items() if k.partition(".")[2] in shared}  # one number under two names
    begun = unbent(point)
    return replace(begun, values={**begun.values, **own}).resmoothed()


def verdict(d: Diagnosis) -> str:
    """Return "no_gap", "unknown", "explained" or "ambiguous"."""
    if not d.best.effects:
        return "no_gap"
    alone = len(d.ambiguity_set) == 1
    if "unknown" in d.best.effects:
        return "unknown"
    return "explained" if alone else "ambiguous"
