"""Places that a command cannot write to, clocks that go back, first runs side by side: what is
left, what comes after?

`python -m experiments.full_disk --moments 20` runs every command (those of `faults`) where the disk
ends after some bytes, where the place becomes read-only at some moment, where the clock is set back
by an hour, where the cache of kernels is on a full or read-only disk, and twice at once with no
cache at all.  Wrong is: a traceback, more than one sentence, another exit code than 0 or 2, a file
that stands there though the command did not end well, or other numbers once there is room again.
Small file systems are mounted in a name space of its own (Linux, `unshare`).
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from experiments.faults import CALLS, LONGEST, ROOT, contents, finish, parts, prepare, start

ROOM = "size=4g"
BACK = 3600.0  # s by which a clock is set back
CLOCK = """
import os, time
_now, _until = time.time, time.monotonic() + {after}
time.time = lambda: _now() - ({back} if time.monotonic() > _until else 0.0)
"""  # read by every Python process at its start


class Place(NamedTuple):
    """A trial: what is wrong with the place, how much (bytes or s), and what was wrong with the
    answer ('' nothing)."""

    command: str
    fault: str
    amount: float
    wrong: str


def mount(folder: Path, options: str) -> None:
    """Mount a file system in memory at a folder, or change the one that is there."""
    folder.mkdir(exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "none", str(folder)], check=True)


def change(folder: Path, options: str) -> bool:
    """Change a mounted file system's options; tell whether it could be done (a file may be
    open)."""
    done = subprocess.run(
        ["mount", "-o", f"remount,{options}", str(folder)], check=False, capture_output=True
    )
    return done.returncode == 0


def unmount(folder: Path) -> None:
    """Take a file system away."""
    subprocess.run(["umount", "-l", str(folder)], check=True)


def ended(process: subprocess.Popen[bytes]) -> tuple[int, str]:
    """Wait for a command; return its exit code and what it said."""
    _, said = process.communicate(timeout=LONGEST)
    return process.returncode, said.decode(errors="replace").strip()


def judged(
    code: int, said: str, name: str, out: Path, whole: dict[str, str], resumes: bool
) -> list[str]:
    """Return what is wrong with how a command ended in a bad place."""
    if code == 0:
        return [] if contents(out) == whole else ["it ended well with other numbers"]
    wrong = []
    if "Traceback" in said:
        wrong.append(f"a traceback: {said.splitlines()[-1][:120]}")
    elif code != 2:
        wrong.append(f"exit code {code}: {said[-120:]}")
    elif len([x for x in said.splitlines() if "compiling" not in x]) != 1:
        wrong.append(f"{len(said.splitlines())} lines: {said[:200]!r}")
    if not resumes and out.exists() and contents(out) and name != "score":
        wrong.append(f"left {sorted(contents(out))[:3]}")
    return wrong


def once_more(name: str, home: Path, out: Path, whole: dict[str, str]) -> list[str]:
    """Run a command again where there is room; return what is wrong."""
    try:
        finish(name, home, out)
    except RuntimeError as error:
        return [str(error)]
    found = contents(out)
    wrong = [
        f"{k} is not the same" for k in sorted({*found, *whole}) if found.get(k) != whole.get(k)
    ][:3]
    return wrong + [f"left {x}" for x in parts(out)[:2]]


def full(name: str, home: Path, place: Path, size: float, whole: dict[str, str]) -> Place:
    """Run a command on a disk of some bytes, give the disk room, and run it again."""
    mount(place, f"size={int(size)}")
    try:
        out = place / "out"
        if name == "score":
            if not change(place, ROOM):
                raise RuntimeError("no room for the campaigns")
            shutil.copytree(home / "check", out)
            used = sum(p.stat().st_blocks * 512 for p in out.rglob("*"))
            change(place, f"size={used + int(size)}")
        code, said = ended(start(name, home, out))
        wrong = judged(code, said, name, out, whole, name in ("sweep", "protocol", "make", "score"))
        change(place, ROOM)
        return Place(name, "full", size, "; ".join(wrong + once_more(name, home, out, whole)))
    finally:
        unmount(place)


def read_only(name: str, home: Path, place: Path, seconds: float, whole: dict[str, str]) -> Place:
    """Run a command in a place that becomes read-only after some seconds (0: from the start), then
    again."""
    mount(place, ROOM)
    try:
        out = place / "out"
        if name == "score":
            shutil.copytree(home / "check", out)
        if not seconds:
            change(place, "ro")
        process = start(name, home, out)
        time.sleep(seconds)
        while process.poll() is None and not change(place, "ro"):
            time.sleep(0.01)  # a file is open for writing
        code, said = ended(process)
        wrong = judged(code, said, name, out, whole, name in ("sweep", "protocol", "make", "score"))
        change(place, "rw")
        return Place(
            name, "read-only", seconds, "; ".join(wrong + once_more(name, home, out, whole))
        )
    finally:
        unmount(place)


def bad_cache(name: str, home: Path, place: Path, size: float, whole: dict[str, str]) -> Place:
    """Run a command whose cache lies on a disk of some bytes (0: read-only): it has to end well,
    only slower."""
    mount(place, f"size={int(size)}" if size else "ro")
    before = os.environ.get("SENSORLESS_CACHE")
    os.environ["SENSORLESS_CACHE"] = str(place / "cache")
    out = home / "out_cache"
    try:
        code, said = ended(start(name, home, out))
        wrong = (
            judged(code, said, name, out, whole, False)
            if code == 0
            else [f"exit code {code}: {said[-160:]}"]
        )
        return Place(name, "cache", size, "; ".join(wrong))
    finally:
        _set("SENSORLESS_CACHE", before)
        unmount(place)
        shutil.rmtree(out, ignore_errors=True)


def clock_back(name: str, home: Path, seconds: float, whole: dict[str, str]) -> Place:
    """Run a command whose clock is set back after some seconds, then again over files of the
    future."""
    (home / "clock").mkdir(exist_ok=True)
    (home / "clock" / "sitecustomize.py").write_text(CLOCK.format(after=seconds, back=BACK))
    out = home / f"out_clock{seconds:.2f}"
    wrong = []
    process = start(name, home, out, [home / "clock"])
    code, said = ended(process)
    if code:
        wrong.append(f"exit code {code}: {said[-160:]}")
    ahead = time.time() + BACK
    for path in [*out.rglob("*"), out] if out.exists() else []:
        os.utime(path, (ahead, ahead))
    return Place(name, "clock", seconds, "; ".join(wrong + once_more(name, home, out, whole)))


def side_by_side(name: str, home: Path, whole: dict[str, str]) -> Place:
    """Run a command twice at once with no cache, then once with what both have kept."""
    before = os.environ.get("SENSORLESS_CACHE")
    wrong = []
    with tempfile.TemporaryDirectory() as cache:
        os.environ["SENSORLESS_CACHE"] = cache
        try:
            outs = [home / "side1", home / "side2"]
            running = [start(name, home, out) for out in outs]
            for out, process in zip(outs, running, strict=True):
                code, said = ended(process)
                if code or "Traceback" in said or "damaged" in said:
                    wrong.append(f"exit code {code}: {said[-160:]}")
                elif contents(out) != whole:
                    wrong.append("other numbers")
            wrong += once_more(name, home, home / "side3", whole)
        finally:
            _set("SENSORLESS_CACHE", before)
    return Place(name, "two first runs", 0.0, "; ".join(wrong))


def _set(name: str, value: str | None) -> None:
    if value is None:
        os.environ.pop(name, None)
    else:
        os.environ[name] = value


def trials(
    name: str, home: Path, moments: int, kinds: Sequence[str], chance: random.Random
) -> list[Place]:
    """Return what became of one command in all places, told as they come."""
    prepare(name, home)
    finish(name, home, home / "first")  # compiles
    takes = finish(name, home, home / "whole")
    whole, place, found = contents(home / "whole"), home / "place", []
    size = sum(p.stat().st_blocks * 512 for p in (home / "whole").rglob("*") if p.is_file())
    if name == "score":
        size = 2_000_000

    def tell(p: Place) -> None:
        """Keep a trial, and print it where something is wrong."""
        found.append(p)
        if p.wrong:
            print(f"{p.command}: {p.fault} {p.amount:.4g}: {p.wrong}", flush=True)

    if "read-only" in kinds:
        tell(read_only(name, home, place, 0.0, whole))
    for k in range(moments):
        share = (k + chance.random()) / moments
        if "full" in kinds:
            tell(full(name, home, place, max(4096.0, 1.1 * size * share), whole))
        if "read-only" in kinds:
            tell(read_only(name, home, place, takes * share, whole))
        if "clock" in kinds and k < 2:
            tell(clock_back(name, home, takes * share, whole))
    if "cache" in kinds:
        for amount in (0.0, 16384.0, 1e6):
            tell(bad_cache(name, home, place, amount, whole))
    if "two first runs" in kinds:
        tell(side_by_side(name, home, whole))
    return found


KINDS = ("full", "read-only", "cache", "clock", "two first runs")


def main() -> None:
    """Run in a name space of its own; print a line a fault, then how many trials went well."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--moments", type=int, default=4, help="a command and kind (4)")
    parser.add_argument("--only", nargs="+", choices=CALLS, default=list(CALLS))
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    if os.environ.get("IN_NAME_SPACE") != "1":
        os.environ |= {"IN_NAME_SPACE": "1", "PYTHONPATH": str(ROOT)}
        os.execvp(
            "unshare",
            ["unshare", "-rm", sys.executable, "-m", "experiments.full_disk", *sys.argv[1:]],
        )
    chance = random.Random(options.seed)
    for name in options.only:
        with tempfile.TemporaryDirectory() as made:
            found = trials(name, Path(made), options.moments, options.kinds, chance)
        for kind in options.kinds:
            own = [p for p in found if p.fault == kind]
            print(
                f"{name:<9} {kind:<15} {sum(not p.wrong for p in own)} of {len(own)} well",
                flush=True,
            )


if __name__ == "__main__":
    main()
