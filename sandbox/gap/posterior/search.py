"""Search: the most probable set of effects, and its fit.

    residual and slopes of all candidates at a point -> posterior over sets by algebra -> fit of the
    most probable set

until no other set is more probable.  Far from the noise the misfit (`misfit`) makes the data count
for less, each set's own: sets are weighed by what the best of them leaves.  One is taken only where
its own fit proves better. Of a long campaign the first rounds look at excerpts; what these
name is only where the rounds on all of it begin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

from model.array_types import Array
from model.effects import library
from sandbox.gap.evidence.algebra import prior_of
from sandbox.gap.evidence.fit import (
    NEAR,
    Fit,
    Task,
    Weights,
    attempted,
    coordinates_of,
    fit,
    keeps_more,
    objective,
    rms_of,
)
from sandbox.gap.evidence.misfit import misfit, weights
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint, normal, part_of
from sandbox.gap.evidence.priors import CENTER, is_ordinary, ordinary, with_usual_sign
from sandbox.gap.posterior.candidates import (
    Candidate,
    begins_further,
    candidates,
    free_forms,
    further,
)
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.linear_model import (
    Linearisation,
    LinearModel,
    equations,
    linear_model,
)
from sandbox.gap.posterior.sets import Chosen, Set, SetPosterior, log_prior
from sandbox.gap.settings import USUAL, Settings
from sandbox.gap.unstated.unstated import NOTHING, Unstated, confirmed, unstated
from sandbox.replay.map_error import same_map

Parts = tuple[tuple[str, int], ...]
Report = Callable[[str], None]
# times at most that sets are weighed anew by what the best of them leaves; chosen, to end circles
REWEIGHTED = 8


@dataclass(frozen=True)
class Problem:
    """What is asked: a campaign at its nominal point, recordings that count, effects that are no
    candidates, sets that are fitted whatever else is, settings, threads, and whom to tell;
    excerpts: what returns the same of parts of a long campaign, made where it is looked at;
    known: what the campaign does not state and was found already; begun: values that ordinary
    deviations alone begin at, None for the nominal ones."""

    start: ParameterPoint
    fitted: Weights
    exclude: Sequence[str] = ()
    rivals: Sequence[Set] = ()
    settings: Settings = USUAL
    workers: int = 1
    report: Report = lambda _: None
    excerpts: Callable[[], ParameterPoint] | None = None
    known: Unstated = NOTHING
    begun: Mapping[str, float] | None = None

    def stating(self, new: Unstated) -> Problem:
        """Return the same of a campaign that states what was found."""
        parts = self.excerpts
        short = None if parts is None else cache(lambda: new.at(parts()))
        return replace(
            self, start=new.at(self.start), excerpts=short, known=self.known.and_then(new)
        )


class Search:
    """A run of the loop: candidates by effect with which sets are fitted, the last equations of all
    candidates."""

    def __init__(self, problem: Problem, *, rough: float = math.inf) -> None:
        """rough: times the noise above which ordinary deviations need no more than the first part
        of a fit."""
        self.problem, self.rough = problem, rough
        problem.report("fitting ordinary deviations")
        begun = replace(problem.start, values=problem.begun or problem.start.values)
        self.null = fit(begun, (), problem.fitted, rough=rough, workers=problem.workers)
        self.null = self.mirrored(self.null)
        self.trace = problem.settings.trace_at(rms_of(self.null))
        self.linear: LinearModel | None = None
        self.met: Weights = {}  # of segments, at their point
        self.chosen: dict[str, Candidate] = {}
        # all candidates, as the residual of the first fit that asks for them shows them
        self.found: list[Candidate] = []
        self.looked = False  # whether nothing was found that the campaign does not state

    def begun(self, *, nominal: bool = False) -> tuple[Fit, bool]:
        """Return the fit of the set that excerpts name, without effects where there are none, and
        where ordinary deviations leave little for them to name; and whether it is no more than the
        first part of one: near the noise the set is mostly the answer, and is fitted whole before
        all candidates are linearised there.

        nominal: the search begins at the nominal model as stated (`at_nominal`), not where ordinary
        deviations are fitted.
        """
        p, alone = self.problem, (self.null, rms_of(self.null) > self.rough)
        if p.excerpts is None or rms_of(self.null) <= p.settings.gap:
            return (self.at_nominal(), True) if nominal else alone
        part = p.excerpts()
        fitted = weights_of(len(part.prepared.recordings))
        short = replace(p, start=part, fitted=fitted, excerpts=None, report=lambda _: None)
        with part_of(part.prepared.samples / p.start.prepared.samples):
            first = Search(short, rough=0.0)
            begun = first.at_nominal() if nominal else first.null
            found, _ = first.grown(begun, True, whole=False)
        if first.problem.known.counts is not p.known.counts:
            self.state(Unstated(counts=first.problem.known.counts))
            p, alone = self.problem, (self.null, rms_of(self.null) > self.rough)
        if not found.effects:
            return alone
        self.chosen = {
            e: c
            for e, c in first.chosen.items()
            if e in found.effects or not library.load_effect(e).free
        }
        p.report(f"fitting {' + '.join(found.effects)}")
        at = replace(
            p.start,
            values=found.point.values,
            prepared=same_map(p.start.prepared, found.point.prepared),
        )
        new = attempted(Task(at, found.effects, p.fitted, p.workers, NEAR), smooth=True)
        if new is None:
            return alone
        rough = rms_of(new) > NEAR
        return (new if rough else self.best_form(new, new.effects, False)), rough

    def at_nominal(self) -> Fit:
        """Return the nominal point itself as a fit without effects: far from the noise, ordinary
        deviations that are fitted alone bend towards what is missing, and effects may not find the
        way back."""
        p = self.problem
        n = normal(p.start, coordinates_of(p.start, ()), workers=p.workers)
        value = objective(n, prior_of(n.coordinates), p.fitted)
        return Fit((), p.start, n.bare(), value, n.simulations)

    def grown(
        self, here: Fit, rough: bool, *, whole: bool = True
    ) -> tuple[Fit, NormalEquations | None]:
        """Return the fit of the most probable set: fitted, linearised anew, until the posterior
        names no other; and the equations of all candidates at its point, where they are known.

        here: where the first round begins; rough: it is no more than the first part of a fit;
        whole: the last fit is one, else its first part is enough.
        """
        known: NormalEquations | None = None
        seen: set[Parts] = {_parts(here.effects), ()}
        tried: set[Parts] = set()
        self.problem.report("weighing all sets of effects")
        self.found = []
        wide = 1 if here.effects else 2  # rounds that look at all candidates
        if self.chosen and not keeps_more(here, self.problem.settings.gap):
            wide = 0  # excerpts chose beside a set that leaves nothing here, either
        for turn in range(self.problem.settings.rounds):
            found = self.every(here) if turn < wide else self.candidates()
            sets = self.linearised(here, found, known)
            known, self.linear = (
                sets.model.normal,
                replace(sets.model, normal=sets.model.normal.bare()),
            )
            new = self.better(here, known, sets, seen, tried)
            if new is not None:
                here, known, rough = new, None, True
                continue
            if rough and whole:
                new = self.fit_of(here.effects, here, known)
                if new is None:
                    break
                here, known, rough = new, None, False
                continue
            if turn + 1 == self.problem.settings.rounds:
                break
            new = self.restated(here, excerpts=not whole)
            if new is not None:
                here, known, wide = new, None, turn + 2
                seen, tried = {_parts(here.effects)}, set()
            elif self.freed(here):
                wide = turn + 2
            else:
                break
        if rough and whole:
            here, known = self.fit_of(here.effects, here, known) or here, None
        if here.effects and whole:
            other = self.mirrored(here)
            here, known = other, known if other is here else None
        return here, known

    def mirrored(self, found: Fit) -> Fit:
        """Return a fit, or that of the same set which begins with the zone of a current's sign on
        the other side of zero, where that fits better.

        Edges late by half on one side of zero, or on the other, are two hollows of the objective,
        and slopes in the middle lead to either.  Far from the noise the sign is as it usually is.
        """
        center = found.point.values[CENTER]
        if not center or rms_of(found) > min(NEAR, self.rough):
            return found
        p, values = self.problem, {**found.point.values, CENTER: -center}
        task = Task(
            replace(found.point, values=values),
            found.effects,
            p.fitted,
            p.workers,
            leader=found.objective,
        )
        new = attempted(task)
        return new if new is not None and new.objective < found.objective else found

    @property
    def how(self) -> Linearisation:
        """How equations of all candidates are taken."""
        return Linearisation(self.trace, self.problem.settings, self.problem.workers)

    def restated(self, here: Fit, *, excerpts: bool) -> Fit | None:
        """Return a set fitted again to the campaign that states what its fit's residual tells; None
        where that tells nothing, or stating it leaves more: then nothing is looked for again, as
        curves join, which hide it."""
        if self.looked:
            return None
        p = self.problem
        new, again = unstated(here, p.known, p.settings, excerpts=excerpts), None
        if new:
            p.report("fitting what the campaign does not state")
            at, rough = new.at(here.point), 0.0 if excerpts else math.inf
            again = attempted(Task(at, here.effects, p.fitted, p.workers, rough), smooth=True)
        if again is None or not confirmed(here, again, new):
            self.looked = True
            return None
        self.state(new, again)
        return again

    def state(self, new: Unstated, again: Fit | None = None) -> None:
        """State in the campaign what was found, and fit ordinary deviations again; again: a fit to
        the campaign that states it, which serves where it is of them alone."""
        self.problem = p = self.problem.stating(new)
        if again is not None and not again.effects:
            self.null = again
        else:
            at = new.at(self.null.point)
            self.null = fit(at, (), p.fitted, rough=self.rough, workers=p.workers)
        self.trace = p.settings.trace_at(rms_of(self.null))

    def freed(self, here: Fit) -> bool:
        """Return whether curves join the candidates: once, where no set of the others leaves but
        noise."""
        known = {c.effect for c in self.found} | set(self.chosen)
        new = [c for c in free_forms(here.point, self.problem.exclude) if c.effect not in known]
        if not keeps_more(here, self.problem.settings.gap) or not new:
            return False
        self.found = [*self.candidates(), *new]
        return True

    def better(
        self,
        here: Fit,
        known: NormalEquations,
        sets: SetPosterior,
        seen: set[Parts],
        tried: set[Parts],
    ) -> Fit | None:
        """Return the fit, its first part, of a more probable set than the one that is fitted here;
        None where there is none.  seen: sets that were fitted here before; tried: those that were
        none better since the last one was.

        A set is taken only where its own residual makes it more probable than the one here, weighed
        alike.  Near the noise slopes are right, and the most probable set is tried.  Far from it
        they say little of sets far from here, and the most probable ones are tried in turn.
        """
        settings, far = self.problem.settings, rms_of(here) > NEAR
        own = max(
            (k for k in sets.known if sets.parts(k) == _parts(here.effects)),
            key=sets.known.__getitem__,
        )
        least = sets.known[own] - settings.near if far else sets.known[sets.best()]
        near: dict[Parts, Chosen] = {}
        for k in sorted(
            (k for k, v in sets.known.items() if v >= least), key=lambda k: (-sets.known[k], k)
        ):
            near.setdefault(sets.parts(k), k)
        level = self.weighed(here, sets, own)
        for parts in [x for x in near if x not in seen | tried][: settings.tries if far else 1]:
            self.choose(sets, near[parts])
            new = self.fit_of(sets.names(near[parts]), here, known, sets, near[parts])
            if new is not None and self.weighed(new, sets, near[parts]) > level:
                seen.add(parts)
                tried.clear()
                return new
            tried.add(parts)
        self.choose(sets, sets.best())
        return None

    def weighed(self, found: Fit, sets: SetPosterior, chosen: Chosen) -> float:
        """Return the log posterior of a fitted set, up to a constant: at its own point, with the
        weights and the price of its candidates in `sets`."""
        return log_posterior(found, self.met, self.problem.settings) - sum(
            sets.price[k] for k in chosen
        )

    def linearised(
        self, here: Fit, found: Sequence[Candidate], known: NormalEquations | None = None
    ) -> SetPosterior:
        """Return the posterior over sets at a fit's point; known: equations that were taken there.

        What a set leaves tells how far the data count: it is weighed anew by what the best set
        leaves, as slopes say, until that is the best one, REWEIGHTED times at most.  So what is
        behind a large gap is named in one round.
        """
        p, variance = self.problem, misfit(here.point)
        left = rms_of(here) > p.settings.gap
        alone = {c.effect for c in found if left and begins_further(c.effect)}
        more = further(here.point, sorted({*here.effects, *alone}))
        model = linear_model(
            here.point,
            [*found, *more],
            here.effects,
            self.how,
            weights(variance),
            known,
        )
        own = tuple(
            k for k, c in enumerate(model.candidates) if c.effect in here.effects and c.part == 1
        )
        best, sets, self.met = own, SetPosterior(model), weights(variance)
        for _ in range(REWEIGHTED):
            if sets.climb(own) == best:
                sets.enumerate(own)
                if sets.best() == best:
                    return sets
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
            level = sets.weigh(key) if sets.allowed(key) else -math.inf
            if c.effect not in levels or level > levels[c.effect]:
                levels[c.effect], self.chosen[c.effect] = level, c

    def every(self, here: Fit) -> list[Candidate]:
        """Return all candidates, begun where the residual of a fit shows them; once."""
        if not self.found:
            self.found = candidates(here.point, self.problem.exclude, left=rms_of(here))
        return self.found

    def candidates(self) -> list[Candidate]:
        """Return the chosen candidates, of those that are chords the slopes, too: which of both the
        truth is nearer to depends on what stands in its place."""
        own = list(self.chosen.values())
        return [x for c in own for x in ((c.slope, c) if c.chord else (c,))]

    def fit_of(
        self,
        key: Set,
        near: Fit,
        known: NormalEquations | None,
        sets: SetPosterior | None = None,
        best: Chosen = (),
        leader: float = math.inf,
    ) -> Fit | None:
        """Return the fit of a set that begins at another one's point; None where no drive can have
        it.

        known: equations there; sets, best: the posterior that chose it: then its first part is
        enough, for the next round's equations; leader: as in `fit`.
        """
        self.problem.report(f"fitting {' + '.join(key) or 'ordinary deviations'}")
        p = self.problem
        at = towards(near, key, [c for e, c in self.chosen.items()])
        if sets is not None:
            at = self.moved(at, near, sets, best)
        rough = sets is not None
        enough = 0.0 if rough else math.inf
        task = Task(at, key, p.fitted, p.workers, enough, known, leader)
        found = attempted(task, smooth=True)
        new = set(key) - set(near.effects)
        if found is None or (rough and not new):
            return found
        return self.best_form(found, [e for e in key if e in new or not rough], rough)

    def begun_anew(self, key: Set, near: Fit, found: Fit | None) -> Fit | None:
        """Return the fit of a set, or one that begins at the nominal model with the sizes its
        effects have in another fit, where that fits better: with what that one bent for an effect
        more it may end at a poor point.  Ordinary deviations alone were fitted so at first."""
        p = self.problem
        if not key:
            return self.null if found is None else min(found, self.null, key=lambda f: f.objective)
        own = {k: v for k, v in near.point.values.items() if k.partition(".")[0] in key}
        begun = replace(p.start, values={**p.start.values, **own})
        leader = math.inf if found is None else found.objective
        new = attempted(Task(begun, key, p.fitted, p.workers, leader=leader), smooth=True)
        return found if new is None or not new.objective < leader else new

    def best_form(self, found: Fit, effects: Sequence[str], rough: bool) -> Fit:
        """Return a fit, or that of the same set with one of these effects in its other form where
        that fits better; rough: both are no more than the first part of one.  The other form begins
        with the usual sign of currents: this one may have bent it."""
        p, point = self.problem, found.point
        drive, width = point.prepared.campaign.drive, point.values["bench.soft_current"]
        for effect in effects:
            card = library.load_effect(effect)
            if card.otherwise is None:
                continue
            other = card.otherwise(point.values, width, drive.motor, drive.converter)
            usual = with_usual_sign({**point.values, **other}, drive.motor)
            at = replace(point, values=usual)
            enough, leader = 0.0 if rough else math.inf, found.objective
            task = Task(at, found.effects, p.fitted, p.workers, enough, leader=leader)
            new = attempted(task, smooth=not rough)
            if new is not None and new.objective < found.objective:
                found = new
        return found

    def moved(
        self, at: ParameterPoint, near: Fit, sets: SetPosterior, best: Chosen
    ) -> ParameterPoint:
        """Return a point with chords at the size that the algebra gives them, and further parts
        begun."""
        x, values = sets.most_probable(best), dict(at.values)
        for k in best:
            c, places = sets.model.candidates[k], sets.model.places[k]
            if c.part > 1:
                values |= c.begun(at)
            elif c.chord and c.effect not in near.effects:
                coordinate = sets.model.coordinates[places[0]]
                values |= coordinate.changes(values, coordinate.bounded(float(x[places[0]])))
        return replace(at, values=values)


def log_posterior(f: Fit, met: Weights, settings: Settings) -> float:
    """Return the log posterior of a fitted set, up to a constant: Laplace's approximation at its
    point, which need not be the most probable one; met: weights of segments."""
    prior, own = prior_of(f.normal.coordinates), equations(f.normal, met)
    short = own.objective(own.x, prior) - own.most_probable(prior).objective
    return log_prior(f.effects, settings) + own.log_evidence(prior) - 0.5 * short


def _parts(effects: Sequence[str]) -> Parts:
    """Return the first part of each effect."""
    return tuple((e, 1) for e in sorted(effects))


def left_by(
    model: LinearModel, x: Array, variance: Mapping[tuple[int, str], float]
) -> dict[tuple[int, str], float]:
    """Return the variance that estimates meet in every segment with coordinates at x (p,), as the
    equations at the model's point say; variance: at that point.  Its excess falls in proportion to
    the squared residual's."""
    out = {}
    for s in model.normal.segments:
        move, here, n = (x - model.normal.x)[s.places], float(s.ssr.sum()), float(s.n.sum())
        there = here - 2.0 * float(move @ s.g.sum(0)) + float(move @ s.a.sum(0) @ move)
        share = min(1.0, max(0.0, there - n) / (here - n)) if here > n else 1.0
        out[s.recording, s.channel] = 1.0 + (variance[s.recording, s.channel] - 1.0) * share
    return out


