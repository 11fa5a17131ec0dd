"""How good is the diagnosis on campaigns of the second simulator whose effect is withheld, beside simple methods?

200 campaigns with scored cycles, 300 controls without a gap and 140 narrow campaigns where pairs of effects look alike,
drawn from seeds never used while tuning (the controls' served one check before, too); single effects once more with the
true one taken out of the library; the simple methods on all of the 200.  Everything is made and diagnosed in WORK and
goes on where it was interrupted; tables and the figure pages are written to results/withheld/.

Run: python -m experiments.withheld_check WORK [JOBS]   (about 1.7 hours on two cores)
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from datetime import date
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results" / "withheld"
CHECKS = {"mixed": (200, 20261141), "controls": (300, 20261132), "pairs": (140, 20261143)}  # campaigns, seed
LEFT_OUT = 0.4  # of single effects of medium size or more


def sensorless(*arguments: object) -> None:
    """Run one step of the command line; its progress and tables go to the terminal."""
    subprocess.run([sys.executable, "-m", "sandbox.cli", *map(str, arguments)], check=True)


def make(folder: Path, kind: str, count: int, seed: int, jobs: int) -> None:
    """Make a check unless it is there."""
    more = ["--kind", kind, "--jobs", jobs]
    sensorless("withheld", "make", folder, "--count", count, "--seed", seed, *more)


def cell(figure: Any) -> str:
    """Return a figure with its limits for a table."""
    if not isinstance(figure, dict) or figure.get("value") is None:
        return "–"
    low, high = figure.get("low"), figure.get("high")
    between = ", ".join("–" if x is None else f"{x:.3g}" for x in (low, high))
    return f"{figure['value']:.3g} [{between}], n = {figure['n']}"


def table(content: dict[str, Any], goals: dict[str, str]) -> list[str]:
    """Return the table of metrics that have a value, a column a method."""
    methods = content["methods"]
    told = [{k for k, v in m.items() if isinstance(v, dict) and v.get("value") is not None} for m in methods.values()]
    names = [k for k in methods["diagnosis"] if any(k in t for t in told)]
    lines = [f"| metric | goal | {' | '.join(methods)} |", "|---|---|" + "---|" * len(methods)]
    lines += [f"| {n} | {goals.get(n, '')} | {' | '.join(cell(m.get(n)) for m in methods.values())} |" for n in names]
    return lines


def details(method: dict[str, Any]) -> list[str]:
    """Return how single effects fare by size, which campaigns were missed and which recordings settled nothing."""
    sizes = ", ".join(f"{s}: {cell(f['top1'])}" for s, f in method["by_size"].items())
    lines = [f"Top-1 of single effects by size: {sizes}.", ""] if sizes else []
    for key, text in (("missed", "First hypothesis wrong"), ("unresolved", "Not settled by the recommended recording")):
        told = "; ".join(" ".join(x).replace("_", " ") for x in method[key])
        lines += [f"{text}: {told}.", ""] if told else []
    return lines


def main(work: Path, jobs: int) -> None:
    """Run whatever is left of the check and write its results."""
    from sandbox.gap.withheld.metrics import GOALS

    for kind, (count, seed) in CHECKS.items():
        make(work / kind, kind, count, seed, jobs)
    RESULTS.mkdir(parents=True, exist_ok=True)
    lines = [
        f"Made {date.today()} by `python -m experiments.withheld_check`; limits are one-sided 95 %. What each metric"
    ]
    lines += ["counts is said in [the check's README](../../../sandbox/gap/withheld/README.md)."]
    lines += ["Confusion, reliability and detection floors: [mixed.png](mixed.png), [pairs.png](pairs.png).", ""]
    for name, kind, options, title in (
        ("mixed", "mixed", ["--leave-out", LEFT_OUT], "Campaigns with one to three effects, none, or one outside"),
        ("pairs", "pairs", [], "Narrow campaigns: pairs that look alike"),
        ("controls", "controls", [], "Controls without a gap"),
        ("baselines", "mixed", ["--baselines"], "Simple methods on the mixed campaigns"),
    ):
        folder = work / kind
        sensorless("withheld", "score", folder, *options, "--jobs", jobs)
        content = json.loads((folder / "withheld.json").read_text())
        lines += [f"## {title}", "", f"Seal SHA-256 `{(folder / 'SHA256').read_text().split()[0]}`.", ""]
        lines += [
            *table(content, GOALS),
            "",
            *(details(content["methods"]["diagnosis"]) if name != "baselines" else []),
        ]
        for suffix in (".json", ".png"):
            shutil.copyfile(folder / f"withheld{suffix}", RESULTS / f"{name}{suffix}")
    (RESULTS / "README.md").write_text("\n".join(lines))
    print(RESULTS / "README.md")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 2)
