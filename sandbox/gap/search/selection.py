"""Which sets of effects explain a campaign: searched by algebra, fitted, linearised anew, until the best set stands.

At a fit's point the equations of all effects say which set of any size is most probable (`subsets`), the data
counting for as much less as the residual stands above the noise and the simulator's own error grows with the gap.
That set is fitted in full; at its point the equations are taken anew.  Effects whose shape or size slopes cannot tell
(delays, orders, frequencies) keep their starts, tried again once much of the gap has closed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from model.errors import BadInput
from sandbox.gap.evidence.discrepancy import allowed
from sandbox.gap.evidence.fit import Fit, Weights, attempted, excess, fit, rms_of
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.evidence.spike_slab import Table, table
from sandbox.gap.search.forward import FAR, WORTH, Search, choose
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.neighbours import MOST
from sandbox.gap.search.points import starting, towards, unbent
from sandbox.gap.search.posterior import ACCURATE
from sandbox.gap.search.subsets import STILL, Subsets, log_prior

PROMISED = 2  # sets fitted at a point that algebra holds more probable than the one there
ROUNDS = 7  # points at which all effects' equations are taken
AGAIN = 2.0  # times that the residual beyond noise has to fall before effects' starts are looked for anew
PRICE = 5.0  # log evidence that one more effect costs, about: its prior and the width it gives up
ALONE = 2  # effects that a rival with shapes to find may have to be fitted from ordinary deviations, too
RIVALS, TURNS = 3, 2  # rivals fitted at a time; times that they are looked for
HOPELESS = 15.0  # tempered log evidence behind which a fit is not weighed, unless algebra holds it near (NEAR)
LEAST, OPEN = 1, 0.2  # effects and chance of `unknown` from which a search goes on
# Share of the gap that the few effects leave, below which more effects have to bring it: where the search of few ended
# by itself, and where it stopped at MOST effects, so that more are likely.  Set on opened campaigns.
CLOSES = (0.5, 0.8)
STRANGE = 0.9  # chance of `unknown` from which on rivals are not fitted: `stranger` says what stands beside it
# Simulations after which no further point is looked at, counted anew where the squared residual beyond noise has fallen
# by GOES_ON times: a fit that closes a fifth of what is left leads on.  Where it had to fall by half, a search of eight
# effects whose fits closed a third each ended at 2.2 floors with a wrong one (w011 of seed 20262103).
SPENT, GOES_ON = 900, 1.25
NEAR, DOUBTED = 5.0, 30.0  # tempered log evidence behind the best: of any set, of one with an effect left out
Key = tuple[str, ...]


@dataclass
class Selection:
    """A search under way: fits by set, the best of them, starts of effects, size of the others' traces, simulations."""

    best: Fit
    chosen: list[Probe]
    share: float
    weights: Weights
    workers: int
    raw: float
    cost: float = 0.0
    fits: dict[Key, Fit] = field(default_factory=dict)
    exclude: tuple[str, ...] = ()
    looked: float = math.inf  # rms where starts were last looked for

    def temperature(self) -> float:
        """Return for how much less the data counts at the best fit's point."""
        return max(rms_of(self.best) ** 2, 1.0 + self.raw / ACCURATE)

    def table(self) -> Table:
        """Return the equations of all effects at the best fit's point."""
        own = table(self.best.point, self.chosen, self.best.effects, self.share, self.weights, self.workers)
        self.cost += own.normal.simulations
        return own

    def look(self) -> bool:
        """Look for effects' starts where the residual has fallen since and is more than the simulator is known to miss
        of any bench; return whether."""
        level = rms_of(self.best)
        if level**2 - 1.0 < allowed(self.best.normal) or AGAIN**2 * (level**2 - 1.0) > self.looked**2 - 1.0:
            return False
        again, spent = choose(self.best, self.exclude, self.weights, self.workers)
        kept = [p for p in self.chosen if p.effect in self.best.effects]
        self.chosen = kept + [p for p in again if p.effect not in self.best.effects]
        self.cost, self.looked = self.cost + spent, level
        return True

    def fitted(self, key: Key) -> Fit | None:
        """Return the fit of a set, from the best fit's point; None where no drive can have it."""
        if key not in self.fits:
            new = [p for p in self.chosen if p.effect in key and p.effect not in self.best.effects]
            point = towards(self.best, key, self.chosen)
            sized = new[0].sized if len(new) == 1 else None
            at = point if sized is None else replace(point, values={**point.values, **sized})
            found = attempted(
                at, key, self.weights, smooth=bool(sized), leader=self.best.objective, workers=self.workers
            )
            if found is not None:
                self.fits[key], self.cost = found, self.cost + found.simulations
        return self.fits.get(key)


