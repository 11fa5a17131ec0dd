"""Which mechanical effects a motion shows: every set of those it can tell, weighed by what each
explains.

A set's evidence is its sum of squares over the scatter that the richest model leaves
(autocorrelation counted), with the usual penalty for each number.  What a motion cannot tell is
taken out before, with the reason and the remedy.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.effects.library import effect_names
from model.errors import BadInput, unknown
from sandbox.gap.motion.shaft import (
    STEADIEST,
    USUAL_WIDTH,
    Design,
    Nominal,
    Shaft,
    Terms,
    columns_of,
    design_of,
    fitted,
    reweighted,
    with_orders,
)
from sandbox.gap.motion.torques import (
    COGGING,
    DRY,
    INERTIA,
    LAG,
    VISCOUS,
    numbers,
    unidentifiable,
    users,
)
from sandbox.gap.motion.windows import OVERLAP, Averages, averages, white
from sandbox.recordings.motion_axis import LINEAR
from sandbox.recordings.motion_log import MotionCampaign

ORDINARY = 0.05  # relative deviation of a stated inertia or friction where the campaign states none
ALIKE = 0.05  # of a column's size: what nothing else can stand in for, least
LARGEST = 1e12  # rad/s^2, N m, ...: beyond it a unit is wrong
# times the noise: left without a word, and left by something unknown
SURE, DOUBTFUL = 1.3, 3.0
WRONG = "a unit or a sign is wrong, angle and current are stamped apart, or something else acts"
BY_STATES = "states that stand a little off their places repeat as it does; log an encoder's angle"
OF_LINEAR = "of a linear axis it is not looked for: its period is no part of a turn"
# widths of friction between two of them, and how often: places known beforehand, so that no
# rounding decides which is best
BETWEEN, FINER = 4, 2
HELD_OUT = 0.3  # of each recording, its end, where there are fewer than three


@dataclass(frozen=True)
class Weighed:
    """A set of effects with its probability (unknown not counted) and fit."""

    effects: tuple[str, ...]
    probability: float
    shaft: Shaft


@dataclass(frozen=True)
class Motion:
    """A judged motion.

    raw, before, after: rms over the noise on rows held out; by_recording: file, before,
    after, held out;
    cannot: effects that this motion cannot tell, why and what would; shares: of the gap's squares,
    each effect's.
    """

    campaign: MotionCampaign
    design: Design
    weighed: tuple[Weighed, ...]
    unknown: float
    nominal_nrmse: float
    before: float
    after: float
    by_recording: tuple[tuple[str, float, float, bool], ...]
    shares: dict[str, float]
    cannot: dict[str, str]
    excluded: tuple[str, ...]
    seconds: float

    @property
    def best(self) -> Weighed:
        """The most probable set."""
        return self.weighed[0]

    def looked_for(self, effect: str) -> bool:
        """Return whether any set holds an effect."""
        return any(effect in w.effects for w in self.weighed)

    def inclusion(self, effect: str) -> float:
        """Return the probability of all sets that hold an effect."""
        return sum(w.probability for w in self.weighed if effect in w.effects)


def judge(campaign: MotionCampaign, exclude: Sequence[str] = ()) -> Motion:
    """Return what a campaign's motion shows; BadInput where it hardly moves."""
    began = time.perf_counter()
    for name in exclude:
        _check_known(name)
    parts = _averaged(campaign)
    nominal = Nominal(
        campaign.inertia,
        campaign.viscous_friction,
        campaign.deviations.get(INERTIA.stated, ORDINARY),
        campaign.deviations.get(VISCOUS.stated, ORDINARY),
    )
    plain = design_of(parts)
    able, cannot = _identifiable(campaign, plain, nominal, exclude)
    whole, design = _richest(plain, plain, able, nominal)
    if beyond := _beyond(design, whole, nominal, able):
        cannot |= beyond
        able = [e for e in able if e not in beyond]
        whole, design = _richest(plain, design, able, nominal)
    sets = _sets(design, able, whole, nominal)
    sizes = _Sizes(plain, design, nominal, _noise_std(design, sets[0].shaft), _held_out(parts))
    left = sizes.left(sets, whole)
    after = left[sets[0].effects]
    return Motion(
        campaign,
        design,
        tuple(sets),
        float(np.clip((after - SURE) / (DOUBTFUL - SURE), 0.02, 0.98)),
        sizes.of(_as_stated(design, nominal), sizes.out),
        left[()],
        after,
        tuple(sizes.by_recording(sets[0].shaft.terms)),
        _shares(left, sets[0].effects),
        cannot,
        tuple(exclude),
        time.perf_counter() - began,
    )


