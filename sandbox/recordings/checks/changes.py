"""The table of mistakes: each a change of some columns or of the motor's stated values that undoes
it, and its words.

A change names only what the log holds, in the log's own words, and what the campaign states.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from model.frames import SQRT3
from model.mapped import MappedMotor
from model.parameters import Drive, Motor
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import PHASES, VOLTAGES, Columns, Complex

THIRD = 2.0 * math.pi / 3.0
Source = Mapping[str, str]  # standard name -> the log's column, of what the log holds
OURS: Source = {n: n for n in ("t", "theta", "u_dc", *PHASES, *VOLTAGES)}
DUTIES = ("d_a", "d_b", "d_c")
ANGLE, CURRENT, VOLTAGE, MOTOR = "angle", "current", "voltage", "motor"
NEAR_RATED = 0.1  # relative: a base so near to the rated current is that
CONVENTIONS = (
    (math.sqrt(2.0), "rms values, not peak: rms for peak"),
    (0.5, "peak to peak for peak"),
    (math.sqrt(1.5), "of the power-invariant transformation, too small by sqrt(3/2)"),
    (1.0 / math.sqrt(1.5), "of the power-invariant transformation, too large by sqrt(3/2)"),
)


@dataclass(frozen=True)
class Change:
    """What undoes one mistake.

    part: of what; column: the standard column whose value is shown, empty for the motor; guess
    and remedy: words;
    signal: what makes a recording's current or voltage vector of its columns; scale: of that
    vector; turn: factor of the angle; values: factors of resistance, half sum and half difference
    of the inductances, and magnet flux;
    convention: a factor that drives really differ by; fitted: its factor was; mistakes: as how many
    it counts, one that was fitted as two; order: one of the phases, which in currents and voltages
    both is an angle; line: of a data sheet that gives values between two terminals.
    """

    part: str
    column: str
    guess: str
    remedy: str
    signal: Callable[[Columns], Complex] | None = None
    scale: float = 1.0
    turn: float = 1.0
    values: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    convention: bool = False
    fitted: bool = False
    mistakes: int = 1
    order: bool = False
    line: bool = False

    @cached_property
    def changed(self) -> frozenset[str]:
        """What it changes; two changes of one thing do not go together."""
        values = zip(("R", "mean L", "half gap of L", "flux"), self.values, strict=True)
        own = {name for name, factor in values if factor != 1.0}
        if self.signal is not None:
            own |= {f"{self.part}'s signal", *(["order"] * self.order)}
        if self.scale != 1.0:
            own.add(f"{self.part}'s {'sign' if self.scale == -1.0 else 'scale'}")
        return frozenset({*own, ANGLE} if self.turn != 1.0 else own)


def current_of(columns: Columns, signs: tuple[float, float] = (1.0, 1.0)) -> Complex:
    """Return the current vector; signs: of phases a and b, c then being minus their sum."""
    a, b, c = (columns[n] for n in PHASES)
    if signs != (1.0, 1.0):
        a, b = signs[0] * a, signs[1] * b
        c = -a - b
    return np.asarray((2.0 * a - b - c) / 3.0 + 1j * ((b - c) / SQRT3))


def _of_link(part: float, columns: Columns) -> Complex:
    """Return voltages (V) that are stated as so many parts of the link's."""
    return np.asarray(part * columns["u_dc"] * voltage_of(columns))


def voltage_of(columns: Columns) -> Complex:
    """Return the voltage vector."""
    return np.asarray(columns["u_alpha"] + 1j * columns["u_beta"])


def changes(drive: Drive, source: Source) -> list[Change]:
    """Return every change that can be asked of a log, the likely ones first."""
    return [
        *_of_currents(source),
        *angles(drive, source),
        *_of_voltages(source),
        *_of_motor(drive.motor),
    ]


def of_base(part: str, scale: float, drive: Drive, source: Source) -> Change:
    """Return the change of currents or voltages that are so many times too small, by a factor that
    was fitted."""
    kind = currents_held(source) if part == CURRENT else voltages_held(source)
    what, unit, rated = (
        ("currents", "A", drive.motor.rated_current) if part == CURRENT else ("voltages", "V", 0.0)
    )
    base = f"per unit of {scale:.3g} {unit}" if scale > 1.0 else f"counts of {scale:.3g} {unit}"
    if rated and abs(scale / rated - 1.0) < NEAR_RATED:
        base, scale = f"per unit of rated_current = {rated:g} A", rated
    remedy = f"map {named(source, *kind)} with scale = {scale:.4g}"
    return Change(
        part,
        _column(kind[0], "i_a" if part == CURRENT else "u_alpha"),
        f"{what} are {base}",
        remedy,
        scale=scale,
        fitted=True,
        mistakes=2,
    )


