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
from sandbox.gap.evidence.discrepancy import Remainder
from sandbox.gap.evidence.fit import NEAR, Fit, Weights, attempted, fit, normalised
from sandbox.gap.evidence.gap_size import Size, rms, size_of
from sandbox.gap.evidence.holdout import held_out, weights_of
from sandbox.gap.evidence.noise import Noise, floor_of, noise_caution, noise_of
from sandbox.gap.evidence.normal import Normal, Point, counted, normal
from sandbox.gap.search.estimates import Estimate, Held, estimates, held_ordinary
from sandbox.gap.search.forward import Judged, Search, search
from sandbox.gap.search.needless import with_fewer
from sandbox.gap.search.one_for_several import with_one_for_several
from sandbox.gap.search.parts.adding import in_parts, level, with_parts
from sandbox.gap.search.parts.idle import without_idle
from sandbox.gap.search.points import own_values, with_values
from sandbox.gap.search.posterior import UNKNOWN, Hypothesis, tempered, with_unknown
from sandbox.gap.search.selection import widened
from sandbox.gap.search.stranger import beside_unknown
from sandbox.gap.search.unfitted import slight
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, read_campaign
from sandbox.replay.memory import USUAL, spare
from sandbox.replay.replay import prepare

CREDIBLE = 0.95
TURNS = 2  # times that all sets are ranked again as one that was to stand beside `unknown` proved the best
NINE_IN_TEN = 2000  # simulations within which nine in ten diagnoses of a mixed check end: what a progress bar expects


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
    noise: Noise | None = None  # stated, seen, used
    at_bound: tuple[Held, ...] = ()  # ordinary deviations of the best hypothesis that are as large as they may be
    fitted: frozenset[tuple[str, ...]] = frozenset()  # all sets that were fitted

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
    spent: list[float] = []
    with counted(spent.append):
        d = _diagnosed(own, exclude, rivals, workers, memory, report)
    return replace(d, simulations=round(sum(spent)), seconds=time.perf_counter() - began)


def _diagnosed(
    own: Campaign, exclude: Sequence[str], rivals: Sequence[tuple[str, ...]], workers: int, memory: float,
    report: Callable[[str], None],
) -> Diagnosis:  # fmt: skip
    """Return the diagnosis of a campaign, what it took left out."""
    report("reading")
    start, nominal = _nominal(own, memory, workers)
    hidden, count = out_of_sight(own), len(own.recordings)
    barred = (*exclude, *hidden)
    left = held_out(start, barred, workers=workers)
    everything, raw = weights_of(count), rms(nominal, range(count))
    found = _searched(start, raw, everything, barred, workers, report)
    found = _with_rivals(found, [s for s in rivals if not set(s) & set(hidden)], everything, workers)
    report("measuring the gap")
    judged, hypotheses, temperature, rest = _weighed(found, raw, everything, workers)
    best = hypotheses[0].judged
    before = _without(found.null, start, left, workers)
    after = _without(best.fit, start, left, workers) if best.effects else before
    size = size_of(nominal, before, after, left, [r.file for r in start.prepared.recordings])
    return Diagnosis(
        own, start, nominal, before, after, left, judged, hypotheses,
        tuple({} if h.effects == (UNKNOWN,) else estimates(h.judged) for h in hypotheses), temperature, rest, size,
        0, 0.0, tuple(exclude), noise_caution(own), hidden, noise_of(own), tuple(held_ordinary(best)), found.fitted,
    )  # fmt: skip


def _searched(
    start: Point, raw: float, weights: Weights, barred: Sequence[str], workers: int, report: Callable[[str], None]
) -> Search:
    """Return the search from a nominal point: few effects, their further parts, more effects, the parts of those; one
    effect in the place of several; no part and no effect that does nothing by then.

    raw: normalised rms of the nominal model; barred: effects that are no candidates.
    """
    first = search(start, weights, exclude=barred, workers=workers, report=report)
    few = with_parts(first, raw, weights, exclude=barred, workers=workers, report=report)
    wide = widened(few, raw, weights, exclude=barred, workers=workers, report=report)
    if set(in_parts(wide)) - set(in_parts(few)):
        wide = with_parts(wide, raw, weights, exclude=barred, workers=workers, report=report)
    idle = without_idle(wide, raw, weights, workers=workers, report=report)
    one = with_one_for_several(idle, raw, weights, workers=workers, report=report)
    return with_fewer(one, raw, weights, workers=workers, report=report)


