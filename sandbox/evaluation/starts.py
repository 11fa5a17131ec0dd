"""Thousands of initial positions: starting up alone, compiled, from every angle with its own
noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.contract import Estimator
from estimators.startup import start_periods
from model.errors import BadInput
from model.frames import wrapped
from model.parameters import Drive
from sandbox.drive import loop
from sandbox.drive.closed import turned_to
from sandbox.drive.design import belief_of, design
from sandbox.drive.feasible import check_feasible, first_state, step_of
from sandbox.drive.recording import ROW
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import LONGEST, exact_bench, inside_for, profile_of, rig_of
from sandbox.plant.sets import complete
from sandbox.recordings.injection import carrier

ANGLES = 36
AFTER = 0.004  # s simulated beyond the end of starting up
REVERSED = 0.5 * math.pi


@dataclass(frozen=True)
class Starts:
    """What starting up found: error (rad, in [-pi, pi)) of each start, by angle (rows) and seed
    (columns)."""

    errors: NDArray[np.float64]

    @property
    def right(self) -> float:
        """Share of starts with the magnet's north where it is."""
        return float(np.mean(np.abs(self.errors) < REVERSED))

    @property
    def axis_errors(self) -> NDArray[np.float64]:
        """Error of the axis alone, polarity left aside, degrees in [-90, 90)."""
        return np.degrees((self.errors + REVERSED) % math.pi - REVERSED)


def starts(
    drive: Drive, estimator: Estimator, belief: str, count: int = 3024, seed: int = 0
) -> Starts:
    """Start `count` times from ANGLES equidistant angles, each start with noise of its own;
    BadInput, PhysicsError."""
    if count < ANGLES:
        raise BadInput(f"{count} starts do not cover {ANGLES} angles; give at least {ANGLES}")
    scenario = Scenario("starts", (Segment(AFTER),))
    gains, believed = design(drive, published=estimator.takes_published), belief_of(drive, belief)
    check_feasible(drive, scenario, gains)
    tuning, h = gains.tuning, gains.tuning.sampling_period
    wave, profile = carrier(drive.injection, drive.converter), profile_of(drive, scenario)
    begin = start_periods(tuning.settle, tuning.average) * tuning.period * h
    samples = round((begin + AFTER) / h)
    values = complete(drive.motor, drive.converter, None)
    run, bench = exact_bench(
        drive, scenario, values, LONGEST, None, believed, inside_for(estimator, drive)
    )
    rig = rig_of(drive, scenario, True, samples, 1, begin)
    step, rows = step_of(estimator, believed), np.zeros(samples, ROW)
    seeds = count // ANGLES
    errors = np.full((ANGLES, seeds), np.nan)
    for k, angle in enumerate(np.arange(ANGLES) * 2.0 * math.pi / ANGLES - math.pi):
        for n in range(seeds):
            # fills the gap between two of the angles
            at = turned_to(bench, angle + 0.17 * n / seeds)
            rng = np.random.default_rng([seed, k, n])
            status, _ = run(
                step,
                first_state(estimator, believed, tuning, None),
                at,
                inside_for(estimator, drive),
                rig,
                gains.control,
                believed,
                tuning,
                profile,
                wave.waveform,
                wave.primitive,
                rng,
                rows,
            )
            first = rows[int(np.argmax(rows["tracking"] > 0.0))]
            if status == loop.Status.DONE and first["tracking"] > 0.0:
                errors[k, n] = wrapped(first["theta"] - first["theta_hat"])
    return Starts(errors)
