"""Campaigns by the number:
`python -m experiments.testbench.make FOLDER KIND COUNT --seed S --jobs J`.

Truths are drawn and sealed first; what exists already is kept, so a call that was stopped goes on.
"""

import argparse
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from . import bench, draw, maps, seal


def names(count: int) -> list[str]:
    """Names that tell nothing but a place in line."""
    return [f"c{k:04d}" for k in range(count)]


def kinds(kind: str, count: int, seed: int) -> list[tuple[str, int]]:
    """Kind and index of each campaign; `mixed` draws them (3 one : 2 several : 1 many : 1 outside :
    2 none)."""
    if kind != "mixed":
        return [(kind, k) for k in range(count)]
    bag = ["one"] * 3 + ["several"] * 2 + ["many", "outside"] + ["none"] * 2
    rng = draw.generator(seed, kind, 0, "kinds")
    seen: dict[str, int] = {}
    out = []
    for _ in range(count):
        k = bag[int(rng.integers(len(bag)))]
        out.append((k, seen.get(k, 0)))
        seen[k] = seen.get(k, 0) + 1
    return out


def _one(
    folder: str, name: str, kind: str, seed: int, index: int, place: str | None
) -> tuple[str, float]:
    start = time.process_time()
    truth, d = draw.draw(kind, seed, index, Path(place) if place else None)
    bench.write(Path(folder), name, truth, d)
    return name, time.process_time() - start


def steps(folder: Path, todo: list[tuple], jobs: int) -> Iterator[tuple[str, float | Exception]]:
    """Run what is to do; yields the name and the CPU seconds, or what went wrong."""
    if jobs == 1:
        for args in todo:
            try:
                yield _one(str(folder), *args)
            except ArithmeticError as e:
                yield args[0], e
        return
    with ProcessPoolExecutor(jobs) as pool:
        waiting = {pool.submit(_one, str(folder), *args): args[0] for args in todo}
        for done in as_completed(waiting):
            error = done.exception()
            if isinstance(error, ArithmeticError):
                yield waiting[done], error
            else:
                yield done.result()


def make(
    folder: str | os.PathLike,
    kind: str,
    count: int,
    seed: int,
    jobs: int = 1,
    *,
    maps_from: str | os.PathLike | None = None,
    key: str = "",
    quiet: bool = False,
) -> str:
    """Seal `count` truths of a kind (one of `draw.KINDS`, or "mixed"), then write their campaigns.

    Returns the SHA-256 of the seal.  Without the folder of published maps only drives without a map
    are drawn (the seal says so).  A campaign whose drive cannot be held on its bench is left out
    and named in `left_out.txt`. Raises ValueError for an unknown kind, a count below 1, or a folder
    that holds another draw.
    """
    if kind not in (*draw.KINDS, "mixed"):
        raise ValueError(f"kind '{kind}' is not one of {', '.join(draw.KINDS)}, mixed")
    if count < 1:
        raise ValueError(f"count {count}: at least 1")
    root = Path(folder)
    place = maps.maps_folder(maps_from)
    rows = list(zip(names(count), kinds(kind, count, seed), strict=True))
    truths = {name: draw.draw(k, seed, index, place)[0] for name, (k, index) in rows}
    facts = {"kind": kind, "count": count, "seed": seed, "with_maps": place is not None}
    digest = seal.write_seal(root, seal.pack(truths, facts, key))
    if not quiet:
        print(f"sealed {count} truths, SHA-256 {digest}", flush=True)
    left = root / "left_out.txt"
    skipped = set(left.read_text().split("\n")) if left.exists() else set()
    skipped = {line.split(":")[0] for line in skipped}
    todo = [
        (name, k, seed, index, str(place) if place else None)
        for name, (k, index) in rows
        if not (root / name / "campaign.toml").exists() and name not in skipped
    ]
    for n, (name, result) in enumerate(steps(root, todo, jobs), count - len(todo) + 1):
        if isinstance(result, Exception):
            with left.open("a") as f:
                f.write(f"{name}: {result}\n")
        if not quiet:
            text = (
                f"left out: {result}" if isinstance(result, Exception) else f"{result:.1f} s of CPU"
            )
            print(f"{n}/{count} {name} {text}", flush=True)
    return digest


def main(arguments: list[str] | None = None) -> int:
    """The command; exit code 2 with one sentence for a bad argument."""
    p = argparse.ArgumentParser(prog="python -m experiments.testbench.make", description=__doc__)
    p.add_argument("folder")
    p.add_argument("kind")
    p.add_argument("count", type=int)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument(
        "--maps",
        help="folder of the published flux maps (else TESTBENCH_MAPS, else shared/realdata)",
    )
    p.add_argument("--key", default="", help="encipher the seal")
    a = p.parse_args(arguments)
    try:
        make(a.folder, a.kind, a.count, a.seed, a.jobs, maps_from=a.maps, key=a.key)
    except (ValueError, FileNotFoundError) as e:
        print(f"testbench: {e}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
