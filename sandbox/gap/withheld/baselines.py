"""What a careful user would try without the project's diagnosis; each answers in the same contract.

- `refit`: refit the ordinary deviations, name the one that left its stated uncertainty furthest;
- `bic`: every effect alone beside the ordinary deviations, fitted to all data, compared by Schwarz' criterion;
- `voltage`: regression of voltage residuals on signature functions (`voltage.py`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from model.effects import library
from model.effects.library import effect_names, load_effect
from sandbox.campaign import Campaign, read_campaign
from sandbox.gap.withheld import refit as fit
from sandbox.gap.withheld.refit import QUADRATURE
from sandbox.replay.replay import Prepared, prepare
from sandbox.replay.sets import complete

SUSPICIOUS = 4.0  # standard deviations: further off is reported as a cause
REMAINS = 1.05  # times the floor: more than this is left unexplained
REFINED = 3  # effects that are fitted in full after the linear screening
ROUNDS = 4  # of Gauss-Newton for each of them
Z95 = 1.96


@dataclass(frozen=True)
class Answer:
    """A diagnosis in the contract of `diagnosis.json`."""

    json: dict[str, Any]


def answer(
    campaign: Campaign,
    ranked: Sequence[tuple[tuple[str, ...], float, Mapping[str, Any]]],
    gaps: tuple[float, float, float],
    started: float,
    simulations: int,
) -> Answer:
    """Return hypotheses (effects, weight, parameters) as a diagnosis; gaps: J raw, before, after.

    What remains of the reducible gap is the probability of `unknown`.
    """
    raw, before, after = gaps
    left = 0.0
    if after > REMAINS:
        left = min(1.0, (after**2 - 1.0) / (max(before, after) ** 2 - 1.0))
    total = sum(w for _, w, _ in ranked)
    hypotheses: list[dict[str, Any]] = [
        {"effects": list(e), "probability": (1.0 - left) * w / total, "parameters": dict(p)} for e, w, p in ranked
    ]
    if left > 0.0:
        hypotheses.append({"effects": ["unknown"], "probability": left, "parameters": {}})
    hypotheses.sort(key=lambda h: -h["probability"])
    members: list[list[str]] = []
    sum_ = 0.0
    for h in hypotheses:
        members.append(h["effects"])
        sum_ += h["probability"]
        if sum_ >= 0.95:
            break
    top = hypotheses[0]["effects"]
    named = "ambiguous" if len(members) > 1 else "unknown" if "unknown" in top else "explained"
    named = named if top else "no_gap"
    closed = None
    if top and before > REMAINS:
        closed = (before**2 - after**2) / (before**2 - 1.0)
    systems = [load_effect(e).subsystem for h in hypotheses for e in h["effects"] if e != "unknown"] or ["machine"]
    return Answer({
        "schema": 1, "campaign": campaign.name, "verdict": named,
        "gap": {"raw": raw, "before": before, "after": after, "floor": 1.0, "closed": closed},
        "where": [{"subsystem": systems[0], "channel": "", "region": "", "order": None, "share": 1.0, "text": ""}],
        "hypotheses": hypotheses, "ambiguity_set": members, "next_recording": None,
        "cost": {"simulations": simulations, "seconds": time.perf_counter() - started},
    })  # fmt: skip


def nuisances(campaign: Campaign) -> tuple[Prepared, dict[str, float], float]:
    """Return the campaign with its ordinary deviations refitted, that set, and the raw gap."""
    prepared, nominal = fit.start(campaign)
    raw = fit.rms(prepared, nominal)
    values = fit.refit(campaign, prepared, nominal, (), 2)
    prepared = prepare(campaign, values, steps=1)
    return prepared, fit.refit(campaign, prepared, values, (), 3), raw


def by_refit(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Refit the ordinary deviations, name the furthest off (the effect it belongs to)."""
    started, campaign = time.perf_counter(), read_campaign(folder)
    prepared, values, raw = nuisances(campaign)
    centre, sd = complete(campaign.drive.motor, campaign.drive.converter), fit.priors(campaign)
    wide = {k: 1e3 * s for k, s in sd.items()}  # priors so wide that the data decide
    names = list(sd)
    n = fit.normal(prepared, names, values)
    dx, covariance, _ = fit.step(n, values, centre, wide, names)
    best = fit.moved(values, n, names, dx)
    error = np.sqrt(np.diag(covariance))
    off = [(abs(best[k] - centre[k]) / math.hypot(sd[k], e), k) for k, e in zip(names, error, strict=True)]
    allowed = [(z, k) for z, k in off if k.partition(".")[0] in set(effect_names()) - set(exclude)]
    z, name = max(allowed)
    end = fit.rms(prepared, best)
    effect = name.partition(".")[0]
    own = {
        k: interval(best[k], Z95 * e)
        for k, e in zip(names, error, strict=True) if k.partition(".")[0] == effect
    }  # fmt: skip
    ranked: list[Any] = [((effect,), 1.0, own)] if z > SUSPICIOUS else [((), 1.0, {})]
    return answer(campaign, ranked, (raw, n.rms, end), started, 4 * len(names))


