"""Columns that stand for each other, of whatever quantities: found by reading them the other way.

A current that stands for an angle passes no check of an angle, and no factor or order of phases
mends it.  So where a campaign is refused or doubted, other ways to read its columns are tried:
every two exchanged, all currents and voltages exchanged, one that nobody mapped in the place of
another, each in the place of the one beside it.  Told is what leaves nothing to refuse, and
explains more.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from model.errors import BadInput, as_toml
from model.number_table import Table
from sandbox.gap.motion.checked import noticed_in_motion
from sandbox.gap.motion.mistakes import shows_inertia
from sandbox.gap.motion.unexplained import unexplained
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.checks.balance import UNDISTURBED, balance, percent
from sandbox.recordings.checks.readings import BETTER
from sandbox.recordings.column_map import CURRENTS, KIND, VOLTAGES, Column, source_columns
from sandbox.recordings.findings import Doubt, Finding, Refused, Unanswered
from sandbox.recordings.foreign import read_table
from sandbox.recordings.importing import Source, how_to_map, unchecked
from sandbox.recordings.motion_log import MotionCampaign, motion_only, read_motion
from sandbox.recordings.preflight import NOTE, REFUSED, Noticed, noticed
from sandbox.recordings.stamps import rows_of

ROWS = 8000  # of a table that are tried
FILES = 4  # recordings that are tried, the first of each kind of rotor among them
THREE = ("i_a", "i_b", "i_c")
GROUPS = (THREE, *CURRENTS, *VOLTAGES)  # columns that are logged together
OF_MOTION = {"t", "theta", "speed", "i_q", "torque"}
VOLTAGE, TORQUE = "the commanded voltage", "what the torque changes by"
MOST_FREE = 12  # columns that nobody mapped, tried in the place of others
Way = Mapping[str, str]  # the log's columns by the standard names that they are read as


@dataclass(frozen=True)
class Held(Source):
    """A source whose tables were read already."""

    tables: Mapping[str, Table] = field(default_factory=dict)

    def table(self, file: str) -> Table:
        """Return one recording's table."""
        return self.tables[file]


class Trial(NamedTuple):
    """What a source shows once some columns of some files are read in another way.

    doubts: how many; left: the share of the commanded voltage, or of a motion's torque, that stays
    unexplained; what: which of the two.
    """

    way: Way
    files: tuple[str, ...]
    doubts: int
    left: float
    what: str


def exchanged(source: Source, found: Sequence[Finding]) -> Finding | None:
    """Return the finding on columns that stand for each other; None where no other way to read them
    leaves nothing to refuse, and BETTER times less unexplained, or fewer doubts of the motion.

    found: what is refused or doubted of the source as it is; a mistake in it that leaves less of
    the voltage unexplained is the cause.
    """
    try:
        held = _held(source)
    except BadInput:
        return None
    own = source_columns(held.table(held.entries[0][0]), held.mapped)
    doubted = {f.column for f in found}
    most = min([f.left for f in found if f.left >= 0.0] + [_left(held)])

    def worth(way: Way, left: float, what: str) -> bool:
        """Tell whether so much may be left."""
        fewer = set(way) <= doubted or (what == TORQUE and bool(set(way) & doubted & OF_MOTION))
        return left * BETTER <= most or (fewer and left <= UNDISTURBED)

    every, some = tuple(held.tables), tuple(f for f in held.tables if f in {f.file for f in found})
    for files in (every, some) if 0 < len(some) < len(every) else (every,):
        ways = _ways(own, held.table(files[0]))
        good = [t for w in ways if (t := _trial(held, own, w, files, worth)) is not None]
        good = [t for t in good if t.left * BETTER <= most or t.doubts < len(found)]
        if good:
            best = min(good, key=lambda t: (t.doubts, len(t.way), t.left))
            return Finding(
                files[0], next(iter(best.way)), None, _sentence(own, held.mapped, best, len(every))
            )
    return None


