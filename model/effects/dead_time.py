"""Dead time of the legs: edges that act late, chosen by the current; real commutation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from model.array_types import Array
from model.commutation import clip, crossing, lateness, quick, static_sign
from model.compiled import inlined
from model.effects.card import At, Effect, Legs, LegSlope, Limit, Ordinary, Parameter
from model.effects.device_drop import sign
from model.effects.said import quantity
from model.lanes import soft_sign
from model.parameters import Converter, Motor

SHARP = 1e-30  # A: in place of nothing to divide by
ROUND = 0.125  # between 0 and 1 also where several effects add up theirs
TAILS = 10.0  # half-widths of a zone: beyond them a tanh is 1 to 4e-9


@inlined
def by_zone(time, zone_width, zone_shape, zone_center, hold):
    """Return how late (s) an edge acts that a sign of the current with a zone delays, linear in it,
    by a time of either sign; and ROUND where `rounded` has to be added."""
    size, off_center = abs(time), hold - zone_center * zone_width
    own = 0.5 * size * (1.0 + clip(off_center * (1.0 / max(zone_width, SHARP))))
    round_zone = (zone_shape > 0.0) & (abs(off_center) < TAILS * zone_width)
    return (own if time >= 0.0 else size - own), (ROUND if round_zone & (size > 0.0) else 0.0)


@inlined
def rounded(time, zone_width, zone_shape, zone_center, hold):
    """Return by how much later (s) than `by_zone` says an edge acts in a zone that is no straight
    line."""
    x = hold / zone_width - zone_center
    return 0.5 * time * (soft_sign(x, zone_shape) - clip(x))


@inlined
def late(
    time, capacitance, residual, zone_width, zone_shape, zone_center, hold, before, after, link
):
    """Return how late (s) an edge acts for constant slopes of its current, and who may say so.

    hold: current (A) that keeps the leg where it is; before, after: its slopes (A/s) with the leg
    there, and gone over.
    Second: 0, right at any slopes; 1, at these; 2: `commutated` has to be asked; ROUND, also beside
    these: it has to, at any slopes.  The residual has a zone; so has the time without a
    capacitance.
    """
    size, charge, real = abs(time), 2.0 * capacitance * link, (capacitance > 0.0) & (time != 0.0)
    zoned, asked = by_zone(
        residual + (0.0 if real else time), zone_width, zone_shape, zone_center, hold
    )
    own = quick(size, charge, hold, 1.0 / max(abs(hold), SHARP), before, after)
    own = own if time >= 0.0 else size - own
    who = 2.0 if crossing(size, charge, hold, before, after) else 1.0
    return zoned + (own if real else 0.0), asked + (who if real else 0.0)


@inlined
def commutated(
    time, capacitance, residual, zone_width, zone_shape, zone_center, hold, before, after, link
):
    """Return by how much later (s) than `late` says an edge acts whose current is near zero."""
    size, real = abs(time), (capacitance > 0.0) & (time != 0.0)
    more = rounded(residual + (0.0 if real else time), zone_width, zone_shape, zone_center, hold)
    if not real:
        return more
    exact = lateness(size, capacitance, link, hold, before, after)
    charge = 2.0 * capacitance * link
    own = quick(size, charge, hold, 1.0 / max(abs(hold), SHARP), before, after)
    return more + (exact - own if time >= 0.0 else own - exact)


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how late an edge may be."""
    yield Limit(
        "dead_time.time + dead_time.residual",
        abs(v["dead_time.time"]) + abs(v["dead_time.residual"]),
        0.5 * converter.update_period,
        "s, half the sampling period",
    )


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    time, width = v["dead_time.time"] + v["dead_time.residual"], v["dead_time.zone_width"]
    if time < 0.0:
        return (
            f"lower the drive's dead-time compensation by {quantity(-time, 's')}: it adds too much"
        )
    if time and v["dead_time.capacitance"]:
        # half of the volts lost are there at half of this width (`otherwise`)
        width = 4.0 * v["dead_time.capacitance"] * converter.dc_bus_voltage / time
    soft = f", less of it below {quantity(width, 'A')} of a phase's current" if width else ""
    return (
        f"set the dead-time compensation to {quantity(time, 's')}{soft} (raise it by that, "
        "where there is one)"
    )


def leg_loss(v: Mapping[str, float], converter: Converter, current: Array) -> Array:
    """Return what a leg loses by it (V, any shape) at constant currents (A), mean over a PWM
    period, by completed values."""
    i = np.asarray(current, dtype=float)
    time, capacitance = v["dead_time.time"], v["dead_time.capacitance"]
    late = v["dead_time.residual"] * zoned(v, i)
    if capacitance > 0.0 and time:
        corner = 2.0 * capacitance * converter.dc_bus_voltage / abs(time)
        slews = np.array([-static_sign(-x, corner) for x in np.abs(i).ravel()]).reshape(i.shape)
        late = late + 0.5 * time * np.sign(i) * (1.0 + slews)
    else:
        late = late + time * zoned(v, i)
    period = converter.sampling_period * converter.samples_a_period
    return np.asarray(converter.dc_bus_voltage / period * late)


def zoned(v: Mapping[str, float], current: Array) -> Array:
    """Return the mean of the signs of currents (A, any shape) by which a leg's two edges are late,
    by completed values."""
    zone, center = dict(v), v.get("bench.soft_center", 0.0)
    if width := v["dead_time.zone_width"]:
        zone = {"bench.soft_current": width, "bench.soft_shape": v["dead_time.zone_shape"]}
        center = v["dead_time.zone_center"]
    shift = center * zone.get("bench.soft_current", 0.0)
    return np.asarray(0.5 * (sign(zone, current - shift) + sign(zone, current + shift)))


