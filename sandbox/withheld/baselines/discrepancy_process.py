"""A discrepancy as a Gaussian process over the operating point, integrated out of a campaign's
normal equations.

Kennedy and O'Hagan (J. R. Stat. Soc. B 63 (2001) 425) with the replay linearised at a point,

    r = J b + delta(z) + e,   b ~ N(prior),   delta_c ~ GP(0, s_c^2 k),   e ~ N(0, 1),
    k(z, z') = exp(-|z - z'|^2 / 2),   z = (i_d / l_i, i_q / l_i, speed / l_w, cos theta / l_a, sin theta / l_a),

an independent delta for each component c: d and q current, motion of a free rotor, angle of a
driven one; all in noise floors.  Random features phi (n, f) with phi phi' = k in the mean (Rahimi,
Recht, NIPS 2007) make delta = phi w, w ~ N(0, s^2).  With A = J'J, C = J'phi, G = phi'phi and
B = (G + I / s^2)^-1, integrating w out leaves

    A - C B C',   J'r - C B phi'r,   r'r - r'phi B phi'r,   and -1/2 log det(I + s^2 G) of log evidence.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from model.array_types import Array
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.normal import NormalEquations, ParameterPoint, simulated
from sandbox.gap.evidence.regression import in_rotor_frame
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import replay, residuals
from sandbox.replay.segments import channel

# random ones, a cosine and a sine each: they miss the kernel by at most 1/sqrt(2 64) = 0.09 (rms)
FREQUENCIES = 64
CURRENTS = ("d", "q")  # components whose discrepancy has the amplitude of currents


class Scales(NamedTuple):
    """Amplitudes of the discrepancy (in noise floors) of currents and of motions, lengths over
    which it changes: of currents (in rated current), of speed (in top speed), of the angle's cosine
    and sine."""

    currents: float
    motions: float
    length_current: float
    length_speed: float
    length_angle: float

    def times(self, factor: float) -> Scales:
        """Return the same with amplitudes so many times larger."""
        return self._replace(currents=factor * self.currents, motions=factor * self.motions)

    def amplitude(self, component: str) -> float:
        """Return the amplitude of a component."""
        return self.currents if component in CURRENTS else self.motions


class Where(NamedTuple):
    """Operating points z (n, 5) of one recording before lengths divide them, and the rotor's angle
    theta (n,)."""

    z: Array
    theta: Array


class Component(NamedTuple):
    """One component of one recording: slopes j (n, q) of the coordinates at places (q,), residual y
    (n,), z (n, 5)."""

    component: str
    places: NDArray[np.int64]
    j: Array
    y: Array
    z: Array


class Gram(NamedTuple):
    """Products of features with slopes C (p, f), with each other G (f, f), with the residual
    (f,)."""

    cross: Array
    own: Array
    pull: Array


@dataclass(frozen=True)
class WithDiscrepancy:
    """Normal equations of a point and the products of every component's features there."""

    normal: NormalEquations
    grams: dict[str, Gram]

    def marginal(self, scales: Scales) -> tuple[Algebra, float]:
        """Return the equations with the discrepancy integrated out, and what it adds to the log
        evidence."""
        return marginal(Algebra(*self.normal.summed(), self.normal.x), self.grams, scales)

    def log_evidence(self, scales: Scales, prior: Prior) -> float:
        """Return the log evidence but for the constant -n/2 log 2 pi."""
        found, more = self.marginal(scales)
        return found.log_evidence(prior) + more


def marginal(a: Algebra, grams: dict[str, Gram], scales: Scales) -> tuple[Algebra, float]:
    """Return equations with the discrepancy integrated out, and -1/2 log det(I + s^2 G) of all
    components."""
    left, g, ssr, more = a.a.copy(), a.g.copy(), a.ssr, 0.0
    for component, (cross, own, pull) in grams.items():
        s2 = scales.amplitude(component) ** 2
        factor = cho_factor(np.eye(len(own)) + s2 * own, lower=True)
        solved = s2 * cho_solve(factor, np.column_stack([cross.T, pull]))
        left -= cross @ solved[:, :-1]
        g -= cross @ solved[:, -1]
        ssr -= float(pull @ solved[:, -1])
        more -= float(np.sum(np.log(np.diag(factor[0]))))
    return Algebra(left, g, ssr, a.x), more


def frequencies(seed: int = 0) -> Array:
    """Return the random frequencies (F, 5) of a kernel whose lengths are 1."""
    return np.random.default_rng(seed).standard_normal((FREQUENCIES, 5))


