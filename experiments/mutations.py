"""Does a test notice when the code says something else?

`python -m experiments.mutations --count 300` makes small wrong changes (`mutation_rules`, and those written by hand in
`mutations.toml`) in a copy of the project, one at a time, and runs the tests that `mutations.toml` names for the file,
up to the first that fails.  Drawn are first one change of every constant of the diagnosis, then changes at random from
a fixed seed.  Resumable: an answer holds while file and tests are what they were.  The table, with every change that no
test noticed and why, is results/mutations.md; all answers are in results/mutations.jsonl.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import time
import tomllib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from experiments.mutation_rules import Mutation, mutations

ROOT = Path(__file__).resolve().parents[1]
LIST = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
RESULTS = Path(__file__).parent / "results"
COPIED = ("model", "estimators", "sandbox", "experiments", "tests", "docs", ".ci", "pyproject.toml", "README.md",
          "CITATION.cff", "CHANGELOG.md", "LICENSE")  # fmt: skip
HEAVY = ("pytest", "hypothesis", "numpy", "numba", "scipy.optimize", "scipy.interpolate", "scipy.signal", "scipy.stats",
         "pyarrow.parquet", "control", "sympy", "_pytest.assertion.rewrite")  # fmt: skip
LEFT_OUT = shutil.ignore_patterns("__pycache__", "_build", "results")
MEMORY = 6_000_000_000  # bytes a run may map
SLOWER = 3.0  # times the tests' own duration after which a change counts as noticed
SPARE = 30.0  # s more: starting, and compiling where a kernel is changed
COMPILING = 240.0  # s more where it is
SEED = 18


class Group(NamedTuple):
    """Files, the tests that have to notice changes in them, how many of the sample are drawn from them (weight)."""

    files: tuple[str, ...]
    tests: tuple[str, ...]
    weight: float
    kernel: bool = False


class Answer(NamedTuple):
    """What became of one change: noticed by which test ('' by none), in how many seconds, for which state."""

    file: str
    change: str
    rule: str
    constant: str
    noticed: str
    seconds: float
    state: str
    tests: str

    @property
    def key(self) -> tuple[str, str, str]:
        """What tells it from others."""
        return self.file, self.change, self.state


@cache
def groups() -> list[Group]:
    """Return the map from files to tests; a pattern stands for all files that fit it and were not named before."""
    seen: set[str] = set()
    out = []
    for entry in LIST["groups"]:
        own = [p.relative_to(ROOT).as_posix() for pattern in entry["files"] for p in sorted(ROOT.glob(pattern))]
        own = [f for f in dict.fromkeys(own) if f not in seen and not f.endswith("__init__.py")]
        seen |= set(own)
        out.append(Group(tuple(own), tuple(entry["tests"]), entry.get("weight", 1.0), entry.get("kernel", False)))
    return out


@cache
def digest(*names: str) -> str:
    """Return a short hash of files of the project (for tests: with their folders' helpers)."""
    value = hashlib.sha256()
    for name in names:
        value.update((ROOT / name.partition("::")[0]).read_bytes())
    return value.hexdigest()[:12]


def by_hand() -> list[Mutation]:
    """Return the changes of `mutations.toml`, each written as the text that stands in a file and its replacement."""
    found = []
    for entry in LIST["by_hand"]:
        source = (ROOT / entry["file"]).read_bytes()
        old = entry["old"].encode()
        if source.count(old) != 1:
            raise SystemExit(
                f"{entry['file']} holds {entry['old']!r} {source.count(old)} times; correct mutations.toml"
            )
        begin = source.index(old)
        line = 1 + source[:begin].count(b"\n")
        change = Mutation(entry["file"], line, "by hand", entry["old"], entry["new"], begin, begin + len(old))
        found.append(change)
    return found


def sample(count: int, seed: int = SEED) -> list[Mutation]:
    """Return the changes to try: by hand, one of every constant of the diagnosis, then at random by the weights."""
    chance = random.Random(seed)
    chosen = by_hand()
    pools: list[tuple[float, list[Mutation]]] = []
    for group in groups():
        pool = [m for file in group.files for m in mutations(file, (ROOT / file).read_bytes())]
        in_gap = [m for m in pool if m.constant and m.file.startswith("sandbox/gap/")]
        chosen += [chance.choice(same) for same in _by_constant(in_gap).values()]
        pools.append((group.weight, [m for m in pool if not m.constant or m not in in_gap]))
    left = max(count - len(chosen), 0)
    whole = sum(weight * len(pool) for weight, pool in pools)
    for weight, pool in pools:
        chosen += chance.sample(pool, min(len(pool), round(left * weight * len(pool) / whole)))
    return chosen


def _by_constant(pool: Sequence[Mutation]) -> dict[tuple[str, str], list[Mutation]]:
    found: dict[tuple[str, str], list[Mutation]] = {}
    for m in pool:
        if m.rule == "number":
            found.setdefault((m.file, m.constant), []).append(m)
    return found


def group_of(file: str) -> Group:
    """Return the group that holds a file."""
    return next(g for g in groups() if file in g.files)


class Copy:
    """A copy of the project in which one file at a time says something else."""

    def __init__(self, place: Path) -> None:
        self.tree, self.cache = place / "tree", place / "cache"
        self.tree.mkdir(parents=True, exist_ok=True)  # what Python compiled there last time still holds
        for name in COPIED:
            source, target = ROOT / name, self.tree / name
            if source.is_dir():
                shutil.copytree(source, target, ignore=LEFT_OUT, dirs_exist_ok=True)
            elif source.is_file():
                shutil.copy2(source, target)
        if not (results := self.tree / "experiments" / "results").exists():
            results.symlink_to(RESULTS)

    def run(self, tests: Sequence[str], seconds: float, written: bool = False) -> tuple[str, float]:
        """Run tests up to the first failure; return what failed ('' nothing) and how long it took.

        written: whether Python may keep what it compiles, which it must not of a changed file.
        """
        begun = time.monotonic()
        told = self.tree.parent / "said.txt"
        child = os.fork()
        if child == 0:
            self._tests(tests, told, written)
        stopped = False
        while not (done := os.waitpid(child, os.WNOHANG))[0]:
            if time.monotonic() - begun > seconds and not stopped:
                stopped = True
                os.killpg(child, signal.SIGKILL)
            time.sleep(0.05)
        took = time.monotonic() - begun
        if stopped:
            return f"did not end in {seconds:.0f} s", took
        if done[1] == 0:
            return "", took
        lines = told.read_text(errors="replace").splitlines()
        failed = [x for x in lines if x.startswith(("FAILED ", "ERROR "))]
        return (failed or ["it does not start"])[0].partition(" - ")[0].removeprefix("FAILED "), took

    def _tests(self, tests: Sequence[str], told: Path, written: bool) -> None:
        os.setsid()
        sink = os.open(told, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(sink, 1)
        os.dup2(sink, 2)
        code = 1
        try:
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.RLIM_INFINITY))
            os.chdir(self.tree)
            for name in [n for n in sys.modules if n.partition(".")[0] in ("experiments", "tests")]:
                del sys.modules[name]
            sys.path[:] = [str(self.tree), *(p for p in sys.path if p and Path(p) != ROOT)]
            sys.dont_write_bytecode = not written
            os.environ |= {"SENSORLESS_CACHE": str(self.cache), "PYTHONPATH": str(self.tree)}
            import pytest

            code = pytest.main(["-n0", "-x", "-q", "--tb=no", "-rfE", "-p", "no:cacheprovider", *tests])
        finally:
            sys.stdout.flush()
            os._exit(int(code))

    def kernels(self) -> set[Path]:
        """Return the folders of compiled kernels."""
        return set(self.cache.glob("kernels-*"))

    def tried(self, m: Mutation, group: Group, usual: float) -> Answer:
        """Change the file, run its tests, change it back; return what became of it."""
        path, before = self.tree / m.file, self.kernels()
        source = path.read_bytes()
        changed = m.applied(source)
        compile(changed, m.file, "exec")
        for kept in path.parent.glob(f"__pycache__/{path.stem}.*"):
            kept.unlink()
        path.write_bytes(changed)
        try:
            limit = SLOWER * usual + SPARE + COMPILING * group.kernel
            noticed, seconds = self.run(group.tests, limit)
        finally:
            path.write_bytes(source)
            for folder in self.kernels() - before:
                shutil.rmtree(folder, ignore_errors=True)
        tests = digest(*group.tests)
        return Answer(m.file, m.told, m.rule, m.constant, noticed, round(seconds, 1), digest(m.file), tests)


