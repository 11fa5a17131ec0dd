"""How good is the diagnosis on campaigns of the second simulator whose effect is withheld, beside
simple methods?

100 campaigns with scored cycles, 30 with four to ten effects at once, 40 with a cause outside the
library each, 300 controls without a gap, 20 narrow campaigns where pairs of effects look alike, and
100 campaigns with the ladder's sizes in place of published ones (what it is worth that the prior
knows them); single effects of the first 100 once more with the true one taken out of the library;
the simple methods on them, too. Everything is made and diagnosed in WORK and goes on where it was
interrupted.  Kept in results/withheld/: a row a diagnosis (NAME.rows.jsonl) and the opened seal
(NAME.truth.json); all else there is computed from these two alone, but NOTES.md.  The page says
what was not run.

Run: python -m experiments.withheld_check WORK [--jobs N] [--only NAME ...]   (hours)
     python -m experiments.withheld_check WORK --finished [--only NAME ...]
         (rows that `score` has left in WORK/NAME)
     python -m experiments.withheld_check --recompute                         (seconds)
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments import screens
from experiments import withheld_words as words
from experiments.withheld_figure import page_figure
from experiments.withheld_wins import split
from model.errors import BadInput
from sandbox.output.files import write_json
from sandbox.output.tables import many
from sandbox.withheld.making.make import SEAL
from sandbox.withheld.scoring.chances import calibration_error
from sandbox.withheld.scoring.judge import label_of
from sandbox.withheld.scoring.metrics import GOALS, by_subsystem
from sandbox.withheld.scoring.rows import BLIND, FILE, Row, check_seal, one_code, read_rows
from sandbox.withheld.scoring.tables_of_rows import by_method, content_of, scored

RESULTS = Path(__file__).parent / "results" / "withheld"
OWN = "diagnosis"  # the project's own method
BASELINES = "baselines"  # after a check's name: file of all methods' figures
# of what would be right if chances held: the 95th percentile scatters by some 2 % of itself
DRAWS = 2000


class Check(NamedTuple):
    """One check: how many campaigns of which kind, their seed, where sizes come from, what else
    `score` is asked."""

    title: str
    kind: str
    campaigns: int
    seed: int
    sizes: str = "published"
    options: tuple[str, ...] = ()


CHECKS = {
    "mixed": Check(
        "Campaigns with one to three effects, none, or one outside",
        "mixed",
        100,
        20262801,
        options=("--leave-out", "1", "--baselines"),
    ),
    "pairs": Check("Narrow campaigns: pairs that look alike", "pairs", 20, 20262805),
    "many": Check(
        "Campaigns of four to ten effects at once", "many", 30, 20262803, options=("--baselines",)
    ),
    "outside": Check(
        "Campaigns of one cause outside the library each",
        "outside",
        40,
        20262804,
        options=("--baselines",),
    ),
    "controls": Check("Controls without a gap", "controls", 300, 20262802),
    "ladder": Check(
        "The same with the ladder's sizes and deviations as stated",
        "mixed",
        100,
        20261224,
        "ladder",
    ),
}


def sensorless(*arguments: object) -> None:
    """Run one step of the command line; its progress and tables go to the terminal."""
    subprocess.run([sys.executable, "-m", "sandbox.cli", *map(str, arguments)], check=True)


def run(name: str, work: Path, jobs: int, results: Path = RESULTS) -> None:
    """Make and score one check, or what is left of it; keep its rows and its seal."""
    check, folder = CHECKS[name], work / name
    drawn = (
        "--kind",
        check.kind,
        "--count",
        check.campaigns,
        "--seed",
        check.seed,
        "--sizes",
        check.sizes,
    )
    sensorless("withheld", "make", folder, *drawn, "--jobs", jobs)
    sensorless("withheld", "score", folder, *check.options, "--jobs", jobs)
    keep(name, folder, results)


def keep(name: str, folder: Path, results: Path = RESULTS) -> None:
    """Keep the rows and the opened seal of a scored check; BadInput where it is not scored yet."""
    if not (folder / FILE).is_file():
        raise BadInput(
            f"'{folder}' holds no {FILE}; run `sensorless withheld score` on it, with "
            "--finished for a part"
        )
    results.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / FILE, results / f"{name}.rows.jsonl")
    shutil.copyfile(folder / SEAL, results / f"{name}.truth.json")


class Kept(NamedTuple):
    """What is kept of a check: its rows, and its seal in a line of the page (hash, seed, how many
    were diagnosed)."""

    rows: list[Row]
    said: str


def kept(name: str, results: Path) -> Kept:
    """Return what is kept of a check.

    BadInput where its rows are not of its seal, a diagnosis has two of them, or the seal is not
    that of CHECKS.
    """
    text = (results / f"{name}.truth.json").read_bytes()
    rows, seal = read_rows(results / f"{name}.rows.jsonl"), json.loads(text)
    check_seal(rows, seal)
    check, sealed = CHECKS[name], len(seal["campaigns"])
    found = [seal.get(k) for k in ("kind", "seed", "style", "sizes")]
    asked = [check.kind, check.seed, "scored", check.sizes]
    if found != asked or sealed != check.campaigns:
        raise BadInput(
            f"'{name}' was sealed as {found} with {sealed} campaigns, not as {asked} with "
            f"{check.campaigns}; correct CHECKS or keep the run that it names"
        )
    if len({(r.method, r.part, r.campaign) for r in rows}) < len(rows):
        raise BadInput(
            f"'{name}.rows.jsonl' has two rows of one diagnosis; score the check once more"
        )
    blind = [r for r in rows if r.method == OWN and r.part == BLIND]
    said = (
        f"Seed {check.seed}, sizes {check.sizes}, seal SHA-256 "
        f"`{hashlib.sha256(text).hexdigest()}`; {len(blind)}"
    )
    return Kept(
        rows,
        f"{said} of {sealed} campaigns diagnosed, code "
        f"`{' '.join(sorted({r.code for r in blind}))}`.",
    )


def recompute(results: Path = RESULTS) -> list[str]:
    """Write every figure, table and page anew from rows and seals alone; return the names of the
    checks found.

    Figures of checks without rows are taken away.  BadInput where there is no check, or where their
    diagnoses come from several states of the code.
    """
    found = {
        name: kept(name, results) for name in CHECKS if (results / f"{name}.rows.jsonl").is_file()
    }
    if not found:
        raise BadInput(f"'{results}' holds no rows of a check; run it first")
    every = [r for check in found.values() for r in check.rows]
    one_code([r for r in every if r.method == OWN], "this page")
    lines = head(list(found), max(r.made for r in every)[:10])
    contents = {}
    for name, (rows, said) in found.items():
        own, others = [r for r in rows if r.method == OWN], {r.method for r in rows} - {OWN}
        content = contents[name] = page(name, own, results)
        lines += [
            f"## {CHECKS[name].title}",
            "",
            said,
            "",
            *table(content, GOALS),
            "",
            *drawing(name),
            *details(content),
        ]
        judged = scored(own).judged
        lines += if_chances_held(
            [j.top_probability for j in judged if j.kind == "one" and not j.failed]
        )
        if others:
            both = f"{name}_{BASELINES}"
            contents[both] = page(both, rows, results)
            lines += [
                "### Simple methods on the same campaigns",
                "",
                *table(contents[both], GOALS),
                "",
            ]
            lines += [*wins_table(rows), ""]
    if {"mixed", "outside"} <= set(found):
        table_of = outside_table(found["outside"].rows, found["mixed"].rows)
        lines += ["## Causes outside the library by subsystem", "", *table_of, ""]
    if {"mixed", "ladder"} <= set(contents):
        two = {
            "methods": {
                k: contents[n]["methods"][OWN]
                for k, n in ((OWN, "mixed"), ("by the ladder", "ladder"))
            }
        }
        lines += ["## Published sizes beside the ladder's", "", *table(two, GOALS), ""]
    for name in {*CHECKS, *(f"{n}_{BASELINES}" for n in CHECKS)} - set(contents):
        # of a run whose rows are not kept
        for suffix in (".json", ".svg", ".narrow.svg"):
            (results / f"{name}{suffix}").unlink(missing_ok=True)
    (results / "README.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    return list(found)


def head(found: Sequence[str], date: str) -> list[str]:
    """Return how the page begins: what it is, where it comes from, what was not run."""
    left = [f"{CHECKS[n].title.lower()} ({CHECKS[n].campaigns})" for n in CHECKS if n not in found]
    return [
        f"Made {date} by `python -m experiments.withheld_check`.",
        "",
        (
            "What is wrong with a drive was drawn by lot, sealed, and recorded by the second "
            "simulator. Then the diagnosis"
        ),
        (
            "ran on the recordings alone, and the seal was opened. The second simulator "
            "integrates the same model"
        ),
        (
            "independently, so this check shows where the diagnosis errs, not whether the "
            "form of an effect is right."
        ),
        "",
        (
            "Each line of a table is one sentence with its figure. In parentheses: the "
            "limits, one-sided 95 % each, and"
        ),
        (
            "how many cases it is of. ✓ and ✗ say whether the figure meets its goal; where "
            "limits reach across the goal,"
        ),
        (
            "more cases may change that. The last column is the name in the JSON files. How "
            "each figure is counted stands"
        ),
        (
            "in [the check's own page](../../../sandbox/withheld/README.md), how this run "
            "was made in [notes](NOTES.md)."
        ),
        "",
        *([f"Not run: {'; '.join(left)}.", ""] if left else []),
    ]


def page(name: str, rows: Sequence[Row], results: Path) -> dict[str, Any]:
    """Write the numbers of rows and their figure; return the numbers."""
    content = content_of(by_method(rows)) | {"figure": f"{name}.svg"}
    write_json(results, name, content, "withheld")
    drawn = page_figure(content, {k: said.short for k, said in words.WORDS.items()})
    screens.write(drawn, results / name)
    return content


def drawing(name: str) -> list[str]:
    """Return a check's figure with the sentence that says how to read it."""
    said = "Chances stated and met, smallest sizes found, and shares with their limits"
    return [
        f"![{said}]({name}.svg)",
        "",
        "*Left*: the share that was right over the chance stated; on the line both agree. "
        "*Middle*: by effect the smallest size that was found (dot) and the largest that was "
        "missed (cross), in multiples of a medium size. *Right*: the shares of the table with "
        "their limits.",
        "",
    ]


