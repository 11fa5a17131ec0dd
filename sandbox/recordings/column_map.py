"""The column map: names, units, scales and other kinds of signals, turned into standard
columns.

A `[columns]` table holds one entry a standard name, e.g.
`theta = {column = "Pos", unit = "deg", mechanical = true}`; IMPORTING.md beside this file tells the
whole.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.errors import BadInput, as_toml, unknown
from model.frames import phases
from model.number_table import Table
from model.parameters import finite
from model.units import KNOWN, UNITS
from sandbox.recordings.angle.commutation import state_names
from sandbox.recordings.angle.turning import of_log, turns_between, unwrapped, with_angle
from sandbox.recordings.campaign import OPTIONAL, REQUIRED, Made, table_of
from sandbox.recordings.findings import Finding
from sandbox.recordings.formats.log_table import MOST_VALUES, first_beyond
from sandbox.recordings.rows.missing import filled, finding_of, gone

KINDS = {
    "time": ("t",),
    "voltage": ("u_alpha", "u_beta", "u_a", "u_b", "u_c", "u_d", "u_q", "u_dc"),
    "current": ("i_a", "i_b", "i_c", "i_alpha", "i_beta", "i_d", "i_q"),
    "speed": ("speed",),
    "angle": ("theta", "theta_hat"),
    "state": ("hall", "hall_a", "hall_b", "hall_c", "steps"),
    "duty": ("d_a", "d_b", "d_c"),
    "torque": ("load_torque", "torque"),
    "temperature": ("temperature",),
}
KIND = {name: kind for kind, names in KINDS.items() for name in names}
# names taken as they stand; `speed` stands in logs in any unit
OURS = tuple(n for n in KIND if n != "speed")
READ = ("current", "speed", "angle", "torque", "temperature")  # kinds that go on from row to row
TURNING = ("angle", "speed")  # kinds that may be the shaft's
VOLTAGES = (("u_alpha", "u_beta"), ("u_a", "u_b", "u_c"), ("u_d", "u_q"), ("d_a", "d_b", "d_c"))
CURRENTS = (("i_a", "i_b"), ("i_b", "i_c"), ("i_alpha", "i_beta"), ("i_d", "i_q"))
HALLS = ("hall_a", "hall_b", "hall_c")
KEYS = ("column", "unit", "scale", "offset", "mechanical", "value")
LARGEST = 1e18  # of any cell, nanoseconds included
# of a recording: a log of few columns becomes all that are needed
MOST_ROWS = MOST_VALUES // len(REQUIRED)
SMALLEST = 1e-12  # size of a factor between units; its inverse is the largest
HEXADECIMAL = re.compile(  # 0x1F, &H1F, 1Fh, 001F
    r"\s*(?:(?:0x|&h|\$)[0-9a-f]+|(?=.*[0-9])(?=.*[a-f])[0-9a-f]+h?|[0-9]+h)\s*$", re.IGNORECASE
)
OF_DAY = re.compile(r"\d:\d\d")
WITH_UNIT = re.compile(r"[+-]?[\d.,]+(?:[eE][+-]?\d+)?\s*([^\d\s.,]\S*)$")
PORT = re.compile(r'"|/"?(?:Out|In)\d+"?$')  # what a path of Simulink has beside a signal's name
BRACKET = re.compile(r"[\[(][^\[\]()]*[\])]\s*$")
LETTERS = ("A", "B", "C")  # units, and names of phases
DISORDER = 0.2  # of the rows: stamps that go back
RARE_GAPS = 0.01  # of the rows: cells without a number that may be left out, a row each
MOST_LISTED = 12  # columns named where one is missing


@dataclass(frozen=True)
class Column:
    """How one standard column is read: from a named column or a constant value, unit, then scale
    and offset.

    others: names that may stand for the column's, and the last parts of names that are paths; with
    any, the column may be absent (of a preset, which does not know what was logged).
    """

    name: str
    column: str
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    mechanical: bool = False
    value: float | None = None
    others: tuple[str, ...] = ()

    def found_in(self, table: Table) -> str | None:
        """Return the name under which a table has the column, None where it may be absent and
        is."""
        if not self.others:
            return table.key(self.column) or self.column
        names = table.columns
        for wanted in self.others:
            ends = [
                n
                for n in names
                if PORT.sub("", f"/{n}").endswith((f".{wanted}", f"/{wanted}", f"\\{wanted}"))
            ]
            if len(ends) == 1 or wanted in ends:
                return wanted if wanted in ends else ends[0]
        return None


def parse_columns(data: Mapping[str, Any], source: str) -> dict[str, Column]:
    """Return the [columns] table by standard name; BadInput names the key that is wrong."""
    try:
        table = table_of(data, "columns")
        return {name: _parse(name, entry) for name, entry in table.items()}
    except BadInput as error:
        raise BadInput(f"{source}: {error}") from None


def _parse(name: str, entry: Any) -> Column:
    if name not in KIND:
        raise unknown("name in [columns]", name, KIND)
    if isinstance(entry, str):
        entry = {"column": entry}
    if not isinstance(entry, dict):
        raise BadInput(
            f"[columns] {name} = {as_toml(entry)} is no entry; write {name} = {{column = "
            f'"...", unit = "..."}}'
        )
    for key in entry:
        if key not in KEYS:
            raise unknown(f"key in [columns] {name}", key, KEYS)
    for key in ("scale", "offset", "value"):
        if finite(entry.get(key, 0.0)) is None:
            raise BadInput(
                f"[columns] {name}: {key} = {as_toml(entry[key])} is no finite number; give one"
            )
    if not SMALLEST <= abs(entry.get("scale", 1.0)) <= 1.0 / SMALLEST:
        raise BadInput(
            f"[columns] {name}: scale = {as_toml(entry['scale'])} would erase the column; leave it "
            f"out or give a factor of size {SMALLEST:g} to {1.0 / SMALLEST:g}"
        )
    for key in ("column", "unit"):
        if not isinstance(entry.get(key, ""), str):
            raise BadInput(
                f"[columns] {name}: {key} = {as_toml(entry[key])} is no text; put it in quotes"
            )
    if not isinstance(entry.get("mechanical", False), bool):
        raise BadInput(
            f"[columns] {name}: mechanical = {as_toml(entry['mechanical'])} must be true or false"
        )
    if entry.get("mechanical") and KIND[name] not in TURNING:
        raise BadInput(
            f"[columns] {name}: mechanical = true is for theta, theta_hat and speed only; remove it"
        )
    if "value" in entry and "column" in entry:
        raise BadInput(f"[columns] {name}: both column and value are given; keep one")
    if "unit" in entry:
        _factor(name, entry["unit"], "[columns] " + name)
    value = entry.get("value")
    return Column(
        name,
        entry.get("column", name),
        entry.get("unit"),
        float(entry.get("scale", 1.0)),
        float(entry.get("offset", 0.0)),
        entry.get("mechanical", False),
        None if value is None else float(value),
    )


def _factor(name: str, unit: str, where: str) -> tuple[float, float]:
    units = UNITS[KIND[name]]
    if unit not in units:
        raise BadInput(f"{where}: {unknown(f'unit of {KIND[name]}', unit, units)}")
    return units[unit]


class StandardColumns(NamedTuple):
    """The standard columns of a table, what was changed or lost on the way, of what the angle was
    made, and by phase which rows of its current had no number (1, else 0)."""

    values: dict[str, Array]
    notes: list[Finding]
    made: Made | None
    empty: dict[str, Array]


def standard_columns(
    file: str,
    table: Table,
    columns: Mapping[str, Column],
    pole_pairs: float,
    link: float,
    *,
    locked: bool = False,
    period: float = 0.0,
) -> StandardColumns:
    """Return the standard columns of a table.

    Names that [columns] does not mention are taken where the table has them; `link` (V) stands in
    for an absent u_dc, speed, Hall states or counted steps for an absent angle; one that is locked
    needs none.
    period: s from row to row where a table has no stamps.
    """
    length = _length(table)
    if length > MOST_ROWS:
        raise BadInput(
            f"{file}: {length / 1e6:.3g} million rows, at most {MOST_ROWS / 1e6:g} are "
            "read; cut the log"
        )
    empty = dict[str, Array]()
    found, notes = measured(file, table, columns, pole_pairs, empty)
    if "u_dc" not in found:
        found["u_dc"] = np.full(length, link)
        notes.append(
            _lost(
                file,
                "u_dc",
                f"not recorded, dc_bus_voltage = {link:g} V stands in; link sag and "
                "ripple stay unseen",
            )
        )
    elif length and "u_dc" not in source_columns(table, columns):
        text = f"{found['u_dc'][0]:g} V given as a constant; link sag and ripple stay unseen"
        notes.append(_lost(file, "u_dc", text))
    found, made = with_angle(
        file, found, source_columns(table, columns), notes, length if locked else 0, period
    )
    currents, voltages = phase_currents(file, found, notes), _voltages(file, found, notes)
    if "theta" not in found:
        some = f" ({lacking(found, [HALLS], 'angle')})" if found.keys() & HALLS else ""
        raise BadInput(
            f"{file}: column 'theta' is missing{some}; map the encoder, or what stands in for "
            "it: speed = "
            '{column = "erpm", unit = "rpm"}, hall = {column = ...} (states 1 to 6) or '
            'steps = {column = "tachometer"}'
        )
    kept = {n: found[n] for n in ("t", "theta", "u_dc", *OPTIONAL) if n in found}
    if empty.keys() - {"i_a", "i_b", "i_c"}:  # of two axes: every phase is made from them
        empty = dict.fromkeys(currents, np.max(list(empty.values()), axis=0))
    return StandardColumns({**kept, **voltages, **currents}, notes, made, empty)


def measured(
    file: str,
    table: Table,
    columns: Mapping[str, Column],
    pole_pairs: float,
    empty: dict[str, Array] | None = None,
) -> tuple[dict[str, Array], list[Finding]]:
    """Return the standard columns that a table has, in their units, and what was changed on the
    way; empty: takes which rows of a current had no number."""
    notes = [Finding(file, column, None, text) for column, text in table.notes]
    found: dict[str, Array] = {}
    mapped = available(table, columns)
    for name in KIND:
        entry = _entry(table, mapped, name)
        if entry is not None:
            turns = turns_between(found)
            own = {} if empty is None else empty
            found[name] = _values(file, table, entry, pole_pairs, notes, turns, own)
            if name == "t":
                _refuse_disorder(file, found[name])
    return found, notes


def stamps_of(file: str, table: Table, columns: Mapping[str, Column]) -> Array | None:
    """Return the stamps (s) of a table's rows, None where it has none; BadInput as in
    `measured`."""
    entry = _entry(table, available(table, columns), "t")
    if entry is None:
        return None
    t = _values(file, table, entry, 1.0, [], None, {})
    _refuse_disorder(file, t)
    return t


def _entry(table: Table, mapped: Mapping[str, Column], name: str) -> Column | None:
    """Return how a standard column is read, by the map or by a name of ours; None where a table
    lacks it."""
    ours = name in OURS and (name in table.columns or name in table.also)
    return mapped.get(name) or (Column(name, name) if ours else None)


def _refuse_disorder(file: str, t: Array) -> None:
    """Raise BadInput where stamps go back as often as forth: rows that are out of order, or all in
    reverse."""
    back = np.flatnonzero(np.diff(t) < 0.0)
    if back.size > DISORDER * len(t):
        k = int(back[0]) + 1
        raise BadInput(
            f"{file}: row {k} of column 't' is {t[k]:.9g}, before row {k - 1} ({t[k - 1]:.9g}), "
            f"and so in {back.size} rows: they are out of order; sort them by time"
        )


def available(table: Table, columns: Mapping[str, Column]) -> dict[str, Column]:
    """Return the map with names as a table has them, without what it need not have and has not."""
    found = {
        name: (c, c.column if c.value is not None else c.found_in(table))
        for name, c in columns.items()
    }
    return {name: replace(c, column=own) for name, (c, own) in found.items() if own is not None}


def source_columns(table: Table, columns: Mapping[str, Column]) -> dict[str, str]:
    """Return the table's own columns by standard name, without constants that stand in."""
    mapped = available(table, columns)
    ours = {n: n for n in KIND if n not in mapped and table.key(n) is not None}
    return ours | {n: c.column for n, c in mapped.items() if c.value is None}


