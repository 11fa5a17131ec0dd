"""A free rotor that nothing corrects: the closed loop's plant under a recording's voltages, against
the switched bench.

In a replay the encoder corrects a free rotor sample by sample, so friction, cogging, inertia and
shaft hardly show in its currents.  Here the plant of `simulate` gets the voltages and the load that
the bench got, once the angle it starts from, and then goes its own way: what it and the bench
differ by in current, angle and speed has
added up over the whole recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from model.effects.library import true_motor
from model.parameters import Drive
from sandbox.drive.closed import closed_bench, longest_step
from sandbox.drive.loop import MEMORY, Memory, Rig, at_sample, progress
from sandbox.drive.sensing import encoder, looked_at, read_phases
from sandbox.plant.period import AppliedTorque
from sandbox.plant.sets import complete, features_of
from sandbox.recordings.campaign import CampaignRecording
from sandbox.replay.motion.smoothing import Motion

START = 0.3  # rad electrical: where the bench's free rotor stands at first


class Left(NamedTuple):
    """Rms differences: current over rated current, angle read (degrees electrical), its speed over
    rated speed."""

    current: float
    angle: float
    speed: float


def alone(
    drive: Drive,
    recording: CampaignRecording,
    motion: Motion,
    effects: Mapping[str, float],
    settled: int,
    finer: float = 1.0,
) -> Left:
    """Return how far the plant is from a free recording of the bench and the motion that the
    bench's encoder reads.

    settled: samples at the beginning that do not count; finer: so many times shorter steps than a
    closed loop's.
    """
    motor, converter = drive.motor, drive.converter
    values, period = complete(motor, converter, effects), converter.sampling_period
    top = float(np.abs(motion.speed).max())
    step = longest_step(true_motor(motor, values), values, features_of(motor, values), top)
    step = min(step, 0.5 * period) / finer
    bench = closed_bench(motor, converter, values, "free", START, step)
    w, rng = bench.w, np.random.default_rng(0)
    rig = Rig(*5 * (0,), period, 0.0, 0.0, 0.0, converter.dc_bus_voltage, 0.0, 0.0)
    memory, (looks, seen) = np.zeros(MEMORY), looked_at(w, period, None)
    memory[Memory.LINK], memory[Memory.INSTANT] = 1.0, w["sample"][0]
    n, load = len(recording.t), recording.columns["load_torque"]
    currents, track, until = np.empty((n, 3)), np.empty((n, 2)), period - float(w["delay"][0])
    for k in range(n):
        applied = AppliedTorque(load[k], 0.0, until, load[min(k + 1, n - 1)], 0.0)
        track[k] = encoder(w, bench.features, *at_sample(w, rig, applied), 0.0)
        memory[Memory.U_ALPHA], memory[Memory.U_BETA] = recording.u_alpha[k], recording.u_beta[k]
        progress(k, bench, rig, applied, memory, looks, seen, rng, False)
        currents[k] = read_phases(w, rig, rng)
    read = np.stack([recording.i_a, recording.i_b, recording.i_c], axis=1)
    miss = (
        np.sqrt(np.mean(np.sum((currents - read)[settled:] ** 2, axis=1) * 2.0 / 3.0))
        / motor.rated_current
    )
    off = np.sqrt(
        np.mean((track - np.stack([motion.angle, motion.speed], axis=1))[settled:] ** 2, axis=0)
    )
    return Left(float(miss), float(np.degrees(off[0])), float(off[1] / motor.rated_omega))
