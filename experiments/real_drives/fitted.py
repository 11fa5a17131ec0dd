"""A fitted value with its unit and interval, and the delete-one-block jackknife the intervals come
from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student


@dataclass(frozen=True)
class Fitted:
    """A value in SI units with its 95 % interval; `basis` says in a few words what the interval
    accounts for."""

    value: float
    low: float
    high: float
    unit: str
    basis: str

    def text(self, scale: float = 1.0, unit: str | None = None) -> str:
        """Return 'value ± half interval unit', scaled for print."""
        half = 0.5 * (self.high - self.low) * scale
        return f"{self.value * scale:.3g} ± {half:.2g} {self.unit if unit is None else unit}"

    def record(self) -> dict[str, Any]:
        """Return the content for a JSON file."""
        return asdict(self)


def interval(value: float, error: float, freedom: int, unit: str, basis: str) -> Fitted:
    """Return a fitted value from its standard error and degrees of freedom (Student's t)."""
    half = float(student.ppf(0.975, max(freedom, 1))) * float(error)
    return Fitted(float(value), float(value) - half, float(value) + half, unit, basis)


def jackknife(
    fit: Callable[[np.ndarray], np.ndarray], blocks: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (values (n,), standard errors (n,)) of `fit(mask)`, leaving out one block of samples
    at a time.

    `blocks` (samples,) numbers the block of each sample; residuals may be correlated inside a
    block, not across.
    """
    names = np.unique(blocks)
    left_out = np.array([fit(blocks != name) for name in names])
    spread = np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0)
    return fit(np.ones(len(blocks), bool)), np.sqrt((len(names) - 1) / len(names) * spread)