def table(content: dict[str, Any], goals: dict[str, str]) -> list[str]:
    """Return the table of metrics that have a value: a sentence each, its figure, its goal and
    whether it is met."""
    methods = content["methods"]
    said = [
        {k for k, v in m.items() if isinstance(v, dict) and v.get("value") is not None}
        for m in methods.values()
    ]
    names = [k for k in methods[OWN] if any(k in t for t in said)]
    if len(methods) == 1:
        own = methods[OWN]
        lines = [
            "| what was counted | figure (limits; cases) | goal | met | name |",
            "|---|---|---|---|---|",
        ]
        for n in names:
            goal = goals.get(n, "")
            met = f"{words.goal_said(n, goal)} | {words.meets(own[n], goal)}"
            lines.append(f"| {words.WORDS[n].sentence} | {words.cell(n, own[n])} | {met} | `{n}` |")
        return lines
    lines = [
        f"| what was counted | {' | '.join(methods)} | name |",
        "|---|" + "---|" * (len(methods) + 1),
    ]
    for n in names:
        cells = [brief(n, m.get(n)) for m in methods.values()]
        lines.append(f"| {words.WORDS[n].short} | {' | '.join(cells)} | `{n}` |")
    return lines


def brief(name: str, figure: Any) -> str:
    """Return a figure without its limits, which the JSON file has."""
    if not isinstance(figure, dict) or figure.get("value") is None:
        return "–"
    return f"{words.value(name, figure['value'])} ({figure['n']})"


