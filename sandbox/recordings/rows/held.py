"""Readings that stand still over some rows and then jump: a sensor, or the path to the log, that is
slower than the rows.

Such a reading is up to so many rows old less one.  Readings that move by counts stand still, too,
but move by one count then; a level that is held moves at no even distance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from model.array_types import Array
from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import PHASES, VOLTAGES, balance
from sandbox.recordings.findings import Finding, Refused

LEAST = 16  # changes that tell
COUNTS = 3.0  # times the smallest step: more than readings of counts move by at once
OFTEN, RARELY = 0.8, 0.1  # of the changes: an even distance, one row apart
ROUNDING = 1e-6  # relative, of the largest change
WORTH = 0.02  # of the voltage: commands that stand still explain it better, where less is open
PARTS = (*PHASES, "theta", *VOLTAGES)


class HeldReadings(Finding):
    """A finding on readings that are older than their rows: what else they contradict follows of
    it."""


def held_over(x: Array) -> int:
    """Return over how many rows readings (n,) stand still between two changes, 1 where they do
    not."""
    step = np.diff(x)
    changed = np.flatnonzero(step)
    if len(changed) < LEAST:
        return 1
    size, apart = np.abs(step[changed]), np.diff(changed)
    rows = round(float(np.median(apart)))
    even = np.mean(np.abs(apart - rows) <= 1) >= OFTEN
    large = np.mean(size > COUNTS * _count(size)) >= 0.5
    return rows if rows > 1 and even and large and np.mean(apart == 1) <= RARELY else 1


def _count(size: Array) -> float:
    """Return the least of which changes, and what they differ by, are made."""
    every = np.unique(size)
    apart = np.diff(every)
    return float(min(every[0], np.min(apart[apart > ROUNDING * every[-1]], initial=np.inf)))


def held(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return a finding for columns of a recording that are held over some rows, one for all that
    are held alike; of commands where more than WORTH of the voltage is unexplained.

    BadInput where phases are not read in the same rows, or the voltage is so far unexplained that
    units and signs cannot be told.
    """
    rows = {n: held_over(r.columns[n]) for n in PARTS if n in r.columns}
    if all(n == 1 for n in rows.values()):
        return []
    fine = balance(r.columns, drive, 1)
    if fine.share <= WORTH + fine.noise:
        rows = {n: x for n, x in rows.items() if n not in VOLTAGES}
    turned = float(np.max(np.abs(np.diff(r.theta))))
    found = finding_of(r.file, rows, r.source, float(np.median(np.diff(r.t))), turned)
    apart = len({rows[n] for n in PHASES}) > 1
    if found and (apart or balance(r.columns, drive).doubtful):
        raise Refused(found[0])
    return found


def finding_of(
    file: str,
    rows: Mapping[str, int],
    source: Mapping[str, str],
    step: float,
    turned: float,
    *,
    even: bool = True,
) -> list[Finding]:
    """Return a finding for each number of rows over which columns are held.

    rows: by standard name; source: the log's own names; step: s from row to row; turned: rad by
    which the angle jumps at the most; even: whether rows have a sampling period.
    """
    out = list[Finding]()
    for many in sorted({n for n in rows.values() if n > 1}):
        names = [n for n, own in rows.items() if own == many]
        said = ", ".join(f"'{source.get(n, n)}'" for n in names)
        several, old = len(names) > 1, f"{many - 1} row{'s' * (many > 2)}"
        behind = f" and {math.degrees(turned):.2g} degrees behind" if "theta" in names else ""
        what = f"a reading is up to {old} ({(many - 1) * step:.3g} s) old{behind}"
        remedy = f"log a fresh reading in each row, or keep one row of {many}, in which it is fresh"
        if even:
            remedy += f", with sampling_period = {many * step:.4g} and pwm_frequency as it is"
        if set(names) <= set(VOLTAGES):
            what, remedy = "the voltage did not", "log the command of each row"
        text = (
            f"{file}: column{'s' * several} {said} change{'s' * (not several)} every {many} rows "
            f"only: {what}; {remedy}"
        )
        out.append(HeldReadings(file, names[0], None, text))
    return out
