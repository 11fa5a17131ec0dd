"""What a diagnosis may move: coordinates of a parameter set, and how far each may be expected to move.

A coordinate is a direction in which a fit is close to linear: a value, its logarithm or reciprocal, or one component of
an amplitude with a phase; cards say which (`model.effects.card`).  A hypothesis is nothing but a list of effects whose
coordinates get a wide prior; every ordinary deviation of motor and bench keeps the narrow one the campaign states.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from model.effects import library
from model.effects.card import Effect, saturation_size
from model.effects.dead_time import SOFT_SIGN
from model.parameters import Drive
from sandbox.recordings.campaign import Campaign
from sandbox.replay.sensitivity import mechanical_only

Set = Mapping[str, float]
WIDE = 1.5  # standard deviation of an effect's prior, in its typical size
FARTHEST = 4.0  # standard deviations that an effect may move
ORDINARY = 4.0  # standard deviations that a deviation may have and still be ordinary
DEFAULT_UNCERTAINTY = {  # relative, where a campaign states nothing: what a careful identification reaches
    "resistance": 0.02, "magnet_flux": 0.02, "inductance_d": 0.03, "inductance_q": 0.03, "alpha_30": 0.05,
    "alpha_12": 0.05, "alpha_40": 0.05, "alpha_22": 0.05, "alpha_04": 0.05, "inertia": 0.05, "viscous_friction": 0.2,
}  # fmt: skip
DEFAULT_BACKGROUND = {
    "current_gain": 0.002, "current_offset": 0.001, "encoder_offset": 0.003, "dead_time": 5e-8,
    "load_torque_offset": 0.002,
}  # fmt: skip
OF_RATED = {"current_offset": "rated_current", "load_torque_offset": "rated_torque"}  # defaults relative to these
SOFT_SPREAD = 0.5  # standard deviation of the logarithm of the width in which the sign of a current goes through zero


@dataclass(frozen=True)
class Coordinate:
    """One direction of a fit: label, prior mean and standard deviation, the parameter(s) it moves and how.

    form: "linear", "log", "reciprocal", or "cosine"/"sine" of the pair (amplitude, phase); "share" is a step from the
    neutral value (0) to the values `along` (1), nothing between; with other forms `along` goes with a move.
    """

    label: str
    mean: float
    deviation: float
    form: str
    names: tuple[str, ...]
    along: tuple[tuple[str, float], ...] = ()
    within: float = math.inf  # deviations from the mean beyond which it is no longer ordinary

    @property
    def effect(self) -> str:
        """The effect (or "bench") that the coordinate belongs to."""
        return self.names[0].partition(".")[0]

    @property
    def mechanical(self) -> bool:
        """Whether it acts on the motion of a free rotor only."""
        return mechanical_only(self.names[0])

    def value(self, values: Set) -> float:
        """Return the coordinate of a completed set."""
        if self.form == "share":
            return 0.0
        x = values[self.names[0]]
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
        """Return the parameters that bring the coordinate to a value, the others unchanged (polar: its other part)."""
        name, companions = self.names[0], dict(self.along)
        if self.form == "share":
            return companions if to else {}
        if self.form == "log":
            return {name: math.exp(to)}
        if self.form == "reciprocal":
            return {**companions, name: 1.0 / to if to > 0.0 else math.inf}
        if self.form in ("cosine", "sine"):
            amplitude, phase = values[name], values[self.names[1]]
            x, y = amplitude * math.cos(phase), amplitude * math.sin(phase)
            x, y = (to, y) if self.form == "cosine" else (x, to)
            return {**companions, name: math.hypot(x, y), self.names[1]: math.atan2(y, x)}
        if name.startswith("saturation.") and name.partition(".")[2] in library.SHARED:
            return {name: to, f"cross_{name}": to}
        return {**companions, name: to}

    def bounds(self) -> tuple[float, float]:
        """Return the lowest and highest value of the coordinate (signs included)."""
        low, high = self._own_bounds()
        return max(low, self.mean - self.within * self.deviation), min(high, self.mean + self.within * self.deviation)

    def _own_bounds(self) -> tuple[float, float]:
        if self.form == "reciprocal":
            return 0.0, math.inf
        if self.form == "share":
            return 0.0, 1.5
        if self.form not in ("linear", "log") or self.names[0] not in library.parameters():
            return -math.inf, math.inf
        p = library.parameters()[self.names[0]]
        if self.form == "log":
            return math.log(p.low) if p.low > 0.0 else -math.inf, math.log(p.high)
        return p.low, p.high

    def bounded(self, to: float) -> float:
        """Return a value moved inside the bounds."""
        low, high = self.bounds()
        return min(max(to, low), high)


def ordinary(campaign: Campaign) -> list[Coordinate]:
    """Return the ordinary deviations: `[uncertainty]` of the motor, `[background]` of the bench (or defaults)."""
    motor = campaign.drive.motor
    neutral = library.neutral(motor)
    out = []
    for name, field in library.OF_MOTOR.items():
        sd = seen(campaign.uncertainty.get(field, DEFAULT_UNCERTAINTY[field])) * abs(getattr(motor, field))
        if sd > 0.0:
            out.append(Coordinate(name, neutral[name], sd, "linear", (name,)))
    for axis in "dq":
        sd = seen(campaign.uncertainty.get(f"inductance_{axis}", DEFAULT_UNCERTAINTY[f"inductance_{axis}"]))
        out.append(Coordinate(f"inductance.scale_{axis}", 1.0, sd, "linear", (f"inductance.scale_{axis}",)))

    def of_bench(key: str) -> float:
        """Return a standard deviation of [background], or the usual one scaled by the motor's rating."""
        scale = getattr(motor, OF_RATED[key]) if key in OF_RATED else 1.0
        return campaign.background.get(key, DEFAULT_BACKGROUND[key] * scale)

    gain, offset = of_bench("current_gain"), of_bench("current_offset")
    bench = {f"current_gain.gain_{phase}": (1.0, gain) for phase in "abc"}
    bench |= {f"current_offset.offset_{phase}": (0.0, offset * math.sqrt(2.0 / 3.0)) for phase in "ab"}
    bench |= {
        "bench.common_offset": (0.0, offset / math.sqrt(3.0)),
        "encoder_offset.offset": (0.0, of_bench("encoder_offset")),
        "dead_time.time": (0.0, of_bench("dead_time")),
        "bench.load_torque_offset": (0.0, of_bench("load_torque_offset")),
    }
    out += [Coordinate(name, mean, sd, "linear", (name,)) for name, (mean, sd) in bench.items() if sd > 0.0]
    soft = math.log(SOFT_SIGN * motor.rated_current)
    out = [replace(c, within=ORDINARY) for c in out]
    return [*out, Coordinate("bench.soft_current", soft, SOFT_SPREAD, "log", ("bench.soft_current",), within=3.0)]


