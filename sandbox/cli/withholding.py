"""The commands `withheld make` and `withheld score`: arguments, progress, files; light to
import."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from model.errors import BadInput
from sandbox.cli import arguments as take
from sandbox.output.files import results, write_json
from sandbox.output.provenance import Call, digest_of, made_by
from sandbox.output.tables import many, print_prose, print_table, progress_bar

if TYPE_CHECKING:
    from sandbox.withheld.scoring.tables_of_rows import Scores

Folder = Annotated[Path, Parameter(name="DIR")]
Kind = Literal["mixed", "controls", "pairs", "many", "outside"]
MapShare = Annotated[
    take.Number | None, take.usual("0.5; 0 where its data set is missing", "SHARE")
]


def make(
    folder: Folder,
    /,
    *,
    count: take.Count,
    seed: take.Seed = 0,
    kind: Kind = "mixed",
    cycles: Literal["practice", "scored"] = "scored",
    sizes: Literal["ladder", "published"] = "published",
    maps: MapShare = None,
    effects_from: take.EffectsFrom = (),
    jobs: take.Jobs = None,
    dask: take.Dask = None,
    quiet: take.Flag = False,
) -> None:
    """Draw drives, seal what is wrong with them, record a campaign of each.

    Parameters
    ----------
    folder
        folder for the check; an interrupted call goes on
    count
        how many campaigns
    seed
        seed of everything that is drawn
    kind
        mixed: none to three effects, or a cause outside the library; controls: shorter, without any
        effect; pairs: one operating point, where two effects look alike; many: four to ten effects
        at once; outside: a cause outside the library each, in every third campaign with an effect
        of it
    cycles
        what the drives do in the recordings: tune on practice, score on scored
    sizes
        sizes of effects: published ranges, or a ladder of multiples of medium ones
    maps
        share of a mixed check whose nominal model is a flux map, 0 to 1
    quiet
        print nothing but errors
    """
    from sandbox.engine.processes import Workers
    from sandbox.withheld.making.make import CheckPlan
    from sandbox.withheld.making.make import make as record
    from sandbox.withheld.making.map_motors import SHARE, map_families, no_maps
    from sandbox.withheld.making.mapped_drive import missing

    share = maps
    if share is None:  # the usual share, where it can be had
        share = SHARE if kind == "mixed" and map_families() else 0.0

    def announce(digest: str) -> None:
        """Print the seal's hash before anything is recorded."""
        if not quiet:
            print_prose(f"truth sealed, SHA-256 {digest}")
            if kind in ("mixed", "outside") and (reason := missing()):
                print_prose(reason)
            if kind == "mixed" and maps is None and not map_families():
                print_prose(
                    f"{no_maps()}; all campaigns of this check have quartic ones, as with --maps 0"
                )

    with progress_bar("recording", quiet) as progress:
        made = record(
            folder,
            CheckPlan(count, seed, kind, cycles, sizes, share),
            workers=Workers.asked(jobs, dask),
            announce=announce,
            progress=progress,
        )
    if not quiet:
        print_prose(
            f"{many(count, 'campaign')} in {made.folder / 'campaigns'}, {made.recorded} "
            "recorded now"
        )


def score(
    folder: Folder,
    /,
    *,
    limit: Annotated[take.Count | None, take.usual("all")] = None,
    leave_out: take.Share = 0.0,
    baselines: take.Flag = False,
    finished: take.Flag = False,
    again: take.Flag = False,
    allow_mixed: take.Flag = False,
    effects_from: take.EffectsFrom = (),
    jobs: take.Jobs = None,
    dask: take.Dask = None,
    quiet: take.Flag = False,
) -> None:
    """Diagnose every campaign blindly, then open the seal and score.

    Parameters
    ----------
    folder
        folder that `withheld make` wrote
    limit
        only the first so many campaigns
    leave_out
        diagnose this share of the single effects once more, the true effect (and what holds all of
        it) excluded
    baselines
        score the simple methods on the same campaigns, too
    finished
        run nothing; judge what has a report already
    again
        forget the reports of earlier calls
    allow_mixed
        take reports by several states of the code; figures of each, too
    quiet
        print nothing but errors
    """
    if finished and again:
        raise BadInput("--finished runs nothing and --again forgets what was run; give one of them")
    from sandbox.engine.processes import Workers
    from sandbox.withheld.baselines.methods import BASELINES
    from sandbox.withheld.making.make import HASH, SEAL
    from sandbox.withheld.scoring.blind import score as judge
    from sandbox.withheld.scoring.blind import standard
    from sandbox.withheld.scoring.check_figure import withheld_figure
    from sandbox.withheld.scoring.rows import FILE, write_rows
    from sandbox.withheld.scoring.running import Check
    from sandbox.withheld.scoring.tables_of_rows import content_of, table

    methods: dict[str, Any] = {"diagnosis": standard, **(BASELINES if baselines else {})}
    scored = []
    for method, diagnose in methods.items():
        with progress_bar(method, quiet) as progress:
            result = judge(
                Check(folder, diagnose, Workers.asked(jobs, dask), progress),
                method=method,
                limit=limit,
                leave_out=leave_out if method == "diagnosis" else 0.0,
                again=again,
                finished=finished,
                allow_mixed=allow_mixed,
            )
        scored.append(result)
    content = {**content_of(scored), "figure": "withheld.png", "rows": FILE}
    with results(folder, "withheld") as out:
        write_rows(out / FILE, (r for s in scored for r in s.rows))
        withheld_figure(content, out / "withheld.png")
        inputs = {name: digest_of(folder / name) for name in (SEAL, HASH)}
        made = made_by(
            Call("withheld score", {}, inputs), (path for path in out.iterdir() if path.is_file())
        )
        write_json(out, "withheld", content, made=made)
    if not quiet:
        print_table(f"{folder}: {many(len(scored[0].judged), 'campaign')}", *table(scored))
        for s in scored:
            _say(s)
        if leave_out and not scored[0].left_out:
            print_prose(
                "no single effect of medium size or more among these campaigns: "
                "nothing was left out"
            )
        print_prose(f"seal and hash agree; {FILE}, withheld.json and withheld.png in {folder}")


def _say(s: Scores) -> None:
    """Print what a reader of a method's figures should know."""
    if len(s.code) > 1:
        print_prose(
            f"reports of '{s.method}' come from {len(s.code)} versions of the code; see by_code of "
            "each"
        )
    for said, judged in (
        ("failed once more on {}, see their reports", (*s.followed, *s.left_out)),
        ("failed on {}, counted as missed", s.judged),
    ):
        if failed := [j.name for j in judged if j.failed]:
            print_prose(f"'{s.method}' {said.format(len(failed))}: {', '.join(failed[:5])}")
