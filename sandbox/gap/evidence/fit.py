"""Fit of one hypothesis: damped Gauss-Newton to the most probable point, and the evidence of a
hypothesis there.

A hypothesis is a list of effects.  Its coordinates are the ordinary deviations with their narrow
priors, and its effects' with wide ones; the objective is the sum of squared residuals over
the noise plus that of deviations over their priors.  Slopes are kept from step to step; only slopes
that were taken near the end say that it is one.  Near the most probable point all is Gaussian:

    log evidence = -1/2 objective - 1/2 log det(A + P^-1) - sum log deviation,

A summed over recordings (Laplace's approximation; MacKay, Neural Comput. 4 (1992) 415).  Checked
against direct integration in tests/sandbox/gap/evidence/test_algebra.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from model.errors import BadInput
from sandbox.gap.evidence.algebra import Prior, algebra, prior_of
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint, equations_of, normal
from sandbox.gap.evidence.priors import FARTHEST, Coordinate, of_effect, ordinary, reach
from sandbox.gap.settings import USUAL

Weights = Mapping[tuple[int, str], float]
# Of the objective over the variance that a gain meets (`variance_at`): a step that gains less
# changes no decision, a chance by a factor of e^0.25 at most.
TOLERANCE = 0.5
# share of a step that is still tried: along a bent valley short steps gain, damped ones hardly
SHORTEST = 0.05
DAMPING = (0.0, 0.05, 0.3, 2.0, 10.0)  # tried in turn until a step gains
# of a part of a fit: steps, each of one simulation, and points at which slopes are taken; of the
# first part where that is enough, since the next round's equations are of all candidates there
STEPS, SLOPES, FIRST_SLOPES = 30, 8, 3
CHORDS = 4  # steps on the same slopes: more of them would only creep
POOR = 0.5  # of the gain that slopes promised: below it they are taken anew
# of it: a step that gains less climbs the sides of a bent valley, along which a shorter one goes
ENOUGH = 0.25
# Times what changes no decision, gained since slopes were taken: 2 at the noise, a way of 1.4
# standard deviations.  On so short a way slopes hold.
HERE = 4.0
# Share of what is left beside noise, and of the objective at least (one nat): a rough fit leaves
# the rest to the equations taken at its end.
ROUGH, ROUGH_NATS = 0.03, 2.0
# Of what a fit lacks to its rival: where slopes, taken anew, promise a smaller share it ends.  Nats
# that it has to be behind by; a set that is further back has less than a hundred thousandth.
HOPE, BEHIND = 0.5, 12.0
SMOOTHINGS = 2  # of a free rotor's motion
SMOOTHER = 3.0  # of the objective that smoothing again must gain
# How a current's sign goes through zero, and how far slopes of it hold in one step: readings bend
# within the zone's width.  Chosen: of eight drives without a fault fits of ordinary deviations end
# up to 190 nats (of 421 800) higher without it, one nat lower at most; of one with a fault (J 2.5)
# 320 of 2.2 million lower.  A center bound to a quarter, too, left an iron loss 870 higher.
STRAIGHT = {"bench.soft_current": 0.5, "bench.soft_shape": 0.25, "bench.soft_center": math.inf}
# Times the noise.  A wrong shape of the sign left 1.02 beside a usual dead time; the excess J^2 - 1
# grows as its square, so 1.9 beside one eight times as large.
NEAR = 3.0
# of the mean square of noise: with 12 recordings one in 360 campaigns has one beyond
SCATTER = 3.5
WIDENED = 4  # times that bounds of the search double, or the motion is smoothed again


@dataclass(frozen=True)
class Fit:
    """A hypothesis at its most probable point; effects (), one or several; simulations it took."""

    effects: tuple[str, ...]
    point: ParameterPoint
    normal: NormalEquations
    objective: float
    simulations: float

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Its coordinates, turns last."""
        return self.normal.coordinates


