"""Which mistake of units, signs or order makes a recording contradict the stator's voltage
equation, if one does.

What stays unexplained is V - R I - S di/dt - D d(exp(2j theta) conj(i))/dt - phi d(exp(j
theta))/dt, averaged over windows: linear in the motor's values and in factors of voltage and
current, a polynomial in exp(j
zero) of a zero of the angle.  So one matrix of products for each reading of the signals tells every
factor and every zero, and all single changes of the table (`changes`) and all pairs are tried.  A
mistake is believed only where undoing it explains the recording; a gap that no mistake explains is
left to the diagnosis.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.axis import off_axis
from sandbox.recordings.checks.balance import (
    UNDISTURBED,
    Balance,
    Columns,
    Complex,
    balance,
    percent,
    saturation_explains,
    window_of,
    with_saturation,
)
from sandbox.recordings.checks.changes import (
    ANGLE,
    CURRENT,
    DUTIES,
    MOTOR,
    VOLTAGE,
    Change,
    Source,
    changes,
    current_of,
    currents_held,
    of_angle,
    of_base,
    source_of,
    voltage_of,
    voltages_held,
)
from sandbox.recordings.checks.shifts import Shift, is_turn, moved_back, shifts
from sandbox.recordings.findings import Finding, Refused
from sandbox.recordings.rows.commands import mean_command

EXPLAINED = 0.2  # share that undoing a mistake must reach ...
BETTER = 4.0  # ... and the factor by which it must fall
FALLS = 8.0  # times by which one more mistake must lessen it, and a convention what is no doubt yet
NOTICED = 0.02  # of the voltage: less is no question of conventions
CLOSE = 0.03  # relative, within which a factor between conventions is believed
UNIT = 10.0  # a factor that no gap is: of a unit, however near to it the best one is
FLOOR = 0.005  # share that a right reading may leave: what is below tells nothing
# factors, or their inverse, beyond any gain of a sensor or a link
BASE = {CURRENT: 5.0, VOLTAGE: 3.0}
ALIKE = 0.2  # of the logarithm: two mistakes that cannot be told apart
ROWS = 20_000  # of a recording, those with most voltage
ZEROS = np.linspace(-math.pi, math.pi, 720, endpoint=False)
SMALLEST_ZERO = math.radians(10.0)  # a smaller one is a gap: an encoder's offset
ROUND = math.radians(4.0)  # a zero so near to a whole twelfth of a turn is that


@dataclass(frozen=True)
class Reading:
    """Some changes together, with a zero of the angle (rad) that is added, and what they leave of
    each recording."""

    changes: tuple[Change, ...]
    zero: float
    shares: NDArray[np.float64]
    before: NDArray[np.float64]
    noise: NDArray[np.float64]

    @property
    def answered(self) -> NDArray[np.bool_]:
        """Tell of which recordings it explains enough."""
        return np.asarray(
            (self.shares <= EXPLAINED + self.noise) & (self.shares * BETTER <= self.before)
        )

    @property
    def count(self) -> int:
        """How many mistakes it is."""
        return sum(1 + c.fitted for c in self.changes) + (self.zero != 0.0)

    @property
    def gentle(self) -> bool:
        """Tell whether the mistakes are factors of two at most between conventions, which a
        diagnosis can bear."""
        factors = [abs(f) for c in self.changes for f in (c.scale, *c.values)]
        return (
            not self.zero
            and all(c.convention for c in self.changes)
            and all(0.5 <= f <= 2.0 for f in factors)
        )

    @property
    def share(self) -> float:
        """What is left of the recordings it answers for."""
        return float(np.mean(self.shares[self.answered])) if self.answered.any() else math.inf

    @property
    def cost(self) -> float:
        """Logarithm of what is left, one more mistake having to lessen it FALLS times."""
        return math.log(self.share + FLOOR) + math.log(FALLS) * self.count

    @property
    def column(self) -> str:
        """The standard column whose value is shown, empty for the motor's values."""
        return "theta" if self.zero or not self.changes else self.changes[0].column

    @property
    def rereads(self) -> frozenset[str]:
        """Parts of a log of which another factor or zero is right; another order moves no bound."""
        parts = {c.part for c in self.changes if c.signal is None}
        return frozenset({*parts, ANGLE} if self.zero else parts)

    def words(self, source: Source) -> tuple[str, str]:
        """Return what was read wrongly, and what to do."""
        turn = [c for c in self.changes if c.part == ANGLE]
        # the zero of an angle that is made of a speed is nobody's reading
        zero = self.zero if "theta" in source or "speed" not in source else 0.0
        angle, advice = of_angle(turn[0] if turn else None, zero)
        name = source.get("theta", source.get("speed", "theta"))
        guesses = ([f"{name} is {angle}"] if angle else []) + [
            c.guess for c in self.changes if c.part != ANGLE
        ]
        remedies = ([advice] if advice else []) + [
            c.remedy for c in self.changes if c.part != ANGLE
        ]
        return " and ".join(guesses), " and ".join(remedies) if len(remedies) < 3 else ", ".join(
            remedies
        )


