"""Frames: phases a b c, stationary alpha beta, rotor d q; amplitude-invariant; angles electrical,
rad."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.compiled import inlined, kernel

SQRT3 = math.sqrt(3.0)


@kernel
def rotate(x, y, angle):
    """Return the vector (x, y) turned by `angle` rad: dq to alpha-beta with +theta, back
    with -theta."""
    c = math.cos(angle)
    s = math.sin(angle)
    return c * x - s * y, s * x + c * y


@kernel
def phases(alpha, beta):
    """Return the three phase quantities of a zero-sum space vector."""
    half = -0.5 * alpha
    quadrature = 0.5 * SQRT3 * beta
    return alpha, half + quadrature, half - quadrature


@kernel
def stationary(a, b, c):
    """Return alpha, beta of three phase quantities; a common part drops out."""
    return (2.0 * a - b - c) / 3.0, (b - c) / SQRT3


@inlined
def sixth(c, s):
    """Return cos and sin of six times the angle of cos c, sin s."""
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    c_4, s_4 = c_2 * c_2 - s_2 * s_2, 2.0 * c_2 * s_2
    return c_4 * c_2 - s_4 * s_2, s_4 * c_2 + c_4 * s_2


@inlined
def multiple(c, s, order):
    """Return cos and sin of a whole multiple of the angle of cos c, sin s; |order| below 64, no
    branch."""
    n, b = abs(order), (s if order >= 0.0 else -s)
    # written out: with a loop in it, one over lanes is no vector code
    n, x, y, a, b = binary_digit(n, 1.0, 0.0, c, b)
    n, x, y, a, b = binary_digit(n, x, y, a, b)
    n, x, y, a, b = binary_digit(n, x, y, a, b)
    n, x, y, a, b = binary_digit(n, x, y, a, b)
    n, x, y, a, b = binary_digit(n, x, y, a, b)
    n, x, y, a, b = binary_digit(n, x, y, a, b)
    return x, y


@inlined
def binary_digit(n, x, y, a, b):
    """Return n halved, (x, y) turned on by the angle of (a, b) where n is odd, and (a, b) at twice
    its angle."""
    half = np.floor(0.5 * n)
    odd = n - 2.0 * half > 0.5
    x, y = (x * a - y * b if odd else x), (x * b + y * a if odd else y)
    return half, x, y, a * a - b * b, 2.0 * a * b


@kernel
def wrap(angle):
    """Return the angle brought into [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


def wrapped(angle: ArrayLike) -> NDArray[np.float64]:
    """Return angles (any shape, rad) brought into [-pi, pi)."""
    a = np.asarray(angle, dtype=float)
    return a - 2.0 * np.pi * np.floor((a + np.pi) / (2.0 * np.pi))
