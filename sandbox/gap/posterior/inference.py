"""Inference: which sets of effects explain a campaign, how probable each is, and where its fit
lies.

The search (`search`) ends at the most probable set.  Sets within a few nats of it are then fitted
themselves and weighed at their own points; all others keep the chance that the algebra gives them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sandbox.gap.evidence.fit import BEHIND, NEAR, Fit, rms_of
from sandbox.gap.evidence.misfit import misfit, weights
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint
from sandbox.gap.posterior.evaluated import EvaluatedModel, evaluate
from sandbox.gap.posterior.linear_model import LinearModel
from sandbox.gap.posterior.search import Problem, Search, log_posterior
from sandbox.gap.posterior.sets import REACH, Set, SetPosterior, log_prior, possible
from sandbox.gap.unstated.unstated import Unstated

# of an effect's wide prior: a move on which slopes hold (the curvature of a delay makes 5 % of it)
STRAIGHT = 0.1
AGAIN = 2  # times at most that the search goes on from a set that leaves far less
SMALL = 1e-6  # probability below which a set is not listed


@dataclass(frozen=True)
class Inference:
    """The answer: ordinary deviations alone (far from the noise the first part of a fit), every
    fitted set evaluated, probability of sets of effects (the most probable first), the variance
    that estimates meet in every segment; linear: the last equations of all candidates; start,
    known: the campaign's nominal point with what it does not state and was found, and that."""

    start: ParameterPoint
    known: Unstated
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
        return float(
            np.average([self.variance[s.recording, "current"] for s in own], weights=count)
        )

    @property
    def best(self) -> EvaluatedModel:
        """The most probable set that was fitted."""
        return self.evaluated[max(self.evaluated, key=lambda k: self.sets.get(k, 0.0))]


def infer(problem: Problem) -> Inference:
    """Return the posterior over sets of effects of a campaign."""
    return _Weighing(Search(problem)).answer()


