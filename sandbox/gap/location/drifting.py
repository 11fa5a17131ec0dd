"""Do the current sensors' offsets differ from recording to recording?

An effect has one value for a campaign, and so has an offset; but sensors warm up, and recordings are made on two days.
A machine or an inverter moves the current with the rotor; over whole turns of it a constant in a phase's readings is
its sensor's.  So the means of what turning recordings miss are asked: how much of the squares above noise is in what
differs between recordings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.effects.said import quantity
from sandbox.gap.evidence.normal import Point
from sandbox.gap.location.decompose import whole_turns
from sandbox.plant.sets import batch_of
from sandbox.replay.inputs import at_rest_reading
from sandbox.replay.replay import Residual

Array = NDArray[np.float64]
FEWEST = 4  # whole turns of a recording
PER_TURN = 12  # samples a turn needs
MOST = 0.5  # of the squares above noise: they are the offsets' for the most part
SURE = 5.0  # standard errors between two recordings
NAMED = 3  # recordings whose offsets a sentence holds


@dataclass(frozen=True)
class Drifting:
    """Sensor (0, 1, 2) whose offset differs most, each turning recording's offset (A), and the share of the squares
    above noise that what differs takes."""

    sensor: int
    offsets: dict[str, float]
    share: float

    @property
    def text(self) -> str:
        """Return it as a sentence, with what to do."""
        ranked = sorted(self.offsets.items(), key=lambda x: x[1])
        shown = ranked if len(ranked) <= NAMED else [ranked[0], ranked[-1]]
        said = ", ".join(f"{quantity(x, 'A')} in {file}" for file, x in shown)
        return (
            f"{100.0 * self.share:.0f} % of what turning recordings miss are offsets of current sensors that differ "
            f"from recording to recording: sensor {'abc'[self.sensor]} reads {said}. Measure the offsets at rest "
            "before each recording and subtract them; an effect has one value for all recordings, so none is named."
        )


def drifting(point: Point, shown: Sequence[Residual]) -> Drifting | None:
    """Return how offsets differ between turning recordings; None where that is not most of what these miss.

    shown: the residuals at a point.
    """
    own = {r.file: found for r, x in zip(point.prepared.recordings, shown, strict=True)
           if r.rotor != "locked" and (found := _means(r.motion.angle, x.current[:, :, 0])) is not None}  # fmt: skip
    if len(own) < 2:
        return None
    means, counts, above = (np.array(x) for x in zip(*own.values(), strict=True))
    total = float(above.sum())
    differ = means - np.average(means, axis=0, weights=counts)
    taken = float(np.sum(counts[:, None] * differ**2))
    sensor = int(np.argmax(np.ptp(means, axis=0)))
    error = math.sqrt(2.0 / float(counts.min()))
    if total <= 0.0 or taken < MOST * total or np.ptp(means[:, sensor]) < SURE * error:
        return None
    drive = point.prepared.campaign.drive
    common = at_rest_reading(batch_of(drive.motor, drive.converter, [dict(point.values)], 1))[sensor]
    offsets = {
        file: float(common) + point.prepared.floor * float(m) for file, m in zip(own, means[:, sensor], strict=True)
    }
    return Drifting(sensor, offsets, min(1.0, taken / total))


def _means(angle: Array, residual: Array) -> tuple[Array, int, float] | None:
    """Return each phase's mean (3,) in floors over whole turns, samples in them, and squares above noise; None where
    there are too few turns."""
    parts = whole_turns(angle, PER_TURN, 1.0)
    if len(parts) < FEWEST:
        return None
    kept = np.concatenate([residual[a:b] for a, b in parts])
    return kept.mean(axis=0), len(kept), float(np.sum(kept**2 - 1.0))