def source_units(table: Table, columns: Mapping[str, Column]) -> dict[str, str]:
    """Return the units in which a table's columns are read, by standard name, where map or table
    state one."""
    mapped, out = available(table, columns), {}
    for name, own in source_columns(table, columns).items():
        unit = (mapped[name].unit if name in mapped else None) or table.units.get(own)
        if unit in UNITS[KIND[name]]:
            out[name] = str(unit)
    return out


def has_voltages(table: Table, columns: Mapping[str, Column]) -> bool:
    """Tell whether a table holds anything of which commanded voltages can be made."""
    names = {*available(table, columns), *table.names}
    return any(names.issuperset(kind) for kind in VOLTAGES)


def lacks_voltages(table: Table, columns: Mapping[str, Column]) -> str:
    """Return which voltages a table lacks, as a clause, where it has no kind of them whole."""
    names = {*available(table, columns), *table.names}
    known = {*KIND, *source_columns(table, columns).values()}
    other = [n for n in table.names if n not in known][:MOST_LISTED]
    others = f" (the log holds {', '.join(other)} beside what is mapped)" if other else ""
    some = lacking(names, VOLTAGES, "voltage")
    return some or f"no column is a commanded voltage{others}"


def lacking(names: Collection[str], kinds: Sequence[tuple[str, ...]], what: str) -> str:
    """Return as a clause which columns a log lacks that has some of a kind of signal, none whole;
    empty where it has none of any."""
    kind = max(kinds, key=lambda k: len([n for n in k if n in names]) / len(k))
    there, missing = ([n for n in kind if (n in names) == has] for has in (True, False))
    tell = "tells" if len(there) == 1 else "tell"
    return (
        f"{' and '.join(there)} without {' and '.join(missing)} {tell} no {what} (log or map all "
        "of them)"
        if there
        else ""
    )


