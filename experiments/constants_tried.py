"""Does a test notice when a constant of the diagnosis is half as large, or half as large again?

`python -m experiments.constants_tried` changes every number of every constant in sandbox/gap both ways, one at a time
in a copy of the project, and runs the tests that noticed another change of it, then those that `mutations.toml` names
for the file, up to the first that fails.  Left out are constants whose effect on verdicts is measured
(`constants.toml`), and those with a reason, which stands in `constants_tried.toml`.  Resumable:
results/diagnosis/constants_tried.jsonl holds a line a change; the page beside it is constants_tried.md.  A test fails
where a number of a constant is none of the three.
"""

from __future__ import annotations

import argparse
import ast
import json
import time
import tomllib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from experiments.mutation_rules import Mutation, constants
from experiments.mutations import HEAVY, ROOT, Copy, digest, group_of, measured

RESULTS = Path(__file__).parent / "results" / "diagnosis"
REASONS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["reasons"]
GAP = "sandbox/gap/"


class Number(NamedTuple):
    """One change of a number: file, constant, which number of it (from 0), as it stands there, what is put there."""

    file: str
    constant: str
    place: int
    old: str
    new: str


class Tried(NamedTuple):
    """What became of a change: noticed by which test ('' by none), for which state of the file."""

    number: Number
    noticed: str
    state: str


def numbers() -> dict[Number, Mutation]:
    """Return every change of a number of a constant of the diagnosis."""
    files = sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / GAP).rglob("*.py"))
    return {number: m for file in files for number, m in _of(file, (ROOT / file).read_bytes())}


def _of(file: str, source: bytes) -> Iterator[tuple[Number, Mutation]]:
    tree, lines = ast.parse(source), source.splitlines(keepends=True)
    for name, value in [*constants(tree), *together(tree)]:
        nodes = [n for n in ast.walk(value) if isinstance(n, ast.Constant) and type(n.value) in (int, float)]
        for k, node in enumerate(sorted(nodes, key=lambda n: (n.lineno, n.col_offset))):
            begin = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
            end = begin + (node.end_col_offset or 0) - node.col_offset
            old = source[begin:end].decode()
            for new in others(ast.literal_eval(node)):
                change = Mutation(file, node.lineno, "number", old, new, begin, end, name)
                yield Number(file, name, k, old, new), change


