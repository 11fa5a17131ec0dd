"""Kinds of values in kernels, and how C holds them: numbers, records, tuples, rows of numbers.

A batch has one lane here: a row of one number is a plain field of the record, and the lane's index
is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

REAL, INT, NOTHING = "real", "int32_t", "void"
LANE = "lane"  # of a shape: the place of the only lane, which is not indexed


@dataclass(frozen=True)
class Absent:
    """What is None, such as the flux map of a motor with a quartic."""


@dataclass(frozen=True)
class Lane:
    """The index of the only lane."""


@dataclass(frozen=True)
class Rows:
    """Numbers in a row behind a pointer; shape of what is left to index, whole numbers or LANE."""

    shape: tuple[int | str, ...]
    whole: bool = False
    fixed: bool = False  # only read

    @property
    def of(self) -> str:
        """The numbers' kind."""
        return INT if self.whole else REAL

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return prod(int(n) for n in self.shape if n != LANE)

    @property
    def stride(self) -> int:
        """How many numbers one step of the first index is."""
        return prod(int(n) for n in self.shape[1:] if n != LANE)


@dataclass(frozen=True)
class Record:
    """A structure: behind a pointer where it is a batch or only read, else by value."""

    name: str
    fields: tuple[tuple[str, Kind], ...]
    pointed: bool = False
    fixed: bool = False  # only read
    defaults: tuple[float, ...] = ()  # of the last fields

    def field(self, name: str) -> Kind:
        """Return the kind of a field."""
        return dict(self.fields)[name]


@dataclass(frozen=True)
class Several:
    """A tuple."""

    parts: tuple[Kind, ...]

    @property
    def name(self) -> str:
        """How C calls it: by its parts."""
        return "tuple_" + "".join(_letter(part) for part in self.parts)


Kind = str | Absent | Lane | Rows | Record | Several


def _letter(kind: Kind) -> str:
    if isinstance(kind, Several):
        return f"_{kind.name.removeprefix('tuple_')}_"
    return {REAL: "r", INT: "i"}[str(kind)]


def declared(kind: Kind, name: str) -> str:
    """Return the declaration of a variable or parameter of a kind."""
    if isinstance(kind, Rows):
        return f"{'const ' if kind.fixed else ''}{kind.of} *{name}"
    if isinstance(kind, Record):
        of = f"{'const ' if kind.fixed else ''}{kind.name}"
        return f"{of} *{name}" if kind.pointed else f"{of} {name}"
    return f"{kind.name if isinstance(kind, Several) else kind} {name}"


def zero(kind: Kind) -> str:
    """Return what a variable begins with."""
    if isinstance(kind, Rows) or (isinstance(kind, Record) and kind.pointed):
        return "0"
    if isinstance(kind, (Record, Several)):
        return "{0}"
    return "0" if kind == INT else "R(0.0)"


def passed(kind: Kind) -> bool:
    """Return whether C knows values of a kind: what is absent, and the only lane, are left out."""
    return not isinstance(kind, (Absent, Lane))


def structure(kind: Several) -> str:
    """Return the type definition of a tuple."""
    fields = " ".join(f"{declared(part, f'_{k}')};" for k, part in enumerate(kind.parts))
    return f"typedef struct {{ {fields} }} {kind.name};"


def joined(a: Kind, b: Kind) -> Kind:
    """Return the kind of a variable that is given values of both."""
    if a == b:
        return a
    if isinstance(a, Several) and isinstance(b, Several):
        return Several(tuple(joined(x, y) for x, y in zip(a.parts, b.parts, strict=True)))
    assert {a, b} == {REAL, INT}, f"a variable is both {a} and {b}"
    return REAL