def _nominal(own: Campaign, memory: float, workers: int) -> tuple[Point, Normal]:
    """Return a campaign at its nominal model; PhysicsError where that predicts nothing finite."""
    left_over = spare(memory, sum(len(r.t) for r in own.recordings))
    prepared = prepare(own)
    prepared = replace(prepared, floor=floor_of(own, prepared.floor), spare=left_over)
    start = Point(prepared, complete(own.drive.motor, own.drive.converter))
    nominal = normal(start, (), workers=workers)
    if not np.isfinite(rms(nominal, range(len(prepared.recordings)))):
        raise PhysicsError(
            "the nominal model predicts no finite currents for these voltages; check [motor] (units, alphas: "
            "`sensorless audit` shows where an energy stops being convex)"
        )
    return start, nominal


def _weighed(
    found: Search, raw: float, weights: Weights, workers: int
) -> tuple[tuple[Judged, ...], tuple[Hypothesis, ...], float, Remainder]:
    """Return what was judged, all hypotheses, `unknown` beside what may stand beside it; the temperature, and what the
    first hypothesis leaves.

    What stands beside `unknown` is fitted anew.  Where it is more probable than the best set so far, that one had ended
    in a poor minimum: all are ranked again, and what is left is asked of the new one.
    """
    for turn in range(TURNS + 1):
        judged, ranked, temperature = _ranked(found, raw, weights, workers)
        best = ranked[0][1]
        rest = found.remainder(best.fit)
        stays = beside_unknown(found, best, rest.unknown, temperature, weights, workers)
        if turn == TURNS or level(stays, temperature) <= level(best, temperature):
            break
        others = (j for j in judged if j.effects != stays.effects)
        found = replace(found, judged=(*others, stays), fitted=found.fitted | {stays.effects})
    other = rest if stays is best else replace(found.remainder(stays.fit), unknown=rest.unknown)
    hypotheses = tuple(with_unknown(ranked, rest.unknown, other.explained, stays))
    return judged, hypotheses, temperature, rest if hypotheses[0].judged is best else other


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
) -> tuple[tuple[Judged, ...], list[tuple[float, Judged]], float]:
    """Return what was judged, the same and slight effects with probabilities, and the temperature.

    A slight effect that comes out first is fitted before it is believed.
    """
    judged = found.judged
    others = slight(judged, {j.effects for j in judged})
    while True:
        ranked, temperature = tempered([*judged, *others], raw)
        best = ranked[0][1]
        if all(best is not j for j in others):
            return judged, ranked, temperature
        others = [j for j in others if j is not best]
        fitted = found.judge_also(best.effects, weights, workers)
        if fitted is not None:
            judged = (*judged, fitted)


def _without(whole: Fit, start: Point, left: Sequence[int], workers: int) -> Fit:
    """Return a fit to all recordings made again without those that are held out; start: the nominal model.

    With effects it begins where the whole fit ended, a few steps away: near the floor its end is the same (a test
    spoils the recording held out).  Far from the floor it could keep some of what the whole fit saw: there the best of
    two counts, the other begins at the nominal model with the effects alone, as one without effects does.
    """
    if not left:
        return whole
    weights = weights_of(len(start.prepared.recordings), left)
    if not whole.effects:
        return fit(start, (), weights, workers=workers)
    near = fit(whole.point, whole.effects, weights, workers=workers)
    if normalised(near.normal, weights) <= NEAR:
        return near
    begun = with_values(start, own_values(whole.effects, whole.point.values))
    other = attempted(begun, whole.effects, weights, smooth=True, leader=near.objective, workers=workers)
    return near if other is None or near.objective <= other.objective else other


def verdict(d: Diagnosis) -> str:
    """Return "no_gap", "unknown", "explained" or "ambiguous"."""
    if not d.best.effects:
        return "no_gap"
    alone = len(d.ambiguity_set) == 1
    if "unknown" in d.best.effects:
        return "unknown"
    return "explained" if alone else "ambiguous"