def coordinates_of(
    point: ParameterPoint, effects: Sequence[str], begun: ParameterPoint | None = None
) -> list[Coordinate]:
    """Return the ordinary coordinates, those that an effect widens replaced, then the effects'
    others.

    begun: where the fit began, if not at the point.
    """
    campaign = point.prepared.campaign
    wide: dict[str, Coordinate] = {}
    for effect in effects:
        start = (begun or point).values
        wide |= {c.label: c for c in of_effect(effect, campaign.drive, start, point.values)}
    own = ordinary(campaign, point.values)
    known = {c.label for c in own}
    return [wide.get(c.label, c) for c in own] + [c for c in wide.values() if c.label not in known]


def fit(
    start: ParameterPoint,
    effects: Sequence[str],
    weights: Weights,
    *,
    rough: float = math.inf,
    near: NormalEquations | None = None,
    leader: float = math.inf,
    workers: int = 1,
) -> Fit:
    """Return the most probable point of a hypothesis on the recordings that `weights` names, by
    Gauss-Newton.

    The first part of a fit holds how a current's sign goes through zero, the second frees it where
    the residual is near the noise (`_within_bounds`).  rough: times the noise above which the first
    part is enough, as long as steps gain more than ROUGH of what is left; 0 for always.

    near: equations with slopes at a point near the start, which serve the first steps.

    leader: the objective of a rival; a fit far behind it ends where slopes promise no way to it.

    Where an effect's value ends at the bound of the search, the bound widens and the fit goes on;
    so it does where free rotors' motion, smoothed again at the point that was found, fits better.
    """
    return _fitted(Task(start, effects, weights, workers, rough, near, leader))


def _fitted(task: Task) -> Fit:
    """Return the most probable point of a task (`fit`)."""
    start = task.start
    found, smoother = _within_bounds(task, start)
    if normalised(found.normal, task.weights) > task.rough:
        return found
    drive = start.prepared.campaign.drive
    for _ in range(WIDENED):
        claimed = [c for e in task.effects for c in of_effect(e, drive, start.values)]
        if all(reach(c, found.point.values) <= FARTHEST for c in claimed) and smoother < SMOOTHER:
            break
        at = found.point.resmoothed() if smoother >= SMOOTHER else found.point
        further, smoother = _within_bounds(task._replace(near=None), at)
        cost = found.simulations + further.simulations
        if not further.objective < found.objective - TOLERANCE:
            return replace(found, simulations=cost)
        found = replace(further, simulations=cost)
    return found


def attempted(task: Task, *, smooth: bool = False) -> Fit | None:
    """Return the fit of a task, None where no drive can have its set or it predicts nothing finite;
    smooth: free rotors' motion is smoothed at the start."""
    try:
        found = _fitted(task._replace(start=task.start.resmoothed()) if smooth else task)
    except BadInput:
        return None
    return found if math.isfinite(found.objective) else None


def normalised(n: NormalEquations, weights: Weights) -> float:
    """Return the normalised rms of the segments that count."""
    own = [s for s in n.segments if weights.get((s.recording, s.channel), 0.0)]
    return math.sqrt(sum(float(s.ssr.sum()) for s in own) / sum(float(s.n.sum()) for s in own))


def excess(f: Fit) -> float:
    """Return the objective above what noise alone makes of it, at least its standard deviation."""
    count = float(sum(s.n.sum() for s in f.normal.segments))
    return float(max(f.objective - count, np.sqrt(2.0 * count)))


def rms_of(f: Fit) -> float:
    """Return the normalised rms of a fit over all segments."""
    return float(
        np.sqrt(
            sum(s.ssr.sum() for s in f.normal.segments) / sum(s.n.sum() for s in f.normal.segments)
        )
    )


