"""One recording through a batch of parameter sets: sample, period, sample, ... (see `sandbox.replay.replay`)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from model.compiled import kernel
from sandbox.plant import additions as add
from sandbox.plant.edges import write_edges
from sandbox.plant.mechanics import step_shaft
from sandbox.plant.period import Course, travel
from sandbox.plant.sampling import deviate, hold_start, read


class Track(NamedTuple):
    """What a recording gives to all sets alike, one value a sample (n,): duties, the encoder's angle over the period
    from there on (cos and sin in its middle, then rate, bend, jerk as `Course`), its speed (rad/s electrical) and
    mechanical angle (rad) at the sample (none where nothing is to be taken off for it), the load asked for (N m), and
    of a free rotor the angle read (rad), gains and scale of its innovation, and smoothed mechanical angle and speed in
    the middle of the period."""

    d_a: Any
    d_b: Any
    d_c: Any
    cos: Any
    sin: Any
    rate: Any
    bend: Any
    jerk: Any
    speed: Any
    turn: Any
    load: Any
    read: Any
    gain_angle: Any
    gain_speed: Any
    scale: Any
    middle_turn: Any
    middle_omega: Any


@kernel
def write(w, out, row, first):
    """Write the readings (A) of all lanes to a row."""
    for j in range(w.psi_a.size):
        out[row, 0, first + j] = w.read_a[j]
        out[row, 1, first + j] = w.read_b[j]
        out[row, 2, first + j] = w.read_c[j]


@kernel
def write_some(w, out, row, first, early):
    """Write those of lanes that sample before the pattern's start (early), or of the others."""
    for j in range(w.psi_a.size):
        if (w.sample[j] < 0.0) == early:
            out[row, 0, first + j] = w.read_a[j]
            out[row, 1, first + j] = w.read_b[j]
            out[row, 2, first + j] = w.read_c[j]


@kernel
def correct(w, track, k, moved, first):
    """Write the innovation of the encoder's reading over its standard deviation, and correct the motion with it."""
    for j in range(w.psi_a.size):
        seen = track.read[k] - w.offset[j] - w.deviation[j]
        if k == 0:
            w.angle[j] = seen
        miss = seen - (w.angle[j] + w.pairs[j] * w.load_share[j] * w.twist[j])
        w.angle[j] += track.gain_angle[k] * miss
        w.speed[j] += track.gain_speed[k] * miss
        moved[k, first + j] = track.scale[k] * miss


@kernel
def predict(w, features, track, k, period):
    """Move a free rotor on by a period under the mean torque; friction at the motion smoothed for all sets.

    The pattern's last part, as long as its delay, lies after the next sample: its torque belongs to the next period.
    """
    for j in range(w.psi_a.size):
        tail = w.torque[j]
        w.torque[j] = (w.impulse[j] + w.delay[j] * (w.last_torque[j] - tail)) / period
        w.impulse[j], w.last_torque[j] = 0.0, tail
        w.turn[j] = track.middle_turn[k] - (w.offset[j] + w.deviation[j]) / w.pairs[j]
        w.omega[j] = track.middle_omega[k]
    step_shaft(w, features, period, track.load[k], 0.0)


@kernel
def run(w, flux_map, timing, features, room, track, out, moved, first):
    """Replay one recording; readings (A) go to out[k, 0:3, first:first + lanes], a free rotor's innovations to
    moved[k, first:] where features say MOTION.  w starts with fluxes and currents of the first sample; room: fresh."""
    n, lanes, period = len(track.d_a), w.psi_a.size, timing.period
    duty, before, looks, seen = np.full(3, 0.5), np.full(3, 0.5), np.empty(0), np.empty((0, 2))
    span, wobbling = 0.0, features & add.WOBBLE != 0 and len(track.turn) > 0
    if wobbling:
        deviate(w, track.turn[0])
        deviate(w, track.turn[0])
        for j in range(lanes):
            w.deviation[j] = w.next_deviation[j]
    hold_start(w, features)
    read(w)
    write(w, out, 0, first)
    for k in range(n):
        if features & add.MOTION:
            correct(w, track, k, moved, first)
        if wobbling and k < n - 1:
            deviate(w, track.turn[k + 1])
        for m in range(3):
            before[m] = duty[m]
        duty[0], duty[1], duty[2] = track.d_a[k], track.d_b[k], track.d_c[k]
        write_edges(room.edges, duty, before, room.shift, period)
        course = Course(
            track.cos[k], track.sin[k], 0.5 * period, 0.0, track.rate[k], track.bend[k], track.jerk[k], track.speed[k],
            0.0, 0.0,
        )  # fmt: skip
        span = travel(w, flux_map, timing, features, room, course, k * period, duty, before, span, looks, seen)
        read(w)
        if timing.first >= 0.0:
            write(w, out, k, first)
        else:
            write_some(w, out, k, first, False)
            write_some(w, out, min(k + 1, n - 1), first, k < n - 1)
        if features & add.MOTION:
            predict(w, features, track, k, period)
        if wobbling:
            for j in range(lanes):
                w.deviation[j] = w.next_deviation[j]
