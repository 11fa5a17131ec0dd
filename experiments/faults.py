"""Long commands, killed at random moments and run again: the same results to the bit, nothing left
behind?

`python -m experiments.faults --moments 50` sends SIGKILL, SIGTERM and SIGINT in turn to each
command at moments spread evenly over what it takes, runs it again to its end, and compares every
number and table with those of a run that nobody disturbed.  Wrong is: another number, a traceback,
a process that lives on, a file that was prepared and is still there when the second run has ended.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from experiments.few_effects import left_out
from sandbox.public.verifying import COSTS

ROOT = Path(__file__).resolve().parents[1]
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
PATIENCE = 20.0  # s in which the processes of a command have to be gone
LONGEST = 900.0  # s of a command
SCENARIO = (
    "[scenario]\nname = 'short'\n[[segment]]\nduration = 0.3\n[[segment]]\nduration = "
    "0.5\nload = 1.0\nramp = 0.1\n"
)
SWEEP = """
[scenario]
start_up = false
[[segment]]
duration = 0.5
load = 1.0
ramp = 0.05
settle = 0.1
[run]
estimator = "qnull"
[random]
points = 400
[random.draw]
true_factor.magnet_flux = { normal = [1.0, 0.02] }
"""
CALLS = {
    "compare": (
        "compare",
        "--scenario",
        "s.toml",
        "--estimators",
        "qnull,ekf",
        "--out",
        "{}",
        "--quiet",
    ),
    "protocol": (
        "protocol",
        "--estimators",
        "qnull",
        "--motors",
        "ipm_exchanged",
        "--tests",
        "start,creep,load_step",
        "--jobs",
        "2",
        "--out",
        "{}",
        "--quiet",
    ),
    "sweep": ("sweep", "sweep.toml", "--jobs", "2", "--out", "{}", "--quiet"),
    "make": (
        "withheld",
        "make",
        "{}",
        "--count",
        "4",
        "--kind",
        "controls",
        "--cycles",
        "practice",
        "--jobs",
        "2",
        "--quiet",
    ),
    "diagnose": (
        "diagnose",
        "campaign",
        "--exclude",
        "EXCLUDED",
        "--jobs",
        "2",
        "--out",
        "{}",
        "--quiet",
    ),
    "score": ("withheld", "score", "{}", "--jobs", "2", "--quiet"),
}
CAMPAIGN = """
[scenario]
name = 'turning'
rotor = 'driven'
[[segment]]
duration = 0.4
speed = 0.1
load = 0.8
ramp = 0.1
"""
RECORDED = (
    "simulate",
    "--scenario",
    "c.toml",
    "--effects",
    "dead_time.time=2e-6",
    "--record",
    "campaign",
    "--json-only",
    "--quiet",
)
CHECK = (
    "withheld",
    "make",
    "check",
    "--count",
    "2",
    "--kind",
    "controls",
    "--cycles",
    "practice",
    "--quiet",
)
# figures and traces hold the hour at which they were made
KEPT = {".json", ".parquet", ".toml", ".csv", ".sealed", ""}
OF_NOW = {*COSTS, "seconds", "seconds_over_60", "made_by", "made", "sha256"}


class Fault(NamedTuple):
    """What became of a command that was sent a signal after some seconds: '' where all is well."""

    command: str
    sent: str
    seconds: float
    wrong: str


def prepare(name: str, home: Path) -> None:
    """Write what a command reads."""
    (home / "s.toml").write_text(SCENARIO)
    (home / "c.toml").write_text(CAMPAIGN)
    (home / "sweep.toml").write_text(SWEEP)
    before = {"diagnose": RECORDED, "score": CHECK}.get(name)
    if before:
        call = [sys.executable, "-m", "sandbox.cli", *before]
        subprocess.run(call, cwd=home, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True)


def start(name: str, home: Path, out: Path, paths: Sequence[Path] = ()) -> subprocess.Popen[bytes]:
    """Start a command in a session of its own; paths: where Python looks first."""
    if name == "score" and not out.exists():  # it writes into what it scores
        shutil.copytree(home / "check", out)
    words = [word.format(out).replace("EXCLUDED", ",".join(left_out())) for word in CALLS[name]]
    program = "experiments.few_effects" if name == "score" else "sandbox.cli"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, [*paths, ROOT]))}
    heard = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # noqa: E731 - a background shell ignores it
    return subprocess.Popen(
        [sys.executable, "-m", program, *words],
        cwd=home,
        env=environment,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        preexec_fn=heard,
    )


def finish(name: str, home: Path, out: Path) -> float:
    """Run a command to its end; return the seconds it took.  RuntimeError where it does not end
    well."""
    begun = time.monotonic()
    process = start(name, home, out)
    _, said = process.communicate(timeout=LONGEST)
    if process.returncode:
        raise RuntimeError(f"{name}: exit code {process.returncode}: {said.decode()[-200:]}")
    return time.monotonic() - begun


def session(pid: int) -> list[int]:
    """Return the processes of a session that are left (zombies aside)."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, of = path.read_text().rpartition(")")[2].split()[:4]
        except OSError:  # gone meanwhile
            continue
        if int(of) == pid and state != "Z":
            found.append(int(path.parent.name))
    return found


