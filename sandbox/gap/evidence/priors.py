"""What a diagnosis may move: coordinates of a parameter set, and how far each may be expected to
move.

A coordinate is a direction in which a fit is close to linear: a value, its logarithm or reciprocal,
or one component of an amplitude with a phase; cards say which (`model.effects.card`).  A hypothesis
is nothing but a list of effects whose coordinates get a wide prior; every ordinary deviation of
motor and bench keeps the narrow one the campaign states.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from model.effects import library
from model.effects.card import Effect, EffectPart
from model.parameters import Drive, Motor
from sandbox.plant.sets import BENCH, ORDINARY, SIGN_SPREAD, further_parts, soft_current
from sandbox.recordings.campaign import Campaign
from sandbox.replay.identification.ends import ends
from sandbox.replay.sensitivity import mechanical_only

Set = Mapping[str, float]
WIDE = 1.5  # standard deviation of an effect's prior, in its typical size
FARTHEST = 4.0  # standard deviations that an effect may move before its bounds widen
OF_POINT = ("turn", "map")  # forms of what a point has beside its parameters
STEPS = ("share", "presence")  # forms that are there or not, nothing between
REACHED = 0.99  # of them: a value there is at its bound
# how a current's sign goes through zero
WIDTH, SHAPE, CENTER = "bench.soft_current", "bench.soft_shape", "bench.soft_center"
# of their deviations that slopes are taken over: readings of a ripple that just meets the zone's
# corners make them steep over shorter ones (over 1e-4 the width tells itself 36 times as well, in
# squares, as the objective bends within three standard deviations; over 0.05 as it does)
SIGN_STEP = 0.05


@dataclass(frozen=True)
class Coordinate:
    """One direction of a fit: label, prior mean and standard deviation, the parameter(s) it moves
    and how.

    form: "linear", "log", "reciprocal", or "cosine"/"sine" of the pair (amplitude, phase); "share"
    is a step from the neutral value (0) to the values `along` (1), "presence" one from where the
    point stands (1) to the neutral values `along` (0), nothing between; with other forms `along`
    goes with a move.
    """

    label: str
    mean: float
    deviation: float
    form: str
    names: tuple[str, ...]
    along: tuple[tuple[str, float], ...] = ()
    within: float = math.inf  # deviations from the mean beyond which it is no longer ordinary
    most: float = math.inf  # beyond which no drive can have it (a limit of the effect's card)
    # finite change (a chord) that its slope is taken over, 0: a difference so small that it is one
    step: float = 0.0

    @property
    def effect(self) -> str:
        """The effect (or "bench") that the coordinate belongs to."""
        return self.names[0].partition(".")[0]

    @property
    def of_point(self) -> bool:
        """Whether it is none of the parameters': a recording's turn, or a mode of what the flux map
        is off by."""
        return self.form in OF_POINT

    @property
    def mechanical(self) -> bool:
        """Whether it acts on the motion of a free rotor only."""
        return mechanical_only(self.names[0])

    def value(self, values: Set) -> float:
        """Return the coordinate of a completed set."""
        if self.form == "share":
            return 0.0
        x = values[self.names[0]]
        if self.form == "presence":
            return float(x != dict(self.along)[self.names[0]])
        if self.form == "log":
            return math.log(x)
        if self.form == "reciprocal":
            return 1.0 / x
        if self.form == "cosine":
            return x * math.cos(values[self.names[1]])
        if self.form == "sine":
            return x * math.sin(values[self.names[1]])
        return x

    def changes(self, values: Set, to: float) -> dict[str, float]:
        """Return the parameters that bring the coordinate to a value, the others unchanged (polar:
        its other part)."""
        name, companions = self.names[0], dict(self.along)
        if self.form == "share":
            return companions if to else {}
        if self.form == "presence":
            return {} if to >= 0.5 else companions
        if self.form == "log":
            return {name: math.exp(to)}
        if self.form == "reciprocal":
            return {**companions, name: 1.0 / to if to > 0.0 else math.inf}
        if self.form in ("cosine", "sine"):
            amplitude, phase = values[name], values[self.names[1]]
            x, y = amplitude * math.cos(phase), amplitude * math.sin(phase)
            x, y = (to, y) if self.form == "cosine" else (x, to)
            return {**companions, name: math.hypot(x, y), self.names[1]: math.atan2(y, x)}
        return {**companions, **library.moved(name, to)}

    def bounds(self) -> tuple[float, float]:
        """Return the lowest and highest value of the coordinate (signs included)."""
        low, high = self._own_bounds()
        reach = self.within * self.deviation
        return max(low, self.mean - reach), min(high, self.mean + reach, self.most)

    def _own_bounds(self) -> tuple[float, float]:
        if self.form == "reciprocal":
            return 0.0, math.inf
        if self.form in STEPS:
            return 0.0, 1.5
        p = BENCH.get(self.names[0]) or library.parameters().get(self.names[0])
        if self.form in ("cosine", "sine") and p is not None:
            # both there: the amplitude at its own
            return -p.high * math.sqrt(0.5), p.high * math.sqrt(0.5)
        if self.form not in ("linear", "log") or p is None:
            return -math.inf, math.inf
        if self.form == "log":
            return math.log(p.low) if p.low > 0.0 else -math.inf, math.log(p.high)
        return p.low, p.high

    def bounded(self, to: float) -> float:
        """Return a value moved inside the bounds."""
        low, high = self.bounds()
        return min(max(to, low), high)


def ordinary(campaign: Campaign, at: Set | None = None) -> list[Coordinate]:
    """Return the ordinary deviations: `[uncertainty]` of the motor, `[background]` of the bench (or
    usual ones); at: completed values, which tell the form of an effect, neutral by default.

    Nobody knows in which form a drive has what is ordinary: all numbers of the form that is on are,
    their sum as large as stated, and its shapes are free.
    """
    motor = campaign.drive.motor
    values, out = library.neutral(motor) if at is None else at, []
    for name, p in library.parameters().items():
        form = _of_form(name, values)
        if p.ordinary is not None and name in form:
            mean = p.neutral_for(motor)
            each = campaign.deviation_of(p.ordinary, mean) / math.sqrt(len(form))
            out.append(Coordinate(name, mean, each, "linear", (name,)))
    for name, b in BENCH.items():
        if b.ordinary is not None:
            mean = b.neutral or 0.0
            out.append(
                Coordinate(name, mean, campaign.deviation_of(b.ordinary, mean), "linear", (name,))
            )
    out = [replace(c, within=ORDINARY) for c in out if c.deviation > 0.0]
    forms = [c for card in _with_forms() for c in _shapes(card, campaign, values)]
    return [*out, *forms, *soft_sign(motor)]


def is_ordinary(card: Effect, campaign: Campaign, values: Set) -> bool:
    """Return whether an effect is no larger than any drive may have it, all numbers of its form
    together."""
    if card.ordinarily is None:
        return False
    own = {card.public(1, name) for name in card.ordinarily(values)}
    known = [c for c in ordinary(campaign, values) if c.label in own]
    away = sum(abs(values[c.label] - c.mean) / c.deviation for c in known)
    return len(known) == len(own) and away <= ORDINARY


def _with_forms() -> list[Effect]:
    """Return the effects that are ordinary in several forms."""
    cards = map(library.load_effect, library.effect_names())
    return [card for card in cards if card.ordinarily is not None]


def _of_form(name: str, values: Set) -> tuple[str, ...]:
    """Return the ordinary parameters of the form in which a parameter's effect is, at completed
    values; of an effect with one form only, the parameter itself."""
    card = library.load_effect(name.partition(".")[0])
    if card.ordinarily is None:
        return (name,)
    return tuple(card.public(1, own) for own in card.ordinarily(values))


def _shapes(card: Effect, campaign: Campaign, values: Set) -> list[Coordinate]:
    """Return the shapes of the form in which an effect is, about those that its other form says of
    an ordinary size."""
    own = [p for p in card.parameters if p.fit == "log" and values[card.public(1, p.name)] != 0.0]
    if not own or card.otherwise is None:
        return []
    motor, converter = campaign.drive.motor, campaign.drive.converter
    usual = library.neutral(motor)
    for p in card.parameters:
        if p.ordinary is not None:
            usual[card.public(1, p.name)] = campaign.deviation_of(p.ordinary, 0.0)
    about = card.otherwise(usual, soft_current(motor), motor, converter)
    names = [card.public(1, p.name) for p in own]
    return [
        Coordinate(name, math.log(about[name]), p.spread, "log", (name,))
        for name, p in zip(names, own, strict=True)
        if about.get(name, 0.0) > 0.0
    ]


def soft_sign(motor: Motor) -> list[Coordinate]:
    """Return the coordinates of how a current's sign goes through zero: width and shape, of which
    little is known; measured shapes reach from linear to tanh."""
    width = Coordinate(
        WIDTH, math.log(soft_current(motor)), SIGN_SPREAD, "log", (WIDTH,), within=3.0
    )
    rest = [Coordinate(name, 0.0, 1.0, "linear", (name,)) for name in (SHAPE, CENTER)]
    return [replace(c, step=SIGN_STEP * c.deviation) for c in (width, *rest)]


def with_usual_sign(values: Set, motor: Motor) -> dict[str, float]:
    """Return a set whose currents' signs go through zero as they usually do.

    Where an effect is missing its fit bends the sign to either end, from which no slope leads back:
    a fit that has the effect begins with the usual one.
    """
    out = dict(values)
    for c in soft_sign(motor):
        out |= c.changes(out, c.mean)
    return out


def of_effect(effect: str, drive: Drive, start: Set, at: Set | None = None) -> list[Coordinate]:
    """Return an effect's coordinates with their wide priors: about neutral, or about where a search
    starts.

    start: completed set with the effect's companions (time constants, frequencies, ...) at the
    values to start from;
    at: where a fit stands, if not there: bounds that it has reached widen.  Of an effect that can
    have several parts, those that are on at the start.
    """
    card = library.load_effect(effect)
    on = [1, *further_parts(card, start, library.neutral(drive.motor))]
    return [c for k in on for c in of_part(card, k, drive, start, at)]


def of_part(
    card: Effect, k: int, drive: Drive, start: Set, at: Set | None = None
) -> list[Coordinate]:
    """Return the coordinates of an effect's k-th part, on or off."""
    out: list[Coordinate] = []
    part = card.part(k)
    idle = card.idle(start) if card.idle else ()
    for p in part.parameters:
        name = card.public(k, p.name)
        neutral, size = p.neutral_for(drive.motor), p.typical_for(drive.motor, drive.converter)
        twin = p.first and all(start[card.public(k, n)] == x for n, x in part.first_at.items())
        if p.fit == "fixed" or p.name in (*phases(part), *idle) or twin:
            continue
        if p.fit == "log" and start[name] == 0.0:  # the effect's form without it
            continue
        if p.fit == "log":
            out.append(Coordinate(name, math.log(start[name]), p.spread, "log", (name,)))
        elif p.fit == "reciprocal":
            out.append(Coordinate(name, 0.0, WIDE / size, "reciprocal", (name,)))
        elif p.name in amplitudes(part):
            pair = (name, card.public(k, amplitudes(part)[p.name]))
            out += [
                Coordinate(f"{name} {form}", 0.0, WIDE * size, form, pair)
                for form in ("cosine", "sine")
            ]
        elif p.scan:
            out.append(Coordinate(name, start[name], p.spread, "linear", (name,)))
        else:
            own, away = p.same_as or name, p.reach_for(drive.motor, drive.converter)
            out.append(Coordinate(own, neutral, WIDE * away, "linear", (own,)))
    most = ends(card, drive, start)
    return [replace(c, within=reach(c, at or start), most=_most(c, most)) for c in out]


def _most(c: Coordinate, ends_of: Mapping[str, float]) -> float:
    """Return how far a coordinate may go for the limit of its parameter."""
    inside = ends_of.get(c.names[0], math.inf)
    return inside if c.form == "linear" else math.log(inside) if c.form == "log" else math.inf


def reach(c: Coordinate, values: Set) -> float:
    """Return how many deviations an effect's coordinate may move: FARTHEST, twice as far as a point
    that is there."""
    if c.form in STEPS:
        return FARTHEST
    at = abs(c.value(values) - c.mean) / c.deviation
    return 2.0 * at if math.isfinite(at) and at >= REACHED * FARTHEST else FARTHEST


def amplitudes(part: EffectPart) -> dict[str, str]:
    """Return the amplitude that belongs to each phase of a part: {amplitude: phase}."""
    return dict([part.polar]) if part.polar else {}


def phases(part: EffectPart) -> tuple[str, ...]:
    """Return the parameters of a part that are phases of an amplitude."""
    return tuple(amplitudes(part).values())