def _averaged(campaign: MotionCampaign) -> list[Averages]:
    """Return what windows of each recording have in the mean; BadInput where numbers are beyond
    what can be, or nothing moves."""
    with np.errstate(all="ignore"):  # what is no number is refused below
        parts = [averages(r, campaign) for r in campaign.recordings]
    for a in parts:
        if not all(
            np.all(np.abs(x) < LARGEST)
            for x in (a.acceleration, a.torque, a.slope, a.speed, a.kernel)
        ):
            raise BadInput(
                f"{a.file}: speeds or torques beyond {LARGEST:g} (SI); check the units "
                "of t, theta and i_q"
            )
    turned = max(float(np.ptp(a.angle)) for a in parts)
    if turned < campaign.axis.least:
        moved = f"{campaign.axis.moves} by {turned:.2g} {campaign.axis.unit('rad')} at most"
        raise BadInput(f"{campaign.name}: {moved}; record it moving")
    return parts


def _identifiable(
    campaign: MotionCampaign, plain: Design, nominal: Nominal, exclude: Sequence[str]
) -> tuple[list[str], dict[str, str]]:
    """Return the effects that a motion can tell, and why it cannot tell the others."""
    cannot = _cannot(plain, nominal, exclude)
    if any(r.sixth for r in campaign.recordings):
        cannot[COGGING.effect] = BY_STATES
    if campaign.axis is LINEAR:
        cannot[COGGING.effect] = OF_LINEAR
    able = [e for e in numbers() if e not in cannot and e not in exclude]
    whole = _terms(able, _width(plain, able, nominal, ()), ())
    design = reweighted(plain, fitted(plain, whole, nominal))
    driving = _driving(design, whole, nominal, able)
    return [e for e in able if e not in driving], {**cannot, **driving}


@dataclass(frozen=True)
class _Sizes:
    """What shafts leave of a motion, over its noise; plain: equations that nothing has weighted;
    held: rows (n,) that are not fitted here."""

    plain: Design
    design: Design
    nominal: Nominal
    noise_std: Array
    held: NDArray[np.bool_]

    @property
    def out(self) -> NDArray[np.bool_]:
        """The rows that are judged: those held out, all where there are none."""
        return self.held if np.any(self.held) else np.ones(len(self.held), bool)

    @cached_property
    def kept(self) -> Design:
        """The equations of the rows that are fitted here."""
        return self.design.only(~self.held)

    def of(self, shaft: Shaft, rows: NDArray[np.bool_]) -> float:
        """Return the rms over the noise of rows, with a shaft's own values."""
        _, columns, _, _ = columns_of(self.plain, shaft.terms, Nominal(1.0, 0.0, 0.0, 0.0))
        rest = (self.plain.torque - columns @ shaft.values) / self.noise_std
        return float(np.sqrt(np.mean(rest[rows] ** 2)))

    def fitted(self, terms: Terms) -> Shaft:
        """Return the shaft with these terms, fitted to the rows that are not held out."""
        return fitted(self.kept, terms, self.nominal)

    def left(self, sets: Sequence[Weighed], whole: Terms) -> dict[tuple[str, ...], float]:
        """Return what every set leaves, and every part of the most probable one."""
        width = whole.dry or self.design.widths[0]
        terms = {e: _terms(e, width, whole.orders) for e in _subsets(sets[0].effects)}
        terms |= {w.effects: w.shaft.terms for w in sets}
        return {e: self.of(self.fitted(t), self.out) for e, t in terms.items()}

    def by_recording(self, best: Terms) -> Iterator[tuple[str, float, float, bool]]:
        """Yield each recording with what no effect and the best set leave, and whether it was held
        out."""
        none, some = self.fitted(Terms()), self.fitted(best)
        for k, a in enumerate(self.design.averages):
            own = self.design.owner == k
            yield a.file, self.of(none, own), self.of(some, own), bool(np.all(self.held[own]))


def _subsets(effects: Sequence[str]) -> list[tuple[str, ...]]:
    """Return every set of some of the effects, possible by itself or not."""
    return [e for count in range(len(effects) + 1) for e in itertools.combinations(effects, count)]


def _check_known(name: str) -> None:
    if name not in effect_names():
        raise unknown("effect", name, effect_names())