def answers(kept: Path) -> dict[tuple[str, str, str], Answer]:
    """Return the last answer to every change of a file that is as it was then."""
    found = {}
    for line in kept.read_text(encoding="utf-8").splitlines() if kept.is_file() else []:
        try:
            a = Answer(**json.loads(line))
        except (ValueError, TypeError):  # cut off by an interruption
            continue
        if (ROOT / a.file).is_file() and digest(a.file) == a.state:
            found[a.key] = a
    return found


def holds(a: Answer | None) -> bool:
    """Tell whether a change need not be tried (again): it was noticed, or the tests are what they were."""
    return a is not None and (bool(a.noticed) or a.tests == digest(*group_of(a.file).tests))


@cache
def measured() -> set[tuple[str, str]]:
    """Return the constants (file, name) for which `constants` has told how answers change."""
    listed = tomllib.loads(Path(__file__).with_name("constants.toml").read_text(encoding="utf-8"))["constants"]
    lines = [line for p in (RESULTS / "diagnosis").glob("constants*.jsonl") for line in p.read_text().splitlines()]
    tried = {json.loads(line).get("constant", "") for line in lines if line.startswith('{"case"')}
    names = {label.rpartition(".")[2].partition("[")[0] for label in tried}
    told = [entry for entry in listed if entry["name"] in names]
    return {(f"sandbox/gap/{entry['module'].replace('.', '/')}.py", entry["name"]) for entry in told}


