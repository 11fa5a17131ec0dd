"""The whole list: every effect of the library with its chance, size and share, and what it cannot
be told from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from model.effects import library
from model.effects.advice import what_to_do
from sandbox.gap.diagnose import Diagnosis, verdict
from sandbox.gap.planning.next_recording import Next
from sandbox.gap.posterior.estimates import Estimate, estimates
from sandbox.gap.posterior.evaluated import EvaluatedModel, by_algebra
from sandbox.gap.posterior.hypotheses import UNKNOWN, Hypothesis
from sandbox.gap.posterior.remainder import Unexplained
from sandbox.gap.report.inclusion import Inclusion, inclusion
from sandbox.gap.report.open_part import OpenPart, Remaining, open_part, own_of, remaining
from sandbox.gap.report.position_moved import Moved, moved
from sandbox.gap.report.shares import Share, Shares, of_set, shares
from sandbox.gap.report.told_apart import Telling, telling
from sandbox.gap.unstated.offsets_said import subtracted

# chance of `unknown` below which no regression is fitted beside the effects; of an effect: no size
SLIGHT = 0.05
LIKELY = 0.5  # chance from which an effect counts as there
MOST_RIVALS = 4  # sets whose shares are worked out: some replays each


@dataclass(frozen=True)
class Ranking:
    """Chances of all effects, the likeliest first; shares, and the waterfall of
    the best hypothesis; parameters of each effect that may be there, in a set that holds it; chance
    of `unknown`; the share of the gap that nothing in the library explains (None: no gap) and where
    that lies (None: nothing is left); what a free regression beside the effects says (None where
    `unknown` is unlikely, or the regression predicts nothing).  moved: by effect and estimator,
    what it does to the position error; tellings: what it is confused with; rivals: shares in the
    likely sets beside the best hypothesis; by_recording: sizes of current_offset, which differ."""

    inclusion: Inclusion
    shares: Shares
    parameters: dict[str, dict[str, Estimate]]
    unknown: float
    unexplained: Unexplained | None
    open_part: OpenPart | None = None
    moved: Mapping[str, Mapping[str, Moved]] = field(default_factory=dict)
    where: Remaining | None = None
    tellings: Mapping[str, Telling | None] = field(default_factory=dict)
    rivals: Mapping[tuple[str, ...], Mapping[str, Share]] = field(default_factory=dict)
    of_best: tuple[str, ...] = ()  # effects of the best hypothesis
    by_recording: Mapping[str, Mapping[str, Estimate]] = field(default_factory=dict)

    def as_json(self, following: Next | None = None) -> dict[str, Any]:
        """Return `effects`, `groups`, `unknown` and `waterfall` of `diagnosis.json`; following: a
        planned recording."""
        return {
            "effects": [self._effect(e, p) for e, p in self.inclusion.chances.items()],
            "groups": [
                {"effects": list(g), "probability": p, "parted_by": parted_by(g, following)}
                for g, p in self.inclusion.groups
            ],
            "unknown": {
                "probability": self.unknown,
                "share": asdict(
                    Unexplained(0.0, None) if self.unexplained is None else self.unexplained
                ),
                "where": "" if self.where is None else self.where.text(),
                "regions": None if self.where is None else self.where.as_json(),
                "beside": None if self.open_part is None else self.open_part.as_json(),
            },
            "waterfall": [
                {"added": e, "J": j if math.isfinite(j) else None} for e, j in self.shares.waterfall
            ],
        }

    def shares_in(self, h: Hypothesis) -> dict[str, float] | None:
        """Return the shares of the gap of a hypothesis' own effects, None where they are not worked
        out."""
        key = tuple(e for e in h.effects if e != UNKNOWN)
        of = self.rivals.get(key)
        if of is None and key == self.of_best:
            of = {e: self.shares.of[e] for e in key if e in self.shares.of}
        return {e: s.value for e, s in of.items()} if of else None

    def sizes(self, effect: str) -> dict[str, Estimate]:
        """Return an effect's parameters: beside the free regression, where something outside the
        library is likely."""
        bent = self.parameters.get(effect, {})
        return (
            self.open_part.parameters.get(effect, bent)
            if self.with_regression and self.open_part
            else bent
        )

    @property
    def with_regression(self) -> bool:
        """Whether sizes are those beside a free regression."""
        return self.open_part is not None and self.unknown >= LIKELY

    def _effect(self, name: str, chance: float) -> dict[str, Any]:
        share, telling = self.shares.of.get(name), self.tellings.get(name)
        group = self.inclusion.group_of(name)
        return {
            "name": name,
            "probability": chance,
            "share": None
            if share is None
            else {
                "value": share.value,
                "ci95": share.ci95,
                "alone": share.alone,
            },
            "parameters": {k: parameter(e) for k, e in self.parameters.get(name, {}).items()},
            "by_recording": self._by_recording() if name == library.drifting().name else None,
            "group": None if group is None else list(group),
            **({"tellable": None, "confused_with": None} if telling is None else telling.as_json()),
            "position": {k: m.as_json() for k, m in self.moved.get(name, {}).items()},
            "beside_unknown": None
            if self.open_part is None
            else with_regression(self.open_part, name),
        }

    def _by_recording(self) -> list[dict[str, Any]] | None:
        """Return the sizes of an effect that has others in each recording."""
        return [
            {"file": file, "parameters": {k: parameter(e) for k, e in own.items()}}
            for file, own in self.by_recording.items()
        ] or None


def with_regression(part: OpenPart, name: str) -> dict[str, Any]:
    """Return an effect's chance and parameters beside a free regression."""
    own = part.parameters.get(name, {})
    return {
        "probability": part.chances.get(name, 0.0),
        "parameters": {k: parameter(e) for k, e in own.items()},
    }


