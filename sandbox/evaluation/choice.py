"""Which estimator for this motor: every one's worst figures, which are as good as the best, in
sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from model.errors import BadInput
from sandbox.evaluation.score import Row

# degrees, share of the best's: nearer is no reason to choose (seeds differ by 0.09 degrees)
NEAR_DEG, NEAR = 0.2, 0.2
MANY = 4  # names that a sentence holds
SLIGHT = 0.2  # degrees of the worst mean error: less is no gain to speak of


class Costed(Protocol):
    """Whatever has the largest costs of an injection: dB of the proxy for its sound, W of loss;
    None: not known."""

    @property
    def sound_db(self) -> float | None:
        """The sound."""

    @property
    def loss_w(self) -> float | None:
        """The loss."""


class Limits(NamedTuple):
    """What an estimator may cost to be recommended: sound (dB of the proxy) and added loss (W);
    None: anything."""

    quiet_below: float | None = None
    loss_below: float | None = None

    def broken_by(self, s: Costed) -> str:
        """Return which of them an estimator breaks, in words; nothing where it keeps both."""
        parts = []
        if (
            self.quiet_below is not None
            and s.sound_db is not None
            and s.sound_db > self.quiet_below
        ):
            parts.append(f"is louder ({s.sound_db:.3g} dB) than {self.quiet_below:g} dB")
        if self.loss_below is not None and s.loss_w is not None and s.loss_w > self.loss_below:
            parts.append(f"adds {s.loss_w:.3g} W, more than {self.loss_below:g} W")
        return " and ".join(parts)


ANY = Limits()


def limits_of(quiet_below: float | None, loss_below: float | None) -> Limits:
    """Return limits (dB, W); BadInput for a number that is none."""
    if quiet_below is not None and not math.isfinite(quiet_below):
        raise BadInput(
            f"quiet_below = {quiet_below:g} is not finite; give dB of the sound proxy, such as 30"
        )
    if loss_below is not None and not (math.isfinite(loss_below) and loss_below >= 0.0):
        raise BadInput(f"loss_below = {loss_below:g} is out of range; give W, at least 0")
    return Limits(quiet_below, loss_below)


@dataclass(frozen=True)
class Standing:
    """The worst of one estimator with one belief over its evaluated segments; degrees electrical.

    worst_mean, worst_p95: None where no segment was in lock; at: the segment of the worst mean;
    then the largest costs of the injection, see `injection_cost` (None where no segment could
    tell).
    """

    estimator: str
    belief: str
    closed_loop: bool
    stretches: int
    lost: int
    missed: int  # segments whose speed was not reached
    worst_mean: float | None
    worst_p95: float | None
    at: Row | None
    loss_w: float | None = None
    loss_share: float | None = None
    torque_ripple: float | None = None
    sound_db: float | None = None
    tone_db: float | None = None
    link_a: float | None = None
    injected_v: float | None = None

    @property
    def kept(self) -> bool:
        """Whether lock and speed were kept throughout."""
        return not self.lost and not self.missed and self.worst_p95 is not None


def standings(rows: Iterable[Row]) -> tuple[Standing, ...]:
    """Return the worst figures of each estimator, belief and loop, in the order of the rows."""
    groups: dict[tuple[str, str, bool], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.estimator, row.belief, row.closed_loop), []).append(row)
    return tuple(_standing(*key, own) for key, own in groups.items())


def _standing(estimator: str, belief: str, closed: bool, rows: Sequence[Row]) -> Standing:
    held = [r for r in rows if r.error_deg.mean is not None]
    at = max(held, key=lambda r: abs(r.error_deg.mean or 0.0), default=None)
    return Standing(
        estimator,
        belief,
        closed,
        len(rows),
        sum(r.lost_lock for r in rows),
        sum(not r.reference_held and not r.lost_lock for r in rows),
        None if at is None else abs(at.error_deg.mean or 0.0),
        max((r.error_deg.p95 or 0.0 for r in held), default=None),
        at,
        **_costs(rows),
    )


def _costs(rows: Iterable[Row]) -> dict[str, float | None]:
    """Return the largest costs over segments, by their names."""
    costs = [row.cost for row in rows if row.cost is not None]
    names = ("loss_w", "loss_share", "torque_ripple", "sound_db", "tone_db", "link_a", "injected_v")
    return {name: max((float(getattr(c, name)) for c in costs), default=None) for name in names}


def best(found: Iterable[Standing], limits: Limits = ANY) -> tuple[Standing, ...]:
    """Return those that keep lock, speed and limits with the estimate in control and err as little
    as the best does.

    The measure is the worst 95th percentile of the error's size; the best is first, the others are
    within NEAR_DEG or NEAR of it.
    """
    able = (s for s in found if s.closed_loop and s.kept and not limits.broken_by(s))
    kept = [(s.worst_p95, s) for s in able if s.worst_p95 is not None]
    kept.sort(key=lambda pair: pair[0])
    if not kept:
        return ()
    bound = max(kept[0][0] + NEAR_DEG, kept[0][0] * (1.0 + NEAR))
    return tuple(s for p95, s in kept if p95 <= bound)


def which(found: Sequence[Standing], limits: Limits = ANY) -> str:
    """Return which estimator to take within limits, in one or two sentences."""
    chosen = best(found, limits)
    out = [s for s in found if s.closed_loop and not s.kept]
    dear = [s for s in found if s.closed_loop and s.kept and limits.broken_by(s)]
    if not chosen and dear:
        return f"None of these within the limits.{_out([*out, *dear], limits)}"
    if not chosen:
        return (
            "None of these: no estimator kept lock and speed in all of it with its estimate "
            "in control."
        )
    worst = max(s.worst_p95 or 0.0 for s in chosen)
    text = (
        f"{clause_of(chosen)}: in every segment within {worst:.2g}° of the true position 95 "
        "% of the time, "
    )
    text += "the estimate in control."
    if len(chosen) > 1:
        text += (
            " They are too near each other to choose by error: take the cheaper or the more "
            "robust one, which "
        )
        text += "`sensorless protocol` measures."
    return text + _out([*out, *dear], limits)


def _out(found: Sequence[Standing], limits: Limits) -> str:
    """Return why estimators are no choice, nothing where there is none."""
    reasons = [f"{clause_of([s])} {limits.broken_by(s) if s.kept else why_out(s)}" for s in found]
    return f" Out: {'; '.join(reasons)}." if reasons else ""


def clause_of(chosen: Sequence[Standing]) -> str:
    """Return estimators and what they believe as one clause."""
    groups: dict[str, list[str]] = {}
    for s in chosen:
        groups.setdefault(s.belief, []).append(s.estimator)
    return either(
        [f"{either(few(names))} with the {belief} belief" for belief, names in groups.items()]
    )


def few(names: Sequence[str]) -> list[str]:
    """Return names, from the MANY-th on only how many."""
    return (
        [*names] if len(names) <= MANY else [*names[: MANY - 1], f"{len(names) - MANY + 1} others"]
    )


def far_off(s: Standing) -> str:
    """Return how far one estimator is off, in one sentence."""
    control = "the estimate" if s.closed_loop else "the encoder"
    if s.worst_p95 is None:
        return f"It {why_out(s)}, {control} in control."
    missed = (
        f", but the rotor's own speed was not the one asked for in {s.missed} of "
        f"{s.stretches} stretches"
    )
    kept = f"It kept lock{missed * bool(s.missed)}" if not s.lost else f"It {why_out(s)}"
    return (
        f"{kept}, {control} in control: the mean error is at most {_size(s)}, and in every stretch "
        f"in lock 95 % of the time the position is within {s.worst_p95:.2g}°."
    )


def either(texts: Sequence[str]) -> str:
    """Return alternatives as one clause."""
    return f"{', '.join(texts[:-1])} or {texts[-1]}" if len(texts) > 1 else texts[0]


def why_out(s: Standing) -> str:
    """Return why an estimator is no choice."""
    lost = f"lost lock in {s.lost} of {s.stretches} segments" if s.lost else ""
    missed = f"missed the speed in {s.missed} of {s.stretches} segments" if s.missed else ""
    return ", ".join(text for text in (lost, missed) if text) or "nothing in lock"


def gained(found: Sequence[Standing]) -> str:
    """Return what believing the saturated model brings over the linear one, estimator by
    estimator."""
    own = {(s.estimator, s.belief): s for s in found if s.closed_loop}
    pairs = []
    for name in dict.fromkeys(s.estimator for s in found):
        linear, saturated = own.get((name, "linear")), own.get((name, "saturated"))
        if linear is None or saturated is None:
            continue
        pairs.append((linear, saturated))
    if not pairs:
        return "Only one belief was run."
    gains = [
        a.worst_mean - b.worst_mean
        for a, b in pairs
        if a.worst_mean is not None and b.worst_mean is not None
    ]
    head = _heading(gains)
    if len(pairs) > MANY:
        linear_, saturated_ = (_range([pair[k] for pair in pairs]) for k in (0, 1))
        return f"{head} Linear → saturated belief: {linear_} → {saturated_}."
    parts = [f"{a.estimator} {_size(a)}{_lost(a)} → {_size(b)}{_lost(b)}" for a, b in pairs]
    return f"{head} Linear → saturated belief: {'; '.join(parts)}."


def _heading(gains: Sequence[float]) -> str:
    """Return whether worst mean errors fall or grow; gains: degrees by which each falls."""
    falls, grows = any(g > SLIGHT for g in gains), any(g < -SLIGHT for g in gains)
    if falls and grows:
        return "The worst mean error falls for some and grows for others."
    if grows:
        return "The worst mean error grows."
    return (
        "The worst mean error falls."
        if falls or not gains
        else "Nothing to speak of on this motor here."
    )


def _range(found: Sequence[Standing]) -> str:
    """Return the least and the most of worst mean errors, and whose they are."""
    known = sorted((s.worst_mean, s.estimator) for s in found if s.worst_mean is not None)
    if not known:
        return "no lock"
    lost = sum(s.lost > 0 for s in found)
    said_lost = f", {lost} of {len(found)} losing lock" if lost else ""
    return f"{known[0][0]:.2f}° ({known[0][1]}) to {known[-1][0]:.2f}° ({known[-1][1]}){said_lost}"


def _size(s: Standing) -> str:
    """Return the worst mean error, and where it is."""
    if s.worst_mean is None or s.at is None:
        return "no lock"
    return (
        f"{s.worst_mean:.2f}°" if s.worst_mean < SLIGHT else f"{s.worst_mean:.2f}° at {place(s.at)}"
    )


def _lost(s: Standing) -> str:
    return f" ({s.lost} lost)" if s.lost and s.at is not None else ""


def place(row: Row) -> str:
    """Return an operating point in words."""
    speed = "" if abs(row.speed_rpm) < 0.5 else f", {row.speed_rpm:+.4g} rpm"
    return f"{100.0 * row.load:.0f} % load{speed}"


def theory_held(rows: Iterable[Row]) -> str:
    """Return how near the linear belief's error is to what theory predicts; nothing where there is
    no theory."""
    apart = [
        abs(r.error_deg.mean - r.predicted_mean_deg)
        for r in rows
        if r.belief == "linear"
        and r.error_deg.mean is not None
        and r.predicted_mean_deg is not None
    ]
    return (
        f"Where theory predicts the linear belief's error, it is met within {max(apart):.2g}°."
        if apart
        else ""
    )