def keeps_more(f: Fit, most: float) -> bool:
    """Return whether a recording keeps a larger normalised rms than that, all its channels
    together, and more than chance makes of noise."""
    squares, count = f.normal.by_recording()
    chance = 1.0 + SCATTER * np.sqrt(2.0 / count)
    return bool(np.any(squares / count > np.maximum(most**2, chance)))


def excess_of(n: NormalEquations, weights: Weights) -> float:
    """Return the squared residual above what noise alone makes of it, over the recordings that
    count."""
    own = [s for s in n.segments if weights.get((s.recording, s.channel), 0.0)]
    return float(sum(s.ssr.sum() - s.n.sum() for s in own))


class Task(NamedTuple):
    """What is fitted: where it begins, effects, recordings that count, threads; rough, near,
    leader: as in `fit`."""

    start: ParameterPoint
    effects: Sequence[str]
    weights: Weights
    workers: int = 1
    rough: float = math.inf
    near: NormalEquations | None = None
    leader: float = math.inf

    def enough(self, n: NormalEquations) -> bool:
        """Return whether its first part is, where equations stand."""
        return normalised(n, self.weights) > self.rough

    def begun(
        self, at: ParameterPoint, coordinates: Sequence[Coordinate]
    ) -> tuple[NormalEquations, bool]:
        """Return the equations at a point, and whether their slopes were taken there, not only near
        it."""
        own = None if self.near is None else self.near.of(coordinates)
        if own is None:
            return normal(at, coordinates, workers=self.workers), True
        return own.at(at, workers=self.workers), False


def _within_bounds(task: Task, at: ParameterPoint) -> tuple[Fit, float]:
    """Return the most probable point within the bounds of the search as they are at a point, and
    what smoothing again would gain.

    How a current's sign goes through zero is freed once all else has brought the residual near the
    noise: far from it the sign walks away with what is missing, and takes hundreds of simulations
    to do so.
    """
    coordinates = coordinates_of(at, task.effects, task.start)
    n, taken_here = task.begun(at, coordinates)
    free = prior_of(n.coordinates)
    sign = np.array([c.label in STRAIGHT for c in n.coordinates])
    held = replace(
        free, mean=np.where(sign, n.x, free.mean), deviation=np.where(sign, 0.0, free.deviation)
    )
    d = Descent(task, coordinates, at, n, n.simulations)
    if not taken_here:
        d.taken, d.steps, d.way = 0, 1, math.inf
    if normalised(n, task.weights) > NEAR:
        d.down(held, confirm=False)
        if d.steps and normalised(d.n, task.weights) > NEAR and not task.enough(d.n):
            d.down(held, confirm=True)
        if d.steps and normalised(d.n, task.weights) <= NEAR:
            d.again(free)
    prior = free if normalised(d.n, task.weights) <= NEAR else held
    if prior is free:
        d.down(free, confirm=not task.enough(d.n))
    smoother = 0.0
    if (
        prior is free
        and not task.enough(d.n)
        and any(r.rotor == "free" for r in d.point.prepared.recordings)
    ):
        again = tried(d.n, d.point.resmoothed(), prior, task.weights, task.workers)[0]
        smoother, d.cost = d.value - again, d.cost + 1.0
    found, value = d.n.bare(), objective(d.n, free, task.weights)
    if not all(np.all(np.isfinite(s.a)) for s in found.segments):
        value = math.inf  # slopes grow without bounds: no drive stands there
    elif prior is held:  # what is made of the fit holds the sign, too
        own = np.flatnonzero(~sign).tolist()
        found = equations_of(found, own, [n.coordinates[k] for k in own], found.x)
    return Fit(tuple(task.effects), d.point, found, value, d.cost), smoother


