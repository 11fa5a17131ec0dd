"""Which mistake of units, signs or order makes a recording contradict the stator's voltage equation, if one does.

Over a window of m samples the flux that voltage leaves behind must be the flux that currents and magnet show,

    sum h (u_k - R (i_k + i_k+1) / 2) = psi(end) - psi(begin),
    psi = (L_d + L_q)/2 i + (L_d - L_q)/2 exp(2j theta) conj(i) + phi_m exp(j theta)      (stator frame, complex)

whatever the load; the nominal linear model is asked, and the saturated one where that leaves a doubt.  The share of
the voltage's energy that stays unexplained is some per cent for a real gap, about 1 or far more for a wrong unit.  A
mistake is believed only where undoing it explains the recording; a gap that no mistake explains is left to the
diagnosis.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.energy import AnyEnergy, flux_from_current
from model.errors import BadInput, PhysicsError
from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording, Finding

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]
Columns = Mapping[str, Array]
PHASES = ("i_a", "i_b", "i_c")
VOLTAGES = ("u_alpha", "u_beta")
UNDISTURBED = 0.35  # unexplained share that no mistake needs to answer for
EXPLAINED = 0.2  # share that undoing a mistake must reach ...
BETTER = 4.0  # ... and the factor by which it must fall
TIE = 1.5  # factor within which two mistakes cannot be told apart
OFF_AXIS = 0.5  # excess of the injected energy along its axis: 30 degrees off
ON_AXIS = 0.9  # excess that undoing a mistake must reach: 13 degrees
LOOKED = 200  # windows in which the saturated model is asked
BLOCK = 500_000  # samples of which the balance is made at a time: some 100 MB
TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Mistake:
    """A way to read a recording wrongly: the column, the question to ask, the remedy, and how to undo it."""

    column: str
    guess: str
    remedy: str
    undo: Callable[[Columns], dict[str, Array]]


@dataclass(frozen=True)
class Balance:
    """Voltage and its unexplained part over each window, V; `noise` is the share that the sensors' noise explains."""

    rows: NDArray[np.int64]
    voltage: Complex
    rest: Complex
    noise: float

    @property
    def doubtful(self) -> bool:
        """Tell whether more goes unexplained than gap and noise are allowed."""
        return self.share > UNDISTURBED + 3.0 * self.noise

    @property
    def worst_row(self) -> int:
        """Row at which most voltage goes unexplained."""
        return int(self.rows[np.argmax(np.abs(self.rest))])

    @property
    def share(self) -> float:
        """Unexplained share of the voltage's energy."""
        total = float(np.sum(np.abs(self.voltage) ** 2))
        return float(np.sum(np.abs(self.rest) ** 2)) / total if total > 0.0 else 0.0