def features(z: Array, scales: Scales, drawn: Array) -> Array:
    """Return the features (n, 2 F) of operating points z (n, 5)."""
    _, _, i, speed, angle = scales
    phase = (z / np.array([i, i, speed, angle, angle])) @ drawn.T
    return np.concatenate([np.cos(phase), np.sin(phase)], axis=1) / np.sqrt(len(drawn))


def places_of(point: ParameterPoint) -> list[Where]:
    """Return the operating points of every recording as a point predicts them, so that no noise
    explains itself."""
    turned = point.turned()
    read = [c[:, :, 0] for c in replay(turned, [point.values]).currents]
    simulated(1.0)
    rated = turned.campaign.drive.motor.rated_current
    top = max(1e-9, *(float(np.max(np.abs(r.motion.speed))) for r in turned.recordings))
    out = []
    for r, currents in zip(turned.recordings, read, strict=True):
        theta = r.motion.angle
        i = np.sqrt(2.0 / 3.0) * in_rotor_frame(currents, theta) / rated
        speed = r.motion.speed * np.ones(len(theta)) / top
        out.append(Where(np.column_stack([i, speed, np.cos(theta), np.sin(theta)]), theta))
    return out


def parts_of(
    point: ParameterPoint, n: NormalEquations, where: Sequence[Where]
) -> Iterator[Component]:
    """Yield the components of every recording; n: normal equations at the point, with their slopes.

    The sum of three phases has no discrepancy: it is not an operating point's current.
    """
    shown = residuals(point.prepared, replay(point.turned(), [point.values]))
    simulated(1.0)
    for s, rows in zip(n.segments, n.rows, strict=True):
        z, theta = where[s.recording]
        y = channel(shown[s.recording], s.channel)
        j = np.asarray(rows[: y.size]).reshape(*y.shape, -1)
        if s.channel != "current":
            yield Component(s.channel, s.places, j[:, 0], y[:, 0], z)
            continue
        axes = np.sqrt(2.0 / 3.0) * LEGS @ np.array([1.0, 1j])
        turned = np.exp(-1j * theta)[:, None] * axes[None, :]
        for component, own in (("d", turned.real), ("q", turned.imag)):
            yield Component(
                component, s.places, np.einsum("ncq,nc->nq", j, own), np.sum(y * own, axis=1), z
            )


def grams_of(parts: Iterable[Component], p: int, scales: Scales, drawn: Array) -> dict[str, Gram]:
    """Return the products of features over parts, by component; p: how many coordinates there
    are."""
    f, out = 2 * len(drawn), dict[str, Gram]()
    for part in parts:
        phi = features(part.z, scales, drawn)
        found = out.setdefault(
            part.component, Gram(np.zeros((p, f)), np.zeros((f, f)), np.zeros(f))
        )
        found.cross[part.places] += part.j.T @ phi
        found.own[:] += phi.T @ phi
        found.pull[:] += phi.T @ part.y
    return out


def thinned(parts: Iterable[Component], most: int) -> list[Component]:
    """Return about so many evenly spread instants of every component together."""
    every = list(parts)
    step = max(1, sum(len(p.y) for p in every) // most)
    return [
        Component(p.component, p.places, p.j[::step].copy(), p.y[::step], p.z[::step])
        for p in every
    ]


def equations(parts: Sequence[Component], p: int) -> tuple[Array, Array, float]:
    """Return A (p, p), g (p,) and r'r of parts alone."""
    a, g, ssr = np.zeros((p, p)), np.zeros(p), 0.0
    for part in parts:
        a[np.ix_(part.places, part.places)] += part.j.T @ part.j
        g[part.places] += part.j.T @ part.y
        ssr += float(part.y @ part.y)
    return a, g, ssr


def learnt(
    parts: Sequence[Component], x: Array, prior: Prior, drawn: Array, begin: Scales, tries: int
) -> Scales:
    """Return the scales of most evidence on parts, the coordinates under their priors; by Nelder
    and Mead's simplex."""
    from scipy.optimize import minimize

    plain = Algebra(*equations(parts, len(x)), x)

    def lost(logs: Array) -> float:
        """Return minus the log evidence of the logarithms of scales."""
        scales = Scales(*map(float, np.exp(logs)))
        found, more = marginal(plain, grams_of(parts, len(x), scales, drawn), scales)
        return -(found.log_evidence(prior) + more)

    # a move of one e-fold first; amplitudes and lengths are not asked for closer than 5 %
    start = np.log(np.array(begin))
    simplex = np.vstack([start, start + np.eye(len(start))])
    options = {"initial_simplex": simplex, "maxfev": tries, "xatol": 0.05, "fatol": 0.5}
    return Scales(
        *map(float, np.exp(minimize(lost, start, method="Nelder-Mead", options=options).x))
    )