def by_states(table: Table, columns: Mapping[str, Column]) -> str:
    """Return the columns of Hall states or counted steps, in the log's words, where these alone
    tell an angle."""
    own = source_columns(table, columns)
    names = state_names(own)
    return (
        ""
        if names is None or "theta" in {*own, *available(table, columns)} or "speed" in own
        else of_log(own, names)
    )


def _values(
    file: str,
    table: Table,
    entry: Column,
    pole_pairs: float,
    notes: list[Finding],
    turns: Array | None,
    empty: dict[str, Array],
) -> Array:
    """Return one column in the standard unit: unwrapped, times unit, scale and pole pairs, plus
    offset.

    turns: electrical, from row to row by the log's speed, by which an angle is unwrapped; empty:
    takes which rows of a current had no number.
    """
    if entry.value is not None:
        return np.full(_length(table), entry.value)
    key, angle = key_of(file, table, entry), KIND[entry.name] == "angle"
    factor, shift = _unit_of(file, table, entry, key)
    turn = 2.0 * math.pi / abs(factor * entry.scale) if angle else 0.0
    raw, rows = _numbers(file, table, entry, turn, notes)
    if rows is not None and KIND[entry.name] == "current":
        empty[entry.name] = rows.astype(np.float64)
    pairs = pole_pairs if entry.mechanical else 1.0
    if angle:
        own = math.copysign(1.0, factor * entry.scale) / pairs
        steps = None if turns is None or entry.name != "theta" else own * turns
        raw = unwrapped(file, key, raw, turn, notes, steps, entry.name == "theta_hat")
    factor *= pairs
    if (factor, shift, entry.scale, entry.offset) == (1.0, 0.0, 1.0, 0.0):
        return raw
    out = np.multiply(raw, factor, dtype=np.float64)  # then in its place: a column may be long
    out += shift
    out *= entry.scale
    out += entry.offset
    return out