def together(tree: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Yield the module's constants that are assigned together, `A, B = 1.0, 2.0`, and their values."""
    for node in tree.body:
        if (
            isinstance(node, ast.Assign)
            and isinstance(node.targets[0], ast.Tuple)
            and isinstance(node.value, ast.Tuple)
        ):
            for name, value in zip(node.targets[0].elts, node.value.elts, strict=True):
                if isinstance(name, ast.Name) and name.id.isupper():
                    yield name.id, value


def others(value: float) -> list[str]:
    """Return a number half as large and half as large again; whole ones by 1 at least, 1 only upwards, 0 not at all."""
    if isinstance(value, float):
        return [repr(value * factor) for factor in (0.5, 1.5) if value]
    if value in (0, 1):
        return [str(value + 1)] if value else []
    return [str(min(value - 1, round(value * 0.5))), str(max(value + 1, round(value * 1.5)))]


def reason(number: Number) -> str:
    """Return why nothing has to notice a change: what `constants` measured, or what stands in the list; '' nothing."""
    if (number.file, number.constant) in measured():
        return "answers at its half and its double are measured: [table](constants.md)"
    for entry in REASONS:
        if (GAP + entry["file"], entry["constant"]) == number[:2] and number.old in entry.get("numbers", [number.old]):
            return str(entry["why"])
    return ""


def answers(kept: Path = RESULTS / "constants_tried.jsonl") -> dict[Number, Tried]:
    """Return the last answer to every change."""
    found = {}
    for line in kept.read_text(encoding="utf-8").splitlines() if kept.is_file() else []:
        try:
            number, noticed, state = json.loads(line)
        except ValueError:  # cut off by an interruption
            continue
        found[Number(*number)] = Tried(Number(*number), noticed, state)
    return found


def unexplained() -> list[Number]:
    """Return the changes that no test is known to notice and that no line gives a reason for."""
    there = answers()
    return [n for n in numbers() if not reason(n) and not (n in there and there[n].noticed)]


def page(there: dict[Number, Tried]) -> list[str]:
    """Return the page: a row a constant, what each change of its numbers is noticed by, or the reason."""
    every = list(numbers())
    held = [n for n in every if not reason(n)]
    seen = sum(bool(n in there and there[n].noticed) for n in held)
    lines = [
        "# What notices a constant of the diagnosis", "",
        f"Every number of the {len({n[:2] for n in every})} constants of `sandbox/gap`, half as large and half as "
        f"large again, by `python -m experiments.constants_tried`: {seen} of {len(held)} changes are noticed by a "
        f"test; of {len(every) - len(held)} more the effect on verdicts is measured, or there is a reason.", "",
        "| constant | number | noticed by, or why it need not be |", "|---|---|---|",
    ]  # fmt: skip
    for file, constant in dict.fromkeys(n[:2] for n in every):
        told: dict[str, list[str]] = {}
        for n in (n for n in every if n[:2] == (file, constant)):
            test = there[n].noticed.rpartition("::")[2].partition("[")[0] if n in there else ""
            why = reason(n) or (f"`{test}`" if test else "nothing so far")
            told.setdefault(why, []).append(f"{n.old} → {float(n.new):.4g}")
        for why, changes in told.items():
            lines.append(f"| `{file.removeprefix(GAP)}` `{constant}` | {', '.join(changes)} | {why} |")
    return lines


def known(number: Number, there: Mapping[Number, Tried]) -> tuple[str, ...]:
    """Return the tests that noticed another change of the same constant, as far as they are still there."""
    told = [a.noticed.partition("[")[0] for n, a in there.items() if n[:2] == number[:2]]
    return tuple(dict.fromkeys(t for t in told if is_there(t)))


def is_there(test: str) -> bool:
    """Tell whether a test, `file::function`, is in its file."""
    file, _, name = test.partition("::")
    return (ROOT / file).is_file() and f"def {name.partition('[')[0]}(" in (ROOT / file).read_text(encoding="utf-8")


def work(
    copy: Copy, chosen: Sequence[tuple[Number, Mutation]], there: Mapping[Number, Tried], deadline: float
) -> Iterator[Tried]:
    """Yield the answers to changes: by the tests that know the constant, then by all of its file's."""
    usual: dict[tuple[str, ...], float] = {}
    for number, m in chosen:
        if time.monotonic() > deadline:
            return
        group, noticed, state = group_of(m.file), "", digest(m.file)
        for tests in (known(number, there), group.tests):
            if noticed or not tests:
                continue
            if tests not in usual:
                wrong, usual[tests] = copy.run(tests, 1800.0, written=True)
                if wrong:
                    raise SystemExit(f"{wrong} fails without a change; nothing can be told of {m.file}")
            noticed = copy.tried(m, group._replace(tests=tests), usual[tests]).noticed
        yield Tried(number, noticed, state)


def main() -> None:
    """Try what is left, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=1e9, help="stop after so long; call again to go on")
    parser.add_argument("--place", type=Path, default=ROOT / "sensorless-out" / "mutations", help="for the copy")
    parser.add_argument("--only", default="", help="files that begin with this, below sandbox/gap")
    parser.add_argument("--anew", action="store_true", help="also what was tried on another state of its file")
    options = parser.parse_args()
    there, kept = answers(), RESULTS / "constants_tried.jsonl"
    left = [(n, m) for n, m in numbers().items() if not reason(n) and n.file.startswith(GAP + options.only)]
    left = [(n, m) for n, m in left if n not in there or not there[n].noticed or (options.anew and old(there[n]))]
    if left and options.seconds > 0.0:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for name in HEAVY:
                __import__(name)
        copy = Copy(options.place.resolve())
        with kept.open("a", encoding="utf-8") as file:
            for a in work(copy, left, there, time.monotonic() + options.seconds):
                there[a.number] = a
                file.write(json.dumps(a) + "\n")
                file.flush()
                print(f"{' '.join(map(str, a.number))}: {a.noticed or 'NOT NOTICED'}", flush=True)
    (RESULTS / "constants_tried.md").write_text("\n".join(page(there)) + "\n", encoding="utf-8")


def old(a: Tried) -> bool:
    """Tell whether a change was tried on another state of its file."""
    return a.state != digest(a.number.file)


if __name__ == "__main__":
    main()
