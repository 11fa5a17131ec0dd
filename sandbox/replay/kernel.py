"""One recording through a batch of parameter sets: sample, period, sample, ... (see
`sandbox.replay.replay`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.compiled import kernel
from sandbox.plant import additions as add
from sandbox.plant.edges import write_edges
from sandbox.plant.mechanics import step_shaft
from sandbox.plant.period import STILL, RotorTrajectory, travel
from sandbox.plant.sampling import deviate, hold_start, read
from sandbox.replay.negative_resistance import Given, held_by_readings

TRACK = np.dtype(
    [
        (name, np.float64)
        for name in (
            "d_a",
            "d_b",
            "d_c",  # duties
            "half",  # of a PWM period, at double update: 1 legs rise, -1 they fall; else 0
            "link",  # the link's mean voltage over the period, in nominal ones
            "cos",
            "sin",
            "rate",
            "bend",
            "jerk",  # the encoder's angle over the period, about its middle (`RotorTrajectory`)
            "speed",
            "turn",  # its speed (rad/s electrical) and mechanical angle (rad) at the sample
            "load",  # asked for, N m
            "read",
            "gain_angle",
            "gain_speed",
            "scale",  # angle read by a free rotor (rad), gains and scale of its innovation
            "middle_turn",
            "middle_omega",  # smoothed mechanical angle and speed in the middle of the period
            "i_a",
            "i_b",
            "i_c",  # currents read, A
        )
    ]
)
"""What a recording gives to all sets alike, one record a sample."""


class Rows(NamedTuple):
    """Periods start to stop - 1 of a track, of which each held-th begins a row of the log; begins:
    periods from the recording's beginning to the first one of the track."""

    held: int
    begins: int
    start: int
    stop: int


class Fixed(NamedTuple):
    """What does not change from period to period: whether the angle handed in still holds what
    encoders are off; w.supply (V) as it began; what legs give back (`negative_resistance`)."""

    eccentric: bool
    supply: NDArray[np.float64]
    given: Given


@kernel
def write(w, out, row, first):
    """Write the readings (A) of all lanes to a row."""
    for j in range(w.psi_alpha.size):
        out[row, 0, first + j] = w.read_a[j]
        out[row, 1, first + j] = w.read_b[j]
        out[row, 2, first + j] = w.read_c[j]


@kernel
def write_some(w, out, row, first, early):
    """Write those of lanes that sample before the pattern's start (early), or of the others."""
    for j in range(w.psi_alpha.size):
        if (w.sample[j] < 0.0) == early:
            out[row, 0, first + j] = w.read_a[j]
            out[row, 1, first + j] = w.read_b[j]
            out[row, 2, first + j] = w.read_c[j]


@kernel
def correct(w, track, k, moved, row, first):
    """Write the innovation of the encoder's reading over its standard deviation to a row of
    `moved`, and correct the motion with it."""
    for j in range(w.psi_alpha.size):
        seen = track[k].read - w.offset[j] - w.deviation[j] + w.latency[j] * track[k].speed
        if k == 0:
            w.angle[j] = seen - w.pairs[j] * w.load_share[j] * w.twist[j]
        miss = seen - (w.angle[j] + w.pairs[j] * w.load_share[j] * w.twist[j])
        w.angle[j] += track[k].gain_angle * miss
        w.speed[j] += track[k].gain_speed * miss
        moved[row, first + j] = track[k].scale * miss


@kernel
def pull(w, period):
    """Write the mean torque of a period of a free rotor (N m).

    The pattern's last part, as long as its delay, lies after the next sample: its torque belongs to
    the next period.
    """
    for j in range(w.psi_alpha.size):
        tail = w.torque[j]
        w.torque[j] = (w.impulse[j] + w.delay[j] * (w.last_torque[j] - tail)) / period
        w.impulse[j], w.last_torque[j] = 0.0, tail


@kernel
def predict(w, features, track, k, period):
    """Move a free rotor on by a period under its mean torque; friction at the motion smoothed for
    all sets."""
    for j in range(w.psi_alpha.size):
        w.omega[j] = track[k].middle_omega
        w.turn[j] = track[k].middle_turn - (w.offset[j] + w.deviation[j]) / w.pairs[j]
        w.turn[j] += w.latency[j] * w.omega[j]
    step_shaft(w, features, period, track[k].load, 0.0)