def _length(table: Table) -> int:
    return max((len(v) for v in table.columns.values()), default=0)


def _unit_of(file: str, table: Table, entry: Column, key: str) -> tuple[float, float]:
    """Return factor and shift to the standard unit, by what the map or the header says."""
    stated = table.units.get(key)
    where = f"{file}: column '{entry.column}'"
    if stated is not None and stated not in UNITS[KIND[entry.name]] and entry.unit is None:
        if not (BRACKET.search(entry.column) and (stated not in KNOWN or stated in LETTERS)):
            _factor(entry.name, stated, where)
        stated = None  # the map spells the bracket: it belongs to the name
    if (
        entry.unit
        and stated in UNITS[KIND[entry.name]]
        and _factor(entry.name, stated, where) != _factor(entry.name, entry.unit, where)
    ):
        raise BadInput(
            f"{where} says its unit is {stated}, [columns] says {entry.unit}; correct one of them"
        )
    unit = entry.unit or stated
    return _factor(entry.name, unit, where) if unit else (1.0, 0.0)


def _numbers(
    file: str, table: Table, entry: Column, turn: float, notes: list[Finding]
) -> tuple[Array, NDArray[np.bool_] | None]:
    """Return a column's numbers, and which rows of it were empty where those beside tell them;
    turn: of an angle, in its own unit, else 0."""
    key = key_of(file, table, entry)
    raw, read = table.columns[key], KIND[entry.name] in READ or entry.name == "u_dc"
    rows = gone(table, key, raw) if read else None
    if rows is None:
        _refuse_gaps(file, table, key, raw)
        return raw, None
    notes.append(finding_of(file, entry.name, entry.column, rows, KIND[entry.name] == "current"))
    return filled(raw, rows, turn), rows


