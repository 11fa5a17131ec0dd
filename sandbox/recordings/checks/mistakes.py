"""Which mistake of units, signs or order makes a recording contradict the stator's voltage
equation, if one does.

`search` tries the table of mistakes (`changes`), `readings` says what each leaves.  A mistake is
believed only where undoing it explains the recording; a gap that no mistake explains is left to the
diagnosis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.axis import off_axis
from sandbox.recordings.checks.balance import (
    UNDISTURBED,
    Balance,
    balance,
    percent,
    saturation_explains,
)
from sandbox.recordings.checks.changes import source_of
from sandbox.recordings.checks.factors import conventions_off
from sandbox.recordings.checks.legs import left_by_legs
from sandbox.recordings.checks.readings import FALLS, FLOOR, ZEROS, Products, Reading
from sandbox.recordings.checks.search import (
    ALIKE,
    explanations,
)
from sandbox.recordings.checks.shifts import Shift, is_turn, moved_back, shifts
from sandbox.recordings.findings import Finding, Refused, Unanswered
from sandbox.recordings.rows.aliased import or_injected

# of what is open: less a voltage of six steps does not leave of a sine (1 - 9 / pi^2 = 0.088),
# which any other mistake makes
AS_SINE = 0.07


def contradictions(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Raise Refused for the mistake that explains what recordings contradict; return what no
    mistake explains."""
    read = [(r, balance(r.columns, drive)) for r in recordings]
    doubtful = [(r, b) for r, b in read if b.doubtful and not saturation_explains(r, drive)]
    found = explanations(doubtful, drive)
    if found and _legs_explain(doubtful, found[0], drive):
        found = []
    if _is_shift(recordings, doubtful, found, drive):
        return []  # `shifted` says so
    if found and not found[0].gentle:
        raise Refused(or_injected(_finding(found, doubtful), drive))
    off_axis(recordings, drive)
    if found:
        return conventions_off(recordings, drive) or [or_injected(_finding(found, doubtful), drive)]
    own = [
        Unanswered(
            r.file,
            "u_alpha",
            b.worst_row,
            f"{r.file}: row {b.worst_row} of column 'u_alpha': {percent(b.share)} of the commanded "
            "voltage is unexplained by currents, angle and nominal model (at most "
            f"{percent(UNDISTURBED)} is usual), and no wrong unit, sign, order or stated value "
            "explains it; a large gap, or several mistakes at once",
        )
        for r, b in doubtful
        if b.share > 0.7
    ]
    return [or_injected(f, drive) for f in own]


def _legs_explain(
    doubtful: Sequence[tuple[CampaignRecording, Balance]], found: Reading, drive: Drive
) -> bool:
    """Tell whether a voltage that each leg loses, one number, explains all recordings that the
    reading found answers for, and costs no more than it."""
    own = [
        (left_by_legs(r, drive), b.share, float(share))
        for (r, b), share, good in zip(doubtful, found.shares, found.answered, strict=True)
        if good
    ]
    legs, before, shares = np.array(own).T
    gained = np.mean(np.log(legs + FLOOR)) - np.mean(np.log(shares + FLOOR))
    few = math.log(FALLS) * (found.count - 1) + ALIKE
    return bool(np.all(legs < AS_SINE * before) and gained <= few)


def _is_shift(
    recordings: Sequence[CampaignRecording],
    doubtful: Sequence[tuple[CampaignRecording, Balance]],
    found: Sequence[Reading],
    drive: Drive,
) -> bool:
    """Tell whether columns that stand some rows off explain more doubtful recordings than the
    readings found, or as many and better.

    At one constant speed a shift by rows is a turn by an angle, so readings win a tie.  Its rows
    are as free as a zero is before it is rounded; beside a sign or an order, which have nothing to
    fit, such a turn is one mistake more.
    """
    moved = shifts(recordings, drive) if doubtful else []
    files = [f for s in moved for f in s.files]
    if not any(r.file in files for r, _ in doubtful) or (len(moved) > 1 and found):
        return False
    if not found:
        return True
    best, own = found[0], _shifted(doubtful, moved[0], drive)
    counts = int(own.answered.sum()), int(best.answered.sum())
    if counts[0] != counts[1]:
        return counts[0] > counts[1]
    turned = not best.zero and is_turn([r for r, _ in doubtful if r.file in files], moved[0])
    rival = own.cost + math.log(FALLS) * (1 + turned)
    return rival + ALIKE < (_freed(doubtful, best, drive) if best.zero else best).cost


def _shifted(
    doubtful: Sequence[tuple[CampaignRecording, Balance]], shift: Shift, drive: Drive
) -> Reading:
    """Return what recordings leave once their columns are moved back, by the measure of
    readings."""
    shares = [
        float(Products(moved_back(r, shift), drive, b.share, b.noise).shares((), np.zeros(1))[0])
        if r.file in shift.files
        else b.share
        for r, b in doubtful
    ]
    before, noise = (
        np.array([b.share for _, b in doubtful]),
        np.array([b.noise for _, b in doubtful]),
    )
    return Reading((), 0.0, np.array(shares), before, noise)


def _freed(
    doubtful: Sequence[tuple[CampaignRecording, Balance]], reading: Reading, drive: Drive
) -> Reading:
    """Return a reading with the zero that leaves least of the recordings it answers for, not
    rounded."""
    shares = np.array(
        [Products(r, drive, b.share, b.noise).shares(reading.changes, ZEROS) for r, b in doubtful]
    )
    best = int(np.argmin(shares[reading.answered].sum(axis=0)))
    return replace(reading, zero=float(ZEROS[best]) or reading.zero, shares=shares[:, best])


def _finding(
    found: Sequence[Reading], doubtful: Sequence[tuple[CampaignRecording, Balance]]
) -> Finding:
    """Return the finding on the readings that explain recordings."""
    own = [x for x, good in zip(doubtful, found[0].answered, strict=True) if good]
    files, row = tuple(r.file for r, _ in own), own[0][1].worst_row
    left = float(np.max(found[0].shares[found[0].answered]))
    text = _sentence(found, doubtful)
    return Finding(files[0], found[0].column, row, text, files, found[0].rereads, left)


def _sentence(
    found: Sequence[Reading], doubtful: Sequence[tuple[CampaignRecording, Balance]]
) -> str:
    """Return the sentence on the readings that explain recordings."""
    m = found[0]
    answered = [x for x, good in zip(doubtful, m.answered, strict=True) if good]
    r, b = answered[0]
    k, left = b.worst_row, float(m.shares[m.answered][0])
    others = f" (and in {len(answered) - 1} other recordings)" if len(answered) > 1 else ""
    where = f"at row {k}"
    source = source_of(r)
    if m.column in source:
        where = f"row {k} of column '{m.column}' is {r.columns[m.column][k]:.6g}, and"
        own = source[m.column]
        where = (
            where.replace(f"'{m.column}'", f"'{m.column}' ('{own}')") if own != m.column else where
        )
    said = [x.words(source) for x in found]
    return (
        f"{r.file}: {where} currents, angle and nominal model leave {percent(b.share)} of the "
        f"commanded voltage unexplained{others}, at most {percent(UNDISTURBED)} would be a gap; it "
        f"falls to {percent(left)} if {', or '.join(guess for guess, _ in said)}: {said[0][1]}"
    )