def widened(
    found: Search, raw: float, weights: Weights, *, exclude: Sequence[str] = (), workers: int = 1,
    report: Callable[[str], None] = lambda _: None,
) -> Search:  # fmt: skip
    """Return a search of few effects continued where these leave much of a gap, or where more effects beside them
    promise more; the sets that stand a chance judged.

    Nothing is added where more effects close little more and leave a gap: so a cause outside the library looks.  Nor
    are rivals fitted where the best set leaves a gap that only something outside the library explains.
    raw: normalised rms of the nominal model.
    """
    few = max(found.judged, key=lambda j: j.log_evidence)
    fits = {j.effects: j.fit for j in found.judged}
    own = [replace(p, sized=None, gain=0.0) for p in found.chosen]
    s = Selection(few.fit, own, found.share, weights, workers, raw, found.simulations, fits, tuple(exclude))
    s.looked = found.looked
    if few.effects and s.look():
        with suppress(BadInput):  # at a new start some effect leaves a drive that none can be
            few = judged_of(s, few.fit)
    open_ = found.remainder(few.fit).unknown >= OPEN
    if len(few.effects) < LEAST or not (open_ or promising(s, few.table, found.fitted)):
        return replace(found, simulations=s.cost)
    select(s, few.table, report)
    closes = CLOSES[len(few.effects) >= MOST]
    if s.best is few.fit or (rms_of(s.best) > FAR and excess(s.best) > closes * excess(few.fit)):
        return replace(found, simulations=s.cost)
    report("weighing hypotheses")
    try:
        top = judged_of(s, s.best)
    except BadInput:
        return replace(found, simulations=s.cost)
    judged = {j.effects: j for j in (*found.judged, few)} | {top.effects: top}
    for _ in range(TURNS if found.remainder(s.best).unknown < STRANGE else 0):
        behind = rivals(s, top)
        for key in [k for k in behind if k not in judged][:RIVALS]:
            s.best = top.fit
            other = from_starts(s, key, found.null)
            if other is not None and (behind[key] < NEAR or told(s, other) > told(s, top.fit) - HOPELESS):
                with suppress(BadInput):  # beside its point some effect leaves a drive that none can be
                    judged[key] = judged_of(s, other)
        best = max(judged.values(), key=lambda j: j.tempered(s.temperature()) + log_prior(j.effects))
        if best is top:
            break
        top = best
    return replace(
        found, judged=tuple(judged.values()), simulations=s.cost, fitted=found.fitted | set(s.fits),
        chosen=tuple(s.chosen), looked=s.looked,
    )  # fmt: skip


def promising(s: Selection, here: Table, fitted: Collection[Key]) -> bool:
    """Return whether algebra holds the few effects with more beside them, a set not fitted so far, more probable: what
    they leave may be small and still tell of one more."""
    near, few = Subsets(here, s.temperature()), s.best.effects
    near.climb(few)
    level = near.weigh(few)
    return any(x > level + STILL and set(k) > set(few) and k not in fitted for k, x in near.known.items())


