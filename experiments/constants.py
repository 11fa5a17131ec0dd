"""Which verdicts hang on a constant of the diagnosis?

Every practice campaign is diagnosed anew with each influential constant halved and doubled, all else as it is; what
changes (verdict, first hypothesis, whether the truth is in the ambiguity set) stands in results/diagnosis/constants.md,
one line a diagnosis in constants.jsonl beside it.  Resumable: what that file holds for this state of the code stays.

Diagnoses of one campaign share most of their simulations; `recalled.py` makes them once.

Run: python -m experiments.constants [FOLDER] [--jobs N | --dask ADDRESS] [--cases p12 ...] [--only WIDE ...] [--name N]
(FOLDER: practice campaigns, usually $SENSORLESS_RECORDINGS/practice, or what `withheld make` wrote: campaigns that no
constant was chosen on; results go to N.jsonl and N.md; 900 diagnoses of 4 s in the middle: an hour of one core;
--recompute writes N.md anew from N.jsonl, by whatever state of the code that is)
"""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from experiments.constants_page import TITLE, Listed, page
from experiments.recalled import Memory, recalled
from model.errors import BadInput
from sandbox.cli.sweeping import on_dask
from sandbox.engine.processes import spread
from sandbox.gap.diagnose import diagnose
from sandbox.gap.location.where import where
from sandbox.gap.report.diagnosis_json import contract
from sandbox.output.files import plain, rounded
from sandbox.recordings.campaign import read_campaign
from sandbox.withheld.making.make import CAMPAIGNS, SEAL
from sandbox.withheld.scoring.rows import DIGITS
from sandbox.withheld.scoring.running import ROOT, code_digest

RESULTS = Path(__file__).parent / "results" / "diagnosis"
LIST = Path(__file__).with_suffix(".toml")
FACTORS = (0.5, 2.0)
GAP = "sandbox/gap"
SIMULATED = "evidence.normal"  # where slopes are taken: its constants change what is remembered


class Constant(NamedTuple):
    """A constant of the diagnosis: module of sandbox.gap, name, what it is, where it was chosen.

    place: the element that is scaled where it is a list, None for all of them; odds: chances for 0, 1, 2 ... effects,
    of which every further one is made so many times likelier.
    """

    module: str
    name: str
    what: str
    chosen: str
    place: int | None = None
    odds: bool = False

    @property
    def label(self) -> str:
        """The name, with the element where one is meant."""
        return self.name if self.place is None else f"{self.name}[{self.place}]"

    def scaled(self, value: Any, factor: float) -> Any:
        """Return the constant so many times as large; whole numbers stay whole."""
        if self.odds:
            raw = [x * factor**k for k, x in enumerate(value)]
            return tuple(x * sum(value) / sum(raw) for x in raw)
        if isinstance(value, tuple):
            chosen = range(len(value)) if self.place is None else (self.place,)
            return tuple(_times(x, factor) if k in chosen else x for k, x in enumerate(value))
        return _times(value, factor)


def _times(value: float, factor: float) -> float:
    return round(value * factor) if isinstance(value, int) else value * factor


CONSTANTS = tuple(Constant(**c) for c in tomllib.loads(LIST.read_text(encoding="utf-8"))["constants"])


class Trial(NamedTuple):
    """One diagnosis to make: campaign folder, constant (its place in CONSTANTS; None: all as they are), factor."""

    folder: Path
    index: int | None
    factor: float

    @property
    def key(self) -> tuple[str, str, float]:
        """What tells it from the others in a file of answers."""
        return self.folder.name, label_of(self.index), self.factor


def label_of(index: int | None) -> str:
    """Return module and name of a constant, for a table."""
    return "" if index is None else f"{CONSTANTS[index].module}.{CONSTANTS[index].label}"


def places_of(constant: Constant) -> list[str]:
    """Return the modules that hold a constant under its name: its own, and those that import it by name."""
    own = f"sandbox.gap.{constant.module}"
    return [own, *(place for place, imported in imports() if imported == (own, constant.name) and place != own)]


