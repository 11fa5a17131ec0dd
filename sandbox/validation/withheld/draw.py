"""Which cases a withheld check has, and the truth of each: drive, deviations, effects; all drawn from one seed.

The last digits of a drawn number depend on the machine (its exponential function, the spline fit of a flux map), so a
truth is sealed with SEALED digits: the same seed gives the same seal everywhere.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

from model.effects.library import complete, effect_names
from model.errors import BadInput, unknown
from model.mapped import without_map
from model.parameters import Drive, Motor
from sandbox.output.files import plain, rounded
from sandbox.validation.switched.bench_numbers import SOFT_SIGN
from sandbox.validation.withheld.cycle_styles import STYLES
from sandbox.validation.withheld.cycles_narrow import PAIRS
from sandbox.validation.withheld.drives import (
    FAMILIES,
    UNCERTAINTY,
    Bench,
    draw_bench,
    draw_drive,
    misjudge,
    off_by,
    sign_of,
    valid,
)
from sandbox.validation.withheld.ladder import LADDER, OUTSIDE, changed, plant, truth_of
from sandbox.validation.withheld.mapped_drive import FLUX_MAP, SUBSYSTEM, identified, missing
from sandbox.validation.withheld.published import multiple, planted
from sandbox.validation.withheld.users_effects import size_at, users_cards, users_planted, users_truth

SHARES = {"one": 0.6, "several": 0.2, "none": 0.1, "outside": 0.1}
KINDS = ("mixed", "controls", "pairs", "many")
AT_ONCE = (4, 10)  # effects of a campaign of the kind "many", least and most
MOST = 10000  # campaigns
PAIR_SIZES = LADDER[1:3]  # large enough to be seen at one operating point
NESTED = {"saturation", "cross_saturation"}  # the one contains the other: never put in together
FOUND_SIZES = LADDER[1:]  # for several at once
TABLES = ("ladder", "published")  # where sizes come from
FOUND_FROM = 0.25  # place in a published range from which on sizes are drawn for several at once, and for pairs
SEALED = 6  # significant digits; what machines differ by, 1e-12 at the most, moves one in a million of them


@dataclass(frozen=True)
class Case:
    """One withheld campaign before anything is drawn of its drive: names are the library's, `outside` is not; pair: of
    effects that its narrow cycles cannot tell apart; table: of TABLES.  Sizes are multiples of the medium one, for
    effects of the library by the published table places in their ranges, 0 to 1."""

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


@dataclass(frozen=True)
class Drawn:
    """A case with its drive: what is true, what its engineer believes, what the switched bench gets beside."""

    case: Case
    true: Drive
    stated: Motor  # as campaign.toml states it
    bench: Bench
    plant: dict[str, float]
    own: dict[str, float]  # the switched bench's own effects
    sign: dict[str, float]  # how the sign of a current goes through zero on it, where not as usual
    drift: float
    theta: float  # rad at the start; where a locked rotor stands
    seed: int
    sizes: tuple[float, ...]  # multiples of the medium one
    off: dict[str, float]  # ordinary deviations, in stated ones

    def as_json(self) -> dict[str, Any]:
        """Return the truth as the seal keeps it."""
        case, b = self.case, self.bench
        return {
            **{k: getattr(case, k) for k in ("kind", "family", "style", "outside")},
            **({"pair": case.pair} if case.pair else {}),
            "effects": [*case.names, *(["unknown"] if case.outside else [])],
            "outside_subsystem": outside_subsystem(case.outside),
            "sizes": self.sizes,
            **({"places": case.sizes} if case.table == "published" and case.names else {}),
            "parameters": truth_of(list(case.names), self.true.motor, self.stated, self.plant)
            | users_truth(case.names, self.own),
            "outside_parameters": {**self.own, **({"drift": self.drift} if self.drift else {})},
            "true_motor": dataclasses.asdict(without_map(self.true.motor)),
            "plant": self.plant,
            "deviations": self.off,
            "bench": {
                "common_offset": float(np.mean(b.offsets)), "load_torque_offset": b.load_torque_offset,
                "theta": self.theta, "soft_current": SOFT_SIGN * self.true.motor.rated_current, **self.sign,
            },
        }  # fmt: skip

    def sealed(self) -> dict[str, Any]:
        """Return the truth as it stands in the seal: with as many digits as all machines agree on."""
        truth: dict[str, Any] = rounded(plain(self.as_json()), SEALED)
        return truth


def outside_names() -> list[str]:
    """Return what is outside the library and can be made here: a flux map needs its data set."""
    return [*OUTSIDE, *([] if missing() else [FLUX_MAP])]


def outside_subsystem(name: str | None) -> str | None:
    """Return where an effect outside the library lies."""
    if name is None:
        return None
    return SUBSYSTEM if name == FLUX_MAP else OUTSIDE[name].subsystem


def cases(
    count: int, seed: int, kind: str, style: str, outside: Sequence[str] = tuple(OUTSIDE), table: str = "ladder"
) -> list[Case]:
    """Return the cases of a check: every effect and size in turn, in an order drawn from the seed.

    Shares of a mixed check as SHARES (each at least one campaign as soon as there are ten).  A flux map is a drive of
    its own and has one size.  Pairs: one effect of every pair in turn, on the pair's narrow cycles.  table: of TABLES;
    published sizes come from every quarter of their range in turn.
    """
    if kind not in KINDS:
        raise unknown("kind of check", kind, KINDS)
    if style not in STYLES:
        raise unknown("style of cycles", style, STYLES)
    if table not in TABLES:
        raise unknown("table of sizes", table, TABLES)
    if not 1 <= count <= MOST:
        raise BadInput(f"count = {count} is no number of campaigns; give 1 to {MOST}")
    rng = np.random.default_rng([seed, 1])
    listed = _pairs(count, style, rng) if kind == "pairs" else _listed(count, kind, style, outside, rng)
    return listed if table == "ladder" else [_placed(c, rng) for c in listed]


def _listed(count: int, kind: str, style: str, outside: Sequence[str], rng: Generator) -> list[Case]:
    """Return mixed cases, controls or cases of many effects, sizes by the ladder."""
    whole = {"controls": "none", "many": "many"}
    kinds = _kinds(count, rng) if kind == "mixed" else [whole[kind]] * count
    families = [str(f) for f in _turns(FAMILIES, count, rng)]
    singles, unlisted = _sized(effect_names(), rng), _sized(outside, rng)
    out = []
    for k, (what, family) in enumerate(zip(kinds, families, strict=True)):
        base = Case(k, what, family, style)
        turn = kinds[:k].count(what)
        if what == "one":
            name, size = singles[turn % len(singles)]
            base = dataclasses.replace(base, names=(name,), sizes=(size,))
        elif what in ("several", "many"):
            names = (
                _several(rng) if what == "several" else _many(AT_ONCE[0] + turn % (AT_ONCE[1] - AT_ONCE[0] + 1), rng)
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


def _placed(case: Case, rng: Generator) -> Case:
    """Return a case whose rungs of the ladder became places: in the same quarter, or anywhere in the upper three."""
    if not case.names:
        return dataclasses.replace(case, table="published")
    if case.kind == "one" and case.pair is None:
        places = [(LADDER.index(s) + float(rng.uniform())) / len(LADDER) for s in case.sizes]
    else:
        places = [float(rng.uniform(FOUND_FROM, 1.0)) for _ in case.sizes]
    return dataclasses.replace(case, table="published", sizes=tuple(places))


def _pairs(count: int, style: str, rng: Generator) -> list[Case]:
    """Return campaigns of one operating point each: pairs in turn, of each both effects in turn."""
    families, order = _turns(FAMILIES, count, rng), [str(p) for p in rng.permutation(list(PAIRS))]
    out = []
    for k, family in enumerate(families):
        round_, place = divmod(k, len(order))
        members = PAIRS[order[place]][0]
        names = (members[(round_ + place) % len(members)],)
        out.append(Case(k, "one", str(family), style, names, (float(rng.choice(PAIR_SIZES)),), None, order[place]))
    return out


def _sized(names: Sequence[str], rng: Generator) -> list[tuple[str, float]]:
    """Return every name at every size, names in turn and sizes mixed from the first on; both orders are drawn."""
    order, rungs = rng.permutation(list(names)), rng.permutation(LADDER)
    return [(str(n), float(rungs[(k + r) % len(rungs)])) for r in range(len(rungs)) for k, n in enumerate(order)]


def _kinds(count: int, rng: Generator) -> list[str]:
    ends = np.round(np.cumsum(list(SHARES.values())) * count).astype(int)
    sizes = np.diff(np.concatenate([[0], ends]))
    kinds = [k for k, n in zip(SHARES, sizes, strict=True) for _ in range(n)]
    return [kinds[j] for j in rng.permutation(count)]


def _turns(values: Sequence[str], count: int, rng: Generator) -> list[str]:
    rounds = -(-count // len(values))
    return [v for _ in range(rounds) for v in rng.permutation(values)][:count]


def _several(rng: Generator) -> tuple[str, ...]:
    """Two or three effects (two twice as often), never two of which one contains the other."""
    while True:
        names = {str(n) for n in rng.choice(effect_names(), int(rng.choice([2, 2, 3])), replace=False)}
        if not names >= NESTED:
            return tuple(sorted(names))


def _many(count: int, rng: Generator) -> tuple[str, ...]:
    """So many effects, never two of which one contains the other."""
    while True:
        names = {str(n) for n in rng.choice(effect_names(), count, replace=False)}
        if not names >= NESTED:
            return tuple(sorted(names))


def draw(case: Case, seed: int) -> Drawn:
    """Return a case with its drive; drawn again where motor or effects are not valid on it."""
    rng = np.random.default_rng([seed, 2, case.index])
    for _ in range(200):
        found = _once(case, rng)
        if found is not None:
            return found
    raise AssertionError(f"{case.name}: nothing valid in 200 draws")


def _once(case: Case, rng: Generator) -> Drawn | None:
    drive = draw_drive(case.family, rng, case.style == "scored")
    by_range = case.table == "published"
    bench = draw_bench(drive, rng, by_range)
    base = drive.motor
    multiples, users = list(case.sizes), users_cards()
    believed = identified(base) if case.outside == FLUX_MAP else base
    true, values, own, drift = base, dict[str, float](), dict[str, float](), 0.0
    for k, name in enumerate(case.names):
        if name in users:
            multiples[k] = size_at(case.sizes[k]) if by_range else case.sizes[k]
            p = users_planted(users[name], base, drive.converter, multiples[k], rng)
        elif by_range:
            p = planted(name, base, drive.converter, case.sizes[k], rng)
            multiples[k] = multiple(name, base, drive.converter, p)
        else:
            p = plant(name, base, drive.converter, case.sizes[k], rng)
        true, believed = changed(true, p.true), changed(believed, p.believed)
        values |= p.plant
        own |= p.bench
    if case.outside in OUTSIDE:
        p = OUTSIDE[case.outside].planted(drive, case.sizes[0], rng)
        own, drift = own | dict(p.bench), p.drift
    values = with_deviations(values, bench)
    stated = misjudge(believed, rng, by_range)
    sign = sign_of(base, rng) if by_range else {}
    if not (valid(true) and valid(stated)):
        return None
    try:
        complete(true, drive.converter, values)
    except BadInput:
        return None
    stands = float(rng.uniform(0.0, 2.0 * np.pi))
    return Drawn(
        case, dataclasses.replace(drive, motor=true), stated, bench, values, own, sign, drift, stands,
        int(rng.integers(2**31)), tuple(multiples), off_by(believed, stated, bench),
    )  # fmt: skip


def with_deviations(values: dict[str, float], bench: Bench) -> dict[str, float]:
    """Return the plant's parameters with the bench's ordinary deviations on top."""
    offsets = np.array(bench.offsets) - np.mean(bench.offsets)
    more = {f"current_gain.gain_{x}": g - 1.0 for x, g in zip("abc", bench.gains, strict=True)}
    more |= {"current_offset.offset_a": float(offsets[0]), "current_offset.offset_b": float(offsets[1])}
    more |= {"encoder_offset.offset": bench.encoder_offset, "dead_time.time": bench.dead_time}
    neutral = {name: 1.0 if name.startswith("current_gain") else 0.0 for name in more}
    return values | {name: values.get(name, neutral[name]) + x for name, x in more.items()}


def uncertainty() -> dict[str, float]:
    """Return [uncertainty] as every withheld campaign states it."""
    return dict(UNCERTAINTY)
