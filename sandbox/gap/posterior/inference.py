"""Inference: which sets of effects explain a campaign, how probable each is, and where its fit lies.

    residual and slopes of all candidates at a point -> posterior over sets by algebra -> fit of the most probable set

until no other set is more probable. Far from the floor the misfit (`misfit`) makes the data count for less, each
set's own: sets are weighed by what the best of them leaves, and one is taken only where its own fit proves better. Of
a long campaign the first rounds look at excerpts; what these name is only where the rounds on all of it begin. Sets
within a few nats of the best one are then fitted themselves and weighed at their own points; all others keep the
chance that the algebra gives them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from sandbox.gap.evidence.algebra import prior_of
from sandbox.gap.evidence.fit import NEAR, Fit, Weights, attempted, fit, rms_of
from sandbox.gap.evidence.normal import Normal, Point, part_of
from sandbox.gap.evidence.priors import ordinary, with_usual_sign
from sandbox.gap.posterior.candidates import Candidate, candidates, further
from sandbox.gap.posterior.evaluated import EvaluatedModel, evaluate
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.linear_model import LinearModel, equations, linear_model
from sandbox.gap.posterior.misfit import misfit, weights
from sandbox.gap.posterior.set_prior import Set, log_prior, possible
from sandbox.gap.posterior.sets import Chosen, SetPosterior
from sandbox.gap.posterior.settings import USUAL, Settings

Array = NDArray[np.float64]
Parts = tuple[tuple[str, int], ...]
Report = Callable[[str], None]
STRAIGHT = 0.1  # of an effect's wide prior: a move on which slopes hold (the curvature of a delay makes 5 % of it)
REWEIGHTED = 8  # times at most that sets are weighed anew by what the best of them leaves; chosen, to end circles
SMALL = 1e-6  # probability below which a set is not listed


@dataclass(frozen=True)
class Problem:
    """What is asked: a campaign at its nominal point, recordings that count, effects that are no candidates, sets that
    are fitted whatever else is, settings, threads, and whom to tell; excerpts: the same of parts of a long campaign."""

    start: Point
    fitted: Weights
    exclude: Sequence[str] = ()
    rivals: Sequence[Set] = ()
    settings: Settings = USUAL
    workers: int = 1
    report: Report = lambda _: None
    excerpts: Point | None = None


@dataclass(frozen=True)
class Inference:
    """The answer: ordinary deviations alone, every fitted set evaluated, probability of sets of effects (the most
    probable first), the variance that estimates meet in every segment; linear: the last equations of all candidates."""

    null: Fit
    evaluated: Mapping[Set, EvaluatedModel]
    sets: Mapping[Set, float]
    variance: Mapping[tuple[int, str], float]
    linear: LinearModel

    @property
    def mean_variance(self) -> float:
        """The variance that estimates meet in currents, mean over readings."""
        own = [s for s in self.null.normal.segments if s.channel == "current"]
        count = [float(s.n.sum()) for s in own]
        return float(np.average([self.variance[s.recording, "current"] for s in own], weights=count))

    @property
    def best(self) -> EvaluatedModel:
        """The most probable set that was fitted."""
        return self.evaluated[max(self.evaluated, key=lambda k: self.sets.get(k, 0.0))]


def infer(problem: Problem) -> Inference:
    """Return the posterior over sets of effects of a campaign."""
    return _Run(problem).answer()


class _Run:
    """A run of the loop: fits by set, candidates by effect with which sets are evaluated."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        problem.report("fitting ordinary deviations")
        self.null = fit(problem.start, (), problem.fitted, workers=problem.workers)
        self.trace = problem.settings.trace_at(rms_of(self.null))
        self.linear: LinearModel | None = None  # the last equations of all candidates
        self.met: Weights = {}  # of segments, at their point
        self.chosen: dict[str, Candidate] = {}
        self.stand_ins: dict[Set, list[Set]] = {}  # by set
        self.found: list[Candidate] = []  # all candidates, as the residual of ordinary deviations alone shows them

    def answer(self) -> Inference:
        """Return the answer."""
        best, known = self.grown(self.begun())
        variance = misfit(best.point)
        fitted = {best.effects: self.evaluated(best, variance, known)}
        known = None
        impossible: set[Set] = set()
        asked = [tuple(sorted(k)) for k in self.problem.rivals]
        while True:
            told, near = self.posterior(fitted, impossible)
            leader = fitted[max(fitted, key=lambda k: (told[k], k))]
            asked = [k for k in asked if k not in fitted and k not in impossible]
            if not asked and (not near or len(fitted) > self.problem.settings.rivals):
                break
            key = asked[0] if asked else near[0]
            new = self.fit_of(key, leader.fit, None)
            if new is None:
                impossible.add(key)
            else:
                fitted[key] = self.evaluated(new, variance)
        total = sum(math.exp(v) for v in told.values())
        sets = {k: math.exp(v) / total for k, v in sorted(told.items(), key=lambda x: (-x[1], x[0]))}
        assert self.linear is not None
        kept = {k: p for k, p in sets.items() if p > SMALL or k in fitted}
        return Inference(self.null, fitted, kept, variance, self.linear)

    def begun(self) -> Fit:
        """Return the fit, to a few per cent of what is left, of the set that excerpts name; without effects where there
        are none, and where ordinary deviations leave little for them to name."""
        p = self.problem
        if p.excerpts is None or rms_of(self.null) <= p.settings.gap:
            return self.null
        parts = p.excerpts.prepared.recordings
        short = replace(p, start=p.excerpts, fitted=weights_of(len(parts)), excerpts=None, report=lambda _: None)
        with part_of(p.excerpts.prepared.samples / p.start.prepared.samples):
            first = _Run(short)
            found, _ = first.grown(first.null, whole=False)
        if not found.effects:
            return self.null
        self.chosen = first.chosen
        p.report(f"fitting {' + '.join(found.effects)}")
        at = replace(p.start, values=found.point.values)
        return attempted(at, found.effects, p.fitted, smooth=True, rough=True, workers=p.workers) or self.null

    def grown(self, here: Fit, *, whole: bool = True) -> tuple[Fit, Normal | None]:
        """Return the fit of the most probable set: fitted, linearised anew, until the posterior names no other; and
        the equations of all candidates at its point, where they are known.

        here: where the first round begins; whole: the last fit is one, else its first part is enough.
        """
        known, rough = None, bool(here.effects)
        seen: set[Parts] = {_parts(here.effects), ()}
        tried: set[Parts] = set()
        self.problem.report("weighing all sets of effects")
        self.found = candidates(here.point, self.problem.exclude, left=rms_of(here))
        wide = 1 if here.effects else 2  # rounds that look at all candidates
        for turn in range(self.problem.settings.rounds):
            sets = self.linearised(here, self.found if turn < wide else self.candidates())
            known, self.linear = sets.model.normal, replace(sets.model, normal=sets.model.normal.bare())
            new = self.better(here, known, sets, seen, tried)
            if new is None:
                if not rough or not whole:
                    break
                rough, new = False, self.fit_of(here.effects, here, known)
                if new is None:
                    break
            else:
                rough = True
            here, known = new, None
        if rough and whole:
            return self.fit_of(here.effects, here, known) or here, None
        return here, known

    def better(self, here: Fit, known: Normal, sets: SetPosterior, seen: set[Parts], tried: set[Parts]) -> Fit | None:
        """Return the fit, its first part, of a more probable set than the one that is fitted here; None where there is
        none.  seen: sets that were fitted here before; tried: those that were none better since the last one was.

        Near the floor slopes are right, and the most probable set is taken.  Far from it they say little of sets far
        from here: the most probable ones are tried, and the first whose own residual makes it more probable, weighed
        as the one here is, is taken.
        """
        settings, far = self.problem.settings, rms_of(here) > NEAR
        own = max((k for k in sets.known if sets.parts(k) == _parts(here.effects)), key=sets.known.__getitem__)
        least = sets.known[own] - settings.near if far else sets.known[sets.best()]
        near: dict[Parts, Chosen] = {}
        for k in sorted((k for k, v in sets.known.items() if v >= least), key=lambda k: (-sets.known[k], k)):
            near.setdefault(sets.parts(k), k)
        barred = seen | tried if far else seen
        level = self.weighed(here, sets, own) if far else -math.inf
        for parts in [x for x in near if x not in barred][: settings.tries if far else 1]:
            self.choose(sets, near[parts])
            new = self.fit_of(sets.names(near[parts]), here, known, sets, near[parts])
            if new is not None and (not far or self.weighed(new, sets, near[parts]) > level):
                seen.add(parts)
                tried.clear()
                return new
            tried.add(parts)
        self.choose(sets, sets.best())
        return None

    def weighed(self, found: Fit, sets: SetPosterior, chosen: Chosen) -> float:
        """Return the log posterior of a fitted set, up to a constant: at its own point, with the weights and the price
        of its candidates in `sets`."""
        return log_posterior(found, self.met, self.problem.settings) - sum(sets.price[k] for k in chosen)

    def linearised(self, here: Fit, found: Sequence[Candidate]) -> SetPosterior:
        """Return the posterior over sets at a fit's point.

        What a set leaves tells how far the data count: it is weighed anew by what the best set leaves, as slopes say,
        until that is the best one, REWEIGHTED times at most.  So what is behind a large gap is named in one round.
        """
        p, more, variance = self.problem, further(here.point, here.effects), misfit(here.point)
        model = linear_model(
            here.point,
            [*found, *more],
            here.effects,
            self.trace,
            weights(variance),
            settings=p.settings,
            workers=p.workers,
        )
        own = tuple(k for k, c in enumerate(model.candidates) if c.effect in here.effects and c.part == 1)
        best, sets, self.met = own, SetPosterior(model), weights(variance)
        sets.enumerate(own)
        for _ in range(REWEIGHTED):
            if sets.best() == best:
                break
            best = sets.best()
            met = left_by(model, sets.most_probable(best), variance)
            model = replace(model, equations=equations(model.normal, weights(met)))
            sets = SetPosterior(model)
            sets.enumerate(own)
        return sets

    def choose(self, sets: SetPosterior, best: Chosen) -> None:
        """Choose for every effect the candidate that is most probable beside a set, or in it."""
        levels: dict[str, float] = {}
        for k, c in enumerate(sets.model.candidates):
            if c.part > 1:
                continue
            rest = (x for x in best if sets.effects[x] != c.effect)
            key = tuple(sorted((*rest, k)))
            told = sets.weigh(key) if sets.allowed(key) else -math.inf
            if c.effect not in levels or told > levels[c.effect]:
                levels[c.effect], self.chosen[c.effect] = told, c

    def candidates(self) -> list[Candidate]:
        """Return the chosen candidates, of those that are chords the slopes, too: which of both the truth is nearer to
        depends on what stands in its place."""
        own = list(self.chosen.values())
        return [x for c in own for x in ((c.slope, c) if c.chord else (c,))]

    def fit_of(
        self, key: Set, near: Fit, known: Normal | None, sets: SetPosterior | None = None, best: Chosen = ()
    ) -> Fit | None:
        """Return the fit of a set that begins at another one's point; None where no drive can have it.

        known: equations there; sets, best: the posterior that chose it: then its first part is enough, for the next
        round's equations.
        """
        self.problem.report(f"fitting {' + '.join(key) or 'ordinary deviations'}")
        p = self.problem
        at = towards(near, key, [c for e, c in self.chosen.items()])
        if sets is not None:
            at = self.moved(at, near, sets, best)
        rough = sets is not None
        found = attempted(at, key, p.fitted, smooth=True, rough=rough, near=known, workers=p.workers)
        new = set(key) - set(near.effects)
        if found is None or (rough and not new):
            return found
        return self.best_form(found, [e for e in key if e in new or key == near.effects], rough)

    def best_form(self, found: Fit, effects: Sequence[str], rough: bool) -> Fit:
        """Return a fit, or that of the same set with one of these effects in its other form where that fits better."""
        p, point = self.problem, found.point
        drive, width = point.prepared.campaign.drive, point.values["bench.soft_current"]
        for effect in effects:
            card = library.load_effect(effect)
            if card.otherwise is None:
                continue
            at = replace(point, values={**point.values, **card.otherwise(point.values, width, drive.converter)})
            new = attempted(at, found.effects, p.fitted, rough=True, leader=found.objective, workers=p.workers)
            if new is not None and new.objective < found.objective:
                whole = None if rough else attempted(new.point, found.effects, p.fitted, smooth=True, workers=p.workers)
                found = whole or new
        return found

    def moved(self, at: Point, near: Fit, sets: SetPosterior, best: Chosen) -> Point:
        """Return a point with chords at the size that the algebra gives them, and further parts begun."""
        x, values = sets.most_probable(best), dict(at.values)
        for k in best:
            c, places = sets.model.candidates[k], sets.model.places[k]
            if c.part > 1:
                values |= c.begun(at)
            elif c.chord and c.effect not in near.effects:
                coordinate = sets.model.coordinates[places[0]]
                values |= coordinate.changes(values, coordinate.bounded(float(x[places[0]])))
        return replace(at, values=values)

    def evaluated(
        self, found: Fit, variance: Mapping[tuple[int, str], float], known: Normal | None = None
    ) -> EvaluatedModel:
        """Return a fitted set weighed at its own point, traces of all other effects beside it; known: equations that
        were taken there."""
        p, own = self.problem, self.candidates()
        return evaluate(found, own, self.trace, weights(variance), known, settings=p.settings, workers=p.workers)

    def posterior(
        self, fitted: Mapping[Set, EvaluatedModel], impossible: set[Set]
    ) -> tuple[dict[Set, float], list[Set]]:
        """Return the log posterior of all sets, the best fitted one's 0, and the sets that ought to be fitted, the most
        probable first.

        Fitted sets have the evidence of their own points; any other one stands to the best of them as the equations at
        its point say.  It ought to be fitted where that is more than the best one's, where it is near and parameters
        would move by more than slopes hold for, and where it only exchanges an effect for one that stands in for it.
        None ought where the best one leaves several floors: something outside the library decides then, not one set or
        another.
        """
        own = {k: e.log_evidence + log_prior(k, self.problem.settings) for k, e in fitted.items()}
        leader = max(own, key=lambda k: (own[k], k))
        sets = SetPosterior(fitted[leader].model)
        sets.enumerate([k for k, c in enumerate(sets.model.candidates) if c.effect in leader])
        by_name, top = sets.by_name(), own[leader]
        told = {k: v - by_name[leader] for k, v in by_name.items() if k not in fitted and k not in impossible}
        near = [k for k, v in told.items() if v > 0.0 or (v > -self.problem.settings.near and _far(sets, leader, k))]
        near = sorted(near, key=lambda k: (-told[k], k))
        if leader not in self.stand_ins:
            self.stand_ins[leader] = stand_ins(fitted[leader].model, leader, self.problem.settings.bend)
        near += [k for k in self.stand_ins[leader] if k not in {*near, *fitted, *impossible}]
        if rms_of(fitted[leader].fit) > NEAR:
            near = []
        told = {k: min(v, 0.0) for k, v in told.items()} | {k: v - top for k, v in own.items()}
        return told, near


