"""Does the answer of a diagnosis change where the noise of the sensors is stated wrongly?

Practice campaigns without a gap, with one effect and with two are diagnosed with the noise of their
current sensors stated 0.8, 0.975, 1 and 1.2 times as large as it is; the first hypothesis, the
chance of `unknown` and what is said of the noise are kept for each.

Rows are written one by one; a run goes on where the last one ended (delete the file to begin anew).

Run: python -m experiments.stated_noise [FOLDER]
    (FOLDER: practice campaigns with truths beside them; 6 min)
"""

from __future__ import annotations

import dataclasses
import json
import os
import sys
from itertools import product
from pathlib import Path
from typing import Any

from experiments.truths import truths_of
from sandbox.gap.diagnose import Diagnosis, diagnosis_of, verdict
from sandbox.gap.report.which import chance_of_unknown
from sandbox.output.files import write_json
from sandbox.output.tables import print_table
from sandbox.recordings.campaign import Campaign, read_folder

RESULTS = Path(__file__).parent / "results" / "diagnosis"
CAMPAIGNS = ("p01", "p04", "p12")  # no gap, one effect, two effects
STATED = (0.8, 0.975, 1.0, 1.2)  # times the noise that the sensors have


def misstated(campaign: Campaign, share: float) -> Campaign:
    """Return a campaign that states a share of its sensors' noise and counts."""
    own = campaign.drive.converter
    noise, counts = share * own.current_noise, share * own.current_resolution
    converter = dataclasses.replace(own, current_noise=noise, current_resolution=counts)
    return dataclasses.replace(
        campaign, drive=dataclasses.replace(campaign.drive, converter=converter)
    )


def row(name: str, put_in: list[str], share: float, d: Diagnosis) -> dict[str, Any]:
    """Return what is kept of a diagnosis."""
    assert d.noise is not None
    return {
        "campaign": name,
        "put_in": put_in,
        "stated_share": share,
        "verdict": verdict(d),
        "first": list(d.best.effects),
        "probability": d.best.probability,
        "unknown": chance_of_unknown(d),
        "before": d.size.before,
        "after": d.size.after,
        "noise": d.noise._asdict(),
        "caution": d.caution,
    }


def main(folder: Path) -> None:
    """Diagnose every campaign at every stated noise, keep and print the table."""
    truths, kept = truths_of(folder), RESULTS / "stated_noise.json"
    rows = json.loads(kept.read_text(encoding="utf-8"))["rows"] if kept.is_file() else []
    done = {(r["campaign"], r["stated_share"]) for r in rows}
    for name, share in product(CAMPAIGNS, STATED):
        if (name, share) not in done:
            rows.append(
                row(
                    name,
                    truths[name],
                    share,
                    diagnosis_of(misstated(read_folder(folder / name), share), workers=1),
                )
            )
            write_json(RESULTS, "stated_noise", {"rows": rows})
            print(name, share, rows[-1]["first"], flush=True)
    heads = ["campaign", "stated", "first", "probability", "P(unknown)", "used / stated", "caution"]
    cells = [
        [
            r["campaign"],
            f"{r['stated_share']:g}",
            " + ".join(r["first"]) or "no gap",
            f"{r['probability']:.3f}",
            f"{r['unknown']:.4f}",
            f"{r['noise']['used'] / r['noise']['stated']:.3f}",
            "yes" if r["caution"] else "no",
        ]
        for r in rows
    ]
    print_table("answers where noise is stated wrongly", heads, cells)


if __name__ == "__main__":
    usual = Path(os.environ.get("SENSORLESS_RECORDINGS", "../shared/recordings")) / "practice"
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else usual)
