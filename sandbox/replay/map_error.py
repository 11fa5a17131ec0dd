"""What a motor's flux map may be off by, and how readings answer to it.

An energy dH that is added to the map's own changes the current at the same flux by its gradient;
what that current drops moves the flux.  To first order, along the path that the map itself
predicts,

    di = grad dH(psi) + Gamma dpsi,   d(dpsi)/dt = -D di,

D what a change of the current drops: windings, legs, all that acts.  D is the plant's own
(`transitions`), so a column of the equations costs a few operations a sample beside three lanes of
the plant for all of them.  A free rotor's motion is taken as it is read: that a map's error also
turns it has no column.
Checked against replays with the energy added (tests/sandbox/replay).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from model.array_types import Array
from model.compiled import inlined, kernel
from model.energy import flux_newton, hessian
from model.mapped import MappedMotor
from model.spline import DEGREE
from model.spline_correction import MapError
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import Prepared
from sandbox.replay.stretches import Stretch
from sandbox.replay.transitions import SHARE, displaced, transitions
from sandbox.replay.walking import Running


def same_map(prepared: Prepared, other: Prepared) -> Prepared:
    """Return a campaign with the map as another one has it: parts and whole of one campaign."""
    return prepared if other.map_error is None else with_map_error(prepared, other.map_error)


def with_map_error(prepared: Prepared, error: MapError) -> Prepared:
    """Return a campaign whose motor has a map's energy with an error added."""
    drive = prepared.campaign.drive
    assert isinstance(drive.motor, MappedMotor)
    motor = replace(drive.motor, spline=error.energy())
    return replace(
        prepared,
        campaign=replace(prepared.campaign, drive=replace(drive, motor=motor)),
        map_error=error,
    )


def rotor_currents(read: Array, theta: Array) -> Array:
    """Return the currents d, q (n, 2) behind three phases' (n, 3)."""
    a, b = ((2.0 / 3.0) * read @ LEGS).T
    c, s = np.cos(theta), np.sin(theta)
    return np.column_stack([c * a + s * b, c * b - s * a])


@dataclass
class Answers:
    """How readings of a set answer to each mode of a map's error, stretch by stretch in time."""

    prepared: Prepared
    values: Mapping[str, float]
    states: dict[int, tuple[Running, Array]] = field(default_factory=dict)

    def over(self, s: Stretch) -> Array:
        """Return slopes (m, 3, k) in A of a stretch, the one after that asked for before."""
        error, r = self.prepared.map_error, self.prepared.recordings[s.recording]
        assert error is not None
        own, begun = self.states.pop(s.recording, None), True
        if own is None:
            state = np.zeros((2, len(error.x) + 4))
            own = displaced(self.prepared, self.values, s.recording, settled=False), state
            begun = r.settling is not None
            if r.settling is not None:
                self._on(own, 0, (False, r.settling.loaded))
        out = self._on(own, s.last, (begun, r.loaded))
        if s.last < s.n:
            self.states[s.recording] = own
        return out

    def _on(self, own: tuple[Running, Array], stop: int, how: tuple[bool, bool]) -> Array:
        """Return slopes (m, 3, k) in A up to a sample, how: as `answered` has it."""
        error, motor = self.prepared.map_error, self.prepared.campaign.drive.motor
        assert error is not None
        moves = transitions(own[0], stop, SHARE * motor.inductance_q * motor.rated_current)
        return answered(motor.energy, error.modes, error.cells, moves, how, own[1])