@dataclass
class Descent:
    """A fit under way: its coordinates, point, equations there, simulations.

    taken: times that slopes were taken; steps, way: steps made since then, and what they gained;
    value: the objective.
    """

    task: Task
    coordinates: Sequence[Coordinate]
    point: ParameterPoint
    n: NormalEquations
    cost: float
    taken: int = 1
    steps: int = 0
    way: float = 0.0
    value: float = math.inf

    def down(self, prior: Prior, confirm: bool) -> None:
        """Step to the most probable point under a prior; confirm: slopes that were taken near it
        say that it is there.

        Slopes are kept from step to step (each costs one simulation) until they promise more than a
        step gains.
        """
        self.value = objective(self.n, prior, self.task.weights)
        if not math.isfinite(self.value):
            return
        # falling: sizes in proportion; share: of a whole step
        damping, share, falling = 0, 1.0, False
        little, enough = self.little(), self.task.enough(self.n)
        most = self.taken + (FIRST_SLOPES if enough else SLOPES) - 1
        for _ in range(STEPS):
            straight, promised = _step(self.n, prior, self.task.weights, DAMPING[damping], share)
            if self.taken > 1 and not self.steps and share == 1.0 and self.hopeless(promised):
                return
            x = fallen(self.n.x, straight, prior) if falling else straight
            gained, stepped = self.stepped(
                x, prior, 0.0 if damping else max(0.0, ENOUGH * promised)
            )
            near = not confirm or self.way <= HERE * self.little()
            if stepped:
                damping, share = max(0, damping - 1), min(1.0, 2.0 * share)
                if gained <= little and near:
                    return
                if gained > POOR * promised and gained > little and self.steps < CHORDS:
                    continue
            elif promised < little and near:
                return
            elif not self.steps:
                if (
                    not falling
                    and not damping
                    and np.any(fallen(self.n.x, straight, prior) != straight)
                ):
                    falling = True
                    continue
                share = shorter(share, promised, promised - gained)
                if share < SHORTEST or damping:
                    damping, share = damping + 1, 1.0
                if damping < len(DAMPING):
                    continue
                return
            if self.taken == most:
                return
            self.again(prior)
            little = self.little()

    def hopeless(self, promised: float) -> bool:
        """Return whether the fit is far behind its rival and slopes promise no way to it."""
        lacks, nats = self.value - self.task.leader, variance_at(self.n, self.task.weights)
        return lacks > 2.0 * BEHIND * nats and promised < HOPE * lacks

    def little(self) -> float:
        """Return what a step may gain and yet change no decision."""
        least = TOLERANCE * variance_at(self.n, self.task.weights)
        if not self.task.enough(self.n):
            return least
        return max(least, ROUGH_NATS, ROUGH * excess_of(self.n, self.task.weights))

    def stepped(self, x: Array, prior: Prior, least: float) -> tuple[float, bool]:
        """Go to x where the objective falls by more than `least`; return by how much it would fall,
        and whether."""
        trial = self.point.moved(self.n.coordinates, x)
        reached, at_trial = tried(self.n, trial, prior, self.task.weights, self.task.workers)
        self.cost += 1.0
        gained = self.value - reached
        if at_trial is None or not gained > least:
            return gained, False
        self.point, self.n, self.value = trial, at_trial, reached
        self.steps, self.way = self.steps + 1, self.way + gained
        return gained, True

    def again(self, prior: Prior) -> None:
        """Take slopes anew, at first with free rotors' motion smoothed again; they stay as they
        were where no drive stands a difference beside this point."""
        at = self.point.resmoothed() if self.taken <= SMOOTHINGS else self.point
        self.taken, self.steps, self.way = self.taken + 1, 0, 0.0
        try:
            n = normal(at, self.coordinates, workers=self.task.workers)
        except BadInput:
            return
        self.point, self.n = at, n
        self.value = objective(self.n, prior, self.task.weights)
        self.cost += self.n.simulations


def stray(f: Fit) -> dict[str, tuple[Coordinate, float]]:
    """Return by label the ordinary deviations of a fit, those that its effects claim left out, and
    how many of their standard deviations they go."""
    usual = {c.label: c.deviation for c in ordinary(f.point.prepared.campaign, f.point.values)}
    return {
        c.label: (c, float(x - c.mean) / c.deviation)
        for c, x in zip(f.coordinates, f.normal.x, strict=True)
        if c.deviation > 0.0 and usual.get(c.label) == c.deviation
    }


