"""The matrix of incremental 1/inductance fitted to pairs of flux and current ripple, and the angle it says.

In the estimated rotor frame, as complex numbers, flux ripple f makes the current ripple
  g = S f + D conj(f),   S = (Gamma_dd + Gamma_qq)/2,   D = (Gamma_dd - Gamma_qq)/2 + j Gamma_dq,
and an error e turns D by 2 e.  Of what the believed S and D leave of g, v = g - S f - D conj(f), recursive least
squares with forgetting make dS and dD, q = sum |f|^2, p = sum f^2:
  (q + c rho) dS + Re(conj(p) dD) = sum Re(conj(f) v),    (q + rho) dD + p dS = sum f v,
  e = arg((D + dD)/D) / 2,
the angle directly, without a search.  rho is the belief's weight: along one axis only three of four entries show, and
c < 1 says that the scale S is known less well than the saliency, so that an inductance all wrong turns nothing.
"""

from __future__ import annotations

import math

from estimators.demodulation import FREE
from model.compiled import kernel

# complex sums p and f v, two slots each; sums q and Re(conj(f) v)
P, FV = range(FREE, FREE + 4, 2)
Q, REAL_FV = range(FREE + 4, FREE + 6)
TAKEN = 6  # slots; an estimator's own begin behind them
SCALE = 0.02  # c
LEAST = 0.05  # of the saliency at zero current: below it the matrix carries no angle


@kernel
def get(state, slot):
    """Return the complex number at a slot."""
    return complex(state[slot], state[slot + 1])


@kernel
def put(state, slot, value):
    """Write a complex number to a slot."""
    state[slot], state[slot + 1] = value.real, value.imag


@kernel
def add(state, f, v, keep):
    """Add a pair f (Wb), v (A) of the rotor frame to the sums, what they hold forgotten by `keep`."""
    put(state, P, keep * get(state, P) + f * f)
    put(state, FV, keep * get(state, FV) + f * v)
    state[Q] = keep * state[Q] + abs(f) ** 2
    state[REAL_FV] = keep * state[REAL_FV] + (f.conjugate() * v).real


@kernel
def solve(state, weight):
    """Return dS, dD (1/H) at the belief's weight rho (Wb^2)."""
    p, fv, q = get(state, P), get(state, FV), state[Q] + weight
    d_s = (state[REAL_FV] - (p.conjugate() * fv).real / q) / (state[Q] + SCALE * weight - abs(p) ** 2 / q)
    return d_s, (fv - d_s * p) / q


@kernel
def forgetting(n):
    """Return the factor a sample that makes the data as old in the mean as in an average over n samples."""
    age = 0.5 * (n - 1)
    return age / (1.0 + age)


@kernel
def believed(dd, dq, qq):
    """Return S and D (1/H) of a belief's Hessian."""
    return 0.5 * (dd + qq), complex(0.5 * (dd - qq), dq)


@kernel
def angle_error(d, d_d, energy):
    """Return e (rad) of the believed D and its deviation; fades out where the belief says there is no saliency."""
    turned = (d + d_d) * d.conjugate()
    least = LEAST * 0.5 * (energy.gamma_d - energy.gamma_q)
    share = abs(d) ** 2 / max(abs(d) ** 2, least * least)
    return 0.5 * share * math.atan2(turned.imag, turned.real)
