"""Modes of what a flux map may be off by: the few directions of its error that recordings can see.

A map is off between its points, and it is another machine's, or that of another day.  Prior: the
sum of two energies.

- At points and between them (`between`): bumps of coenergy over the currents, as far apart as the
  map's points and half as far, independent; together the flux at a current is off by what the map's
  fit misses, thereabouts, at points that are left out of it (`Missed`).  Where a bridge saturates
  that is several times what it is elsewhere.
- As a whole (`smooth`): saturation that comes sooner or later, by the share that the campaign
  states for the inductances.

Of their hundreds of directions recordings tell those whose answer in the readings stands above the
noise; the best told ones are modes.  What all others are likely to leave in the readings, and what
is finer than bumps (`FINER`), they leave whatever the causes are (`MapError.beyond`): so much more
a simulator with this map misses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from model.array_types import Array
from model.effects import library
from model.effects.library import true_motor
from model.mapped import MappedMotor, map_left_out, motor_points
from model.spline import DEGREE, SplineEnergy, currents
from model.spline_correction import Basis, MapError, refined
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.response import added_current, fluxes
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import LEGS
from sandbox.replay.map_error import rotor_currents, with_map_error
from sandbox.replay.memory import SHARE
from sandbox.replay.replay import replay

# of the prior's precision: information in the recordings below which a direction is left away
MIN_INFORMATION = 1.0
MAX_DIRECTIONS = 160  # directions, the best told ones
SPACINGS = (1.0, 0.5)  # of bumps, in that of the map's points
# Of the squared error of a map's flux that no bumps can take: three published maps (THOR, a
# PMSynRM, 28 kW of the second bench) beside what is made of some of their points, by least squares
# over bumps of both spacings, 0.7, 0.4 and 0.7 %
FINER = 0.006
SAMPLES = 40_000  # that directions are looked for in
SETTLED = 5.0  # time constants L/R of each part in a row of these: of its start 0.7 % is left


class Missed(NamedTuple):
    """What a map's fit misses at points that are left out of it: their currents (A), how far apart
    they are (A), squared flux errors (n,) in Wb^2."""

    i_d: Array
    i_q: Array
    apart: float
    square: Array

    def near(self, i_d: Array, i_q: Array) -> Array:
        """Return the flux error (Wb rms of the vector) to be expected at currents (k,): the mean
        square of points about as far away as their neighbours are, and of one more point that
        misses what all of them do: few points alone would say little."""
        far = (i_d[:, None] - self.i_d) ** 2 + (np.abs(i_q)[:, None] - np.abs(self.i_q)) ** 2
        weight = np.exp(-0.5 * far / self.apart**2)
        whole = float(np.mean(self.square))
        return np.sqrt((weight @ self.square + whole) / (weight.sum(axis=1) + 1.0))


def missed(campaign: Campaign) -> Missed | None:
    """Return what the fit of a motor's map misses; None without a map, or where no fit to a part
    of its points is found."""
    motor = campaign.drive.motor
    if not isinstance(motor, MappedMotor) or motor.origin is None:
        return None
    points, square = map_left_out(motor)
    found = np.isfinite(square)
    if not found.any():
        return None
    return Missed(points.i_d[found], points.i_q[found], spacing(motor), square[found])


def with_modes(point: ParameterPoint, off: Missed | None) -> ParameterPoint:
    """Return the point with modes of its motor's flux map, none of them there yet; as it is where
    the motor has no map; off: what the map's fit misses."""
    prepared = point.prepared
    motor = prepared.campaign.drive.motor
    stated = motor.energy
    if not isinstance(motor, MappedMotor) or not isinstance(stated, SplineEnergy):
        return point
    basis = Basis(refined(stated, *parts_of(motor, stated)))
    answers, chosen = _answers(point, basis)
    if not len(chosen):
        return point
    parts, between_bumps = [smooth(prepared.campaign, basis)[chosen]], 0.0
    if off is not None:
        parts.append(between(motor, basis, off.near)[chosen])
        between_bumps = FINER * float(np.sum(parts[1] * (answers @ parts[1])))
    spread = factor(np.hstack(parts))
    along = spread.T @ basis.gradients(np.zeros((1, 2)), chosen)[0, :, 0]
    answers = _without(spread.T @ answers @ spread, along)
    value, vector = np.linalg.eigh(answers / prepared.noise_std**2)
    modes = np.flatnonzero(value > MIN_INFORMATION)[::-1][:MAX_DIRECTIONS]
    if not len(modes):
        return point
    sizes = np.zeros((len(modes), basis.size))
    sizes[:, chosen] = (spread @ vector[:, modes]).T
    readings = len(LEGS) * prepared.samples
    beyond = float(np.delete(value, modes).clip(0.0).sum())
    beyond = (beyond + between_bumps / prepared.noise_std**2) / readings
    error = MapError(basis.of, basis.cells(sizes), np.zeros(len(modes)), beyond)
    return replace(point, prepared=with_map_error(prepared, error))


def factor(spread: Array) -> Array:
    """Return as few columns (c, m) of the same covariance as many columns (c, k) have."""
    if spread.shape[1] <= spread.shape[0]:
        return spread
    value, vector = np.linalg.eigh(spread @ spread.T)
    return np.asarray(vector * np.sqrt(value.clip(0.0)))


