"""Inertia, frictions and cogging from averages of the shaft's equation; each torque is linear in
its sizes.

Orders of cogging are added one by one, the one that explains most first, until none explains more
than chance would among all that were tried.  Intervals allow for residuals that go together within
a block of windows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from sandbox.gap.motion.torques import DRY, INERTIA, LAG, VISCOUS, against, users
from sandbox.gap.motion.windows import Averages

# Of the log's fastest: over which dry friction changes its sign.  A tanh is 0.96 at twice its
# width; a wider one bends where viscous friction is told, and takes from it what belongs to
# presliding.
WIDTHS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.03)
USUAL_WIDTH = 0.005
# standard deviation of its logarithm before the log (0.1 to 5 %), and least where the speed goes
# through it within a row: there counts blur it (0.2 rad/s came out as 0.2 to 0.42 in 24 logs)
SPREAD_WIDTH, UNRESOLVED = 1.0, 0.4
# of an order, seen in the angle: with fewer it stands for anything that depends on the place
LEAST_PERIODS = 2.0
MOST_ORDERS = 16
HIGHEST = 200  # order per turn that is looked for
PASSED = 0.1  # of a sine's square: an order that windows average away below it is not looked for
BLOCKS = 24  # for intervals
HELD = 0.9  # of a block's information that is left out: one that holds all tells nothing without
# of the usual step: how late or early current, or a change of the speed's sign, is read beside the
# angle in an ordinary log
ORDINARY_LAG = 0.5
REVERSAL = "reversal"  # dry friction times how late (s) its sign changes
SHORT = 8  # windows: fewer do not tell their own scatter
STEADIEST = 0.1  # of the usual scatter: the least that a recording is believed to have
TAIL = 3.0  # deviations from which a row counts less, as with Student-t residuals
STUDENT = 2.07  # 95 % of Student's t with BLOCKS - 1 degrees of freedom


@dataclass(frozen=True)
class Design:
    """The equations J a = torque + ..., one row a window: recordings stacked, with one offset in
    common.

    weight: one over the standard deviation of a row; firm: what of the rows' information is left as
    weights yield to residuals; block: which rows go together; step: s, usual between samples;
    of_users: columns of the user's effects by their sizes' names; kept: columns asked for so far.
    """

    torque: Array
    slope: Array
    acceleration: Array
    speed: Array
    averages: tuple[Averages, ...]
    owner: NDArray[np.int64]
    weight: Array
    block: NDArray[np.int64]
    step: float
    of_users: Mapping[str, Array] = field(default_factory=dict)
    kept: dict[tuple[str, float], Array] = field(default_factory=dict, repr=False)
    firm: float = 1.0

    @cached_property
    def noise(self) -> Array:
        """Return the noise (rad/s^2 rms) of each row's acceleration."""
        return np.concatenate([a.noise_acceleration for a in self.averages])

    @cached_property
    def fastest(self) -> float:
        """The speed (rad/s) that samples exceed in one of a hundred."""
        speeds = np.concatenate([np.abs(a.path_speed) for a in self.averages])
        return float(np.quantile(speeds, 0.99)) or 1.0

    @cached_property
    def within_a_row(self) -> float:
        """Half of what the speed (rad/s) usually changes from row to row."""
        return 0.5 * self.step * float(np.sqrt(np.mean(self.acceleration**2)))

    @cached_property
    def widths(self) -> tuple[float, ...]:
        """Speeds (rad/s) over which dry friction may change its sign."""
        return tuple(share * self.fastest for share in WIDTHS)

    def dry(self, width: float) -> Array:
        """Return the column of dry friction that changes its sign over a width (rad/s)."""
        return self._once(
            ("dry", width), lambda: [a.along(np.tanh(a.path_speed / width)) for a in self.averages]
        )

    def bend(self, width: float) -> Array:
        """Return how that column changes with the logarithm of its width."""

        def one(a: Averages) -> Array:
            """Return a recording's part."""
            x = a.path_speed / width
            return a.along(-x * (1.0 - np.tanh(x) ** 2))

        return self._once(("bend", width), lambda: [one(a) for a in self.averages])

    def reversal(self, width: float) -> Array:
        """Return the slope (1/s) of the column of dry friction: what its change of sign is late or
        early."""

        def one(a: Averages) -> Array:
            """Return a recording's part."""
            f = np.tanh(a.path_speed / width)
            return a.along(np.gradient(f.ravel(), a.step / f.shape[1]).reshape(f.shape))

        return self._once(("reversal", width), lambda: [one(a) for a in self.averages])

    def order(self, n: int) -> Array:
        """Return the two columns of a torque sin, cos of n times the angle on the rotor, (rows,
        2)."""

        def one(a: Averages) -> Array:
            """Return a recording's part."""
            return a.along(np.stack([np.sin(n * a.angle), np.cos(n * a.angle)], axis=2))

        return self._once(("order", n), lambda: [one(a) for a in self.averages])

    def _once(self, key: tuple[str, float], make: Callable[[], list[Array]]) -> Array:
        """Return a column that is worked out once, whatever the rows weigh."""
        if key not in self.kept:
            self.kept[key] = np.concatenate(make())
        return self.kept[key]

    def only(self, keep: NDArray[np.bool_]) -> Design:
        """Return the same with the weight of other rows at zero."""
        return replace(self, weight=np.where(keep, self.weight, 0.0))


