"""Which cases a withheld check has: kinds, families, effects and sizes in turn, in an order drawn
from its seed."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from model.effects.library import causes
from model.errors import BadInput, unknown
from sandbox.withheld.making.cycle_styles import STYLES
from sandbox.withheld.making.cycles_narrow import PAIRS
from sandbox.withheld.making.drives import FAMILIES
from sandbox.withheld.making.effect_sizes import EFFECT_SIZES
from sandbox.withheld.making.mapped_drive import FLUX_MAP
from sandbox.withheld.making.mapped_drive import SUBSYSTEM as OF_MAP
from sandbox.withheld.making.outside_causes import EVERY, OUTSIDE

SHARES = {"one": 0.6, "several": 0.2, "none": 0.1, "outside": 0.1}
KINDS = ("mixed", "controls", "pairs", "many", "outside")
AT_ONCE = (4, 10)  # effects of a campaign of the kind "many", least and most
MAX_CAMPAIGNS = 10000  # campaigns
PAIR_SIZES = EFFECT_SIZES[1:3]  # large enough to be seen at one operating point
NESTED = {"saturation", "cross_saturation"}  # the one contains the other: never put in together
FOUND_SIZES = EFFECT_SIZES[1:]  # for several at once
TABLES = ("ladder", "published")  # where sizes come from
# of the kind "outside": one in three has an effect of the library, too
WITH_EFFECT = (True, False, False)
# place in a published range from which on sizes are drawn for several at once, and for pairs
FOUND_FROM = 0.25


class Maps(NamedTuple):
    """The share of a mixed check's campaigns whose nominal model is a flux map, and the families of
    these drives."""

    share: float = 0.0
    families: tuple[str, ...] = ()


NO_MAPS = Maps()


@dataclass(frozen=True)
class Case:
    """One withheld campaign before anything is drawn of its drive: names are the library's,
    `outside` is not; pair: of effects that its narrow cycles cannot tell apart; table: of TABLES.
    Sizes are multiples of the medium one, that of `outside` last; for effects of the library by the
    published table places in their ranges, 0 to 1."""

    index: int
    kind: str
    family: str
    style: str
    names: tuple[str, ...] = ()
    sizes: tuple[float, ...] = ()
    outside: str | None = None
    pair: str | None = None
    table: str = "ladder"

    @property
    def name(self) -> str:
        """The campaign's folder."""
        return f"w{self.index:03d}"


def cases(
    count: int,
    seed: int,
    kind: str,
    style: str,
    outside: Sequence[str] | None = None,
    table: str = "ladder",
    maps: Maps = NO_MAPS,
) -> list[Case]:
    """Return the cases of a check: every effect and size in turn, in an order drawn from the seed.

    Shares of a mixed check as SHARES (each at least one campaign as soon as there are ten).  A flux
    map is a drive of its own and has one size.  Pairs: one effect of every pair in turn, on the
    pair's narrow cycles.  Outside: see `_outside`.  outside: causes that can be drawn (EVERY for
    that kind, else OUTSIDE); table: of TABLES; published sizes come from every quarter of their
    range in turn; maps: of mixed checks, which are else the same to the bit. BadInput for an
    unknown name or a count that is none.
    """
    if kind not in KINDS:
        raise unknown("kind of check", kind, KINDS)
    if style not in STYLES:
        raise unknown("style of cycles", style, STYLES)
    if table not in TABLES:
        raise unknown("table of sizes", table, TABLES)
    if not 1 <= count <= MAX_CAMPAIGNS:
        raise BadInput(f"count = {count} is no number of campaigns; give 1 to {MAX_CAMPAIGNS}")
    rng = np.random.default_rng([seed, 1])
    if outside is None:
        outside = tuple(EVERY if kind == "outside" else OUTSIDE)
    if kind == "pairs":
        listed = _pairs(count, style, rng)
    elif kind == "outside":
        listed = _outside(count, style, outside, rng)
    else:
        listed = _listed(count, kind, style, outside, rng)
    if maps.share > 0.0:
        listed = _on_maps(listed, kind, maps, np.random.default_rng([seed, 5]))
    return listed if table == "ladder" else [_placed(c, rng) for c in listed]


def _listed(
    count: int, kind: str, style: str, outside: Sequence[str], rng: Generator
) -> list[Case]:
    """Return mixed cases, controls or cases of many effects, sizes by the ladder."""
    whole = {"controls": "none", "many": "many"}
    kinds = _kinds(count, rng) if kind == "mixed" else [whole[kind]] * count
    families = [str(f) for f in _turns(FAMILIES, count, rng)]
    singles, unlisted = _sized(causes(), rng), _sized(outside, rng)
    out = []
    for k, (what, family) in enumerate(zip(kinds, families, strict=True)):
        base = Case(k, what, family, style)
        turn = kinds[:k].count(what)
        if what == "one":
            name, size = singles[turn % len(singles)]
            base = dataclasses.replace(base, names=(name,), sizes=(size,))
        elif what in ("several", "many"):
            names = (
                _several(rng)
                if what == "several"
                else _many(AT_ONCE[0] + turn % (AT_ONCE[1] - AT_ONCE[0] + 1), rng)
            )
            sizes = tuple(float(rng.choice(FOUND_SIZES)) for _ in names)
            base = dataclasses.replace(base, names=names, sizes=sizes)
        elif what == "outside":
            name, size = unlisted[turn % len(unlisted)]
            base = dataclasses.replace(base, outside=name, sizes=(size,))
            if name == FLUX_MAP:
                base = dataclasses.replace(base, family="mapped", sizes=(1.0,))
        out.append(base)
    return out


