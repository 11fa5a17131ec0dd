"""Does one phase miss more than the others, as a fault of its leg, its winding or its sensor makes it?

The currents of a star sum to zero.  So a fault of one leg or one winding that misses a current e in its own phase
misses -e/2 in each other: the squares are as 4 to 1 to 1, and a sensor's fault leaves even less in the others.  What
all phases miss alike is 1 to 1 to 1.  Squares p, 4 p, p beside q everywhere: the one phase's part of all is
6 p / (6 p + 3 q).  Where that is three quarters, the odd phase's squares are 2.8 times either other's, 1.67 in rms.

Squares are averaged over the rotor's angle, turn by turn: then a current that stands still in one phase for a while
(a locked rotor, a standstill) makes no phase odd.  The turns' own scatter says whether the excess could be chance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sandbox.gap.evidence.normal import Point
from sandbox.gap.report.decompose import whole_turns
from sandbox.replay.replay import Residual

Array = NDArray[np.float64]
ONE_PHASE = 0.75  # of what all phases miss: most of it is one phase's
FEWEST = 10  # turns from which their scatter tells chance
SURE = 3.0  # standard errors over turns
PER_TURN = 12  # samples a turn needs


@dataclass(frozen=True)
class OddPhase:
    """The phase ("a", "b" or "c") that misses more, and how many times the rms of the larger other one's excess; None
    where the others miss nothing."""

    phase: str
    times: float | None

    @property
    def text(self) -> str:
        """Return it as a sentence."""
        more = "current, unlike" if self.times is None else f"{self.times:.1f} times as much current as"
        return (
            f"Phase {self.phase} misses {more} either other phase, as with a fault of one phase alone: look at its "
            "sensor, its leg and its winding first."
        )


def odd_phase(point: Point, shown: Sequence[Residual]) -> OddPhase | None:
    """Return the phase that misses more than both others, at least ONE_PHASE of all; None where none surely does.

    shown: the residuals at a point; only turning rotors count, FEWEST electrical turns at the least.
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
    """Return squares of residuals (n, 3) above noise's, averaged over the angle (n,) of each whole turn: (turns, 3)."""
    found = []
    for a, b in whole_turns(angle, PER_TURN, 1.0):
        weight = np.abs(np.gradient(angle[a:b]))
        found.append(weight @ (residual[a:b] ** 2 - 1.0) / weight.sum())
    return np.array(found).reshape(-1, 3)
