"""A measured table of an inverter's voltage error: what a leg loses (V) against its current (A).

In a drive's or campaign's file, points or a file beside it:

    [drive]
    inverter_table = [[0.0, 0.0], [0.2, 2.4], [0.5, 4.4], [1.0, 5.3], [4.5, 6.2]]
    inverter_table = "inverter.csv"     # two columns, current (A) and voltage error (V); a line of names may come first

The error is odd and goes straight from point to point, constant beyond the last.  A file may hold
both signs of the current: half the difference of both is taken.  It acts beside dead time and
device drop: a table
that holds what these lose stands in their place, and they are then what the drive has beyond its
table.
"""  # noqa: E501

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput, as_toml
from model.given import given_bytes
from model.names import check_file

MOST_POINTS = 64
MOST_BYTES = 1_000_000  # of its file
Points = tuple[tuple[float, float], ...]
KEY = "[drive] inverter_table"


def with_points(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return [drive] with the points of the file that it names, if it names one; folder: of the
    file it stands in."""
    if not isinstance(values.get("inverter_table"), str):
        return dict(values)
    return {
        **values,
        "inverter_table": read_points(folder / check_file(values["inverter_table"], KEY)),
    }


def read_points(path: Path) -> Points:
    """Return the points of a CSV file, odd part of what both signs of the current say; BadInput
    says what is wrong."""
    content = given_bytes(path, MOST_BYTES, f"give a CSV file of two columns as {KEY}")
    try:
        lines = io.StringIO(content.decode("utf-8-sig"), newline="")
        rows = [row for row in csv.reader(lines) if any(cell.strip() for cell in row)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise BadInput(
            f"{KEY}: '{path.name}' cannot be read ({error}); give a CSV file of two columns"
        ) from None
    numbers = [_numbers(row) for row in rows]
    body = numbers[1:] if numbers and numbers[0] is None else numbers
    for k, row in enumerate(body):
        if row is None:
            line = k + 1 + len(numbers) - len(body)
            raise BadInput(
                f"{KEY}: line {line} of '{path.name}' is no pair of numbers; give "
                "current (A), error (V)"
            )
    if not body:
        raise BadInput(
            f"{KEY}: '{path.name}' holds no numbers; give current (A) and voltage error (V) a line"
        )
    table = np.array(body, dtype=float)
    return checked(table if table[0, 0] >= 0.0 else _odd(table, path.name))


def _numbers(row: list[str]) -> tuple[float, float] | None:
    try:
        one, other = (float(cell) for cell in row)
    except ValueError:
        return None
    return one, other


def _odd(table: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Return the odd part of a table that has both signs of the current, from 0 up."""
    i, v = table.T
    if not (np.isfinite(table).all() and np.all(np.diff(i) > 0.0)):
        raise BadInput(
            f"{KEY}: currents in '{name}' do not rise, or are no numbers; sort and clean its lines"
        )
    reach = min(-i[0], i[-1])
    sizes = np.unique(np.abs(i))
    sizes = np.append(0.0, sizes[(sizes > 0.0) & (sizes <= reach)])
    return np.stack([sizes, 0.5 * (np.interp(sizes, i, v) - np.interp(-sizes, i, v))], axis=1)


def checked(points: Any) -> Points:
    """Return points as pairs of numbers; BadInput unless they begin at 0 A with 0 V, rise in
    current and are few."""
    try:
        table = np.array(points, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(
            f"{KEY} = {as_toml(points)} is no list of pairs; give [[0, 0], [A, V], ...] or a file"
        ) from None
    if table.ndim != 2 or table.shape[1] != 2 or not 2 <= len(table) <= MOST_POINTS:
        raise BadInput(
            f"{KEY} holds {table.shape} numbers; give 2 to {MOST_POINTS} pairs of "
            "current and voltage error"
        )
    if not (
        np.isfinite(table).all()
        and np.all(np.diff(table[:, 0]) > 0.0)
        and np.abs(table).max() < 1e5
    ):
        raise BadInput(
            f"{KEY} has currents that do not rise, or values that are no finite A and V; "
            "sort and clean it"
        )
    if table[0, 0] != 0.0 or table[0, 1] != 0.0:
        raise BadInput(
            f"{KEY} begins with {table[0, 1]:g} V at {table[0, 0]:g} A; it is odd: begin "
            "it with 0 V at 0 A"
        )
    return tuple((float(i), float(v)) for i, v in table)
