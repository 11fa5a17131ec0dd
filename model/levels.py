"""Steady levels of a locked-rotor test, and what a fit to them returns.

A level is a stretch with constant bias current and periodic injected voltage; what is read of it
are the bias voltage and current and the slopes S (1/H), the ripple current per unit of flux ripple
(see `model.ripple`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.confidence import Z95
from model.energy import Energy
from model.errors import BadInput
from model.ripple import flux_ripple

NAMES = (
    "resistance",
    "inductance_d",
    "inductance_q",
    "alpha_30",
    "alpha_12",
    "alpha_40",
    "alpha_22",
    "alpha_04",
)
UNITS = dict(
    zip(NAMES, ("ohm", "H", "H", "A/Wb^2", "A/Wb^2", "A/Wb^3", "A/Wb^3", "A/Wb^3"), strict=True)
)


class Axis(IntEnum):
    """Along which axis a level lies."""

    D = 0
    Q = 1
    NONE = -1


D, Q, NONE = Axis
ON_AXIS = 0.08  # of the largest current: how far a level may lie from an axis to count as on it
AT_ZERO = 0.02  # of the largest current: how far from zero to count as at zero


class NoStaircase(BadInput):
    """Recordings that are right, but not the staircases that the method needs."""


@dataclass(frozen=True, repr=False)
class Levels:
    """Steady levels, n of them, in the rotor frame the encoder gives; arrays lead with n, second
    axis d, q."""

    period: float  # sampling period, s
    axis: NDArray[np.int64]  # injected axis: D, Q or NONE
    voltage: Array  # (n, 2) V, mean command
    current: Array  # (n, 2) A, mean reading
    slope: Array  # (n, 2) 1/H, ripple per unit of flux ripple along the injected axis
    voltage_sd: Array
    slope_sd: Array
    waveform: Array  # (n, N, 2) V, command over one injection period less its mean
    theta: Array  # (n,) rad, lock angle
    source: tuple[str, ...] = field(default=())  # (n,) recording

    def __repr__(self) -> str:
        return f"<Levels: {self.axis.size} levels, {len(set(self.source))} recordings>"

    @cached_property
    def flux(self) -> Array:
        """Sampled flux ripple (n, N) along the injected axis, V s."""
        return np.array(
            [
                flux_ripple(w[:, max(a, 0)], self.period)
                for w, a in zip(self.waveform, self.axis, strict=True)
            ]
        )

    def pick(self, axis: int, bias: int | None) -> NDArray[np.int64]:
        """Return the indices of levels injected on an axis with bias on `bias` alone (zero
        included), or at zero."""
        near = (AT_ZERO if bias is None else ON_AXIS) * np.max(np.hypot(*self.current.T))
        off = np.hypot(*self.current.T) if bias is None else np.abs(self.current[:, 1 - bias])
        return np.flatnonzero((self.axis == axis) & (off <= near))


@dataclass(frozen=True)
class Fit:
    """Estimated parameters: values and standard deviations by name (SI), covariance in the order of
    `names`."""

    method: str
    names: tuple[str, ...]
    values: dict[str, float]
    covariance: Array
    residual_rms: float  # A, peak of the ripple left unexplained
    # how many times its noise the worse of voltages and ripples leaves, 1 where noise explains all
    misfit: float
    nuisance: dict[str, float]
    residuals: Array  # (n, 2) A, peak of the ripple less its prediction at each level

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations by name."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    def ci95(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a parameter."""
        half = Z95 * self.sd[name]
        return self.values[name] - half, self.values[name] + half

    @property
    def energy(self) -> Energy:
        """The magnetic model found."""
        v = self.values
        return Energy(
            1.0 / v["inductance_d"], 1.0 / v["inductance_q"], *(float(v[n]) for n in NAMES[3:])
        )


def require_information(levels: Levels) -> None:
    """Raise NoStaircase naming the axis or the level without which parameters cannot be
    identified."""
    cases = (
        (D, D, "d", "d", "inductance_d, alpha_30 and alpha_40"),
        (D, Q, "d", "q", "alpha_12 and alpha_22"),
        (Q, Q, "q", "q", "inductance_q and alpha_04"),
    )
    scale = float(np.max(np.hypot(*levels.current.T), initial=0.0))
    for axis, bias, injected, biased, names in cases:
        rows = levels.pick(axis, bias)
        if rows.size == 0:
            raise NoStaircase(
                f"no steady level with injection on {injected} and bias on {biased}: "
                f"{names} cannot be identified; "
                f"record a bias staircase on {biased} with injection on {injected}"
            )
        i = levels.current[rows, bias]
        if scale == 0.0 or np.ptp(i) < 0.2 * scale or len(_distinct(i, ON_AXIS * scale)) < 3:
            found = ", ".join(f"{x:.3g}" for x in _distinct(i, ON_AXIS * scale))
            raise NoStaircase(
                f"the staircase on {biased} with injection on {injected} has levels at {found} A "
                f"only: {names} need at least three, well apart; add levels"
            )
        if (
            axis == D
            and bias == D
            and not (i.min() < -ON_AXIS * scale and i.max() > ON_AXIS * scale)
        ):
            side = "negative" if i.min() >= -ON_AXIS * scale else "positive"
            raise NoStaircase(
                f"the staircase on d with injection on d has no level at {side} i_d (range "
                f"{i.min():.3g} to {i.max():.3g} A): alpha_30 and alpha_40 cannot be told apart; "
                "add levels of both signs"
            )


def _distinct(values: Array, apart: float) -> list[float]:
    kept: list[float] = []
    for x in np.sort(values):
        if not kept or x - kept[-1] > apart:
            kept.append(float(x))
    return kept


def resistance_of(levels: Levels) -> tuple[float, float]:
    """Return R and its standard deviation (ohm) from the bias levels, u = R i + u_0 sign(i) along
    each level; BadInput where levels do not differ in current."""
    i = np.hypot(*levels.current.T)
    big = i > 0.15 * i.max()
    if big.sum() < 3 or np.ptp(i[big]) < 0.1 * i.max():
        raise BadInput(
            "the bias levels do not differ in current: resistance cannot be identified; add levels"
        )
    along = np.sum(levels.voltage * levels.current, axis=1)[big] / i[big]
    a = np.column_stack([i[big], np.ones(big.sum())])
    x, *_ = np.linalg.lstsq(a, along, rcond=None)
    spread = np.sum((along - a @ x) ** 2) / max(1, big.sum() - 2) + np.mean(levels.voltage_sd**2)
    return float(x[0]), math.sqrt(spread * np.linalg.inv(a.T @ a)[0, 0])