def asking(found: Iterable[Noticed], motion: bool) -> list[Finding]:
    """Return all that is refused or doubted where something of it may be columns that stand for
    each other, none elsewhere; motion: whether only that is judged, of which any doubt asks."""
    some = [n for n in found if n.level != NOTE or isinstance(n.finding, Unanswered)]
    asked = any(
        n.level == REFUSED
        or isinstance(n.finding, (Unanswered, Doubt) if motion else Unanswered)
        or n.finding.column == "theta"
        for n in some
    )
    return [n.finding for n in some] if asked else []


def put_right(source: Source, refused: BadInput) -> BadInput:
    """Return a refusal by columns that are exchanged where these are its cause, or else itself."""
    text = str(refused)
    own = Finding(text.partition(":")[0], "", None, text)
    finding = exchanged(source, [refused.finding if isinstance(refused, Refused) else own])
    return refused if finding is None else Refused(_with_map(source, finding))


def refuse_exchanged(source: Source, found: Sequence[Finding]) -> None:
    """Raise Refused where columns that are exchanged are the cause of what is doubted."""
    finding = exchanged(source, found)
    if finding is not None:
        raise Refused(_with_map(source, finding))


def _with_map(source: Source, finding: Finding) -> Finding:
    return finding if source.foreign else replace(finding, text=how_to_map(finding.text))


def _held(source: Source) -> Held:
    """Return a source with some rows of some of its tables, all their columns; BadInput where they
    cannot be read."""
    some, rotors = list(source.entries[:FILES]), {e[1] for e in source.entries[:FILES]}
    some += [e for e in source.entries[FILES:] if e[1] not in rotors][:1]
    tables = {}
    for file, *_ in some:
        table = read_table(source.folder / file, [], source.log.matrix)
        length = max((len(x) for x in table.columns.values()), default=0)
        tables[file] = rows_of(table, np.arange(min(length, ROWS))) if length else table
    fields = {k: getattr(source, k) for k in Source.__dataclass_fields__}
    return Held(**{**fields, "entries": some}, tables=tables)


def _ways(own: Mapping[str, str], table: Table) -> Iterator[Way]:
    """Yield the ways to read the columns that a log holds (by standard name) in another way.

    Two of one quantity are a matter of order or sense, which `checks.changes` knows; but the link's
    voltage is none of the commands', and without voltages nothing else tells i_d from i_q.
    """
    alone = not any(all(n in own for n in kind) for kind in VOLTAGES)
    for x, y in itertools.combinations(own, 2):
        other = KIND[x] != KIND[y] or "u_dc" in (x, y) or (alone and {x, y} == {"i_d", "i_q"})
        if other and own[x] != own[y]:
            yield {x: own[y], y: own[x]}
    held = [k for k in GROUPS if all(n in own for n in k)]
    for a, b in itertools.combinations(held, 2):
        if len(a) == len(b) and not set(a) & set(b):
            yield {x: own[y] for pair in zip(a, b, strict=True) for x, y in (pair, pair[::-1])}
    keys = {n: table.key(c) for n, c in own.items()}
    free = [n for n, x in table.columns.items() if n not in keys.values() and np.ptp(x) > 0.0]
    for x, column in itertools.product(own, free[:MOST_FREE]):
        yield {x: column}
    names = list(table.columns)
    for by in (1, -1):
        yield {n: names[(names.index(key) + by) % len(names)] for n, key in keys.items() if key}


def _left(held: Held) -> float:
    """Return the share of the commanded voltage or of the torque that a source leaves unexplained
    as it is, 1 where it cannot be read."""
    try:
        with np.errstate(all="ignore"):
            return _read(held)[1]
    except BadInput:
        return 1.0


def _read(held: Held) -> tuple[Campaign | MotionCampaign, float, str]:
    """Return a source's campaign and the share of what that stays unexplained; BadInput where it
    cannot be read."""
    why = motion_only(held)
    if why is not None:
        motion = read_motion(held, why)
        return motion, unexplained(motion), TORQUE
    campaign = unchecked(held)
    shares = [balance(r.columns, campaign.drive).share for r in campaign.recordings]
    return campaign, max(shares, default=1.0), VOLTAGE


