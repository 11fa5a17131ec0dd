"""Motion at imposed speed behind an encoder's counts: straight ramps of speed from corner to
corner.

With h = max(0, t - g) behind a corner at g, the angle is

    theta = theta_0 + omega_0 t + a_0 t^2 / 2 + sum d h^2 / 2,   d theta / d g = -d h,

d the step of acceleration there.  An eccentric encoder adds a sine of the mechanical angle, and so
does a speed that is uneven once a turn.
Angles, steps and places are found together (Gauss-Newton); the number of corners is the one of
least

    n log(sum of squares) + 3 corners log n

(the criterion for change points of Zhang and Siegmund, Biometrics 63 (2007) 22, its leading terms),
n the readings that are independent: no more of them than counts passed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from model.array_types import Array

CORNERS = 8
# means on which corners are sought: ten in each of PLACES at least; all readings refine them
FEW = 2000
PLACES = 40  # a new corner is first sought at so many equal steps of the recording
# numbers worked on at once there: a long recording's places are tried a few at a time
TOGETHER = 1e7
APART = 2  # samples between corners, and between a corner and an end
ITERATIONS = 30
HALVINGS = 8
CONVERGED = 1e-6  # of the sum of squares: far below what a corner has to gain
RANK = 1e-12  # of singular values
# least distance of a column of unit length from those before it: of normal equations its square,
# 1e-10, is far above rounding
SOLID = 1e-5
WOBBLES = 2  # fits of the sine: each takes off its amplitude (rad mechanical) times what is left
PENALTY = 3.0
# deviations of the mean square of n uniform errors, sqrt(0.8 / n) of its mean: no corner is sought
# below
SCATTER = 3.0


@dataclass(frozen=True)
class Ramps:
    """A fit: corners (shares of the recording), angle (n,) rad and speed (n,) rad a sample without
    the sine, squares left over, the sine (n,)."""

    corners: Array
    angle: Array
    speed: Array
    squares: float
    sine: Array


@dataclass(frozen=True)
class Reading:
    """What is fitted: tau (n,) time over the whole length, theta (n,) rad, the mechanical angle
    (n,) that the sine goes along (None: no sine is fitted), independent readings, least possible
    sum of squares."""

    tau: Array
    theta: Array
    mechanical: Array | None
    independent: float
    least: float

    def sine(self) -> list[Array]:
        """Return the columns (n,) of the sine."""
        return [] if self.mechanical is None else [np.sin(self.mechanical), np.cos(self.mechanical)]

    def thinned(self) -> Reading:
        """Return means of some readings each, FEW at most, on which corners are sought first."""
        each = math.ceil(len(self.tau) / FEW)
        whole = len(self.tau) // each * each

        def mean(x: Array) -> Array:
            """Return means of a course."""
            return np.asarray(x[:whole].reshape(-1, each).mean(axis=1))

        turned = None if self.mechanical is None else mean(self.mechanical)
        return replace(self, tau=mean(self.tau), theta=mean(self.theta), mechanical=turned)

    def criterion(self, fitted: Ramps) -> float:
        """Return the criterion above, least for the right number of corners."""
        chance = self.independent * math.log(max(fitted.squares, self.least))
        return chance + PENALTY * len(fitted.corners) * math.log(self.independent)


def ramps_of(theta: Array, pole_pairs: float, count: float) -> Ramps:
    """Return the ramps behind readings theta (n,), rad electrical, equally spaced in time; count:
    rad, electrical.

    The speed is in radians per sample.
    """
    n = len(theta)
    turns = np.ptp(theta) > 2.0 * math.pi * pole_pairs
    reading = Reading(
        np.arange(n) / n,
        theta,
        theta / pole_pairs if turns else None,
        independent(theta, count),
        n * max(count, 1e-6) ** 2 / 1200.0,
    )
    enough = most_squares(n, float(n), count)
    best = _sought(reading, enough)
    if turns and best.squares > enough:
        # a sine as large as a whole turn looks like a reversal, where corners are missing
        plain = _sought(replace(reading, mechanical=None), enough)
        best = min(best, refined(reading, plain.corners), key=reading.criterion)
    rough = reading.thinned()
    while len(best.corners):
        fewer = [
            _shown(reading, rough, np.delete(best.corners, k)) for k in range(len(best.corners))
        ]
        least = refined(reading, min(fewer, key=reading.criterion).corners)
        if reading.criterion(least) >= reading.criterion(best):
            break
        best = least
    for _ in range(WOBBLES if turns else 0):
        # the sine is one of the motion itself, not of its reading
        reading = replace(reading, mechanical=(theta - best.sine) / pole_pairs)
        best = refined(reading, best.corners)
    return best


def _sought(reading: Reading, enough: float) -> Ramps:
    """Return the best ramps with corners added one by one, until no more are needed or two more
    gain nothing; enough: sum of squares that rounding leaves."""
    rough = reading.thinned()
    best = fitted = refined(reading, np.empty(0))
    worse = 0
    while fitted.squares > enough and len(fitted.corners) < CORNERS and worse < 2:
        corners = np.sort(np.append(fitted.corners, _next(rough, fitted.corners)))
        fitted = refined(reading, refined(rough, corners).corners)
        better = reading.criterion(fitted) < reading.criterion(best)
        best, worse = (fitted, 0) if better else (best, worse + 1)
    return best


def _shown(reading: Reading, rough: Reading, corners: Array) -> Ramps:
    """Return the ramps whose corners, near those given, are the best ones of means, as all readings
    show them."""
    return _linear(reading, inside(reading.tau, refined(rough, corners).corners))[0]


def independent(theta: Array, count: float) -> float:
    """Return how many readings are independent: no more of them than counts passed."""
    passed = float(np.sum(np.abs(np.diff(theta)))) / count if count > 0.0 else math.inf
    return min(float(len(theta)), max(passed, 2.0))


def most_squares(n: int, pieces: float, count: float) -> float:
    """Return the largest sum of n squares that rounding to counts leaves, so many of them
    independent: the square of a uniform error scatters by sqrt(0.8) of its mean."""
    return n * max(count, 1e-6) ** 2 / 12.0 * (1.0 + SCATTER * math.sqrt(0.8 / pieces))


def straightened(fitted: Ramps, theta: Array, count: float) -> Ramps:
    """Return ramps without a sine, corners near those of a fit that has one."""
    n = len(theta)
    reading = Reading(np.arange(n) / n, theta, None, independent(theta, count), 0.0)
    return refined(reading, fitted.corners)


def are_ramps(fitted: Ramps, theta: Array, count: float) -> bool:
    """Return whether ramps miss readings by no more than rounding to counts does."""
    return fitted.squares <= most_squares(len(theta), independent(theta, count), count)


def refined(reading: Reading, corners: Array) -> Ramps:
    """Return the best ramps with so many corners near those given; corners: (k,), as `tau`."""
    fitted, step = _linear(reading, corners)
    for _ in range(ITERATIONS if len(corners) else 0):
        for halving in range(HALVINGS):
            trial = inside(reading.tau, fitted.corners + 0.5**halving * step)
            closer, onward = _linear(reading, trial)
            if closer.squares < fitted.squares:
                break
        else:
            break
        gained = 1.0 - closer.squares / fitted.squares
        fitted, step = closer, onward
        if gained < CONVERGED:
            break
    return fitted


def _linear(reading: Reading, corners: Array) -> tuple[Ramps, Array]:
    """Return the fit with corners as they are, and how far they should move."""
    h = np.maximum(0.0, reading.tau[:, None] - corners)
    columns = [np.ones_like(reading.tau), reading.tau, 0.5 * reading.tau**2, *(0.5 * h**2).T]
    m = len(columns)
    columns += reading.sine()
    own = len(columns)
    a = np.column_stack([*columns, -h])
    x, left, moved = _least_squares(a, reading.theta, own)
    steps, n = x[3:m], len(reading.tau)
    squares, sine = float(left @ left), a[:, m:own] @ x[m:]
    fitted = Ramps(
        corners, a[:, :m] @ x[:m], (x[1] + x[2] * reading.tau + h @ steps) / n, squares, sine
    )
    if not len(corners):
        return fitted, np.empty(0)
    return fitted, np.divide(moved, steps, out=np.zeros_like(moved), where=np.abs(steps) > 0.0)


def _least_squares(a: Array, y: Array, own: int) -> tuple[Array, Array, Array]:
    """Return the coefficients (own,) of the first columns of a (n, k) beside values y (n,), what
    they leave (n,), and the coefficients of the others where all of them are fitted.

    By normal equations, whose root is the triangular factor of `a`, and a correction by what they
    leave: that takes their error, at most SOLID^-2 times rounding, to its square.  Where columns
    are closer to each other than that, by the factor itself.
    """
    size = np.sqrt(np.einsum("nk,nk->k", a, a))
    size[size == 0.0] = 1.0
    try:
        root = np.linalg.cholesky((a.T @ a) / np.outer(size, size))
    except np.linalg.LinAlgError:
        root = np.zeros((1, 1))
    if np.diag(root).min() < SOLID:
        q, r = np.linalg.qr(a)
        b = q.T @ y
        x = np.linalg.lstsq(r[:own, :own], b[:own], rcond=RANK)[0]
        return x, y - a[:, :own] @ x, np.linalg.lstsq(r, b, rcond=RANK)[0][own:]

    def explained(left: Array, k: int) -> Array:
        """Return the coefficients of the first k columns beside what is left (n,)."""
        first = root[:k, :k]
        right = (a[:, :k].T @ left) / size[:k]
        return np.asarray(np.linalg.solve(first.T, np.linalg.solve(first, right)) / size[:k])

    x = explained(y, own)
    x = x + explained(y - a[:, :own] @ x, own)
    left = y - a[:, :own] @ x
    return x, left, explained(left, a.shape[1])[own:]


def inside(tau: Array, corners: Array) -> Array:
    """Return the corners in order, a few samples from the ends and from each other; tau: (n,)
    times."""
    least = APART / len(tau)
    kept = np.sort(np.clip(corners, least, 1.0 - least))
    for k in range(1, len(kept)):
        kept[k] = max(kept[k], kept[k - 1] + least)
    return kept


def _next(reading: Reading, corners: Array) -> float:
    """Return where one more corner would take most from the squares, others as they are."""
    h = np.maximum(0.0, reading.tau[:, None] - corners)
    columns = [
        np.ones_like(reading.tau),
        reading.tau,
        0.5 * reading.tau**2,
        *(0.5 * h**2).T,
        *(-h).T,
    ]
    columns += reading.sine()
    basis = np.linalg.svd(np.column_stack(columns), full_matrices=False)[0]
    left = reading.theta - basis @ (basis.T @ reading.theta)
    places = np.arange(1, PLACES) / PLACES
    groups = np.array_split(places, min(len(places), math.ceil(len(left) * len(places) / TOGETHER)))
    gain = np.concatenate([_gain(reading.tau, left, basis, some) for some in groups])
    return float(places[int(np.argmax(gain))])


def _gain(tau: Array, left: Array, basis: Array, places: Array) -> Array:
    """Return what one more corner at each of the places would take off the squares of what is left
    (n,); basis: of all columns that are there."""
    new = 0.5 * np.maximum(0.0, tau[:, None] - places) ** 2
    size = np.sum(new**2, axis=0)
    new -= basis @ (basis.T @ new)
    own = np.sum(new**2, axis=0)
    return np.where(own > 1e-12 * size, (left @ new) ** 2 / np.maximum(own, 1e-300), 0.0)
