"""How good is the diagnosis on the second bench, which was written from published equations and
imports nothing of it?

The plan stands here, and is committed before the first campaign is drawn: the seed, how many
campaigns of which kind, and the goals (`second_bench_scores.GOALS`).  Campaigns of all kinds are
made and diagnosed in turn, so that a run which ends early has seen each kind; those whose seal was
opened before come last (`OPENED`).  Rows (answer and truth of a campaign) are added to
results/second_bench/rows.jsonl one by one, and a run goes on where it was interrupted; a diagnosis
that fails counts as wrong.  What rivals answer on the same
campaigns stands in rivals.jsonl beside it (`sandbox/withheld/baselines`).

Run: python -m experiments.second_bench WORK [--hours H] [--jobs N]
         (2026-11-29: four minutes of the processor a campaign, the longest 13)
     python -m experiments.second_bench WORK --rivals susie,stepwise [--hours H] [--jobs N]
         (of campaigns that have a row)
     python -m experiments.second_bench --recompute          (the page from the rows)
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any, NamedTuple

from experiments.second_bench_scores import UNKNOWN, page
from experiments.testbench.make import make
from experiments.testbench.seal import unpack
from sandbox.gap.diagnose import Diagnosis, diagnosis_of
from sandbox.gap.excerpts import excerpted
from sandbox.gap.report.ranking import ranking
from sandbox.recordings.campaign import read_folder
from sandbox.withheld.baselines.methods import BASELINES
from sandbox.withheld.scoring.running import code_digest

SEED = 20261129
GROUPS = {"none": 40, "one": 60, "several": 40, "many": 30, "outside": 30}
AT_ONCE = 5  # campaigns of a kind that are drawn together
# batches of each kind whose seal was opened on 2026-11-29, when the code was mended by what they
# showed: they come last
OPENED = 1
RESULTS = Path(__file__).parent / "results" / "second_bench"
ROWS = RESULTS / "rows.jsonl"
RIVALS = RESULTS / "rivals.jsonl"


def places() -> list[tuple[str, int, int]]:
    """Return every campaign of the plan as its kind, a batch's number and its place in that, all
    kinds in turn in proportion to their counts; opened ones at the end."""
    blind, opened = [], []
    for kind, count in GROUPS.items():
        for k in range(count // AT_ONCE):
            for j in range(AT_ONCE):
                place = (k - OPENED) * AT_ONCE + j + 0.5
                own = blind if k >= OPENED else opened
                own.append((place / (count - OPENED * AT_ONCE), kind, k, j))
    return [(kind, k, j) for _, kind, k, j in [*sorted(blind), *sorted(opened)]]


def answered(d: Diagnosis) -> dict[str, Any]:
    """Return what a diagnosis says, as far as it is scored."""
    r = ranking(d, position=False)
    return {
        "sets": [{"effects": h.effects, "probability": h.probability} for h in d.hypotheses],
        "in_set": [h.effects for h in d.ambiguity_set],
        "chances": dict(r.inclusion.chances),
        "unknown": r.unknown,
        "parameters": {k: [e.value, e.low, e.high] for k, e in d.parameters[0].items()},
        "before": d.size.before,
        "after": d.size.after,
        "simulations": d.simulations,
    }


def one_row(folder: Path, name: str, kind: str, truth: dict[str, Any]) -> dict[str, Any]:
    """Return the row of a campaign: its answer, as `sensorless diagnose` gives it, and the truth
    that is looked at afterwards."""
    began = time.process_time()
    try:
        found: dict[str, Any] = answered(diagnosis_of(excerpted(read_folder(folder)), workers=1))
    except Exception as error:  # whatever it is, it counts as wrong
        found = {"failed": repr(error)}
    cpu = time.process_time() - began
    return {
        "name": name,
        "kind": kind,
        "code": code_digest(),
        "cpu": cpu,
        "found": found,
        "truth": truth,
    }


class Asked(NamedTuple):
    """A campaign of the plan that is to be diagnosed: its folder, name and kind, its truth, and the
    rival who does it ("": the diagnosis)."""

    folder: Path
    name: str
    kind: str
    truth: dict[str, Any]
    method: str = ""


def asked(work: Path, known: set[str]) -> Iterator[Asked]:
    """Yield the campaigns of the plan that have no row, each batch made when its turn comes."""
    truths: dict[tuple[str, int], dict[str, Any]] = {}
    for kind, k, j in places():
        folder = work / f"{kind}-{k}"
        if (kind, k) not in truths:
            make(folder, kind, AT_ONCE, SEED + k, quiet=True)
            truths[kind, k] = unpack(folder)["truths"]
        name = f"c{j:04d}"
        own = f"{kind}-{k}-{name}"
        if own not in known and (folder / name / "campaign.toml").exists():
            yield Asked(folder / name, own, kind, truths[kind, k][name])


def of_rivals(work: Path, methods: list[str], known: set[tuple[str, str]]) -> Iterator[Asked]:
    """Yield the campaigns that have a row, for each rival that has not answered on them."""
    for row in lines(ROWS):
        kind, k, name = row["name"].split("-")
        make(work / f"{kind}-{k}", kind, AT_ONCE, SEED + int(k), quiet=True)
        for method in methods:
            if (row["name"], method) not in known:
                folder = work / f"{kind}-{k}" / name
                yield Asked(folder, row["name"], kind, row["truth"], method)


def answer(one: Asked) -> dict[str, Any]:
    """Return the row of a campaign."""
    if one.method:
        return rival_row(one)
    return one_row(one.folder, one.name, one.kind, one.truth)


def run(tasks: Iterator[Asked], file: Path, hours: float, jobs: int) -> None:
    """Let campaigns be answered, so many at once, until all are or the time is over; each row is
    kept when it is there."""
    end = time.monotonic() + 3600.0 * hours
    RESULTS.mkdir(parents=True, exist_ok=True)
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=spawn) as pool:
        waiting: set[Future[dict[str, Any]]] = set()
        while True:
            while len(waiting) < jobs and time.monotonic() < end:
                one = next(tasks, None)
                if one is None:
                    break
                waiting.add(pool.submit(answer, one))
            if not waiting:
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                row = future.result()
                kept(file, row)
                print(said(row), flush=True)


def said(row: dict[str, Any]) -> str:
    """Return a row in one line."""
    found, truth = row["found"], row["truth"]
    first = (found.get("sets") or [{"effects": found.get("failed"), "probability": 1.0}])[0]
    true = [c["name"] for c in truth["causes"] + truth["outside"]]
    answered = f"{first['effects']} {first['probability']:.3f}"
    return f"{row['name']} {row.get('method', '')} {true} -> {answered} {row['cpu']:.0f} s"


def rival_row(one: Asked) -> dict[str, Any]:
    """Return what a rival answers on a campaign, in the form of its row."""
    began = time.process_time()
    try:
        answered = BASELINES[one.method](one.folder, ()).json["hypotheses"]
        found: dict[str, Any] = {
            "sets": [{k: h[k] for k in ("effects", "probability")} for h in answered]
        }
        named = sorted({e for h in answered for e in h["effects"]} - {UNKNOWN})
        found["chances"] = {
            e: sum(h["probability"] for h in answered if e in h["effects"]) for e in named
        }
    except Exception as error:  # whatever it is, it counts as wrong
        found = {"failed": repr(error)}
    return {
        "name": one.name,
        "kind": one.kind,
        "truth": one.truth,
        "code": code_digest(),
        "cpu": time.process_time() - began,
        "found": found,
        "method": one.method,
    }


def kept(file: Path, row: dict[str, Any]) -> None:
    """Add a row to a file."""
    with file.open("a", encoding="utf-8") as out:
        out.write(json.dumps(row, default=float) + "\n")


def lines(file: Path) -> list[dict[str, Any]]:
    """Return the rows of a file so far."""
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def main() -> None:
    """Run what is left, then write the page."""
    p = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("work", type=Path, nargs="?")
    p.add_argument("--hours", type=float, default=24.0)
    p.add_argument("--jobs", type=int, default=1, help="campaigns at once (default 1)")
    p.add_argument("--rivals", default="", help=f"of {', '.join(BASELINES)}; only these answer")
    p.add_argument("--recompute", action="store_true")
    a = p.parse_args()
    if a.work is None and not a.recompute:
        p.error("give a folder to work in, or --recompute")
    if a.jobs < 1:
        p.error(f"--jobs {a.jobs}: give 1 or more campaigns at once")
    methods = [m for m in a.rivals.split(",") if m]
    if not set(methods) <= set(BASELINES):
        p.error(f"--rivals {a.rivals}: give some of {', '.join(BASELINES)}")
    if not a.recompute and methods:
        known = {(r["name"], r["method"]) for r in lines(RIVALS)}
        run(of_rivals(a.work, methods, known), RIVALS, a.hours, a.jobs)
    elif not a.recompute:
        run(asked(a.work, {row["name"] for row in lines(ROWS)}), ROWS, a.hours, a.jobs)
    (RESULTS / "README.md").write_text(
        page(lines(ROWS), GROUPS, SEED, lines(RIVALS)), encoding="utf-8"
    )
    print(RESULTS / "README.md")


if __name__ == "__main__":
    main()
