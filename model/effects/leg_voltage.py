"""What a leg of the inverter loses against its current, as a free curve: for inverters that no
other form fits.

The curve is odd, a sum of currents that saturate: each goes straight through zero and is constant
beyond its corner. Three corners come to two octaves, from an eightieth of a current of reference to
twice it.  So a commutation that is done at small currents, a knee of the devices, and a resistance
are each mostly one term, and any curve without sharper corners than these is a sum of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from model.array_types import Array
from model.compiled import inlined
from model.effects import dead_time, device_drop
from model.effects.card import At, Curve, Effect, Legs, LegSlope, Parameter
from model.effects.said import quantity
from model.parameters import Converter, Motor

# of the current of reference
CORNERS = (0.0125, 0.02, 0.032, 0.05, 0.08, 0.125, 0.2, 0.32, 0.5, 0.8, 1.25, 2.0)
# of the link, what a dead time of 0.2 us takes of 0.1 ms: a term in a diagnosis; a run with typical
# terms has a quarter
USUAL, TYPICAL = 0.002, 0.0005
SIMPLER = ("dead_time", "device_drop")  # forms of what a leg loses that are points of it
VOLTS = tuple(f"v_{k + 1}" for k in range(len(CORNERS)))


@inlined
def term(volts, share, half):
    """Return a term's volts at a share of its corner, and what its integral lacks of them; half:
    its corner, halved."""
    inside = min(share, 1.0)
    return volts * inside, volts * inside * inside * half


@inlined
def sums(v_1, v_2, v_3, v_4, v_5, v_6, v_7, v_8, v_9, v_10, v_11, v_12, x):
    """Return the volts lost at a current over that of reference, and their integral from 0 on."""
    size = abs(x)
    u_1, w_1 = term(v_1, 80.0 * size, 0.00625)
    u_2, w_2 = term(v_2, 50.0 * size, 0.01)
    u_3, w_3 = term(v_3, 31.25 * size, 0.016)
    u_4, w_4 = term(v_4, 20.0 * size, 0.025)
    u_5, w_5 = term(v_5, 12.5 * size, 0.04)
    u_6, w_6 = term(v_6, 8.0 * size, 0.0625)
    u_7, w_7 = term(v_7, 5.0 * size, 0.1)
    u_8, w_8 = term(v_8, 3.125 * size, 0.16)
    u_9, w_9 = term(v_9, 2.0 * size, 0.25)
    u_10, w_10 = term(v_10, 1.25 * size, 0.4)
    u_11, w_11 = term(v_11, 0.8 * size, 0.625)
    u_12, w_12 = term(v_12, 0.5 * size, 1.0)
    volts = (u_1 + u_2 + u_3) + (u_4 + u_5 + u_6) + (u_7 + u_8 + u_9) + (u_10 + u_11 + u_12)
    lacks = (w_1 + w_2 + w_3) + (w_4 + w_5 + w_6) + (w_7 + w_8 + w_9) + (w_10 + w_11 + w_12)
    return volts if x >= 0.0 else -volts, volts * size - lacks


@inlined
def lost(v_1, v_2, v_3, v_4, v_5, v_6, v_7, v_8, v_9, v_10, v_11, v_12, reference, before, after):
    """Return what a leg loses on average (V) while its current (A) goes straight from before to
    after."""
    per = 1.0 / max(reference, 1e-30)
    x, y = before * per, after * per
    step = y - x
    flat = abs(step) < 1e-6
    here, first = sums(v_1, v_2, v_3, v_4, v_5, v_6, v_7, v_8, v_9, v_10, v_11, v_12, x)
    there, last = sums(v_1, v_2, v_3, v_4, v_5, v_6, v_7, v_8, v_9, v_10, v_11, v_12, y)
    return 0.5 * (here + there) if flat else (last - first) / (1.0 if flat else step)


def corners(v: Mapping[str, float], motor: Motor) -> Array:
    """Return the currents (A) at which the curve bends, by completed values."""
    return (v["leg_voltage.reference"] or motor.rated_current) * np.array(CORNERS)


def whole(v: Mapping[str, float], motor: Motor, converter: Converter, current: Array) -> Array:
    """Return what a leg loses in all (V, any shape) at constant currents (A), by completed values:
    the curve with dead time and drop."""
    known = device_drop.leg_loss(v, current) + dead_time.leg_loss(v, converter, current)
    return np.asarray(curve(v, motor, current) + known)


def curve(v: Mapping[str, float], motor: Motor, current: Array) -> Array:
    """Return the curve's own voltage error (V, any shape) at currents (A), by completed values."""
    x = np.asarray(current, dtype=float)
    volts = [v[f"leg_voltage.{n}"] for n in VOLTS]
    return np.asarray(
        sum(u * np.clip(x / c, -1.0, 1.0) for u, c in zip(volts, corners(v, motor), strict=True))
    )


