"""Which subsystem is it that shows what no effect of the library explains?

Readings whose sum is not zero: no star-connected machine and no inverter brings that about, a
sensor does; one whose curve is bent, even by the smoothest odd power, has a tenth of its error's
squares there (i^3 = 3/4 fundamental and 1/4 third harmonic, alike in all three phases).  What only
the motion of free rotors shows is the mechanics', what only the encoder shows at imposed speed the
encoder's.  The rest, which currents show, is the machine's or the inverter's: by how well functions
of either predict it (`evidence.inverter_or_machine`).  What neither predicts is put down to the
machine for the most part: an inverter and a sensor are few parts with known faults, iron and
windings no
list exhausts; some of it to where effects of the library could take up most of it together.

Does one phase miss more than the others, as a fault of its leg, its winding or its sensor makes it?

The currents of a star sum to zero.  So a fault of one leg or one winding that misses a current e in
its own phase misses -e/2 in each other: the squares are as 4 to 1 to 1, and a sensor's fault leaves
even less in the others.  What all phases miss alike is 1 to 1 to 1.  Squares p, 4 p, p beside q
everywhere: the one phase's part of all is 6 p / (6 p + 3 q).  Where that is three quarters, the odd
phase's squares are 2.8 times either other's, 1.67 in rms.

Squares are averaged over the rotor's angle, turn by turn: then a current that stands still in one
phase for a while (a locked rotor, a standstill) makes no phase odd.  The turns' own scatter says
whether the excess could be chance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from model.array_types import Array
from sandbox.gap.evidence.inverter_or_machine import explained
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import whole_turns
from sandbox.replay.replay import Residual, replay, residuals

MACHINE = 0.6  # of what currents show and no list holds
THIRD = 10.0  # a bent sensor's squares over those of its third harmonic
NONE = 1e-3  # of it is always left unpredicted, so that a chance is never 0 or 1
SLIGHT = 0.05  # a chance whose weight in any share is smaller than a page shows
SIGNIFICANT = 3.0  # standard deviations of noise's squares that are no excess
ONE_PHASE = 0.75  # of what all phases miss: most of it is one phase's
FEWEST = 10  # turns from which their scatter tells chance
SURE = 3.0  # standard errors over turns
PER_TURN = 12  # samples a turn needs


def outside(
    point: ParameterPoint, spans: Mapping[str, float], chance: float = 1.0
) -> dict[str, float]:
    """Return subsystems' shares (sum 1) of what residuals at a point have above noise; spans:
    shares of what the library's effects could take up; chance: that there is anything outside it.
    Below SLIGHT no regression is made."""
    prepared = point.turned()
    predicted = explained(point) if chance >= SLIGHT else (0.0, 0.0)
    return shares(excesses(residuals(prepared, replay(prepared, [point.values]))), spans, predicted)


def inverters(by_inverter: float, by_machine: float) -> float:
    """Return the chance that it is the inverter's: odds of what either leaves unpredicted, with
    MACHINE's before."""
    odds = (1.0 - MACHINE) / MACHINE * (1.0 - by_machine + NONE) / (1.0 - by_inverter + NONE)
    return odds / (1.0 + odds)


def shares(
    sizes: Mapping[str, float],
    spans: Mapping[str, float],
    predicted: tuple[float, float] = (0.0, 0.0),
) -> dict[str, float]:
    """Return subsystems' shares from the excesses of channels; predicted: shares of what currents
    show, by functions of an inverter and of a machine."""
    total = sizes["current"] + sizes["motion"] + sizes["angle"]
    if not total:
        return dict(spans)
    bent = min(sizes["current"], THIRD * sizes["sum"])
    rest = sizes["current"] - bent
    known, inverter = max(predicted), inverters(*predicted)
    out = {name: (1.0 - known) * (1.0 - MACHINE) * rest * share for name, share in spans.items()}
    out["machine"] += ((1.0 - known) * MACHINE + known * (1.0 - inverter)) * rest
    out["inverter"] += known * inverter * rest
    out["sensor"] += bent + sizes["angle"]
    out["mechanics"] += sizes["motion"]
    whole = sum(out.values())
    return {name: x / whole for name, x in out.items()}


def excesses(shown: Sequence[Residual]) -> dict[str, float]:
    """Return the squares that residuals have above noise: of all currents, of their sum, of motion
    and angle."""
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


@dataclass(frozen=True)
class OddPhase:
    """The phase ("a", "b" or "c") that misses more, and how many times the rms of the larger other
    one's excess; None where the others miss nothing."""

    phase: str
    times: float | None

    @property
    def text(self) -> str:
        """Return it as a sentence."""
        more = (
            "current, unlike"
            if self.times is None
            else f"{self.times:.1f} times as much current as"
        )
        return (
            f"Phase {self.phase} misses {more} either other phase, as with a fault of one phase "
            "alone: look at its sensor, its leg and its winding first."
        )

    @property
    def exchange(self) -> str:
        """Return what to record next: the same with the odd phase's sensor exchanged."""
        own, other = self.phase, "a" if self.phase != "a" else "b"
        return (
            f"Exchange the current sensors of phases {own} and {other}, their channels included, "
            f"keep the names of the phases in the log, and record again. Where phase {other} then "
            f"misses more, it is that sensor's fault; where phase {own} still does, its leg's or "
            "its winding's."
        )


def odd_phase(point: ParameterPoint, shown: Sequence[Residual]) -> OddPhase | None:
    """Return the phase that misses more than both others, at least ONE_PHASE of all; None where
    none surely does.

    shown: the residuals at a point; only turning rotors count, FEWEST electrical turns at the
    least.
    """
    own = zip(point.prepared.recordings, shown, strict=True)
    turns = [_by_turn(r.motion.angle, x.current[:, :, 0]) for r, x in own if r.rotor != "locked"]
    squares = np.concatenate(turns) if turns else np.zeros((0, 3))
    if len(squares) < FEWEST:
        return None
    mean = squares.mean(axis=0)
    worst, other = (int(k) for k in np.argsort(mean)[[2, 1]])
    above = squares[:, worst] - _to_others() * squares[:, other]
    if above.mean() <= SURE * above.std(ddof=1) / math.sqrt(len(above)):
        return None
    times = math.sqrt(mean[worst] / mean[other]) if mean[other] > 0.0 else None
    return OddPhase("abc"[worst], times)


def _to_others() -> float:
    """Return the odd phase's squares over either other's where its own part of all is ONE_PHASE."""
    everywhere = 2.0 * (1.0 / ONE_PHASE - 1.0)  # q over p
    return (4.0 + everywhere) / (1.0 + everywhere)


def _by_turn(angle: Array, residual: Array) -> Array:
    """Return squares of residuals (n, 3) above noise's, averaged over the angle (n,) of each whole
    turn: (turns, 3)."""
    found = []
    for a, b in whole_turns(angle, PER_TURN, 1.0):
        weight = np.abs(np.gradient(angle[a:b]))
        found.append(weight @ (residual[a:b] ** 2 - 1.0) / weight.sum())
    return np.array(found).reshape(-1, 3)
