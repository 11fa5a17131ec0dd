"""Is the share of the gap that the diagnosis gives to an effect the share that vanishes when the
effect is taken out?

Reads a finished check (`sensorless withheld make --kind many`, `score`).  Each of its drives is
recorded again on the switched bench, with the same deviations, cycles and noise, with one effect
taken out (its *last* place among all), and with all others taken out (its *first*); the gap is what
ordinary deviations, refitted, leave above the noise floor. A diagnosis states two numbers an
effect.  `alone` is what the gap would lose without this effect: compared with the bench without it
(`rms_alone`, the goal's wording).  The share itself is the mean over all orders of adding, so that
shares sum up: compared with the mean of both places (`rms_true`), and for the record with each
(`rms_last`, `rms_first`).  An effect that is not named has the stated share 0, one that is not
there the true share 0.  A share is negative where an effect cancels others.

Run: python -m experiments.shares_truth CHECK
    (1 to 2 min a campaign; rows are kept in CHECK, a second call goes on)
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.noise import noise_of
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.posterior.holdout import weights_of
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, read_folder
from sandbox.replay.replay import prepare
from sandbox.withheld.making.case_list import Case, Maps, cases
from sandbox.withheld.making.draw import draw
from sandbox.withheld.making.make import campaign_of
from sandbox.withheld.scoring.blind import opened

ROWS = "shares.rows.jsonl"


class Row(NamedTuple):
    """An effect of a campaign: its true share in the last and the first place, the stated one with
    its interval, and what is stated to vanish with this effect alone."""

    campaign: str
    effect: str
    last: float
    first: float
    stated: float
    low: float
    high: float
    alone: float

    @property
    def true(self) -> float:
        """The mean of the last and the first place."""
        return 0.5 * (self.last + self.first)

    @property
    def named(self) -> bool:
        """The diagnosis states a share, of either sign."""
        return (self.stated, self.low, self.high) != (0.0, 0.0, 0.0)


def gap_of(campaign: Campaign) -> float:
    """Return the squares above the noise floor that ordinary deviations leave, in readings."""
    prepared = prepare(campaign)
    noise = noise_of(campaign)
    prepared = replace(prepared, noise_std=noise.used, colour=noise.colour)
    start = ParameterPoint(prepared, complete(campaign.drive.motor, campaign.drive.converter))
    found = fit(start, (), weights_of(len(prepared.recordings)), workers=1)
    return sum(float(s.ssr.sum() - s.n.sum()) for s in found.normal.segments)


def rows_of(case: Case, seed: int, folder: Path) -> Iterator[Row]:
    """Yield the rows of a diagnosed campaign."""
    report = json.loads((folder / "diagnoses" / f"{case.name}.json").read_text(encoding="utf-8"))
    stated = {e["name"]: e["share"] for e in report["effects"] if e["share"] is not None}
    whole = gap_of(read_folder(folder / "campaigns" / case.name))
    nothing = gap_of(campaign_of(draw(case, seed, case.names)))
    for effect in sorted({*case.names, *stated}):
        share = stated.get(effect, {"value": 0.0, "ci95": [0.0, 0.0], "alone": 0.0})
        low, high = share["ci95"] or (math.nan, math.nan)
        last = first = 0.0
        if effect in case.names:
            last = (whole - gap_of(campaign_of(draw(case, seed, (effect,))))) / whole
            others = tuple(n for n in case.names if n != effect)
            first = (gap_of(campaign_of(draw(case, seed, others))) - nothing) / whole
        yield Row(case.name, effect, last, first, share["value"], low, high, share["alone"])


def kept(path: Path) -> list[Row]:
    """Return the rows of earlier calls; a campaign stands in one line."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return [Row(*row) for line in lines for row in json.loads(line)]


def main() -> None:
    """Compare every campaign that has a diagnosis; print a line each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "check", type=Path, help="folder of a check whose campaigns are diagnosed, all or some"
    )
    folder = parser.parse_args().check
    header = opened(folder)
    listed = cases(
        len(header["campaigns"]),
        header["seed"],
        header["kind"],
        header["style"],
        header["outside"],
        header["sizes"],
        Maps(*header.get("maps", ())),
    )
    rows = kept(folder / ROWS)
    for case in listed:
        known = case.name in {r.campaign for r in rows}
        if known or not (folder / "diagnoses" / f"{case.name}.json").is_file():
            continue
        own = list(rows_of(case, header["seed"], folder))
        rows += own
        with (folder / ROWS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(own) + "\n")
        print(
            case.name, " ".join(f"{r.effect} {r.true:.2f}/{r.stated:.2f}" for r in own), flush=True
        )
    write(rows)


def compared(rows: list[Row]) -> dict[str, Any]:
    """Return how far stated shares are from true ones (rms over n effects), and how often intervals
    hold them.

    rms_alone: what is stated to vanish with an effect alone, against the last place; rms_last,
    rms_first, rms_true: the share, against the last place, the first, the mean of both;
    in_interval: of shares that are stated (n_stated), those whose interval holds that mean.
    """
    found: dict[str, Any] = {"campaigns": len({r.campaign for r in rows}), "n": len(rows)}
    for name in ("last", "true", "first"):
        found[f"rms_{name}"] = math.sqrt(
            np.mean([(r.stated - getattr(r, name)) ** 2 for r in rows])
        )
    found["rms_alone"] = math.sqrt(np.mean([(r.alone - r.last) ** 2 for r in rows]))
    found["between_places"] = math.sqrt(np.mean([(r.last - r.first) ** 2 for r in rows]))
    inside = [r.low <= r.true <= r.high for r in rows if r.named and math.isfinite(r.low)]
    return {
        **found,
        "in_interval": float(np.mean(inside)) if inside else None,
        "n_stated": len(inside),
    }


def write(rows: list[Row]) -> None:
    """Write results/shares_truth.json and .png."""
    found, stated = compared(rows), np.array([r.stated for r in rows])
    figure, axes = new_figure()
    a = axes[0, 0]
    a.errorbar(
        [r.true for r in rows],
        stated,
        [stated - [r.low for r in rows], [r.high for r in rows] - stated],
        [abs(r.last - r.first) / 2 for r in rows],
        ".",
        color=COLOURS["model"],
        ecolor="0.75",
        elinewidth=0.8,
    )
    a.plot([0.0, 1.0], [0.0, 1.0], color="0.4", linewidth=0.8)
    a.set(
        xlabel="share that vanishes with the effect (last to first place)",
        ylabel="stated share (95 % interval)",
    )
    a.set_title(
        f"rms {found['rms_true']:.3f} (mean of last and first place);\nstated to vanish with the "
        f"effect alone: rms {found['rms_alone']:.3f}; n = {found['n']} effects",
        fontsize=8,
    )
    save("shares_truth", {**found, "rows": [r._asdict() for r in rows]}, figure)
    print({k: v if v is None else round(v, 3) for k, v in found.items()})


if __name__ == "__main__":
    main()
