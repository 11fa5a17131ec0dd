"""Every effect's chance of being there: the posterior over all sets near the best one, summed over those that hold it.

Fitted sets have the probabilities of their hypotheses.  A set that was not fitted stands to the fitted one that it
differs least from as the equations at the best set's point say: all with one effect more, one fewer, one exchanged that
came near on the way.  Only this difference is told by algebra: what an effect is worth whose answer is far from linear
(a shaft's stiffness) is what the fit without it lost.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from sandbox.gap.evidence.spike_slab import Table
from sandbox.gap.search.posterior import UNKNOWN, Hypothesis
from sandbox.gap.search.subsets import Set, Subsets, possible

APART = 0.2  # of the less probable of two effects: chance of both together, below which they stand for each other
SURE = 0.9  # chance that one of a group is there: less, and they are no group but each a doubt of its own
LARGEST = 4  # effects of a group: more of them are no question that one recording answers
OPEN = (0.05, 0.95)  # chances between which an effect may be one of a group


@dataclass(frozen=True)
class Inclusion:
    """Chance of each effect, the groups of effects that cannot be parted: (effects, chance that one is there), and the
    chances of the sets that they follow from."""

    chances: Mapping[str, float]
    groups: tuple[tuple[tuple[str, ...], float], ...]
    sets: Mapping[Set, float] = field(default_factory=dict)

    def group_of(self, effect: str) -> tuple[str, ...] | None:
        """Return the group an effect belongs to."""
        return next((names for names, _ in self.groups if effect in names), None)

    def most_probable(self, effect: str) -> Set | None:
        """Return the most probable set that holds an effect."""
        return max((s for s in self.sets if effect in s), key=lambda s: self.sets[s], default=None)

    def mixed(self, other: Inclusion, share: float) -> Inclusion:
        """Return chances and groups where the sets of another have that share of the probability."""
        both = dict.fromkeys([*self.sets, *other.sets], 0.0)
        sets = {s: (1.0 - share) * self.sets.get(s, 0.0) + share * other.sets.get(s, 0.0) for s in both}
        return summed(sets, tuple(self.chances))


def inclusion(hypotheses: Sequence[Hypothesis], temperature: float, tried: Collection[Set] = frozenset()) -> Inclusion:
    """Return the chances of all effects of the library that were candidates.

    tried: all sets that were fitted; one that is no hypothesis fell too far behind to be weighed, and has no chance.
    """
    fitted: dict[Set, float] = {}
    for h in hypotheses:
        if h.effects != (UNKNOWN,):
            key = tuple(sorted(e for e in h.effects if e != UNKNOWN))
            fitted[key] = fitted.get(key, 0.0) + h.probability
    best = next(h for h in hypotheses if h.effects != (UNKNOWN,))
    own = tuple(sorted(e for e in best.effects if e != UNKNOWN))
    near = Subsets(best.judged.table, temperature)
    near.weigh(own)
    near.climb(own)
    for effect in best.judged.table.members:
        if effect not in own and possible((*own, effect)):
            near.weigh((*own, effect))
    told = {key: near.weigh(key) for key in fitted if set(key) <= set(best.judged.table.members)}
    untried = [key for key in near.known if key not in fitted and key not in tried]
    chances = fitted | {key: _beside(key, near.known, fitted, told, own) for key in untried}
    names = dict.fromkeys([*best.judged.table.members, *(e for key in fitted for e in key)])
    if not any(chances.values()):  # something outside the library alone is certain to the last digit
        return Inclusion(dict.fromkeys(names, 0.0), (), {(): 1.0})
    return summed(chances, names)


def _beside(
    key: Set, known: Mapping[Set, float], fitted: Mapping[Set, float], told: Mapping[Set, float], own: Set
) -> float:
    """Return the chance of a set by those of the fitted sets next to it: the least of what they promise, and at most
    that of the best one, `own`, as a set that promised more was fitted.

    known, told: log posterior by algebra, of all sets and of fitted ones.
    """
    apart = {f: len(set(key) ^ set(f)) for f in told}
    least = min(apart.values())
    nearest = [f for f in told if apart[f] == least]
    if any(fitted[f] == 0.0 for f in (own, *nearest)):
        return 0.0
    promised = min(math.log(fitted[f]) + known[key] - told[f] for f in nearest)
    return math.exp(min(math.log(fitted[own]), promised))


def by_algebra(table: Table, effects: Sequence[str], temperature: float) -> Inclusion:
    """Return the chances by the equations of one point alone: of a set of effects that was fitted there, and of all
    sets with one of them left out or exchanged.

    No set counts more than the fitted one.  None with one effect more counts: beside a free regression that is an
    effect which no fit has tried, and one that a cause outside the library may imitate.
    """
    near, own = Subsets(table, temperature), tuple(sorted(effects))
    top = near.weigh(own)
    rests = [set(own) - {gone} for gone in own]
    for other in (*rests, *(rest | {e} for rest in rests for e in table.members if e not in own)):
        if possible(other):
            near.weigh(other)
    return summed({key: math.exp(min(0.0, told - top)) for key, told in near.known.items()}, table.members)


def summed(sets: Mapping[Set, float], names: Sequence[str] | Mapping[str, object]) -> Inclusion:
    """Return the chances of effects from those of sets (which need not sum to 1), and the groups among them."""
    total = sum(sets.values())
    chance = {e: sum(p for s, p in sets.items() if e in s) / total for e in names}
    open_ = sorted((e for e in names if OPEN[0] < chance[e] < OPEN[1]), key=lambda e: -chance[e])
    groups: list[tuple[tuple[str, ...], float]] = []
    for e in open_:
        if any(e in g for g, _ in groups):
            continue
        group: tuple[str, ...] = (e,)
        for f in open_:  # each stands for each other one: of {a} and {b, c} both b and c are rivals of a, no group
            both = [sum(p for s, p in sets.items() if f in s and g in s) / total for g in group]
            if f != e and all(p < APART * min(chance[f], chance[g]) for p, g in zip(both, group, strict=True)):
                group = (*group, f)
        either = sum(p for s, p in sets.items() if set(group) & set(s)) / total
        if len(group) > 1 and either > SURE and len(group) <= LARGEST:
            groups.append((group, either))
    shares = {s: p / total for s, p in sets.items()}
    return Inclusion(dict(sorted(chance.items(), key=lambda x: -x[1])), tuple(groups), shares)
