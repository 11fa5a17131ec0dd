"""Whether columns of a log stand some rows off those beside them, by any number of rows at once.

From row to row the balance leaves r_k = sum over terms of F_k M_(k - s), F of columns that stay and
M of those moved down by s rows, so its energy at every s is a sum of correlations, which Fourier
transforms tell together.  Commands alone are exact so; of currents or the angle alone the products
with what stays are further terms.

Where commands hardly change from row to row a shift cannot be seen; at one constant speed it is a
turn by one angle, so that a zero of the angle, a sign or an order of phases explains the log as
well (`mistakes` weighs them).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import next_fast_len

from model.array_types import Array
from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import (
    PHASES,
    UNDISTURBED,
    VOLTAGES,
    Complex,
    with_saturation,
)
from sandbox.recordings.findings import Finding, Refused
from sandbox.recordings.rows.aliased import or_injected
from sandbox.recordings.rows.commands import mean_command

Terms = tuple[Sequence[Complex], Sequence[Complex]]
MOVED = (VOLTAGES, PHASES, ("theta",))  # columns that are logged together
ROWS = 8192  # of a recording, those with most voltage
MOST_ROWS = 1024  # by which columns are moved, and a quarter of the rows at most
LATE = 4  # rows: a drive itself is not later, and a diagnosis can tell its delay
SHIFTED = 0.25  # of the unexplained share: what shifting must leave of it
# of the voltage's energy: less unexplained is no shift; of 288 recordings that are not shifted the
# most that a shift explains by chance is 0.4 %
NOTICED = 0.005
WORSE = 0.02  # of it, by which a shift of all recordings may leave more of one that is in doubt
# shifts of a signal that repeats: the shortest of those within this factor and share
ALIKE, FLOOR = 1.25, 0.002
# of the energy: what one turn leaves of vectors that turn on over the rows of a shift
ONE_SPEED = 0.005
EFFECTS = {VOLTAGES: "pwm_delay", PHASES: "current_sampling"}


@dataclass(frozen=True)
class Shift:
    """Columns that stand so many rows too high (rows > 0), in which files, and shares of the
    voltage unexplained before and after."""

    rows: int
    moved: tuple[str, ...]
    files: tuple[str, ...]
    before: float
    after: float

    @property
    def refused(self) -> bool:
        """Tell whether this is no gap: too much is unexplained, and no drive is so late."""
        return abs(self.rows) > LATE and self.before > UNDISTURBED

    @property
    def finding(self) -> Finding:
        """It as a finding."""
        files, column = self.files, self.moved[0]
        return Finding(files[0], column, None, self.sentence, files, left=self.after)

    @property
    def sentence(self) -> str:
        """What is off, by how much, and what to move."""
        count = abs(self.rows)
        many, by = (
            ("one sample", "one row") if count == 1 else (f"{count} samples", f"{count} rows")
        )
        what = {VOLTAGES: "commands act", PHASES: "currents are of"}.get(
            self.moved, "the angle is of"
        )
        stand = "it stands" if len(self.moved) == 1 else "they stand"
        more = f" (and in {len(self.files) - 1} other recordings)" if len(self.files) > 1 else ""
        effect = EFFECTS.get(self.moved) if count <= LATE else None
        late = f" (a drive that is late itself shows as {effect})" if effect else ""
        return (
            f"{self.files[0]}: column '{self.moved[0]}': {what} {many} "
            f"{'later than' if self.rows > 0 else 'before'} the row in which {stand}: "
            f"{100.0 * self.before:.3g} % of the voltage is unexplained, shifted by "
            f"{by.replace('one', 'a')} {100.0 * self.after:.3g} %{more}; if the log is shifted, "
            f"move {', '.join(self.moved)} {'down' if self.rows > 0 else 'up'} by {by}{late}"
        )


def shifted(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Return a finding where commands, currents or the angle, shifted by some rows, explain
    recordings far better; BadInput where no drive is so late.
    """
    found = shifts(recordings, drive)
    for s in found:
        if s.refused:
            raise Refused(or_injected(s.finding, drive))
    return [or_injected(s.finding, drive) for s in found]


