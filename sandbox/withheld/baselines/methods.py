"""What a careful user would try without the project's diagnosis; each answers in the same form.

- `refit`: refit the ordinary deviations unbounded, name the one that left its stated uncertainty
  furthest;
- `bic`: every effect alone beside the ordinary deviations, fitted to all data, compared by Schwarz'
  criterion;
- `voltage`: regression of voltage residuals on signature functions (`voltage_regression.py`);
- `stepwise`: sets of effects, one added or dropped at a time, each refitted in full
  (`stepwise.py`);
- `gp`: effects beside a Gaussian process for all that no effect explains (`gaussian_process.py`);
- `susie`: a sum of single effects on the slopes at the ordinary fit, nothing fitted anew
  (`single_effects.py`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from model.effects.library import effect_names
from model.errors import BadInput
from sandbox.gap.evidence.normal import ParameterPoint, counted
from sandbox.gap.evidence.priors import with_usual_sign
from sandbox.gap.posterior.candidates import Candidate
from sandbox.recordings.campaign import read_folder
from sandbox.withheld.baselines import refit as fit
from sandbox.withheld.baselines.answer import Answer, answer
from sandbox.withheld.baselines.gaussian_process import by_gaussian_process
from sandbox.withheld.baselines.refit import UNFITTED, Z95, interval
from sandbox.withheld.baselines.screening import screened
from sandbox.withheld.baselines.single_effects import by_single_effects
from sandbox.withheld.baselines.stepwise import REFINED, Visited, by_stepwise, ranked, visited
from sandbox.withheld.baselines.voltage_regression import by_voltage

SUSPICIOUS = 4.0  # standard deviations: further off is reported as a cause
# times the stated deviations: priors so wide that the data decide, but for what they do not show
LOOSE = 30.0
FREE = 4  # rounds of Gauss-Newton without priors


def by_refit(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Refit the ordinary deviations without priors or bounds, name the furthest off (the effect it
    belongs to)."""
    started, campaign = time.perf_counter(), read_folder(folder)
    null, raw = fit.nuisances(campaign)
    stated = fit.usual(campaign)
    # without bounds first, then without priors
    near = fit.refit(null.point, fit.widened(stated, 1.0), fit.ROUNDS)
    free = fit.refit(near.point, fit.widened(stated, LOOSE), FREE)
    x, error = free.normal.x, free.error()
    off = [
        (abs(x[k] - c.mean) / math.hypot(c.deviation, error[k]), c.effect)
        for k, c in enumerate(stated)
    ]
    z, effect = max((z, e) for z, e in off if e in set(effect_names()) - set(exclude))
    own = {
        c.names[0]: interval(x[k], Z95 * error[k])
        for k, c in enumerate(stated)
        if c.effect == effect
    }
    named: list[Any] = [((), 1.0, {})]
    after = null.rms
    if z > SUSPICIOUS:
        named, after = [((effect,), 1.0, own)], free.rms
    simulations = round(null.simulations + near.simulations + free.simulations)
    return answer(campaign, named, (raw, null.rms, after), started, simulations)


def by_bic(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Fit every effect alone beside the ordinary deviations, weigh by the Bayesian information
    criterion.

    All are screened by the equations of the ordinary fit; the best few are fitted, and one that
    cannot be is skipped.
    """
    started, campaign, spent = time.perf_counter(), read_folder(folder), list[float]()
    with counted(spent.append):
        null, raw = fit.nuisances(campaign)
        found = [Visited((), null, null.cost)]
        unbent = replace(
            null.point, values=with_usual_sign(null.point.values, campaign.drive.motor)
        )
        for promise in screened(null.point, fit.usual(campaign), usual_probes(null.point, exclude))[
            :REFINED
        ]:
            with suppress(*UNFITTED):
                found.append(visited(unbent, promise.probe))
    best = min(found, key=lambda v: v.criterion)
    return answer(
        campaign, ranked(found), (raw, null.rms, best.fit.rms), started, round(sum(spent))
    )


def usual_probes(point: ParameterPoint, exclude: Sequence[str]) -> list[Candidate]:
    """Return one probe an effect, its companions at typical values, but for effects that this drive
    cannot have."""
    out = []
    for effect in effect_names():
        if effect not in exclude:
            with suppress(BadInput):
                out.append(fit.beginning(point, effect))
    return out


BASELINES: dict[str, Callable[[Path, tuple[str, ...]], Answer]] = {
    "refit": by_refit,
    "bic": by_bic,
    "voltage": by_voltage,
    "stepwise": by_stepwise,
    "gp": by_gaussian_process,
    "susie": by_single_effects,
}
