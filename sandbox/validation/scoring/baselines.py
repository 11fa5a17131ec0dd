"""What a careful user would try without the project's diagnosis; each answers in the same contract.

- `refit`: refit the ordinary deviations unbounded, name the one that left its stated uncertainty furthest;
- `bic`: every effect alone beside the ordinary deviations, fitted to all data, compared by Schwarz' criterion;
- `voltage`: regression of voltage residuals on signature functions (`voltage.py`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from model.effects.library import effect_names, load_effect
from model.errors import BadInput, PhysicsError
from sandbox.gap.evidence.algebra import algebra, prior_of
from sandbox.gap.evidence.normal import Point, normal
from sandbox.gap.evidence.priors import Coordinate, ordinary, with_usual_sign
from sandbox.gap.evidence.probes import Probe, probe_coordinates
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, read_campaign
from sandbox.replay.replay import prepare
from sandbox.validation.scoring import refit as fit
from sandbox.validation.scoring.baseline_answer import Answer, answer
from sandbox.validation.scoring.refit import Z95, Refit, interval
from sandbox.validation.scoring.voltage_regression import by_voltage

SUSPICIOUS = 4.0  # standard deviations: further off is reported as a cause
LOOSE = 30.0  # times the stated deviations: priors so wide that the data decide, but for what they do not show
REFINED = 3  # effects that are fitted in full after the linear screening
ROUNDS, FREE = 3, 4  # of Gauss-Newton: with priors, without
UNFITTED = (BadInput, PhysicsError, np.linalg.LinAlgError)  # what a fit may end with


class _Fitted(NamedTuple):
    """One hypothesis of `by_bic`: its effects, criterion, the effect's own intervals, normalised rms."""

    effects: tuple[str, ...]
    criterion: float
    own: Any
    rms: float


def nuisances(campaign: Campaign) -> tuple[Refit, float]:
    """Return the fit of the ordinary deviations alone, and the raw gap."""
    start = Point(prepare(campaign, steps=1), complete(campaign.drive.motor, campaign.drive.converter))
    return fit.refit(start, ordinary(campaign), ROUNDS), fit.rms(normal(start, ()))


def by_refit(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Refit the ordinary deviations without priors or bounds, name the furthest off (the effect it belongs to)."""
    started, campaign = time.perf_counter(), read_campaign(folder)
    null, raw = nuisances(campaign)
    stated = ordinary(campaign)
    near = fit.refit(null.point, fit.widened(stated, 1.0), ROUNDS)  # without bounds first, then without priors
    free = fit.refit(near.point, fit.widened(stated, LOOSE), FREE)
    x, error = free.normal.x, free.error()
    off = [(abs(x[k] - c.mean) / math.hypot(c.deviation, error[k]), c.effect) for k, c in enumerate(stated)]
    z, effect = max((z, e) for z, e in off if e in set(effect_names()) - set(exclude))
    own = {c.names[0]: interval(x[k], Z95 * error[k]) for k, c in enumerate(stated) if c.effect == effect}
    ranked: list[Any] = [((), 1.0, {})]
    after = null.rms
    if z > SUSPICIOUS:
        ranked, after = [((effect,), 1.0, own)], free.rms
    simulations = round(null.simulations + near.simulations + free.simulations)
    return answer(campaign, ranked, (raw, null.rms, after), started, simulations)


def by_bic(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Fit every effect alone beside the ordinary deviations, weigh by the Bayesian information criterion.

    All are screened by the equations of the ordinary fit; the best few are fitted, and one that cannot be is skipped.
    """
    started, campaign = time.perf_counter(), read_campaign(folder)
    null, raw = nuisances(campaign)
    listed, spent = screened(null, [e for e in effect_names() if e not in exclude])
    found = [_Fitted((), null.cost, {}, null.rms)]
    unbent = replace(null.point, values=with_usual_sign(null.point.values, campaign.drive.motor))
    for _, probe in listed[:REFINED]:
        begin, coordinates = fit.with_effect(unbent, probe)
        try:
            one = fit.refit(begin, coordinates, ROUNDS)
            own = fit.intervals(one, probe.effect)
        except UNFITTED:
            continue
        spent += one.simulations
        criterion = one.cost + _count(probe.effect, coordinates) * math.log(fit.readings(one.normal))
        found.append(_Fitted((probe.effect,), criterion, own, one.rms))
    least = min(f.criterion for f in found)
    behind = sorted(((min(f.criterion - least, 1400.0), f) for f in found), key=lambda x: x[0])
    ranked = [(f.effects, math.exp(-0.5 * far), f.own) for far, f in behind]
    _, best = behind[0]
    return answer(campaign, ranked, (raw, null.rms, best.rms), started, round(null.simulations + spent))


def screened(null: Refit, effects: Sequence[str]) -> tuple[list[tuple[float, Probe]], float]:
    """Return effects by the criterion that one step from the ordinary fit promises, the best first; simulations."""
    point, known = null.point, {c.label: c for c in ordinary(null.point.prepared.campaign)}
    own: dict[str, tuple[Probe, dict[str, Coordinate]]] = {}
    for effect in effects:
        with suppress(BadInput):
            probe = fit.beginning(point, effect)
            own[effect] = probe, {c.label: c for c in probe_coordinates(point, probe, "")}
    every = dict(known)
    for _, more in own.values():
        every = {**more, **every}
    n = normal(point, list(every.values()))
    a, size = algebra(n), math.log(fit.readings(null.normal))
    out = []
    for probe, more in own.values():
        chosen = [more.get(c.label, c) for c in n.coordinates]
        free = [c.label in more or c.label in known or c.form == "turn" for c in chosen]
        held = [replace(c, mean=float(x), deviation=0.0) for c, x in zip(chosen, n.x, strict=True)]
        prior = prior_of([c if f else h for c, f, h in zip(chosen, free, held, strict=True)])
        out.append((a.most_probable(prior).objective + len(more) * size, probe))
    return sorted(out, key=lambda r: r[0]), n.simulations


def _count(effect: str, coordinates: Sequence[Coordinate]) -> int:
    """Return how many coordinates are an effect's own, the cross part under saturation's names."""
    owner = "saturation" if effect == "cross_saturation" else effect
    names = {f"{owner}.{p.name}" for p in load_effect(effect).parameters}
    return sum(c.names[0] in names for c in coordinates)


BASELINES: dict[str, Callable[[Path, tuple[str, ...]], Answer]] = {
    "refit": by_refit,
    "bic": by_bic,
    "voltage": by_voltage,
}
