"""Modes of what a flux map may be off by: the few directions of its error that recordings can see.

A map is off between its points, and it is another machine's, or that of another day.  Prior: the
sum of two energies.

- Between points: independent B-splines on the map's own cells, each cut in two along d, all of one
  size; together they move the current, at the recordings' operating points, as the map's own flux
  is off by: the flux error that its fit makes at points left out of it, over the inductances at
  zero current.
- As a whole (`smooth`): saturation that comes sooner or later, by the share that the campaign
  states for the inductances.

Of their hundreds of directions recordings tell those whose answer in the readings stands above the
noise; the best told ones are modes.  What all others are likely to leave in the readings, they
leave whatever the causes are (`MapError.beyond`): so much more a simulator with this map misses.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from model.effects.library import true_motor
from model.mapped import MappedMotor, map_quality
from model.spline import SplineEnergy, currents
from model.spline_correction import Basis, MapError, refined
from model.spline_energy import CHOICES
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.response import added_current, fluxes
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import LEGS
from sandbox.replay.map_error import rotor_currents, with_map_error
from sandbox.replay.memory import SHARE
from sandbox.replay.replay import replay

Array = NDArray[np.float64]
FINER = (2, 1)  # parts of the map's cells along d and q
# cells along d that a fit may have: one that has more was cut before
FINEST = max(cells[0] for cells, _ in CHOICES)
# of the prior's precision: information in the recordings below which a direction is left away
MIN_INFORMATION = 1.0
MAX_DIRECTIONS = 64  # directions, the best told ones
SAMPLES = 40_000  # that directions are looked for in
SETTLED = 5.0  # time constants L/R of each part in a row of these: of its start 0.7 % is left


def map_error(campaign: Campaign) -> float:
    """Return what the current at a flux of a motor's map is off by, A rms of both components; 0
    without a map."""
    motor = campaign.drive.motor
    if not isinstance(motor, MappedMotor) or motor.origin is None:
        return 0.0
    missed = map_quality(motor.origin.table, motor.origin.path.parent).held_out
    if missed is None:
        return 0.0
    each = math.sqrt(0.5) * missed  # of the rms of the vector, along d and along q
    return each * math.hypot(1.0 / motor.inductance_d, 1.0 / motor.inductance_q)


def with_modes(point: Point, size: float) -> Point:
    """Return the point with modes of its motor's flux map, none of them there yet; as it is where
    the motor has no map.

    size: rms of the current that the map is off by, A.
    """
    prepared = point.prepared
    stated = prepared.campaign.drive.motor.energy
    if not isinstance(stated, SplineEnergy):
        return point
    basis = Basis(refined(stated, *(FINER if stated.cells.shape[0] <= FINEST else (1, 1))))
    path, answers, chosen = _answers(point, basis)
    if not len(chosen):
        return point
    spread = np.hstack(
        [size / np.sqrt(path) * np.eye(len(chosen)), smooth(prepared.campaign, basis)[chosen]]
    )
    along = spread.T @ basis.gradients(np.zeros((1, 2)), chosen)[0, :, 0]
    answers = _without(spread.T @ answers @ spread, along)
    value, vector = np.linalg.eigh(answers / prepared.noise_std**2)
    told = np.flatnonzero(value > MIN_INFORMATION)[::-1][:MAX_DIRECTIONS]
    if not len(told):
        return point
    sizes = np.zeros((len(told), basis.size))
    sizes[:, chosen] = (spread @ vector[:, told]).T
    readings = len(LEGS) * prepared.samples
    beyond = float(np.delete(value, told).clip(0.0).sum()) / readings
    error = MapError(basis.of, basis.cells(sizes), np.zeros(len(told)), beyond)
    return replace(point, prepared=with_map_error(prepared, error))


def smooth(campaign: Campaign, basis: Basis) -> Array:
    """Return what a machine of the map's kind differs from the map by, each column (size, 2) in J
    as large as is likely: along d, along q.

    A machine with a factor c on each winding's flux at currents 1/c times as large, its magnet
    left, has the energy H(psi/c) for H(psi): to first order in c - 1 what is added is
    -(c - 1) psi_d i_d, and alike along q.  The part of it that is there without saturation,
    psi_d^2/L_d, is the inductance's own and left away.
    """
    motor, e = campaign.drive.motor, basis.of
    stated = {p.ordinary.stated: p.ordinary for p in library.parameters().values() if p.ordinary}
    d, q = (basis.places(axis) for axis in (0, 1))
    flux = np.stack([x.ravel() for x in np.meshgrid(d, q[q >= 0.0], indexing="ij")], axis=1)
    read = np.array([currents(e, x, y) for x, y in flux])
    shares = [campaign.deviation_of(stated[f"inductance_{axis}"], 1.0) for axis in "dq"]
    inductances = np.array([motor.inductance_d, motor.inductance_q])
    return basis.sizes(flux, np.array(shares) * flux * (read - flux / inductances))


def _without(answers: Array, along: Array) -> Array:
    """Return squares of answers (c, c) with nothing along a direction (c,): of current at no flux,
    as a map begins where its magnet's flux is, which has a coordinate of its own."""
    size = float(along @ along)
    if size == 0.0:
        return answers
    left = np.eye(len(along)) - np.outer(along, along) / size
    return np.asarray(left @ answers @ left)


def _answers(point: Point, basis: Basis) -> tuple[float, Array, NDArray[np.int64]]:
    """Return of energies that recordings meet the mean square of all their currents (A^2), the
    squares of how readings answer (c, c), and their places (c,)."""
    prepared, drive = point.turned(), point.prepared.campaign.drive
    motor = true_motor(drive.motor, dict(point.values), keep_map=True)
    told = replay(prepared, [point.values])
    paths = []
    for r, read in zip(prepared.recordings, told.currents, strict=True):
        dq = rotor_currents(read[:, :, 0], r.motion.angle)
        paths.append((r, dq, fluxes(motor.energy, dq)))
    chosen = basis.there(np.concatenate([psi for _, _, psi in paths]))
    # of a sample: six arrays of two components
    room = SHARE * prepared.spare / (8.0 * 12.0 * max(1, len(chosen)))
    share = min(1.0, SAMPLES / prepared.samples, room / prepared.samples)
    slowest = max(motor.inductance_d, motor.inductance_q) / motor.resistance
    lasting = SETTLED * slowest / drive.converter.sampling_period
    squares, count, total = 0.0, 0, np.zeros((len(chosen), len(chosen)))
    for r, dq, psi in paths:
        for own in spread(r.samples, share, lasting):
            x = basis.gradients(psi[own], chosen)
            squares, count = squares + float(np.sum(x**2)), count + len(x)
            answer = x + added_current(
                motor.energy,
                motor.resistance,
                drive.converter.sampling_period,
                dq[own],
                r.motion.angle[own],
                -motor.resistance * x,
            )
            rows = np.ascontiguousarray(answer.transpose(0, 2, 1)).reshape(-1, len(chosen))
            total += 1.5 / share * rows.T @ rows  # three phases hold 3/2 of squares of d and q
    return squares / count, total, chosen


def spread(samples: int, share: float, least: float) -> list[slice]:
    """Return parts of a recording that hold a share of its samples, alike in length (at least so
    many, where it has them) and evenly over it: what it visits briefly is in some part."""
    count = max(1, int(share * samples / max(1.0, least)))
    length = max(1, round(share * samples / count))
    starts = [int((k + 0.5) * samples / count - 0.5 * length) for k in range(count)]
    return [slice(k, k + length) for k in starts]
