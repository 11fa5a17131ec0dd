"""How large is the simulator's own error, told in effects?

A diagnosis lets every effect have an *ordinary size* beside those it claims, a small share of its
wide prior (`trace`, up to `trace_most` where the gap is large, `sandbox/gap/settings.py`).  It
stands for the simulator's own error where that resembles an effect.  This script measures it on
campaigns whose truth is known: their true effects and the
ordinary deviations are fitted, then every other effect is freed on its own, one at a time.  What it
comes out at, beyond what the noise of the readings explains, is the error, as a share of its wide
prior.

Each folder stands for a plant of its own structure: `practice/` for an independent bench, what
`withheld make` wrote for the switched bench, `experiments.reference_campaigns` for a reference with
events and for the own plant at a finer step, `experiments.other_simulator` for motulator.

Run: python -m experiments.ordinary_size FOLDER [FOLDER ...] [--count N]
(FOLDER: campaigns with truths beside them, or what `withheld make` wrote, its seal opened; half a
minute each)
"""

from __future__ import annotations

import argparse
import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.truths import campaigns_of, truths_of
from model.effects import library
from sandbox.gap.diagnose import out_of_sight
from sandbox.gap.evidence.algebra import Prior
from sandbox.gap.evidence.fit import fit, rms_of
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.posterior.candidates import candidates
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.linear_model import Linearisation, LinearModel, linear_model
from sandbox.gap.settings import USUAL
from sandbox.output.files import write_json
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import read_folder
from sandbox.replay.replay import prepare
from sandbox.withheld.making.make import SEAL

RESULTS = Path(__file__).parent / "results" / "diagnosis"
# of the ordinary size: coordinates that noise alone leaves less known say nothing of it
KNOWN = 0.5


def values_of(folder: Path, name: str) -> dict[str, float]:
    """Return the true effects' parameters."""
    if (folder / SEAL).is_file():
        return dict(
            json.loads((folder / SEAL).read_text(encoding="utf-8"))["campaigns"][name]["parameters"]
        )
    truth = tomllib.loads((folder / f"{name}.truth.toml").read_text(encoding="utf-8"))
    return {f"{e}.{n}": float(x) for e in truth["effects"] for n, x in truth[e].items()}


def traces(
    path: Path, effects: Sequence[str], values: Mapping[str, float]
) -> Iterator[dict[str, Any]]:
    """Give what every effect but the true ones comes out at on its own, as a share of its wide
    prior."""
    campaign = read_folder(path)
    drive, weights = campaign.drive, weights_of(len(campaign.recordings))
    nominal = ParameterPoint(prepare(campaign), complete(drive.motor, drive.converter))
    null = fit(nominal, (), weights)
    true = ParameterPoint(prepare(campaign, values), complete(drive.motor, drive.converter, values))
    found = fit(true, tuple(effects), weights) if effects else null
    first = {
        c.effect: c for c in reversed(candidates(null.point, out_of_sight(campaign), left=0.0))
    }
    at = linear_model(
        found.point, list(first.values()), tuple(effects), Linearisation(1.0), weights
    )
    for effect in sorted(set(first) - set(effects)):
        prior = alone(at, effects, effect)
        x, free, _ = at.equations.most_probable(prior)
        known = np.sqrt(np.diag(at.equations.covariance(prior)))
        for k in at.members[effect]:
            c = at.coordinates[k]
            if (
                at.of_effects[k]
                and free[k]
                and c.form != "log"
                and c.names[0] not in first[effect].start
            ):
                size = library.load_effect(effect).trace * c.deviation
                share, sd = float((x[k] - prior.mean[k]) / size), float(known[k] / size)
                yield {
                    "campaign": path.name,
                    "rms": rms_of(null),
                    "left": rms_of(found),
                    "effect": effect,
                    "coordinate": c.label,
                    "share": share,
                    "deviation": sd,
                }


def alone(at: LinearModel, effects: Sequence[str], effect: str) -> Prior:
    """Return the priors with the true effects and one more free, without bounds for that one, all
    others held."""
    prior = at.prior(effects, alone=True)
    own = np.isin(np.arange(len(prior.mean)), at.members[effect])
    deviation = np.where(own, at.wide.deviation, prior.deviation)
    low, high = np.where(own, -np.inf, prior.low), np.where(own, np.inf, prior.high)
    return Prior(np.where(own, at.wide.mean, prior.mean), deviation, low, high)


def summary(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, float]]:
    """Return, for small and for large gaps, the error's size beyond the noise beside the ordinary
    size assumed."""
    out = []
    for low, high in ((0.0, 3.0), (3.0, 10.0), (10.0, 30.0), (30.0, np.inf)):
        own = [r for r in rows if low <= r["rms"] < high]
        own = [r for r in own if r["deviation"] < KNOWN * USUAL.trace_at(r["rms"])]
        if own:
            share, noise = (
                np.array([r["share"] for r in own]),
                np.array([r["deviation"] for r in own]),
            )
            beyond = np.sqrt(np.maximum(share**2 - noise**2, 0.0))
            out.append(
                {
                    "from": low,
                    "to": high,
                    "coordinates": len(own),
                    "campaigns": len({(r.get("plant"), r["campaign"]) for r in own}),
                    "rms": float(np.sqrt(max(np.mean(share**2 - noise**2), 0.0))),
                    "half_below": float(np.median(beyond)),
                    "nine_of_ten_below": float(np.quantile(beyond, 0.9)),
                    "assumed": float(np.mean([USUAL.trace_at(r["rms"]) for r in own])),
                }
            )
    return out


def main() -> None:
    """Measure, keep every coordinate, print the summary."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--count", type=int, default=20, help="campaigns of each folder (20)")
    options = parser.parse_args()
    if len({f.name for f in options.folders}) < len(options.folders):
        parser.error(
            "two folders have the same name, by which their plants are told apart; link "
            "one under another name"
        )
    rows: list[dict[str, Any]] = []
    for folder in options.folders:
        truths = truths_of(folder)
        for path in [p for p in campaigns_of(folder) if p.name in truths][: options.count]:
            own = traces(path, truths[path.name], values_of(folder, path.name))
            rows += [{"plant": folder.name, **row} for row in own]
            print(path.name, len(rows), flush=True)
    summaries = {"all": summary(rows)} | {
        f.name: summary([r for r in rows if r["plant"] == f.name]) for f in options.folders
    }
    write_json(
        RESULTS,
        "ordinary_size",
        {
            "small": USUAL.trace,
            "largest": USUAL.trace_most,
            "summary": summaries,
            "coordinates": rows,
        },
    )
    for plant, lines in summaries.items():
        for line in lines:
            print(plant, {k: round(v, 4) if np.isfinite(v) else v for k, v in line.items()})


if __name__ == "__main__":
    main()
