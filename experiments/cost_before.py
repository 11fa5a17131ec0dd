"""What the one plant costs beside the three copies of every effect that it replaced, measured in
one run.

The state before (BEFORE) is taken out of the repository's history into a temporary folder; both
trees run the same probes in turns, each in a process of its own, on one thread, and the least CPU
time of several counts.  Writes results/plant/cost.{json,md}.

Run: python -m experiments.cost_before [--campaigns FOLDER ...]
(FOLDER: campaigns to diagnose, such as $SENSORLESS_RECORDINGS/practice/p01; ten minutes for two of
them)
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from sandbox.output.files import version, write_json

ROOT = Path(__file__).resolve().parents[1]
RESULTS = Path(__file__).parent / "results" / "plant"
BEFORE = (
    # the last state with an averaged loop and closed forms in the replay
    "89cffbbfcab0c3cad8aa7e92c82752020048b38e"
)
PROBE = Path(__file__).with_name("cost_probe.py")
TURNS = 3
GOALS = {
    "closed loop, no effects": 0.7,
    "closed loop, all effects": 0.5,
    "replay, dead time": 0.6,
    "replay, a diagnosis' mean": 0.6,
    "diagnosis": 0.7,
}


def probed(tree: Path, cache: Path, campaigns: list[str]) -> dict[str, Any]:
    """Return what the probes measure in a tree: CPU seconds by name."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    caches = {k: str(cache) for k in ("SENSORLESS_CACHE", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    done = subprocess.run(
        [sys.executable, "-B", str(PROBE), str(tree), *campaigns],
        env={**os.environ, **threads, **caches},
        cwd=tree,
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(json.loads(done.stdout.splitlines()[-1]))


def table(before: dict[str, float], now: dict[str, float], only_now: dict[str, float]) -> str:
    """Return the results as markdown."""
    lines = [
        "# What the plant costs",
        "",
        f"Written by `python -m experiments.cost_before` on {datetime.date.today()}, {version()}. "
        f"CPU time, one thread, the least of {TURNS} runs in turns; before: commit {BEFORE[:7]}.",
        "",
        "| | before | now | ratio | goal |",
        "|---|--:|--:|--:|--:|",
    ]
    for name, old in before.items():
        goal = next((g for k, g in GOALS.items() if name.startswith(k)), None)
        text = "" if goal is None else f"≤ {goal:g}"
        lines.append(f"| {name} | {old:.4g} | {now[name]:.4g} | {now[name] / old:.2f} | {text} |")
    if only_now:
        lines += [
            "",
            "| now alone | |",
            "|---|--:|",
            *(f"| {k} | {v:.4g} |" for k, v in only_now.items()),
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure both states and write what they cost."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument(
        "--campaigns", nargs="*", default=[], help="folders of campaigns to diagnose"
    )
    campaigns = [str(Path(c).resolve()) for c in parser.parse_args().campaigns]
    with tempfile.TemporaryDirectory() as place:
        old = Path(place) / "before"
        packed = subprocess.run(
            ["git", "archive", BEFORE], cwd=ROOT, capture_output=True, check=True
        ).stdout
        old.mkdir()
        subprocess.run(["tar", "-x", "-C", str(old)], input=packed, check=True)
        found: dict[str, list[dict[str, float]]] = {"before": [], "now": []}
        for turn in range(TURNS):
            for name, tree in (("before", old), ("now", ROOT)):
                found[name].append(
                    probed(tree, Path(place) / f"cache-{name}", campaigns if not turn else [])
                )
                print(f"turn {turn + 1} of {TURNS}, {name}", flush=True)
    least = {
        name: {k: min(turn[k] for turn in turns if k in turn) for k in turns[0]}
        for name, turns in found.items()
    }
    shared = {k: v for k, v in least["before"].items() if k in least["now"]}
    only_now = {k: v for k, v in least["now"].items() if k not in shared}
    RESULTS.mkdir(parents=True, exist_ok=True)
    (RESULTS / "cost.md").write_text(table(shared, least["now"], only_now), encoding="utf-8")
    write_json(RESULTS, "cost", {"before": BEFORE, "turns": TURNS, **least})


if __name__ == "__main__":
    main()