def contents(folder: Path) -> dict[str, str]:
    """Return hashes of a folder's tables and documents, costs left out, by their paths."""
    return {path.relative_to(folder).as_posix(): digest for path, digest in _contents(folder)}


def _contents(folder: Path) -> Iterator[tuple[Path, str]]:
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix in KEPT):
        body = path.read_bytes()
        if path.suffix == ".json":
            body = json.dumps(bare(json.loads(body))).encode()
        yield path, hashlib.sha256(body).hexdigest()


def bare(tree: Any) -> Any:
    """Return a JSON tree without what is of the moment."""
    if isinstance(tree, dict):
        return {k: bare(v) for k, v in tree.items() if k not in OF_NOW}
    return [bare(x) for x in tree] if isinstance(tree, list) else tree


def disturbed(
    name: str, home: Path, out: Path, sent: signal.Signals, seconds: float, whole: dict[str, str]
) -> Fault:
    """Send a command a signal after some seconds, run it again, and say what is wrong then."""
    process = start(name, home, out)
    time.sleep(seconds)
    process.send_signal(sent)
    _, said = process.communicate(timeout=LONGEST)
    deadline = time.monotonic() + PATIENCE
    while (left := session(process.pid)) and time.monotonic() < deadline:
        time.sleep(0.1)
    wrong = [f"processes {left} live on"] if left else []
    if b"Traceback" in said:
        wrong.append("a traceback")
    try:
        finish(name, home, out)
    except RuntimeError as error:
        return Fault(name, sent.name, seconds, "; ".join([*wrong, str(error)]))
    found = contents(out)
    if apart := sorted(k for k in {*found, *whole} if found.get(k) != whole.get(k)):
        wrong.append(f"{apart[:3]} are not the same")
    if more := parts(home):
        wrong.append(f"left {more[:2]}")
    return Fault(name, sent.name, seconds, "; ".join(wrong))


def parts(home: Path) -> list[str]:
    """Return what was prepared and never put in its place."""
    return sorted(
        p.relative_to(home).as_posix()
        for p in home.rglob(".*")
        if "part" in p.name or "protocol" in p.name
    )


def main() -> None:
    """Run; print a line a fault, then how many moments were tried."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moments", type=int, default=12, help="a command (12)")
    parser.add_argument("--only", nargs="+", choices=CALLS, default=list(CALLS))
    parser.add_argument(
        "--first", type=int, default=0, help="moment to go on from, of a run that was stopped (0)"
    )
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for name in options.only:
        with tempfile.TemporaryDirectory() as made:
            home = Path(made)
            prepare(name, home)
            finish(name, home, home / "first")  # compiles
            takes = finish(name, home, home / "whole")
            whole, faults = contents(home / "whole"), []
            assert whole == contents(home / "first"), f"{name}: two undisturbed runs differ"
            for k in range(options.first, options.moments):
                seconds = (
                    takes
                    * (k + random.Random(f"{options.seed} {name} {k}").random())
                    / options.moments
                )
                fault = disturbed(
                    name, home, home / f"out{k}", SIGNALS[k % len(SIGNALS)], seconds, whole
                )
                faults.append(fault)
                print(
                    f"{name} {k}: {fault.sent} after {seconds:.2f} s: {fault.wrong or 'well'}",
                    flush=True,
                )
            good = sum(not fault.wrong for fault in faults)
            print(
                f"{name:<9} {takes:.1f} s, {good} of {len(faults)} moments well, "
                f"{len(whole)} files",
                flush=True,
            )


if __name__ == "__main__":
    main()
