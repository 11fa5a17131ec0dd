"""Which mistake of units, signs or order makes a recording contradict the stator's voltage
equation, if one does.

`search` tries the table of mistakes (`changes`), `readings` says what each leaves.  A mistake is
believed only where undoing it explains the recording; a gap that no mistake explains is left to the
diagnosis.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.axis import off_axis
from sandbox.recordings.checks.balance import (
    PHASES,
    UNDISTURBED,
    VOLTAGES,
    Balance,
    balance,
    percent,
    saturation_explains,
    with_saturation,
)
from sandbox.recordings.checks.changes import CURRENT, VOLTAGE, Change, changes, source_of
from sandbox.recordings.checks.legs import left_by_legs
from sandbox.recordings.checks.readings import BETTER, FALLS, FLOOR, ZEROS, Products, Reading
from sandbox.recordings.checks.search import (
    ALIKE,
    bases,
    explanations,
    likeliest,
    readings_of,
    single,
)
from sandbox.recordings.checks.shifts import Shift, is_turn, moved_back, shifts
from sandbox.recordings.findings import Finding, Refused

CLOSE = 0.03  # relative, within which a factor between conventions is believed
UNIT = 10.0  # a factor that no gap is: of a unit, however near to it the best one is
# relative, that stated values are off by on any drive: they leave its square of the voltage open
OFF = 0.03
# of what is open: less a voltage of six steps does not leave of a sine (1 - 9 / pi^2 = 0.088),
# which any other mistake makes
AS_SINE = 0.07
WORTH_ASKING = 0.02  # of the voltage: less is not worth asking a saturated model for
# relative, of resistance (75 K), inductances (saturation, an air gap) and flux (a warm magnet):
# within it no other convention is needed
ORDINARY = (0.3, 0.25, 0.15)


class Unanswered(Finding):
    """A recording that contradicts the nominal model by no mistake that is known: a diagnosis may
    explain it."""


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
        raise Refused(_finding(found, doubtful))
    off_axis(recordings, drive)
    if found:
        return conventions_off(recordings, drive) or [_finding(found, doubtful)]
    return [
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
    return Finding(
        files[0], found[0].column, row, _sentence(found, doubtful), files, found[0].rereads
    )


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


def conventions_off(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Return a finding where another convention of currents, voltages or stated values, another
    unit, order or zero of the angle explains recordings far better."""
    read = [(r, balance(r.columns, drive)) for r in recordings]
    parts = [
        Products(r, drive, _left_by(r, b, drive), b.noise)
        for r, b in read
        if math.isfinite(b.noise)
    ]
    before = float(np.mean([p.before for p in parts])) if parts else 0.0
    if before + OFF**2 < BETTER * OFF**2:
        return []

    def left(own: tuple[Change, ...], zero: float = 0.0) -> float:
        return float(np.mean([p.left(own, zero) for p in parts]))

    table = changes(drive, source_of(parts[0].recording))
    tried = [*single(parts, drive, table), *readings_of(parts, ((c,) for c in bases(parts, drive)))]
    tried += readings_of(parts, _conventions(table))
    told = sorted(
        ((left(x.changes, x.zero), k, x) for k, x in enumerate(tried)),
        key=lambda x: (x[0] + OFF**2) * FALLS ** x[2].count,
    )
    after, _, best = told[0]
    after = min(after, float(np.mean([_left_as(p, best.changes, after) for p in parts])))
    if (after + OFF**2) * BETTER * FALLS ** (best.count - 1) > before + OFF**2:
        return []
    if len(best.changes) == 1 and not _beyond_a_gap(best.changes[0], after, parts, left):
        return []
    alike = likeliest(
        [
            x
            for a, _, x in told
            if x.count == best.count and a <= told[0][0] * math.exp(ALIKE) + 1e-4
        ]
    )
    r = parts[0].recording
    said = [x.words(source_of(r)) for x in alike]
    text = (
        f"{r.file}: {percent(before)} of the commanded voltage is unexplained, {percent(after)} if "
        f"{', or '.join(guess for guess, _ in said)}; then {said[0][1]}"
    )
    return [Finding(r.file, alike[0].column, None, text, rereads=alike[0].rereads)]