@cache
def imports() -> list[tuple[str, tuple[str, str]]]:
    """Return what modules of the diagnosis import by name: (module, (from where, name))."""
    out = []
    for path in sorted((ROOT / GAP).rglob("*.py")):
        place = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                out += [(place, (str(node.module), a.name)) for a in node.names]
    return out


@contextmanager
def changed(constant: Constant, factor: float) -> Iterator[None]:
    """Scale a constant wherever it is used, and put it back; BadInput where the module no longer has it."""
    modules = [importlib.import_module(m) for m in places_of(constant)]
    if not hasattr(modules[0], constant.name):
        raise BadInput(f"{modules[0].__name__} has no constant {constant.name}; correct {LIST.name}")
    before = getattr(modules[0], constant.name)
    try:
        for m in modules:
            setattr(m, constant.name, constant.scaled(before, factor))
        yield
    finally:
        for m in modules:
            setattr(m, constant.name, before)


def diagnosed(folder: Path) -> dict[str, Any]:
    """Return a campaign's diagnosis by the contract, recommended recordings left out."""
    d = diagnose(read_campaign(folder), workers=1)
    found: dict[str, Any] = plain(contract(d, where(d), None, None))
    return found


def answered(trial: Trial, how: Callable[[Path], Mapping[str, Any]] = diagnosed) -> dict[str, Any]:
    """Return what one diagnosis said: verdict, first hypothesis, ambiguity set, simulations; or why it failed."""
    case, name, factor = trial.key
    head = {"case": case, "constant": name, "factor": factor, "code": code_digest()}
    try:
        if trial.index is None:
            with recalled(str(trial.folder)):
                d = how(trial.folder)
        else:
            with changed(CONSTANTS[trial.index], factor), remembered(trial):
                d = how(trial.folder)
    except Exception as error:  # a diagnosis that fails with a constant changed is a result
        return {**head, "failed": f"{type(error).__name__}: {error}"}
    best = d["hypotheses"][0]
    told = {
        "verdict": d["verdict"], "effects": sorted(best["effects"]), "probability": best["probability"],
        "ambiguity_set": [sorted(m) for m in d["ambiguity_set"]], "simulations": d["cost"]["simulations"],
    }  # fmt: skip
    return {**head, **rounded(told, DIGITS)}


def remembered(trial: Trial) -> AbstractContextManager[Memory | None]:
    """Return the memory of a campaign's simulations, or none where the constant takes part in making them."""
    if trial.index is not None and f"sandbox.gap.{SIMULATED}" in places_of(CONSTANTS[trial.index]):
        return nullcontext()
    return recalled(str(trial.folder))


def run(
    trials: Sequence[Trial], kept: Path, jobs: int, how: Callable[[Path], Mapping[str, Any]] = diagnosed,
    cluster: str | None = None,
) -> int:  # fmt: skip
    """Make the diagnoses that a file does not hold for this state of the code, a line each; return how many."""
    there = {_key(a) for a in answers(kept) if a["code"] == code_digest()}
    left = [t for t in trials if t.key not in there]
    for index in {t.index for t in left} - {None}:
        with changed(CONSTANTS[index or 0], 1.0):  # all are where the list says, before anything is diagnosed
            pass
    kept.parent.mkdir(parents=True, exist_ok=True)
    sound = "".join(line(a) for a in answers(kept))  # an interruption may have cut off the last line
    aside = kept.with_suffix(".part")
    aside.write_text(sound, encoding="utf-8")
    aside.replace(kept)
    with kept.open("a", encoding="utf-8") as file:
        for found in spread(partial(answered, how=how), left, jobs, cluster=cluster):
            file.write(line(found))
            file.flush()
    return len(left)


def line(answer: Mapping[str, Any]) -> str:
    """Return an answer as a line of a file."""
    return json.dumps(answer, separators=(",", ":")) + "\n"


def answers(kept: Path) -> list[dict[str, Any]]:
    """Return the answers of a file, none where there is no file; a line that an interruption cut off is left out."""
    lines = kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []
    out = []
    for line in lines:
        try:
            out.append(json.loads(line))
        except ValueError:
            continue
    return out


