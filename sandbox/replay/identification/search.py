"""Gauss and Newton on the replayed currents of ordinary recordings, and how far what is found
may be off."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from model.array_types import Array
from model.confidence import Z95
from model.errors import BadInput, PhysicsError
from sandbox.replay.identification.places import ANGLE, NAMES, OF_EFFECT, OFFSET_OF, Place
from sandbox.replay.inputs import Inputs
from sandbox.replay.replay import Prepared, replay, residuals

BLOCKS = 40  # blocks of time that all recordings are cut into, for the scatter of what they say
STEPS, ENOUGH = 40, 1e-3  # of Gauss and Newton; in standard deviations
SHARE = 1e-3  # of a parameter: the step of its slope
FARTHEST = math.log(3.0)  # of a parameter in one step


class Search:
    """Gauss and Newton on the replayed currents, over places (`Place`) of the motor's parameters
    and of what stands beside.

    Slopes are differences of replays that run together.
    """

    def __init__(
        self, prepared: Prepared, names: Sequence[str], places: Mapping[str, Place], workers: int
    ) -> None:
        self.prepared, self.names, self.workers = prepared, list(names), workers
        self.motor, self.places = prepared.campaign.drive.motor, places
        own = [places[n] for n in names]
        self.logs = np.array([p.form == "log" for p in own])
        self.x = np.array([p.begin for p in own])
        self.centre = np.array([p.centre for p in own])
        self.prior = np.array([p.deviation for p in own])
        self.step = SHARE * np.where([n in NAMES for n in names], 1.0, self.prior)
        self.least, self.most = np.array([p.low for p in own]), np.array([p.high for p in own])
        self.r = np.empty(0)

    def of_others(self, names: Sequence[str]) -> Search:
        """Return a search of other parameters that begins where this one stands."""
        other = Search(self.prepared, names, self.places, self.workers)
        here = dict(zip(self.names, self.x, strict=True))
        other.x = np.array([here.get(n, v) for n, v in zip(other.names, other.x, strict=True)])
        return other

    def values(self, x: Array | None = None) -> dict[str, float]:
        """Return parameters and what stands beside at a place."""
        at = self.x if x is None else x
        return {n: self.places[n].value(float(v)) for n, v in zip(self.names, at, strict=True)}

    def as_set(self, x: Array, angle: str) -> dict[str, float]:
        """Return a place as the replay takes it for the recordings of one angle."""
        out: dict[str, float] = {}
        for n, v in self.values(x).items():
            if n.startswith(ANGLE):
                out |= {OFFSET_OF: v} if n == ANGLE + angle else {}
                continue
            scale = getattr(self.motor, n) if n.startswith("inductance_") else 1.0
            out[OF_EFFECT.get(n, n)] = v / scale
        return out

    def residuals(self, points: Sequence[Array]) -> Array:
        """Return residuals (n, places) of all currents over the noise."""
        shown = []
        for angle, own in itertools.groupby(self.prepared.recordings, self._own_angle):
            part = replace(self.prepared, recordings=tuple(own))
            shown += residuals(
                part, replay(part, [self.as_set(x, angle) for x in points], workers=self.workers)
            )
        return np.concatenate([t.current.reshape(-1, len(points)) for t in shown])

    def tried(self, x: Array) -> Array:
        """Return residuals (n,) at a place; not finite where no flux of its motor gives the first
        readings."""
        try:
            return self.residuals([x])[:, 0]
        except BadInput:
            return np.full_like(self.r, np.nan)

    def _own_angle(self, r: Inputs) -> str:
        """Return the name of a recording's angle where its zero is fitted, empty where it was
        read."""
        return r.angle_name if ANGLE + r.angle_name in self.names else ""

    def cost(self, r: Array, x: Array) -> float:
        """Return half the squares, those of nuisances' priors with them."""
        return 0.5 * float(r @ r + np.sum(((x - self.centre) / self.prior) ** 2))

    def slopes(self) -> Array:
        """Return slopes (n, p) at the place, and keep the residual there."""
        step = np.where(self.x + self.step > self.most, -self.step, self.step)
        every = self.residuals([self.x, *(self.x + np.diag(step))])
        self.r = every[:, 0]
        return np.asarray((every[:, 1:] - every[:, :1]) / step)

    def found(self) -> Search:
        """Go to the place of the least squares; PhysicsError where none is found."""
        for _ in range(STEPS):
            j = self.slopes()
            weight = 1.0 / self.prior**2
            # seconds beside volts are no small direction
            size = np.sqrt(np.sum(j**2, axis=0) + weight)
            inner = (j.T @ j + np.diag(weight)) / np.outer(size, size) + 1e-9 * np.eye(len(size))
            down = -(j.T @ self.r + weight * (self.x - self.centre)) / size
            if not (np.all(np.isfinite(inner)) and np.all(np.isfinite(down))):
                raise PhysicsError(
                    "these recordings and the nominal motor go nowhere together; check "
                    "[motor] and units"
                )
            move = self.linear_step(inner, down, size)
            before, share = self.cost(self.r, self.x), 1.0
            while share > 1e-3:
                place = self.bounded(self.x + share * move)
                r = self.tried(place)
                if np.all(np.isfinite(r)) and self.cost(r, place) <= before:
                    break
                share *= 0.5
            else:
                break
            gone = before - self.cost(r, place)
            self.x, self.r = place, r
            if gone < ENOUGH * max(1.0, before / len(r)):
                break
        self.j = self.slopes()
        return self

    def linear_step(self, inner: Array, down: Array, size: Array) -> Array:
        """Return the step that solves the linear problem inside the bounds, logarithms by FARTHEST
        at most.  Steps are scaled by size: a step cut at a bound afterwards would go elsewhere."""
        root = np.linalg.cholesky(inner)
        farthest = np.where(self.logs, FARTHEST, np.inf)
        low = size * np.maximum(self.least - self.x, -farthest)
        high = size * np.minimum(self.most - self.x, farthest)
        solved = lsq_linear(root.T, np.linalg.solve(root, down), (low, high))
        return np.asarray(solved.x / size)

    def bounded(self, x: Array) -> Array:
        """Return a place inside the bounds."""
        return np.asarray(np.clip(x, self.least, self.most))

    def deviations(self) -> tuple[Array, Array]:
        """Return the standard deviation of each place, and the covariance (p, p) of what noise and
        priors leave open.

        Three parts: the priors' and the noise's; where blocks of time scatter by more than noise,
        theirs (the "sandwich" of White, Econometrica 48 (1980) 817); and what the model lacks.
        Of that the fit shows the part which no parameter can stand for, and hides the rest in
        them: the 95 % interval takes as much to be hidden as is shown, all of it in the one
        parameter.
        """
        weight = np.diag(1.0 / self.prior**2)
        information = self.j.T @ self.j
        covariance = np.asarray(np.linalg.inv(information + weight), dtype=np.float64)
        cuts = np.array_split(np.arange(len(self.r)), BLOCKS)
        g = np.stack([self.j[c].T @ self.r[c] for c in cuts])
        scatter = np.diag(covariance @ (g.T @ g + weight) @ covariance)
        lacks = len(self.r) * max(self.square() - 1.0, 0.0) / Z95**2
        hidden = lacks * np.diag(covariance @ information @ covariance)
        return np.sqrt(np.maximum(np.diag(covariance), scatter) + hidden), covariance

    def relative(self, size: Array) -> Array:
        """Return standard deviations of places as those of values over the values."""
        return np.where(self.logs, size, size / np.maximum(np.abs(self.x), 1e-9))

    def square_at_start(self) -> float:
        """Return the mean square of what the start leaves, over the noise's; infinite where it
        predicts nothing."""
        r = self.residuals([self.x])
        return float(np.mean(r**2)) if np.all(np.isfinite(r)) else math.inf

    def at_bound(self, k: int) -> bool:
        """Tell whether a parameter stands at a bound."""
        return bool(self.x[k] <= self.least[k] or self.x[k] >= self.most[k])

    def square(self) -> float:
        """Return the mean square of what is left, over the noise's."""
        return float(np.mean(self.r**2))

    def residual_rms(self) -> dict[str, float]:
        """Return each recording's rms, over the noise."""
        out, at = {}, 0
        for r in self.prepared.recordings:
            n = 3 * r.samples
            out[r.file] = float(np.sqrt(np.mean(self.r[at : at + n] ** 2)))
            at += n
        return out