@kernel
def deviate_at_start(w, track):
    """Write what the encoder is off by at the first sample."""
    deviate(w, track[0].turn)
    deviate(w, track[0].turn)
    for j in range(w.psi_alpha.size):
        w.deviation[j] = w.next_deviation[j]


@kernel
def turn(w, timing, features, track, rows, eccentric, torque, moved):
    """Move free rotors alone through some periods, all under one mean torque (n,) in N m of each
    period; innovations as `run` writes them."""
    n, held, start, stop = len(track), rows.held, rows.start, rows.stop
    wobbling = features & add.WOBBLE != 0 and eccentric
    if start == 0 and wobbling:
        deviate_at_start(w, track)
    for k in range(start, stop):
        if k % held == 0:
            correct(w, track, k, moved, (k - start) // held, 0)
        if wobbling and k < n - 1:
            deviate(w, track[k + 1].turn)
        for j in range(w.psi_alpha.size):
            w.torque[j] = torque[k]
        predict(w, features, track, k, timing.period)
        if wobbling:
            for j in range(w.psi_alpha.size):
                w.deviation[j] = w.next_deviation[j]


@kernel
def follow(w, timing, given, track, k, held):
    """Hold currents that are unstable by the row's readings, after period k."""
    if k % held == 0:
        held_by_readings(w, given, track[k], held * timing.period, False)
    if timing.first < 0.0 and (k + 1) % held == 0 and k < len(track) - 1:
        held_by_readings(w, given, track[k + 1], held * timing.period, True)


@kernel
def run(
    w,
    flux_map,
    timing,
    features,
    room,
    track,
    rows,
    fixed,
    span,
    out,
    moved,
    torque,
    first,
):
    """Replay some PWM periods of one recording; return what `span` is to be for those after them.

    Readings (A) of row k of the log go to out[k - first row, 0:3, first:first + lanes], a free
    rotor's innovations to moved[k - first row, first:] and the first lane's mean torque (N m) to
    torque[period], where features say MOTION.  w starts with fluxes and currents of the first
    sample, room fresh, span at 0; all three are handed on from stretch to stretch.  Lanes that
    sample before the pattern's start write one row ahead: `out` has a row for period `stop`, unless
    there is none.  track: (n,) of
    TRACK; rows: `Rows`; fixed: `Fixed`.
    """
    n, lanes, period = len(track), w.psi_alpha.size, timing.period
    held, begins, start, stop = rows.held, rows.begins, rows.start, rows.stop
    looks, seen = np.empty(0), np.empty((0, 2))
    wobbling = features & add.WOBBLE != 0 and fixed.eccentric
    if start == 0:
        if wobbling:
            deviate_at_start(w, track)
        hold_start(w, features)
        read(w)
        write(w, out, 0, first)
    for k in range(start, stop):
        own, shown = (k - start) // held, k % held == 0
        if features & add.MOTION and shown:
            correct(w, track, k, moved, own, first)
        if wobbling and k < n - 1:
            deviate(w, track[k + 1].turn)
        row = track[k]
        for m in range(3):
            room.before[m] = room.duty[m]
        room.duty[0], room.duty[1], room.duty[2] = row.d_a, row.d_b, row.d_c
        room.half = int(row.half)
        write_edges(room, period)
        for j in range(lanes):
            w.supply[j] = row.link * fixed.supply[j]
            w.link[j] = w.supply[j] - w.link_sag[j]
        trajectory = RotorTrajectory(
            row.cos, row.sin, 0.5 * period, 0.0, row.rate, row.bend, row.jerk, row.speed, STILL
        )
        span = travel(
            w,
            flux_map,
            timing,
            features,
            room,
            trajectory,
            (begins + k) * period,
            span,
            looks,
            seen,
        )
        read(w)
        if shown and timing.first >= 0.0:
            write(w, out, own, first)
        elif shown:
            write_some(w, out, own, first, False)
        if timing.first < 0.0 and (k + 1) % held == 0 and k < n - 1:
            write_some(w, out, own + 1, first, True)
        if fixed.given.acts:
            follow(w, timing, fixed.given, track, k, held)
        if features & add.MOTION:
            pull(w, period)
            torque[k] = w.torque[0]
            predict(w, features, track, k, period)
        if wobbling:
            for j in range(lanes):
                w.deviation[j] = w.next_deviation[j]
    return span