def _key(answer: Mapping[str, Any]) -> tuple[str, str, float]:
    return answer["case"], answer["constant"], answer["factor"]


def truths_of(folder: Path) -> dict[str, list[str]]:
    """Return the effects put into every campaign whose truth lies beside it, or in the seal of what was made blindly;
    nothing of campaigns with a cause outside the library."""
    if (folder / SEAL).is_file():
        sealed = json.loads((folder / SEAL).read_text(encoding="utf-8"))["campaigns"]
        return {name: list(c["effects"]) for name, c in sealed.items() if not c["outside"]}
    files = folder.glob("*.truth.toml")
    return {p.name.removesuffix(".truth.toml"): list(tomllib.loads(p.read_text())["effects"]) for p in files}


def campaigns_of(folder: Path) -> list[Path]:
    """Return the campaign folders in a folder, or in what `withheld make` wrote there."""
    inside = folder / CAMPAIGNS if (folder / SEAL).is_file() else folder
    return sorted(p for p in inside.glob("*") if (p / "campaign.toml").exists())


def main(arguments: Sequence[str] | None = None, how: Callable[[Path], Mapping[str, Any]] = diagnosed) -> None:
    """Diagnose whatever is left, then write the table of all answers by this state of the code."""
    usual = Path(os.environ.get("SENSORLESS_RECORDINGS", "../shared/recordings")) / "practice"
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=usual)
    parser.add_argument("--jobs", type=int, default=1)
    on_dask(parser)
    parser.add_argument("--cases", nargs="+", help="campaigns (all)")
    parser.add_argument("--only", nargs="+", help="constants by name (all)")
    parser.add_argument("--results", type=Path, default=RESULTS, help=argparse.SUPPRESS)
    parser.add_argument("--name", default="constants", help="of the results' files (constants)")
    parser.add_argument("--recompute", action="store_true", help="only write the page anew, of one state of the code")
    options = parser.parse_args(arguments)
    kept = options.results / f"{options.name}.jsonl"
    if not options.recompute:
        cases = [p for p in campaigns_of(options.folder) if options.cases is None or p.name in options.cases]
        if not cases:
            raise BadInput(f"no such campaign in '{options.folder}'; give a folder of campaigns, and --cases in it")
        done = run(trials_of(cases, options.only), kept, options.jobs, how, options.dask)
        print(f"{done} diagnoses made, the answers are in {kept}")
    found = [a for a in answers(kept) if options.recompute or a["code"] == code_digest()]
    if len({a["code"] for a in found}) > 1:
        raise BadInput(f"'{kept}' holds answers by several states of the code; keep those of one")
    title = TITLE if options.name == "constants" else f"{TITLE} ({options.name.removeprefix('constants_')})"
    text = "\n".join(page(found, truths_of(options.folder), listed_for(found), title)) + "\n"
    (options.results / f"{options.name}.md").write_text(text, encoding="utf-8")


def listed_for(found: Sequence[Mapping[str, Any]]) -> list[Listed]:
    """Return the constants of some answers: as in the list, or by their name alone where they stand elsewhere now."""
    own = {label_of(k): c for k, c in enumerate(CONSTANTS)}
    named = {c.label: c for c in CONSTANTS}
    labels = [*own, *sorted({a["constant"] for a in found} - set(own) - {""})]
    pairs = [(label, own.get(label) or named.get(label.rpartition(".")[2])) for label in labels]
    return [Listed(label, c.what, c.chosen) if c else Listed(label, "no longer there", "") for label, c in pairs]


def trials_of(cases: Sequence[Path], only: Sequence[str] | None) -> list[Trial]:
    """Return the diagnoses to make: every campaign as it is, then with each constant (those named, or all) scaled."""
    chosen = [k for k, c in enumerate(CONSTANTS) if only is None or c.name in only]
    return [t for p in cases for t in (Trial(p, None, 1.0), *(Trial(p, k, f) for k in chosen for f in FACTORS))]


if __name__ == "__main__":
    main()