def tried(
    n: NormalEquations, trial: ParameterPoint, prior: Prior, weights: Weights, workers: int
) -> tuple[float, NormalEquations | None]:
    """Return the objective and the equations at a trial; infinite where the point is none a drive
    can have."""
    try:
        reached = n.at(trial, workers=workers)
    except BadInput:
        return math.inf, None
    value = objective(reached, prior, weights)
    return (value, reached) if math.isfinite(value) else (math.inf, None)


def objective(n: NormalEquations, prior: Prior, weights: Weights) -> float:
    """Return the sum of squared residuals and of squared deviations from the prior's means."""
    free = prior.deviation > 0.0
    away = (n.x - prior.mean)[free] / prior.deviation[free]
    return n.summed(weights).ssr + float(np.sum(away**2))


def shorter(share: float, promised: float, missed: float) -> float:
    """Return the share of a step that gains most, where `share` of it misses what it promised by so
    much.

    A bend of the residual along the step makes the objective miss by the fourth power of the share
    a (of this one): 2 a - a^2 of the promise less a^4 of what was missed, largest near (promised /
    2 missed)^(1/3).
    """
    best = (0.5 * promised / missed) ** (1.0 / 3.0)
    return share * min(max(best, 0.1), 0.5)


def fallen(x: Array, to: Array, prior: Prior) -> Array:
    """Return the end of a step on which sizes that cannot be negative fall in proportion: to x
    e^(d/x), not to x + d.

    Both begin in the same direction.  Where a size and a time constant stand for each other, as a
    skin effect's do, the way that fits as well is straight in proportions; the other one ends at no
    size at all.
    """
    size = (prior.low == 0.0) & (x > 0.0) & (to < x)
    safe = np.where(size, x, 1.0)
    return np.where(size, x * np.exp(np.where(size, (to - x) / safe, 0.0)), to)


def noise_at(n: NormalEquations, weights: Weights) -> float:
    """Return the squared residual over the noise, at least 1: as much of the objective as noise of
    the residual's size would make of one value."""
    return max(1.0, normalised(n, weights) ** 2)


def variance_at(n: NormalEquations, weights: Weights) -> float:
    """Return the variance that a gain of the objective meets, in the noise's: as `misfit` has it,
    mean over what segments leave beyond noise and chance; 1 where they leave no more."""
    own = [s for s in n.segments if weights.get((s.recording, s.channel), 0.0)]
    count = np.array([s.n.sum() for s in own])
    left = np.maximum(
        0.0, np.array([s.ssr.sum() for s in own]) - count - 2.0 * np.sqrt(2.0 * count)
    )
    return 1.0 + float(left @ left / USUAL.shapes / left.sum()) if np.any(left) else 1.0


def _step(
    n: NormalEquations, prior: Prior, weights: Weights, damping: float, share: float
) -> tuple[Array, float]:
    """Return where a share of a step leads, and the objective it promises to gain.

    Far from the noise as if the noise were as large as the residual, so that priors keep a say.
    """
    equations, near = algebra(n, weights), _where_straight(n, prior)
    x = n.x + share * (
        equations.scaled(noise_at(n, weights)).damped(damping).most_probable(near).x - n.x
    )
    return x, equations.objective(n.x, prior) - equations.objective(x, prior)


def _where_straight(n: NormalEquations, prior: Prior) -> Prior:
    """Return a prior with bounds within which slopes at a point hold (`STRAIGHT`)."""
    reach = np.array([STRAIGHT.get(c.label, math.inf) for c in n.coordinates])
    return replace(
        prior, low=np.maximum(prior.low, n.x - reach), high=np.minimum(prior.high, n.x + reach)
    )
