"""Rows that stand in two recordings: exported twice, or one log under two names.  They are counted
once.

Rows are compared as they were read, window by window: sensors' noise makes no two stretches alike.
One log that was written twice with other digits differs by half of the last one at most, in every
row; noise makes two runs differ by more in many.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.findings import Doubt, Finding

Hashes = NDArray[np.uint64]
WINDOW = 64  # rows that must be the same, one after the other
PROBED = 16  # windows: every so many is looked for
DIFFERENT = 32  # of them that differ from the row before: a signal at rest is alike everywhere
SHORTEST = 64  # rows of a remainder that is kept
# odd, from the golden ratio: spreads bits (Knuth, multiplicative hashing)
MIX = np.uint64(0x9E3779B97F4A7C15)
SINGLE, EXACT = 1e-6, 1e-12  # relative: digits of single precision, and of double
SEEN = ("i_a", "i_b", "i_c", "theta")  # what sensors read


@dataclass(frozen=True)
class Copied:
    """Rows first ... end of recording `at` that stand in recording `of` from row `begins` on."""

    at: int
    of: int
    first: int
    end: int
    begins: int


def copied(signals: Sequence[Sequence[Array]]) -> list[Copied]:
    """Return, for each recording (its signals, (n,) each), the longest stretch that an earlier one
    holds, too."""
    windows = [_windows(_hashes(one)) for one in signals]
    order = [np.argsort(own) for own, _ in windows]
    out = []
    for at, (own, varied) in enumerate(windows):
        rows = np.flatnonzero(varied)[::PROBED]
        best: Copied | None = None
        for of, (other, _) in enumerate(windows[:at]):
            if not len(other):
                continue
            there = order[of][
                np.minimum(np.searchsorted(other, own[rows], sorter=order[of]), len(other) - 1)
            ]
            hit = other[there] == own[rows]
            if np.any(hit):
                shift = int(np.median((there - rows)[hit]))
                same = rows[hit & (there - rows == shift)]
                if same.size and (best is None or same[-1] - same[0] > best.end - best.first):
                    first, end = int(same[0]), int(same[-1]) + WINDOW
                    best = _grown(
                        signals[at], signals[of], Copied(at, of, first, end, first + shift)
                    )
        again = [k for k in range(at) if best is None and _written_again(signals[at], signals[k])]
        if again:
            best = Copied(at, again[0], 0, len(signals[at][0]), 0)
        if best is not None:
            out.append(best)
    return out


def _written_again(own: Sequence[Array], other: Sequence[Array]) -> bool:
    """Tell whether all signals are those of another recording but for the digits they are written
    with."""
    if len(own[0]) != len(other[0]) or len(own[0]) < WINDOW:
        return False
    some = max(len(np.unique(x)) for x in own) >= DIFFERENT
    pairs = zip(own, other, strict=True)
    return some and all(
        float(np.max(np.abs(x - y))) <= max(_half_digit(x), _half_digit(y)) for x, y in pairs
    )


def _half_digit(x: Array) -> float:
    """Return half of the last decimal place that a signal is written with, of seven digits where it
    has more."""
    largest = float(np.max(np.abs(x)))
    for places in range(7):
        scaled = x * 10.0**places
        if (
            float(np.max(np.abs(scaled - np.rint(scaled))))
            <= EXACT * max(largest, 1.0) * 10.0**places
        ):
            return 0.5 * 10.0**-places * (1.0 + SINGLE)
    return SINGLE * largest


def _hashes(signals: Sequence[Array]) -> Hashes:
    """Return a number for each row, equal where all signals are."""
    total = np.zeros(len(signals[0]), dtype=np.uint64)
    with np.errstate(over="ignore"):
        for x in signals:
            total = (total ^ np.ascontiguousarray(x + 0.0, dtype=np.float64).view(np.uint64)) * MIX
            total ^= total >> np.uint64(29)
    return total


def _windows(rows: Hashes) -> tuple[Hashes, NDArray[np.bool_]]:
    """Return a number for each window of rows, and which windows hold enough different rows."""
    if len(rows) < WINDOW:
        return np.zeros(0, dtype=np.uint64), np.zeros(0, dtype=bool)
    with np.errstate(over="ignore"):
        sums = np.concatenate([np.zeros(1, dtype=np.uint64), np.cumsum(rows, dtype=np.uint64)])
        moves = np.concatenate([[0], np.cumsum(np.concatenate([[0], rows[1:] != rows[:-1]]))])
        return sums[WINDOW:] - sums[:-WINDOW], moves[WINDOW:] - moves[:-WINDOW] >= DIFFERENT


def _grown(own: Sequence[Array], other: Sequence[Array], found: Copied) -> Copied:
    """Return a stretch with the rows at rest beside it that are the same, too; cut where a row
    differs."""
    shift = found.begins - found.first
    low, high = max(0, -shift), min(len(own[0]), len(other[0]) - shift)
    same = np.all(
        [x[low:high] == y[low + shift : high + shift] for x, y in zip(own, other, strict=True)],
        axis=0,
    )
    middle = (found.first + found.end) // 2 - low
    before, after = np.flatnonzero(~same[:middle]), np.flatnonzero(~same[middle:])
    first = low + (int(before[-1]) + 1 if before.size else 0)
    end = low + (middle + int(after[0]) if after.size else len(same))
    return Copied(found.at, found.of, first, end, first + shift)


def counted_once(campaign: Campaign) -> Campaign:
    """Return a campaign without rows that stand in two recordings; a finding says which."""
    found = copied([[r.columns[n] for n in SEEN] for r in campaign.recordings])
    if not found:
        return campaign
    copies, recordings, findings = {c.at: c for c in found}, [], list(campaign.findings)
    for k, r in enumerate(campaign.recordings):
        if k not in copies:
            recordings.append(r)
            continue
        keep = own_rows(copies[k], len(r.t))
        findings.append(
            copy_finding(r.file, campaign.recordings[copies[k].of].file, copies[k], len(r.t))
        )
        if keep is not None:
            recordings.append(_part(r, keep))
    return dataclasses.replace(campaign, recordings=tuple(recordings), findings=tuple(findings))


def own_rows(c: Copied, rows: int) -> slice | None:
    """Return the longer stretch of a recording that is no copy, None where it is too short."""
    keep = max((slice(0, c.first), slice(c.end, rows)), key=lambda s: s.stop - s.start)
    return keep if keep.stop - keep.start >= SHORTEST else None


def copy_finding(file: str, of: str, c: Copied, rows: int) -> Finding:
    """Return the finding on a copy."""
    keep = own_rows(c, rows)
    kept = 0 if keep is None else keep.stop - keep.start
    what = "all rows are" if c.end - c.first == rows else f"rows {c.first} to {c.end - 1} are"
    then = f"its {kept} other rows are used" if kept else "it is left out"
    text = (
        f"{file}: {what} those of {of} (from row {c.begins}): the same recording twice tells "
        f"nothing more; {then}"
    )
    return Doubt(file, "", c.first, text)


def _part(r: CampaignRecording, keep: slice) -> CampaignRecording:
    t = r.t[keep]
    columns = {n: x[keep] for n, x in r.columns.items()} | {"t": t - t[0]}
    return dataclasses.replace(r, columns=columns, of=r.origin, starts_at=r.starts_at + float(t[0]))
