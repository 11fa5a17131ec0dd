"""Scoring a withheld check: diagnose blindly, then open the seal.

`diagnose(folder, exclude)` is any function that answers with an object whose `json` is the diagnosis of
`diagnosis.json`; the baselines are such functions, too.  It is given a campaign's folder and never the seal.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from model.errors import BadInput
from sandbox.campaign import read_campaign
from sandbox.gap.answers import answer
from sandbox.gap.contract import contract
from sandbox.gap.withheld.judge import Judgement, judge
from sandbox.gap.withheld.limits import Figure
from sandbox.gap.withheld.make import CAMPAIGNS, HASH, SEAL, spread
from sandbox.gap.withheld.metrics import by_size, confusion, detection_floor, figures, left_out, reliability
from sandbox.report import plain

DIAGNOSES, LEFT_OUT = "diagnoses", "left_out"
LEAST_LEFT_OUT = 1.0  # size from which on an effect is left out of the library
Diagnose = Callable[[Path, tuple[str, ...]], Any]


@dataclass(frozen=True)
class Scores:
    """A scored check of one method: figures by name, judgements, and those with the true effect left out."""

    method: str
    figures: dict[str, Figure]
    judged: tuple[Judgement, ...]
    left_out: tuple[Judgement, ...]

    def as_json(self) -> dict[str, Any]:
        """Return what `withheld.json` keeps of it."""
        sizes = {s: {k: f.as_json() for k, f in fs.items()} for s, fs in by_size(self.judged).items()}
        return {
            **{k: f.as_json() for k, f in self.figures.items()},
            "by_size": sizes, "detection_floor": detection_floor(self.judged), "confusion": confusion(self.judged),
            "reliability": reliability(self.judged), "failed": [j.name for j in self.judged if j.failed],
            "missed": [[j.name, *j.effects, "->", j.label] for j in self.judged if not j.hit],
        }  # fmt: skip


def standard(folder: Path, exclude: tuple[str, ...] = ()) -> Any:
    """Diagnose a campaign with the project's own diagnosis."""
    a = answer(read_campaign(folder), exclude=exclude, workers=1)
    return SimpleNamespace(json=plain(contract(a.diagnosis, a.where, a.position, a.following)))


def score(
    folder: Path,
    diagnose: Diagnose = standard,
    *,
    method: str = "diagnosis",
    jobs: int = 1,
    limit: int | None = None,
    leave_out: float = 0.0,
    again: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Scores:
    """Diagnose a check's campaigns (those without a report yet) and judge them.

    limit: the first so many campaigns; leave_out: share of the single effects of medium size or more diagnosed once
    more without the true effect in the library; again: forget earlier reports.  BadInput where the folder is no check
    or its seal is not the one that was hashed.
    """
    if not 0.0 <= leave_out <= 1.0:
        raise BadInput(f"leave_out = {leave_out} is no share; give a number in [0, 1]")
    names = campaign_names(folder, limit)
    reports = folder / DIAGNOSES if method == "diagnosis" else folder / DIAGNOSES / method
    if again:
        shutil.rmtree(reports / LEFT_OUT, ignore_errors=True)
        for old in reports.glob("*.json"):
            old.unlink()
    run_all(folder, dict.fromkeys(names, ()), diagnose, reports, jobs, progress)
    truth = opened(folder)
    single = [n for n in names if truth[n]["kind"] == "one" and truth[n]["sizes"][0] >= LEAST_LEFT_OUT]
    chosen = single[: round(leave_out * len(single))]
    without = {n: tuple(truth[n]["effects"]) for n in chosen}
    run_all(folder, without, diagnose, reports / LEFT_OUT, jobs, progress)
    judged = tuple(judge(n, truth[n], read_report(reports, n)) for n in names)
    others = tuple(judge(n, truth[n], read_report(reports / LEFT_OUT, n)) for n in chosen)
    return Scores(method, figures(judged) | (left_out(others) if others else {}), judged, others)


def campaign_names(folder: Path, limit: int | None = None) -> list[str]:
    """Return the names of a check's campaigns; BadInput where there is none, or recording is not finished."""
    found = sorted(p.name for p in (folder / CAMPAIGNS).glob("[!.]*") if p.is_dir())
    if not found or not (folder / SEAL).is_file():
        raise BadInput(f"'{folder}' is no withheld check; make one with `sensorless withheld make`")
    return found[:limit]


def run_all(
    folder: Path, work: dict[str, tuple[str, ...]], diagnose: Diagnose, reports: Path, jobs: int,
    progress: Callable[[float], None] | None = None,
) -> None:  # fmt: skip
    """Diagnose campaigns, each with effects excluded, that have no report yet; every finished one is kept."""
    reports.mkdir(parents=True, exist_ok=True)
    left = [(folder / CAMPAIGNS / n, x, reports) for n, x in work.items() if not (reports / f"{n}.json").exists()]
    for done, _ in enumerate(spread(partial(_one, diagnose), left, jobs), 1):
        if progress is not None:
            progress(done / len(left))


def _one(diagnose: Diagnose, item: tuple[Path, tuple[str, ...], Path]) -> None:
    """Diagnose one campaign; whatever goes wrong is written down as a miss, not raised."""
    campaign, exclude, reports = item
    try:
        content = plain(diagnose(campaign, exclude).json)
    except Exception as error:  # a failing campaign is a result
        content = {"campaign": campaign.name, "failed": f"{type(error).__name__}: {error}"}
    path = reports / f"{campaign.name}.json"
    aside = reports / f".{campaign.name}.part"
    aside.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    aside.replace(path)


def read_report(reports: Path, name: str) -> dict[str, Any]:
    """Return one stored diagnosis."""
    content: dict[str, Any] = json.loads((reports / f"{name}.json").read_text(encoding="utf-8"))
    return content


def opened(folder: Path) -> dict[str, Any]:
    """Return the truths by campaign; BadInput where the seal is not the file that was hashed."""
    data = (folder / SEAL).read_bytes()
    stated = (folder / HASH).read_text(encoding="utf-8").split()[0] if (folder / HASH).is_file() else "missing"
    found = hashlib.sha256(data).hexdigest()
    if found != stated:
        raise BadInput(f"{SEAL} has SHA-256 {found}, {HASH} says {stated}: the truth was changed; make the check anew")
    campaigns: dict[str, Any] = json.loads(data)["campaigns"]
    return campaigns


def table(scores: Sequence[Scores]) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the table of metrics, one column a method."""
    from sandbox.gap.withheld.metrics import GOALS

    names = list(dict.fromkeys(k for s in scores for k in s.figures))
    rows = [[n, GOALS.get(n, ""), *(_cell(s.figures.get(n)) for s in scores)] for n in names]
    return ["metric", "goal", *(s.method for s in scores)], rows


def _cell(f: Figure | None) -> str:
    if f is None or f.value is None or f.low is None or f.high is None:
        return "–"
    return f"{f.value:.3g} [{f.low:.3g}, {f.high:.3g}] n={f.n}"
