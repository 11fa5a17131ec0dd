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

from sandbox.gap.evidence.fit import Fit, stray
from sandbox.gap.evidence.gap_size import DRAWS, UNDEFINED, rms, squares
from sandbox.gap.evidence.normal import Normal
from sandbox.replay.inputs import counted, with_columns
from sandbox.replay.replay import Prepared, replay

FLOOR = 0.012  # of J^2: what the simulator misses of a bench without a gap
SHARE = 3e-4  # of the gap before: what it misses of an effect it knows
IMITATED = (0.0, 0.002, 0.005, 0.1)  # odds that so many named effects only imitate what is missing
COUNTS = 4096  # of half a PWM period: usual, and seldom logged
STRETCH = 4.0  # standard deviations of a deviation that imitation stretches
WEIGHTS = (-3.3, 4.0)  # logistic: constant, slope against the logarithm of the remainder over what it misses


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


def unlogged_counts(prepared: Prepared) -> float:
    """Return the excess J^2 that a PWM counter of COUNTS leaves by rounding duties; none where the campaign states one.

    Rounding is replayed as a voltage that comes beside the commands; it depends on link, period and inductance alone.
    """
    if prepared.campaign.drive.converter.pwm_counts is not None:
        return 0.0
    rounded = []
    for r in prepared.recordings:
        duty = {name: counted(r.track[name], COUNTS) for name in ("d_a", "d_b", "d_c")}
        rounded.append(dataclasses.replace(r, track=with_columns(r.track, duty)))
    one, other = (
        replay(p, [{}]).currents for p in (prepared, dataclasses.replace(prepared, recordings=tuple(rounded)))
    )
    squares = sum(float(np.sum((a - b) ** 2)) for a, b in zip(one, other, strict=True))
    excess = squares / prepared.floor**2 / (3.0 * prepared.samples)
    return excess if math.isfinite(excess) else 0.0


def remainder(before: Fit, after: Fit, unlogged: float = 0.0) -> Remainder:
    """Return what remains of the gap, on all recordings; before, after: fits to all of them, without and with the best
    hypothesis; unlogged: excess J^2 that ordinary rounding may leave."""
    every = range(1 + max(s.recording for s in before.normal.segments))
    j0, j1 = rms(before.normal, every) ** 2 - 1.0, rms(after.normal, every) ** 2 - 1.0
    ratio = max(j1, 1e-4) / missed(j0, unlogged)
    odds = math.exp(WEIGHTS[0] + WEIGHTS[1] * math.log(ratio))
    if after.effects:
        odds += IMITATED[min(len(after.effects), len(IMITATED) - 1)] * stretched(after)
    unknown = odds / (1.0 + odds)
    explained = min(1.0, max(0.0, 1.0 - j1 / j0)) if j0 > 0.0 else 0.0
    return Remainder(j0, j1, explained, unknown, unexplained(before.normal, after.normal, unlogged))


def missed(gap: float, unlogged: float) -> float:
    """Return the excess J^2 that the simulator is known to miss of a gap (excess J^2 before)."""
    return FLOOR + unlogged + SHARE * max(gap, 0.0)


def unexplained(before: Normal, after: Normal, unlogged: float = 0.0, seed: int = 0) -> Unexplained | None:
    """Return the share of the gap on all recordings that is left beyond what the simulator misses.

    None without a gap beyond that.  The interval is a bootstrap over blocks, as that of the share closed; draws without
    a gap have no share, and where these are more than UNDEFINED there is no interval.
    """
    every = range(1 + max(s.recording for s in before.segments))
    (a, n), (b, _) = squares(before, every), squares(after, every)
    pick = np.random.default_rng(seed).integers(len(n), size=(DRAWS, len(n)))
    pick = np.concatenate([np.arange(len(n))[None], pick])  # first of all the recordings themselves
    gap, left = (x[pick].sum(1) / n[pick].sum(1) - 1.0 for x in (a, b))
    there = gap > FLOOR + unlogged
    if not there[0] or not np.isfinite(left[0]):
        return None
    share = np.clip((left - FLOOR - unlogged) / np.where(there, gap, np.nan) - SHARE, 0.0, 1.0)
    low, high = (float(x) for x in np.nanpercentile(share[1:], [2.5, 97.5]))
    return Unexplained(float(share[0]), (low, high) if np.mean(~there) <= UNDEFINED else None)


def stretched(after: Fit) -> float:
    """Return how much likelier the ordinary deviations of a fit are if one of them was stretched than if none was."""
    z = np.array([x for _, x in stray(after).values()])
    wider = np.exp(0.5 * z**2 * (1.0 - STRETCH**-2)) / STRETCH
    return float(np.mean(wider)) if wider.size else 0.0
