"""Linearity error of the current sensors against the current, as a free curve: for sensors whose
errors are neither gains nor offsets.

The curve is odd, a polynomial without its linear term, which is a gain.  All three sensors have the
same one.  Data sheets state the largest of such an error as "linearity".
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from model.array_types import Array
from model.compiled import inlined
from model.effects.card import At, Curve, Effect, Parameter
from model.effects.said import quantity
from model.parameters import Converter, Motor

FARTHEST = 2.5  # times rated current up to which the curve is shown
# of the current at the current of reference: what a term of a diagnosis usually is, and one of a
# run with typical terms
USUAL, TYPICAL = 0.01, 0.004
TERMS = {"second": 2, "third": 3, "fourth": 4}


@inlined
def one(second, third, fourth, per, i):
    """Return what a sensor reads at a current (A); per: 1/A."""
    x = abs(i) * per
    return i * (1.0 + x * (second + x * (third + x * fourth)))


@inlined
def bent(second, third, fourth, reference, a, b, c):
    """Return three readings (A) with their sensors' linearity error; reference: A."""
    per = 1.0 / max(reference, 1e-30)
    return (
        one(second, third, fourth, per, a),
        one(second, third, fourth, per, b),
        one(second, third, fourth, per, c),
    )


def places(v: Mapping[str, float], motor: Motor) -> Array:
    """Return the currents (A) at which the curve is shown."""
    return np.linspace(0.0, FARTHEST * motor.rated_current, 26)


def curve(v: Mapping[str, float], motor: Motor, converter: Converter, current: Array) -> Array:
    """Return the error of readings (A, any shape) at currents (A), by completed values."""
    i = np.asarray(current, dtype=float)
    x = np.abs(i) / (v["current_linearity.reference"] or motor.rated_current)
    return np.asarray(i * sum(v[f"current_linearity.{n}"] * x ** (k - 1) for n, k in TERMS.items()))


def said(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return how large the error is at rated current and at twice that."""
    rated, twice = curve(v, motor, converter, motor.rated_current * np.array([1.0, 2.0]))
    share = 100.0 / motor.rated_current
    return (
        f"The sensors read {quantity(rated, 'A')} ({share * rated:+.2g} %) off at rated current, "
        f"{quantity(twice, 'A')} ({0.5 * share * twice:+.2g} %) at twice rated current."
    )


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    (rated,) = curve(v, motor, converter, np.array([motor.rated_current]))
    return (
        f"compare the sensors with a reference up to the largest current ({quantity(rated, 'A')} "
        "off at rated current), correct the readings by the curve, or choose a wider range: "
        "a core that saturates, an amplifier near its rail"
    )


CARD = Effect(
    name="current_linearity",
    summary="linearity error of the current sensors, as a free curve",
    subsystem="sensor",
    equation=(
        "reading = i (1 + c_2 x + c_3 x^2 + c_4 x^3), x = |i|/i_0, i_0 a current of reference; all "
        "three sensors alike"
    ),
    formulas=(
        r"i_\text{read} = i\,\bigl(1 + c_2\,x + c_3\,x^2 + c_4\,x^3\bigr), \qquad "
        r"x = \frac{|i|}{i_0}",
    ),
    source=(
        "linearity error as data sheets of current transducers define it: largest deviation from "
        "the straight line, IEC 61869-1; its curve: Ziegler, Woodward, Iu, Borle, Current sensing "
        "techniques: a review, IEEE Sensors J. 9 (2009) 354"
    ),
    parameters=(
        *(
            Parameter(
                n,
                "",
                0.0,
                -0.5,
                0.5,
                TYPICAL,
                change=USUAL,
                title=f"term of {n} order of the sensors' linearity error, at the reference",
            )
            for n in TERMS
        ),
        Parameter(
            "reference",
            "A",
            0.0,
            0.0,
            1e5,
            1.0,
            "rated current",
            fit="fixed",
            title="current of reference of the curve (0: rated current)",
        ),
    ),
    axis="both",
    order="0 and 6k",
    region="grows faster than the current",
    confused_with=("current_gain", "saturation", "inductance"),
    separated_by=(
        "slow ramps of a locked rotor's current on both axes, at several rotor angles: the error "
        "goes with the phase currents, saturation with the rotor's axes"
    ),
    at=(At("reading", bent, (*TERMS, "reference")),),
    switches=tuple(TERMS),
    do=do,
    free=True,
    curve=Curve("current", "A", "error of a sensor's reading", "A", places, curve, said),
)