def log_posterior(f: Fit, met: Weights, settings: Settings) -> float:
    """Return the log posterior of a fitted set, up to a constant: Laplace's approximation at its point, which need not
    be the most probable one; met: weights of segments."""
    prior, own = prior_of(f.normal.coordinates), equations(f.normal, met)
    short = own.objective(own.x, prior) - own.most_probable(prior).objective
    return log_prior(f.effects, settings) + own.log_evidence(prior) - 0.5 * short


def _parts(effects: Sequence[str]) -> Parts:
    """Return the first part of each effect."""
    return tuple((e, 1) for e in sorted(effects))


def left_by(model: LinearModel, x: Array, variance: Mapping[tuple[int, str], float]) -> dict[tuple[int, str], float]:
    """Return the variance that estimates meet in every segment with coordinates at x (p,), as the equations at the
    model's point say; variance: at that point.  Its excess falls in proportion to the squared residual's."""
    out = {}
    for s in model.normal.segments:
        move, here, n = (x - model.normal.x)[s.places], float(s.rr.sum()), float(s.n.sum())
        there = here - 2.0 * float(move @ s.g.sum(0)) + float(move @ s.a.sum(0) @ move)
        share = min(1.0, max(0.0, there - n) / (here - n)) if here > n else 1.0
        out[s.recording, s.channel] = 1.0 + (variance[s.recording, s.channel] - 1.0) * share
    return out