def _trial(
    held: Held,
    own: Mapping[str, str],
    way: Way,
    files: tuple[str, ...],
    worth: Callable[[Way, float, str], bool],
) -> Trial | None:
    """Return what is left to doubt with columns of some files read in another way; None where
    anything is refused, a motion shows no inertia, or what is unexplained then is not worth a
    further look."""
    tables = {f: _read_so(t, own, way) if f in files else t for f, t in held.tables.items()}
    try:
        with np.errstate(all="ignore"):
            campaign, left, what = _read(replace(held, tables=tables))
            if not worth(way, left, what):
                return None
            if isinstance(campaign, Campaign):
                found = noticed(campaign)
            elif shows_inertia(campaign):  # a speed as a torque would be friction's
                found = noticed_in_motion(campaign)
            else:
                return None
    except BadInput:
        return None
    doubts = [n for n in found if n.level != NOTE]
    again = what == TORQUE and any(n.finding.column in way for n in doubts)
    return (
        None
        if again or any(n.level == REFUSED for n in doubts)
        else Trial(way, files, len(doubts), left, what)
    )


def _read_so(table: Table, own: Mapping[str, str], way: Way) -> Table:
    """Return a table with columns, their units and their odd cells in the place of others."""
    of = {table.key(own[n]) or own[n]: table.key(other) or other for n, other in way.items()}
    columns = {
        n: table.columns[of.get(n, n)] for n in table.columns if of.get(n, n) in table.columns
    }
    units = {n: u for n in table.columns if (u := table.units.get(of.get(n, n))) is not None}
    odd = {(n, k): cell for n in of for (m, k), cell in table.odd.items() if m == of[n]}
    odd |= {(n, k): cell for (n, k), cell in table.odd.items() if n not in of}
    return replace(table, columns=columns, units=units, odd=odd)


def _sentence(own: Mapping[str, str], mapped: Mapping[str, Column], best: Trial, files: int) -> str:
    """Return which columns stand for each other, by what that is seen, and how to map them."""
    pairs = [(x, y) for x, y in itertools.combinations(best.way, 2) if own[y] == best.way[x]]
    two_by_two = 2 * len(pairs) == len(best.way)
    if two_by_two:
        said = ", ".join(f"{_named(own, x)} and {_named(own, y)}" for x, y in pairs)
        said = f"columns {said} are exchanged"
    elif len(best.way) == 1:
        ((name, other),) = best.way.items()
        said = f"column '{other}' is {name}, '{own[name]}' is not"
    else:
        said = "each column holds what the one beside it should"
    where = f" in {', '.join(best.files)} alone" if len(best.files) < files else ""
    remedy = ", ".join(f"{x} = {_entry(mapped.get(x), other)}" for x, other in best.way.items())
    how = "exchange them there" if where else f"map {remedy}"
    return (
        f"{best.files[0]}: {said}{where}: read so, {percent(best.left)} of {best.what} is "
        f"unexplained (at most {percent(UNDISTURBED)} is usual); {how}"
    )


def _entry(mapped: Column | None, other: str) -> str:
    """Return an entry of [columns] with another column, and all else as it is."""
    keys: dict[str, Any] = {"column": other}
    if mapped is not None:
        usual = Column("", "")
        own = {k: getattr(mapped, k) for k in ("unit", "scale", "offset", "mechanical")}
        keys.update((k, x) for k, x in own.items() if x != getattr(usual, k))
    return "{" + ", ".join(f"{k} = {as_toml(x)}" for k, x in keys.items()) + "}"


def _named(own: Mapping[str, str], name: str) -> str:
    """Return a log's column in quotes, with our name where that is another one."""
    return f"'{name}'" if own[name] == name else f"'{own[name]}' (for {name})"
