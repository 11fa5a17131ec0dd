"""What remains after the best hypothesis, and how likely it is that something outside the library is at work.

Named effects can imitate a missing one until nothing remains.  Of 24 single effects taken out of the library on an
opened check three were imitated by three others, none by one or two (but for twins, `withheld.judge`): with something
outside the library at work in one campaign of forty, half a case where none was seen, and the priors of
`subsets.NUMBER` that makes odds of 0.025 (1/48, 1/48, 1/8)/(0.27, 0.1, 0.03), rounded in IMITATED.  Ordinary
deviations then often have to help, further than they usually go: one of them, it is not known which, is drawn from a
Gaussian of STRETCH standard deviations rather than one.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sandbox.gap.evidence.fit import Fit, stray
from sandbox.gap.evidence.gap_size import DRAWS, FEWEST, UNDEFINED, rms, squares
from sandbox.gap.evidence.noise import PLAUSIBLE, Noise
from sandbox.gap.evidence.normal import Normal
from sandbox.replay.inputs import counted, with_columns
from sandbox.replay.replay import Prepared, replay

Array = NDArray[np.float64]
# Of J^2: what the simulator misses of a bench.  With true effects fitted, 35 campaigns of the switched bench (practice
# cycles) lie within 0.5 % of the floor, twelve of the independent bench within 1.1 % (2.1 % at a gap of 421, hence
# SHARE).
FLOOR = 0.008
SHARE = 3e-5  # of the gap before: what it misses of an effect it knows
# Odds that so many named effects only imitate what is missing; more than three count as three.
IMITATED = (0.0, 0.002, 0.005, 0.1)
COUNTS = 4096  # of half a PWM period: usual, and seldom logged
STRETCH = 4.0  # standard deviations of a deviation that imitation stretches
# Logistic against the logarithm of the remainder over what it misses: constant and slope, from the practice recordings
# and sixty campaigns made as they are.  P(unknown) is 0.036 where what is left is what it misses, 0.5 at 2.3 times.
WEIGHTS = (-3.3, 4.0)


@dataclass(frozen=True)
class Unexplained:
    """Share of the gap that nothing in the library explains, 0 to 1, what the simulator is known to miss taken off; its
    95 % interval, None where a gap is too near to what the simulator misses for one."""

    value: float
    ci95: tuple[float, float] | None


@dataclass(frozen=True)
class Remainder:
    """Excess J^2 - 1 before and after on all recordings, share explained, P(unknown); share that nothing explains, None
    where no gap stands above what the simulator is known to miss."""

    before: float
    after: float
    explained: float
    unknown: float
    share: Unexplained | None = None


def unlogged_counts(prepared: Prepared) -> Array:
    """Return by recording (r,) the squares over the floor that a PWM counter of COUNTS leaves in currents by rounding
    duties; none where the campaign states one.

    Rounding is replayed as a voltage that comes beside the commands; it depends on link, period and inductance alone.
    """
    if prepared.campaign.drive.converter.pwm_counts is not None:
        return np.zeros(len(prepared.recordings))
    coarse = []
    for r in prepared.recordings:
        duty = {name: counted(r.track[name], COUNTS) for name in ("d_a", "d_b", "d_c")}
        coarse.append(dataclasses.replace(r, track=with_columns(r.track, duty)))
    one, other = (replay(p, [{}]).currents for p in (prepared, dataclasses.replace(prepared, recordings=tuple(coarse))))
    squares = np.array([float(np.sum((a - b) ** 2)) for a, b in zip(one, other, strict=True)])
    return squares / prepared.floor**2 if np.all(np.isfinite(squares)) else np.zeros(len(squares))


def rounded(after: Normal, unlogged: Array) -> float:
    """Return the excess J^2 that rounding of duties may have left in a fit; unlogged: as `unlogged_counts` returns it.

    Rounding leaves its share in every recording.  So it counts only so many times as recordings show, at most once: by
    the factor of least absolute deviations through the origin, which is the median over recordings of excess over
    rounding, weighted by the latter.  What another cause leaves in recordings of less than half the weight, it does not
    excuse; what one leaves in most recordings, it does.
    """
    shown = np.zeros(len(unlogged))
    for s in after.segments:
        if s.channel == "current":
            shown[s.recording] += float(s.rr.sum() - s.n.sum())
    own = np.flatnonzero(unlogged > 0.0)
    if not own.size:
        return 0.0
    order = own[np.argsort(shown[own] / unlogged[own])]
    middle = order[np.searchsorted(np.cumsum(unlogged[order]), 0.5 * unlogged.sum())]
    times = min(1.0, max(0.0, float(shown[middle] / unlogged[middle])))
    return times * float(unlogged.sum()) / _count(after)


def remainder(before: Fit, after: Fit, least: float | None = None) -> Remainder:
    """Return what remains of the gap, on all recordings; before, after: fits to all of them, without and with the best
    hypothesis; least: excess J^2 that may be left (`allowed` where it is not given: noise and counts as stated)."""
    every = range(1 + max(s.recording for s in before.normal.segments))
    j0, j1 = rms(before.normal, every) ** 2 - 1.0, rms(after.normal, every) ** 2 - 1.0
    least = allowed(after.normal) if least is None else least
    ratio = max(j1, 1e-4) / (least + SHARE * max(j0, 0.0))
    odds = math.exp(WEIGHTS[0] + WEIGHTS[1] * math.log(ratio))
    if after.effects:
        odds += IMITATED[min(len(after.effects), len(IMITATED) - 1)] * stretched(after)
    unknown = 1.0 - 1.0 / (1.0 + odds)
    explained = min(1.0, max(0.0, 1.0 - j1 / j0)) if j0 > 0.0 else 0.0
    return Remainder(j0, j1, explained, unknown, unexplained(before.normal, after.normal, least))


def allowed(after: Normal, noise: Noise | None = None, unlogged: Array | None = None) -> float:
    """Return the excess J^2 that a simulator may leave without a gap.

    What it misses of any bench, one standard deviation of noise's own square, and by how much the floor that is used
    (twice, as squares count) differs from the noise that readings show, are independent; rounding of duties that the
    campaign does not state (`unlogged_counts`) comes on top.
    """
    apart = 0.0 if noise is None or noise.seen is None else abs(math.log(noise.used / noise.seen))
    if apart > math.log(PLAUSIBLE):  # the stated noise stands alone
        apart = 0.0
    coarse = 0.0 if unlogged is None else rounded(after, unlogged)
    return math.hypot(FLOOR, math.sqrt(2.0 / _count(after)), 2.0 * apart) + coarse


def _count(n: Normal) -> float:
    """Return the number of residuals."""
    return sum(float(s.n.sum()) for s in n.segments)


def unexplained(before: Normal, after: Normal, least: float, seed: int = 0) -> Unexplained | None:
    """Return the share of the gap on all recordings that is left beyond what the simulator misses.

    least: excess J^2 that it may leave (`allowed`).  None without a gap beyond that.  The interval is a bootstrap over
    blocks of time, as that of the share closed; draws without a gap have no share, and where these are more than
    UNDEFINED, or of fewer than FEWEST blocks, there is no interval.
    """
    every = range(1 + max(s.recording for s in before.segments))
    (a, n), (b, _) = squares(before, every), squares(after, every)
    pick = np.random.default_rng(seed).integers(len(n), size=(DRAWS, len(n)))
    pick = np.concatenate([np.arange(len(n))[None], pick])  # first of all the recordings themselves
    gap, left = (x[pick].sum(1) / n[pick].sum(1) - 1.0 for x in (a, b))
    there = gap > least
    if not there[0] or not np.isfinite(left[0]):
        return None
    share = np.clip((left - least) / np.where(there, gap, np.nan) - SHARE, 0.0, 1.0)
    low, high = (float(x) for x in np.nanpercentile(share[1:], [2.5, 97.5]))
    told = len(n) >= FEWEST and np.mean(~there) <= UNDEFINED
    return Unexplained(float(share[0]), (low, high) if told else None)


def stretched(after: Fit) -> float:
    """Return how much likelier the ordinary deviations of a fit are if one of them was stretched than if none was."""
    z = np.array([x for _, x in stray(after).values()])
    wider = np.exp(0.5 * z**2 * (1.0 - STRETCH**-2)) / STRETCH
    return float(np.mean(wider)) if wider.size else 0.0