def wins_table(rows: Sequence[Row]) -> list[str]:
    """Return the table of campaigns where the diagnosis, or a simple method, does better than the
    other."""
    own, *others = by_method(rows)
    lines = [
        (
            "Better: the first hypothesis is right and the other's wrong; of four effects "
            "and more, F1 of those named."
        ),
        "Chance: that methods of equal worth differ as unevenly (sign test).",
        "",
        (
            f"| method | {own.method} better | method better | alike | chance | where the "
            "method is better |"
        ),
        "|---|--:|--:|--:|--:|---|",
    ]
    for s in others:
        found, truth = split(own.judged, s.judged), {j.name: label_of(j.effects) for j in s.judged}
        where = ", ".join(f"{n} ({truth[n].replace('_', ' ')})" for n in found.other) or "–"
        counts = f"{len(found.own)} | {len(found.other)} | {found.alike} | {found.chance:.2g}"
        lines.append(f"| {s.method} | {counts} | {where} |")
    return lines


def outside_table(outside: Sequence[Row], known: Sequence[Row]) -> list[str]:
    """Return the table of what is said of causes outside the library by their subsystem, beside
    known campaigns."""
    own, others = (scored([r for r in rows if r.method == OWN]).judged for rows in (outside, known))
    lines = [
        "*Seen*: `unknown` stands in the first set. *Blamed*: a name that is not there stands in "
        "it, beside `unknown` or in its place. *Told apart*: how well the chance of `unknown` "
        "separates these causes from all others (area under ROC, 1: perfectly).",
        "",
        "| the cause lies in | seen | blamed beside it | blamed in its place | told apart |",
        "|---|---|---|---|---|",
    ]
    # in percent, or not
    said = {"found": "top1", "named": "top1", "blamed": "top1", "auroc": "unknown_auroc"}
    for subsystem, figures in by_subsystem(own, others).items():
        cells = (words.cell(said[k], f.as_json()) for k, f in figures.items())
        lines.append(f"| {subsystem} | {' | '.join(cells)} |")
    return lines


