"""How a log may be read otherwise, and what each reading leaves unexplained of the stator's voltage
equation.

What stays unexplained is V - R I - S di/dt - D d(exp(2j theta) conj(i))/dt - phi d(exp(j
theta))/dt, averaged over windows: linear in the motor's values and in factors of voltage and
current, a polynomial in exp(j zero) of a zero of the angle.  So one matrix of products for each
reading of the signals tells every factor and every zero.  A sixth term is a voltage that each leg
loses with its current's sign.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.parameters import Drive, Motor
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import UNDISTURBED, Columns, Complex, window_of
from sandbox.recordings.checks.changes import (
    ANGLE,
    CURRENT,
    VOLTAGE,
    Change,
    Source,
    current_of,
    currents_held,
    of_angle,
    source_of,
    voltage_of,
    voltages_held,
)
from sandbox.recordings.checks.legs import lost_by_legs
from sandbox.recordings.rows.commands import mean_command

PARTS = (CURRENT, VOLTAGE)
EXPLAINED = 0.2  # share that undoing a mistake must reach ...
BETTER = 4.0  # ... and the factor by which it must fall, twice that for each further one
FALLS = 8.0  # times by which one more mistake must lessen it, and a convention what is no doubt yet
FLOOR = 0.005  # share that a right reading may leave: what is below tells nothing
ROWS = 20_000  # of a recording, those with most voltage
ZEROS = np.linspace(-math.pi, math.pi, 720, endpoint=False)
VALUES = 10_000  # at once: rows of windows times paces
GIVEN = 0.99  # quantile of the commands that no link is too low for


def count_of(changes: Sequence[Change], zero: float) -> int:
    """Return how many mistakes some changes and a zero of the angle are; one convention of currents
    and voltages both is one, as is a data sheet's of all values between two terminals."""
    own = [c for c in changes if c.convention and c.part in (CURRENT, VOLTAGE)]
    both = len(own) == 2 and own[0].scale == own[1].scale
    both |= len(changes) == 2 and all(c.line for c in changes)
    return sum(c.mistakes for c in changes) + (zero != 0.0) - both


@dataclass(frozen=True)
class Reading:
    """Some changes together, with a zero of the angle (rad) that is added, and what they leave of
    each recording."""

    changes: tuple[Change, ...]
    zero: float
    shares: Array
    before: Array
    noise: Array

    @property
    def does(self) -> tuple[Hashable, ...]:
        """What its changes do together: readings that do the same are one, however they are put."""
        values = [math.prod(c.values[k] for c in self.changes) for k in range(4)]
        scales = [math.prod(c.scale for c in self.changes if c.part == p) for p in PARTS]
        signals = frozenset(c for c in self.changes if c.signal is not None)
        turn = math.prod(c.turn for c in self.changes)
        return tuple(values), (*scales, turn), signals, self.zero

    @property
    def answered(self) -> NDArray[np.bool_]:
        """Tell of which recordings it explains enough: nearly all, or far more than so many
        mistakes do by chance, beside a gap."""
        better = BETTER * 2.0 ** (self.count - 1)
        nearly = (self.shares <= EXPLAINED + self.noise) & (self.shares * better <= self.before)
        far = self.shares * FALLS ** (1 + self.count) <= self.before
        return np.asarray(nearly | (far & (self.shares <= UNDISTURBED + 3.0 * self.noise)))

    @property
    def count(self) -> int:
        """How many mistakes it is."""
        return count_of(self.changes, self.zero)

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
    def cost(self) -> float:
        """Mean logarithm of what is left, one more mistake having to lessen it FALLS times."""
        return float(np.mean(np.log(self.shares + FLOOR))) + math.log(FALLS) * self.count

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
        angle, advice = of_angle(turn[0] if turn else None, self.zero, source)
        guesses = ([angle] if angle else []) + [c.guess for c in self.changes if c.part != ANGLE]
        remedies = ([advice] if advice else []) + [
            c.remedy for c in self.changes if c.part != ANGLE
        ]
        return " and ".join(guesses), " and ".join(remedies) if len(remedies) < 3 else ", ".join(
            remedies
        )


class Terms(NamedTuple):
    """How some changes read the five terms: whose signals, the angle's factor, that of voltages,
    and those of the terms (5)."""

    current: Change | None
    voltage: Change | None
    turn: float
    scale: float
    factors: Array