def _terms(effects: Sequence[str], width: float, orders: tuple[int, ...]) -> Terms:
    return Terms(
        INERTIA.effect in effects,
        VISCOUS.effect in effects,
        width if DRY.effect in effects else None,
        LAG.effect in effects,
        orders if COGGING.effect in effects else (),
        tuple(n.size for n in users() if n.effect in effects),
    )


def _held_out(parts: Sequence[object]) -> NDArray[np.bool_]:
    """Return the rows that are not fitted: every third recording, or the end of each where there
    are fewer."""
    lengths = [len(a.torque) for a in parts]  # type: ignore[attr-defined]
    if len(parts) >= 3:
        return np.concatenate([np.full(n, k % 3 == 2) for k, n in enumerate(lengths)])
    return np.concatenate([np.arange(n) >= (1.0 - HELD_OUT) * n for n in lengths])


def _scaled(design: Design, whole: Terms, nominal: Nominal) -> Design:
    """Return the equations weighted so that the richest model's squares count as independent rows
    of scatter one."""
    richest = fitted(design, whole, nominal)
    scale = richest.chi2 / max(int(np.count_nonzero(design.weight)), 1) * richest.inflation
    return replace(design, weight=design.weight / math.sqrt(max(float(scale), 1e-300)))


def _width(design: Design, able: Sequence[str], nominal: Nominal, orders: tuple[int, ...]) -> float:
    """Return the width of dry friction that leaves least."""
    if DRY.effect not in able:
        return design.widths[0]
    widths = design.widths

    def left(width: float) -> float:
        """Return the sum of squares that a width leaves."""
        return fitted(design, _terms(able, width, orders), nominal).chi2

    for _ in range(1 + FINER):
        best = min(range(len(widths)), key=[left(w) for w in widths].__getitem__)
        low, high = widths[max(best - 1, 0)], widths[min(best + 1, len(widths) - 1)]
        found, widths = widths[best], tuple(np.geomspace(low, high, 2 * BETWEEN + 1))
    return found


def _richest(
    plain: Design, design: Design, able: Sequence[str], nominal: Nominal
) -> tuple[Terms, Design]:
    """Return the model that has every effect, and the equations weighted by what it leaves."""
    whole = _terms(able, _width(plain, able, nominal, ()), ())
    for _ in range(2):
        design = _scaled(reweighted(plain, fitted(design, whole, nominal)), whole, nominal)
        if COGGING.effect in able:
            whole = with_orders(design, replace(whole, orders=()), nominal)
        whole = _terms(able, _width(design, able, nominal, whole.orders), whole.orders)
    return whole, _scaled(reweighted(plain, fitted(design, whole, nominal)), whole, nominal)


def _driving(design: Design, whole: Terms, nominal: Nominal, able: Sequence[str]) -> dict[str, str]:
    """Return frictions that would drive the motion instead of braking it, each with the size that
    says so."""
    out = {}
    shaft = fitted(design, whole, nominal)
    for effect, n in numbers().items():
        if n.brakes and effect in able and shaft.ci95(n.size)[1] < 0.0:
            out[effect] = (
                f"it would drive the motion ({shaft.value(n.size):.3g} {n.unit}): the current's "
                "sign is reversed, or something else acts"
            )
    return out


def _beyond(design: Design, whole: Terms, nominal: Nominal, able: Sequence[str]) -> dict[str, str]:
    """Return effects whose sizes would lie outside their bounds, each with the size that says
    so."""
    out = {}
    shaft = fitted(design, whole, nominal)
    for effect, n in numbers().items():
        if effect not in able or not n.size:
            continue
        (low, high), p = shaft.ci95(n.size), n.of_library
        if high < p.low or low > p.high:
            side = (
                f"below what can be ({p.low:g})"
                if high < p.low
                else f"beyond what can be ({p.high:g})"
            )
            out[effect] = f"its size would be {shaft.value(n.size):.3g} {n.unit}, {side}: {WRONG}"
    return out


def _possible(shaft: Shaft, effects: Sequence[str]) -> bool:
    """Return whether the sizes of effects lie inside their bounds: at a bound an effect says
    nothing, or too much."""
    known = (numbers()[e] for e in effects)
    return all(
        n.of_library.low <= shaft.value(n.size) <= n.of_library.high for n in known if n.size
    )


