"""Has anything got worse since the last release?

`python -m experiments.releases` measures, in one run: position errors of two estimators with both beliefs on a short
staircase, what the diagnosis says of a small campaign with dead time, and what estimators cost in C against compiled
Python.  Errors and scores come with their noise: the standard deviation over seeds of the sensors' noise.  The entry
of this version in results/releases.json is made anew, the table releases.md has a column a release.  The suite makes
errors and scores again with one seed, and fails where they are worse than the last entry by more than LARGE deviations.
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"
KEPT = RESULTS / "releases.json"
SEEDS = (3, 4, 5, 6, 7)  # of a comparison; the first is the suite's
DRAWS = (5, 6, 7)  # of a campaign; likewise
LARGE = 5.0  # standard deviations: of forty numbers none goes so far by chance
LEAST = {"position": 0.01, "diagnosis": 0.01}  # degrees, shares: other machines and libraries
SIGN = {"position": 1.0, "diagnosis": -1.0}  # what should be small, what large
LEFT_OUT = ("pwm_delay", "current_sampling", "current_filter")


def errors(rows: Sequence[Any]) -> dict[str, float]:
    """Return the size of each row's mean position error (degrees) by what the row is."""
    return {
        f"{r.estimator}, {r.belief}, {'closed' if r.closed_loop else 'open'}, {r.load:g} of load": abs(r.error_deg.mean)
        for r in rows
    }


def scores(answers: Any, truth: str) -> dict[str, float]:
    """Return what a diagnosis is judged by, each a share that should be 1."""
    d = answers.diagnosis
    of_truth = sum(h.probability for h in d.hypotheses if h.effects == (truth,))
    place = answers.where[0].subsystem if answers.where else ""
    return {"probability of the truth": of_truth, "share closed": float(d.size.closed or 0.0),
            "first place is the inverter": float(place == "inverter")}  # fmt: skip


def worse(kept: Mapping[str, Any], kind: str, own: Mapping[str, float]) -> list[str]:
    """Return in words what is worse than a kept entry beyond its noise: errors that grew, scores that fell."""
    sign, told = SIGN[kind], []
    for name, entry in kept[kind].items():
        allowed = max(LARGE * entry["noise"], LEAST[kind])
        if sign * (own[name] - entry["value"]) > allowed:
            told.append(f"{name}: {own[name]:.4g}, was {entry['value']:.4g} with {allowed:.2g} allowed")
    return told


def last() -> dict[str, Any]:
    """Return the entry of the last release."""
    found: dict[str, Any] = json.loads(KEPT.read_text(encoding="utf-8"))[-1]
    return found


def spread(runs: Sequence[Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return the first run's values with the standard deviation over all runs."""
    return {n: {"value": x, "noise": statistics.pstdev(r[n] for r in runs)} for n, x in runs[0].items()}


def compared(seed: int) -> dict[str, float]:
    """Return the errors of the suite's short comparison for a seed."""
    from model.drive_files import load_drive
    from sandbox.drive.scenario import Scenario, Segment
    from sandbox.evaluation.compare import compare

    scenario = Scenario("two_steps", (Segment(0.2), Segment(0.3, 1.0, ramp=0.05)), settle=0.15)
    return errors(compare(load_drive("ipm_exchanged"), scenario, ("qnull", "ekf"), seed=seed).rows)


def diagnosed(seed: int) -> dict[str, float]:
    """Return the scores of the suite's small campaign with dead time for a seed."""
    from sandbox.gap.report.answers import answer
    from tests.sandbox.gap.conftest import DEAD_TIME, small_campaign

    return scores(answer(small_campaign({"dead_time.time": DEAD_TIME}, seed=seed), exclude=LEFT_OUT), "dead_time")


def costs() -> dict[str, float]:
    """Return what a closed-loop second costs in compiled Python over that with the same estimator in C, as last
    measured side by side (`c_estimators`)."""
    kept = json.loads((RESULTS / "c_estimators.json").read_text(encoding="utf-8"))["costs"]
    return {f"{name}, Python over C": c["python_loop_ms_s"] / c["c_loop_ms_s"] for name, c in kept.items()}


def table(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return lines of markdown: a column a release."""
    versions = [f"{e['version']} ({e['made']})" for e in entries]
    lines = [f"| what | {' | '.join(versions)} |", f"|---|{'--:|' * len(entries)}"]
    for kind in ("position", "diagnosis", "cost"):
        for name in dict.fromkeys(n for e in entries for n in e[kind]):
            cells = [_cell(e[kind].get(name)) for e in entries]
            lines.append(f"| {kind}: {name} | {' | '.join(cells)} |")
    return lines


def _cell(value: Any) -> str:
    if isinstance(value, dict):
        return f"{value['value']:.4g} ± {value['noise']:.1g}"
    return "" if value is None else f"{value:.3g}"


def main() -> None:
    """Measure, and keep the entry of this version."""
    from sandbox.output.provenance import version

    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    entries = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else []
    own = {
        "version": version(), "made": datetime.now(UTC).date().isoformat(),
        "position": spread([compared(s) for s in SEEDS]),
        "diagnosis": spread([diagnosed(s) for s in DRAWS]),
        "cost": costs(),
    }  # fmt: skip
    entries = [e for e in entries if e["version"] != own["version"]] + [own]
    KEPT.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
    lines = ["# Releases", "", "By `python -m experiments.releases`.", "", *table(entries)]
    (RESULTS / "releases.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(table(entries)))


if __name__ == "__main__":
    main()
