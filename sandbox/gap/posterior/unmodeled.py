"""How likely it is that something outside the library is at work: a part of the model, weighed by
its evidence.

Each recording leaves an excess e = J^2 - 1 beyond noise.  With all causes named, e is what the
replay misses: a Pareto distribution (Lomax's, of heavy tail) with a mean that is known
(`Settings.misses`, and what a flux map's fine error is likely to leave), plus the scatter of
noise's own square.  With a cause outside the library, a
share f of the recordings (prior: Jeffreys), nobody knows which, has an excess of any order of
magnitude (log-uniform up to `Settings.farthest`).  The Bayes factor is the mean over f of the
product over recordings.

A cause outside can also hide: named effects imitate it (`Settings.imitated` for each of them), and
an ordinary deviation has to go further than it usually does to make up for the rest.  One of them,
it is not known which, is then drawn from a Gaussian of `Settings.stretch` standard deviations.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import expit

from model.array_types import Array
from model.spline_correction import MapError
from sandbox.gap.evidence.fit import Fit, stray
from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.settings import USUAL, Settings

DECADES = 1e3  # times the mean miss: as far as the grid goes to either side of it at least
GRID = 400  # values of an excess, evenly in its logarithm: a tenth of a decade and less
# of recordings in which an outside cause shows: Jeffreys
SHARES = np.sin(0.5 * np.pi * (np.arange(100) + 0.5) / 100.0) ** 2


def unmodeled(before: Fit, after: Fit, noise: float = 0.0, settings: Settings = USUAL) -> float:
    """Return the posterior probability of a cause outside the library beside a fitted set.

    before, after: fits to all recordings without and with the set; noise: by how much of itself the
    noise's square may be misstated.
    """
    shown = math.log(settings.unknown / (1.0 - settings.unknown))
    shown += log_bayes_factor(
        before.normal, after.normal, noise, settings, map_left(after.point.prepared.map_error)
    )
    if not after.effects:
        return float(expit(shown))
    hidden = math.log(settings.imitated * len(after.effects)) + log_stretched(after, settings)
    return float(expit(np.logaddexp(shown, hidden)))


def map_left(error: MapError | None) -> float:
    """Return the mean excess J^2 - 1 that what the motor's flux map is off by beside its modes is
    likely to leave; 0 without a map.

    Modes come in the order of what recordings tell of them: where the last half of them turns out
    larger than is likely, so is what comes after.
    """
    if error is None:
        return 0.0
    last = error.x[len(error.x) // 2 :]
    return error.beyond * max(1.0, float(np.mean(last**2)))


def log_bayes_factor(
    before: NormalEquations,
    after: NormalEquations,
    noise: float,
    settings: Settings = USUAL,
    beyond: float = 0.0,
) -> float:
    """Return the log Bayes factor of a cause outside from what a fit leaves; beyond: what the
    replay misses in the mean beside `Settings.misses`."""
    gap, _ = excess(before)
    left, count = excess(after)
    left = np.maximum(left, 0.0)  # less than noise says nothing of causes
    known = settings.misses + beyond + settings.misses_of_gap * np.maximum(gap, 0.0)
    scatter = np.hypot(np.sqrt(2.0 / count), noise)
    densities = np.array(
        [_log_densities(*x, settings) for x in zip(left, scatter, known, strict=True)]
    )
    per = densities[:, 1] - densities[:, 0]
    mixed = np.logaddexp(np.log(SHARES)[:, None] + per, np.log1p(-SHARES)[:, None]).sum(1)
    return float(np.logaddexp.reduce(mixed) - math.log(len(SHARES)))


def excess(n: NormalEquations) -> tuple[Array, Array]:
    """Return J^2 - 1 of every recording (r,), all its channels together, and how many readings that
    is."""
    squares, count = n.by_recording()
    return squares / count - 1.0, count


def _log_densities(
    e: float, scatter: float, mean: float, settings: Settings
) -> tuple[float, float]:
    """Return the log density of an excess that is a miss of the replay, and of one that a cause
    outside makes.

    A cause outside leaves what the replay misses in the mean, or more: up to `Settings.farthest`,
    at least DECADES times as much.
    """
    farthest = max(settings.farthest, DECADES * mean)
    z = np.linspace(math.log(mean / DECADES), math.log(farthest), GRID)
    size, step = np.exp(z), z[1] - z[0]
    wide = np.hypot(scatter, 0.5 * step * size)  # no gaps between the grid's values
    likelihood = -0.5 * ((e - size) / wide) ** 2 - np.log(wide * math.sqrt(math.tau))
    scale = mean * (settings.tail - 1.0)
    misses = (
        math.log(settings.tail / scale)
        - (settings.tail + 1.0) * np.log1p(size / scale)
        + z
        + math.log(step)
    )
    outside = np.where(size >= mean, math.log(step / math.log(farthest / mean)), -np.inf)
    return float(np.logaddexp.reduce(likelihood + misses)), float(
        np.logaddexp.reduce(likelihood + outside)
    )


def log_stretched(after: Fit, settings: Settings = USUAL) -> float:
    """Return by how much the ordinary deviations of a fit are likelier (log) if one of them was
    stretched than if none was; at least 0: nothing speaks against an outside cause that ordinary
    deviations need not make up for."""
    z = np.array([x for _, x in stray(after).values()])
    wider = 0.5 * z**2 * (1.0 - settings.stretch**-2) - math.log(settings.stretch)
    return max(0.0, float(np.logaddexp.reduce(wider) - math.log(z.size))) if z.size else 0.0
