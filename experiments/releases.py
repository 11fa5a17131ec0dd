"""Has anything got worse since the last release?

`python -m experiments.releases` measures, in one run: position errors of two estimators with both
beliefs on a short staircase, what the diagnosis says of a small campaign with dead time, and what
estimators cost in compiled Python against the same in C.  Errors and scores come with their noise:
the standard deviation over seeds of the sensors' noise; costs with that over BATCHES.  The entry of
this version in results/releases.json is made anew (`--only cost`: that part of it), the table
releases.md has a column a release.  The suite makes all of it again once, and fails where something
is worse than the last entry by more than LARGE deviations.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from estimators.contract import Estimator

RESULTS = Path(__file__).parent / "results"
KEPT = RESULTS / "releases.json"
SEEDS = (3, 4, 5, 6, 7)  # of a comparison; the first is the suite's
DRAWS = (5, 6, 7)  # of a campaign; likewise
LARGE = 5.0  # standard deviations: of forty numbers none goes so far by chance
# degrees, shares, ratios: other machines and libraries
LEAST = {"position": 0.01, "diagnosis": 0.01, "cost": 0.2}
SIGN = {"position": 1.0, "diagnosis": -1.0, "cost": 1.0}  # what should be small, what large
BATCHES, TURNS = 5, 7  # of costs: medians, and runs in turns of which each is the median
LEFT_OUT = ("pwm_delay", "current_sampling", "current_filter")


def errors(rows: Sequence[Any]) -> dict[str, float]:
    """Return the size of each row's mean position error (degrees) by what the row is."""
    return {
        (
            f"{r.estimator}, {r.belief}, {'closed' if r.closed_loop else 'open'}, {r.load:g} "
            "of load"
        ): abs(r.error_deg.mean)
        for r in rows
    }


def scores(answers: Any, truth: str) -> dict[str, float]:
    """Return what a diagnosis is judged by, each a share that should be 1."""
    d = answers.diagnosis
    of_truth = sum(h.probability for h in d.hypotheses if h.effects == (truth,))
    place = answers.where[0].subsystem if answers.where else ""
    return {
        "probability of the truth": of_truth,
        "share closed": float(d.size.closed or 0.0),
        "first place is the inverter": float(place == "inverter"),
    }


def worse(kept: Mapping[str, Any], kind: str, own: Mapping[str, float]) -> list[str]:
    """Return in words what is worse than a kept entry beyond its noise: errors that grew, scores
    that fell."""
    sign, text = SIGN[kind], []
    for name, entry in kept[kind].items():
        allowed = max(LARGE * entry["noise"], LEAST[kind])
        if sign * (own[name] - entry["value"]) > allowed:
            text.append(
                f"{name}: {own[name]:.4g}, was {entry['value']:.4g} with {allowed:.2g} allowed"
            )
    return text


def last() -> dict[str, Any]:
    """Return the entry of the last release."""
    found: dict[str, Any] = json.loads(KEPT.read_text(encoding="utf-8"))[-1]
    return found


def spread(runs: Sequence[Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return the first run's values with the standard deviation over all runs."""
    return {
        n: {"value": x, "noise": statistics.pstdev(r[n] for r in runs)} for n, x in runs[0].items()
    }


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

    return scores(
        answer(small_campaign({"dead_time.time": DEAD_TIME}, seed=seed), exclude=LEFT_OUT),
        "dead_time",
    )


def costs(libraries: Mapping[str, Estimator]) -> dict[str, float]:
    """Return what a closed-loop second costs in compiled Python over that with the same estimator
    in C (`libraries`): the median of runs in turns, by processor time."""
    from estimators.registry import load_estimator
    from model.drive_files import load_drive
    from sandbox.drive.scenario import Scenario, Segment
    from sandbox.drive.simulate import simulate

    drive, scenario, found = load_drive("ipm_exchanged"), Scenario("a_second", (Segment(1.0),)), {}
    for name, library in libraries.items():
        both = load_estimator(name), library
        ratios = []
        for _ in range(TURNS + 1):
            python, c = (simulate(drive, scenario, which).cpu_seconds for which in both)
            ratios.append(python / c)
        found[f"{name}, Python over C"] = statistics.median(ratios[1:])  # the first one compiles
    return found


def measured_costs() -> dict[str, dict[str, float]]:
    """Return costs with their noise over BATCHES, the C sources compiled here."""
    from estimators.c import generate
    from estimators.c.build import build
    from estimators.registry import load_estimator

    with tempfile.TemporaryDirectory() as made:
        built = {
            n: load_estimator(build(generate.HERE / f"{n}.c", Path(made))) for n in generate.NAMES
        }
        return spread([costs(built) for _ in range(BATCHES)])


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

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=["cost"], help="make this part of the entry anew")
    only, today = parser.parse_args().only, datetime.now(UTC).date().isoformat()
    entries = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else []
    if only:
        made = entries[-1]["made"].partition(";")[0]
        own = entries[-1] | {"made": f"{made}; cost {today}", "cost": measured_costs()}
    else:
        own = {
            "version": version(),
            "made": today,
            "position": spread([compared(s) for s in SEEDS]),
            "diagnosis": spread([diagnosed(s) for s in DRAWS]),
            "cost": measured_costs(),
        }
    entries = [e for e in entries if e["version"] != own["version"]] + [own]
    KEPT.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
    lines = ["# Releases", "", "By `python -m experiments.releases`.", "", *table(entries)]
    (RESULTS / "releases.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(table(entries)))


if __name__ == "__main__":
    main()