def _on_maps(listed: list[Case], kind: str, maps: Maps, rng: Generator) -> list[Case]:
    """Return the cases, a share of every kind on drives with a flux map, whose families come in
    turn.

    A cause outside the library that is itself a map keeps its drive.
    """
    if kind != "mixed":
        raise BadInput(f"a share of flux maps belongs to mixed checks; leave it away for '{kind}'")
    if not (maps.share <= 1.0 and maps.families):
        raise BadInput(
            f"maps = {maps.share} of {len(maps.families)} families is no share; give 0 to 1 of some"
        )
    chosen: list[int] = []
    for what in SHARES:
        own = [c.index for c in listed if c.kind == what and c.outside != FLUX_MAP]
        chosen += [
            int(k) for k in rng.permutation(own)[: int(maps.share * len(own) + rng.uniform())]
        ]
    families = dict(zip(sorted(chosen), _turns(maps.families, len(chosen), rng), strict=True))
    return [dataclasses.replace(c, family=str(families.get(c.index, c.family))) for c in listed]


def _placed(case: Case, rng: Generator) -> Case:
    """Return a case whose rungs of the ladder became places: in the same quarter, or anywhere in
    the upper three."""
    if not case.names:
        return dataclasses.replace(case, table="published")
    if case.kind == "one" and case.pair is None:
        places = [
            (EFFECT_SIZES.index(s) + float(rng.uniform())) / len(EFFECT_SIZES) for s in case.sizes
        ]
    else:
        places = [float(rng.uniform(FOUND_FROM, 1.0)) for _ in case.names]
    return dataclasses.replace(
        case, table="published", sizes=(*places, *case.sizes[len(case.names) :])
    )


def _pairs(count: int, style: str, rng: Generator) -> list[Case]:
    """Return campaigns of one operating point each: pairs in turn, of each both effects in turn."""
    families, order = _turns(FAMILIES, count, rng), [str(p) for p in rng.permutation(list(PAIRS))]
    out = []
    for k, family in enumerate(families):
        round_, place = divmod(k, len(order))
        members = PAIRS[order[place]][0]
        names = (members[(round_ + place) % len(members)],)
        out.append(
            Case(
                k,
                "one",
                str(family),
                style,
                names,
                (float(rng.choice(PAIR_SIZES)),),
                None,
                order[place],
            )
        )
    return out


def _outside(count: int, style: str, outside: Sequence[str], rng: Generator) -> list[Case]:
    """Return campaigns of one cause outside the library each: subsystems in turn, in each its
    causes and their sizes in turn; every third has an effect of the library beside it, but no drive
    with a flux map."""
    of = {name: OF_MAP if name == FLUX_MAP else EVERY[name].subsystem for name in outside}
    order = _turns(sorted(set(of.values())), count, rng)
    by_subsystem = {
        s: _sized([n for n in outside if of[n] == s], rng) for s in sorted(set(of.values()))
    }
    families, with_effect = _turns(FAMILIES, count, rng), _turns(WITH_EFFECT, count, rng)
    effects = iter(_turns(causes(), count, rng))
    out = []
    for k, subsystem in enumerate(order):
        mine = by_subsystem[subsystem]
        name, size = mine[order[:k].count(subsystem) % len(mine)]
        if name == FLUX_MAP:
            out.append(Case(k, "outside", "mapped", style, (), (1.0,), name))
            continue
        names = (str(next(effects)),) if with_effect[k] else ()
        sizes = (*(float(rng.choice(FOUND_SIZES)) for _ in names), size)
        out.append(Case(k, "outside", str(families[k]), style, names, sizes, name))
    return out


def _sized(names: Sequence[str], rng: Generator) -> list[tuple[str, float]]:
    """Return every name at every size, names in turn and sizes mixed from the first on; both orders
    are drawn."""
    order, rungs = rng.permutation(list(names)), rng.permutation(EFFECT_SIZES)
    return [
        (str(n), float(rungs[(k + r) % len(rungs)]))
        for r in range(len(rungs))
        for k, n in enumerate(order)
    ]


def _kinds(count: int, rng: Generator) -> list[str]:
    ends = np.round(np.cumsum(list(SHARES.values())) * count).astype(int)
    sizes = np.diff(np.concatenate([[0], ends]))
    kinds = [k for k, n in zip(SHARES, sizes, strict=True) for _ in range(n)]
    return [kinds[j] for j in rng.permutation(count)]


def _turns(values: Sequence[Any], count: int, rng: Generator) -> list[Any]:
    rounds = -(-count // len(values))
    return [v for _ in range(rounds) for v in rng.permutation(values)][:count]


def _several(rng: Generator) -> tuple[str, ...]:
    """Two or three effects (two twice as often), never two of which one contains the other."""
    while True:
        names = {str(n) for n in rng.choice(causes(), int(rng.choice([2, 2, 3])), replace=False)}
        if not names >= NESTED:
            return tuple(sorted(names))


def _many(count: int, rng: Generator) -> tuple[str, ...]:
    """So many effects, never two of which one contains the other."""
    while True:
        names = {str(n) for n in rng.choice(causes(), count, replace=False)}
        if not names >= NESTED:
            return tuple(sorted(names))