def select(s: Selection, here: Table, report: Callable[[str], None] = lambda _: None) -> None:
    """Move a search to the best set it finds; here: the equations of all effects at its start.

    A point beside which some effect leaves a drive that none can be (no flux for a current) is gone back from.
    """
    limit, before, level = s.cost + SPENT, s.best, excess(s.best)
    for turn in range(ROUNDS):
        if s.cost > limit:
            return
        try:
            at, moved, before = here if not turn else s.table(), False, s.best
        except BadInput:
            s.best = before
            return
        for key in proposals(s, at):
            report(f"fitting {' + '.join(key)}")
            found = s.fitted(key)
            if found is not None and better(s, found):
                s.best, moved = found, True
                break
        if GOES_ON * excess(s.best) < level:
            limit, level = s.cost + SPENT, excess(s.best)
        looked = s.look()
        if not moved and not looked:
            return


def proposals(s: Selection, here: Table) -> list[Key]:
    """Return the sets to fit next: what algebra holds most probable, then what the sizes that were tried point to."""
    t = s.temperature()
    beside = Subsets(here, t)
    beside.climb(s.best.effects)
    level = beside.weigh(s.best.effects)
    ranked = sorted(beside.known, key=lambda k: -beside.known[k])
    out = [k for k in ranked if beside.known[k] > level and k not in s.fits][:PROMISED]
    if rms_of(s.best) > FAR:
        own = sorted((p for p in s.chosen if p.effect not in s.best.effects), key=lambda p: -p.gain)
        if own and own[0].gain > 0.0:
            out.append(tuple(sorted({*s.best.effects, own[0].effect})))
        out.append(Subsets(here, t, alone=True).climb(s.best.effects)[0])
    return [k for k in dict.fromkeys(out) if k not in s.fits]


def better(s: Selection, new: Fit) -> bool:
    """Return whether a new fit is worth its effects: tempered objective, and a price for each."""
    t = s.temperature()
    gained = 0.5 * (s.best.objective - new.objective) / t
    return gained > PRICE * (len(new.effects) - len(s.best.effects))


def judged_of(s: Selection, found: Fit) -> Judged:
    """Return a fit weighed with all effects beside it."""
    own = judge(found, s.chosen, s.share, s.weights, s.workers)
    s.cost += own.simulations
    return own


def told(s: Selection, f: Fit) -> float:
    """Return how well a fit tells the data, roughly: its tempered objective and the price of its effects."""
    return -0.5 * f.objective / s.temperature() - PRICE * len(f.effects)


def rivals(s: Selection, best: Judged) -> dict[Key, float]:
    """Return the sets near the best one by the equations at its point, the most probable first, with the tempered log
    evidence by which they are behind: any set a little behind, and those that leave one effect out unless the
    recordings are clear about it; never one with more effects of which the recordings say nothing."""
    near = Subsets(best.table, s.temperature())
    level = near.weigh(best.effects)
    near.climb(best.effects)
    for effect in best.effects:
        near.weigh(e for e in best.effects if e != effect)
    reach = {k: DOUBTED if set(k) < set(best.effects) and len(k) == len(best.effects) - 1 else NEAR for k in near.known}
    told = {k: x - log_prior(k) for k, x in near.known.items()}
    unseen = {k for k in told if set(k) > set(best.effects) and told[k] < told[best.effects] + WORTH}
    found = [k for k in near.known if near.known[k] > level - reach[k] and k != best.effects and k not in unseen]
    return {k: level - near.known[k] for k in sorted(found, key=lambda k: -near.known[k])}


def from_starts(s: Selection, key: Key, null: Fit) -> Fit | None:
    """Return the best of two fits of a rival: from the best set's point, and from ordinary deviations alone."""
    first = s.fitted(key)
    several = {p.effect for p in s.chosen if p.start}
    if not several & set(key) or len(key) > ALONE or not set(key) < set(s.best.effects):
        return first
    try:
        at = starting(unbent(null.point), key, s.chosen)
        other = fit(at, key, s.weights, leader=s.best.objective, workers=s.workers)
    except BadInput:
        return first
    s.cost += other.simulations
    if first is None or other.objective < first.objective:
        s.fits[key] = other
    return s.fits[key]
