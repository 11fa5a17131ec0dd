"""Stamps of a motion's log: rows that repeat a stamp, pauses, and a clock that jumps or begins
again.

A row whose stamp belongs nowhere is left out; where the clock goes on from another time the log is
cut, as at a pause.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.errors import BadInput
from sandbox.recordings.findings import Doubt, Finding
from sandbox.recordings.stamps import SHORTEST

Rows = NDArray[np.int64]
PAUSE = 8.0  # times the usual step: a gap at which the motion is cut
ALONE = 3  # rows: fewer between two jumps of the clock are stamped wrong
MOST_LOST = 0.5  # of the rows that may repeat a stamp: beyond it the clock has too few digits


def stretches(file: str, t: Array, findings: list[Finding]) -> list[Rows]:
    """Return the rows of each stretch in which stamps t (s) rise without a pause, each of SHORTEST
    rows at least.

    What is left out or cut is added to the findings; BadInput where no stretch is left.
    """
    step = np.diff(t)
    forward = step[step > 0.0]
    if len(forward) < SHORTEST - 1:
        raise BadInput(
            f"{file}: {len(forward) + 1} rows with rising stamps; a motion needs at "
            f"least {SHORTEST}"
        )
    usual = float(np.median(forward))
    chains, strays = _chains(t, PAUSE * usual)
    kept = [rows[_rising(t[rows])] for rows in chains]
    repeated = sum(map(len, chains)) - sum(map(len, kept))
    if repeated > MOST_LOST * len(t):
        raise BadInput(
            f"{file}: {repeated} of {len(t)} rows repeat a stamp of column 't' or go back; give it "
            "enough digits (rows that differ are at different times), and each row once"
        )
    if repeated:
        k = int(np.argmax(step <= 0.0)) + 1
        kind = Doubt if repeated > 0.05 * len(t) else Finding
        text = f"{file}: {repeated} of {len(t)} rows repeat a stamp or go back; left out"
        findings.append(kind(file, "t", k, text))
    good = [rows for rows in kept if len(rows) >= SHORTEST]
    if not good:
        raise BadInput(
            f"{file}: no stretch of {SHORTEST} rows without a pause in column 't'; log "
            "with fewer pauses"
        )
    _say_cuts(file, t, kept, good, strays, findings)
    return good


def _chains(t: Array, pause: float) -> tuple[list[Rows], Rows]:
    """Return the rows between jumps of the clock, joined again over rows that are stamped wrong,
    and those rows."""
    breaks = np.flatnonzero(np.abs(np.diff(t)) > pause) + 1
    chains: list[list[Rows]] = []
    strays: list[Rows] = []
    bounds = [0, *breaks.tolist(), len(t)]
    for rows in (np.arange(a, b) for a, b in itertools.pairwise(bounds)):
        before = chains[-1][-1] if chains else None
        if before is not None and abs(t[rows[0]] - t[before[-1]]) <= pause:
            chains[-1].append(rows)
        elif len(rows) < ALONE:
            strays.append(rows)
        else:
            chains.append([rows])
    none = np.zeros(0, dtype=np.int64)
    return [np.concatenate(c) for c in chains], np.concatenate([none, *strays])


def _rising(t: Array) -> NDArray[np.bool_]:
    """Return which stamps are later than all before them."""
    return np.concatenate([[True], np.diff(np.maximum.accumulate(t)) > 0.0])


def _say_cuts(
    file: str, t: Array, kept: list[Rows], good: list[Rows], strays: Rows, findings: list[Finding]
) -> None:
    """Add what was cut, and where the clock jumped."""
    if strays.size:
        k = int(strays[0])
        text = (
            f"{file}: row {k} of column 't' is {t[k]:.9g} s between rows of {t[max(k - 1, 0)]:.9g} "
            f"and {t[min(k + 1, len(t) - 1)]:.9g} s ({strays.size} such rows); stamps that belong "
            "nowhere are left out"
        )
        findings.append(Doubt(file, "t", k, text))
    if len(kept) < 2:
        return
    gaps = [(float(t[b[0]] - t[a[-1]]), int(b[0])) for a, b in itertools.pairwise(kept)]
    lost = sum(map(len, kept)) - sum(map(len, good))
    cut = f"cut into {len(good)} stretches, {lost} of {len(t)} rows in shorter ones left out"
    back = [k for gap, k in gaps if gap < 0.0]
    if back:
        text = (
            f"{file}: row {back[0]} of column 't' is {t[back[0]]:.9g} s, before the row above it: "
            f"the clock begins again ({len(back)} times); {cut}"
        )
        findings.append(Doubt(file, "t", back[0], text))
        return
    longest, k = max(gaps)
    pauses = "a pause" if len(gaps) == 1 else f"{len(gaps)} pauses"
    findings.append(
        Finding(file, "t", k, f"{file}: {pauses} in column 't', the longest {longest:.3g} s; {cut}")
    )