def source_of(r: CampaignRecording) -> Source:
    """Return the log's columns by standard name; our own names where nothing was mapped."""
    return r.source or OURS


def named(source: Source, *names: str) -> str:
    """Return columns in the log's words."""
    return ", ".join(source.get(n, n) for n in names)


def currents_held(source: Source) -> tuple[str, ...]:
    """Return the signals of which a log's phase currents are made."""
    two = tuple(n for n in PHASES if n in source)
    kinds = (PHASES, *([two] if len(two) == 2 else []), ("i_alpha", "i_beta"), ("i_d", "i_q"))
    return next((k for k in kinds if all(n in source for n in k)), PHASES)


def voltages_held(source: Source) -> tuple[str, ...]:
    """Return the signals of which a log's commands are made."""
    kinds = (VOLTAGES, ("u_d", "u_q"), ("u_a", "u_b", "u_c"), DUTIES)
    return next((k for k in kinds if all(n in source for n in k)), VOLTAGES)


def angles(drive: Drive, source: Source) -> Iterator[Change]:
    """Yield the mistakes of the angle: unit, mechanical, poles, sense."""
    if "theta" not in source:  # a constant stands in, or an angle made of a speed
        yield from _speeds(float(drive.motor.pole_pairs), source)
        return
    pairs, degree = float(drive.motor.pole_pairs), math.pi / 180.0
    units = {
        1.0: ("", ""),
        degree: ("in degrees", 'map it with unit = "deg"'),
        pairs: ("mechanical", "multiply it by pole_pairs or map it with mechanical = true"),
        pairs * degree: ("in mechanical degrees", 'map it with unit = "deg", mechanical = true'),
        math.tau: ("in turns", 'map it with unit = "rev"'),
        pairs * math.tau: ("in mechanical turns", 'map it with unit = "rev", mechanical = true'),
        1.0 / pairs: ("multiplied by pole_pairs twice", "divide it by pole_pairs"),
        2.0: ("half of the electrical angle", "check whether pole_pairs counts pairs of poles"),
        0.5: ("twice the electrical angle", "check whether pole_pairs counts poles"),
    }
    own = dict(reversed(list(units.items()))) | {1.0: ("", "")}
    for turn, (text, remedy) in units.items():
        if own[turn] != (text, remedy):
            continue  # pairs that are 1 or 2: the earlier words count
        for sense in (1.0, -1.0):
            if (turn, sense) == (1.0, 1.0):
                continue
            back = ["counted backwards"] if sense < 0.0 else []
            advice = ["map it with scale = -1"] if sense < 0.0 else []
            yield Change(
                ANGLE,
                "theta",
                " and ".join([*([text] if text else []), *back]),
                " and ".join([*([remedy] if remedy else []), *advice]),
                turn=sense * turn,
                mistakes=1 + bool(text and back),
            )


def _speeds(pairs: float, source: Source) -> Iterator[Change]:
    """Yield the mistakes of a speed of which the angle is made: unit, mechanical, sense."""
    if "speed" not in source:
        return
    rpm = math.tau / 60.0
    units = {
        rpm: ("in rpm, not in rad/s", 'map it with unit = "rpm"'),
        1.0 / rpm: ("in rad/s, not in rpm", 'map it with unit = "rad/s"'),
        math.tau: ("in turns a second, not in rad/s", 'map it with unit = "Hz"'),
        1.0 / math.tau: ("in rad/s, not in turns a second", 'map it with unit = "rad/s"'),
        60.0: ("in turns a second, not in rpm", 'map it with unit = "Hz"'),
        1.0 / 60.0: ("in rpm, not in turns a second", 'map it with unit = "rpm"'),
    }
    shaft = {1.0: ("", "")}
    if pairs > 1.0:
        shaft[pairs] = ("mechanical", "map it with mechanical = true")
        shaft[1.0 / pairs] = ("electrical, not mechanical", "map it without mechanical = true")
    for (size, own), (times, of) in itertools.product(
        [(1.0, ("", "")), *units.items()], shaft.items()
    ):
        for sense in (1.0, -1.0):
            parts = [own, of, *([("counted backwards", "map it with scale = -1")] * (sense < 0.0))]
            guess, remedy = (" and ".join(filter(None, x)) for x in zip(*parts, strict=True))
            if guess:
                wrong = sum(1 for guess, _ in parts if guess)
                yield Change(
                    ANGLE, "theta", guess, remedy, turn=sense * size * times, mistakes=wrong
                )


