"""The commands `withheld make` and `withheld score`: arguments, progress, files; light to import."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sandbox.cli.arguments import add_own_effects
from sandbox.cli.sweeping import on_dask
from sandbox.output.files import results, write_json
from sandbox.output.provenance import Call, digest_of, made_by
from sandbox.output.tables import many, print_prose, print_table, progress_bar

Number = Callable[[str], int]
ROWS = "withheld.rows.jsonl"


def add_withheld(commands: Any, parser_class: Any, positive: Number, seed: Number) -> None:
    """Add both steps to the command line; positive, seed: how it reads such numbers."""
    text = "how good the diagnosis is: sealed campaigns, blind diagnoses, scores"
    steps = commands.add_parser("withheld", help=text, description=text).add_subparsers(
        dest="step", required=True, metavar="STEP", parser_class=parser_class
    )
    text = "draw drives, seal what is wrong with them, record a campaign of each"
    c = steps.add_parser("make", help=text, description=text)
    c.set_defaults(run=run_make)
    c.add_argument("folder", type=Path, metavar="DIR", help="folder for the check; an interrupted call goes on")
    c.add_argument("--count", type=positive, required=True, help="how many campaigns")
    c.add_argument("--seed", type=seed, default=0, help="seed of everything that is drawn (0)")
    c.add_argument(
        "--kind",
        default="mixed",
        choices=("mixed", "controls", "pairs", "many", "outside"),
        help="mixed: none to three effects, or a cause outside the library; controls: shorter, without any effect; "
        "pairs: one operating point, where two effects look alike; many: four to ten effects at once; "
        "outside: a cause outside the library each, in every third campaign with an effect of it (mixed)",
    )
    text = "what the drives do in the recordings: tune on practice, score on scored (scored)"
    c.add_argument("--cycles", default="scored", choices=("practice", "scored"), help=text)
    c.add_argument(
        "--sizes",
        default="published",
        choices=("ladder", "published"),
        help="sizes of effects: published ranges, or a ladder of multiples of medium ones (published)",
    )
    text = "share of a mixed check whose nominal model is a flux map, 0 to 1 (0.5; 0 where its data set is missing)"
    c.add_argument("--maps", type=float, metavar="SHARE", help=text)
    _common(c, positive)
    text = "diagnose every campaign blindly, then open the seal and score"
    c = steps.add_parser("score", help=text, description=text)
    c.set_defaults(run=run_score)
    c.add_argument("folder", type=Path, metavar="DIR", help="folder that `withheld make` wrote")
    c.add_argument("--limit", type=positive, help="only the first so many campaigns (all)")
    text = "diagnose this share of the single effects once more, the true effect (and what holds all of it) excluded"
    c.add_argument("--leave-out", type=float, default=0.0, metavar="SHARE", help=text)
    c.add_argument("--baselines", action="store_true", help="score the simple methods on the same campaigns, too")
    either = c.add_mutually_exclusive_group()
    either.add_argument("--finished", action="store_true", help="run nothing; judge what has a report already")
    either.add_argument("--again", action="store_true", help="forget the reports of earlier calls")
    c.add_argument(
        "--allow-mixed", action="store_true", help="take reports by several states of the code; figures of each, too"
    )
    _common(c, positive)


def _common(command: Any, positive: Number) -> None:
    add_own_effects(command)
    command.add_argument("--jobs", type=positive, help="processes (all cores)")
    on_dask(command)
    command.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run_make(options: argparse.Namespace) -> None:
    """Make a check; the seal's hash is printed before anything is recorded."""
    from sandbox.withheld.making.make import make
    from sandbox.withheld.making.map_motors import SHARE, map_families, no_maps
    from sandbox.withheld.making.mapped_drive import missing

    maps = options.maps
    if maps is None:  # the usual share, where it can be had
        maps = SHARE if options.kind == "mixed" and map_families() else 0.0

    def announce(digest: str) -> None:
        """Print the seal's hash before anything is recorded."""
        if not options.quiet:
            print_prose(f"truth sealed, SHA-256 {digest}")
            if options.kind in ("mixed", "outside") and (reason := missing()):
                print_prose(reason)
            if options.kind == "mixed" and options.maps is None and not map_families():
                print_prose(f"{no_maps()}; all campaigns of this check have quartic ones, as with --maps 0")

    with progress_bar("recording", options.quiet) as progress:
        made = make(
            options.folder, options.count, options.seed, kind=options.kind, style=options.cycles, sizes=options.sizes,
            maps=maps, jobs=options.jobs or os.cpu_count() or 1, cluster=options.dask, announce=announce,
            progress=progress,
        )  # fmt: skip
    if not options.quiet:
        print_prose(f"{many(options.count, 'campaign')} in {made.folder / 'campaigns'}, {made.recorded} recorded now")


def run_score(options: argparse.Namespace) -> None:
    """Score a check; write its rows, the figures that follow from them and their page into its folder."""
    from sandbox.withheld.baselines.methods import BASELINES
    from sandbox.withheld.making.make import HASH, SEAL
    from sandbox.withheld.scoring.blind import score, standard
    from sandbox.withheld.scoring.check_figure import withheld_figure
    from sandbox.withheld.scoring.rows import write_rows
    from sandbox.withheld.scoring.tables_of_rows import content_of, table

    methods: dict[str, Any] = {"diagnosis": standard, **(BASELINES if options.baselines else {})}
    scored = []
    for method, diagnose in methods.items():
        with progress_bar(method, options.quiet) as progress:
            result = score(
                options.folder, diagnose, method=method, jobs=options.jobs or os.cpu_count() or 1,
                limit=options.limit, leave_out=options.leave_out if method == "diagnosis" else 0.0,
                again=options.again, finished=options.finished, allow_mixed=options.allow_mixed, cluster=options.dask,
                progress=progress,
            )  # fmt: skip
        scored.append(result)
    content = {**content_of(scored), "figure": "withheld.png", "rows": ROWS}
    with results(options.folder, "withheld") as out:
        write_rows(out / ROWS, (r for s in scored for r in s.rows))
        withheld_figure(content, out / "withheld.png")
        inputs = {name: digest_of(options.folder / name) for name in (SEAL, HASH)}
        made = made_by(Call("withheld score", {}, inputs), (path for path in out.iterdir() if path.is_file()))
        write_json(out, "withheld", content, made=made)
    if not options.quiet:
        print_table(f"{options.folder}: {many(len(scored[0].judged), 'campaign')}", *table(scored))
        for s in scored:
            if len(s.code) > 1:
                print_prose(
                    f"reports of '{s.method}' come from {len(s.code)} versions of the code; see by_code of each"
                )
            failed = [j.name for j in s.judged if j.failed]
            more = [j.name for j in (*s.followed, *s.left_out) if j.failed]
            if more:
                print_prose(f"'{s.method}' failed once more on {len(more)}, see their reports: {', '.join(more[:5])}")
            if options.leave_out and s is scored[0] and not s.left_out:
                print_prose("no single effect of medium size or more among these campaigns: nothing was left out")
            if failed:
                print_prose(f"'{s.method}' failed on {len(failed)}, counted as missed: {', '.join(failed[:5])}")
        print_prose(f"seal and hash agree; {ROWS}, withheld.json and withheld.png in {options.folder}")