def balance(columns: Columns, drive: Drive, window: int | None = None, *, saturated: bool = False) -> Balance:
    """Return the flux balance of a recording's columns over windows of so many samples (None: as many as keep the
    voltage), with the nominal linear model or the saturated one.

    saturated: some LOOKED windows all over the recording, without those whose currents are outside the nominal model.
    """
    m, size = drive.motor, window or _window(columns)
    ends = np.arange(0, len(columns["theta"]), size)
    asked = _some(len(ends)) if saturated else None
    step = max(BLOCK // size, 1)
    voltage, rest = np.empty((2, max(len(ends) - 1, 0)), dtype=np.complex128)
    for k in range(0, len(voltage), step):
        own = slice(k, k + step)
        voltage[own], rest[own] = _differences(columns, drive, ends[k : k + step + 1], asked, k)
    sensor = math.hypot(drive.converter.current_noise, drive.converter.current_resolution / math.sqrt(12.0))
    span = size * drive.converter.sampling_period
    noise = 4.0 / 3.0 * (m.inductance_d**2 + m.inductance_q**2) * (sensor / span) ** 2
    energy = float(np.mean(np.abs(voltage) ** 2)) if len(voltage) else 0.0
    share = noise / energy if energy > 0.0 else math.inf
    inside = np.isfinite(rest)
    if inside.all():
        return Balance(ends[:-1], voltage, rest, share)
    return Balance(ends[:-1][inside], voltage[inside], rest[inside], share)


def _some(windows: int) -> NDArray[np.int64]:
    """Return some LOOKED beginnings and ends of windows, by their number."""
    some = np.unique(np.linspace(0, windows - 1, min(LOOKED, windows), dtype=np.int64))
    return np.asarray(np.unique(np.minimum([some, some + 1], windows - 1)))


def _differences(
    columns: Columns, drive: Drive, ends: NDArray[np.int64], asked: NDArray[np.int64] | None, first: int
) -> tuple[Complex, Complex]:
    """Return voltage and its unexplained part (V) over the windows between some ends of a recording.

    asked: numbers of the ends at which the saturated model is asked (None: the linear one everywhere); `first` is the
    number of the first end here.
    """
    m, h = drive.motor, drive.converter.sampling_period
    part = slice(int(ends[0]), int(ends[-1]) + 1)
    u = columns["u_alpha"][part] + 1j * columns["u_beta"][part]
    a, b, c = (columns[n][part] for n in PHASES)
    i = (2.0 * a - b - c) / 3.0 + 1j * (b - c) / math.sqrt(3.0)
    rows = ends - ends[0]
    turn = np.exp(1j * columns["theta"][ends])
    if asked is None:
        half_sum, half_gap = 0.5 * (m.inductance_d + m.inductance_q), 0.5 * (m.inductance_d - m.inductance_q)
        psi = half_sum * i[rows] + half_gap * turn**2 * np.conj(i[rows]) + m.magnet_flux * turn
    else:
        own = asked[(asked >= first) & (asked < first + len(ends))] - first
        psi = np.full(len(ends), np.nan, dtype=np.complex128)
        psi[own] = _saturated_flux(m.energy, (i[rows] * np.conj(turn))[own]) + m.magnet_flux
        psi *= turn
    flux = np.concatenate([[0j], np.cumsum(h * u[:-1])])[rows]
    drop = np.concatenate([[0j], np.cumsum(0.5 * h * m.resistance * (i[:-1] + i[1:]))])[rows]
    span = h * int(ends[1] - ends[0])
    voltage: Complex = np.asarray(np.diff(flux) / span, dtype=np.complex128)
    return voltage, voltage - np.diff(drop + psi) / span


def _saturated_flux(energy: AnyEnergy, current: Complex) -> Complex:
    """Return d + j q (Wb) (n,) of currents d + j q (A), not a number where the model does not hold them."""
    out = np.full(len(current), np.nan, dtype=np.complex128)
    for k, i in enumerate(current):
        with contextlib.suppress(PhysicsError):
            d, q = flux_from_current(energy, float(i.real), float(i.imag))
            out[k] = complex(float(d), float(q))
    return out


def _window(columns: Columns) -> int:
    """Return the longest of 8, 4, 2, 1 samples whose averages keep a fifth of the voltage's energy."""
    u = [columns[n] for n in VOLTAGES]
    energy = sum(float(x @ x) for x in u)
    for size in (8, 4, 2):
        whole = len(u[0]) // size * size
        means = [x[:whole].reshape(-1, size).mean(axis=1) for x in u]
        if size * sum(float(x @ x) for x in means) >= 0.2 * energy:
            return size
    return 1


def mistakes(drive: Drive) -> Iterator[Mistake]:
    """Yield every mistake that is looked for, the likely ones first."""
    for scale, guess, unit in ((1e-3, "in mA", "mA"), (1e3, "in kA", "kA")):
        remedy = f'convert i_a, i_b, i_c to A or map them with unit = "{unit}"'
        yield Mistake("i_a", f"currents are {guess}", remedy, _scaled(PHASES, scale))
    yield from theta_mistakes(drive)
    for order in itertools.permutations(PHASES):
        if order != PHASES:
            names = ", ".join(order)
            wrong = next(n for n, o in zip(PHASES, order, strict=True) if n != o)
            yield Mistake(wrong, f"phases are swapped (order {names})", "reorder i_a, i_b, i_c", _reordered(order))
    yield Mistake(
        "i_a", "currents are counted out of the motor", "map i_a, i_b, i_c with scale = -1", _scaled(PHASES, -1)
    )
    for scale, unit in ((1e3, "kV"), (1e-3, "mV")):
        remedy = f'convert u_alpha, u_beta to V or map them with unit = "{unit}"'
        yield Mistake("u_alpha", f"voltages are in {unit}", remedy, _scaled(VOLTAGES, scale))
    yield Mistake(
        "u_alpha", "voltages have the wrong sign", "map u_alpha, u_beta with scale = -1", _scaled(VOLTAGES, -1)
    )
    yield Mistake("u_beta", "u_beta has the wrong sign", "map u_beta with scale = -1", _scaled(("u_beta",), -1))
    yield Mistake("u_alpha", "u_alpha and u_beta are exchanged", "exchange their columns", _exchanged)
    for part in (1.0, 0.5):
        remedy = f"multiply u_alpha, u_beta by {'' if part == 1.0 else 'half '}u_dc"
        yield Mistake("u_alpha", "voltages are per unit of the link", remedy, _per_unit(part))


def theta_mistakes(drive: Drive, zeros: Sequence[float] = (0.0, 0.5, -0.5, 1.0)) -> Iterator[Mistake]:
    """Yield the mistakes of the angle: unit, mechanical, sense; then the same with another zero.

    `zeros` (of pi): the magnet's south, or the axis of the back-EMF, taken for theta = 0.
    """
    pairs, degree = float(drive.motor.pole_pairs), math.pi / 180.0
    units = [
        (1.0, "", ""),
        (degree, "in degrees", 'map it with unit = "deg"'),
        (pairs, "mechanical", "multiply it by pole_pairs or map it with mechanical = true"),
        (pairs * degree, "in mechanical degrees", 'map it with unit = "deg", mechanical = true'),
        (TURN, "in turns", 'map it with unit = "rev"'),
        (pairs * TURN, "in mechanical turns", 'map it with unit = "rev", mechanical = true'),
        (1.0 / pairs, "multiplied by pole_pairs twice", "divide it by pole_pairs"),
        (2.0, "half of the electrical angle", "check whether pole_pairs counts pairs of poles"),
        (0.5, "twice the electrical angle", "check whether pole_pairs counts poles"),
    ]
    seen: set[float] = set()
    chosen = [u for u in units if not (u[0] in seen or seen.add(u[0]))]  # type: ignore[func-returns-value]
    for zero in zeros:
        for scale, text, remedy in chosen:
            for sense in (1.0, -1.0):
                if (scale, sense, zero) == (1.0, 1.0, 0.0):
                    continue
                parts = [text] if text else []
                advice = [remedy] if remedy else []
                if sense < 0.0:
                    parts.append("counted backwards (or phases b and c swapped in currents and voltages)")
                    advice.append("map it with scale = -1")
                if zero:
                    parts.append(f"{abs(zero) * 180:.0f} degrees {'behind' if zero > 0 else 'ahead'}")
                    advice.append(f"map it with offset = {zero * math.pi:.4f}")
                yield Mistake(
                    "theta", "theta is " + " and ".join(parts), " and ".join(advice), _turned(sense * scale, zero)
                )


def _scaled(names: tuple[str, ...], factor: float) -> Callable[[Columns], dict[str, Array]]:
    return lambda c: {**c, **{n: factor * c[n] for n in names}}


def _reordered(order: tuple[str, ...]) -> Callable[[Columns], dict[str, Array]]:
    return lambda c: {**c, **{n: c[o] for n, o in zip(PHASES, order, strict=True)}}


def _exchanged(c: Columns) -> dict[str, Array]:
    return {**c, "u_alpha": c["u_beta"], "u_beta": c["u_alpha"]}


def _per_unit(part: float) -> Callable[[Columns], dict[str, Array]]:
    return lambda c: {**c, **{n: part * c["u_dc"] * c[n] for n in VOLTAGES}}


def _turned(factor: float, zero: float) -> Callable[[Columns], dict[str, Array]]:
    return lambda c: {**c, "theta": factor * c["theta"] + zero * math.pi}


class Unanswered(Finding):
    """A recording that contradicts the nominal model by no mistake that is known: a diagnosis may explain it."""


def contradictions(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Raise BadInput for the mistake that explains what recordings contradict; return what no mistake explains."""
    read = [(r, balance(r.columns, drive)) for r in recordings]
    doubtful = [(r, b) for r, b in read if b.doubtful and not _saturation_explains(r, drive)]
    found = _explanations(doubtful, drive)
    if found:
        m = found[0]
        answered = [(r, b) for r, b in doubtful if _explains(m, r, b, drive) is not None]
        r, b = answered[0]
        k, after = b.worst_row, balance(m.undo(r.columns), drive).share
        others = f" (and in {len(answered) - 1} other recordings)" if len(answered) > 1 else ""
        raise BadInput(
            f"{r.file}: row {k} of column '{m.column}' is {r.columns[m.column][k]:.6g}, and currents, angle and "
            "nominal "
            f"model leave {percent(b.share)} of the commanded voltage unexplained{others}, at most "
            f"{percent(UNDISTURBED)} would be a gap; it falls to {percent(after)} if "
            f"{', or '.join(x.guess for x in found)}: {m.remedy}"
        )
    off_axis(recordings, drive)
    return [
        Unanswered(
            r.file, "u_alpha", b.worst_row,
            f"{r.file}: row {b.worst_row} of column 'u_alpha': {percent(b.share)} of the commanded voltage is "
            f"unexplained by currents, angle and nominal model (at most {percent(UNDISTURBED)} is usual), and no "
            "single "
            "wrong unit, sign or order explains it; a large gap, a wrong nominal value, or several mistakes at once",
        )
        for r, b in doubtful if b.share > 0.7
    ]  # fmt: skip


def _saturation_explains(r: CampaignRecording, drive: Drive) -> bool:
    """Return whether a recording agrees with the nominal model once its saturation is asked, too, in at least half of
    its windows."""
    with np.errstate(all="ignore"):  # currents of a wrong unit
        told = balance(r.columns, drive, saturated=True)
    asked = min(LOOKED, len(r.t) // _window(r.columns))
    return len(told.rows) >= 0.5 * asked and not told.doubtful


def percent(share: float) -> str:
    """Return a share in percent, or how many times the whole it is; two digits, no power of ten."""
    if share < 10.0:
        return f"{plain(100.0 * share)} %"
    return f"{plain(share)} times all"


def plain(x: float) -> str:
    """Return a number of two digits as a person writes it."""
    rounded = float(f"{x:.2g}")
    return f"{rounded:.0f}" if abs(rounded) >= 10.0 else f"{rounded:g}"


def _explains(m: Mistake, r: CampaignRecording, b: Balance, drive: Drive) -> float | None:
    """Return the share left once a mistake is undone, None where that does not explain the recording."""
    after = balance(m.undo(r.columns), drive)
    good = after.share <= EXPLAINED + after.noise and after.share * BETTER <= b.share
    return after.share if good else None


def _explanations(doubtful: Sequence[tuple[CampaignRecording, Balance]], drive: Drive) -> list[Mistake]:
    """Return the mistake that answers for most recordings, with a second one that does as well.

    Where none answers for all, theta and another column may both be wrong; else the recordings differ among themselves.
    """
    table: list[tuple[int, float, Mistake]] = []
    for m in mistakes(drive):
        shares = [s for r, b in doubtful if (s := _explains(m, r, b, drive)) is not None]
        if shares:
            table.append((len(shares), float(np.mean(shares)), m))
    most = max((n for n, _, _ in table), default=0)
    if most < len(doubtful):
        for m in _both(drive):
            if all(_explains(m, r, b, drive) is not None for r, b in doubtful):
                return [m]
    best = min((s for n, s, _ in table if n == most), default=0.0)
    return [m for n, s, m in table if n == most and s <= TIE * best + 1e-3][:2]


def _both(drive: Drive) -> Iterator[Mistake]:
    """Yield a mistake of theta's unit or sense together with one of another column."""
    others = [m for m in mistakes(drive) if m.column != "theta"]
    for a in theta_mistakes(drive, (0.0,)):
        for b in others:
            text, remedy = f"{a.guess} and {b.guess}", f"{a.remedy}, and {b.remedy}"
            yield Mistake("theta", text, remedy, lambda c, a=a, b=b: b.undo(a.undo(c)))  # type: ignore[misc]


def off_axis(recordings: Sequence[CampaignRecording], drive: Drive) -> None:
    """Raise BadInput where theta does not turn the injected voltage to its axis, but a mistaken theta would.

    This sees a wrong theta at locked rotor and low speed too, where the balance hardly depends on it.
    """
    for r in recordings:
        share = _share_on_axis(r.columns, drive, r.injection_axis)
        if share is None or share > OFF_AXIS:
            continue
        for m in theta_mistakes(drive):
            after = _share_on_axis(m.undo(r.columns), drive, r.injection_axis)
            if after is not None and after > ON_AXIS:
                raise BadInput(
                    f"{r.file}: row 0 of column 'theta' is {r.theta[0]:.6g}; turned by theta, only "
                    f"{percent(max(share, 0.0))} of the injected voltage lies along axis {r.injection_axis} (at least "
                    f"{percent(ON_AXIS)} expected), it does if {m.guess}: {m.remedy}"
                )


def _share_on_axis(columns: Columns, drive: Drive, axis: str) -> float | None:
    """Return how much more of the ripple's energy lies along the axis than across it, of all; None without ripple."""
    n = max(round(1.0 / (drive.injection.frequency * drive.converter.sampling_period)), 2)
    u = columns["u_alpha"] + 1j * columns["u_beta"]
    whole = len(u) // n * n
    if axis == "none" or not whole:
        return None
    cut = u[:whole].reshape(-1, n)
    turned = (cut - cut.mean(axis=1, keepdims=True)).ravel() * np.exp(-1j * columns["theta"][:whole])
    energy = float(np.sum(np.abs(turned) ** 2))
    if energy <= whole * (0.1 * drive.injection.amplitude) ** 2:
        return None
    return float(np.sum(turned**2).real) / energy * (1.0 if axis == "d" else -1.0)