def of_angle(change: Change | None, zero: float, source: Source) -> tuple[str, str]:
    """Return in words what is wrong of an angle, and what to do; with the order of phases in
    currents and voltages that is the same, first where it is one thing and the angle's are two."""
    if change is None and not zero:
        return "", ""
    # the zero of an angle that is made of a speed is nobody's reading
    name, shift = source.get("theta", source.get("speed", "theta")), zero
    if "theta" not in source and "speed" in source:
        shift = 0.0
    guess, remedy = ("", "") if change is None else (change.guess, change.remedy)
    if shift:
        off = f"{abs(math.degrees(zero)):.0f} degrees {'behind' if zero > 0.0 else 'ahead'}"
        guess = f"{guess} and {off}" if guess else off
        offset = f"offset = {zero:.4f}"
        remedy = (
            f"{remedy} and {offset}"
            if "map" in remedy
            else " and ".join(filter(None, [remedy, f"map it with {offset}"]))
        )
    guess = f"{name} is {guess}" if guess else ""
    order = _order_of(change, zero, source)
    if not order:
        return guess, remedy
    columns = f"{named(source, *currents_held(source))}, {named(source, *voltages_held(source))}"
    phases = f"reorder the phases of {columns}"
    if round(math.degrees(zero)) == 180:
        phases = f"map {columns} with scale = -1"
    if zero and change is not None and change.turn == -1.0:
        return f"{order} or, which is the same, {guess}", (
            f"{phases}, or {remedy.replace('map it', f'map {name}')}"
        )
    return f"{guess} or, which is the same, {order}", f"{remedy}, or {phases}"


def _order_of(change: Change | None, zero: float, source: Source) -> str:
    """Return in words which order of phases in currents and voltages looks as an angle does; empty
    where none does, or the log holds no phases of them."""
    turned = currents_held(source)[0] == "i_d" or voltages_held(source)[0] == "u_d"
    degrees, back = round(math.degrees(zero)), change is not None
    if change is not None and change.turn != -1.0:
        return ""  # a unit or a gear beside it
    if turned or degrees not in (0, 120, -120, 180) or "theta" not in source:
        return ""
    if degrees == 180:
        return "" if back else "currents and voltages both have the wrong sign"
    if back:
        pair = {0: "b and c", 120: "a and b", -120: "a and c"}[degrees]
        return f"phases {pair} are swapped in currents and voltages"
    order = {120: "c, a, b", -120: "b, c, a"}.get(degrees)
    return f"phases stand in the order {order} in currents and voltages" if order else ""


def _of_currents(source: Source) -> Iterator[Change]:
    kind = currents_held(source)
    first, every = _column(kind[0], "i_a"), named(source, *kind)
    for scale, unit in ((1e-3, "mA"), (1e3, "kA")):
        remedy = f'convert {every} to A or map them with unit = "{unit}"'
        yield Change(CURRENT, first, f"currents are in {unit}", remedy, scale=scale)
    remedy = f"map {every} with scale = -1"
    yield Change(CURRENT, first, "currents are counted out of the motor", remedy, scale=-1.0)
    if kind[0] in PHASES:
        yield from _orders(source, kind)
    if len(kind) == 2 and kind[0] in PHASES:
        for n in kind:
            yield _reversed(n, kind, source)
    if kind in (("i_alpha", "i_beta"), ("i_d", "i_q")):
        yield from _of_axes(kind, source, CURRENT, current_of)
    for factor, guess in CONVENTIONS:
        remedy = f"give peak values of a phase, map {every} with scale = {factor:.4g}"
        yield Change(CURRENT, first, f"currents are {guess}", remedy, scale=factor, convention=True)


def _column(name: str, usual: str) -> str:
    """Return the standard column of which a value can be shown."""
    return name if name in (*PHASES, *VOLTAGES) else usual


def _orders(source: Source, kind: tuple[str, ...]) -> Iterator[Change]:
    """Yield the orders of phase currents; a phase that is not recorded is minus the sum of the
    others."""
    for order in itertools.permutations(PHASES):
        if order == PHASES:
            continue
        wrong = next(n for n, o in zip(PHASES, order, strict=True) if n != o)
        said = ", ".join(source.get(n, n) for n in order)
        if len(kind) == 3:
            guess, remedy = (
                f"phases are swapped (order {said})",
                f"reorder {named(source, *PHASES)}",
            )
        else:
            own = [
                f"{source[o]} is that of {n}"
                for n, o in zip(PHASES, order, strict=True)
                if o in kind
            ]
            guess, remedy = f"phases are swapped (order {said}: {', '.join(own)})", "map them so"
        yield Change(
            CURRENT, _column(wrong, "i_a"), guess, remedy, signal=_reordered(order), order=True
        )


