"""Which subsystem is it that shows what no effect of the library explains?

Readings whose sum is not zero: no star-connected machine and no inverter brings that about, a sensor does; one whose
curve is bent, even by the smoothest odd power, has a tenth of its error's squares there (i^3 = 3/4 fundamental and 1/4
third harmonic, alike in all three phases).  What only the motion of free rotors shows is the mechanics', what only the
encoder shows at imposed speed the encoder's.  The rest, which currents show, is the machine's or the inverter's: by how
well functions of either predict it (`evidence.inverter_or_machine`).  What neither predicts is put down to the machine
for the most part: an inverter and a sensor are few parts with known faults, iron and windings no list exhausts; some of
it to where effects of the library could take up most of it together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sandbox.gap.evidence.inverter_or_machine import explained
from sandbox.gap.evidence.normal import Point
from sandbox.replay.replay import Residual, replay, residuals

Array = NDArray[np.float64]
MACHINE = 0.6  # of what currents show and no list holds
THIRD = 10.0  # a bent sensor's squares over those of its third harmonic
NONE = 1e-3  # of it is always left unpredicted, so that a chance is never 0 or 1
SLIGHT = 0.05  # a chance whose weight in any share is smaller than a page shows
SIGNIFICANT = 3.0  # standard deviations of noise's squares that are no excess


def outside(point: Point, spans: Mapping[str, float], chance: float = 1.0) -> dict[str, float]:
    """Return subsystems' shares (sum 1) of what residuals at a point have above noise; spans: shares of what the
    library's effects could take up; chance: that there is anything outside it.  Below SLIGHT no regression is made."""
    prepared = point.turned()
    told = explained(point) if chance >= SLIGHT else (0.0, 0.0)
    return shares(excesses(residuals(prepared, replay(prepared, [point.values]))), spans, told)


def inverters(by_inverter: float, by_machine: float) -> float:
    """Return the chance that it is the inverter's: odds of what either leaves unpredicted, with MACHINE's before."""
    odds = (1.0 - MACHINE) / MACHINE * (1.0 - by_machine + NONE) / (1.0 - by_inverter + NONE)
    return odds / (1.0 + odds)


def shares(
    sizes: Mapping[str, float], spans: Mapping[str, float], predicted: tuple[float, float] = (0.0, 0.0)
) -> dict[str, float]:
    """Return subsystems' shares from the excesses of channels; predicted: shares of what currents show, by functions
    of an inverter and of a machine."""
    total = sizes["current"] + sizes["motion"] + sizes["angle"]
    if not total:
        return dict(spans)
    bent = min(sizes["current"], THIRD * sizes["sum"])
    rest = sizes["current"] - bent
    told, inverter = max(predicted), inverters(*predicted)
    out = {name: (1.0 - told) * (1.0 - MACHINE) * rest * share for name, share in spans.items()}
    out["machine"] += ((1.0 - told) * MACHINE + told * (1.0 - inverter)) * rest
    out["inverter"] += told * inverter * rest
    out["sensor"] += bent + sizes["angle"]
    out["mechanics"] += sizes["motion"]
    whole = sum(out.values())
    return {name: x / whole for name, x in out.items()}


def excesses(shown: Sequence[Residual]) -> dict[str, float]:
    """Return the squares that residuals have above noise: of all currents, of their sum, of motion and angle."""
    parts: dict[str, list[Array]] = {
        "current": [r.current.ravel() for r in shown],
        "sum": [r.current.sum(axis=1).ravel() / math.sqrt(3.0) for r in shown],
        "motion": [r.motion.ravel() for r in shown if r.motion is not None],
        "angle": [r.angle.ravel() for r in shown if r.angle is not None],
    }
    return {name: _excess(np.concatenate(of)) if of else 0.0 for name, of in parts.items()}


def _excess(x: Array) -> float:
    noise = len(x) + SIGNIFICANT * math.sqrt(2.0 * len(x))
    return max(0.0, float(x @ x) - noise)
