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
from numpy.typing import NDArray

from model.compiled import kernel
from model.effects.library import true_motor
from model.energy import flux_newton, hessian
from model.mapped import MappedMotor
from model.spline import SplineEnergy, currents
from model.spline_correction import MapError
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import Prepared
from sandbox.replay.stretches import Stretch
from sandbox.replay.transitions import SHARE, displaced, transitions
from sandbox.replay.walking import Running

Array = NDArray[np.float64]


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
        error, motor = self.prepared.map_error, self.prepared.campaign.drive.motor
        assert error is not None
        own = self.states.pop(s.recording, None)
        if own is None:
            start = np.zeros((len(error.modes) + 4, 2))
            own = displaced(self.prepared, self.values, s.recording), start
        moves = transitions(own[0], s.last, SHARE * motor.inductance_q * motor.rated_current)
        if s.last < s.n:
            self.states[s.recording] = own
        energy = true_motor(motor, dict(self.values), keep_map=True).energy
        r = self.prepared.recordings[s.recording]
        rests = r.loaded if r.settling is None else r.rotor == "locked"
        return answered(energy, error.modes, error.cells, moves, (s.first > 0, rests), own[1])


@kernel
def answered(m, modes, cells, moves, how, state):
    """Return three phases (n, 3, k) in A that energies on cells (k, n_d, n_q, 5, 5) add where
    `moves` go (`Transitions`).

    At a constant current an energy moves the flux by -L grad dH, L the incremental inductances:
    towards that it goes from sample to sample, as the plant lets a change of the flux decay.  The
    flux itself goes straight there: gradients and inverse inductances are means over that way, by
    Simpson's rule, since ripple crosses cells.
    how: whether a stretch goes on from `state`; if not, whether it begins at a constant current (as
    read, or settled), not at a constant flux.  state (k + 4, 2): flux that each energy has moved,
    the last sample's flux, angle, and transition; written at the end.
    """
    n, count = len(moves.flux), len(modes)
    begun, rests = how
    out, mean, own = np.empty((n, 3, count)), np.empty((count, 2)), np.empty((count, 2))
    psi = state[:count]
    old_d, old_q, old_angle = state[count, 0], state[count, 1], state[count + 1, 0]
    if begun:
        gradient_at(modes, cells, old_d, old_q, own)
    for k in range(n):
        d, q = moves.flux[k]
        if k > 0 or begun:
            last = moves.a[k - 1] if k > 0 else state[count + 2 :]
            t_aa, t_ab, t_ba, t_bb = last[0, 0], last[0, 1], last[1, 0], last[1, 1]
            mean[:] = own / 6.0
            g_dd, g_dq, g_qq = hessian(m, old_d, old_q)
            m_dd, m_dq, m_qq = g_dd / 6.0, g_dq / 6.0, g_qq / 6.0
            for share, w in ((0.5, 4.0 / 6.0), (1.0, 1.0 / 6.0)):
                x, y = old_d + share * (d - old_d), old_q + share * (q - old_q)
                g_dd, g_dq, g_qq = hessian(m, x, y)
                m_dd, m_dq, m_qq = m_dd + w * g_dd, m_dq + w * g_dq, m_qq + w * g_qq
                gradient_at(modes, cells, x, y, own)
                for i in range(count):
                    mean[i, 0] += w * own[i, 0]
                    mean[i, 1] += w * own[i, 1]
            angle = 0.5 * (moves.theta[k] + old_angle)
            co, si, inverse = math.cos(angle), math.sin(angle), 1.0 / (m_dd * m_qq - m_dq * m_dq)
            for i in range(count):
                x = inverse * (m_qq * mean[i, 0] - m_dq * mean[i, 1])
                y = inverse * (m_dd * mean[i, 1] - m_dq * mean[i, 0])
                x, y = co * x - si * y, si * x + co * y
                u, v = psi[i, 0] + x, psi[i, 1] + y
                psi[i, 0], psi[i, 1] = t_aa * u + t_ab * v - x, t_ba * u + t_bb * v - y
        else:
            gradient_at(modes, cells, d, q, own)
        g_dd, g_dq, g_qq = hessian(m, d, q)
        co, si, inverse = (
            math.cos(moves.theta[k]),
            math.sin(moves.theta[k]),
            1.0 / (g_dd * g_qq - g_dq * g_dq),
        )
        for i in range(count):
            x = inverse * (g_qq * own[i, 0] - g_dq * own[i, 1])
            y = inverse * (g_dd * own[i, 1] - g_dq * own[i, 0])
            x, y = co * x - si * y, si * x + co * y
            if k == 0 and rests and not begun:
                psi[i, 0], psi[i, 1] = -x, -y
            u, v = psi[i, 0] + x, psi[i, 1] + y
            for j in range(3):
                out[k, j, i] = moves.c[k, j, 0] * u + moves.c[k, j, 1] * v
        old_d, old_q, old_angle = d, q, moves.theta[k]
    state[count, 0], state[count, 1], state[count + 1, 0] = old_d, old_q, old_angle
    state[count + 2 :] = moves.a[n - 1]
    return out


@kernel
def gradients(m, modes, cells, current):
    """Return the currents (n, k, 2) in A of energies on cells (k, n_d, n_q, 5, 5) at the fluxes
    that a map m has for currents (n, 2)."""
    n = len(current)
    out = np.empty((n, len(modes), 2))
    d = q = 0.0
    for k in range(n):
        d, q, _ = flux_newton(m, current[k, 0], current[k, 1], d, q)
        gradient_at(modes, cells, d, q, out[k])
    return out


@kernel
def gradient_at(modes, cells, d, q, out):
    """Write the currents (k, 2) in A of energies on cells at one flux (Wb)."""
    low_d, low_q, per_d, per_q = cells
    for j in range(len(modes)):
        out[j, 0], out[j, 1] = currents(
            SplineEnergy(modes[j], low_d, low_q, per_d, per_q, 0.0, 0.0), d, q
        )
