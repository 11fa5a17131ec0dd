"""Is what a long recording, a large campaign or a long simulation costs in proportion to its
length?

`python -m experiments.load` runs the command line on ever longer input, each time in a process of
its own, and prints processor time, the largest memory and the exponent of time between one length
and the next (1: in proportion). `--longest` goes up to 10 minutes at 10 kHz in one recording, 200
recordings in a campaign, an hour's simulation.  Of more than 250 000 samples a diagnosis works on
100 000 only.  `--memory` is a limit in GB for each.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
RESULTS = Path(__file__).parent / "results"
MOTOR = ROOT / "model" / "motors" / "ipm_exchanged.toml"
GIGA = 1e9
SHORT = 0.5  # s of each of many recordings


class Case(NamedTuple):
    """A command and the lengths of its input: unit, usual lengths and the longest ones."""

    name: str
    unit: str
    usual: tuple[float, ...]
    longest: tuple[float, ...]


class Cost(NamedTuple):
    """What one call cost: processor time in s, largest memory in GB, or the sentence with which it
    was refused."""

    name: str
    length: float
    unit: str
    seconds: float
    memory: float
    refused: str


CASES = (
    Case("simulate", "s simulated", (15.0, 60.0), (225.0, 900.0, 3600.0)),
    Case("record", "s at 10 kHz", (15.0, 60.0), (37.5, 150.0, 600.0)),
    Case("check", "s at 10 kHz", (15.0, 60.0), (37.5, 150.0, 600.0)),
    Case("diagnose", "s at 10 kHz", (3.75, 15.0), (37.5, 150.0, 600.0)),
    Case("check many", "recordings", (12.0, 50.0), (12.0, 50.0, 200.0)),
    Case("diagnose many", "recordings", (3.0, 12.0), (12.0, 50.0, 200.0)),
)


def scenario(seconds: float) -> str:
    """Return a driven run: standstill, then turning under load."""
    return (
        '[scenario]\nname = "long"\nrotor = "driven"\n[[segment]]\nduration = '
        f"{seconds / 6}\nload = 0.3\n"
        f"[[segment]]\nduration = {seconds * 5 / 6}\nspeed = 0.1\nload = 0.8\nramp = "
        f"{seconds / 60}\n"
    )


def motor() -> str:
    """Return the motor's file, sampled at 10 kHz."""
    text = MOTOR.read_text(encoding="utf-8")
    drive = tomllib.loads(text)["drive"]
    for name, value in (("sampling_period", 1e-4), ("pwm_frequency", 1e4)):
        text = text.replace(f"{name} = {drive[name]}", f"{name} = {value}")
    changed = tomllib.loads(text)["drive"]
    assert (changed["sampling_period"], changed["pwm_frequency"]) == (1e-4, 1e4)
    return text


def recorded(home: Path, seconds: float) -> list[str]:
    """Return the call that records a run as a campaign, after writing its scenario."""
    (home / "motor.toml").write_text(motor(), encoding="utf-8")
    (home / f"s{seconds:g}.toml").write_text(scenario(seconds), encoding="utf-8")
    return [
        "simulate",
        "--motor",
        "motor.toml",
        "--scenario",
        f"s{seconds:g}.toml",
        "--json-only",
        "--record",
        f"r{seconds:g}",
        "--effects",
        "dead_time.time=2e-6",
    ]


def many(home: Path, count: int) -> Path:
    """Return a campaign of so many short recordings: one recorded run under many names, each a
    link."""
    one, folder = home / f"r{SHORT:g}", home / f"many{count}"
    if not one.exists():
        called(home, recorded(home, SHORT), None)
    text = (one / "campaign.toml").read_text(encoding="utf-8")
    head, _, entry = text.partition("[[recording]]")
    name = tomllib.loads(text)["recording"][0]["file"]
    folder.mkdir(exist_ok=True)
    entries = []
    for k in range(count):
        file = f"r{k:03d}.parquet"
        if not (folder / file).exists():
            os.link(one / name, folder / file)
        entries.append("[[recording]]" + entry.replace(name, file))
    (folder / "campaign.toml").write_text(head + "\n".join(entries), encoding="utf-8")
    return folder