def shifts(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Shift]:
    """Return the shift that explains recordings together far better, or else those of single
    ones."""
    linear = ((r, own) for r in recordings if (own := curves(r, drive)) and _now(own) > NOTICED)
    noticed = {r.file: own for r, c in linear if _now(own := _as_it_stands(c, r, drive)) > NOTICED}
    if not noticed:
        return []
    most = min(len(c[VOLTAGES]) for c in noticed.values()) // 2
    together: dict[tuple[str, ...], Array] = {
        moved: np.mean([_inner(c[moved], most) for c in noticed.values()], axis=0)
        for moved in MOVED
    }
    best = _best(together)
    found = [f for f, c in noticed.items() if _answers(c, best)]
    doubtful = [c for c in noticed.values() if _now(c) > WORSE] or [*noticed.values()]
    if found and all(_left(c, best) <= _now(c) + WORSE for c in doubtful):
        return [_shift(best, noticed, found)]
    alone = {f: _best(c) for f, c in noticed.items() if _now(c) > UNDISTURBED}
    return [_shift(own, noticed, [f]) for f, own in alone.items() if _answers(noticed[f], own)]


def _as_it_stands(
    c: dict[tuple[str, ...], Array], r: CampaignRecording, drive: Drive
) -> dict[tuple[str, ...], Array]:
    """Return a recording's curves, at no shift what the saturated model leaves where that is
    less."""
    balanced = with_saturation(r, drive, window=1)
    if balanced is None or (left := max(balanced.share - balanced.noise, 0.0)) >= _now(c):
        return c
    return {
        moved: np.concatenate([x[: len(x) // 2], [left], x[len(x) // 2 + 1 :]])
        for moved, x in c.items()
    }


def moved_back(r: CampaignRecording, shift: Shift) -> CampaignRecording:
    """Return a recording whose columns stand in the rows of which they are, without the rows that
    then lack some."""
    down, up = max(shift.rows, 0), max(-shift.rows, 0)
    stay, move = slice(down, len(r.t) - up), slice(up, len(r.t) - down)
    return replace(
        r, columns={n: x[move if n in shift.moved else stay] for n, x in r.columns.items()}
    )


def is_turn(recordings: Sequence[CampaignRecording], shift: Shift) -> bool:
    """Tell whether the rotor goes on by one and the same angle over the rows of a shift, all
    through recordings."""
    rows = abs(shift.rows)
    steps = np.concatenate([r.theta[rows:] - r.theta[: len(r.t) - rows] for r in recordings])
    return 1.0 - abs(complex(np.mean(np.exp(1j * steps)))) ** 2 < ONE_SPEED


def _shift(
    best: tuple[int, tuple[str, ...]],
    noticed: dict[str, dict[tuple[str, ...], Array]],
    files: list[str],
) -> Shift:
    own = noticed[files[0]]
    return Shift(*best, tuple(files), _now(own), _left(own, best))


def _inner(curve: Array, most: int) -> Array:
    middle = len(curve) // 2
    return curve[middle - most : middle + most + 1]


def _now(curves: dict[tuple[str, ...], Array]) -> float:
    return float(curves[VOLTAGES][len(curves[VOLTAGES]) // 2])


def _left(curves: dict[tuple[str, ...], Array], shift: tuple[int, tuple[str, ...]]) -> float:
    rows, moved = shift
    return float(curves[moved][len(curves[moved]) // 2 + rows])


def _answers(curves: dict[tuple[str, ...], Array], shift: tuple[int, tuple[str, ...]]) -> bool:
    return _left(curves, shift) < SHIFTED * _now(curves)


def _best(curves: dict[tuple[str, ...], Array]) -> tuple[int, tuple[str, ...]]:
    """Return the rows and the columns whose shift leaves least; commands, where others do not leave
    half of that."""
    own = {moved: _shortest(curve) for moved, curve in curves.items()}
    left = {moved: _left(curves, (rows, moved)) for moved, rows in own.items()}
    moved = min(left, key=lambda m: left[m] * (1.0 if m == VOLTAGES else 2.0))
    return own[moved], moved


def _shortest(curve: Array) -> int:
    """Return the shortest shift among the minima that leave as little as any."""
    middle = len(curve) // 2
    around = np.pad(curve, 1, constant_values=np.inf)
    minima = (curve <= around[:-2]) & (curve <= around[2:]) & (np.arange(len(curve)) != middle)
    low = np.flatnonzero(minima)
    if not low.size:
        return 1
    least = float(curve[low].min())
    good = low[curve[low] <= ALIKE * least + FLOOR] - middle
    return int(min(good, key=abs))


def curves(r: CampaignRecording, drive: Drive) -> dict[tuple[str, ...], Array]:
    """Return the share of the voltage that stays unexplained sample by sample, noise off, at shifts
    of -most to most rows (odd,), for each group of columns that may be moved; empty for a short
    recording."""
    most = min(MOST_ROWS, len(r.t) // 4)
    if most <= LATE:
        return {}
    first = 0
    if len(r.t) > ROWS:
        energy = np.concatenate([[0.0], np.cumsum(r.u_alpha**2 + r.u_beta**2)])
        first = int(np.argmax(energy[ROWS:] - energy[:-ROWS]))
    own = slice(first, first + ROWS)
    theta, h = r.theta[own], drive.converter.sampling_period
    i = np.empty(len(theta), dtype=np.complex128)
    i.real, i.imag = (x[own] for x in r.current)
    u = mean_command(r.u_alpha[own] + 1j * r.u_beta[own], theta, drive.converter)[:-1]
    inner = np.zeros(len(u))
    inner[most : len(u) - most] = 1.0
    sensor = math.hypot(
        drive.converter.current_noise, drive.converter.current_resolution / math.sqrt(12.0)
    )
    noise = (
        4.0 / 3.0 * (drive.motor.inductance_d**2 + drive.motor.inductance_q**2) * (sensor / h) ** 2
    )
    power = _correlated([(inner, np.abs(u) ** 2)], most)  # of the voltage where it then stands
    out = {}
    for moved, (stay, move) in zip(MOVED, _terms(u, i, theta, drive), strict=True):
        left = _energy([inner * f for f in stay], move, most)
        base = power if moved == VOLTAGES else np.full(len(power), power[most])
        out[moved] = np.maximum(left - noise * inner.sum(), 0.0) / np.maximum(base, 1e-300)
    return out


def _terms(u: Complex, i: Complex, theta: Array, drive: Drive) -> tuple[Terms, Terms, Terms]:
    """Return factors that stay and factors that are moved, of commands, currents and the angle,
    over n - 1 periods."""
    m, h = drive.motor, drive.converter.sampling_period
    mean, gap = 0.5 * (m.inductance_d + m.inductance_q), 0.5 * (m.inductance_d - m.inductance_q)
    one = np.ones(len(u), dtype=np.complex128)
    turn, other = np.exp(1j * theta), np.conj(i)
    ohmic = 0.5 * m.resistance * (i[:-1] + i[1:]) + mean * np.diff(i) / h
    magnet, salient = m.magnet_flux * np.diff(turn) / h, gap / h * turn**2
    whole = ohmic + magnet + np.diff(salient * other)
    return (
        ((-whole, one), (one, u)),
        ((u - magnet, -one, -salient[1:], salient[:-1]), (one, ohmic, other[1:], other[:-1])),
        ((u - ohmic, -one, -other[1:], other[:-1]), (one, magnet, salient[1:], salient[:-1])),
    )


def _energy(stay: Sequence[Complex], move: Sequence[Complex], most: int) -> Array:
    """Return sum over k of |sum over terms of stay_k move_(k - s)|^2 for s from -most to most."""
    pairs = []
    for j, (a, b) in enumerate(zip(stay, move, strict=True)):
        pairs.append((np.abs(a) ** 2, np.abs(b) ** 2))
        for c, d in zip(stay[j + 1 :], move[j + 1 :], strict=True):
            pairs.append((2.0 * np.conj(a) * c, np.conj(b) * d))
    return _correlated(pairs, most)


def _correlated(pairs: Sequence[tuple[Complex | Array, Complex | Array]], most: int) -> Array:
    """Return the real part of the sum over pairs a, b and over k of a_k b_(k - s) for s from -most
    to most."""
    size = next_fast_len(len(pairs[0][0]) + most)
    both = sum(np.fft.fft(a, size) * np.conj(np.fft.fft(np.conj(b), size)) for a, b in pairs)
    full = np.fft.ifft(both)
    return np.concatenate([full[-most:], full[: most + 1]]).real
