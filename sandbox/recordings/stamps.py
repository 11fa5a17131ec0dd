"""Time stamps as loggers write them: gaps at which a recording is cut, rows that came late, values
that were polled.

`[log] stamps` says what a stamp is:

    "drive"    the drive's own clock, or near it; rows up to a quarter of a period off are put on its grid (usual)
    "arrival"  rows are the drive's samples without loss, stamps are when they arrived (USB, serial,
    CAN)
    "polled"   values were asked for at uneven instants: interpolated onto the drive's grid, the stamps' scatter
               taken as noise
"""  # noqa: E501

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.errors import BadInput, as_toml, brief, unknown
from model.number_table import Table
from sandbox.recordings.findings import Finding

Columns = Mapping[str, Array]
STAMPS = ("drive", "arrival", "polled")
KEYS = ("stamps", "matrix")
SHORTEST = 64  # rows of a segment that is kept
MOST_SEGMENTS = 12  # of one recording, the longest
GAP = 1.5  # of the sampling period: a step beyond it is a gap
JITTER = 0.25  # of the sampling period: beyond it a row may be another sample
AROUND = 8  # rows before and after a step that show whether the clock goes on beside the even one
MOST_OFF = 1000  # steps that are no period, of which each is looked at
LOST = 0.75  # of the period: a lasting shift of late rows that is a lost sample
BACK = 8.0  # of the period: a clock that jumps back so far begins again
SPAN = 50  # rows over which the earliest arrival tells the clock


@dataclass(frozen=True)
class Log:
    """What `[log]` says of the files: what stamps are, and the names of the columns of matrices."""

    stamps: str = "drive"
    matrix: Mapping[str, Sequence[str]] = field(default_factory=dict)


def parse_log(table: Mapping[str, Any], source: str) -> Log:
    """Return the [log] table; BadInput names the key that is wrong."""
    for key in table:
        if key not in KEYS:
            raise BadInput(f"{source}: {unknown('key in [log]', key, KEYS)}")
    stamps, matrix = table.get("stamps", "drive"), table.get("matrix", {})
    if stamps not in STAMPS:
        raise BadInput(f"{source}: {unknown('[log] stamps', brief(stamps), STAMPS)}")
    good = isinstance(matrix, dict) and all(
        isinstance(v, list) and v and all(isinstance(x, str) for x in v) for v in matrix.values()
    )
    if not good:
        raise BadInput(
            f'{source}: [log] matrix = {as_toml(matrix)}; write matrix = {{data = ["t", '
            f'"i_a", ...]}}'
        )
    return Log(stamps, matrix)


def cut_at_gaps(
    file: str, columns: Columns, period: float
) -> tuple[list[tuple[str, dict[str, Array]]], list[Finding]]:
    """Return the pieces of a recording between gaps of its stamps (s), named run-1.csv, run-2.csv,
    ..., and a finding.

    A gap is a step of more than GAP periods, and one after which the clock goes on beside the even
    one (a drive that paused for no whole number of periods).  Their stamps count from the
    recording's beginning.  A recording without a gap, or whose clock is wrong in other ways, is
    returned as it is.  BadInput where no piece has SHORTEST rows.
    """
    t = columns.get("t")
    if t is None or len(t) < 2:
        return [(file, dict(columns))], []
    step = np.diff(t)
    usual = float(np.median(step))
    if np.any(step <= 0.0) or not 0.6 < usual / period < 1.4:
        return [(file, dict(columns))], []
    gaps = np.flatnonzero((step > GAP * max(period, usual)) | _moves_for_good(t, usual))
    if not gaps.size:
        return [(file, dict(columns))], []
    bounds = np.concatenate([[0], gaps + 1, [len(t)]])
    lengths = np.diff(bounds)
    kept = sorted(np.argsort(-lengths, kind="stable")[:MOST_SEGMENTS])
    kept = [int(k) for k in kept if lengths[k] >= SHORTEST]
    longest = int(gaps[np.argmax(step[gaps])])
    missing = round(float(np.sum(step[gaps] / period - 1.0)))
    many = "a gap" if gaps.size == 1 else f"{gaps.size} gaps"
    whole = step[longest] > GAP * max(period, usual)
    lost = (
        f"about {missing} samples are missing" if whole else "the clock goes on beside the even one"
    )
    said = (
        f"{file}: {many} in column 't', the longest {step[longest]:.4g} s after row "
        f"{longest}; {lost}"
    )
    if not kept:
        raise BadInput(
            f"{said} and no stretch without a gap has {SHORTEST} rows; log fewer signals, a faster "
            "link, or store in the drive and read out afterwards"
        )
    pieces = []
    for number, k in enumerate(kept, 1):
        part = slice(int(bounds[k]), int(bounds[k + 1]))
        own = {n: x[part] for n, x in columns.items()}
        own["t"] = own["t"] - t[0]
        pieces.append((segment_name(file, number), own))
    rows = len(t) - sum(len(c["t"]) for _, c in pieces)
    left = f", {rows} rows in shorter stretches left out" if rows else ""
    text = f"{said}; it becomes {len(pieces)} recordings, {pieces[0][0]} to {pieces[-1][0]}{left}"
    if len(pieces) == 1:
        text = f"{said}; the longest stretch is {pieces[0][0]}{left}"
    return pieces, [Finding(file, "t", longest, text)]


