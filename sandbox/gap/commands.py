"""The command `diagnose`: arguments, progress, files; light to import."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sandbox import report


def add_diagnose(add: Callable[..., Any]) -> None:
    """Add the command to the command line by its own `add`."""
    c = add(
        "diagnose",
        run_diagnose,
        "where a campaign's gap to the simulator lies, which effect causes it, how far it shrinks",
    )
    c.add_argument("campaign", type=Path, metavar="CAMPAIGN", help="folder with campaign.toml and its tables")
    c.add_argument("--nominal", choices=("linear",), help="leave the nominal model's saturation out")
    c.add_argument("--exclude", action="append", default=[], metavar="EFFECT", help="no candidate (may be repeated)")
    c.add_argument("--columns", type=Path, metavar="FILE.toml", help="names and units (sandbox/IMPORTING.md)")


def run_diagnose(options: argparse.Namespace) -> None:
    """Diagnose a campaign; write diagnosis.json, report.html and diagnosis.rrd."""
    from sandbox.gap.answers import answer, linear
    from sandbox.gap.contract import contract
    from sandbox.gap.report import print_answers, write_report
    from sandbox.gap.traces import write_traces
    from sandbox.importing import read_recordings

    folder = options.out or Path("sensorless-out") / options.command
    report.check_output(folder)
    campaign = read_recordings(options.campaign, options.columns)
    campaign = linear(campaign) if options.nominal else campaign
    exclude = [name.strip() for text in options.exclude for name in text.split(",") if name.strip()]
    with report.stage_bar("diagnosing", options.quiet) as progress:
        found = answer(campaign, exclude=exclude, workers=options.jobs or os.cpu_count() or 1, report=progress)
        with report.results(folder, "diagnosis") as out:
            progress("writing")
            write_report(out / "report.html", found)
            write_traces(out / "diagnosis.rrd", found)
            content = contract(
                found.diagnosis, found.where, found.position, found.following, found.remains, found.alike
            )
            report.write_json(out, "diagnosis", content, command="diagnose")
    if not options.quiet:
        print_answers(found)
        print(f"results in {folder}")