@kernel
def answered(m, modes, cells, moves, how, state):
    """Return three phases (n, 3, k) in A that energies on cells (n_d, n_q, 5, 5, k) add where
    `moves` go (`Transitions`).

    At a constant current an energy moves the flux by -L grad dH, L the incremental inductances:
    towards that it goes from sample to sample, as the plant lets a change of the flux decay.  The
    flux itself goes straight there: gradients and inverse inductances are means over that way, by
    Simpson's rule, since ripple crosses cells.
    how: whether a stretch goes on from `state`; if not, whether it begins at a constant current (as
    read, or settled), not at a constant flux.  state (2, k + 4): flux that each energy has moved,
    the last sample's flux, angle, and transition; written at the end.
    """
    n, count = len(moves.flux), modes.shape[-1]
    begun, rests = how
    out, mean, own = np.empty((n, 3, count)), np.empty((2, count)), np.zeros((2, count))
    psi = state[:, :count]
    old_d, old_q, old_angle = state[0, count], state[1, count], state[0, count + 1]
    if begun:
        add_gradients(modes, cells, old_d, old_q, 1.0, own)
    for k in range(n):
        d, q = moves.flux[k]
        if k > 0 or begun:
            mean[:] = own / 6.0
            x, y = 0.5 * (d + old_d), 0.5 * (q + old_q)
            add_gradients(modes, cells, x, y, 4.0 / 6.0, mean)
            own[:] = 0.0
            add_gradients(modes, cells, d, q, 1.0, own)
            for i in range(count):
                mean[0, i] += own[0, i] / 6.0
                mean[1, i] += own[1, i] / 6.0
            inductance = inverse_mean(hessian(m, old_d, old_q), hessian(m, x, y), hessian(m, d, q))
            last = moves.a[k - 1] if k > 0 else state[:, count + 2 :]
            turned = along(inductance, 0.5 * (moves.theta[k] + old_angle))
            go_on(psi, last, turned, mean)
        else:
            add_gradients(modes, cells, d, q, 1.0, own)
        here = hessian(m, d, q)
        turned = along(inverse_mean(here, here, here), moves.theta[k])
        if k == 0 and rests and not begun:
            psi[:] = 0.0
            take_off(psi, turned, own)
        read(psi, turned, own, moves.c[k], out[k])
        old_d, old_q, old_angle = d, q, moves.theta[k]
    state[0, count], state[1, count], state[0, count + 1] = old_d, old_q, old_angle
    state[:, count + 2 :] = moves.a[n - 1]
    return out


@inlined
def inverse_mean(one, two, three):
    """Return incremental inductances (dd, dq, qq) in H: the inverse of Simpson's mean of inverse
    ones."""
    dd, dq, qq = (
        (one[0] + 4.0 * two[0] + three[0]) / 6.0,
        (one[1] + 4.0 * two[1] + three[1]) / 6.0,
        (one[2] + 4.0 * two[2] + three[2]) / 6.0,
    )
    over = 1.0 / (dd * qq - dq * dq)
    return over * qq, -over * dq, over * dd


@inlined
def along(inductance, angle):
    """Return a matrix (aa, ab, ba, bb) in H from currents d, q to fluxes in the stationary
    frame."""
    dd, dq, qq = inductance
    c, s = math.cos(angle), math.sin(angle)
    return c * dd - s * dq, c * dq - s * qq, s * dd + c * dq, s * dq + c * qq


@inlined
def go_on(psi, last, turned, mean):
    """Move fluxes (2, k) in Wb to the next sample, as changes of the flux decay: towards those at
    which currents (2, k) in A are made up for."""
    t_aa, t_ab, t_ba, t_bb = last[0, 0], last[0, 1], last[1, 0], last[1, 1]
    aa, ab, ba, bb = turned
    for i in range(psi.shape[1]):
        x, y = aa * mean[0, i] + ab * mean[1, i], ba * mean[0, i] + bb * mean[1, i]
        u, v = psi[0, i] + x, psi[1, i] + y
        psi[0, i], psi[1, i] = t_aa * u + t_ab * v - x, t_ba * u + t_bb * v - y


@inlined
def take_off(psi, turned, current):
    """Take off fluxes (2, k) in Wb those of currents (2, k) in A."""
    aa, ab, ba, bb = turned
    for i in range(psi.shape[1]):
        psi[0, i] -= aa * current[0, i] + ab * current[1, i]
        psi[1, i] -= ba * current[0, i] + bb * current[1, i]