def seen(deviation: float) -> float:
    """Return a relative deviation of the stated from the true value as seen from the stated one.

    True = stated/(1 + x): three deviations too low a statement, 1 - 3 s of the truth, is 3 s/(1 - 3 s) of itself off.
    """
    return deviation / (1.0 - min(3.0 * deviation, 0.6))


def of_effect(effect: str, drive: Drive, start: Set) -> list[Coordinate]:
    """Return an effect's coordinates with their wide priors: about neutral, or about where a search starts.

    start: completed set with the effect's companions (time constants, frequencies, ...) at the values to start from.
    """
    card = library.load_effect(effect)
    out: list[Coordinate] = []
    for p in card.parameters:
        name = f"{effect}.{p.name}"
        neutral, size = p.neutral_for(drive.motor), p.typical_for(drive.motor, drive.converter)
        if p.fit == "fixed" or p.name in phases(card):
            continue
        if p.fit == "log":
            out.append(Coordinate(name, math.log(start[name]), p.spread, "log", (name,)))
        elif p.fit == "reciprocal":
            out.append(Coordinate(name, 0.0, WIDE / size, "reciprocal", (name,)))
        elif p.name in amplitudes(card):
            pair = (name, f"{effect}.{amplitudes(card)[p.name]}")
            out += [Coordinate(f"{name} {form}", 0.0, WIDE * size, form, pair) for form in ("cosine", "sine")]
        elif p.scan:
            out.append(Coordinate(name, start[name], p.spread, "linear", (name,)))
        else:
            own = f"saturation.{p.name}" if effect == "cross_saturation" else name
            away = abs(size - neutral) or abs(size)
            if p.of_motor.startswith("alpha_"):  # a nominal model may lack saturation altogether
                away = max(away, saturation_size(drive.motor, p.of_motor))
            out.append(Coordinate(own, neutral, WIDE * away, "linear", (own,)))
    return [replace(c, within=FARTHEST) for c in out]


def amplitudes(card: Effect) -> dict[str, str]:
    """Return the amplitude that belongs to each phase of a card: {amplitude: phase}."""
    return dict([card.polar]) if card.polar else {}


def phases(card: Effect) -> tuple[str, ...]:
    """Return the parameters of a card that are phases of an amplitude."""
    return tuple(amplitudes(card).values())
