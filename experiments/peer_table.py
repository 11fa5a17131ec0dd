"""Other simulators in one table, one run, one core: CPU per simulated second, position error, what
each leaves out.

Run: python -m experiments.peer_table --python PYTHON
    (two minutes; writes experiments/results/peer_table.{json,md})
PYTHON: one of 3.12 that has motulator==0.18.0 motulator-export gym-electric-motor
exciting-environments, best in an environment of its own: python3.12 -m venv peers && peers/bin/pip
install ...
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import statistics
import subprocess
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from estimators.registry import load_estimator
from experiments.drawing import RESULTS, save, shared
from experiments.lane_cost import driven, times
from sandbox.drive.simulate import simulate
from sandbox.evaluation.bench import C_STEP, c_reference, plant_second
from sandbox.evaluation.protocol_motion import reversal_case
from sandbox.evaluation.score import error_of
from sandbox.replay.grouping import ROOMS

SCRIPTS = Path(__file__).parent / "peers"
ALONE = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
LOOP, PLANT = "closed loop", "plant alone"
WHAT = {  # name: what is run, what it has, what it leaves out
    "sensorless-sandbox, qnull": (
        LOOP,
        "every PWM edge exact, saturation and 26 effects possible",
        "",
    ),
    "sensorless-sandbox, inversion": (LOOP, "the same", ""),
    "sensorless-sandbox, ekf": (LOOP, "the same", ""),
    "motulator-export, native": (
        LOOP,
        "C, adaptive RK45, averaged voltage",
        "PWM edges here (it has them)",
    ),
    "motulator-export, native, constant speed": (
        LOOP,
        "the same without asking Python for references",
        "the same",
    ),
    "motulator": (LOOP, "Python, adaptive RK45, averaged voltage", "PWM edges here (it has them)"),
    "sensorless-sandbox": (PLANT, "4 kHz, every PWM edge exact, saturated, rotor free", ""),
    "sensorless-sandbox, 1000 at once": (
        PLANT,
        "the same, sets side by side in blocks, rotor driven",
        "",
    ),
    "C reference": (PLANT, "RK4 of 10 us, saturated, rotor free", "PWM edges, effects, events"),
    "exciting-environments": (
        PLANT,
        "JAX, one Euler step of 100 us",
        "PWM edges, saturation here, mechanics, effects",
    ),
    "exciting-environments, 1000 at once": (PLANT, "the same, a thousand side by side", "the same"),
    "gym-electric-motor": (
        PLANT,
        "Python, one step of 100 us",
        "PWM edges here, saturation, position estimators",
    ),
}


class Peer(NamedTuple):
    """A measured simulator: CPU seconds a simulated second, position error rms (degrees; None: no
    estimator)."""

    name: str
    cost: float
    rms: float | None = None


def ours() -> Iterator[Peer]:
    """Yield our closed loop on motulator's example, and our plant alone."""
    drive, scenario = reversal_case()
    for name in ("qnull", "inversion", "ekf"):
        method = load_estimator(name)
        runs = [simulate(drive, scenario, method) for _ in range(6)][1:]
        cost = statistics.median(run.cpu_seconds for run in runs) / scenario.duration
        rms = error_of(runs[0].recording.between(scenario.duration / 8.0, scenario.duration)).rms
        yield Peer(f"sensorless-sandbox, {name}", cost, rms)
    yield Peer("sensorless-sandbox", plant_second())
    prepared = driven()
    # s a period, of as many sets as fit; a thousand are such blocks in turn
    block = 1e-9 * times(prepared, {})[-1]
    blocks = -(-1000 // ROOMS[-1])
    yield Peer(
        "sensorless-sandbox, 1000 at once",
        blocks * block / 1000.0 / prepared.campaign.drive.converter.sampling_period,
    )
    yield Peer("C reference", c_reference(shared("SENSORLESS_ANCHORS", "anchors")) * 1e-9 / C_STEP)


def theirs(python: str) -> Iterator[Peer]:
    """Yield the peers that run in another Python; one that does not run is told and left out."""
    for script in sorted(SCRIPTS.glob("*_case.py")):
        done = subprocess.run(
            [python, str(script)], capture_output=True, text=True, check=False, env=ALONE
        )
        if done.returncode:
            print(f"{script.name} does not run: {done.stderr.strip().splitlines()[-1]}")
        for line in done.stdout.splitlines():
            if line.startswith("{"):
                found: dict[str, Any] = json.loads(line)
                yield Peer(found["peer"], found["cpu_s_per_s"], found.get("rms_deg"))


def markdown(peers: list[Peer]) -> str:
    """Return the table with its date and machine."""
    said = textwrap.fill(
        f"{datetime.date.today()}, one core of {processor()}, all in one run. Closed loop: "
        "motulator's 2.2 kW example, a linear motor, square-wave injection at 4 kHz, a speed "
        "reversal of 4 s; error: rms after the first eighth. Plant alone: no control; models "
        "differ, see what each leaves out. CPU seconds a simulated second; "
        f"{os.getloadavg()[0]:.0f} programs shared {os.cpu_count()} cores, so a quiet machine "
        "needs less.",
        120,
    )
    rows = [
        "| simulator | run | CPU s/s | error ° | model | left out |",
        "|---|---|--:|--:|---|---|",
    ]
    for name, (kind, has, lacks) in WHAT.items():
        for p in (p for p in peers if p.name == name):
            rms = "–" if p.rms is None else f"{p.rms:.2g}"
            rows.append(f"| {name} | {kind} | {p.cost:.2g} | {rms} | {has} | {lacks or '–'} |")
    return "\n".join(["# Peers in one table", "", said, "", *rows, ""])


def processor() -> str:
    """Return what the machine's processor is called."""
    lines = (
        Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        if platform.system() == "Linux"
        else []
    )
    return next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")),
        platform.machine(),
    )


def main() -> None:
    """Measure, print, keep."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--python", required=True)
    peers = [*ours(), *theirs(arguments.parse_args().python)]
    text = markdown(peers)
    (RESULTS / "peer_table.md").write_text(text, encoding="utf-8")
    save("peer_table", {"processor": processor(), "peers": [p._asdict() for p in peers]})
    print(text)


if __name__ == "__main__":
    main()
