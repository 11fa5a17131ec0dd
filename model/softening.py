"""By how much terms of H that turn with the rotor soften it, over a whole turn and at many fluxes.

At a flux a term of order n adds Re(Z e^{j n theta}) to H's second derivatives, Z = C - j S for C
cos + S sin, a complex symmetric 2x2 matrix.  With M = L L' those of the motor alone, s times the
terms A leave M + s A positive as long as s < 1 / share, share the largest eigenvalue of -L^-1 A
L^-T over angles and fluxes.

Angles are looked at PER_WAVE times a wave of the highest order, so one lies within half such a step
of the worst. There a term's part of the quadratic form of the worst direction is at its maximum but
for (n step/2)^2/2 of its amplitude, which is at most the root of the squares of C's and S's largest
eigenvalues: so much is added, and the share returned is never below the true one at these fluxes,
and above it by 0.08 % of the amplitudes at most.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.energy import SOLVED, flux_newton, hessian, min_eigenvalue
from model.parameters import OVERLOAD, Motor

Complex = NDArray[np.complex128]
PER_WAVE = 96
# currents: directions, sizes up to OVERLOAD.  Twice as many lower what terms may have by 0.4 % on
RAYS, RADII = (
    180,
    40,
)
# the paper's motors, and by 3 % where a flux map has its knee within a few of them
AT_ONCE = 8  # fluxes looked at together
# of its least stiffness at zero current: where a motor has lost more, it is its own domain that
# ends
KEPT = 0.5


class Term(NamedTuple):
    """A term of H: whose it is, its order (above 0), and Z (3, fluxes): dd, dq, qq in 1/H."""

    name: str
    order: int
    z: Complex


class Softest(NamedTuple):
    """Where terms soften H most: the share they take there at most, and whose term takes most."""

    share: float
    name: str


def softest(terms: Sequence[Term], stiffness: Array) -> Softest:
    """Return the share and the worst term; stiffness: (3, fluxes) M's dd, dq, qq in 1/H, positive
    definite."""
    lower = 1.0 / np.sqrt(stiffness[0])
    across = stiffness[1] * lower
    last = 1.0 / np.sqrt(stiffness[2] - across**2)
    side = -across * lower * last
    by: dict[int, Complex] = {}
    scaled = [_scaled(term.z, lower, side, last) for term in terms]
    for term, z in zip(terms, scaled, strict=True):
        by[term.order] = by.get(term.order, np.zeros(1)) + z
    common = math.gcd(*by)
    waves = {n: n // common for n in by}
    count = PER_WAVE * max(waves.values())
    x = np.arange(count) * (math.tau / count)
    sizes = {n: _amplitude(z) for n, z in by.items()}
    between = np.asarray(
        sum(0.5 * (waves[n] * math.pi / count) ** 2 * size for n, size in sizes.items())
    )
    most = np.asarray(sum(sizes.values()))  # no flux has a larger share
    left, best, where = np.argsort(-most), -math.inf, (0, 0)
    while len(left) and most[left[0]] > best:
        some, left = left[:AT_ONCE], left[AT_ONCE:]
        b = sum(np.real(z[:, some, None] * np.exp(1j * waves[n] * x)) for n, z in by.items())
        taken = between[some, None] - _least(b)
        at, k = divmod(int(np.argmax(taken)), count)
        if taken[at, k] > best:
            best, where = float(taken[at, k]), (int(some[at]), k)
    own = [
        np.real(z[:, where[0]] * np.exp(1j * waves[t.order] * x[where[1]]))
        for t, z in zip(terms, scaled, strict=True)
    ]
    dd, dq, qq = np.sum(own, axis=0)
    # of the eigenvector of the smaller eigenvalue
    turn = 0.5 * math.atan2(2.0 * dq, dd - qq) + 0.5 * math.pi
    along = np.array([math.cos(turn) ** 2, math.sin(2.0 * turn), math.sin(turn) ** 2])
    return Softest(best, terms[int(np.argmin(own @ along))].name)


def _scaled(z: Complex, lower: Array, side: Array, last: Array) -> Complex:
    """Return L^-1 Z L^-T; lower, side, last: entries of L^-1."""
    dd, dq, qq = z
    return np.array(
        [
            lower**2 * dd,
            lower * (side * dd + last * dq),
            side**2 * dd + 2.0 * side * last * dq + last**2 * qq,
        ]
    )


def _least(m: Array) -> Array:
    """Return the smaller eigenvalues of symmetric matrices (3, ...)."""
    return np.asarray(0.5 * (m[0] + m[2]) - np.hypot(0.5 * (m[0] - m[2]), m[1]))


def _amplitude(z: Complex) -> Array:
    """Return what v' Z v is at most in size, v of length 1: the root of both parts' squares."""
    both = [
        np.abs(0.5 * (m[0] + m[2])) + np.hypot(0.5 * (m[0] - m[2]), m[1]) for m in (z.real, z.imag)
    ]
    return np.asarray(np.hypot(*both))


@lru_cache(maxsize=64)
def of_overload(motor: Motor) -> tuple[Array, Array]:
    """Return fluxes (2, n) in Wb of currents up to OVERLOAD of rated, and H's second derivatives
    there (3, n), 1/H.

    Where the motor alone has no flux for a current, or has lost more than half of its stiffness, a
    ray ends.
    """
    energy, fluxes = motor.energy, [(0.0, 0.0)]
    least = KEPT * min_eigenvalue(*hessian(energy, 0.0, 0.0))
    for angle in np.arange(RAYS) * (math.tau / RAYS):
        d = q = 0.0
        for i in np.linspace(0.0, OVERLOAD * motor.rated_current, RADII + 1)[1:]:
            d, q, status = flux_newton(energy, i * math.cos(angle), i * math.sin(angle), d, q)
            if status != SOLVED or not min_eigenvalue(*hessian(energy, d, q)) >= least:
                break
            fluxes.append((d, q))
    return np.array(fluxes).T, np.array([hessian(energy, d, q) for d, q in fluxes]).T