def _cannot(design: Design, nominal: Nominal, exclude: Sequence[str]) -> dict[str, str]:
    """Return the effects that others could stand in for on this motion, each with why and what
    would tell it."""
    base = [np.ones(len(design.torque))]
    if nominal.inertia is None:
        base.append(design.acceleration)
    columns = {
        DRY.effect: design.dry(USUAL_WIDTH * design.fastest),
        INERTIA.effect: design.acceleration,
        VISCOUS.effect: design.speed,
        LAG.effect: design.slope,
        **{n.effect: design.of_users[n.size] for n in users()},
    }
    known, found = numbers(), unidentifiable()
    if nominal.inertia is None:
        found[INERTIA.effect] = (
            "no inertia is stated, so there is none to differ from; its value is estimated"
        )
    for name, column in columns.items():
        if name in found or name in exclude:
            continue
        q, _ = np.linalg.qr(np.stack(base, axis=1))
        alone = float(np.linalg.norm(column - q @ (q.T @ column)))
        if not alone > ALIKE * float(np.linalg.norm(column)):
            found[name] = known[name].hidden
        else:
            base.append(column)
    return found


def _sets(design: Design, able: Sequence[str], whole: Terms, nominal: Nominal) -> list[Weighed]:
    """Return every set of effects, the most probable first."""
    able = [e for e in able if e != COGGING.effect or whole.orders]
    rows = int(np.count_nonzero(design.weight))
    richest = fitted(design, _terms(able, whole.dry or design.widths[0], whole.orders), nominal)
    effective = max(rows / richest.inflation, 2.0)
    size: dict[str, int] = {COGGING.effect: 2 * len(whole.orders), DRY.effect: 2}
    found = []
    for count in range(len(able) + 1):
        for effects in itertools.combinations(able, count):
            shaft = fitted(
                design, _terms(effects, whole.dry or design.widths[0], whole.orders), nominal
            )
            if not _possible(shaft, effects):
                continue
            penalty = sum(size.get(e, 1) for e in effects) * math.log(effective)
            found.append((-0.5 * (shaft.chi2 + shaft.strain + penalty), effects, shaft))
    top = max(f[0] for f in found)
    weights = [math.exp(f[0] - top) for f in found]
    total = sum(weights)
    weighed = [Weighed(e, w / total, s) for w, (_, e, s) in zip(weights, found, strict=True)]
    return sorted(weighed, key=lambda w: -w.probability)


def _as_stated(design: Design, nominal: Nominal) -> Shaft:
    """Return the model as stated, nothing fitted."""
    exact = replace(
        nominal, inertia=nominal.inertia or 0.0, inertia_deviation=0.0, viscous_deviation=0.0
    )
    shaft = fitted(design, Terms(), exact)
    values = shaft.values.copy()
    values[shaft.names.index("offset")] = 0.0
    return replace(shaft, values=values)


def _noise_std(design: Design, shaft: Shaft) -> Array:
    """Return each row's noise (N m rms): the stated current noise, and that of the angle times the
    inertia.

    Where no current noise is stated, what changes at random between windows that share no row
    counts: 1 is then a residual without structure.  A recording too short to tell, or in which
    nothing changes, has the others' noise.
    """
    out = np.empty(len(design.torque))
    seen = np.array(
        [white(shaft.residual[design.owner == k][::OVERLAP]) for k in range(len(design.averages))]
    )
    positive = seen[seen > 0.0]
    usual = (
        float(np.median(positive)) if positive.size else float(np.sqrt(np.mean(shaft.residual**2)))
    )
    for k, a in enumerate(design.averages):
        known = np.hypot(shaft.value(INERTIA.size) * a.noise_acceleration, a.noise_torque)
        random = (
            0.0
            if np.any(a.noise_torque)
            else max(seen[k], STEADIEST * usual)
            if seen[k] > 0.0
            else usual
        )
        out[design.owner == k] = np.maximum(known, random)
    return out


def _shares(sizes: dict[tuple[str, ...], float], best: tuple[str, ...]) -> dict[str, float]:
    """Return each effect's share of what the best set takes off the squares, mean over orders of
    adding (Shapley)."""
    gap = sizes[()] ** 2 - sizes[best] ** 2
    if not best or not gap > 0.0:
        return dict.fromkeys(best, 0.0)
    out = {}
    for e in best:
        others, total = [x for x in best if x != e], 0.0
        for count in range(len(others) + 1):
            weight = (
                math.factorial(count)
                * math.factorial(len(others) - count)
                / math.factorial(len(best))
            )
            for some in itertools.combinations(others, count):
                with_e = tuple(x for x in best if x in (*some, e))
                without = tuple(x for x in best if x in some)
                total += weight * (sizes[without] ** 2 - sizes[with_e] ** 2)
        out[e] = total / gap
    return out