def leg_slope(v: Mapping[str, float], motor: Motor, legs: Legs) -> LegSlope:
    """Return what a leg loses by it around zero current, by completed values: all of it within the
    zone of a sign, or of currents that just slew a leg over in the dead time."""
    late = v["dead_time.time"] + v["dead_time.residual"]
    slews = 4.0 * v["dead_time.capacitance"] * legs.link / max(abs(late), SHARP)
    within = max(v["dead_time.zone_width"] or legs.zone, slews)
    return LegSlope(late * legs.link / (legs.period * within), within)


def ordinarily(v: Mapping[str, float]) -> tuple[str, ...]:
    """Return of which numbers any drive has a little: without a capacitance edges know the sum of
    both only."""
    return ("time", "residual") if v["dead_time.capacitance"] > 0.0 else ("time",)


def otherwise(
    v: Mapping[str, float], width: float, motor: Motor, converter: Converter
) -> dict[str, float]:
    """Return the capacitance in place of a zone of half-width `width` (A), or none in place of one:
    the leg just slews over in the dead time at half of the width, where the volts lost by all edges
    have the same slope at zero."""
    if v["dead_time.capacitance"] > 0.0:
        return {
            "dead_time.capacitance": 0.0,
            "dead_time.time": v["dead_time.time"] + v["dead_time.residual"],
            "dead_time.residual": 0.0,
        }
    return {
        "dead_time.capacitance": 0.25 * width * abs(v["dead_time.time"]) / converter.dc_bus_voltage
    }


CARD = Effect(
    name="dead_time",
    summary="dead time of the legs: late edges, chosen by the current; legs slew, and are "
    "clamped by diodes",
    subsystem="inverter",
    equation=(
        "both switches are off for t_d: the current keeps the leg where it is (late by t_d) or "
        "moves it with i/(2 C) until a diode clamps it (late by C u_dc/|i|; t_d - t_d^2 |i|/(4 C "
        "u_dc) where it does not arrive), and may come to zero meanwhile; mean loss u_dc t_d/T_s "
        "times the vector of signs (fundamental 4/pi, lines 6k); the pattern is late by t_d/2 on "
        "average. Without a capacitance: late by a sign of the current, linear within +-1.5 % of "
        "rated current, or (1 - shape) clip x + shape tanh x in a zone of its own, x = i/width - "
        "center, i the current that keeps the leg; "
        "so is what a compensation leaves of it or adds too much (residual, ordinary on any drive)"
    ),
    formulas=(
        r"\overline{\Delta u} = -\,u_\text{dc}\,\frac{t_d}{T_s}\,\operatorname{sign}(i), "
        r"\qquad \operatorname{sign}(i) \to (1 - s)\,\operatorname{clip}\,\frac{i}{i_0} + s "
        r"\,\tanh\,\frac{i}{i_0}",
    ),
    source=(
        "Zhang, Xu, Dead-time compensation of inverters considering snubber and parasitic "
        "capacitance, IEEE Trans. Power Electron. 29 (2014) 3179; Jeong, Park, The analysis and "
        "compensation of dead-time effects in PWM inverters, IEEE Trans. Ind. Electron. 38 (1991) "
        "108"
    ),
    parameters=(
        Parameter(
            "time",
            "s",
            0.0,
            -5e-6,
            5e-5,
            2e-6,
            ordinary=Ordinary("dead_time", 5e-8),
            title="dead time",
        ),
        Parameter(
            "capacitance",
            "F",
            0.0,
            0.0,
            1e-7,
            0.0,
            fit="log",
            spread=1.5,
            change=1e-10,
            title="output capacitance of each switch",
        ),
        Parameter(
            "residual",
            "s",
            0.0,
            -5e-6,
            5e-6,
            0.0,
            fit="fixed",
            ordinary=Ordinary("dead_time", 5e-8),
            change=1e-7,
            title="dead time that a compensation leaves",
        ),
        Parameter(
            "zone_width",
            "A",
            0.0,
            0.0,
            1e5,
            0.0,
            "rated current",
            fit="fixed",
            change=0.1,
            title="width of the zone at zero current",
        ),
        Parameter(
            "zone_shape",
            "",
            0.0,
            0.0,
            1.0,
            0.0,
            fit="fixed",
            change=1.0,
            title="shape of the zone at zero current",
        ),
        Parameter(
            "zone_center",
            "",
            0.0,
            -1.0,
            1.0,
            0.0,
            fit="fixed",
            change=1.0,
            title="middle of the zone in its half-widths, of the current that keeps a leg",
        ),
    ),
    axis="against the current",
    order="1 and 6k (5, 7 in phases)",
    region="steps where a phase current crosses zero; size independent of current and speed",
    confused_with=("device_drop", "flux_harmonics", "stator_resistance"),
    separated_by="slow zero crossings of each phase at two modulation depths or two PWM frequencies",  # noqa: E501
    at=(
        At(
            "edge",
            late,
            ("time", "capacitance", "residual", "zone_width", "zone_shape", "zone_center"),
        ),
        At(
            "commutation",
            commutated,
            ("time", "capacitance", "residual", "zone_width", "zone_shape", "zone_center"),
        ),
    ),
    switches=("time", "residual"),
    limits=limits,
    do=do,
    otherwise=otherwise,
    ordinarily=ordinarily,
    leg_slope=leg_slope,
)
