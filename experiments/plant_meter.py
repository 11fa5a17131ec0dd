"""A meter beside the plant: what it takes in, loses, hands on and stores, from what kernels leave
in its batch.

Only where kernels are interpreted (NUMBA_DISABLE_JIT=1), one lane: `experiments.plant_energy` puts
it in.  The current in a segment is its parabola through start, middle and end, and the kinks that
late edges make in it (`sandbox.plant.lags`); the voltage what the legs apply, edge by edge, as late
as they act.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import root

from model.parameters import Drive
from model.spline import SplineEnergy, energy
from sandbox.plant import electrical, losses, ports

PLACES, WEIGHTS = np.polynomial.legendre.leggauss(3)


class Fields:
    """A record whose fields are attributes, as compiled code sees them."""

    def __init__(self, record: Any) -> None:
        for name in record.dtype.names:
            setattr(self, name, record[name])

    def __getitem__(self, name: str) -> Any:
        """Return a field."""
        return getattr(self, name)


class Middle(NamedTuple):
    """A segment as its middle knows it: length (s), link (V), the legs' levels, late edges with
    what they change of these and how late (s), flux at the start (Wb), current in the middle and
    mean iron-loss current (A), by how much this follows the flux at once (1/H)."""

    span: float
    link: float
    levels: complex
    edges: list[tuple[complex, float]]
    flux: complex
    current: complex
    core: complex
    stiff: float


class Meter:
    """What a plant takes in, loses and hands on (J), added up segment by segment; w: of one
    lane."""

    def __init__(
        self, w: Any, v: Mapping[str, float], drive: Drive, rotor: str, load: float
    ) -> None:
        self.w, self.v, self.motor, self.rotor, self.load = w, v, drive.motor, rotor, load
        self.flux_map = drive.motor.energy if isinstance(drive.motor.energy, SplineEnergy) else None
        names = ("in", "copper", "skin", "core", "legs", "friction", "shaft")
        self.total = dict.fromkeys(names, 0.0)
        self.waiting: list[tuple[complex, float]] = []
        self.begun: list[complex] = []
        self.segment: Middle | None = None

    def vector(self, name: str) -> complex:
        """Return a vector of the batch."""
        return complex(getattr(self.w, f"{name}_alpha")[0], getattr(self.w, f"{name}_beta")[0])

    def speeds(self) -> tuple[float, float]:
        """Return the speeds of rotor and load, rad/s mechanical."""
        w = self.w
        omega = w.speed[0] / w.pairs[0] + w.load_share[0] * w.slip[0]
        return omega, omega - w.slip[0]

    def turn(self) -> float:
        """Return the rotor's angle, rad mechanical."""
        return float(self.w.angle[0] / self.w.pairs[0] + self.w.load_share[0] * self.w.twist[0])

    def magnetic(self, psi: complex) -> tuple[complex, float]:
        """Return the magnetising current (A) and H (J up to 3/2) at a flux (Wb), the rotor as it
        stands."""
        w, theta = self.w, self.turn() * self.motor.pole_pairs
        c, s, e = math.cos(theta), math.sin(theta), complex(math.cos(theta), math.sin(theta))
        m = w.magnet[0] + complex(*ports.magnets(w, 0, c, s)[:2])
        m += sum(complex(*ports.further_magnets(w, k, 0, c, s)[:2]) for k in range(w.more_magnets))
        z = psi / e - m
        i = complex(*electrical.quartic(w, 0, z.real, z.imag))
        h = (
            w.gamma_d[0] * z.real**2 / 2
            + w.gamma_q[0] * z.imag**2 / 2
            + w.cubic_d[0] * z.real**3 / 3
        )
        h += w.cubic_q[0] * z.real * z.imag**2 + w.quartic_d[0] * z.real**4 / 4
        h += w.quartic_dq[0] * (z.real * z.imag) ** 2 + w.quartic_q[0] * z.imag**4 / 4
        if self.flux_map is not None:
            i, h = (
                i + complex(*ports.map_currents(self.flux_map, *pair(z))),
                h + energy(self.flux_map, *pair(z)),
            )

        def more(x: float) -> complex:
            """Return what effects add to the current (A) at a share x of the flux."""
            at = pair(x * z)
            own = complex(*ports.energy(w, 0, c, s, *at)[:2])
            return own + sum(
                complex(*ports.further_energy(w, k, 0, c, s, *at)[:2]) for k in range(w.more_energy)
            )

        # from no flux to z: Gauss' rule, exact for energies up to degree six
        way = 0.5 * (1.0 + PLACES)
        h += sum(
            0.5 * a * (more(x).conjugate() * z).real for x, a in zip(way, WEIGHTS, strict=True)
        )
        return (i + more(1.0)) * e, float(h)

    def flux(self, i: complex, near: complex) -> complex:
        """Return the flux (Wb) of a magnetising current (A)."""
        found = root(lambda x: pair(self.magnetic(complex(*x))[0] - i), pair(near), tol=1e-12)
        return complex(*found.x)

    def stored(self) -> float:
        """Return the energy stored (J) at a segment's start."""
        w, v = self.w, self.v
        h = 1.5 * self.magnetic(self.vector("psi"))[1]
        h += 1.5 * self.lag_holds(self.slope()) / w.core_rate[0]
        h += 0.75 * w.play[0] * abs(self.vector("ahead")) ** 2
        if w.skin_r[0] > 0.0:
            h += 0.75 * w.skin_r[0] / w.skin_rate[0] * abs(self.vector("slow")) ** 2
        if self.rotor != "free":
            return h
        for part in ("", *(f"{k}." for k in range(2, 7))):
            a, n, x = (
                v[f"cogging_torque.{part}{name}"] for name in ("amplitude", "order_mech", "phase")
            )
            h += a / n * math.cos(n * self.turn() + x)
        omega, other = self.speeds()
        if w.swing_rate[0] > 0.0:
            h += 0.5 * self.stiffness() * w.twist[0] ** 2
            return float(h + 0.5 * omega**2 / w.motor_inv[0] + 0.5 * other**2 / w.load_inv[0])
        return float(h + 0.5 * omega**2 / w.inertia_inv[0])

    def slope(self) -> complex:
        """Return the slope of the flux behind the iron's lag (V) at a segment's start."""
        return complex(self.w.core_rate[0] * (self.vector("psi") - self.vector("eddy")))

    def lag_holds(self, e: complex) -> float:
        """Return the integral of the current (A) of eddy currents and excess loss by the lagged
        slope (V) up to e, over its direction."""
        w = self.w
        narrow = w.slope_width[0] ** 2
        return float(
            0.5 * w.core_g[0] * abs(e) ** 2
            + (2.0 / 3.0) * w.excess[0] * ((abs(e) ** 2 + narrow) ** 0.75 - narrow**0.75)
        )

    def lag_loses(self, e: Any) -> Any:
        """Return the power (W, up to 3/2) that both lose at lagged slopes (V)."""
        w, square = self.w, abs(e) ** 2
        return square * (w.core_g[0] + w.excess[0] / (square + w.slope_width[0] ** 2) ** 0.25)

    def stiffness(self) -> float:
        """Return the shaft's, N m/rad."""
        return float(self.w.swing_rate[0] ** 2 / (self.w.motor_inv[0] + self.w.load_inv[0]))

    def at_start(self) -> None:
        """End the last segment, if there is one, and begin another."""
        now = [self.vector(x) for x in ("i", "core", "slow", "eddy", "ahead", "psi")]
        now.append(self.slope())
        if self.segment is not None:
            self.end(self.segment, self.begun, now)
        self.begun = now

    def in_middle(self, span: float, u: complex, own: complex) -> None:
        """Keep what a segment's middle says; u: the legs' levels, own: what of it the edge just
        taken changes."""
        w = self.w
        edges = [(own, min(w.late[0], span)), *self.waiting]
        edges = [(x, r) for x, r in edges if x != 0 and r > 0.0]
        self.segment = Middle(
            span,
            w.link[0],
            u,
            edges,
            *(self.vector(x) for x in ("psi", "j", "core")),
            float(w.core_stiff[0]),
        )
        self.waiting = []

    def end(self, middle: Middle, first: list[complex], last: list[complex]) -> None:
        """Add up a segment's powers: Gauss' rule between the instants at which edges act."""
        span, link, u, edges, psi, mid, core, _ = middle
        w, g, rate = self.w, middle.stiff, self.w.core_rate[0]

        def kinks(x: Any, of: list[tuple[complex, float]]) -> Any:
            """Return what late edges change at shares x of the segment, beside the straight
            line."""
            return (
                sum(change * (x * r / span - np.minimum(x, r / span)) for change, r in of) + 0j * x
            )

        flux = [(link * span * x, r) for x, r in edges]
        field = [(self.answers(psi, x), r) for x, r in flux]
        means = [sum(-0.5 * x * r / span * (1.0 - r / span) for x, r in of) for of in (flux, field)]
        a, b = first[0] - first[1], last[0] - last[1]
        up = (mid - core - means[1]) - 0.5 * (a + b)
        more = 1.5 * (core - g * means[0] - 0.5 * (first[1] + last[1]))
        steeper = (last[3] - first[3]) / span - rate * means[0] - 0.5 * (first[6] + last[6])
        dragged = abs((last[5] - last[4]) - (first[5] - first[4]))
        self.total["core"] += 1.5 * w.play[0] * w.play_reach[0] * dragged
        slower = span * w.skin_rate[0] * ((first[0] - first[2]) - (last[0] - last[2])) / 8.0
        corners = [0.0, *sorted(r / span for _, r in edges), 1.0]
        for start, stop in pairwise(corners):
            x = start + (stop - start) * 0.5 * (1.0 + PLACES)
            weight, bow = 0.5 * (stop - start) * span * WEIGHTS, 4.0 * x * (1.0 - x)
            eddy = first[1] + (last[1] - first[1]) * x + more * bow + g * kinks(x, flux)
            i = a + (b - a) * x + up * bow + kinks(x, field) + eddy
            slow = first[2] + (last[2] - first[2]) * x + slower * bow
            volts = link * (u - sum(change for change, r in edges if r / span >= stop))
            self.count("in", weight, 1.5 * (np.conj(volts) * i).real)
            winding = [ports.winding(w, 0, *pair(z)) for z in i]
            self.count("copper", weight, 1.5 * w.resistance[0] * abs(i) ** 2 + _power(winding, i))
            self.count("skin", weight, 1.5 * w.skin_r[0] * abs(i - slow) ** 2)
            slope = first[6] + (last[6] - first[6]) * x + 1.5 * steeper * bow
            slope = slope + rate * kinks(x, flux)
            self.count("core", weight, 1.5 * self.lag_loses(slope))
            self.count(
                "legs",
                weight,
                _power([losses.legs_lose(w, 0, 0.0, *pair(z), *pair(z)) for z in i], i),
            )

    def count(self, name: str, weight: Any, power: Any) -> None:
        """Add the integral of a power (W)."""
        self.total[name] += float(np.sum(weight * power))

    def answers(self, psi: complex, change: complex) -> complex:
        """Return by how much the magnetising current (A) grows with a small change of flux (Wb)."""
        h = 1e-4 * change
        return (self.magnetic(psi + h)[0] - self.magnetic(psi - h)[0]) / 2e-4

    def moved(self, span: float, before: tuple[float, float, float]) -> None:
        """Add up what the shaft does in a segment; before: its speeds and the twist's slope at the
        start."""
        w = self.w
        if self.rotor != "free":
            self.total["shaft"] += span * w.torque[0] * before[0]
            return
        now = (*self.speeds(), w.slip[0])
        omega, other, slip = (
            a + (b - a) * 0.5 * (1.0 + PLACES) for a, b in zip(before, now, strict=True)
        )
        rubbed = np.array([ports.friction(w, 0, x) * x for x in omega])
        if w.swing_rate[0] > 0.0:
            rubbed += 2.0 * w.swing_ratio[0] * self.stiffness() / w.swing_rate[0] * slip**2
        self.count("friction", 0.5 * span * WEIGHTS, rubbed)
        self.count("shaft", 0.5 * span * WEIGHTS, self.load * other)


def pair(z: complex) -> tuple[float, float]:
    """Return both parts of a vector."""
    return float(z.real), float(z.imag)


def _power(volts: list[tuple[float, float]], i: Any) -> Any:
    """Return the power (W) that drops (V) take from currents (A)."""
    return 1.5 * (np.conj([complex(*x) for x in volts]) * i).real