def _reordered(order: tuple[str, ...]) -> Callable[[Columns], Complex]:
    return lambda c: current_of({n: c[o] for n, o in zip(PHASES, order, strict=True)})


def _reversed(name: str, kind: tuple[str, ...], source: Source) -> Change:
    """Return the change of one of two sensors' sign; the third phase follows."""

    def signal(c: Columns) -> Complex:
        """Return the current with that sensor's sign reversed."""
        own = {n: (-c[n] if n == name else c[n]) for n in kind}
        third = next(n for n in PHASES if n not in kind)
        return current_of({**own, third: -np.sum(list(own.values()), axis=0)})

    guess = f"the sensor {named(source, name)} counts the other way than the other one"
    return Change(CURRENT, name, guess, f"map {named(source, name)} with scale = -1", signal=signal)


def _of_axes(
    kind: tuple[str, ...], source: Source, part: str, vector: Callable[[Columns], Complex]
) -> Iterator[Change]:
    """Yield mistakes of two axes, of the stator or of the rotor."""
    x, y = (source.get(n, n) for n in kind)
    turns = kind[0] in ("i_d", "u_d")

    def frame(c: Columns) -> Complex:
        """Return the rotor's direction for its axes, 1 for the stator's."""
        return np.asarray(np.exp(1j * c["theta"])) if turns else np.ones(1, dtype=np.complex128)

    column = "i_a" if part == CURRENT else "u_beta"
    other = Change(
        part,
        column,
        f"{y} has the wrong sign",
        f"map {y} with scale = -1",
        signal=lambda c: np.conj(vector(c) / frame(c)) * frame(c),
        order=not turns,
    )
    swap = Change(
        part,
        column,
        f"{x} and {y} are exchanged",
        "exchange their columns",
        signal=lambda c: 1j * np.conj(vector(c) / frame(c)) * frame(c),
    )
    yield from (other, swap)


def _of_voltages(source: Source) -> Iterator[Change]:
    kind, duties = voltages_held(source), DUTIES
    every = named(source, *kind)
    if kind != duties:
        for scale, unit in ((1e3, "kV"), (1e-3, "mV")):
            remedy = f'convert {every} to V or map them with unit = "{unit}"'
            yield Change(VOLTAGE, "u_alpha", f"voltages are in {unit}", remedy, scale=scale)
    guess = (
        "voltages have the wrong sign"
        if kind != duties
        else "duties are those of the lower switches"
    )
    remedy = f"map {every} with scale = -1" + (" and offset = 1" if kind == duties else "")
    yield Change(VOLTAGE, "u_alpha", guess, remedy, scale=-1.0)
    if len(kind) == 2:
        yield from _of_axes(kind, source, VOLTAGE, voltage_of)
    for undone, order in _phase_orders():
        if len(kind) == 3:
            text = ", ".join(source.get(kind["abc".index(p)], p) for p in order)
            guess, remedy = f"the voltages' phases are swapped (order {text})", f"reorder {every}"
        elif order != "acb" and kind == VOLTAGES:  # that one is a sign of u_beta
            taken = {"cab": "bca", "bca": "cab"}.get(order, order)
            guess = f"the voltages' phases are taken in the order {', '.join(taken)}"
            remedy = f"reorder the phases of which {every} are made"
        else:
            continue
        yield Change(VOLTAGE, "u_alpha", guess, remedy, signal=undone, order=True)
    if kind != duties:
        link = source.get("u_dc", "u_dc")
        for part, said in ((1.0, link), (0.5, f"half {link}"), (1.0 / SQRT3, f"{link} / sqrt(3)")):
            remedy = f"multiply {every} by {said}"
            yield Change(
                VOLTAGE,
                "u_alpha",
                "voltages are per unit of the link",
                remedy,
                signal=partial(_of_link, part),
            )
        for factor, guess in (
            *CONVENTIONS,
            (1.0 / SQRT3, "between two phases: line for phase voltage"),
        ):
            remedy = f"give peak values of a phase, map {every} with scale = {factor:.4g}"
            yield Change(
                VOLTAGE, "u_alpha", f"voltages are {guess}", remedy, scale=factor, convention=True
            )