def parts_of(motor: MappedMotor, stated: SplineEnergy) -> tuple[int, int]:
    """Return into how many parts a map's cells are cut along d and q, for no fewer cells than
    points (`spacing`)."""
    if motor.origin is None:
        return 1, 1
    point = motor_points(motor)
    sides = np.array([np.ptp(point.i_d), 2.0 * np.max(np.abs(point.i_q))]) / spacing(motor)
    d, q = (math.ceil(x / n) for x, n in zip(sides, stated.cells.shape[:2], strict=True))
    return d, q


def spacing(motor: MappedMotor) -> float:
    """Return how far apart a map's points are, A: the side of the square that each of them has; of
    more points than the fit has cells the side that a cell has."""
    point, cells = motor_points(motor), motor.spline.cells
    count = min(len(point.i_d), cells.shape[0] * cells.shape[1])
    return math.sqrt(float(np.ptp(point.i_d) * np.ptp(point.i_q)) / count)


def between(motor: MappedMotor, basis: Basis, off: Callable[[Array, Array], Array]) -> Array:
    """Return energies (size, k) in J of bumps as far apart as the map's points, and half as far;
    with sizes of 1 each the flux at currents i_d, i_q (n,) is off by off(i_d, i_q) in Wb rms of the
    vector, as much along d as along q, and as much by wide bumps (points that are off) as by narrow
    ones (what lies between them).

    An error w of the coenergy at a current is one of -w of the energy at its flux (Legendre).
    """
    point, flux = motor_points(motor), basis.grid()
    read = np.array([currents(basis.of, x, y) for x, y in flux])
    bump = BSpline.basis_element(np.arange(DEGREE + 2) - 0.5 * (DEGREE + 1), extrapolate=False)
    x = np.linspace(-0.5, 0.5, 1001)[1:-1] * (DEGREE + 1)
    square, slope = (float(np.trapezoid(bump(x, nu=k) ** 2, x)) for k in (0, 1))
    out = []
    for apart in spacing(motor) * np.array(SPACINGS):
        first, last = (f(point.i_d) / apart for f in (np.min, np.max))
        d = np.arange(math.floor(first), math.ceil(last) + 1)
        q = np.arange(math.ceil(np.max(np.abs(point.i_q)) / apart) + 1)
        along_d, above, below = (
            np.nan_to_num(bump(read[:, k : k + 1] / apart - at))
            for k, at in ((0, d), (1, q), (1, -q))
        )
        along_q = np.where(q > 0, above + below, above)  # even in q, the one at its zero once
        energies = (along_d[:, :, None] * along_q[:, None, :]).reshape(len(flux), -1)
        size = apart / math.sqrt(2.0 * square * slope * len(SPACINGS))
        middle = apart * np.stack(np.meshgrid(d, q, indexing="ij")).reshape(2, -1)
        out.append(-size * off(*middle) * basis.sizes(energies))
    return np.hstack(out)


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
    flux = basis.grid()
    read = np.array([currents(e, x, y) for x, y in flux])
    shares = [campaign.deviation_of(stated[f"inductance_{axis}"], 1.0) for axis in "dq"]
    inductances = np.array([motor.inductance_d, motor.inductance_q])
    return basis.sizes(np.array(shares) * flux * (read - flux / inductances))


def _without(answers: Array, along: Array) -> Array:
    """Return squares of answers (c, c) with nothing along a direction (c,): of current at no flux,
    as a map begins where its magnet's flux is, which has a coordinate of its own."""
    size = float(along @ along)
    if size == 0.0:
        return answers
    left = np.eye(len(along)) - np.outer(along, along) / size
    return np.asarray(left @ answers @ left)


def _answers(point: ParameterPoint, basis: Basis) -> tuple[Array, NDArray[np.int64]]:
    """Return of energies that recordings meet the squares of how readings answer (c, c), and their
    places (c,)."""
    prepared, drive = point.turned(), point.prepared.campaign.drive
    motor = true_motor(drive.motor, dict(point.values), keep_map=True)
    predicted = replay(prepared, [point.values])
    paths = []
    for r, read in zip(prepared.recordings, predicted.currents, strict=True):
        dq = rotor_currents(read[:, :, 0], r.motion.angle)
        paths.append((r, dq, fluxes(motor.energy, dq)))
    chosen = basis.there(np.concatenate([psi for _, _, psi in paths]))
    # of a sample: six arrays of two components
    room = SHARE * prepared.spare / (8.0 * 12.0 * max(1, len(chosen)))
    share = min(1.0, SAMPLES / prepared.samples, room / prepared.samples)
    slowest = max(motor.inductance_d, motor.inductance_q) / motor.resistance
    lasting = SETTLED * slowest / drive.converter.sampling_period
    total = np.zeros((len(chosen), len(chosen)))
    for r, dq, psi in paths:
        for own in spread(r.samples, share, lasting):
            x = basis.gradients(psi[own], chosen)
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
    return total, chosen


def spread(samples: int, share: float, least: float) -> list[slice]:
    """Return parts of a recording that hold a share of its samples, alike in length (at least so
    many, where it has them) and evenly over it: what it visits briefly is in some part."""
    count = max(1, int(share * samples / max(1.0, least)))
    length = max(1, round(share * samples / count))
    starts = [int((k + 0.5) * samples / count - 0.5 * length) for k in range(count)]
    return [slice(k, k + length) for k in starts]
