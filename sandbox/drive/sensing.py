"""What the sensors of a closed loop read of the exact plant: currents at the sample and inside the
period, the link, the encoder; and at which instants.

A current filter, a late sampler, gains, offsets, noise and counts act on readings inside the period
as on the samples;
jitter does not: those instants are fixed.
"""

from __future__ import annotations

import math

import numpy as np

from estimators.contract import COMMANDED_ALPHA, COMMANDED_BETA, READ_ALPHA, READ_BETA
from model.compiled import kernel
from model.frames import stationary
from sandbox.drive.inside import commanded
from sandbox.plant import additions as add
from sandbox.plant.sampling import misread, read

SOONEST, LATEST = -0.45, 0.45  # of the period: instants of sampling, jitter included
# places among the instants looked at: the sample for t_k and, where it is before its pattern, the
# next
SAMPLES = 2


@kernel
def read_current(value, rig, rng):
    """Return a phase current as its sensor reads it: noise, then quantisation."""
    value += rig.noise * rng.standard_normal()
    return (
        rig.resolution * math.floor(value / rig.resolution + 0.5) if rig.resolution > 0.0 else value
    )


@kernel
def read_link(rig, rng):
    """Return the link voltage as the controller reads it, over its nominal value."""
    return 1.0 + rig.link_noise / rig.link * rng.standard_normal() if rig.link_noise > 0.0 else 1.0


@kernel
def read_phases(w, rig, rng):
    """Return the three phase currents (A) as their sensors read the current held."""
    read(w)
    return (
        read_current(w.read_a[0], rig, rng),
        read_current(w.read_b[0], rig, rng),
        read_current(w.read_c[0], rig, rng),
    )


@kernel
def encoder(w, features, theta, omega, step):
    """Return angle (rad) as the encoder reads it, and its slope (rad/s, electrical) without
    counts."""
    off, slope = 0.0, 1.0
    if features & add.WOBBLE:
        pairs, turn, small = w.pairs[0], theta / w.pairs[0], 1e-6
        off = misread(w, 0, turn)
        slope = 1.0 + (misread(w, 0, turn + small) - off) / (small * pairs)
    angle = theta + w.offset[0] + off - omega * w.latency[0]
    return (step * math.floor(angle / step + 0.5) if step > 0.0 else angle), omega * slope


@kernel
def instant(w, rig, rng):
    """Return when the next sample is taken, s after its pattern's start (before it where
    negative)."""
    if w.jitter[0] == 0.0:
        return w.sample[0]
    s = w.sample[0] + w.delay[0] + w.jitter[0] * rng.standard_normal()
    return min(max(s, SOONEST * rig.sampling_period), LATEST * rig.sampling_period) - w.delay[0]


@kernel
def inside_at(w, period, j, n):
    """Return when the j-th of n readings inside the period is taken, s after its pattern's start
    (before: negative).

    In the middle of its n-th part, or as much later as samples are, but not beyond the period from
    t_k to t_k+1.
    """
    late = w.sample[0] + w.delay[0]
    return min(max((j + 0.5) * period / n + late, 0.0), period) - w.delay[0]


@kernel
def looked_at(w, period, inside):
    """Return instants (s after the pattern's start) at which the current is held in a period, and
    room for it (A).

    The first SAMPLES are set period by period, the others are those of readings inside: where one
    comes before its pattern starts, the next period's.
    """
    n = 0
    if inside is not None:
        n = inside.readings.shape[0]
    looks, seen = np.full(SAMPLES + n, -1.0), np.zeros((SAMPLES + n, 2))
    for j in range(n):
        at = inside_at(w, period, j, n)
        looks[SAMPLES + j] = at if at >= 0.0 else period + at
    return looks, seen


@kernel
def gather(w, room, rig, inside, u_dc, seen, rng):
    """Write the readings of the period just run: currents as the sensors read those seen, V s as
    commanded.

    u_dc: the link as read, by which duties were formed.  What was seen for the next period is kept
    until then.
    """
    readings, ahead, period = inside.readings, inside.ahead, rig.sampling_period
    n = readings.shape[0]
    # within the period voltages act: all phases are read at once here
    w.slope_alpha[0] = w.slope_beta[0] = w.slopes_alpha[0] = w.slopes_beta[0] = 0.0
    for j in range(n):
        a, b = seen[SAMPLES + j, 0], seen[SAMPLES + j, 1]
        if inside_at(w, period, j, n) < 0.0:
            next_a, next_b = a, b
            a, b = ahead[j, 0], ahead[j, 1]
            ahead[j, 0], ahead[j, 1] = next_a, next_b
        w.held_alpha[0], w.held_beta[0] = a, b
        i_a, i_b, i_c = read_phases(w, rig, rng)
        readings[j, READ_ALPHA], readings[j, READ_BETA] = stationary(i_a, i_b, i_c)
        readings[j, COMMANDED_ALPHA], readings[j, COMMANDED_BETA] = commanded(
            (j + 0.5) * period / n, period, room.duty, room.shift, u_dc
        )
