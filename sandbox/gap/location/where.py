"""Where the gap lies: sentences, the largest share first.

How much of the gap belongs to a subsystem follows from the hypotheses: each counts by its
probability, and its effects by what the fit loses without them.  For `unknown` counts which
readings show it (`outside`).  What a subsystem's part looks like (channel, direction, region,
order) is measured on the residual that is left when its effects are missing and all else is fitted.
Charts show the same parts (`parts`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from model.array_types import Array
from model.effects import library
from model.effects.card import SUBSYSTEMS
from model.errors import BadInput
from sandbox.gap.diagnose import Diagnosis, verdict
from sandbox.gap.evidence.algebra import Prior
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.priors import of_effect, ordinary
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location.decompose import Decomposition, decompose
from sandbox.gap.location.outside import outside
from sandbox.gap.location.readings import described
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.gap.posterior.hypotheses import UNKNOWN, Hypothesis
from sandbox.gap.words import times
from sandbox.plant.sets import complete

LEAST = 0.02  # share below which a subsystem is not spoken of
DETAIL = 0.1  # the same for a detail, of its subsystem's part
# share from which a further subsystem stands in the first answer: below, the list of findings has
# it
MUCH = 0.2
WORTH = 0.1  # probability below which a gap that cannot be told from none is not spoken of
ALIKE = 1.5  # ratio of amplitudes within which they count as independent of speed or current
NAMES = {
    "inverter": "inverter",
    "machine": "machine",
    "sensor": "sensors",
    "mechanics": "mechanics",
}
WHOSE = {
    "inverter": "inverter's",
    "machine": "machine's",
    "sensor": "sensors'",
    "mechanics": "mechanics'",
}
# ports between a current and its reading; an angle has others
MEASURED = ("reading", "filter", "instant", "channels")
WHAT = {"motion": "motion of the free rotor", "position": "the encoder's angle at imposed speed"}
ORDER_TEXT = {
    1: "stands still in the stator (order 1 of the rotor's frame)",
    2: "turns against the rotor (order 2 of its frame)",
}


@dataclass(frozen=True)
class Finding:
    """One plain sentence on where the gap lies, with its share; order: of the rotor's frame (None:
    no single one)."""

    subsystem: str
    channel: str
    region: str
    order: float | None
    share: float
    text: str


@dataclass(frozen=True)
class SubsystemPart:
    """One subsystem's part of the gap: its share, and what is left without its effects, taken
    apart; of_readings: told as errors of the measured currents, in A."""

    subsystem: str
    share: float
    left: Decomposition
    of_readings: bool = False


def parts(d: Diagnosis) -> tuple[SubsystemPart, ...]:
    """Return the subsystems' parts that are spoken of, the largest first; none where there is no
    gap."""
    if verdict(d) == "no_gap":
        return ()
    found = []
    for name, share in subsystems(d).items():
        if share >= LEAST:
            point = without(d, name, alone=share > 1.0 - LEAST)
            found.append(
                SubsystemPart(
                    name, share, decompose(point, shown(point)), name == "sensor" and of_readings(d)
                )
            )
    return tuple(sorted(found, key=lambda p: -p.share))


def of_readings(d: Diagnosis) -> bool:
    """Return whether the sensors' part is told as errors of current readings.

    The most probable of the likely hypotheses that names sensors' effects decides: all of them act
    on current readings, or the loss of those costs more than the loss of the others.  It is so,
    too, where none is named: then readings whose sum is not zero show it (`outside`).
    """
    for h in d.ambiguity_set:
        cards = [
            c
            for c in map(library.load_effect, sorted({*h.effects} - {UNKNOWN}))
            if c.subsystem == "sensor"
        ]
        of_currents = [c.name for c in cards if all(at.port in MEASURED for at in c.at)]
        others = [c.name for c in cards if c.name not in of_currents]
        if of_currents and others:
            return _lost(h.evaluated, of_currents) > _lost(h.evaluated, others)
        if cards:
            return not others
    return True


def where(d: Diagnosis, found: Sequence[SubsystemPart] | None = None) -> tuple[Finding, ...]:
    """Return the findings, the largest share first; none where surely nothing is wrong (`summary`
    says so).

    found: the gap's `parts`, if they are known.
    """
    if verdict(d) == "no_gap":
        return possible(d, subsystems(d))
    own = parts(d) if found is None else found
    said = [
        f for p in own for f in sentences(p.subsystem, p.share, p.left, of_readings=p.of_readings)
    ]
    return tuple(sorted(said, key=lambda f: -f.share))


def possible(d: Diagnosis, shares: Mapping[str, float]) -> tuple[Finding, ...]:
    """Return where a gap would lie that cannot be told from none: a share of what its hypotheses
    are probable."""
    chance = 1.0 - sum(h.probability for h in d.hypotheses if not h.effects)
    return (
        ()
        if chance < WORTH
        else tuple(
            Finding(
                name,
                "",
                "",
                None,
                chance * share,
                f"If there is a gap at all ({percent(chance)} probable), {percent(share)} of it is "
                f"expected in the {NAMES[name]}.",
            )
            for name, share in sorted(shares.items(), key=lambda x: -x[1])
            if share >= LEAST
        )
    )


def summary(d: Diagnosis, findings: Sequence[Finding]) -> str:
    """Return the first finding, and which other subsystems have MUCH of the gap; or that nothing is
    wrong."""
    if findings and verdict(d) != "no_gap":
        return f"{findings[0].text} {_further(findings)}".rstrip()
    return (
        "Nowhere: with ordinary deviations refitted, residuals stand at "
        f"{times(d.size.before)} the noise floor on "
        "the recordings checked, and no effect of the library explains them better."
    )


def _further(findings: Sequence[Finding]) -> str:
    """Return which subsystems beside that of the first finding have MUCH of the gap; '' where none
    has."""
    most: dict[str, float] = {}
    for f in findings:  # the largest share first: a subsystem's first is its whole part
        most.setdefault(f.subsystem, f.share)
    others = [
        (NAMES[name], percent(share)) for name, share in list(most.items())[1:] if share >= MUCH
    ]
    texts = [
        f"{share}{'' if k else ' of the gap points'} to the {name}"
        for k, (name, share) in enumerate(others)
    ]
    return f"A further {' and '.join(texts)}." if texts else ""


def subsystems(d: Diagnosis) -> dict[str, float]:
    """Return each subsystem's share of the gap, all hypotheses weighed by their probability; sums
    to 1."""
    out = dict.fromkeys(SUBSYSTEMS, 0.0)
    for h in d.hypotheses:
        for name, share in _of_hypothesis(d, h).items():
            out[name] += h.probability * share
    total = sum(out.values())
    return {name: share / total for name, share in out.items()} if total else out


def _of_hypothesis(d: Diagnosis, h: Hypothesis) -> dict[str, float]:
    """Return the subsystems' shares under one hypothesis; empty where it has no gap to share
    out."""
    named = [e for e in h.effects if e != UNKNOWN]
    out = dict.fromkeys(SUBSYSTEMS, 0.0)
    if not h.effects:
        return out
    for name, lost in _losses(h.evaluated, named).items():
        out[name] += lost
    if UNKNOWN in h.effects:
        open_part = 1.0 - d.remainder.explained if named else 1.0
        judged = h.evaluated if named else min(d.evaluated, key=lambda j: len(j.effects))
        spans = outside(judged.model.point, _spans(judged), h.probability)
        out = {name: (1.0 - open_part) * out[name] + open_part * spans[name] for name in SUBSYSTEMS}
    return out


def _losses(j: EvaluatedModel, effects: Sequence[str]) -> dict[str, float]:
    """Return what the objective loses without each subsystem's effects, all else refitted; sums to
    1."""
    groups: dict[str, list[str]] = {}
    for effect in effects:
        groups.setdefault(library.load_effect(effect).subsystem, []).append(effect)
    if len(groups) <= 1:
        return dict.fromkeys(groups, 1.0)
    lost = {name: _lost(j, own) for name, own in groups.items()}
    total = sum(lost.values())
    return {name: x / total if total else 1.0 / len(lost) for name, x in lost.items()}


def _lost(j: EvaluatedModel, effects: Sequence[str]) -> float:
    """Return what the objective loses without some effects, all else refitted."""
    best, left = (
        j.equations.most_probable(held_at_neutral(j, own)).objective for own in ((), effects)
    )
    return max(0.0, left - best)


def held_at_neutral(j: EvaluatedModel, effects: Sequence[str]) -> Prior:
    """Return a hypothesis' prior with effects, and traces of all others, at neutral; ordinary ones
    stay in reach."""
    campaign = j.fit.point.prepared.campaign
    usual = {c.label: c for c in ordinary(campaign, j.fit.point.values)}
    missing = {
        c.label: c for e in effects for c in of_effect(e, campaign.drive, j.fit.point.values)
    }
    claimed = {k for e in j.effects for k in j.model.members[e]}
    prior = Prior(
        j.prior.mean.copy(), j.prior.deviation.copy(), j.prior.low.copy(), j.prior.high.copy()
    )
    for k, c in enumerate(j.normal.coordinates):
        if c.label in usual and c.label in missing:
            prior.mean[k], prior.deviation[k] = usual[c.label].mean, usual[c.label].deviation
            prior.low[k], prior.high[k] = usual[c.label].bounds()
        elif c.label in missing or (k not in claimed and c.label not in usual and not c.of_point):
            prior.mean[k], prior.deviation[k] = missing.get(c.label, c).mean, 0.0
    return prior


def _spans(j: EvaluatedModel) -> dict[str, float]:
    """Return how much of what a hypothesis leaves each subsystem's effects could take up together;
    sums to 1."""
    base = j.equations.most_probable(j.prior).objective
    gain = {}
    for name in SUBSYSTEMS:
        own = [
            e
            for e in j.model.members
            if library.load_effect(e).subsystem == name and e not in j.effects
        ]
        gain[name] = max(
            0.0, base - j.equations.most_probable(j.model.prior([*j.effects, *own])).objective
        )
    total = sum(gain.values())
    return {name: g / total if total else 1.0 / len(gain) for name, g in gain.items()}


def without(d: Diagnosis, subsystem: str, *, alone: bool) -> ParameterPoint:
    """Return the point at which a subsystem's effects are missing and all else is fitted.

    alone: the whole gap is the subsystem's, so that is where the diagnosis began; else by the
    equations at the best.
    """
    own = [
        e for e in d.best.effects if e != UNKNOWN and library.load_effect(e).subsystem == subsystem
    ]
    if alone or not own:
        return d.before.point
    j, drive = d.best.evaluated, d.campaign.drive
    x = j.equations.most_probable(held_at_neutral(j, own)).x
    moved = [(c, to) for c, to in zip(j.normal.coordinates, x, strict=True) if c.form != "share"]
    point = j.model.point.moved([c for c, _ in moved], np.array([to for _, to in moved]))
    with suppress(BadInput):  # extrapolated: none that a drive can have
        complete(drive.motor, drive.converter, point.values)
        return point
    return d.before.point


def sentences(
    name: str, share: float, part: Decomposition, *, of_readings: bool = False
) -> Iterator[Finding]:
    """Yield what is to be said of one subsystem's part of the gap: what it is, then details.

    of_readings: as errors of the measured currents; else as the voltage that would explain it.
    """
    channel = max(part.channels, key=lambda c: part.channels[c])
    order = max(part.electrical, key=lambda n: part.electrical[n])
    region = max(part.speeds, key=lambda r: part.speeds[r])
    mostly = region if part.speeds[region] > 0.6 else "all speeds"
    if channel == "currents" and of_readings:
        what = described(part.readings) + _dependence(part.readings.amplitude)
    elif channel == "currents":
        direction, size = part.direction
        what = f"voltage {direction}" if size > 0.5 else "voltage in no single direction"
        what = (
            what.replace("voltage ", f"voltage, mostly ({percent(size)}) ", 1)
            if 0.5 < size < 0.95
            else what
        )
        what += _dependence(part.amplitude)
    else:
        what = f"{WHAT[channel]}, {mostly}"
    text = f"{percent(share)} of the gap is {what}. This points to the {NAMES[name]}."
    text = text[0].upper() + text[1:]
    turning = sum(part.electrical.values())
    single = abs(order) if turning > DETAIL and part.electrical[order] > 0.5 * turning else None
    yield Finding(name, channel, mostly, single, share, text)
    yield from _details(name, share, part, channel, mostly)


def percent(share: float) -> str:
    """Return a share in words a sentence can hold."""
    return "all" if share > 0.995 else f"{100.0 * share:.0f} %"


def _dependence(amplitude: Array) -> str:
    """Return how an amplitude (4, 4) depends on speed and current: a sentence more, or nothing if
    none can tell.

    It is an rms, without the region near zero current; the charts' shares of squares may go another
    way.
    """
    out = []
    for table, of in ((amplitude, "speed"), (amplitude.T, "current")):
        seen = [row for row in table if np.isfinite(row).any()]
        shared = (
            np.isfinite(seen[0]) & np.isfinite(seen[-1]) if len(seen) >= 2 else np.array([False])
        )
        if shared.any():
            ratio = float(np.exp(np.mean(np.log(seen[-1][shared] / seen[0][shared]))))
            same = 1.0 / ALIKE < ratio < ALIKE
            out.append(
                f"{'does not depend on' if same else 'grows with' if ratio > 1.0 else 'falls with'} {of}"  # noqa: E501
            )
    text = " and ".join(out).replace("on speed and does not depend on", "on speed or")
    return f". Where currents are not near zero, its rms {text}" if text else ""


def _details(
    name: str, share: float, part: Decomposition, channel: str, mostly: str
) -> Iterator[Finding]:
    def one(of: float, text: str, order: float | None = None, at: str = channel) -> Finding:
        """Return a finding on a share of this subsystem's part."""
        # a region's excess may outdo the whole where others fall below the noise
        part = share * min(of, 1.0)
        said = f"{percent(part)} of the gap {text}."
        if share < 1.0 - LEAST:
            said = f"of the {WHOSE[name]} part {percent(min(of, 1.0))} {text}."
        return Finding(name, at, mostly, order, part, said[:1].upper() + said[1:])

    file = max(part.recordings, key=lambda f: part.recordings[f])
    if part.recordings[file] > max(DETAIL, 1.5 / len(part.recordings)):
        yield one(part.recordings[file], f"is in {file}, more than in any other recording")
    for other, of in part.channels.items():
        if other != channel and of > DETAIL:
            yield one(of, f"is seen in {WHAT.get(other, 'the phase currents')}", at=other)
    for region, of in (*part.speeds.items(), *part.currents.items()):
        if of > 0.6:
            yield one(of, f"lies {region}")
    merged: dict[int, float] = {}
    for n, of in part.electrical.items():
        merged[abs(n)] = merged.get(abs(n), 0.0) + of
    for n, of in merged.items():
        if n and of > DETAIL:
            yield one(
                of,
                f"{ORDER_TEXT.get(n, f'is of electrical order {n} in the rotor frame')}",
                n,
                "currents",
            )
    for n, of in part.mechanical.items():
        if of > DETAIL:
            yield one(of, f"is of mechanical order {n}", n, "motion")
    if part.injection > DETAIL:
        yield one(
            part.injection,
            "is ripple at the injection's frequency and its harmonics",
            at="currents",
        )
    if part.line and part.line[1] > DETAIL:
        yield one(
            part.line[1],
            f"is at a fixed frequency of {part.line[0]:.0f} Hz at locked rotor",
            at="currents",
        )