def towards(best: Fit, key: Sequence[str], chosen: Sequence[Candidate]) -> ParameterPoint:
    """Return a fit's point with the effects that another set lacks at neutral, and those it has
    more begun; without effects so far, signs of currents go through zero as they usually do."""
    campaign = best.point.prepared.campaign
    neutral, first = library.neutral(campaign.drive.motor), library.same_numbers()
    values = dict(best.point.values)
    lacks = [library.load_effect(e) for e in best.effects if e not in key]
    lacks = [card for card in lacks if not is_ordinary(card, campaign, values)]
    gone = tuple(f"{card.name}." for card in lacks)
    left = values | {k: x for k, x in neutral.items() if k.startswith(gone)}
    kept = {c.label for c in ordinary(campaign, left)}
    used = kept | {first.get(k, k) for k in neutral if k.partition(".")[0] in key}
    owns = {first.get(k, k) for k in neutral if k.startswith(gone)} - used
    formed = tuple(f"{card.name}." for card in lacks if card.ordinarily is not None)
    for own in owns | {k for k in kept if k.startswith(formed)}:
        values |= library.moved(own, neutral[own])
    if not best.effects:
        values = with_usual_sign(values, campaign.drive.motor)
    for c in chosen:
        if c.effect in key and c.effect not in best.effects:
            values |= c.start
    return replace(best.point, values=values)