def key_of(file: str, table: Table, entry: Column) -> str:
    """Return a table's own name for a column; BadInput where it has none, or two."""
    try:
        key = table.key(entry.column)
    except BadInput as error:
        raise BadInput(f"{file}: {error}") from None
    if key is not None:
        return key
    near = [n for n in table.names if _plain(n) == _plain(entry.column)]
    listed = ", ".join(list(table.columns)[:MOST_LISTED])
    hint = f"is it '{near[0]}'? the file" if near else "it"
    less = (
        " or leave it out: two currents are enough" if entry.name in ("i_a", "i_b", "i_c") else ""
    )
    raise BadInput(
        f"{file}: no column '{entry.column}' (for '{entry.name}'); {hint} holds {listed}: correct "
        f"the name in [columns]{less}"
    )


def _plain(name: str) -> str:
    return re.sub(r"[\s_]", "", name).casefold()


def _refuse_gaps(file: str, table: Table, column: str, raw: Array) -> None:
    k = first_beyond(raw, LARGEST)
    if len(raw) and np.all(np.isnan(raw)) and not table.odd.get((column, 0)):
        raise BadInput(
            f"{file}: column '{column}' holds no number in any row; map the column that was "
            "recorded, or leave it out of [columns]"
        )
    if k is not None:
        cell = table.odd.get((column, k))
        shown = f"{raw[k]}" if cell is None else f"'{cell[:20]}'" if cell else "empty"
        many = int(np.count_nonzero(~(np.abs(raw) <= LARGEST)))
        remedy = (
            "delete the row (the stamps of 't' show the gap, and the log is cut there), or export "
            "every sample"
        )
        if many > RARE_GAPS * len(raw):
            remedy = "record every sample and export it again"
        if cell and HEXADECIMAL.match(cell):
            remedy = "it is hexadecimal: export decimal numbers, with their sign"
        elif cell and OF_DAY.search(cell):
            remedy = "it is a time of day: export seconds, from any beginning"
        elif cell and (found := WITH_UNIT.match(cell)) and found[1] in KNOWN:
            remedy = (
                f"its unit stands in the cell: export numbers, the unit in the header [{found[1]}]"
            )
        raise BadInput(
            f"{file}: row {k} of column '{column}' is {shown}, no number that was "
            f"measured{f' ({many} such rows)' * (many > 1)}; {remedy}"
        )


