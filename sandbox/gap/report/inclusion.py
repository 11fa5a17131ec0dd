"""Every effect's chance of being there: the posterior over sets, summed over those that hold it;
and the groups of effects that stand for each other in them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from model.effects import library
from sandbox.gap.posterior.hypotheses import Hypothesis, sets_of
from sandbox.gap.posterior.linear_model import LinearModel
from sandbox.gap.posterior.sets import Set, log_prior, possible

# of the less probable of two effects: chance of both together, below which they stand for each
# other
APART = 0.2
# chance that one of a group is there: less, and they are no group but each a doubt of its own
SURE = 0.9
LARGEST = 4  # effects of a group: more of them are no question that one recording answers
OPEN = (0.05, 0.95)  # chances between which an effect may be one of a group


@dataclass(frozen=True)
class Inclusion:
    """Chance of each effect, the groups of effects that cannot be parted: (effects, chance that one
    is there), and the chances of the sets that they follow from."""

    chances: Mapping[str, float]
    groups: tuple[tuple[tuple[str, ...], float], ...]
    sets: Mapping[Set, float] = field(default_factory=dict)

    def group_of(self, effect: str) -> tuple[str, ...] | None:
        """Return the group an effect belongs to."""
        return next((names for names, _ in self.groups if effect in names), None)

    def mixed(self, other: Inclusion, share: float) -> Inclusion:
        """Return chances and groups where the sets of another have that share of the
        probability."""
        both = dict.fromkeys([*self.sets, *other.sets], 0.0)
        sets = {
            s: (1.0 - share) * self.sets.get(s, 0.0) + share * other.sets.get(s, 0.0) for s in both
        }
        return summed(sets, list(self.chances))

    def most_probable(self, effect: str) -> Set | None:
        """Return the most probable set that holds an effect."""
        return max((s for s in self.sets if effect in s), key=lambda s: self.sets[s], default=None)


def inclusion(hypotheses: Sequence[Hypothesis]) -> Inclusion:
    """Return the chances of all effects of the library that were candidates."""
    sets = sets_of(list(hypotheses))
    members = dict.fromkeys(e for h in hypotheses for e in h.evaluated.model.members)
    names = [e for e in library.effect_names() if e in members]
    return summed(sets, names)


def by_algebra(model: LinearModel, effects: Sequence[str]) -> Inclusion:
    """Return the chances by the equations of one point alone: of a set of effects that was fitted
    there, and of all sets with one of them left out or exchanged.

    No set counts more than the fitted one.  None with one effect more counts: beside a free
    regression that is an effect which no fit has tried, and one that a cause outside the library
    may imitate.
    """
    own = tuple(sorted(effects))
    near = {own: model.log_evidence(own) + log_prior(own)}
    rests = [set(own) - {gone} for gone in own]
    for other in (*rests, *(rest | {e} for rest in rests for e in model.members if e not in own)):
        if possible(other):
            key = tuple(sorted(other))
            near[key] = model.log_evidence(key) + log_prior(key)
    return summed(
        {k: math.exp(min(0.0, v - near[own])) for k, v in near.items()}, list(model.members)
    )


def summed(sets: Mapping[Set, float], names: Sequence[str]) -> Inclusion:
    """Return the chances of effects from those of sets (which need not sum to 1), and the groups
    among them."""
    total = sum(sets.values()) or 1.0
    chance = {e: sum(p for s, p in sets.items() if e in s) / total for e in names}
    open_ = sorted((e for e in names if OPEN[0] < chance[e] < OPEN[1]), key=lambda e: -chance[e])
    groups: list[tuple[tuple[str, ...], float]] = []
    for e in open_:
        if any(e in g for g, _ in groups):
            continue
        group: tuple[str, ...] = (e,)
        for f in open_:
            # each stands for each other one: {a} and {b, c} give the groups (a, b) and (c, a), as b
            # and c come together
            both = [sum(p for s, p in sets.items() if f in s and g in s) / total for g in group]
            if f != e and all(
                p < APART * min(chance[f], chance[g]) for p, g in zip(both, group, strict=True)
            ):
                group = (*group, f)
        either = sum(p for s, p in sets.items() if set(group) & set(s)) / total
        if len(group) > 1 and either > SURE and len(group) <= LARGEST:
            groups.append((group, either))
    shares = {s: p / total for s, p in sets.items()}
    return Inclusion(dict(sorted(chance.items(), key=lambda x: -x[1])), tuple(groups), shares)