def called(home: Path, words: Sequence[str], memory: float | None) -> tuple[float, float, str]:
    """Call the command line in a process of its own; return its processor time, memory (GB) and
    refusal."""

    def limited() -> None:
        """Let the process map no more than the limit."""
        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (int(memory * GIGA), resource.RLIM_INFINITY))

    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    call = [sys.executable, "-m", "sandbox.cli", *words, "--quiet", "--out", str(home / "out")]
    with (home / "said.txt").open("w") as said:
        process = subprocess.Popen(
            call, cwd=home, env=environment, stderr=said, stdout=said, preexec_fn=limited
        )
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    lines = (home / "said.txt").read_text(errors="replace").strip().splitlines()
    wrong = (
        f"exit code {process.returncode}: {(lines or [''])[-1][:200]}" if process.returncode else ""
    )
    return used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / GIGA, wrong


def cost(case: Case, length: float, home: Path, memory: float | None) -> Cost:
    """Return what a case costs at a length."""
    if case.name == "simulate":
        (home / "s.toml").write_text(scenario(length), encoding="utf-8")
        words = ["simulate", "--scenario", "s.toml", "--json-only"]
    elif case.name == "record":
        words = recorded(home, length)
    elif case.name.endswith("many"):
        words = [case.name.split()[0], str(many(home, int(length)))]
    else:
        if not (home / f"r{length:g}").exists():
            called(home, recorded(home, length), None)
        words = [case.name, f"r{length:g}"]
    if words[0] == "diagnose":
        words += ["--jobs", "1"]
    return Cost(case.name, length, case.unit, *called(home, words, memory))


def exponents(found: Sequence[Cost]) -> Iterator[tuple[Cost, float]]:
    """Yield each cost with the exponent of its time against the length before it, NaN for a first
    one."""
    before: dict[str, Cost] = {}
    for c in found:
        last = before.get(c.name)
        apart = c.refused or last is None or last.refused
        yield (
            c,
            math.nan
            if apart or last is None
            else math.log(c.seconds / last.seconds) / math.log(c.length / last.length),
        )
        before[c.name] = c


def table(found: Sequence[Cost]) -> list[str]:
    """Return lines of markdown."""
    lines = ["| command | length | processor s | memory GB | exponent |", "|---|--:|--:|--:|--:|"]
    for c, exponent in exponents(found):
        text = "" if math.isnan(exponent) else f"{exponent:.2f}"
        if c.refused:
            lines.append(f"| {c.name} | {c.length:g} {c.unit} | {c.refused} | {c.memory:.2f} | |")
        else:
            lines.append(
                f"| {c.name} | {c.length:g} {c.unit} | {c.seconds:.1f} | {c.memory:.2f} | {text} |"
            )
    return lines


def main() -> None:
    """Run, and write results/load.md and load.json where all cases ran at their longest."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--longest", action="store_true", help="the lengths of the issue: an hour or more"
    )
    parser.add_argument("--only", nargs="+", choices=[c.name for c in CASES])
    parser.add_argument("--most", type=float, default=math.inf, help="no length above this")
    parser.add_argument("--memory", type=float, help="GB that a process may map")
    options = parser.parse_args()
    kept = RESULTS / "load.json"
    found = []
    with tempfile.TemporaryDirectory() as made:
        home = Path(made)
        for case in CASES:
            if options.only and case.name not in options.only:
                continue
            called(home, recorded(home, 0.25), None)
            cost(case, min(case.usual), home, None)  # compiles
            for length in case.longest if options.longest else case.usual:
                if length <= options.most:
                    found.append(cost(case, length, home, options.memory))
                    print(table(found)[-1], flush=True)
    if options.longest:
        before = [Cost(**c) for c in json.loads(kept.read_text())] if kept.exists() else []
        again = {(c.name, c.length) for c in found}
        found = [c for c in before if (c.name, c.length) not in again] + found
        found.sort(key=lambda c: ([k.name for k in CASES].index(c.name), c.length))
        kept.write_text(json.dumps([c._asdict() for c in found], indent=1) + "\n")
        (RESULTS / "load.md").write_text("\n".join(["# Load", "", *table(found)]) + "\n")


if __name__ == "__main__":
    main()