def _conventions(table: Sequence[Change]) -> Iterator[tuple[Change, ...]]:
    """Yield two conventions together, of currents, voltages or stated values."""
    pairs = itertools.combinations((c for c in table if c.convention), 2)
    return ((a, b) for a, b in pairs if a.part != b.part)


def _beyond_a_gap(
    c: Change, after: float, parts: Sequence[Products], left: Callable[[tuple[Change, ...]], float]
) -> bool:
    """Tell whether a change is no factor, or the best one, or one that stated values would have to
    be far off for."""
    factors = [abs(f) for f in (c.scale, *c.values)]
    if min(factors) <= 1.0 / UNIT and left((_vanished(c),)) <= BETTER * after:
        return False  # without these terms as little stays open: nothing tells their factor
    if c.signal is not None or c.turn != 1.0 or max(factors) >= UNIT or min(factors) <= 1.0 / UNIT:
        return True
    if min(left((_stretched(c, x),)) for x in (1.0 - 2.0 * CLOSE, 1.0 + 2.0 * CLOSE)) >= after:
        return True
    return with_values_off(parts) > BETTER * after


def with_values_off(parts: Sequence[Products]) -> float:
    """Return the share that stays unexplained with the motor's values at their best within
    ORDINARY of what is stated."""
    total = np.zeros((5, 5))
    for p in parts:
        m = p.drive.motor
        half = 0.5 * (m.inductance_d + m.inductance_q), 0.5 * (m.inductance_d - m.inductance_q)
        terms = np.array([1.0, *(-x for x in (m.resistance, *half, m.magnet_flux))])
        own = p.of(None, None, 1.0).real
        total += np.outer(terms, terms) * own / max(float(own[0, 0]), 1e-300) / len(parts)
    half_gap, mean = abs(half[1]) or 1e-300, half[0]
    off = np.array(ORDINARY)[[0, 1, 1, 2]] * (1.0, 1.0, mean / half_gap, 1.0)
    root = np.linalg.cholesky(total + 1e-12 * np.trace(total) * np.eye(5)).T
    found = lsq_linear(root[:, 1:], -root[:, 0], (1.0 - off, 1.0 + off))
    return 2.0 * float(found.cost)


def _left_by(r: CampaignRecording, b: Balance, drive: Drive) -> float:
    """Return the share that the nominal model leaves beyond noise: the saturated one where the
    linear leaves more."""
    left = max(b.share - b.noise, 0.0)
    if left < WORTH_ASKING:
        return left
    told = with_saturation(r, drive)
    return left if told is None else min(left, max(told.share - told.noise, 0.0))


def _left_as(p: Products, own: Sequence[Change], linear: float) -> float:
    """Return what the nominal model leaves of a recording once currents and voltages are scaled,
    `linear` where other things change."""
    parts = {CURRENT: PHASES, VOLTAGE: VOLTAGES}
    if any(c.part not in parts or c.signal is not None for c in own) or not own:
        return linear
    columns = dict(p.recording.columns)
    for c in own:
        columns.update({n: c.scale * columns[n] for n in parts[c.part]})
    read = replace(p.recording, columns=columns)
    return _left_by(read, balance(columns, p.drive), p.drive)


def _vanished(c: Change) -> Change:
    """Return a change whose small factors are none at all."""
    scale, *values = (x if abs(x) > 1.0 / UNIT else 0.0 for x in (c.scale, *c.values))
    return replace(c, scale=scale if c.part != VOLTAGE else c.scale, values=tuple(values))  # type: ignore[arg-type]


def _stretched(c: Change, x: float) -> Change:
    """Return a convention's change with another factor."""
    values = (1.0 + (v != 1.0) * (x * v - 1.0) for v in c.values)
    return replace(c, scale=c.scale * x if c.scale != 1.0 else 1.0, values=tuple(values))  # type: ignore[arg-type]