@inlined
def read(psi, turned, current, c, out):
    """Write how three phases (3, k) in A show fluxes and currents (2, k)."""
    aa, ab, ba, bb = turned
    for j in range(3):
        to_a, to_b = c[j, 0], c[j, 1]
        for i in range(psi.shape[1]):
            u = psi[0, i] + aa * current[0, i] + ab * current[1, i]
            v = psi[1, i] + ba * current[0, i] + bb * current[1, i]
            out[j, i] = to_a * u + to_b * v


@kernel
def gradients(m, mode, cells, current):
    """Return the currents (n, 2) in A of an energy on cells (n_d, n_q, 5, 5) at the fluxes that a
    map m has for currents (n, 2)."""
    n = len(current)
    out, own = np.empty((n, 2)), np.empty((2, 1))
    modes = mode.reshape(*mode.shape, 1)
    d = q = 0.0
    for k in range(n):
        d, q, _ = flux_newton(m, current[k, 0], current[k, 1], d, q)
        own[:] = 0.0
        add_gradients(modes, cells, d, q, 1.0, own)
        out[k, 0], out[k, 1] = own[0, 0], own[1, 0]
    return out


@kernel
def add_gradients(modes, cells, d, q, weight, out):
    """Add the currents (2, k) in A of energies on cells (n_d, n_q, 5, 5, k) at one flux (Wb), each
    times a weight; beyond the box they go on with the inductances of its edge.

    The current is linear in a cell's 25 coefficients: their factors are found once for all
    energies.
    """
    low_d, low_q, per_d, per_q = cells
    x, y = (d - low_d) * per_d, (q - low_q) * per_q
    in_x, in_y = min(max(x, 0.0), float(modes.shape[0])), min(max(y, 0.0), float(modes.shape[1]))
    i, j = min(int(in_x), modes.shape[0] - 1), min(int(in_y), modes.shape[1] - 1)
    far_x, far_y, by_d, by_q = x - in_x, y - in_y, weight * per_d, weight * per_q
    x, y = in_x - i, in_y - j
    to_d, to_q = out[0], out[1]
    for a in range(DEGREE + 1):
        p = powers(x, a)
        own = modes[i, j, a]
        d_0, q_0 = factors(p, powers(y, 0), far_x, far_y)
        d_1, q_1 = factors(p, powers(y, 1), far_x, far_y)
        d_2, q_2 = factors(p, powers(y, 2), far_x, far_y)
        d_3, q_3 = factors(p, powers(y, 3), far_x, far_y)
        d_4, q_4 = factors(p, powers(y, 4), far_x, far_y)
        for k in range(modes.shape[-1]):  # five coefficients at once: a loop that writes less
            e, f, g, h, u = own[0, k], own[1, k], own[2, k], own[3, k], own[4, k]
            to_d[k] += by_d * (d_0 * e + d_1 * f + d_2 * g + d_3 * h + d_4 * u)
            to_q[k] += by_q * (q_0 * e + q_1 * f + q_2 * g + q_3 * h + q_4 * u)


@inlined
def factors(x, y, far_x, far_y):
    """Return what a term x^a y^b adds to the slopes along x and y, of powers and their derivatives;
    far_x, far_y: how far beyond the box the place is."""
    return (
        x[1] * y[0] + far_x * x[2] * y[0] + far_y * x[1] * y[1],
        x[0] * y[1] + far_x * x[1] * y[1] + far_y * x[0] * y[2],
    )


@inlined
def powers(x, n):
    """Return x^n and its first two derivatives."""
    return (
        x**n,
        n * x ** (n - 1) if n > 0 else 0.0,
        n * (n - 1) * x ** (n - 2) if n > 1 else 0.0,
    )