def terms_of(change: Sequence[Change], motor: Motor) -> Terms:
    """Return how some changes read the five terms of a motor's balance."""
    signal = {c.part: c for c in change if c.signal is not None}
    i, u = (math.prod(c.scale for c in change if c.part == part) for part in (CURRENT, VOLTAGE))
    half = 0.5 * (motor.inductance_d + motor.inductance_q)
    gap = 0.5 * (motor.inductance_d - motor.inductance_q)
    r, s, d, flux = (
        math.prod(c.values[k] for c in change) * value
        for k, value in enumerate((motor.resistance, half, gap, motor.magnet_flux))
    )
    turn = math.prod(c.turn for c in change)
    factors = np.array([u, -r * i, -s * i, -d * i, -flux])
    return Terms(signal.get(CURRENT), signal.get(VOLTAGE), turn, u, factors)


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
        i = int(self.turns_i)
        # by how many zeros of the angle each of the five terms is turned
        self.turns = np.array([int(self.turns_u), i, i, 2 - i, 1])
        self.size = window_of(r.columns)
        own = slice(0, len(r.t))
        if len(r.t) > ROWS:
            energy = np.concatenate([[0.0], np.cumsum(r.u_alpha**2 + r.u_beta**2)])
            first = int(np.argmax(energy[ROWS:] - energy[:-ROWS]))
            own = slice(first, first + ROWS)
        self.columns: Columns = {n: x[own] for n, x in r.columns.items()}
        self.at = np.arange(0, len(self.columns["theta"]), self.size)
        nominal = r.dc_bus_voltage or self.drive.converter.dc_bus_voltage
        # whether signals are others at another pace of the angle
        self.moved = self.turns_u or self.turns_i or self.drive.converter.periods_a_row > 1
        self.link = max(nominal, float(np.median(self.columns["u_dc"])))

    def of(self, current: Change | None, voltage: Change | None, turn: float) -> Any:
        """Return the matrix (6, 6) of products, the last those of what legs lose, with signals and
        factor of the angle as some changes read them."""
        return self._kept("products", self._products, current, voltage, turn)

    def _kept(self, what: str, made: Callable[..., Any], *key: Change | float | None) -> Any:
        """Return what a method makes, made once: signals have as many values as a log has rows."""
        own = (what, *(id(k) if isinstance(k, Change) else k for k in key))
        if own not in self.known:
            self.known[own] = made(*key)
        return self.known[own]

    def _products(self, current: Change | None, voltage: Change | None, turn: float) -> Any:
        return self._together(self._signals(current, voltage, turn), turn)

    def _signals(
        self, current: Change | None, voltage: Change | None, turn: float
    ) -> tuple[Complex, Complex, Complex, Complex]:
        """Return over windows the mean voltage and current, the current where they begin, and the
        means of what legs lose."""
        own = turn if self.turns_u else 1.0
        read = turn if self.drive.converter.periods_a_row > 1 else own
        u = self._kept("voltage", self._voltage, voltage, own, read)
        return u, *self._kept("current", self._current, current, turn if self.turns_i else 1.0)

    def _together(self, signals: Sequence[Complex], turn: Any) -> Any:
        """Return the products of the terms; signals and the angle's factor may be of many paces."""
        u, mean, i, lost = signals
        span = self.drive.converter.sampling_period * self.size
        around = np.exp(1j * (turn * self.columns["theta"][self.at]))
        slopes = [np.diff(y) / span for y in (i, around**2 * np.conj(i), around)]
        x = np.stack(np.broadcast_arrays(u, mean, *slopes, lost), axis=-1)
        return np.conj(np.swapaxes(x, -1, -2)) @ x

    def _voltage(self, change: Change | None, turn: float, read: float) -> Complex:
        """Return the means of the voltage over windows; read: how many times itself the angle is
        between slow rows."""
        signal = voltage_of if change is None or change.signal is None else change.signal
        u = signal(self.columns) * self._moved(turn)
        return self._means(mean_command(u, read * self.columns["theta"], self.drive.converter)[:-1])

    def _current(self, change: Change | None, turn: float) -> tuple[Complex, Complex, Complex]:
        """Return the means of the current over windows, its values where they begin, and the means
        of what legs lose, 1 V each."""
        signal = current_of if change is None or change.signal is None else change.signal
        i = signal(self.columns) * self._moved(turn)
        between = 0.5 * (i[:-1] + i[1:])
        return self._means(between), i[self.at], self._means(lost_by_legs(between))

    def _moved(self, turn: float) -> Any:
        """Return what turns vectors that were made with the log's angle, read as `turn` times
        itself."""
        theta = self.columns["theta"]
        return np.exp(1j * (turn * theta - theta)) if turn != 1.0 else 1.0

    def _means(self, x: Complex) -> Any:
        return np.diff(np.concatenate([[0j], np.cumsum(x)])[self.at]) / self.size

    def possible(self, change: Sequence[Change]) -> bool:
        """Tell whether the link could give the commands as some changes read them."""
        signal = next((c for c in change if c.part == VOLTAGE and c.signal is not None), None)
        scale = math.prod(abs(c.scale) for c in change if c.part == VOLTAGE)
        return scale * float(self._kept("largest", self._largest, signal)) <= self.link

    def noise_of(self, change: Sequence[Change]) -> float:
        """Return the share that the sensors' noise leaves of what some changes read."""
        scale = math.prod(c.scale * c.values[1] for c in change if c.part != VOLTAGE)
        scale /= math.prod(c.scale for c in change if c.part == VOLTAGE)
        return self.noise * scale**2

    def _largest(self, change: Change | None) -> float:
        signal = voltage_of if change is None or change.signal is None else change.signal
        return float(np.quantile(np.abs(signal(self.columns)), GIVEN))

    def shares(self, change: Sequence[Change], zeros: Array) -> Array:
        """Return what stays unexplained at each zero of the angle (rad), of the voltage as it is
        then read."""
        read = terms_of(change, self.drive.motor)
        rest, square = self._by_zero(self.products(read)[None], read, np.exp(1j * zeros))
        return np.asarray(np.maximum(rest[0], 0.0) / square[0])

    def least(self, turns: Array) -> Array:
        """Return what stays unexplained at the best of ZEROS, of angles that turn so many times as
        fast."""
        at, few = np.exp(1j * ZEROS), max(1, VALUES // len(self.at))
        read = terms_of((), self.drive.motor)
        out = []
        for own in (turns[k : k + few] for k in range(0, len(turns), few)):
            signals = [
                self._signals(None, None, float(x)) for x in (own if self.moved else own[:1])
            ]
            together = [np.array(x) for x in zip(*signals, strict=True)]
            products = self._together(together, own[:, None])
            rest, square = self._by_zero(products, read, at)
            out.append(np.maximum(rest.min(axis=1), 0.0) / square)
        return np.concatenate(out)

    def _by_zero(self, products: Any, read: Terms, at: Complex) -> tuple[Array, Array]:
        """Return what stays unexplained (matrices of products, zeros), which rounding may put below
        zero, and what there is to explain (matrices): polynomials in exp(j zero), whose values `at`
        are."""
        form = products[:, :5, :5] * np.outer(read.factors, read.factors)
        step = self.turns - self.turns[:, None]
        none, once, twice = (form[:, step == k].sum(axis=1) for k in range(3))
        # real parts of c z and c z^2, as one product of matrices
        parts = np.stack([none.real, once.real, once.imag, twice.real, twice.imag], axis=1)
        more = at**2
        waves = [2.0 * at.real, -2.0 * at.imag, 2.0 * more.real, -2.0 * more.imag]
        square = np.maximum(read.scale**2 * products[:, 0, 0].real, 1e-300)
        return parts @ np.stack([np.ones(len(at)), *waves]), square

    def share(self, read: Terms, zero: float) -> float:
        """Return the same at one zero: of many changes one after the other, whose products are the
        same."""
        form, square = self._kept("form", self._form, read.current, read.voltage, read.turn, zero)
        rest = float(read.factors @ form @ read.factors)
        return max(rest, 0.0) / max(read.scale**2 * square, 1e-300)

    def _form(
        self, current: Change | None, voltage: Change | None, turn: float, zero: float
    ) -> tuple[Array, float]:
        """Return what the terms' factors are weighed by, and what the voltage's is alone."""
        products = self.of(current, voltage, turn)[:5, :5]
        at = np.exp(1j * zero * self.turns)
        return (np.conj(at)[:, None] * products * at).real, float(products[0, 0].real)

    def products(self, read: Terms) -> Any:
        """Return the matrix (6, 6) of products with signals as some changes read them."""
        return self.of(read.current, read.voltage, read.turn)

    def factors(self, read: Terms, zero: float) -> Any:
        """Return the factors of the five terms as some changes read them at a zero of the angle."""
        return read.factors * np.exp(1j * zero * self.turns)