def by_bic(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Fit every effect alone beside the ordinary deviations, weigh by the Bayesian information criterion."""
    started, campaign = time.perf_counter(), read_campaign(folder)
    prepared, values, raw = nuisances(campaign)
    centre, sd = complete(campaign.drive.motor, campaign.drive.converter), fit.priors(campaign)
    effects = [e for e in effect_names() if e not in exclude]
    every = list(dict.fromkeys([*sd, *(p for e in effects for p in fit.parameters_of(e))]))
    at = turned(campaign, prepared, values)
    n = fit.normal(prepared, every, at)
    size = float(np.sum(n.counts))

    def cost(own: Sequence[str]) -> float:
        kept = list(own)
        while True:
            free = {k: s for k, s in sd.items() if k not in own}
            chosen = list(dict.fromkeys([*sd, *kept]))
            dx, _, left = fit.step(n, at, centre, free, chosen)
            out = [k for k, x in zip(chosen, dx, strict=True) if k in kept and k not in sd and fit.refused(n, at, k, x)]
            if not out:
                return left + len(own) * math.log(size)
            kept = [k for k in kept if k not in out]

    screened = sorted((cost(fit.parameters_of(e)), e) for e in effects)
    ranked: list[Any] = [((), fit.cost(n, values, centre, sd), {}, n.rms)]
    for _, effect in screened[:REFINED]:
        ranked.append(_fitted(campaign, prepared, at, effect, size))
    best = min(r[1] for r in ranked)
    weights = sorted(((e, math.exp(-0.5 * min(c - best, 1400.0)), p, j) for e, c, p, j in ranked), key=lambda r: -r[1])
    simulations = 2 * len(sd) + len(every) + REFINED * (ROUNDS + 1) * len(sd)
    return answer(campaign, [w[:3] for w in weights], (raw, n.rms, weights[0][3]), started, simulations)


def turned(campaign: Campaign, prepared: Prepared, values: Mapping[str, float]) -> dict[str, float]:
    """Return the set with the cogging's order at typical and phases where linear amplitudes are largest."""
    order = library.typical("cogging_torque", campaign.drive.motor, campaign.drive.converter)
    out = {**values, "cogging_torque.order_mech": order["cogging_torque.order_mech"]}
    for amplitude, phase in QUADRATURE.items():
        sines = [fit.normal(prepared, [amplitude], {**out, phase: p}) for p in (1e-9, 0.5 * math.pi)]
        parts = [s.right[0] / max(s.matrix[0, 0], 1e-300) for s in sines]
        out[phase] = math.atan2(parts[1], parts[0])
    return out


def interval(value: float, half: float) -> dict[str, Any]:
    """Return a parameter with its 95 % interval."""
    return {"value": value, "ci95": [value - half, value + half]}


def _fitted(campaign: Campaign, prepared: Prepared, at: Mapping[str, float], effect: str, size: float):
    """Return an effect's hypothesis: effects, criterion, parameters with intervals, rms after the fit."""
    own = fit.parameters_of(effect)
    centre = complete(campaign.drive.motor, campaign.drive.converter)
    sd = {k: s for k, s in fit.priors(campaign).items() if k not in own}
    phases = {p for a, p in QUADRATURE.items() if a in own}
    begin = {k: v for k, v in at.items() if k in phases or k not in QUADRATURE.values()}
    if effect == "shaft_compliance":
        begin |= library.typical(effect, campaign.drive.motor, campaign.drive.converter)
    values = fit.refit(campaign, prepared, begin, own, ROUNDS)
    names = list(dict.fromkeys([*sd, *own]))
    n = fit.normal(prepared, names, values)
    covariance, cost = fit.step(n, values, centre, sd, names)[1], fit.cost(n, values, centre, sd)
    error = {k: Z95 * math.sqrt(covariance[names.index(k), names.index(k)]) for k in own}
    found = {
        (f"cross_{k}" if effect == "cross_saturation" else k): interval(values[k], error[k])
        for k in own if math.isfinite(values[k])
    }  # fmt: skip
    return (effect,), cost + len(own) * math.log(size), found, n.rms


def by_voltage(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Regress voltage residuals on signature functions."""
    from sandbox.gap.withheld.voltage import by_voltage as run

    return run(folder, exclude)


BASELINES: dict[str, Callable[[Path, tuple[str, ...]], Answer]] = {
    "refit": by_refit,
    "bic": by_bic,
    "voltage": by_voltage,
}