def reason(a: Answer) -> str:
    """Return why nothing noticed a change, as `mutations.toml` says."""
    for entry in LIST.get("reasons", []):
        if entry["file"] == a.file and entry["change"] in a.change:
            return str(entry["why"])
    if (a.file, a.constant) in measured():
        return "answers at its half and its double are measured: [table](diagnosis/constants.md)"
    return "open" if holds(a) else "open; the tests have changed since"


def table(found: Sequence[Answer], drawn: Mapping[str, int]) -> list[str]:
    """Return the page: shares noticed by room, then what was not, with the reason where there is one."""
    lines = ["| room | possible | tried | noticed | share |", "|---|--:|--:|--:|--:|"]
    rooms = sorted({room(a.file) for a in found})
    for name, own in [*((r, [a for a in found if room(a.file) == r]) for r in rooms), ("all", list(found))]:
        seen = sum(bool(a.noticed) for a in own)
        possible = drawn.get(name, sum(drawn.values()))
        lines.append(f"| {name} | {possible} | {len(own)} | {seen} | {100 * seen / max(len(own), 1):.0f} % |")
    lines += ["", "## Not noticed", "", "| file | change | why |", "|---|---|---|"]
    for a in sorted((a for a in found if not a.noticed), key=lambda a: (a.file, a.change)):
        change = a.change.replace("|", "\\|")
        lines.append(f"| `{a.file}` | `{change}` | {reason(a)} |")
    return lines


def room(file: str) -> str:
    """Return the room of a file, with its own room for parts of the sandbox."""
    parts = file.split("/")
    return "/".join(parts[: 3 if file.startswith("sandbox/gap") else 2 if parts[0] == "sandbox" else 1])


def possible() -> dict[str, int]:
    """Return how many changes there are, by room."""
    found: dict[str, int] = {}
    for file in (f for g in groups() for f in g.files):
        found[room(file)] = found.get(room(file), 0) + len(mutations(file, (ROOT / file).read_bytes()))
    return found


def work(copy: Copy, chosen: Sequence[Mutation], kept: Path, deadline: float) -> Iterator[Answer]:
    """Yield the answers to changes, group by group, each group's tests without a change first."""
    for group in groups():
        own = [m for m in chosen if m.file in group.files]
        if not own or time.monotonic() > deadline:
            continue
        wrong, usual = copy.run(group.tests, 1800.0, written=True)  # compiles, where nothing is kept yet
        if wrong:
            raise SystemExit(f"{wrong} fails without a change; nothing can be told of {', '.join(group.files)}")
        print(f"{', '.join(group.tests)}: {usual:.0f} s for {len(own)} changes", flush=True)
        for m in own:
            if time.monotonic() < deadline:
                yield copy.tried(m, group, usual)


def main() -> None:
    """Try what is left of the sample, then write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300, help="changes in all (300)")
    parser.add_argument("--seconds", type=float, default=1e9, help="stop after so long; call again to go on")
    parser.add_argument("--place", type=Path, default=ROOT / "sensorless-out" / "mutations", help="for the copy")
    parser.add_argument("--only", help="files that begin with this")
    options = parser.parse_args()
    kept = RESULTS / "mutations.jsonl"
    chosen = sample(options.count)
    there = answers(kept)
    left = [m for m in chosen if not holds(there.get((m.file, m.told, digest(m.file))))]
    left = [m for m in left if m.file.startswith(options.only or "")]
    if left and options.seconds > 0.0:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for name in HEAVY:
                __import__(name)
        copy = Copy(options.place.resolve())
        with kept.open("a", encoding="utf-8") as file:
            for a in work(copy, left, kept, time.monotonic() + options.seconds):
                there[a.key] = a
                file.write(json.dumps(a._asdict()) + "\n")
                file.flush()
                print(f"{a.seconds:6.1f} s {a.file}:{a.change}: {a.noticed or 'NOT NOTICED'}", flush=True)
    wanted = {(m.file, m.told) for m in chosen}
    found = [a for a in there.values() if (a.file, a.change) in wanted]
    lines = ["# Mutations", "", f"By `python -m experiments.mutations` ({len(found)} of {len(chosen)} drawn).", ""]
    (RESULTS / "mutations.md").write_text("\n".join([*lines, *table(found, possible())]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