def parameter(e: Estimate) -> dict[str, Any]:
    """Return one parameter as `diagnosis.json` has it."""
    return {"value": e.value, "ci95": [e.low, e.high], "unit": e.unit} | (
        {"at_bound": True} if e.at_bound else {}
    )


def advised(d: Diagnosis, r: Ranking) -> dict[str, str]:
    """Return what to do about each effect that has a size, by its card."""
    drive, out = d.campaign.drive, dict[str, str]()
    for e, own in r.parameters.items():
        if own:
            out |= what_to_do(
                [e], {k: p.value for k, p in own.items()}, drive.motor, drive.converter
            )
    return out | ({library.drifting().name: subtracted(r.by_recording)} if r.by_recording else {})


def parted_by(group: tuple[str, ...], following: Next | None) -> dict[str, str]:
    """Return the recording that tells each effect of a group apart: the planned one where it
    separates a set that holds this effect from one that holds another of the group instead, else
    what the effect's card says."""
    sets = () if following is None else [{e for e in s if e in group} for s in following.separates]
    out = {}
    for effect in group:
        having, lacking = ([s for s in sets if (effect in s) == there] for there in (True, False))
        parts = following is not None and any(b - a for a in having for b in lacking)
        out[effect] = (
            planned(following) if parts and following else library.load_effect(effect).separated_by
        )
    return out


def planned(following: Next) -> str:
    """Return a planned recording in words."""
    return (
        f"the recording planned next ({following.entry}): {following.description}, for "
        f"{following.seconds:g} s"
    )


def ranking(d: Diagnosis, workers: int = 1, *, position: bool = True) -> Ranking:
    """Return the whole list of a diagnosis; position: whether closed loops say what effects do to
    it."""
    own: dict[str, dict[str, Estimate]] = {}
    for h, parameters in zip(d.hypotheses, d.parameters, strict=True):
        for e in h.effects:
            if e != UNKNOWN and e not in own:
                own[e] = own_of(e, parameters)
    chance = sum(h.probability for h in d.hypotheses if UNKNOWN in h.effects)
    left = None if verdict(d) == "no_gap" and chance < SLIGHT else d.remainder.share
    part = open_part(d, workers) if chance >= SLIGHT else None
    found = included(d, part)
    r = completed(d, Ranking(found, shares(d), own, chance, left, part))
    lies = left is not None and (left.value > 0.0 or chance >= SLIGHT)
    there = [e for e in r.parameters if found.chances[e] >= LIKELY]
    values = {e: {k: x.value for k, x in r.sizes(e).items()} for e in there}
    at = remaining(d.after.point) if lies else None
    return replace(r, where=at, moved=moved(d.campaign.drive, values) if position else {})