def leg_slope(v: Mapping[str, float], motor: Motor, legs: Legs) -> LegSlope:
    """Return what the curve takes from a leg around zero current, by completed values: its slope
    there, up to the corner beyond which it gives nothing back."""
    volts = [v[f"leg_voltage.{n}"] for n in VOLTS]
    if not any(volts):
        return LegSlope(0.0, 0.0)
    amps = corners(v, motor)
    slopes = np.cumsum((volts / amps)[::-1])[::-1]  # of the stretch that ends at each corner
    back = np.append(slopes < 0.0, False)
    return LegSlope(float(slopes[0]), float(np.append(0.0, amps)[np.argmin(back)]))


def places(v: Mapping[str, float], motor: Motor) -> Array:
    """Return the currents (A) at which the curve is shown: 0 and its corners, between which it is
    straight, and some between them where a simpler form is there, too."""
    ends = np.append(0.0, corners(v, motor))
    if not simpler(v):
        return ends
    more = ends[:-1, None] + np.diff(ends)[:, None] * np.linspace(0.0, 1.0, 4, endpoint=False)
    return np.append(more.ravel(), ends[-1])


def simpler(v: Mapping[str, float]) -> bool:
    """Return whether a simpler form of what a leg loses is there, by completed values."""
    return bool(v["dead_time.time"] or v["device_drop.threshold"])


def said(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what a threshold and a resistance make of the curve up to rated current, as least
    squares fit them."""
    i = motor.rated_current * np.linspace(0.02, 1.0, 50)
    u = whole(v, motor, converter, i)
    forms = np.stack([np.ones_like(i), i], axis=1)
    (threshold, ohm), *_ = np.linalg.lstsq(forms, u, rcond=None)
    left = u - forms @ (threshold, ohm)
    share = 1.0 - float(left @ left) / max(float(u @ u), 1e-300)
    late = threshold * converter.sampling_period / converter.dc_bus_voltage
    return (
        f"A threshold of {quantity(threshold, 'V')} (by a dead time alone: {quantity(late, 's')}) "
        f"and a resistance of {quantity(ohm, 'ohm')} explain {100.0 * share:.3g} % of it (of "
        "squares, up to rated current)."
    )


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    amps = corners(v, motor)
    points = [f"[{i:.3g}, {u:.3g}]" for i, u in zip(amps, curve(v, motor, amps), strict=True)]
    more = " beside its dead time and drop" if simpler(v) else ""
    return (
        f"compensate each leg by this curve (A, V){more}, or state it as what the drive loses: "
        f"[drive] inverter_table = [[0, 0], {', '.join(points)}]"
    )


CARD = Effect(
    name="leg_voltage",
    summary="voltage error of a leg against its current, as a free curve",
    subsystem="inverter",
    equation=(
        "leg voltage -= sum of v_k clip(i/(c_k i_0)), corners c_k = 0.0125, 0.02, 0.032, "
        "0.05, ... 2 of a current of "
        "reference i_0: odd, straight between corners, constant beyond the last"
    ),
    formulas=(
        r"u_\text{leg} \;\text{-=}\; \sum_{k=1}^{12} v_k\,\operatorname{clip}\frac{i}{c_k\,i_0}",
    ),
    source=(
        "measured curves of this kind: Guerrero, Leetmaa, Briz, Zamarron, Lorenz, Inverter "
        "nonlinearity effects in high-frequency signal-injection-based sensorless control "
        "methods, IEEE Trans. Ind. Appl. 41 (2005) 618"
    ),
    parameters=(
        *(
            Parameter(
                n,
                "V",
                0.0,
                -1e3,
                1e3,
                TYPICAL,
                "DC link",
                change=USUAL,
                title=f"volts that saturate at {c:g} of the reference",
            )
            for n, c in zip(VOLTS, CORNERS, strict=True)
        ),
        Parameter(
            "reference",
            "A",
            0.0,
            0.0,
            1e5,
            1.0,
            "rated current",
            fit="log",
            spread=0.35,
            title="current of reference of the curve (0: rated current)",
        ),
    ),
    axis="against the current",
    order="1 and 6k",
    region="steps where a phase current crosses zero, or wherever the curve bends",
    confused_with=("dead_time", "device_drop", "stator_resistance"),
    separated_by=(
        "dead time and drops are points of it: they are named where their form explains as much; "
        "a slow ramp of each phase current from zero to twice its rating shows the curve"
    ),
    at=(At("leg_curve", lost, (*VOLTS, "reference")),),
    switches=VOLTS,
    do=do,
    leg_slope=leg_slope,
    free=True,
    curve=Curve("current", "A", "voltage a leg loses", "V", places, whole, said, SIMPLER),
)
