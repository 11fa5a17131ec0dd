"""Cells of a log without a number: single ones of a reading, which the rows beside tell.

A transfer that loses a word leaves an empty cell.  A reading goes on from row to row, so its
neighbours tell it; a command may be anything, so nothing stands in for it.  Of a current
`sandbox.recordings.rows.disturbed` works out what the command did to it in that row.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.number_table import Table
from sandbox.recordings.findings import Doubt, Finding

NOTHING = (
    "",
    "-",
    "--",
    "nan",
    "na",
    "n/a",
    "#n/a",
    "null",
    "none",
)  # cells that say there is none
LONGEST = 3  # rows one after the other
MOST = 0.06  # of the rows, as of readings that were disturbed


def gone(table: Table, column: str, raw: Array) -> NDArray[np.bool_] | None:
    """Return which rows of a reading are empty; None where none is, or where the rows beside do not
    tell them: too many, too long, at an end, or another text."""
    rows = np.isnan(raw)
    if not np.any(rows) or rows[0] or rows[-1] or np.mean(rows) > MOST:
        return None
    if table.odd.get((column, int(np.argmax(rows))), "").strip().casefold() not in NOTHING:
        return None
    ends = np.flatnonzero(np.diff(rows.astype(np.int8)))
    return rows if int(np.max(np.diff(ends)[::2])) <= LONGEST else None


def filled(raw: Array, rows: NDArray[np.bool_], turn: float) -> Array:
    """Return readings with empty ones on a straight line between those beside; turn: of an angle,
    which goes the short way (0: of none)."""
    out, own = raw.copy(), raw[~rows]
    line = np.unwrap(own, period=turn) if turn else own
    there = np.interp(np.flatnonzero(rows), np.flatnonzero(~rows), line)
    if turn and np.ptp(own) <= turn:
        low = float(np.min(own))
        there = low + np.mod(there - low, turn)
    out[rows] = there
    return out


def finding_of(
    file: str, name: str, column: str, rows: NDArray[np.bool_], current: bool
) -> Finding:
    """Return what is said of empty cells."""
    k, count = int(np.argmax(rows)), int(np.count_nonzero(rows))
    so = "what that misses counts as noise" if current else "on a straight line"
    return Doubt(
        file,
        name,
        k,
        f"{file}: row {k} of column '{column}' is empty ({count} of {len(rows)} rows): what the "
        f"rows beside tell stands in, {so}; record every sample",
    )
