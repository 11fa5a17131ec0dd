"""How small changes of the flux go on in the plant, period by period, whatever effects act in it.

Two lanes beside the base set have a flux that is displaced along alpha and beta; after every period
they are set back to that distance.  So the plant itself says how a change decays (or grows, where a
leg's voltage rises with its current) and how readings show it.  Only the flux is displaced: what
lags behind the current follows from there on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from model.compiled import kernel
from sandbox.plant import additions as add
from sandbox.plant.electrical import finished, seen
from sandbox.plant.sets import complete
from sandbox.replay.kernel import Rows, deviate_at_start, run
from sandbox.replay.replay import Prepared, block_of
from sandbox.replay.walking import Running

SHARE = 1e-6  # of the flux of rated current: the displacement


class Transitions(NamedTuple):
    """Of n samples: how a change of the flux (Wb, stationary frame) stands one sample later, a (n,
    2, 2), and how the three readings show it, c (n, 3, 2) in A/Wb; flux due to currents (n, 2) in
    Wb, rotor's frame, whose true angle is theta (n,)."""

    a: Array
    c: Array
    flux: Array
    theta: Array


def displaced(
    prepared: Prepared, values: Mapping[str, float], recording: int, *, settled: bool = True
) -> Running:
    """Return a set and its two displaced twins before the first sample of a recording; settled:
    they went through the samples before, else stand at the first of these."""
    drive = prepared.campaign.drive
    own = complete(drive.motor, drive.converter, dict(values))
    r, block = prepared.recordings[recording], block_of(prepared, [0, 0, 0], [own])
    running = Running.begun(drive, prepared.steps, r, block, settled=settled)
    if not settled and r.settling is not None:
        running.done = -r.settling.samples
    return running


def transitions(running: Running, stop: int, size: float) -> Transitions:
    """Return the transitions of the samples from where a set stands to `stop`, and move it on to
    there; size: Wb."""
    r = running.r
    n, held = stop - running.done, r.held
    before = len(running.track) // held - r.samples
    angle = r.motion.angle
    if r.settling is not None:
        angle = np.concatenate([r.settling.motion.angle, angle])
    theta = angle[before + running.done : before + stop].copy()
    out = Transitions(np.empty((n, 2, 2)), np.empty((n, 3, 2)), np.empty((n, 2)), theta)
    running.span = one_by_one(
        running.batch,
        running.flux_map,
        running.timing,
        running.features,
        running.room,
        running.track,
        (held, held * (r.settling or r).first, before + running.done, before + stop),
        running.fixed,
        running.span,
        size,
        out,
    )
    running.done = stop
    return out


@kernel
def one_by_one(w, flux_map, timing, features, room, track, samples, fixed, span, size, out):
    """Write the transitions of samples (periods each, periods before the track, first, last) in the
    first three lanes; return what `span` is to be afterwards.  out: angles are as they are read."""
    held, begins, start, stop = samples
    lanes, wobbling = w.psi_alpha.size, features & add.WOBBLE != 0 and fixed.eccentric
    if start == 0 and wobbling:
        deviate_at_start(w, track)
    read, moved, torque = np.zeros((2, 3, lanes)), np.zeros((1, lanes)), np.empty(len(track))
    for k in range(start, stop):
        base_a, base_b = finished(w, 0, span)
        # what the encoder reads too much there
        angle = out.theta[k - start] - w.offset[0] - w.deviation[0]
        angle += w.latency[0] * track[held * k].speed
        out.theta[k - start] = angle
        out.flux[k - start] = seen(w, 0, math.cos(angle), math.sin(angle), base_a, base_b)
        for j in range(2):
            x, y = finished(w, 1 + j, span)
            w.psi_alpha[1 + j] += base_a + (size if j == 0 else 0.0) - x
            w.psi_beta[1 + j] += base_b + (size if j == 1 else 0.0) - y
        rows = Rows(held, begins, held * k, held * (k + 1))
        span = run(
            w,
            flux_map,
            timing,
            features,
            room,
            track,
            rows,
            fixed,
            span,
            read,
            moved,
            torque,
            0,
        )
        base_a, base_b = finished(w, 0, span)
        for j in range(2):
            x, y = finished(w, 1 + j, span)
            out.a[k - start, 0, j], out.a[k - start, 1, j] = (
                (x - base_a) / size,
                (y - base_b) / size,
            )
            for m in range(3):
                out.c[k - start, m, j] = (read[0, m, 1 + j] - read[0, m, 0]) / size
        read[0] = read[1]
    return span
