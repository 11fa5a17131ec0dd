"""What does the diagnosis say about campaigns of an independent bench, and is it right where the
truth is known?

Diagnoses every campaign of a folder (blindly: truth files are opened only for the table, after all
answers are written); writes one diagnosis.json each and a table to experiments/results/diagnosis/.
Resumable: what is there stays.

Run: python -m experiments.diagnose_recordings FOLDER
    (FOLDER: practice or sealed; about half a minute a campaign)
"""

from __future__ import annotations

import json
import sys
import tomllib
from datetime import date
from pathlib import Path
from typing import Any

from sandbox.engine.processes import Workers, spread
from sandbox.gap.report.answers import answer
from sandbox.gap.report.diagnosis_json import document
from sandbox.output.files import plain
from sandbox.recordings.campaign import read_folder

RESULTS = Path(__file__).parent / "results" / "diagnosis"


def one(folder: Path) -> dict[str, Any]:
    """Return the diagnosis of a campaign folder, written beside the others."""
    path = RESULTS / folder.parent.name / f"{folder.name}.json"
    if not path.exists():
        a = answer(read_folder(folder), workers=1)
        found = plain(document(a.diagnosis, a.where, a.position, a.following, a.remains, a.alike))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(found, indent=1) + "\n")
    answered: dict[str, Any] = json.loads(path.read_text())
    return answered


def _named(folder: Path) -> tuple[Path, dict[str, Any]]:
    return folder, one(folder)


def row(folder: Path, d: dict[str, Any]) -> str:
    """Return one line of the table."""
    truth = folder.parent / f"{folder.name}.truth.toml"
    known = (
        " + ".join(tomllib.loads(truth.read_text())["effects"]) or "none"
        if truth.exists()
        else "sealed"
    )
    best, gap = d["hypotheses"][0], d["gap"]
    effects = " + ".join(best["effects"]) or "no gap"
    closed = "" if gap["closed"] is None else f"{100 * gap['closed']:.2f} %"
    cost = f"{d['cost']['simulations']} / {d['cost']['seconds']:.0f} s"
    sizes = f"{gap['raw']:.2f} → {gap['before']:.2f} → {gap['after']:.3f}"
    cells = (
        folder.name,
        known,
        d["verdict"],
        effects,
        f"{best['probability']:.3f}",
        sizes,
        closed,
        cost,
    )
    return f"| {' | '.join(cells)} |"


def main(folder: Path) -> None:
    """Diagnose all campaigns of a folder and write the table."""
    campaigns = sorted(p for p in folder.iterdir() if (p / "campaign.toml").exists())
    answers = dict(spread(_named, campaigns, Workers(2)))
    found = [answers[c] for c in campaigns]
    lines = [
        (
            f"Diagnoses of `{folder.name}/`, {date.today()}, by `python -m "
            "experiments.diagnose_recordings`."
        ),
        "",
    ]
    lines += [
        (
            "| campaign | put in | verdict | best hypothesis | probability | J raw → before "
            "→ after | closed | cost |"
        )
    ]
    lines += ["|---|---|---|---|--:|---|--:|---|"]
    lines += [row(c, d) for c, d in zip(campaigns, found, strict=True)]
    text = "\n".join(lines) + "\n"
    (RESULTS / f"{folder.name}.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
