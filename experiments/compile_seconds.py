"""How long does compiling take, command by command, from an empty cache?

Each command runs on what comes with the package.  What it took is written into
model/kernels/usual.json, from which a command's first run on another machine says how long it will
compile (by as much longer or shorter as its first kernels took there).

Run: python -m experiments.compile_seconds [COMMAND ...]   (all: ten minutes of the processor)
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from model.kernels.memory import Memory
from model.kernels.notice import USUAL
from sandbox.recordings.campaign import EXAMPLE

LOG = str(EXAMPLE)
COMMANDS = (
    ("compare",),
    ("simulate", "--effects", "dead_time.time=2e-6", "--record", "log"),
    ("audit", "ipm"),
    ("maps", "ipm"),
    ("check", LOG),
    ("identify", "log"),  # of simulate
    ("replay", LOG),
    ("plan", "--can", "locked"),
    ("diagnose", "--example"),
    ("protocol", "--estimators", "qnull,ekf", "--motors", "ipm"),
    ("sweep", "sweep.toml"),
    ("withheld", "make", "sealed", "--count", "1"),
    ("bench",),
)
SWEEP = '[run]\nestimator = "qnull"\n[grid]\nmotor = ["ipm", "ipm_exchanged"]\n'


def main() -> None:
    """Run every command, or those named, print what compiling took each, and keep that."""
    asked = [words for words in COMMANDS if words[0] in (sys.argv[1:] or words)]
    memory = Memory()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "sweep.toml").write_text(SWEEP, encoding="utf-8")
        environment = {**os.environ, "SENSORLESS_CACHE": str(place / "cache")}
        for words in asked:
            run = [sys.executable, "-m", "sandbox", *words]
            done = subprocess.run(run, cwd=place, env=environment, capture_output=True, text=True)
            memory = Memory.read((place / "cache" / "compiling.json").read_text(encoding="utf-8"))
            seconds = {
                command: sum(memory.took.get(n, 0.0) for n in memory.all_of(courses[-1]))
                for command, courses in memory.courses.items()
            }
            print(words[0], done.returncode, f"{seconds.get(words[0], 0.0):.1f} s", flush=True)
            if done.returncode:
                print(done.stderr[-500:])
    usual = Memory.read(USUAL.read_text(encoding="utf-8"))
    for command in {c for c, *_ in asked} & memory.courses.keys():
        usual.courses[command] = memory.courses[command][-1:]
    usual.took |= memory.took
    usual.inside |= memory.inside
    USUAL.write_text(usual.text(), encoding="utf-8")


if __name__ == "__main__":
    main()
