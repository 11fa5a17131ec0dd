"""The card of an effect: what it is called, its equation, where it comes from, its parameters and
how it shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

from model.array_types import Array
from model.parameters import Converter, Motor

INF = math.inf
# scan of a phase: two parts, one of each, are a wave of any phase
EITHER_PHASE = (0.0, 0.5 * math.pi, 0.5 * math.pi)
LINEAR_LACKS = 0.2  # of the linear energy at rated current: what saturation takes on common motors
SUBSYSTEMS = ("machine", "inverter", "sensor", "mechanics")


@dataclass(frozen=True)
class Ordinary:
    """A deviation that a drive has without any effect: its key in a campaign's `[uncertainty]`
    (where the parameter is of the motor: relative) or `[background]` (in the parameter's unit);
    `usual` where a campaign
    states nothing, in units of `relative_to` (a key of `scales`); share: of what is stated, one
    parameter's part."""

    stated: str
    usual: float
    relative_to: str = ""
    share: float = 1.0
    of_motor: bool = False


@dataclass(frozen=True)
class Parameter:
    """A number of an effect: neutral value (None: the motor's own `of_motor`), closed bounds, unit,
    typical size.

    The typical size is in units of `relative_to`, a key of `scales` ("": absolute; "neutral": of
    the neutral value), the neutral value in units of `neutral_relative_to`, a key of
    `motor_scales`.
    How a diagnosis fits it: `fit` is "linear", "log", "reciprocal" (the coordinate in which
    readings are close to linear) or "fixed" (kept neutral); `spread` the prior's standard deviation
    in that coordinate where the typical size does not say it; `starts` values to begin from, in
    units of the typical size; `scan` (first, last, step) in the parameter's unit, step 0: as fine
    as the recordings resolve; `scan_poles`: beyond it, so many multiples of the number of poles, as
    often as the torque of slots may repeat.

    What else a diagnosis has to know: `change`, a change to take differences over where the typical
    size is none (in units of `relative_to`); `secant`, the least share of the typical size that a
    difference from an infinite neutral value is taken over; `resolved_by` "time" or "turns": a
    change is as fine as the recordings' length resolves;
    `same_as`: the parameter of another effect that is the same number; `predicted` False: pure
    noise, no prediction moves; `ordinary`: the deviation that every drive may have.

    What else it is: `scales`, the motor's value that it multiplies (one without a neutral value of
    its own replaces the motor's; in the library alone); `whole`: only whole numbers but 0 make
    sense, such as orders; `first`: the parameter of the effect's first part that is the same number
    where a further part stands at its `first_at`; `title`: its name in a sentence, such as "6th
    harmonic of d flux" (default: `name` in words).
    """

    name: str
    unit: str
    neutral: float | None
    low: float
    high: float
    typical: float
    relative_to: str = ""
    of_motor: str = ""
    fit: str = "linear"
    spread: float = 0.0
    starts: tuple[float, ...] = (1.0,)
    scan: tuple[float, float, float] | None = None
    scan_poles: int = 0
    change: float = 0.0
    secant: float = 0.0
    resolved_by: str = ""
    same_as: str = ""
    predicted: bool = True
    ordinary: Ordinary | None = None
    scales: str = ""
    whole: bool = False
    first: str = ""
    title: str = ""
    neutral_relative_to: str = ""

    def neutral_for(self, motor: Motor) -> float:
        """Return the neutral value for a motor."""
        if self.neutral is None:
            return float(getattr(motor, self.of_motor))
        if not self.neutral_relative_to:
            return self.neutral
        return self.neutral * motor_scales(motor)[self.neutral_relative_to]

    def typical_for(self, motor: Motor, converter: Converter) -> float:
        """Return the typical size (in the parameter's unit) on a drive."""
        if self.relative_to == "neutral" and self.neutral_for(motor) == 0.0:
            if self.of_motor.startswith("alpha_"):
                return saturation_size(motor, self.of_motor)
            return abs(1.0 - self.typical) * flux_scale(motor)  # of magnets, where there are none
        if self.relative_to == "neutral":
            return self.typical * self.neutral_for(motor)
        return self.typical * scales(motor, converter)[self.relative_to]

    def away_for(self, motor: Motor, converter: Converter) -> float:
        """Return how far from neutral the typical size is on a drive; where it is none,
        `change`."""
        if self.change:
            return self.change * scales(motor, converter)[self.relative_to]
        neutral, size = self.neutral_for(motor), self.typical_for(motor, converter)
        return abs(size - neutral) or abs(size)

    def reach_for(self, motor: Motor, converter: Converter) -> float:
        """Return the same as a search has to reach: a nominal model may lack saturation
        altogether."""
        away = self.away_for(motor, converter)
        return (
            max(away, saturation_size(motor, self.of_motor))
            if self.of_motor.startswith("alpha_")
            else away
        )


def of_electrical_order(what: str) -> tuple[Parameter, Parameter]:
    """Return order and phase of a further harmonic; what: such as "flux harmonic"."""
    scan = (6.0, 60.0, 6.0)
    order = Parameter("order", "", 12.0, -60.0, 60.0, 12.0, fit="fixed", scan=scan, whole=True)
    phase = Parameter("phase", "rad", 0.0, -INF, INF, 0.0, fit="fixed", change=1.0)
    return (
        replace(order, title=f"order of {what}"),
        replace(phase, scan=EITHER_PHASE, title=f"phase of {what}"),
    )


@dataclass(frozen=True)
class Port:
    """A place of the plant where equations of effects enter: what they are handed, and how many
    numbers they return.

    once: asked for once a batch, not as the plant runs; the first number is then 0 where the effect
    is neutral.
    joined: what several effects at one port make: "sum", they add up; "chain", each is handed what
    the one before made of it; "lags" and "branches", first numbers add up and the second is the
    time constant of `model.lanes.one_lag`, `one_branch`; "last", the last one whose first number is
    not 0.
    """

    quantities: tuple[str, ...]
    returns: int
    what: str
    once: bool = False
    joined: str = "sum"


PORTS = {
    "link": Port(("time",), 1, "V added to the link's voltage at an instant of the recording (s)"),
    "drawn": Port(
        ("d_a", "d_b", "d_c", "i_alpha", "i_beta"),
        1,
        "V that the link sags by over a period: duties, current (A)",
    ),
    "edge": Port(
        ("hold", "before", "after", "link"),
        2,
        "s that an edge acts late; right at slopes 0 any, 1 these, else with "
        "`commutation` (< 1 any); hold: A",
    ),
    "commutation": Port(
        ("hold", "before", "after", "link"),
        1,
        "s by which an edge acts later than `edge` says, its current near zero",
    ),
    "leg": Port(
        ("before", "after", "shape"),
        1,
        "V a leg loses on average while its current over its sign's width changes; "
        "shape: 0 linear, 1 tanh",
    ),
    "leg_curve": Port(
        ("before", "after"),
        1,
        "V a leg loses on average while its current (A) goes straight from before to after",
    ),
    "winding": Port(
        ("i_alpha", "i_beta"), 2, "V lost in the windings, stationary frame, at a current (A)"
    ),
    "magnets": Port(
        ("c", "s"),
        4,
        "harmonic flux d, q (Wb) and its slope (Wb/rad) at cos, sin of the rotor's angle",
    ),
    "energy": Port(
        ("c", "s", "d", "q"), 3, "further current i_d, i_q (A) and dH/dtheta (J/rad) at a flux (Wb)"
    ),
    "torque": Port(
        ("turn", "omega"), 1, "N m on the rotor at its mechanical angle (rad) and speed (rad/s)"
    ),
    "friction": Port(
        ("omega",), 1, "N m that the motor's side loses at a mechanical speed (rad/s)"
    ),
    "bristles": Port(
        ("omega", "inertia"),
        4,
        "of friction that bends before it slides: N m/rad, damping (N m s/rad), N m of sliding, "
        "and N m at the begin; at a mechanical speed (rad/s) and the motor side's inertia (kg m^2)",
        joined="last",
    ),
    "load": Port(
        ("omega",), 1, "N m that the load takes beside what it is asked for, at its speed (rad/s)"
    ),
    "reading": Port(
        ("a", "b", "c"), 3, "what the sensors make of three phase currents (A)", joined="chain"
    ),
    "angle": Port(
        ("turn", "pairs"),
        1,
        "rad electrical that the angle's reading is off at a mechanical angle (rad)",
    ),
    "source": Port(
        (),
        3,
        "rate (rad/s) at which the link rings with its source, ohm that a step of the draw rings "
        "by, damping ratio",
        once=True,
        joined="last",
    ),
    "supply": Port(
        (), 1, "share of its nominal voltage that the link has more, on average", once=True
    ),
    "resistance": Port((), 1, "ohm in series with the winding", once=True),
    "iron": Port(
        (),
        2,
        "conductance across the slope of the flux (1/ohm), time constant of its lag (s)",
        once=True,
        joined="branches",
    ),
    "excess": Port(
        ("slope",),
        1,
        "current by the root of the lagged slope of the flux, A/V^(1/2); slope: rated, V",
        once=True,
    ),
    "play": Port(
        ("flux",),
        2,
        "current by what the flux is ahead of that held (1/H), most it can be ahead (Wb); flux: "
        "rated, Wb",
        once=True,
        joined="last",
    ),
    "skin": Port(
        (),
        2,
        "ohm for what the current has beside its lagged part, time constant (s)",
        once=True,
        joined="lags",
    ),
    "layers": Port(
        (),
        3,
        "ohm of every even and every odd branch n of a series of them, each as at `skin`, and time "
        "constant (s) of the first, n^2 times that of branch n",
        once=True,
        joined="last",
    ),
    "filter": Port(
        (), 1, "time constant (s) of the low-pass between sensors and samplers", once=True
    ),
    "delay": Port((), 1, "s by which pulses come later than the recording says", once=True),
    "instant": Port(
        (),
        2,
        "s by which samples are taken later than t_k, variance of their jitter (s^2)",
        once=True,
    ),
    "channels": Port(
        (), 1, "s by which each phase's sample comes later than that of the one before", once=True
    ),
    "offset": Port((), 1, "rad electrical that all readings of the angle are off", once=True),
    "latency": Port((), 1, "s by which readings of the angle are older than their rows", once=True),
    "shaft": Port(
        ("inertia",),
        3,
        "of the inertia (kg m^2) what a shaft that twists drives, rate (rad/s) and "
        "damping ratio of its swing",
        once=True,
        joined="last",
    ),
    "backlash": Port((), 1, "rad that such a shaft turns freely, from end to end", once=True),
}


@dataclass(frozen=True)
class At:
    """An equation at a port of the plant, handed the effect's parameters `numbers`, then the port's
    quantities; switches: it is off while these are neutral (default: those of `numbers` that switch
    the effect); form: where it is for one of two forms of the effect, the parameter that tells them
    apart, and whether that is other than neutral in this one."""

    port: str
    equation: Callable[..., Any]
    numbers: tuple[str, ...]
    switches: tuple[str, ...] = ()
    form: tuple[str, bool] | None = None


@dataclass(frozen=True)
class EffectPart:
    """One of the like parts of which an effect can have several at once, such as orders of a
    harmonic.

    parameters; at: its equations at ports; switches: it is off while these are neutral (default:
    all parameters);
    polar: amplitude and phase that are fitted as cosine and sine; first_at: where it is what the
    first part is, so that a diagnosis leaves the parameters neutral that name one of that part
    (`Parameter.first`).
    """

    parameters: tuple[Parameter, ...]
    at: tuple[At, ...] = ()
    switches: tuple[str, ...] = ()
    polar: tuple[str, str] | None = None
    first_at: Mapping[str, float] = field(default_factory=dict)


# ports at which parts beyond the first can enter
REPEATED = ("magnets", "energy", "torque", "angle")


class Limit(NamedTuple):
    """A size that must stay below a bound beside the rest of the drive; no limit for sizes of 0 or
    less.

    name: whose size, as the user calls it; what: the unit, and in words what the bound is, such as
    "V, the DC link";
    simulated: only a simulated drive has this limit, a recorded one may be beyond it.
    """

    name: str
    size: float
    bound: float
    what: str
    simulated: bool = False

    @property
    def broken(self) -> bool:
        """Whether the size is at its bound or beyond; a size of 0 or less has none."""
        return self.size > 0.0 and not self.size < self.bound


class Legs(NamedTuple):
    """Of an inverter's legs, what an effect's own numbers do not say: the link's voltage (V), the
    PWM's period (s), half the width (A) in which the sign of a current goes through zero."""

    link: float
    period: float
    zone: float


class LegSlope(NamedTuple):
    """What an effect takes from a leg around zero current: volts that grow with the current by so
    many ohms (below 0: it gives them back), within so many A of zero."""

    ohms: float
    within: float


class Curve(NamedTuple):
    """What an effect that is a curve draws: names and units of its axes, by completed values and
    the motor the places (n,) where it is shown, with the converter its value (n,) there and one
    sentence of what it is in simpler forms.

    simpler_forms: effects of simpler forms at the same place, which its value holds, too.
    """

    across: str
    unit_across: str
    of: str
    unit: str
    places: Callable[[Mapping[str, float], Motor], Array]
    value: Callable[[Mapping[str, float], Motor, Converter, Array], Array]
    said: Callable[[Mapping[str, float], Motor, Converter], str]
    simpler_forms: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effect:
    """One effect; equation and source as text, signature as axis, order and region of the residual
    it leaves.

    formulas: the equation as LaTeX, a display each, for pages.

    at: its equations at ports of the plant; an effect of the library whose parameters replace or
    scale values of the motor (`of_motor`, `scales`) needs none.  switches: the effect is off while
    these parameters are neutral (default: all of its parameters).

    limits: bounds that completed values have beside a motor and a converter, asked for where a
    parameter of the effect is not neutral; it raises BadInput for what is no matter of a bound.
    inside: further ones that take longer to work out, of a simulated drive alone; asked for once,
    before a run begins.  longest: the longest step (s) that a closed loop may take while the effect
    is on, by completed values, the motor (true) and its highest speed (rad/s, electrical); see
    `model.steps`.

    ordinarily: of the parameters that may be ordinary, those that the form has in which the effect
    is, by completed values (default: all of them, in every form).

    free: whether it is a form that fits nearly anything at its place, a curve; a diagnosis asks for
    it only where the other effects leave more than noise.  curve: how it is drawn.

    drifts: whether each recording may have a size of its own, which a diagnosis measures first.

    idle: parameters that mean nothing at completed values: no fit moves them there.

    leg_slope: what it takes from a leg around zero current, by completed values and the motor; an
    effect that says nothing takes nothing there.  Where all effects together give volts back, the
    current is unstable, and a replay lets readings hold it.

    do: what a person should do about it, one sentence from completed values, the nominal motor and
    the converter; asked for where the effect is on (`model.effects.advice`).

    otherwise: values with which the effect has the other of its two forms, from completed values,
    the half-width (A) of the zone in which a current's sign goes through zero, motor and converter;
    a fit compares both.

    repeats: how many parts like its first it can have at once, that one included; they add up.
    Parameters of the first are `effect.parameter`, of the k-th (k from 2 on) `effect.k.parameter`,
    neutral unless given; further: what parts from the second on are made of (None: of the same as
    the first).  A search that found one part looks for the next by `part(k)` and
    `public(k, parameter)`; in which of the places 2 ... repeats a part stands is all the same.
    """

    name: str
    summary: str
    subsystem: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    axis: str
    order: str
    region: str
    confused_with: tuple[str, ...]
    separated_by: str
    polar: tuple[str, str] | None = None  # amplitude and phase that are fitted as cosine and sine
    # of the size an ordinary trace may have in a diagnosis: less where a simulation meets it better
    trace: float = 1.0
    at: tuple[At, ...] = ()
    switches: tuple[str, ...] = ()
    limits: Callable[[Mapping[str, float], Motor, Converter], Iterable[Limit]] | None = None
    inside: Callable[[Mapping[str, float], Motor, Converter], Iterable[Limit]] | None = None
    longest: Callable[[Mapping[str, float], Motor, float], float] | None = None
    repeats: int = 1
    further: EffectPart | None = None
    formulas: tuple[str, ...] = ()
    do: Callable[[Mapping[str, float], Motor, Converter], str] | None = None
    otherwise: Callable[[Mapping[str, float], float, Motor, Converter], dict[str, float]] | None = (
        None
    )
    ordinarily: Callable[[Mapping[str, float]], tuple[str, ...]] | None = None
    free: bool = False
    curve: Curve | None = None
    drifts: bool = False
    leg_slope: Callable[[Mapping[str, float], Motor, Legs], LegSlope] | None = None
    idle: Callable[[Mapping[str, float]], tuple[str, ...]] | None = None

    def part(self, k: int) -> EffectPart:
        """Return the k-th part (1 ... repeats)."""
        if k > 1 and self.further:
            return self.further
        return EffectPart(self.parameters, self.at, self.switches, self.polar)

    def public(self, k: int, parameter: str) -> str:
        """Return the public name of a parameter of the k-th part (1 ... repeats)."""
        return f"{self.name}.{parameter}" if k == 1 else f"{self.name}.{k}.{parameter}"

    @cached_property
    def switched_by(self) -> tuple[tuple[str, ...], ...]:
        """The public names of the parameters that switch each part on."""
        parts = [(k, self.part(k)) for k in range(1, self.repeats + 1)]
        return tuple(
            tuple(self.public(k, n) for n in p.switches or [q.name for q in p.parameters])
            for k, p in parts
        )

    def switched_off(
        self, values: Mapping[str, float], neutral: Mapping[str, float], k: int = 1
    ) -> bool:
        """Return whether completed values leave the effect's k-th part off."""
        return all(values[n] == neutral[n] for n in self.switched_by[k - 1])

    def limits_at(
        self, values: Mapping[str, float], motor: Motor, converter: Converter
    ) -> Iterator[Limit]:
        """Yield the limits at any completed values, possible or not, up to the first one broken:
        later ones may rest on it, as a shaft's resonance on a load's inertia below that of all.
        BadInput: the values have none at all."""
        for limit in self.limits(values, motor, converter) if self.limits else ():
            yield limit
            if limit.broken:
                return

    def is_on(self, values: Mapping[str, float], neutral: Mapping[str, float]) -> bool:
        """Return whether any part of the effect is there."""
        return not all(self.switched_off(values, neutral, k) for k in range(1, self.repeats + 1))


def saturation_size(motor: Motor, alpha: str) -> float:
    """Return the size of a coefficient `alpha_jk` that a linear nominal model lacks: its term
    phi^(j+k) then has LINEAR_LACKS of the energy phi^2 / 2 L at the flux L x rated current."""
    inductance = math.sqrt(motor.inductance_d * motor.inductance_q)
    degree = sum(int(x) for x in alpha.removeprefix("alpha_"))
    return LINEAR_LACKS / (2.0 * inductance * (inductance * motor.rated_current) ** (degree - 2))


def flux_scale(motor: Motor) -> float:
    """Return the magnet flux (Wb), or what rated current links where the rotor has no magnets."""
    return (
        motor.magnet_flux
        or math.sqrt(motor.inductance_d * motor.inductance_q) * motor.rated_current
    )


def motor_scales(motor: Motor) -> dict[str, float]:
    """Return what sizes are relative to, of a motor alone (SI)."""
    speed = motor.rated_omega / motor.pole_pairs
    swing = motor.inertia * (math.tau * 100.0) ** 2
    return {
        "": 1.0,
        "rated current": motor.rated_current,
        "rated torque": motor.rated_torque,
        "rated speed": speed,
        "rated torque / rated speed": motor.rated_torque / speed,
        "magnet flux": flux_scale(motor),
        "resistance": motor.resistance,
        "1 / L_d": 1.0 / motor.inductance_d,
        "rated current / (L_d rated current)^2": 1.0
        / (motor.inductance_d**2 * motor.rated_current),
        "rated current / (L_d L_q rated current^2)": 1.0
        / (motor.inductance_d * motor.inductance_q * motor.rated_current),
        "rated current / (L_q rated current)^2": 1.0
        / (motor.inductance_q**2 * motor.rated_current),
        "rated reactance": motor.rated_omega * max(motor.inductance_d, motor.inductance_q),
        "pole pairs": float(motor.pole_pairs),
        "inertia": motor.inertia,
        "inertia x (2 pi 100 Hz)^2": swing,
        "rated torque / (inertia x (2 pi 100 Hz)^2)": motor.rated_torque / swing,
    }


def scales(motor: Motor, converter: Converter) -> dict[str, float]:
    """Return what typical sizes are relative to, on this drive (SI)."""
    return motor_scales(motor) | {
        "DC link": converter.dc_bus_voltage,
        "DC link / rated current": converter.dc_bus_voltage / motor.rated_current,
        "PWM period": converter.update_period,
    }
