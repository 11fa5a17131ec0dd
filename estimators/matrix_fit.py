"""The matrix of incremental 1/inductance fitted to pairs of flux and current ripple, and the angle
it says.

In the estimated rotor frame, as complex numbers, flux ripple f makes the current ripple
  g = S f + D conj(f),   S = (Gamma_dd + Gamma_qq)/2,   D = (Gamma_dd - Gamma_qq)/2 + j Gamma_dq,
and an error e turns D by 2 e, and the belief's current by e.
Of what the believed S and D leave of g, v = g - S f - D conj(f), recursive least
squares with forgetting make dS and dD, q = sum |f|^2, p = sum f^2:
  (q + c rho) dS + Re(conj(p) dD) = sum Re(conj(f) v),    (q + rho) dD + p dS = sum f v,
rho the belief's weight: along one axis only three of four entries show, and c < 1 says that the
scale S is known less well than the saliency, so that an inductance all wrong turns nothing.  The
angle is the Gauss-Newton step
  e = Re(conj(D') dD)/|D'|^2,   D' = d/de of D(R(-e) i) exp(2 j e) at e = 0,
where what lies along D, its scale, counts c times: D' is 2 j D but for saturation.
"""

from __future__ import annotations

import math

from estimators.believed import believed_hessian, damped
from estimators.demodulation import FREE
from model.compiled import kernel

# complex sums p and f v, two slots each; sums q and Re(conj(f) v)
P, FV = range(FREE, FREE + 4, 2)
Q, REAL_FV = range(FREE + 4, FREE + 6)
TAKEN = 6  # slots; an estimator's own begin behind them
SCALE = 0.1  # c: the scale is known three times less well than the saliency
DELTA = 0.02  # rad, half width of the difference for D'


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
    """Add a pair f (Wb), v (A) of the rotor frame to the sums, what they hold forgotten by
    `keep`."""
    put(state, P, keep * get(state, P) + f * f)
    put(state, FV, keep * get(state, FV) + f * v)
    state[Q] = keep * state[Q] + abs(f) ** 2
    state[REAL_FV] = keep * state[REAL_FV] + (f.conjugate() * v).real


@kernel
def solve(state, weight):
    """Return dS, dD (1/H) at the belief's weight rho (Wb^2)."""
    p, fv, q = get(state, P), get(state, FV), state[Q] + weight
    d_s = (state[REAL_FV] - (p.conjugate() * fv).real / q) / (
        state[Q] + SCALE * weight - abs(p) ** 2 / q
    )
    return d_s, (fv - d_s * p) / q


@kernel
def forgetting(n):
    """Return the factor a sample that makes the data as old in the mean as in an average over n
    samples."""
    age = 0.5 * (n - 1)
    return age / (1.0 + age)


@kernel
def believed(state, energy, i):
    """Return S, D (1/H) of a belief at a mean current (A, complex, estimated frame), and the slope
    D' (1/H a rad)."""
    turn = complex(math.cos(DELTA), math.sin(DELTA))
    _, ahead = parts(state, energy, i * turn.conjugate())
    _, behind = parts(state, energy, i * turn)
    s, d = parts(state, energy, i)
    turn *= turn
    return s, d, (ahead * turn - behind * turn.conjugate()) / (2.0 * DELTA)


@kernel
def parts(state, energy, i):
    """Return S and D (1/H) of a belief's Hessian at a current (A, complex)."""
    dd, dq, qq = believed_hessian(state, energy, i.real, i.imag)
    return 0.5 * (dd + qq), complex(0.5 * (dd - qq), dq)


@kernel
def angle_error(d, slope, d_d, energy):
    """Return e (rad) of the believed D, its slope D' and its deviation; less of it where the slope
    is small."""
    size = abs(d)
    along = d / size if size > 0.0 else 1.0 + 0j
    turned, grown = slope * along.conjugate(), d_d * along.conjugate()
    step = turned.imag * grown.imag + SCALE * turned.real * grown.real
    return damped(step, turned.imag * turned.imag + SCALE * turned.real * turned.real, energy)
