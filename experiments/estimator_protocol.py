"""Which estimator for which motor: the whole protocol, every family with both beliefs on four
motors.

python -m experiments.estimator_protocol [--peer-python PYTHON] [--jobs N | --dask ADDRESS | --page]
    writes results/estimator_protocol.{json,md,png} and the table of estimators/LIMITS.md; --page:
    nothing is run, page, table and figure anew from the JSON

The table of README.md and the account in estimators/LIMITS.md quote these files.  An interrupted
run goes on where it stopped.  With a Python that has motulator 0.18 the reversal is measured beside
it in the same run.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from textwrap import fill

from experiments.drawing import RESULTS, save
from experiments.on_cluster import on_dask
from sandbox.engine.processes import Workers
from sandbox.evaluation.bench import peer
from sandbox.evaluation.pages.protocol_cells import reading, table, tables
from sandbox.evaluation.pages.protocol_figure import protocol_figure
from sandbox.evaluation.protocol import Protocol, Row, Unit, forget, protocol
from sandbox.evaluation.protocol_names import LINES
from sandbox.evaluation.protocol_tests import MEAN_GOAL, P95_GOAL, Outcome
from sandbox.output.columns import write_table
from sandbox.output.files import check_output, version
from sandbox.output.provenance import commit
from sandbox.public.protocols import ProtocolResult

ANCHORS = Path("../shared/anchors")
NAME = "estimator_protocol"
LIMITS = Path(__file__).resolve().parents[1] / "estimators" / "LIMITS.md"
FAILURES = {
    "static_map": "static map",
    "load_step": "load step",
    "creep": "creep",
    "hand_over": "hand-over",
    "mission": "mission",
}
WIDEST = 5  # tests side by side
LEGEND = """\
Each line is an estimator with its belief, saturated or linear. ✓ and ✗ say whether the goal beside them is met. ○ says
that what stands beside it holds, while the error itself is beyond the goal of 1 (3)°, or starts end at the wrong pole,
or the drive did not reach its speed in time; *as theory* is an error as large as theory foretells for a linear belief.
Without a mark there is no goal. A cell of a test of position gives the worst mean error and, in brackets, the worst
error that 95 % of the samples stay below, in electrical degrees. It looks at loads up to 180 %, and where the ripple
carries information. *Lost* counts the parts of the test in which lock was lost, *slow* those in which the drive did not
reach the speed asked for in time."""  # noqa: E501


def markdown(result: Protocol, made: str) -> str:
    """Return the result page: every motor's table, worst figures of each test; made: when, and by
    which code."""
    cpu = sum(row.cpu_seconds for row in result.rows)
    tests = "\n".join(
        fill(f"- **{name}**: {line}.", 120, subsequent_indent="  ") for name, line in LINES.items()
    )
    blocks = [
        "# Protocol of all estimators",
        f"{made}: {cpu:.0f} s of processor time.",
        LEGEND,
        tests,
    ]
    if result.peer:
        blocks.append(
            f"motulator's reversal in the same run: {result.peer[1]:.2f}° rms, "
            f"{result.peer[0]:.2f} CPU s/s."
        )
    for motor in dict.fromkeys(row.unit.motor for row in result.rows):
        blocks += [f"## {motor}", *folded(*table(result, motor))]
    return "\n\n".join(blocks) + "\n"


def folded(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> list[str]:
    """Return a wide table as several of at most WIDEST tests, each with the first column."""
    out = []
    for k in range(1, len(heads), WIDEST):
        rows = [[row[0], *row[k : k + WIDEST]] for row in (heads, *lines)]
        rows = [row for row in rows if any(row[1:])]  # what no estimator of its own is asked for
        rows.insert(1, ["---"] * len(rows[0]))
        out.append("\n".join(f"| {' | '.join(row)} |" for row in rows))
    return out


def failing(row: Row) -> str:
    """Return a failed test's name with its worst mean (else p95) where it is beyond the goal, and
    the parts lost."""
    m = row.outcome.metrics
    mean, p95, lost = m.get("mean_deg"), m.get("p95_deg"), m.get("lost")
    said = []
    if mean is not None and abs(mean) > MEAN_GOAL:
        said.append(f"{abs(mean):.1f}")
    elif p95 is not None and p95 > P95_GOAL:
        said.append(f"p95 {p95:.1f}")
    said += [f"{lost:.0f} lost"] * bool(lost)
    return FAILURES[row.unit.test] + (f" ({', '.join(said)})" if said else "")


def verdicts(result: Protocol) -> str:
    """Return the table of what fails with a saturated belief (FAILURES), estimators of one verdict
    together."""
    rows = [r for r in result.rows if r.unit.belief == "saturated" and r.unit.test in FAILURES]
    motors = list(dict.fromkeys(r.unit.motor for r in rows))
    same: dict[tuple[str, ...], list[str]] = {}
    for name in dict.fromkeys(r.unit.estimator for r in rows):
        own = [r for r in rows if r.unit.estimator == name and not r.outcome.passed]
        failed = ("; ".join(failing(r) for r in own if r.unit.motor == motor) for motor in motors)
        same.setdefault(tuple(cell or "all passed" for cell in failed), []).append(f"`{name}`")
    order = sorted(same.items(), key=lambda item: -item[0].count("all passed"))
    lines = [["estimator", *(f"`{motor}`" for motor in motors)], ["---"] * (1 + len(motors))]
    lines += [[", ".join(names), *cells] for cells, names in order]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def with_table(text: str, table: str) -> str:
    """Return a page with a table in place of the one that has the same heads."""
    begin = text.index(table.split("\n", 1)[0])
    return text[:begin] + table + text[text.index("\n\n", begin) :]


def kept() -> tuple[Protocol, str]:
    """Return the protocol that the JSON keeps, without its points, and when and by which code it
    was made."""
    found = json.loads((RESULTS / f"{NAME}.json").read_text(encoding="utf-8"))
    rows = [
        Row(
            Unit(*(r[f.name] for f in fields(Unit))),
            Outcome((), r["metrics"], r["passed"]),
            r["cpu_seconds"],
            r["failure"],
        )
        for r in found["tests"]
    ]
    reversal = found["peer"] and (found["peer"]["cpu_s_per_s"], found["peer"]["rms_deg"])
    return Protocol(tuple(rows), found["seed"], reversal), stamp(
        found["date"], found["version"], found["commit"]
    )


def stamp(date: str, release: str, state: str | None) -> str:
    """Return when and by which code a protocol was made, in words."""
    return f"{date}, {release}, commit {(state or 'unknown')[:8]}"


def draw(result: Protocol, made: str) -> None:
    """Write page and figure, and print the page."""
    text = markdown(result, made)
    (RESULTS / f"{NAME}.md").write_text(text, encoding="utf-8")
    LIMITS.write_text(
        with_table(LIMITS.read_text(encoding="utf-8"), verdicts(result)), encoding="utf-8"
    )
    protocol_figure(tables(result), reading(result), RESULTS / f"{NAME}.png")
    print(text)


def main() -> None:
    """Run, print, keep."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--peer-python", help="Python >= 3.12 that has motulator 0.18")
    arguments.add_argument("--jobs", type=int, default=2)
    on_dask(arguments)
    arguments.add_argument("--page", action="store_true")
    options = arguments.parse_args()
    if options.page:
        draw(*kept())
        return
    folder = Path("sensorless-out") / NAME
    check_output(folder)
    folder.mkdir(parents=True, exist_ok=True)
    result = protocol(workers=Workers(options.jobs, options.dask), keep=folder)
    if options.peer_python:
        result = result.with_reversal_of(*peer(ANCHORS, options.peer_python, "lin", 4.0))
    draw(result, stamp(time.strftime("%Y-%m-%d"), version(), commit()))
    write_table(folder / f"{NAME}.parquet", ProtocolResult(result).to_table())
    save(NAME, {"version": version(), "commit": commit(), **result.as_json()})
    forget(folder)


if __name__ == "__main__":
    main()