def details(method: dict[str, Any]) -> list[str]:
    """Return how single effects fare by size, which campaigns were missed and which recordings
    settled nothing."""
    sizes = [
        f"| {float(s):g} | {words.cell('top1', f['top1'])} |" for s, f in method["by_size"].items()
    ]
    head = [
        "| size of a single effect (medium size: 1) | named first (limits; cases) |",
        "|--:|---|",
    ]
    lines = [*head, *sizes, ""] if sizes else []
    for key, text in (
        ("missed", "Where something else was named first"),
        ("unresolved", "Where the recommended recording settled nothing"),
    ):
        said = [
            f"- {name}: {_names(true)}; named {_names([said])}"
            for name, *true, _, said in method[key]
        ]
        lines += [f"{text}:", "", *said, ""] if said else []
    return lines


def _names(effects: Sequence[str]) -> str:
    """Return names of effects in a sentence."""
    said = {"several": "several effects", "none": "nothing", "failed": "nothing, as it failed"}
    plain = [said.get(e, e.replace("_", " ")) for e in effects]
    return " and ".join(filter(None, (", ".join(plain[:-1]), *plain[-1:]))) or "nothing was wrong"


def if_chances_held(chances: Sequence[float]) -> list[str]:
    """Return the calibration error of single effects that would be seen if every stated chance held
    exactly.

    So few campaigns show an error by luck alone; what is beyond the second figure is more than
    luck.
    """
    stated = np.array(chances)
    if not stated.size:
        return []
    rng = np.random.default_rng(0)
    drawn = [calibration_error(stated, rng.random(stated.size) < stated) for _ in range(DRAWS)]
    median, most = np.percentile(drawn, [50.0, 95.0])
    said = (
        f"in {many(stated.size, 'campaign')} they would differ by {median:.2f} from the "
        "share that was right"
    )
    return [
        (
            f"If all stated chances held exactly, {said} (half of draws), by {most:.2f} at "
            "most in 95 % of draws."
        ),
        "",
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run whatever is left of the checks asked for, then write their results from the rows."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    either = parser.add_mutually_exclusive_group(required=True)
    either.add_argument("work", type=Path, nargs="?", help="folder for campaigns and reports")
    either.add_argument(
        "--recompute", action="store_true", help="from the rows that are kept, nothing run"
    )
    parser.add_argument(
        "--finished", action="store_true", help="run nothing, keep what WORK holds scored"
    )
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--only", nargs="+", choices=CHECKS, help="(all; with --finished those that have rows)"
    )
    options = parser.parse_args(arguments)
    if not options.recompute:
        scored = [name for name in CHECKS if (options.work / name / FILE).is_file()]
        for name in options.only or (scored if options.finished else CHECKS):
            if options.finished:
                keep(name, options.work / name)
            else:
                run(name, options.work, options.jobs)
    for name in recompute():
        print(f"{name}: {RESULTS / f'{name}.json'}")


if __name__ == "__main__":
    main()
