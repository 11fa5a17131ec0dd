"""Which estimator for which motor: the whole protocol, every family with both beliefs on four motors.

python -m experiments.estimator_protocol [--peer-python PYTHON] [--jobs N | --dask ADDRESS]
    writes results/estimator_protocol.{json,md,png}

The table of README.md and the account in estimators/LIMITS.md quote these files.  An interrupted run goes on where it
stopped.  With a Python that has motulator 0.18 the reversal is measured beside it in the same run.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from experiments.drawing import RESULTS, save
from sandbox.cli.sweeping import on_dask
from sandbox.evaluation.bench import peer
from sandbox.evaluation.protocol import READING, Protocol, forget, protocol, table, tables
from sandbox.output.columns import write_table
from sandbox.output.files import output_folder, version
from sandbox.output.plots import protocol_figure
from sandbox.public.protocols import ProtocolResult

ANCHORS = Path("../shared/anchors")
NAME = "estimator_protocol"


def markdown(result: Protocol, date: str) -> str:
    """Return every motor's table, worst figures per test."""
    cpu = sum(row.cpu_seconds for row in result.rows)
    blocks = [f"Protocol of {date}, {version()}: {cpu:.0f} s of CPU.", READING]
    if result.peer:
        blocks.append(f"motulator's reversal in the same run: {result.peer[1]:.2f}° rms, {result.peer[0]:.2f} CPU s/s.")
    for motor in dict.fromkeys(row.unit.motor for row in result.rows):
        heads, lines = table(result, motor)
        rows = [f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *lines)]
        blocks.append("\n".join([f"**{motor}**", "", *rows]))
    return "\n\n".join(blocks) + "\n"


def main() -> None:
    """Run, print, keep."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--peer-python", help="Python >= 3.12 that has motulator 0.18")
    arguments.add_argument("--jobs", type=int, default=2)
    on_dask(arguments)
    options = arguments.parse_args()
    folder = output_folder(Path("sensorless-out") / NAME)
    result = protocol(jobs=options.jobs, keep=folder, cluster=options.dask)
    if options.peer_python:
        result = result.beside(*peer(ANCHORS, options.peer_python, "lin", 4.0))
    text = markdown(result, time.strftime("%Y-%m-%d"))
    (RESULTS / f"{NAME}.md").write_text(text, encoding="utf-8")
    protocol_figure(tables(result), READING, RESULTS / f"{NAME}.png")
    write_table(folder / f"{NAME}.parquet", ProtocolResult(result).to_table())
    save(NAME, {"version": version(), **result.as_json()})
    forget(folder)
    print(text)


if __name__ == "__main__":
    main()
