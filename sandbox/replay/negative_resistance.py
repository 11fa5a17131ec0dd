"""Legs that give volts back: where a dead time is over-compensated, the current is unstable around
zero.

A compensation that adds too much (a negative dead time) gives a leg volts that grow with its
current, within the zone in which the current's sign goes through zero: a negative incremental
resistance.  Where it exceeds the winding's, the current does not stay at zero: it runs to one side
or the other, on what is too small to be known.  A replay with voltages prescribed then leaves the
recording whatever its parameters are, and a fit bends other numbers to bring it back.

So the readings hold such a replay, as an observer does.  In the current, x' = (S - R) G x: S (ohm)
what legs give back, R the winding, G the inverse inductance.  Of a state that starts unknown and is
driven by nothing unknown the Kalman filter's gain goes to the one that mirrors each unstable pole,
1 - exp(-2 (S - R) G T) a reading, and to none for stable ones.  In the flux that is 2 (S - R) T
volt-seconds for each ampere by which a reading differs from what is predicted: a resistance of
twice the excess, whatever the inductance.  Near S = R, where neither holds the current, what little
is unknown of the voltage (the angle's noise in a turning rotor) adds up without end; so what legs
give back is taken at least, and nothing is remembered longer than the winding does by itself:
max(S, 2 (S - R)).  A leg counts that is near zero by the reading or by the prediction: one of both
has left first.  Predictions are then those of the next reading; their errors are those of readings
times exp((S - R) G T) while a leg is near zero, which nobody takes into account.
Checked: tests/sandbox/replay/test_negative_resistance.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from model.compiled import kernel
from model.effects import library
from model.effects.card import Legs
from model.frames import stationary
from model.parameters import Converter, Motor
from sandbox.plant.edges import LEG_X, LEG_Y
from sandbox.plant.electrical import HALF_ROOT

TWO_THIRDS = 2.0 / 3.0

Set = Mapping[str, float]


class Given(NamedTuple):
    """What legs give back around zero current: ohms (lanes,) of each leg, within so many A (lanes,)
    of zero; inverse: the largest 1/L of the motor (1/H); acts: whether readings hold any lane;
    hold: ohms that they hold any current by (`held`)."""

    ohms: Array
    within: Array
    inverse: float
    acts: bool
    hold: float


def given_back(motor: Motor, converter: Converter, sets: Sequence[Set], links: Array) -> Given:
    """Return what legs of completed sets, a lane each, give back around zero current, as the
    effects' cards say (`leg_slope`); links: (lanes,) their DC links' voltages, V."""
    period = converter.sampling_period * converter.samples_a_period
    zones = [v["bench.soft_current"] for v in sets]
    slopes = [
        library.leg_slope(v, motor, Legs(float(link), period, zone))
        for v, link, zone in zip(sets, links, zones, strict=True)
    ]
    ohms = np.array([max(0.0, -slope.ohms) for slope in slopes])
    inverse = 1.0 / min(motor.inductance_d, motor.inductance_q)
    return Given(ohms, np.array([s.within for s in slopes]), inverse, bool(np.any(ohms > 0.0)), 0.0)


def none_given(lanes: int) -> Given:
    """Return that of a replay that goes by its voltages alone."""
    return Given(np.zeros(lanes), np.zeros(lanes), 0.0, False, 0.0)


def held_everywhere(given: Given, ohms: float) -> Given:
    """Return that of a replay that readings hold at any current, as a resistance of so many ohms
    does."""
    return Given(given.ohms, given.within, given.inverse, True, ohms)


@kernel
def held_by_readings(w, given, row, seconds, early):
    """Correct the flux of lanes whose legs give volts back by what a row's readings (A) differ from
    theirs; seconds: from reading to reading; early: of lanes that sample before the pattern's
    start, or of the others."""
    for j in range(w.psi_alpha.size):
        if given.ohms[j] + given.hold <= 0.0 or (w.sample[j] < 0.0) != early:
            continue
        half, side = -0.5 * w.held_alpha[j], HALF_ROOT * w.held_beta[j]
        phases, seen = (w.held_alpha[j], half + side, half - side), (row.i_a, row.i_b, row.i_c)
        aa = ab = bb = 0.0
        for m in range(3):
            if min(abs(phases[m]), abs(seen[m])) < given.within[j]:
                v = TWO_THIRDS * given.ohms[j]
                aa, bb = aa + v * LEG_X[m] * LEG_X[m], bb + v * LEG_Y[m] * LEG_Y[m]
                ab += v * LEG_X[m] * LEG_Y[m]
        x, y = stationary(row.i_a - w.read_a[j], row.i_b - w.read_b[j], row.i_c - w.read_c[j])
        legs = (aa, ab, bb, w.resistance[j], given.hold)
        a, b = taken_back(legs, (x, y), seconds, given.inverse)
        w.psi_alpha[j], w.psi_beta[j] = w.psi_alpha[j] + a, w.psi_beta[j] + b
        w.eddy_alpha[j], w.eddy_beta[j] = w.eddy_alpha[j] + a, w.eddy_beta[j] + b


@kernel
def taken_back(legs, miss, seconds, inverse):
    """Return the volt-seconds that take back what legs give (aa, ab, bb of a symmetric matrix, ohm)
    beside a winding (ohm), at least what `hold` ohms take, for a difference (x, y) in A."""
    aa, ab, bb, winding, hold = legs
    x, y = miss
    mean, apart = 0.5 * (aa + bb), math.hypot(0.5 * (aa - bb), ab)
    first = gain(mean + apart, winding, hold, seconds, inverse)
    if mean + apart <= 0.0:
        return first * x, first * y
    second = gain(mean - apart, winding, hold, seconds, inverse)
    # along the eigenvector of the larger one: (1 + (matrix - mean) / apart) / 2 projects on it
    c, s = ((aa - mean) / apart, ab / apart) if apart > 0.0 else (0.0, 0.0)
    even, odd = 0.5 * (first + second), 0.5 * (first - second)
    return even * x + odd * (c * x + s * y), even * y + odd * (s * x - c * y)


@kernel
def gain(ohms, winding, hold, seconds, inverse):
    """Return the volt-seconds an ampere for one eigenvalue of what legs give back.  Where it grows
    much from reading to reading, no more than leaves the corrected state stable."""
    own = max(ohms, 2.0 * (ohms - winding), hold) * seconds
    return own / (1.0 + own * inverse)