class _Weighing:
    """The sets near the most probable one, fitted and weighed; stand_ins, known (what the equations
    at its point say of others): by set."""

    def __init__(self, search: Search) -> None:
        self.search = search
        self.stand_ins: dict[Set, list[Set]] = {}
        self.known: dict[Set, SetPosterior] = {}

    @property
    def problem(self) -> Problem:
        """What is asked, with what the search found that the campaign does not state."""
        return self.search.problem

    def answer(self) -> Inference:
        """Return the answer; where a set beside the best one leaves far less than it, the search
        goes on from there: it stood at a poor point, and data count as far as what it left.  Where
        it ends far from the noise it begins anew at the nominal model as stated."""
        first = self.first(*self.search.begun())
        if rms_of(first[0].fit) > NEAR:
            begun, rough = self.search.begun(nominal=True)
            if self.problem.excerpts is None or self.far_less(begun, first[0].fit):
                other = self.first(begun, rough)
                first = other if self.far_less(other[0].fit, first[0].fit) else first
        found = self.around(*first)
        for _ in range(AGAIN):
            least = min((e.fit for e in found.evaluated.values()), key=rms_of)
            if not self.far_less(least, first[0].fit):
                break
            first = self.first(least, False)
            found = self.around(*first)
        return found

    def first(
        self, begun: Fit, rough: bool
    ) -> tuple[EvaluatedModel, Mapping[tuple[int, str], float]]:
        """Return the most probable set that is found from a fit on, and the variance that it
        meets; rough: the fit is no more than the first part of one."""
        best, known = self.search.grown(begun, rough)
        variance = misfit(best.point)
        return self.evaluated(best, variance, known), variance

    def far_less(self, new: Fit, old: Fit) -> bool:
        """Return whether a fit leaves less than half of another one's excess, which is one."""
        left, before = (rms_of(f) ** 2 - 1.0 for f in (new, old))
        return rms_of(old) > self.problem.settings.gap and left < 0.5 * before

    def around(self, first: EvaluatedModel, variance: Mapping[tuple[int, str], float]) -> Inference:
        """Return the sets near the most probable one, weighed by the variance that it meets; with
        them ordinary deviations alone, which were fitted already: slopes at another set's point say
        little of how far they would go without it."""
        fitted, self.stand_ins, self.known = {first.effects: first}, {}, {}
        behind: dict[Set, float] = {}
        if first.effects:
            self.weigh((), self.search.null, first, variance, fitted, behind)
        asked = [tuple(sorted(k)) for k in self.problem.rivals]
        while True:
            levels, near = self.posterior(fitted, behind)
            leader = fitted[max(fitted, key=lambda k: (levels[k], k))]
            asked = [k for k in asked if k not in fitted and k not in behind]
            many = len(fitted) + len(behind) > self.problem.settings.rivals
            if not asked and (not near or many):
                break
            key = asked[0] if asked else near[0]
            ahead = math.inf if asked else leader.fit.objective  # who is asked for is fitted whole
            new = self.search.fit_of(key, leader.fit, None, leader=ahead)
            if set(key) < set(leader.effects):
                new = self.search.begun_anew(key, leader.fit, new)
            self.weigh(key, new, leader, variance, fitted, behind, asked=bool(asked))
        total = sum(math.exp(v) for v in levels.values())
        sets = {
            k: math.exp(v) / total for k, v in sorted(levels.items(), key=lambda x: (-x[1], x[0]))
        }
        assert self.search.linear is not None
        kept = {k: p for k, p in sets.items() if p > SMALL or k in fitted}
        null = fitted[()].fit if () in fitted else self.search.null
        return Inference(
            self.problem.start, self.problem.known, null, fitted, kept, variance, self.search.linear
        )

    def sets_of(self, key: Set, e: EvaluatedModel) -> SetPosterior:
        """Return the sets that are weighed by the equations at a fitted set's point."""
        if key not in self.known:
            sets = SetPosterior(e.model)
            sets.enumerate([k for k, c in enumerate(sets.model.candidates) if c.effect in key])
            self.known[key] = sets
        return self.known[key]

    def from_nearest(
        self,
        fitted: Mapping[Set, EvaluatedModel],
        own: Mapping[Set, float],
        behind: Mapping[Set, float],
    ) -> dict[Set, float]:
        """Return the log posterior of sets that were not fitted, the best fitted one's 0, each by
        the equations at the point of the fitted set that is nearest to it; own: of fitted sets."""
        by_name = {f: self.sets_of(f, e).by_name() for f, e in fitted.items()}
        top, out = max(own.values()), {}
        # sorted: sums over sets come to the same digits whatever the seed of hashes is
        for key in sorted({k for names in by_name.values() for k in names} - {*fitted, *behind}):
            seen_by = [f for f in by_name if key in by_name[f]]
            f = min(seen_by, key=lambda f: (len(set(f) ^ set(key)), -own[f], f))
            out[key] = own[f] - top + by_name[f][key] - by_name[f][f]
        return out

    def weigh(
        self,
        key: Set,
        new: Fit | None,
        leader: EvaluatedModel,
        variance: Mapping[tuple[int, str], float],
        fitted: dict[Set, EvaluatedModel],
        behind: dict[Set, float],
        *,
        asked: bool = False,
    ) -> None:
        """Enter a fit among those that are weighed at their own points, or, where it is far behind
        the best one, among those that are not; who is asked for is weighed in any case."""
        lead = self.lead(leader.fit, new, variance)
        if new is None or (lead > BEHIND and not asked):
            behind[key] = self.level(leader) - lead
        else:
            fitted[key] = self.evaluated(new, variance)

    def lead(self, one: Fit, other: Fit | None, variance: Mapping[tuple[int, str], float]) -> float:
        """Return by how much the log posterior of one fit is above another's, both weighed at their
        own points; infinite where no drive can have the other."""
        if other is None:
            return math.inf
        own = (log_posterior(f, weights(variance), self.problem.settings) for f in (one, other))
        return next(own) - next(own)

    def level(self, e: EvaluatedModel) -> float:
        """Return the log posterior of a set that is weighed, up to a constant."""
        return e.log_evidence + log_prior(e.effects, self.problem.settings)

    def evaluated(
        self,
        found: Fit,
        variance: Mapping[tuple[int, str], float],
        known: NormalEquations | None = None,
    ) -> EvaluatedModel:
        """Return a fitted set weighed at its own point, traces of all other effects beside it;
        known: equations that were taken there."""
        own = self.search.candidates()
        return evaluate(found, own, self.search.how, weights(variance), known)

    def posterior(
        self, fitted: Mapping[Set, EvaluatedModel], behind: Mapping[Set, float]
    ) -> tuple[dict[Set, float], list[Set]]:
        """Return the log posterior of all sets, the best fitted one's 0, and the sets that ought to
        be fitted, the most probable first.

        behind: log posterior of sets whose fit ended far behind the best one's.  Fitted sets have
        the evidence of their own points; any other one stands to the nearest of them, the one that
        differs from it in the fewest effects, as the equations at its point say.  It ought to be
        fitted where that is more than the best one's, where it is near and parameters would move by
        more than slopes hold for, and where it only lacks an effect that others stand in for, or
        exchanges it for one that does.  So it ought where it lacks one effect and is within reach
        at all: that the best set has an effect too many shows at the other one's own point.  None
        ought where the best one leaves several times the noise: something outside the library
        decides then, not one set or another.
        """
        own = {k: self.level(e) for k, e in fitted.items()}
        leader = max(own, key=lambda k: (own[k], k))
        sets, top = self.sets_of(leader, fitted[leader]), own[leader]
        relative = self.from_nearest(fitted, own, behind)
        far = rms_of(self.search.null) > NEAR
        near = [
            k
            for k, v in relative.items()
            if v > 0.0
            or (v > -self.problem.settings.near and _far(sets, leader, k))
            or ((far or v > -REACH) and 0 < len(k) == len(leader) - 1 and set(k) < set(leader))
        ]
        near = sorted(near, key=lambda k: (-relative[k], k))
        if leader not in self.stand_ins:
            self.stand_ins[leader] = stand_ins(
                fitted[leader].model, leader, self.problem.settings.bend
            )
        near += [k for k in self.stand_ins[leader] if k not in {*near, *fitted, *behind}]
        if rms_of(fitted[leader].fit) > NEAR:
            near = []
        relative = {k: min(v, 0.0) for k, v in relative.items()}
        relative |= {k: v - top for k, v in (*own.items(), *behind.items())}
        return relative, near


def stand_ins(model: LinearModel, effects: Set, bend: float) -> list[Set]:
    """Return the sets with one of the effects, which the model's point has, left out or exchanged
    for another one, where the rest moves readings the same way: but for less than slopes err by, a
    share of what the effect moves.  The nearest first."""
    whole, point = (
        model.equations.most_probable(model.prior(effects, alone=True)),
        model.narrow.mean,
    )
    found = []
    for gone in effects:
        own = list(model.members[gone])
        moved = np.zeros_like(point)
        moved[own] = whole.x[own] - point[own]
        room = bend**2 * float(moved @ model.equations.a @ moved)
        rest = set(effects) - {gone}
        for new in [set(), *({e} for e in model.members if e not in effects)]:
            other = tuple(sorted(rest | new))
            if possible(other):
                lost = (
                    model.equations.most_probable(model.prior(other, alone=True)).objective
                    - whole.objective
                )
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