def _lost(file: str, column: str, text: str) -> Finding:
    return Finding(file, column, None, f"{file}: column '{column}': {text}")


def phase_currents(file: str, found: Mapping[str, Array], notes: list[Finding]) -> dict[str, Array]:
    """Return three phase currents from what there is, noting what they cannot show."""
    have = [n for n in ("i_a", "i_b", "i_c") if n in found]
    if len(have) == 3:
        return {n: found[n] for n in have}
    if len(have) == 2:
        third = ({"i_a", "i_b", "i_c"} - set(have)).pop()
        text = (
            f"not recorded, minus the sum of {' and '.join(have)} stands in; faults of a "
            "third sensor stay unseen"
        )
        notes.append(_lost(file, third, text))
        return {**{n: found[n] for n in have}, third: -found[have[0]] - found[have[1]]}
    for x, y in (("i_alpha", "i_beta"), ("i_d", "i_q")):
        if x in found and y in found:
            a, b = _stationary(file, found, x, y) if x == "i_d" else (found[x], found[y])
            seen = "gain and offset of single sensors cannot be told apart" + (
                "; the angle used for dq is taken to be theta" if x == "i_d" else ""
            )
            notes.append(_lost(file, "i_a", f"phase currents are made from {x} and {y}; {seen}"))
            return dict(
                zip(
                    ("i_a", "i_b", "i_c"),
                    (np.asarray(p) for p in phases.py_func(a, b)),
                    strict=True,
                )
            )
    raise BadInput(
        f"{file}: {lacking(found, CURRENTS, 'current') or 'no currents'}; map i_a and i_b (with "
        "i_c where there are three), or i_alpha and i_beta, or i_d and i_q"
    )


def _voltages(file: str, found: Mapping[str, Array], notes: list[Finding]) -> dict[str, Array]:
    """Return the commanded voltage in the stator frame from what there is."""
    if "u_alpha" in found and "u_beta" in found:
        return {n: found[n] for n in ("u_alpha", "u_beta")}
    if all(n in found for n in ("u_d", "u_q")):
        a, b = _stationary(file, found, "u_d", "u_q")
        text = (
            "made from u_d and u_q at theta; an angle that the drive advanced for its delay "
            "is not undone"
        )
        notes.append(_lost(file, "u_alpha", text))
        return {"u_alpha": a, "u_beta": b}
    for names, link in ((("u_a", "u_b", "u_c"), 1.0), (("d_a", "d_b", "d_c"), found["u_dc"])):
        if all(n in found for n in names):
            a, b, c = (link * found[n] for n in names)
            if names[0] == "d_a":
                _check_duties(file, {n: found[n] for n in names})
                notes.append(
                    _lost(
                        file,
                        "u_alpha",
                        "made from duties times u_dc; what u_dc misreads enters the command",
                    )
                )
            return {"u_alpha": (2.0 * a - b - c) / 3.0, "u_beta": (b - c) / math.sqrt(3.0)}
    raise BadInput(
        f"{file}: {lacking(found, VOLTAGES, 'voltage') or 'no commanded voltages'}; map u_alpha "
        "and u_beta, or u_a, u_b and u_c, or u_d and u_q, or duties d_a, d_b and d_c"
    )


def _check_duties(file: str, duties: Mapping[str, Array]) -> None:
    for name, d in duties.items():
        bad = np.flatnonzero((d < -0.01) | (d > 1.01))
        if bad.size:
            k = int(bad[0])
            raise BadInput(
                f"{file}: row {k} of column '{name}' is {d[k]:g}, a duty lies in [0, 1]; "
                "give it as a share, or map "
                "it with "
                'unit = "%"'
            )


def _stationary(file: str, found: Mapping[str, Array], x: str, y: str) -> tuple[Array, Array]:
    if "theta" not in found:
        raise BadInput(
            f"{file}: {x} and {y} need theta to be turned into the stator frame; map theta"
        )
    c, s = np.cos(found["theta"]), np.sin(found["theta"])
    return c * found[x] - s * found[y], s * found[x] + c * found[y]