def stand_ins(model: LinearModel, effects: Set, bend: float) -> list[Set]:
    """Return the sets with one of the effects, which the model's point has, exchanged for another one that moves
    readings the same way: but for less than slopes err by, a share of what the effect moves.  The nearest first."""
    whole, point = model.equations.most_probable(model.prior(effects, alone=True)), model.narrow.mean
    found = []
    for gone in effects:
        own = list(model.members[gone])
        moved = np.zeros_like(point)
        moved[own] = whole.x[own] - point[own]
        room = bend**2 * float(moved @ model.equations.a @ moved)
        for new in model.members:
            other = tuple(sorted({*effects, new} - {gone}))
            if new not in effects and possible(other):
                lost = model.equations.most_probable(model.prior(other, alone=True)).objective - whole.objective
                if lost < room:
                    found.append((lost, other))
    return [other for _, other in sorted(found)]


def _far(sets: SetPosterior, here: Set, there: Set) -> bool:
    """Return whether some effect's size is another one in two sets by more than slopes hold for."""
    places = {c.effect: k for k, c in enumerate(sets.model.candidates)}
    ends = [sets.most_probable(tuple(places[e] for e in key)) for key in (here, there)]
    own = [k for e in {*here, *there} for k in sets.model.places[places[e]]]
    moved = np.abs(ends[1] - ends[0])[own] / sets.model.wide.deviation[own]
    return bool(np.any(moved > STRAIGHT))


def towards(best: Fit, key: Sequence[str], chosen: Sequence[Candidate]) -> Point:
    """Return a fit's point with the effects that another set lacks at neutral, and those it has more begun; without
    effects so far, signs of currents go through zero as they usually do."""
    campaign = best.point.prepared.campaign
    neutral, kept = library.neutral(campaign.drive.motor), {c.label for c in ordinary(campaign)}
    gone = tuple(f"{e}." for e in best.effects if e not in key)
    first = library.same_numbers()
    used = kept | {first.get(k, k) for k in neutral if k.partition(".")[0] in key}
    owns = {first.get(k, k) for k in neutral if gone and k.startswith(gone)} - used
    values = dict(best.point.values)
    for own in owns:
        values |= library.moved(own, neutral[own])
    if not best.effects:
        values = with_usual_sign(values, campaign.drive.motor)
    for c in chosen:
        if c.effect in key and c.effect not in best.effects:
            values |= c.start
    return replace(best.point, values=values)