@dataclass(frozen=True)
class Terms:
    """Which torques a model has: free inertia and viscous friction, dry friction (its width,
    rad/s), a first-order lag of the current's readings (s), orders of cogging, sizes of the user's
    effects."""

    inertia: bool = False
    viscous: bool = False
    dry: float | None = None
    lag: bool = False
    orders: tuple[int, ...] = ()
    of_users: tuple[str, ...] = ()


@dataclass(frozen=True)
class Nominal:
    """What is stated: inertia (None: free in any model), viscous friction, and their relative
    deviations."""

    inertia: float | None
    viscous: float
    inertia_deviation: float
    viscous_deviation: float


@dataclass(frozen=True)
class Shaft:
    """A fitted model: sizes, their covariance, the residual (N m) of each row, and the sum of
    weighted squares."""

    terms: Terms
    names: tuple[str, ...]
    values: Array
    covariance: Array
    residual: Array
    chi2: float
    strain: float  # squares of how far stated values were moved, in their deviations
    inflation: float  # how many windows say one thing

    def value(self, name: str) -> float:
        """Return a size."""
        return float(self.values[self.names.index(name)])

    def ci95(self, name: str) -> tuple[float, float]:
        """Return a size's 95 % interval."""
        k = self.names.index(name)
        half = STUDENT * math.sqrt(max(float(self.covariance[k, k]), 0.0))
        return float(self.values[k]) - half, float(self.values[k]) + half

    def amplitude(self, order: int) -> tuple[float, float, float, float]:
        """Return amplitude (N m) and its deviation, phase (rad) of sin(order x angle + phase) and
        its deviation."""
        k = self.names.index(f"sin {order}")
        s, c = self.values[k : k + 2]
        size = math.hypot(s, c)
        unit = np.array([s, c]) / size
        own = self.covariance[k : k + 2, k : k + 2]
        across = np.array([-unit[1], unit[0]])
        return (
            size,
            math.sqrt(unit @ own @ unit),
            math.atan2(c, s),
            math.sqrt(across @ own @ across) / size,
        )