def _moves_for_good(t: Array, period: float) -> NDArray[np.bool_]:
    """Return for each step of stamps t (s) whether it moves the clock by more than JITTER of a
    period, for good: a row that was stamped late comes back."""
    off = t - np.arange(len(t)) * period
    at = np.flatnonzero(np.abs(np.diff(off)) > JITTER * period)
    out = np.zeros(len(t) - 1, dtype=np.bool_)
    for k in at if len(at) <= MOST_OFF else ():
        before, after = off[max(k - AROUND + 1, 0) : k + 1], off[k + 1 : k + 1 + AROUND]
        out[k] = abs(float(np.median(after) - np.median(before))) > JITTER * period
    return out


def cut_where_begun_again(
    file: str, table: Table, t: Array | None, period: float
) -> tuple[list[tuple[str, int, Table]], list[Finding]]:
    """Return the pieces of a table in which several logs follow each other, and a finding; one that
    goes on is whole.

    t: stamps (s) of its rows.  Of each piece its name, its first row and its table.  Without stamps
    a log begins where the header stood again; with them, where the clock does not go on there, and
    wherever it jumps back.  The longest MOST_SEGMENTS are kept.  BadInput where no piece has
    SHORTEST rows.
    """
    length = max((len(x) for x in table.columns.values()), default=0)
    begun = [k for k in table.breaks if 0 < k < length]
    if t is not None:
        step = np.diff(t)
        begun = [k for k in begun if not 0.0 < step[k - 1] < GAP * period]
        begun = sorted({*begun, *(int(k) + 1 for k in np.flatnonzero(step < -BACK * period))})
    if not begun:
        return [(file, 0, table)], []
    bounds = [(a, b) for a, b in itertools.pairwise([0, *begun, length]) if b - a >= SHORTEST]
    if not bounds:
        raise BadInput(
            f"{file}: the log begins again in row {begun[0]}, and no stretch has "
            f"{SHORTEST} rows; log longer"
        )
    bounds = sorted(sorted(bounds, key=lambda x: x[0] - x[1])[:MOST_SEGMENTS])
    pieces = [
        (segment_name(file, k), a, rows_of(table, np.arange(a, b)))
        for k, (a, b) in enumerate(bounds, 1)
    ]
    left = length - sum(b - a for a, b in bounds)
    less = f", the longest of {len(begun) + 1}; {left} rows are left out" if left else ""
    often = f" ({len(begun)} times)" if len(begun) > 1 else ""
    became = f"{len(pieces)} recordings" if len(pieces) > 1 else "one recording"
    text = f"{file}: the log begins again in row {begun[0]}{often}; it becomes {became}{less}"
    return pieces, [Finding(file, "t", begun[0], text)]


def rows_of(table: Table, rows: NDArray[np.int64]) -> Table:
    """Return some rows of a table, counted from 0."""
    own = slice(int(rows[0]), int(rows[-1]) + 1) if len(rows) == rows[-1] - rows[0] + 1 else rows
    columns = {n: x[own] for n, x in table.columns.items()}
    place = {int(k): n for n, k in enumerate(rows)} if table.odd else {}
    odd = {(n, place[k]): cell for (n, k), cell in table.odd.items() if k in place}
    return replace(table, columns=columns, odd=odd, breaks=())


def segment_name(file: str, number: int) -> str:
    """Return the name of a piece of a file: run.csv, 2 -> run-2.csv."""
    path = PurePosixPath(file)
    return str(path.with_name(f"{path.stem}-{number}{path.suffix}"))


