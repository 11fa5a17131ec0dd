"""The modulator: duties of three legs from the voltage asked for, as a drive's `modulation` says.

Every pulse stays centred in its period. What a modulator chooses is the part common to all legs,
which no current sees between the terminals of a star: in the middle (`centred`), or so that one leg
does not switch at
all (discontinuous PWM): the lowest low (`dpwm_min`), the highest high (`dpwm_max`), or the one of
the largest voltage, each leg twice a turn for 60 degrees around its peaks (`dpwm_60`).  Beyond the
hexagon of what legs can give, a voltage is taken to the nearest point of it (`nearest`; least error
of magnitude) or shortened (`shortened`; least error of angle); from SIX_STEP of the link on
`six_step` gives the nearest corner: every leg switches once in half a turn.  A pulse shorter than
`least` is dropped, and so is a gap.

Sources: Hava, Kerkman, Lipo, Simple analytical and graphical methods for carrier-based PWM-VSI
drives, IEEE Trans. Power Electronics 14(1), 1999 (discontinuous PWM); Hava, Sul, Kerkman, Lipo,
Dynamic overmodulation characteristics of triangle intersection PWM methods, IEEE Trans. Industry
Applications 35(4), 1999 (`nearest`, `shortened`).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from model.compiled import kernel
from model.parameters import Converter
from sandbox.plant.edges import duties

SIX_STEP = 2.0 / math.pi  # of the link: the amplitude of six steps' fundamental wave
ROUNDING = 1e-9  # of the period: a pulse or a gap so short is none
ANGLES = 720  # of a turn, over which a mean is taken
ROOT, TWO_THIRDS = 0.8660254037844386, 2.0 / 3.0


class Pattern(IntEnum):
    """Which legs switch: MODULATIONS, as compiled code has them."""

    CENTRED, DPWM_MIN, DPWM_MAX, DPWM_60 = range(4)


class Beyond(IntEnum):
    """What is made of a voltage that the legs cannot give: OVERMODULATIONS, or nothing stated."""

    NONE, NEAREST, SHORTENED, SIX_STEP = range(4)


class Modulation(NamedTuple):
    """How a drive modulates: numbers of `Pattern` and `Beyond`, least pulse as a share of the
    period."""

    pattern: int
    beyond: int
    least: float


PLAIN = Modulation(int(Pattern.CENTRED), int(Beyond.NONE), 0.0)


def modulation_of(converter: Converter) -> Modulation:
    """Return how a converter modulates."""
    return Modulation(
        int(Pattern[converter.modulation.upper()]),
        int(Beyond[(converter.overmodulation or "none").upper()]),
        converter.least_pulse / converter.update_period,
    )


@kernel
def is_plain(how):
    """Tell whether a drive modulates as `edges.duties` does, never beyond its own limit."""
    return how.pattern == Pattern.CENTRED and how.beyond == Beyond.NONE and how.least == 0.0


@kernel
def modulated(how, u_alpha, u_beta, u_dc):
    """Return the duties of three legs for a voltage asked for (V) and the link as read (V)."""
    if is_plain(how):
        return duties(u_alpha, u_beta, u_dc)
    a, b, c = u_alpha, -0.5 * u_alpha + ROOT * u_beta, -0.5 * u_alpha - ROOT * u_beta
    if how.beyond == Beyond.SIX_STEP and math.hypot(u_alpha, u_beta) >= SIX_STEP * u_dc:
        return 1.0 if a > 0.0 else 0.0, 1.0 if b > 0.0 else 0.0, 1.0 if c > 0.0 else 0.0
    scale = u_dc / max(max(a, b, c) - min(a, b, c), u_dc) if how.beyond == Beyond.SHORTENED else 1.0
    # limited: the nearest point of the hexagon
    a, b, c = duties(scale * u_alpha, scale * u_beta, u_dc)
    if how.pattern != Pattern.CENTRED:
        low, high = min(a, b, c), max(a, b, c)
        up = how.pattern == Pattern.DPWM_MAX or (
            how.pattern == Pattern.DPWM_60 and high + low > TWO_THIRDS * (a + b + c)
        )
        side = 1.0 - high if up else -low
        a, b, c = a + side, b + side, c + side
    return kept(a, how.least), kept(b, how.least), kept(c, how.least)


@kernel
def kept(duty, least):
    """Return a leg's duty without a pulse, or a gap, that is shorter than the least (of the
    period)."""
    least = max(least, ROUNDING)
    if duty < least:
        return 0.0
    return 1.0 if duty > 1.0 - least else duty


@kernel
def given(legs, u_dc):
    """Return the mean voltage (V) that three legs' duties give."""
    a, b, c = legs
    return TWO_THIRDS * u_dc * (a - 0.5 * (b + c)), TWO_THIRDS * ROOT * u_dc * (b - c)


def attainable(converter: Converter) -> float:
    """Return the largest mean amplitude (V) that a drive's modulator gives over a turn."""
    if converter.overmodulation is None:
        return converter.voltage_limit
    how, link, most = (
        modulation_of(converter)._replace(least=0.0),
        converter.dc_bus_voltage,
        converter.command_limit,
    )
    wave = np.exp(2j * math.pi * (np.arange(ANGLES) + 0.5) / ANGLES)
    got = [complex(*given(modulated(how, most * e.real, most * e.imag, link), link)) for e in wave]
    return float(np.mean((np.array(got) * wave.conj()).real))