def design_of(parts: Sequence[Averages]) -> Design:
    """Return the stacked equations, each row's weight one over the rms of all torques."""
    owner = np.repeat(np.arange(len(parts)), [len(a.torque) for a in parts])
    block = np.concatenate(
        [_blocks(len(a.torque), len(parts)) + 1000 * k for k, a in enumerate(parts)]
    )
    torque, slope, acceleration, speed = (
        np.concatenate([getattr(a, name) for a in parts])
        for name in ("torque", "slope", "acceleration", "speed")
    )
    step = float(np.median([a.step for a in parts]))
    of_users = {
        n.size: np.concatenate([a.along(against(n, a.angle, a.path_speed)) for a in parts])
        for n in users()
    }
    return Design(
        torque,
        slope,
        acceleration,
        speed,
        tuple(parts),
        owner,
        np.full(len(owner), 1.0 / (float(np.sqrt(np.mean(torque**2))) or 1.0)),
        block,
        step,
        of_users,
    )


def _blocks(rows: int, recordings: int) -> NDArray[np.int64]:
    return np.arange(rows) * max(BLOCKS // recordings, 2) // max(rows, 1)


def columns_of(
    design: Design, terms: Terms, nominal: Nominal
) -> tuple[list[str], Array, Array, Array]:
    """Return names, columns, and prior means and deviations (inf: free) of a model's sizes.

    torque = J a + B omega + T_c dry + the user's - orders - offset, each row.
    """
    free = math.inf
    j = nominal.inertia
    names, mean = [INERTIA.size, VISCOUS.size], [0.0 if j is None else j, nominal.viscous]
    wide = [
        free if terms.inertia or j is None else nominal.inertia_deviation * j,
        free if terms.viscous else nominal.viscous_deviation * nominal.viscous,
    ]
    columns = [design.acceleration[:, None], design.speed[:, None]]
    if terms.dry is not None:
        names, mean, wide = [*names, DRY.size], [*mean, 0.0], [*wide, free]
        columns.append(design.dry(terms.dry)[:, None])
        names, mean = [*names, REVERSAL], [*mean, 0.0]
        wide = [*wide, ORDINARY_LAG * design.step * float(np.sqrt(np.mean(design.torque**2)))]
        columns.append(design.reversal(terms.dry)[:, None])
    for size in terms.of_users:
        names, mean, wide = [*names, size], [*mean, 0.0], [*wide, free]
        columns.append(design.of_users[size][:, None])
    names, mean, wide = (
        [*names, LAG.size],
        [*mean, 0.0],
        [*wide, free if terms.lag else ORDINARY_LAG * design.step],
    )
    columns.append(-design.slope[:, None])  # true torque = as read + lag x its slope
    for n in terms.orders:
        names, mean, wide = [*names, f"sin {n}", f"cos {n}"], [*mean, 0.0, 0.0], [*wide, free, free]
        columns.append(-design.order(n))
    columns.append(-np.ones((len(design.torque), 1)))
    return [*names, "offset"], np.hstack(columns), np.array([*mean, 0.0]), np.array([*wide, free])


def fitted(design: Design, terms: Terms, nominal: Nominal) -> Shaft:
    """Return the weighted least-squares fit of a model, deviations of what is stated as priors."""
    names, columns, mean, wide = columns_of(design, terms, nominal)
    fixed = wide == 0.0
    start = np.where(fixed | np.isfinite(wide), mean, 0.0)
    y = (design.torque - columns @ start) * design.weight
    a = columns[:, ~fixed] * design.weight[:, None]
    precision = np.where(np.isfinite(wide[~fixed]), np.maximum(wide[~fixed], 1e-300) ** -2.0, 0.0)
    size = np.sqrt(np.sum(a * a, axis=0) + precision) + 1e-100  # of a column of zeros: squared
    normal = (a / size).T @ (a / size) + np.diag(precision / size**2)
    inverse = np.linalg.pinv(normal, rcond=1e-11, hermitian=True) / size / size[:, None]
    right = a.T @ y
    if not fixed[0]:
        inverse, taken = _without_noise(inverse, float(np.sum((design.noise * design.weight) ** 2)))
        right[0] += taken * start[0]  # what the noise makes of the inertia that is taken off y
    move = inverse @ right
    values = start.copy()
    values[~fixed] += move
    residual = design.torque - columns @ values
    scored = residual * design.weight
    strain = float(np.sum(precision * (values - mean)[~fixed] ** 2))
    chi2, inflation = float(scored @ scored), _inflation(scored, design)
    loose = np.linalg.solve(
        np.eye(len(inverse)) - (1.0 - design.firm) * inverse @ (a.T @ a), np.eye(len(inverse))
    )
    plain = loose @ inverse @ loose.T
    plain *= chi2 / max(int(np.count_nonzero(design.weight)), 1) * inflation
    found = widened(_sandwich(a, scored, design.block, loose @ inverse, design.firm), plain)
    if terms.dry is not None:
        bend = values[names.index(DRY.size)] * design.bend(terms.dry) * design.weight
        found += of_width(a, inverse, bend, design.within_a_row / terms.dry)
    covariance = np.zeros((len(names), len(names)))
    covariance[np.ix_(~fixed, ~fixed)] = found
    return Shaft(terms, tuple(names), values, covariance, residual, chi2, strain, inflation)


def of_width(a: Array, inverse: Array, bend: Array, rows: float) -> Array:
    """Return what the other sizes' covariance has more as the width of dry friction was fitted;
    bend: how its torque changes with the logarithm of the width; rows: what the speed changes in
    half a row, over the width."""
    moved = inverse @ (a.T @ bend)
    information = max(float(bend @ bend) - float((a.T @ bend) @ moved), 0.0) + SPREAD_WIDTH**-2.0
    return np.outer(moved, moved) * max(1.0 / information, (UNRESOLVED * min(rows, 1.0) ** 2) ** 2)


def widened(covariance: Array, other: Array) -> Array:
    """Return a covariance whose variances are no less than another one's, correlations kept.

    Sums over few blocks, of which some hold nearly all that tells a size, scatter by as much as
    themselves: with the larger of both estimates, as where currents are fitted (`estimates`).
    """
    own = np.maximum(np.diag(covariance), 1e-300)
    wider = np.sqrt(np.maximum(np.diag(other) / own, 1.0))
    return covariance * wider * wider[:, None]


def _without_noise(inverse: Array, squares: float) -> tuple[Array, float]:
    """Return the inverse of normal equations whose first column, the acceleration, holds noise of a
    known sum of squares, and what of these was taken off: with them the inertia would come out too
    small.

    At most half of what the others cannot stand in for: beyond it the noise is all there is.
    """
    own = float(inverse[0, 0])
    squares = min(squares, 0.5 / own) if own > 0.0 else 0.0
    wider = np.outer(inverse[:, 0], inverse[0]) * squares / (1.0 - squares * own)
    return inverse + wider, squares


def _sandwich(
    a: Array, scored: Array, block: NDArray[np.int64], inverse: Array, firm: float
) -> Array:
    """Return the covariance that allows for residuals going together within a block: of estimates
    without one block each (jackknife), so that a block which alone tells a size counts as one.

    inverse: of the information that is left; firm: what share of its own a block has of it.
    """
    _, place = np.unique(block, return_inverse=True)
    count = place.max() + 1
    moved = np.zeros((count, a.shape[1]))
    for k in range(count):
        own, left = a[place == k], scored[place == k]
        without = np.eye(a.shape[1]) - HELD * firm * (inverse @ (own.T @ own))
        moved[k] = np.linalg.lstsq(without, inverse @ (own.T @ left), rcond=None)[0]
    return moved.T @ moved * max(count - 1, 1) / count


def _inflation(scored: Array, design: Design) -> float:
    """Return 1 + twice the sum of the residual's correlations from window to window, up to the
    first below 0.05."""
    total, energy = 1.0, float(scored @ scored) or 1.0
    for lag in range(1, 40):
        same = design.owner[lag:] == design.owner[:-lag]
        rho = float(np.sum((scored[lag:] * scored[:-lag])[same])) / energy
        if rho < 0.05:
            break
        total += 2.0 * rho
    return total


def reweighted(design: Design, shaft: Shaft) -> Design:
    """Return the equations with rows weighted by what their recording's residuals scatter, outliers
    less.

    A recording in which nothing changes, or of a few windows, scatters by chance as little as it
    likes: none counts for more than STEADIEST of the usual scatter, a short one for the usual one.
    """
    weight = np.empty(len(design.weight))
    parts = [shaft.residual[design.owner == k] for k in range(len(design.averages))]
    spreads = [1.4826 * float(np.median(np.abs(x - np.median(x)))) for x in parts]
    usual = max(float(np.median(np.repeat(spreads, [len(x) for x in parts]))), 1e-12)
    for k, x in enumerate(parts):
        own = design.owner == k
        spread = max(spreads[k], usual if len(x) < SHORT else STEADIEST * usual)
        # a jump between two rows counts little
        weight[own] = 1.0 / np.hypot(spread, shaft.residual[own] / TAIL)
    weight = np.where(design.weight > 0.0, weight, 0.0)
    return replace(design, weight=weight, firm=firmness(weight, shaft.residual))


def firmness(weight: Array, residual: Array) -> float:
    """Return what is left of the rows' information as their weights are told by the same residuals.

    A row pulls by w^2 r, w^-2 = spread^2 + (r/TAIL)^2: as its residual r grows its weight yields,
    so that the pull grows by w^2 (1 - 2 (w r/TAIL)^2) only.  An estimate moves by noise over the
    sum of these, where equations of fixed weights would have the sum of w^2 (Huber, Robust
    Statistics, 1981, 7.6: the mean of psi').  Half the residuals of each recording are within 0.67
    of its spread, or of a larger one: above 0.37 it is always.
    """
    square = weight**2
    total = float(np.sum(square))
    yielded = 2.0 * float(np.sum(square**2 * (residual / TAIL) ** 2))
    return 1.0 - yielded / total if total > 0.0 else 1.0


def with_orders(design: Design, terms: Terms, nominal: Nominal, highest: int = HIGHEST) -> Terms:
    """Return terms with the orders of cogging that explain more than chance, the strongest
    first."""
    tried = {}
    travel = max(float(np.ptp(a.angle)) for a in design.averages)
    for n in range(max(1, math.ceil(LEAST_PERIODS * math.tau / travel)), highest + 1):
        pair = design.order(n) * design.weight[:, None]
        if np.mean(pair[design.weight > 0.0] ** 2) > 0.5 * PASSED * np.mean(
            design.weight[design.weight > 0.0] ** 2
        ):
            tried[n] = pair
    rows = int(np.count_nonzero(design.weight))
    while len(terms.orders) < MOST_ORDERS:
        now = fitted(design, terms, nominal)
        _, columns, _, wide = columns_of(design, terms, nominal)
        q, _ = np.linalg.qr(columns[:, wide > 0.0] * design.weight[:, None])
        rest = now.residual * design.weight
        gains = {
            n: _gain(pair - q @ (q.T @ pair), rest)
            for n, pair in tried.items()
            if n not in terms.orders
        }
        best = max(gains, key=lambda n: gains[n], default=None)
        scale = now.chi2 / rows * now.inflation
        if best is None or gains[best] / scale < 2.0 * math.log(
            max(len(tried), 2)
        ) + 2.0 * math.log(rows):
            return terms
        terms = replace(terms, orders=(*terms.orders, best))
    return terms


def _gain(pair: Array, rest: Array) -> float:
    """Return by how much two columns lessen the sum of squares."""
    normal, right = pair.T @ pair, pair.T @ rest
    if np.linalg.det(normal) <= 1e-9 * np.trace(normal) ** 2:
        return 0.0
    return float(right @ np.linalg.solve(normal, right))
