"""One diagnosis against the truth of its campaign: what was right, what was missed.

Where one effect contains another (saturation and its cross part), a verdict for either is right if
the truth is in its ambiguity set.  A diagnosis that failed has everything wrong: nothing is found,
nothing located, and its P(unknown) is 0 where the truth is unknown, else 1.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from model.effects.library import load_effect, parameters

INSEPARABLE = (frozenset({"saturation", "cross_saturation"}),)
TWINS = (  # one stands for the other where that one is missing
    *INSEPARABLE,
    frozenset({"dead_time", "device_drop"}),  # cosine 0.998 beside ordinary deviations
    frozenset({"current_filter", "current_sampling"}),  # 0.99
)
UNKNOWN = "unknown"
PERIODIC = ("phase",)  # parameters compared modulo 2 pi
NO_GAP_LEFT = 1.05  # times the floor: below, `closed` is undefined rather than missed
SETTLED = 0.95  # probability of a confident verdict


@dataclass(frozen=True)
class Judgement:
    """What one diagnosis was worth; sizes as in the ladder, shares in [0, 1].

    hit: the true set is the first hypothesis; probability: given to the true set; unknown:
    P(unknown);
    parts: parameters (covered, given); closed: None where it is undefined; subsystem: rightly
    located, None without an effect; top, top_probability: the first hypothesis; in_set,
    unknown_in_set: the truth, or a hypothesis with `unknown`, stands in the ambiguity set; chances:
    of each effect, to be there; parts_of: `parts` by effect; outside: the subsystem of a cause
    outside the library.
    """

    name: str
    kind: str
    family: str
    effects: tuple[str, ...]
    sizes: tuple[float, ...]
    failed: bool
    unknown: float
    verdict: str
    parts: tuple[int, int]
    closed: float | None
    subsystem: bool | None
    hit: bool = False
    probability: float = 0.0
    f1: float = 0.0
    in_set: bool = False
    unknown_in_set: bool = False
    set_size: int = 0
    seconds: float | None = None
    simulations: float | None = None
    top: tuple[str, ...] = ()
    top_probability: float = 0.0
    chances: Mapping[str, float] = field(default_factory=dict)
    parts_of: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    outside: str | None = None

    @property
    def separable(self) -> bool:
        """No effect of it contains another of the library."""
        return not any(set(self.effects) & group for group in INSEPARABLE)

    @property
    def label(self) -> str:
        """The first hypothesis in one word."""
        return "failed" if self.failed else label_of(self.top)

    @property
    def settled(self) -> bool:
        """The truth is alone in the ambiguity set."""
        return self.in_set and self.set_size == 1

    @property
    def falsely_named(self) -> bool:
        """The first hypothesis names an effect of the library that is not there."""
        return bool({*self.top} - {*self.effects, UNKNOWN})

    def listed(self, least: float) -> frozenset[str]:
        """Return the effects with a chance above `least` that are not there: false names of the
        whole list."""
        return frozenset(e for e, chance in self.chances.items() if chance > least) - {
            *self.effects
        }

    @property
    def twin(self) -> bool:
        """The first hypothesis is the twin of the true effect."""
        return self.top != self.effects and frozenset({*self.top, *self.effects}) in TWINS

    @property
    def confident(self) -> bool:
        """The first hypothesis has nearly all of the probability."""
        return self.top_probability >= SETTLED


def label_of(effects: Sequence[str]) -> str:
    """Return a hypothesis in one word, for a confusion matrix."""
    if len(effects) > 1:
        return UNKNOWN if UNKNOWN in effects else "several"
    return effects[0] if effects else "none"


def alike(one: frozenset[str], other: frozenset[str]) -> bool:
    """Tell whether two sets of effects are the same up to effects of which one contains the
    other."""

    def plain(effects: frozenset[str]) -> frozenset[str]:
        """Return a set with each effect under the name of its group."""
        return frozenset(
            "+".join(sorted(next((g for g in INSEPARABLE if e in g), {e}))) for e in effects
        )

    return plain(one) == plain(other)


def judge(name: str, truth: Mapping[str, Any], diagnosis: Mapping[str, Any]) -> Judgement:
    """Judge one diagnosis (`diagnosis.json`, or {"failed": why}) against one entry of the seal."""
    true = frozenset(truth["effects"])
    beyond = (truth.get("outside_subsystem") or "machine") if UNKNOWN in true else None
    head: dict[str, Any] = {
        "name": name,
        "kind": truth["kind"],
        "family": truth["family"],
        "effects": tuple(truth["effects"]),
        "sizes": tuple(truth["sizes"]),
        "outside": beyond,
    }
    if "failed" in diagnosis:
        given = Counter(n.partition(".")[0] for n in truth["parameters"] if estimated(n))
        return Judgement(
            **head,
            failed=True,
            unknown=0.0 if UNKNOWN in true else 1.0,
            verdict="failed",
            parts=(0, given.total()),
            parts_of={e: (0, n) for e, n in sorted(given.items())},
            closed=0.0 if true else None,
            subsystem=False if true else None,
        )
    hypotheses = [
        (frozenset(h["effects"]), float(h["probability"]), h) for h in diagnosis["hypotheses"]
    ]
    top, top_probability, best = hypotheses[0]
    members = [frozenset(m) for m in diagnosis["ambiguity_set"]]
    cost, verdict = diagnosis.get("cost", {}), str(diagnosis["verdict"])
    parts = {
        e: covered(truth["parameters"], best.get("parameters", {}), [e]) for e in sorted(top & true)
    }
    place = located(true, diagnosis.get("where", []), beyond)
    return Judgement(
        **head,
        failed=False,
        hit=_same(top, true, members),
        probability=sum(p for e, p, _ in hypotheses if _same(e, true, members)),
        f1=f1(top, true),
        unknown=sum(p for e, p, _ in hypotheses if UNKNOWN in e),
        verdict=verdict,
        parts=(sum(hits for hits, _ in parts.values()), sum(n for _, n in parts.values())),
        parts_of=parts,
        closed=closed(true, diagnosis["gap"]),
        in_set=any(_contains_truth(m, true) for m in members),
        unknown_in_set=any(UNKNOWN in m for m in members),
        set_size=len(members),
        # where there is no gap, `where` says where one would lie if there were one
        subsystem=False if true and verdict == "no_gap" else place,
        seconds=cost.get("seconds"),
        simulations=cost.get("simulations"),
        top=tuple(sorted(top)),
        top_probability=top_probability,
        chances=chances(diagnosis),
    )


def chances(diagnosis: Mapping[str, Any]) -> dict[str, float]:
    """Return with which chance each effect is there: as stated, else by the hypotheses that hold
    it."""
    if "effects" in diagnosis:
        return {str(e["name"]): float(e["probability"]) for e in diagnosis["effects"]}
    out: dict[str, float] = {}
    for h in diagnosis["hypotheses"]:
        for effect in set(h["effects"]) - {UNKNOWN}:
            out[effect] = out.get(effect, 0.0) + float(h["probability"])
    return out


def _same(found: frozenset[str], true: frozenset[str], members: Sequence[frozenset[str]]) -> bool:
    if UNKNOWN in true:
        return UNKNOWN in found
    return found == true or (alike(found, true) and true in members)


def _contains_truth(member: frozenset[str], true: frozenset[str]) -> bool:
    return UNKNOWN in member if UNKNOWN in true else member == true


def f1(found: frozenset[str], true: frozenset[str]) -> float:
    """Return the harmonic mean of precision and recall of named effects; 1 where both are empty."""
    named = found - {UNKNOWN}
    if not named and not true:
        return 1.0
    return 2.0 * len(named & true) / (len(named) + len(true))


def estimated(name: str) -> bool:
    """Tell whether a diagnosis estimates a parameter; others are kept, or chosen from a list,
    without an interval."""
    known = parameters().get(name)
    return known is None or known.fit != "fixed"


def covered(
    true: Mapping[str, float], found: Mapping[str, Any], effects: Sequence[str]
) -> tuple[int, int]:
    """Return how many true parameters of rightly named effects lie in their 95 % intervals, and how
    many were given.

    An interval without an end is open there.
    """
    hits = given = 0
    for name, value in true.items():
        interval = found.get(name, {}).get("ci95") if name.partition(".")[0] in effects else None
        if interval is None or not estimated(name):
            continue
        low = -math.inf if interval[0] is None else float(interval[0])
        high = math.inf if interval[1] is None else float(interval[1])
        given += 1
        turns = 0.0
        if name.rpartition(".")[2] in PERIODIC and math.isfinite(high - low):
            turns = math.tau * round((0.5 * (low + high) - value) / math.tau)
        hits += low <= value + turns <= high
    return hits, given


def closed(true: frozenset[str], gap: Mapping[str, Any]) -> float | None:
    """Return the share of the gap closed; a verdict of no gap closes nothing, unless hardly any was
    left."""
    if not true or UNKNOWN in true:
        return None
    if gap.get("closed") is not None:
        return float(gap["closed"])
    return None if float(gap["before"]) < NO_GAP_LEFT else 0.0


def located(
    true: frozenset[str], where: Sequence[Mapping[str, Any]], outside: str | None = None
) -> bool | None:
    """Tell whether the first place named lies in a subsystem that has an effect; outside: that of
    an unknown one.

    Seals that do not say so hold unknown effects of the machine only.
    """
    if not true:
        return None
    subsystems = {outside or "machine" if e == UNKNOWN else load_effect(e).subsystem for e in true}
    return bool(where) and where[0]["subsystem"] in subsystems
