"""Candidates: every effect of the library with the values of its companions that it may begin from.

An effect that is strongly nonlinear stands in the equations with several candidates: its time
constant, frequency, stiffness or order at trial values, and a delay by finite changes (chords)
beside its slope.  The same algebra then chooses the set of effects and where each of them begins;
nothing is probed or scanned elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from model.effects import library
from model.effects.card import Effect, Parameter
from model.errors import BadInput
from sandbox.gap.evidence.fit import NEAR
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.priors import WIDE, Coordinate, of_effect, of_part
from sandbox.gap.evidence.spectrum import best_values, link_lines
from sandbox.plant.sets import complete, further_parts, soft_current

# typical sizes: octaves up to three sampling periods of a delay
CHORDS = (2.0, 4.0, 8.0, 16.0, 32.0)
# times the usual zone of a current's sign: where an effect's other form begins
ZONES = (1.0, 5.0, 25.0)
BEGUN = 1e-3  # of an amplitude's typical size: a part that a fit begins with is on, and hardly more


@dataclass(frozen=True)
class Candidate:
    """An effect, or a further part of one, and where it may begin.

    start: values of its companions; chord: the finite change (in the size's unit) that stands for
    its slope, 0: the slope; part: which of the effect's parts; tried: how many values of the
    companions were looked at to find these.
    """

    effect: str
    start: Mapping[str, float] = field(default_factory=dict)
    chord: float = 0.0
    part: int = 1
    tried: int = 1

    def coordinates(self, point: ParameterPoint, label: str = "") -> list[Coordinate]:
        """Return the columns that the candidate adds to the equations at a point where the effect
        is off."""
        card, start = library.load_effect(self.effect), dict(self.start)
        if card.ordinarily is not None:  # it may be on, in a form that is ordinary
            start = {k: x for k, x in start.items() if x or not point.values[k]}
        drive, values = point.prepared.campaign.drive, {**point.values, **start}
        along = tuple(start.items())
        if self.part > 1:
            own = of_part(card, self.part, drive, values)
            return [replace(c, label=f"{c.label}{label}", along=along) for c in own]
        own = of_effect(self.effect, drive, values)
        off = [c for c in own if c.form != "log" and c.names[0] not in start]
        if not off:  # nothing but shapes: there or not, one straight way between
            first = next(iter(start))
            return [Coordinate(f"{self.effect}{label}", 0.0, 1.0, "share", (first,), along)]
        if self.chord:
            off = [
                replace(c, step=self.chord, within=2.0 * abs(self.chord) / c.deviation) for c in off
            ]
        return [replace(c, label=f"{c.label}{label}", along=along) for c in off]

    @property
    def slope(self) -> Candidate:
        """The same effect by its slope, in its first form: in the other one it has none where it is
        off."""
        forms = library.load_effect(self.effect).otherwise is not None
        return replace(
            self, chord=0.0, start=dict.fromkeys(self.start, 0.0) if forms else self.start
        )

    def begun(self, point: ParameterPoint) -> dict[str, float]:
        """Return the values with which a fit begins that has the candidate."""
        out = dict(self.start)
        if self.part > 1:
            drive, card = point.prepared.campaign.drive, library.load_effect(self.effect)
            part = card.part(self.part)
            moved = {
                c.names[0] for c in of_part(card, self.part, drive, {**point.values, **self.start})
            }
            for p in part.parameters:
                name = card.public(self.part, p.name)
                if p.name in part.switches and name in moved:
                    out[name] = BEGUN * p.typical_for(drive.motor, drive.converter)
        return out


def candidates(
    point: ParameterPoint, exclude: Sequence[str] = (), *, left: float = math.inf
) -> list[Candidate]:
    """Return all candidates of the library at a point that leaves so many times the noise: of
    much, finite changes of delays beside their slopes; of more, other forms of effects, which are
    told by their typical size alone."""
    out = []
    for effect in library.causes():
        if effect not in exclude:
            own = list(_beginnings(point, library.load_effect(effect)))
            out += own
            if left > 1.0 and len(own) == 1:
                out += _chords(point, own[0])
            if left > NEAR:
                out += _other_forms(point, effect)
    return out


def free_forms(point: ParameterPoint, exclude: Sequence[str] = ()) -> list[Candidate]:
    """Return the candidates that are curves: they fit nearly anything at their place, so other
    effects come first."""
    cards = map(library.load_effect, library.effect_names())
    return [x for c in cards if c.free and c.name not in exclude for x in _beginnings(point, c)]


def begins_further(effect: str) -> bool:
    """Return whether an effect may be there by a further part alone: its first part is one order
    that no scan moves, as an encoder's error once a turn, and amplitudes have a phase."""
    card = library.load_effect(effect)
    return card.repeats > 1 and bool(card.polar) and not any(p.scan for p in card.parameters)


def further(point: ParameterPoint, effects: Sequence[str]) -> list[Candidate]:
    """Return the next part of effects that can have several, at the orders that explain most of the
    residual."""
    out = []
    for effect in effects:
        card = library.load_effect(effect)
        on = further_parts(card, point.values, library.neutral(point.prepared.campaign.drive.motor))
        k = next((k for k in range(2, card.repeats + 1) if k not in on), None)
        if k is None:
            continue
        part, choices, tried = card.part(k), [], 1
        for p in part.parameters:
            if p.scan and p.scan[2]:
                values, name = (
                    scanned(p, point.prepared.campaign.drive.motor.pole_pairs),
                    card.public(k, p.name),
                )
                tried *= len(values)
                if part.polar:
                    pair = (card.public(k, part.polar[0]), card.public(k, part.polar[1]))
                    values = best_values(point, pair, name, values)
                choices.append([(name, x) for x in values])
        if choices:
            out += [Candidate(effect, dict(c), part=k, tried=tried) for c in product(*choices)]
    return [c for c in out if c.coordinates(point)]


def _beginnings(point: ParameterPoint, card: Effect) -> Iterator[Candidate]:
    """Yield an effect at every combination of the values that its companions may begin from."""
    drive, choices, tried = point.prepared.campaign.drive, [], 1
    for p in card.parameters:
        name = f"{card.name}.{p.name}"
        if p.scan and card.polar:
            low, high, step = p.scan
            pair = (f"{card.name}.{card.polar[0]}", f"{card.name}.{card.polar[1]}")
            values = scanned(p, drive.motor.pole_pairs) if step else []
            found = best_values(point, pair, name, values) if step else link_lines(point, low, high)
            tried *= max(1, len(values) // max(1, len(found)))
            choices.append([(name, x) for x in found])
        elif p.fit == "log":
            size = p.typical_for(drive.motor, drive.converter)
            choices.append([(name, s * size) for s in p.starts])
    for c in product(*choices):
        if possible(point, dict(c)):
            yield Candidate(card.name, dict(c), tried=tried)


def _chords(point: ParameterPoint, slope: Candidate) -> Iterator[Candidate]:
    """Yield finite changes of an effect that is one time (s): pulses that move past each other are
    no straight line."""
    drive = point.prepared.campaign.drive
    own = of_effect(slope.effect, drive, point.values)
    if (
        len(own) != 1
        or own[0].form != "linear"
        or library.parameters()[own[0].names[0]].unit != "s"
    ):
        return
    low, high = replace(own[0], within=np.inf).bounds()
    size = own[0].deviation / WIDE
    for to in (sign * k * size for k in CHORDS for sign in (1.0, -1.0)):
        if low <= own[0].mean + to <= high and possible(
            point, own[0].changes(point.values, own[0].mean + to)
        ):
            yield replace(slope, chord=to)


def _other_forms(point: ParameterPoint, effect: str) -> Iterator[Candidate]:
    """Yield an effect of one size in its other form, as the finite change to its typical size; it
    has none at no size at all.

    Of one with several sizes, with no size, with shapes in its first form, too, or with shapes that
    are none of a zone about zero current, a fit tries the other one.
    """
    drive, card = point.prepared.campaign.drive, library.load_effect(effect)
    if card.otherwise is None:
        return
    shapes = [p for p in card.parameters if p.fit == "log"]
    sizes = [p for p in card.parameters if p.fit not in ("log", "fixed")]
    if len(sizes) != 1 or any(p.typical for p in shapes):
        return
    first = {**point.values, **{card.public(1, p.name): 0.0 for p in shapes}}
    (size,) = (c for c in of_effect(effect, drive, first) if c.form == "linear")
    typical = size.mean + size.deviation / WIDE
    values = {**first, **size.changes(first, typical)}
    usual = soft_current(drive.motor)
    zoned = [card.otherwise(values, k * usual, drive.motor, drive.converter) for k in ZONES]
    for start in zoned if zoned[0] != zoned[-1] else ():
        if possible(point, {**values, **start}):
            yield Candidate(effect, start, chord=typical - size.mean)


def scanned(p: Parameter, pole_pairs: int) -> list[float]:
    """Return the values of a parameter with a scan in steps that are tried; beyond the last,
    multiples of the number of poles where its card says so: the torque of slots has the least
    common multiple of slots and
    poles (Zhu, Howe)."""
    low, high, step = p.scan or (1.0, 0.0, 1.0)
    values = np.arange(low, high + 0.5 * step, step)
    poles = 2.0 * pole_pairs * np.arange(1.0, p.scan_poles + 1.0)
    return [*values.tolist(), *poles[poles > high].tolist()]


def possible(point: ParameterPoint, start: Mapping[str, float]) -> bool:
    """Return whether a drive can have these values beside those of a point (masses, delays that
    bound each other)."""
    drive = point.prepared.campaign.drive
    try:
        complete(drive.motor, drive.converter, {**point.values, **start})
    except BadInput:
        return False
    return True


def at_typical(point: ParameterPoint, exclude: Sequence[str] = ()) -> list[Candidate]:
    """Return one candidate an effect, its companions at typical values: what is known before
    looking at residuals."""
    drive = point.prepared.campaign.drive
    out = []
    for effect in library.causes():
        card = library.load_effect(effect)
        own = [p for p in card.parameters if p.fit == "log"]
        start = {f"{effect}.{p.name}": p.typical_for(drive.motor, drive.converter) for p in own}
        if effect not in exclude:
            out.append(Candidate(effect, start))
    return out