def _phase_orders() -> Iterator[tuple[Callable[[Columns], Complex], str]]:
    """Yield what puts the phases of a voltage vector right, and the order in which they stand."""
    for k, order in ((1, "cab"), (-1, "bca")):
        yield lambda c, k=k: voltage_of(c) * np.exp(1j * k * THIRD), order  # type: ignore[misc]
    for k, order in ((0, "acb"), (1, "bac"), (-1, "cba")):
        yield lambda c, k=k: np.conj(voltage_of(c)) * np.exp(1j * k * THIRD), order  # type: ignore[misc]


def _of_motor(m: Motor) -> Iterator[Change]:
    """Yield other readings of the stated values; a flux map's own are not stated."""

    def of(guess: str, remedy: str, r: float = 1.0, mean: float = 1.0, flux: float = 1.0) -> Change:
        """Return a change of the motor's values."""
        values, line = (r, mean, mean, flux), "between two terminals" in guess
        words = f"{remedy} in [motor]"
        return Change(MOTOR, "", guess, words, values=values, convention=True, line=line)

    if isinstance(m, MappedMotor):
        yield of("resistance is that between two terminals", "halve resistance", 0.5)
        yield of("resistance is in mohm", "divide resistance by 1000", 1e-3)
        return
    both = "inductance_d and inductance_q"
    every = f"resistance, {both}"
    yield of(f"{every} are those between two terminals", f"halve {every}", 0.5, 0.5)
    one = f"{every} are those between one terminal and the two others together"
    yield of(one, f"multiply {every} by 2/3", 2.0 / 3.0, 2.0 / 3.0)
    yield of("resistance is that between two terminals", "halve resistance", 0.5)
    yield of(f"{both} are those between two terminals", f"halve {both}", 1.0, 0.5)
    yield of("resistance is in mohm", "divide resistance by 1000", 1e-3)
    yield of(f"{both} are in mH", f"divide {both} by 1000", 1.0, 1e-3)
    yield of(f"{both} are in uH", f"divide {both} by 1e6", 1.0, 1e-6)
    yield of("resistance is 1000 times too small", "multiply resistance by 1000", 1e3)
    yield of(f"{both} are 1000 times too small", f"multiply {both} by 1000", 1.0, 1e3)
    if m.inductance_d != m.inductance_q:
        turned = (1.0, 1.0, -1.0, 1.0)
        yield Change(MOTOR, "", f"{both} are exchanged", "exchange them in [motor]", values=turned)
    yield from (
        of(guess, remedy, flux=factor)
        for factor, guess, remedy in fluxes(float(m.pole_pairs), m.magnet_flux)
    )


def fluxes(p: float, flux: float) -> Iterator[tuple[float, str, str]]:
    """Yield factors of the magnet flux (stated, Wb, with p pole pairs), what else the number may
    be, what to do."""
    if p > 1.0:
        yield (
            1.0 / p,
            "magnet_flux is the back-EMF constant per mechanical rad/s",
            f"divide magnet_flux by pole_pairs = {p:g}",
        )
        yield (
            1.0 / p / SQRT3,
            "magnet_flux is the back-EMF between two terminals per mechanical rad/s",
            (f"divide magnet_flux by sqrt(3) and pole_pairs = {p:g}"),
        )
    yield (
        1.0 / (1.5 * p),
        "magnet_flux is the torque constant (N m/A)",
        f"divide magnet_flux by 1.5 pole_pairs = {1.5 * p:g}",
    )
    yield 1e-3, "magnet_flux is in mWb", "divide magnet_flux by 1000"
    yield 1.0 / SQRT3, "magnet_flux is that between two terminals", "divide magnet_flux by sqrt(3)"
    yield math.sqrt(2.0), "magnet_flux is an rms value", "multiply magnet_flux by sqrt(2)"
    yield (
        math.sqrt(2.0 / 3.0),
        "magnet_flux is an rms value between two terminals",
        "multiply magnet_flux by sqrt(2/3)",
    )
    yield 0.5, "magnet_flux is a peak-to-peak value", "halve magnet_flux"
    if flux > 1.0:
        found = 60.0 / (math.tau * SQRT3 * flux * p)
        yield (
            found / flux,
            "magnet_flux is Kv (rpm/V)",
            (
                "write magnet_flux = 60 / (2 pi sqrt(3) Kv pole_pairs) = "
                f"{found:.4g}, where V is the peak between two terminals,"
            ),
        )
