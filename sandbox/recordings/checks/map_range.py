"""Rows of recordings whose currents lie within the motor's flux map.

Beyond its outermost points a map goes on with the inductances that it has there.  No machine does:
it saturates further, and by how much nobody has measured.  A short step to twice the map's currents
leaves an error of the flux that lasts for L/R, many times the noise, and effects that bend the map
at large currents would be taken for it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.mapped import MappedMotor, held_by_data, motor_points
from model.parameters import Drive, Motor
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.findings import Finding

# of the distance between a map's points: the slope of the outermost cell holds as far on the other
# side of its edge as its middle lies on this one
BEYOND = 0.5


def beyond_map(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return a finding where a recording's currents leave the motor's flux map."""
    inside, _ = within(drive.motor, r)
    if inside.all():
        return []
    assert isinstance(drive.motor, MappedMotor)
    point = motor_points(drive.motor)
    d, q = _dq(r)
    far = int(np.argmax(np.where(inside, 0.0, np.hypot(d, q))))
    text = (
        f"{r.file}: currents reach i_d = {d[far]:.4g} A, i_q = {q[far]:.4g} A, beyond the flux "
        f"map's points (i_d {np.min(point.i_d):.4g} to {np.max(point.i_d):.4g} A, i_q up to "
        f"{np.max(np.abs(point.i_q)):.4g} A); a diagnosis leaves out the {np.sum(~inside)} of "
        f"{len(inside)} rows that lie there; give a map as far as the currents go to have them "
        "count"
    )
    return [Finding(r.file, "i_a", int(np.argmin(inside)), text)]


def within(motor: Motor, r: CampaignRecording) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which rows' currents lie within the motor's flux map or near its edge, and which
    between its points; all where the motor was read from no map."""
    if not isinstance(motor, MappedMotor) or motor.origin is None:
        every = np.ones(len(r.t), dtype=bool)
        return every, every
    d, q = _dq(r)
    inside = held_by_data(motor, d, q, beyond=BEYOND * point_spacing(motor))
    inside[1:-1] |= inside[:-2] & inside[2:]  # one reading alone is a spike, no current
    return inside, held_by_data(motor, d, q)


def stretches_within(motor: Motor, r: CampaignRecording, least: int) -> list[tuple[int, int]]:
    """Return first row and end of a recording's stretches within the motor's flux map, of at least
    so many rows each; the whole of it where it stays there.

    A stretch begins at an even row between the map's points: there a current tells the flux.
    """
    inside, between = within(motor, r)
    if inside.all():
        return [(0, len(inside))]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
    found = (_begun(between, first, last) for first, last in edges.reshape(-1, 2).tolist())
    return [(first, last) for first, last in found if last - first >= max(2, least)]


def point_spacing(motor: MappedMotor) -> float:
    """Return how far apart the points of a map are (A): the side of the square that each of them
    has of the rectangle around them."""
    point = motor_points(motor)
    return math.sqrt(float(np.ptp(point.i_d) * np.ptp(point.i_q)) / len(point.i_d))


def _begun(between: NDArray[np.bool_], first: int, last: int) -> tuple[int, int]:
    """Return a stretch from its first even row that lies between the map's points."""
    even = first + first % 2
    own = np.flatnonzero(between[even:last:2])
    return (even + 2 * int(own[0]), last) if len(own) else (last, last)


def _dq(r: CampaignRecording) -> tuple[Array, Array]:
    """Return a recording's currents d, q (A) at the angle that it reads."""
    alpha, beta = r.current
    turned = (alpha + 1j * beta) * np.exp(-1j * r.theta)
    return turned.real, turned.imag
