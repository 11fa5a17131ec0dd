"""Several orders of one effect at once: those of a machine's slots share a gap of which none of them closes half.

Chosen by algebra at one point, one after the other, the order that brings most log evidence first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from model.effects import library
from sandbox.gap.evidence.algebra import Prior, algebra
from sandbox.gap.evidence.fit import Weights, excess_of
from sandbox.gap.evidence.normal import Normal
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.search.judged import Judged
from sandbox.gap.search.selection import CLOSES


@dataclass(frozen=True)
class Start:
    """A part of an effect that may be there: the values that are looked for (order, phase), those a fit begins from
    (amplitudes among them), its coordinates, and in which place it stands; parts: how many stand from there on."""

    effect: str
    begun: Mapping[str, float]
    coordinates: tuple[Coordinate, ...]
    place: int = 2
    parts: int = 1

    def at_place(self, k: int) -> dict[str, float]:
        """Return the values it begins with as those of the k-th part."""
        own, other = (f"{self.effect}.{place}." for place in (self.place, k))
        return {name.replace(own, other): x for name, x in self.begun.items()}


@dataclass(frozen=True)
class Screened:
    """Equations at a fit's point of its own coordinates and of those of every start, its own prior, recordings that
    count."""

    equations: Normal
    prior: Prior
    weights: Weights


def together(best: Judged, tried: Sequence[Start], screened: Screened, worth: float) -> list[tuple[float, Start]]:
    """Return for each effect that is not in the set the orders that together promise half of the gap, as one start,
    with what they promise.

    The recordings whose rotor turns have to tell them: at a rotor that stands each order is a constant, and a few of
    them are a saturation.
    """
    recordings = best.fit.point.prepared.recordings
    turning = {k: w for k, w in screened.weights.items() if recordings[k[0]].rotor != "locked"}
    if not any(turning.values()):
        return []
    own, out = replace(screened, weights=turning), list[tuple[float, Start]]()
    for effect in dict.fromkeys(s.effect for s in tried if s.effect not in best.effects):
        mine = {k: s for k, s in enumerate(tried) if s.effect == effect}
        chosen, gain = greedy(own, mine, worth)
        if len(chosen) > 1 and gain > 0.5 * (1.0 - CLOSES[0]) * excess_of(screened.equations, turning):
            out.append((gain, joined([mine[k] for k in chosen])))
    return out


def greedy(screened: Screened, candidates: Mapping[int, Start], worth: float) -> tuple[list[int], float]:
    """Return the starts of an effect that bring most log evidence one after the other, each as much as it is worth, as
    many as the effect has places; and what they bring together."""
    equations, base = algebra(screened.equations, screened.weights), screened.prior.deviation
    place = {c.label: i for i, c in enumerate(screened.equations.coordinates)}
    wide = np.array([c.deviation for c in screened.equations.coordinates])
    own = {k: [place[f"{c.label}@{k}"] for c in s.coordinates] for k, s in candidates.items()}

    def told(chosen: Sequence[int]) -> float:
        """Return the log evidence with the coordinates of some starts."""
        deviation = base.copy()
        for k in chosen:
            deviation[own[k]] = wide[own[k]]
        return equations.log_evidence(screened.prior.with_deviation(deviation))

    first = level = told([])
    chosen: list[int] = []
    places = min((library.load_effect(s.effect).repeats - s.place + 1 for s in candidates.values()), default=0)
    while len(chosen) < min(places, len(candidates)):
        ahead = {k: told([*chosen, k]) for k in candidates if k not in chosen}
        k = max(ahead, key=lambda k: ahead[k])
        if ahead[k] - level < worth:
            break
        chosen, level = [*chosen, k], ahead[k]
    return chosen, level - first


def joined(starts: Sequence[Start]) -> Start:
    """Return parts of one effect as one start, one place behind the other."""
    first = starts[0]
    begun = {n: x for k, s in enumerate(starts) for n, x in s.at_place(first.place + k).items()}
    return Start(first.effect, begun, (), first.place, len(starts))