def included(d: Diagnosis, part: OpenPart | None) -> Inclusion:
    """Return the chances of all effects: those of the sets without `unknown`, those beside the free
    regression as often as `unknown` stands beside effects, none as often as it stands alone."""
    alone = sum(h.probability for h in d.hypotheses if h.effects == (UNKNOWN,))
    if part is None:
        found = inclusion(d.hypotheses)
    else:
        without = [h for h in d.hypotheses if UNKNOWN not in h.effects]
        both = sum(h.probability for h in d.hypotheses if UNKNOWN in h.effects) - alone
        found = inclusion(without).mixed(part.inclusion, both / (1.0 - alone or 1.0))
    return found.mixed(Inclusion({}, (), {(): 1.0}), alone)


def completed(d: Diagnosis, r: Ranking) -> Ranking:
    """Return the list with sizes, and what it is confused with, of every effect that may be there,
    and the share of every effect that is likely to be: those that are not in the best hypothesis as
    they are in the
    most probable set that holds them, by the equations at the best hypothesis' point."""
    sets, sized, tellings = _Sets(d, r), dict(r.parameters), dict[str, Telling | None]()
    of, part = dict(r.shares.of), r.open_part
    for e, chance in r.inclusion.chances.items():
        if chance < SLIGHT:
            continue
        j = sets.holding(e)
        if j is None:
            continue
        tellings[e] = telling(j, e)
        if not sized.get(e):
            sized[e] = own_of(e, estimates(j))
        if part is not None and e not in part.parameters:
            part = part.sized(e, j)
        if chance > LIKELY and e not in of:
            shared = sets.shares(j)
            of |= {e: shared[e]} if e in shared else {}
    r = replace(
        r, shares=replace(r.shares, of=of), parameters=sized, open_part=part, tellings=tellings
    )
    rivals = {} if verdict(d) == "no_gap" else sets.rivals(d)
    return replace(r, rivals=rivals, of_best=tuple(e for e in d.best.effects if e != UNKNOWN))


def ordered(chances: Mapping[str, float], of: Mapping[str, Share]) -> dict[str, float]:
    """Return chances, those of likely effects first, the largest share first, then all others, the
    likeliest first."""
    shares = {
        e: of[e].value if e in of and math.isfinite(of[e].value) else -math.inf for e in chances
    }
    likely = [e for e in chances if chances[e] > LIKELY]
    first = sorted(likely, key=lambda e: (-shares[e], -chances[e]))
    rest = sorted((e for e in chances if e not in likely), key=lambda e: -chances[e])
    return {e: chances[e] for e in (*first, *rest)}


class _Sets:
    """The sets that hold effects, by the equations at the best hypothesis' point, and their shares,
    each worked out once."""

    def __init__(self, d: Diagnosis, r: Ranking) -> None:
        self.best, self.inclusion = d.best.evaluated, r.inclusion
        self.part = r.open_part if r.with_regression else None
        self.known: dict[tuple[str, ...], EvaluatedModel] = {
            tuple(sorted(self.best.effects)): self.best
        }
        self.shared: dict[int, dict[str, Share]] = {}

    def holding(self, effect: str) -> EvaluatedModel | None:
        """Return the best hypothesis if it holds an effect, else the most probable set that
        does."""
        if effect in self.best.effects:
            return self.best
        key = self.inclusion.most_probable(effect)
        if key is None or any(e not in self.best.model.members for e in key):
            return None
        if key not in self.known:
            self.known[key] = by_algebra(self.best, key)
        return self.known[key]

    def rivals(self, d: Diagnosis) -> dict[tuple[str, ...], dict[str, Share]]:
        """Return the shares in the likeliest MOST_RIVALS sets of the ambiguity set that are not the
        best."""
        out: dict[tuple[str, ...], dict[str, Share]] = {}
        for h in d.ambiguity_set[: MOST_RIVALS + 1]:
            key = tuple(e for e in h.effects if e != UNKNOWN)
            if key and set(key) != set(self.best.effects) and key not in out:
                out[key] = self.shares(h.evaluated)
        return out

    def shares(self, j: EvaluatedModel) -> dict[str, Share]:
        """Return the shares of a set's effects: at sizes that no unknown part bends, where one is
        likely.  None of a set that was not fitted, with an effect that is there or not, nothing
        between (a shaft): no replay has it."""
        if any(
            j.model.coordinates[k].form == "share" for e in j.effects for k in j.model.members[e]
        ):
            return {}
        if id(j) not in self.shared:
            self.shared[id(j)] = of_set(j if self.part is None else self.part.unbent(j))
        return self.shared[id(j)]