@dataclass
class Products:
    """Products of the five terms of a recording's balance, for each reading of its signals; see the
    module."""

    recording: CampaignRecording
    drive: Drive
    before: float
    noise: float
    known: dict[tuple[str | int | float | None, ...], Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        r = self.recording
        # made with the angle that the log holds
        self.turns_u = voltages_held(source_of(r))[0] == "u_d"
        self.turns_i = currents_held(source_of(r))[0] == "i_d"
        self.size = window_of(r.columns)
        own = slice(0, len(r.t))
        if len(r.t) > ROWS:
            energy = np.concatenate([[0.0], np.cumsum(r.u_alpha**2 + r.u_beta**2)])
            first = int(np.argmax(energy[ROWS:] - energy[:-ROWS]))
            own = slice(first, first + ROWS)
        self.columns: Columns = {n: x[own] for n, x in r.columns.items()}
        self.at = np.arange(0, len(self.columns["theta"]), self.size)

    def of(self, current: Change | None, voltage: Change | None, turn: float) -> Any:
        """Return the matrix (5, 5) of products, with signals and factor of the angle as some
        changes read them."""
        return self._kept("products", self._products, current, voltage, turn)

    def _kept(self, what: str, made: Callable[..., Any], *key: Change | float | None) -> Any:
        """Return what a method makes, made once: signals have as many values as a log has rows."""
        own = (what, *(id(k) if isinstance(k, Change) else k for k in key))
        if own not in self.known:
            self.known[own] = made(*key)
        return self.known[own]

    def _products(self, current: Change | None, voltage: Change | None, turn: float) -> Any:
        span = self.drive.converter.sampling_period * self.size
        own = turn if self.turns_u else 1.0
        u = self._kept(
            "voltage",
            self._voltage,
            voltage,
            own,
            turn if self.drive.converter.periods_a_row > 1 else own,
        )
        mean, i = self._kept("current", self._current, current, turn if self.turns_i else 1.0)
        around = np.exp(1j * (turn * self.columns["theta"][self.at]))
        x = np.stack(
            [
                u,
                mean,
                np.diff(i) / span,
                np.diff(around**2 * np.conj(i)) / span,
                np.diff(around) / span,
            ],
            axis=1,
        )
        return x.conj().T @ x

    def _voltage(self, change: Change | None, turn: float, read: float) -> Complex:
        """Return the means of the voltage over windows; read: how many times itself the angle is
        between slow rows."""
        signal = voltage_of if change is None or change.signal is None else change.signal
        u = signal(self.columns) * self._moved(turn)
        return self._means(mean_command(u, read * self.columns["theta"], self.drive.converter)[:-1])

    def _current(self, change: Change | None, turn: float) -> tuple[Complex, Complex]:
        """Return the means of the current over windows, and its values where they begin."""
        signal = current_of if change is None or change.signal is None else change.signal
        i = signal(self.columns) * self._moved(turn)
        return self._means(0.5 * (i[:-1] + i[1:])), i[self.at]

    def _moved(self, turn: float) -> Any:
        """Return what turns vectors that were made with the log's angle, read as `turn` times
        itself."""
        theta = self.columns["theta"]
        return np.exp(1j * (turn * theta - theta)) if turn != 1.0 else 1.0

    def _means(self, x: Complex) -> Any:
        return np.diff(np.concatenate([[0j], np.cumsum(x)])[self.at]) / self.size

    def shares(self, change: Sequence[Change], zeros: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what stays unexplained at each zero of the angle (rad), of the voltage as it is
        then read."""
        m = self.drive.motor
        signal = {c.part: c for c in change if c.signal is not None}
        scale = {
            part: math.prod(c.scale for c in change if c.part == part)
            for part in (CURRENT, VOLTAGE)
        }
        turn = math.prod(c.turn for c in change)
        values = np.prod([c.values for c in change], axis=0) if change else np.ones(4)
        half = 0.5 * (m.inductance_d + m.inductance_q), 0.5 * (m.inductance_d - m.inductance_q)
        r, s, d, flux = values * (m.resistance, *half, m.magnet_flux)
        by_i, at = float(self.turns_i), 1j * zeros
        factors = np.stack(
            [
                scale[VOLTAGE] * np.exp(self.turns_u * at),
                -r * scale[CURRENT] * np.exp(by_i * at),
                -s * scale[CURRENT] * np.exp(by_i * at),
                -d * scale[CURRENT] * np.exp((2.0 - by_i) * at),
                -flux * np.exp(at),
            ]
        )
        products = self.of(signal.get(CURRENT), signal.get(VOLTAGE), turn)
        rest = np.sum(np.conj(factors) * (products @ factors), axis=0).real
        return np.maximum(rest, 0.0) / max(scale[VOLTAGE] ** 2 * float(products[0, 0].real), 1e-300)


class Unanswered(Finding):
    """A recording that contradicts the nominal model by no mistake that is known: a diagnosis may
    explain it."""


def contradictions(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Raise Refused for the mistake that explains what recordings contradict; return what no
    mistake explains."""
    read = [(r, balance(r.columns, drive)) for r in recordings]
    doubtful = [(r, b) for r, b in read if b.doubtful and not saturation_explains(r, drive)]
    found = explanations(doubtful, drive)
    if _is_shift(recordings, doubtful, found, drive):
        return []  # `shifted` says so
    if found and not found[0].gentle:
        raise Refused(_finding(found, doubtful))
    off_axis(recordings, drive)
    if found:
        return [_finding(found, doubtful)]
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


def explanations(
    doubtful: Sequence[tuple[CampaignRecording, Balance]], drive: Drive
) -> list[Reading]:
    """Return the reading that answers for most recordings with the fewest mistakes, and one that
    does as well."""
    parts = [Products(r, drive, b.share, b.noise) for r, b in doubtful]
    if not parts:
        return []
    good = [x for x in readings(parts, drive) if x.answered.any()]
    most = max((int(x.answered.sum()) for x in good), default=0)
    good = [x for x in good if int(x.answered.sum()) == most]
    best = min(good, key=lambda x: x.cost, default=None)
    alike = [x for x in good if best and x.cost <= best.cost + ALIKE and x.count == best.count]
    alike.sort(key=lambda x: x.zero != 0.0)  # a zero may be anything, a unit is what it is
    return alike[: 2 if best and best.count == 1 else 1]


def readings(parts: Sequence[Products], drive: Drive) -> Iterator[Reading]:
    """Yield every single change of the table, every pair of two, as they stand and with the zero
    that fits best."""
    table = changes(drive, source_of(parts[0].recording))
    before, noise = np.array([p.before for p in parts]), np.array([p.noise for p in parts])
    for own in [(), *((c,) for c in table), *_pairs(table)]:
        for zero in dict.fromkeys((0.0, _zero(parts, own) if len(own) < 2 else 0.0)):
            if own or zero:
                shares = np.array([p.shares(own, np.array([zero]))[0] for p in parts])
                yield Reading(own, zero, shares, before, noise)
                if zero == 0.0 and shares.max() < FLOOR:
                    break  # no zero can do better
    for beside in ((), *((c,) for c in table if c.part == ANGLE)):
        for base in bases(parts, drive, beside):
            shares = np.array([p.shares((*beside, base), np.zeros(1))[0] for p in parts])
            yield Reading((*beside, base), 0.0, shares, before, noise)


def bases(
    parts: Sequence[Products], drive: Drive, beside: tuple[Change, ...] = ()
) -> Iterator[Change]:
    """Yield the factors of all currents, and of all voltages, that leave least beside other
    changes, where they are no gain of a sensor.

    What is left is a parabola in the factor of the currents, and in one over that of the voltages.
    """
    source = source_of(parts[0].recording)
    for part in (CURRENT, VOLTAGE):
        if part == VOLTAGE and voltages_held(source) == DUTIES:
            continue
        ends = (Change(part, "", "", "", scale=x) for x in (-1.0, 1.0))
        low, high = (
            sum(float(p.shares((*beside, c), np.zeros(1))[0]) for p in parts) for c in ends
        )
        none = Change(part, "", "", "", scale=0.0)
        middle = sum(
            float(p.shares((*beside, none), np.zeros(1))[0]) if part == CURRENT else 1.0
            for p in parts
        )
        bend, slope = 0.5 * (high + low) - middle, 0.5 * (high - low)
        if bend <= 0.0 or slope >= 0.0:
            continue
        best = -0.5 * slope / bend
        scale = best if part == CURRENT else 1.0 / best
        if abs(math.log(scale)) > math.log(BASE[part]):
            yield of_base(part, scale, drive, source)


def _pairs(table: Sequence[Change]) -> Iterator[tuple[Change, ...]]:
    """Yield the pairs that occur: the angle and something else, an order of phases and a unit or a
    sign, one unit or convention in currents and voltages, and two of the motor's values taken from
    one data sheet.

    Others would be free factors that explain any gap.
    """
    for a, b in itertools.combinations(table, 2):
        angle = (a.part == ANGLE) != (b.part == ANGLE)
        order = a.part == b.part == CURRENT and (a.signal is None) != (b.signal is None)
        both = {a.part, b.part} == {CURRENT, VOLTAGE} and a.scale == b.scale not in (1.0, -1.0)
        sheet = a.part == b.part == MOTOR and not np.any(
            (np.array(a.values) != 1.0) & (np.array(b.values) != 1.0)
        )
        if angle or order or both or sheet:
            yield a, b


def _zero(parts: Sequence[Products], own: Sequence[Change]) -> float:
    """Return the zero of the angle (rad) that leaves least of all recordings; 0 where that is none
    to speak of.  An angle that was made has its own already, but not at another speed."""
    made = any(c.part == ANGLE for c in own)
    if all("theta" in source_of(p.recording) or made for p in parts):
        total = sum(p.shares(own, ZEROS) for p in parts)
        best = float(ZEROS[int(np.argmin(total))])
        near = round(best / (math.pi / 6.0)) * math.pi / 6.0
        best = near if abs(best - near) < ROUND else best
        if abs(best) >= SMALLEST_ZERO and float(np.ptp(total)) > FLOOR:
            return math.pi if best < -math.pi + 1e-9 else best
    return 0.0


def conventions_off(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Return a finding where another convention of currents, voltages or stated values, or another
    zero of the angle, explains recordings far better."""
    read = [(r, balance(r.columns, drive)) for r in recordings]
    parts = [
        Products(r, drive, _left_by(r, b, drive), b.noise)
        for r, b in read
        if math.isfinite(b.noise)
    ]
    before = float(np.mean([p.before for p in parts])) if parts else 0.0
    if before < NOTICED:
        return []

    def left(own: tuple[Change, ...], zero: float = 0.0) -> float:
        return float(
            np.mean([max(p.shares(own, np.array([zero]))[0] - p.noise, 0.0) for p in parts])
        )

    table = [
        c
        for c in changes(drive, source_of(parts[0].recording))
        if c.convention or c.values[2] < 0.0
    ]
    table += bases(parts, drive)
    zero = _zero(parts, ())
    turned = left((), zero)
    if zero and turned * BETTER < min(before, min((left((c,)) for c in table), default=before)):
        guess, remedy = of_angle(None, zero)
        r, name = parts[0].recording, source_of(parts[0].recording)["theta"]
        text = (
            f"{percent(before)} of the commanded voltage is unexplained, {percent(turned)} "
            f"if {name} is {guess}"
        )
        return [
            Finding(
                r.file, "theta", None, f"{r.file}: {text}: {remedy}", rereads=frozenset({ANGLE})
            )
        ]
    told = sorted(((left((c,)), k, c) for k, c in enumerate(table)), key=lambda x: x[:2])
    after, _, best = told[0]
    factors = [abs(f) for f in (best.scale, *best.values)]
    near = max(factors) < UNIT and min(factors) > 1.0 / UNIT
    beside = (left((_stretched(best, x),)) for x in (1.0 - 2.0 * CLOSE, 1.0 + 2.0 * CLOSE))
    if after * FALLS > before or (near and min(beside) < after):
        return []  # none, or the best factor lies elsewhere: a gap, no convention
    alike = sorted(
        (c for a, _, c in told if a <= after * math.exp(ALIKE) + 1e-4),
        key=lambda c: c.part != MOTOR,
    )[:2]
    r = parts[0].recording
    text = (
        f"{r.file}: {percent(before)} of the commanded voltage is unexplained, {percent(after)} if "
        f"{', or '.join(c.guess for c in alike)}; then {alike[0].remedy}"
    )
    return [Finding(r.file, alike[0].column, None, text, rereads=frozenset({alike[0].part}))]


def _left_by(r: CampaignRecording, b: Balance, drive: Drive) -> float:
    """Return the share that the nominal model leaves beyond noise: the saturated one where the
    linear leaves more."""
    left = max(b.share - b.noise, 0.0)
    if left < NOTICED:
        return left
    told = with_saturation(r, drive)
    return left if told is None else min(left, max(told.share - told.noise, 0.0))


def _stretched(c: Change, x: float) -> Change:
    """Return a convention's change with another factor."""
    values = (1.0 + (v != 1.0) * (x * v - 1.0) for v in c.values)
    return replace(c, scale=c.scale * x if c.scale != 1.0 else 1.0, values=tuple(values))  # type: ignore[arg-type]