def by_arrival(file: str, t: Array, period: float) -> tuple[Array, Finding]:
    """Return the drive's own instants (s) of rows that were stamped on arrival; BadInput where a
    sample seems lost.

    Arrivals scatter to the late side only, so the earliest of SPAN rows tell the clock; where they
    shift by LOST of a period and stay there, a sample is missing.
    """
    n = len(t)
    place = np.arange(n, dtype=np.float64)
    drift, start = np.polyfit(place, t - t[0] - place * period, 1)
    if abs(drift) > 0.01 * period:
        raise BadInput(
            f"{file}: rows arrive every {period + drift:.6g} s, sampling_period is {period:.6g} s "
            "(1 % at most); correct [drive] sampling_period, or log without loss"
        )
    off = t - t[0] - place * period - start - drift * place
    early = np.array([off[k : k + SPAN].min() for k in range(0, max(n - SPAN, 1), SPAN)])
    early -= (
        np.polyval(np.polyfit(np.arange(len(early)), early, 1), np.arange(len(early)))
        if len(early) > 4
        else 0.0
    )
    if np.ptp(early) > LOST * period:
        k = SPAN * int(np.argmax(np.abs(np.diff(early))) + 1) if len(early) > 1 else 0
        raise BadInput(
            f"{file}: rows near {k} of column 't' arrive {np.ptp(early):.3g} s off an "
            "even clock and stay so, a sample "
            f"({period:.3g} s) seems lost; log without loss, or with the drive's own stamps"
        )
    text = (
        f"{file}: stamps of arrival scatter by {float(np.std(off)):.3g} s rms about an even clock; "
        f"rows are taken as the drive's samples, {period:.6g} s apart, values unchanged"
    )
    return place * period, Finding(file, "t", None, text)


def polled(
    file: str, columns: Columns, period: float, jitter: float
) -> tuple[dict[str, Array], float, Finding]:
    """Return columns interpolated onto an even grid, the noise (A rms) that the stamps' scatter
    adds, and a finding.

    jitter: s rms of the stamps (see `stamp_jitter`).
    """
    t = columns["t"]
    step = np.diff(t)
    if np.any(step <= 0.0):
        k = int(np.argmax(step <= 0.0))
        raise BadInput(
            f"{file}: row {k + 1} of column 't' is {t[k + 1]:.9g}, not after row {k}; "
            "give each sample once"
        )
    grid = t[0] + np.arange(math.floor((t[-1] - t[0]) / period) + 1) * period
    out = {n: np.interp(grid, t, x) for n, x in columns.items()}
    out["t"] = grid - grid[0]
    slope = max(
        (
            float(np.median(np.abs(np.diff(columns[n]) / step)))
            for n in ("i_a", "i_b", "i_c")
            if n in columns
        ),
        default=0.0,
    )
    noise = 1.5 * slope * jitter
    text = (
        f"{file}: {len(t)} polled rows, {np.min(step):.3g} to {np.max(step):.3g} s apart, are "
        f"interpolated onto a grid of {period:.6g} s; stamps scatter by {jitter:.2g} s rms, which "
        f"adds {noise:.2g} A rms of noise; what happens within {2.0 * float(np.median(step)):.2g} "
        "s is not seen"
    )
    return out, noise, Finding(file, "t", None, text)


def stamp_jitter(t: Array, angle: Array, count: float) -> float:
    """Return the scatter (s rms) of stamps t (s) that an angle (rad) shows which moves smoothly, 0
    where it stands.

    Each reading against the cubic through its four neighbours: what is left beyond the encoder's
    count (rad) is speed times the scatter.  An upper bound: a real jerk counts as scatter.
    """
    if len(t) < 9 or np.any(np.diff(t) <= 0.0):
        return 0.0
    x = np.stack([t[k : len(t) - 4 + k] for k in (0, 1, 3, 4)]) - t[2:-2]
    weights = np.stack(
        [np.prod([-x[m] / (x[j] - x[m]) for m in range(4) if m != j], axis=0) for j in range(4)]
    )
    y = np.stack([angle[k : len(t) - 4 + k] for k in (0, 1, 3, 4)])
    rest = (angle[2:-2] - np.sum(weights * y, axis=0)) / np.sqrt(1.0 + np.sum(weights**2, axis=0))
    speed = np.abs((y[3] - y[0]) / (x[3] - x[0]))
    fast = speed >= np.median(speed)
    usual = float(np.median(speed[fast]))
    if usual <= 0.0:
        return 0.0
    spread = float(np.median(np.abs(rest[fast]))) / 0.6745
    return math.sqrt(max(spread**2 - count**2 / 12.0, 0.0)) / usual
