"""What the simulator costs, and beside it, in the same run, the C reference and the peer.

Times are CPU seconds of one core, medians; absolute times depend on the machine, ratios hardly do.
"""

from __future__ import annotations

import dataclasses
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from estimators.registry import load_estimator
from model.compiled import kernel
from model.drive_files import load_drive
from model.effects.library import effect_names, typical
from model.errors import BadInput
from model.parameters import Drive, Rotor
from model.saliency import current_for_torque
from sandbox.drive import loop
from sandbox.drive.closed import closed_bench
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.evaluation.peer_python import SCRIPT
from sandbox.evaluation.score import error_of
from sandbox.plant.period import STILL
from sandbox.plant.sets import complete

PERIODS, C_STEPS = 100_000, 4_000_000
C_STEP = 1e-5  # s, of the reference
PEER_REPETITIONS = 3
PLANT, LOOP = "plant_cpu_s_per_s", "closed_loop_qnull_cpu_s_per_s"  # names of two figures


@kernel
def _many_periods(bench, rig, memory, rng, periods):
    """Move the plant on through periods of a 500 Hz square wave, as reference_rk4.c does."""
    looks, seen = np.full(2, -1.0), np.zeros((2, 2))
    for k in range(periods):
        memory[loop.Memory.U_ALPHA], memory[loop.Memory.U_BETA] = (
            (-30.0 if (k // 4) & 1 else 30.0),
            10.0,
        )
        loop.progress(k, bench, rig, STILL, memory, looks, seen, rng, False)


def plant_second() -> float:
    """Return the CPU seconds that the closed loop's plant takes for a second at 4 kHz, saturated,
    the rotor free."""
    drive = load_drive("ipm")
    motor = dataclasses.replace(drive.motor, magnet_flux=0.2, inertia=1e-3)
    bench = closed_bench(motor, drive.converter, complete(motor, drive.converter), "free", 0.0, 1.0)
    rig = loop.Rig(
        1, 1, 0, 0, int(Rotor.FREE), drive.converter.sampling_period, *3 * (0.0,), 400.0, 0.0, 0.0
    )
    memory, rng = np.zeros(loop.MEMORY), np.random.default_rng(0)
    memory[loop.Memory.LINK] = 1.0
    _many_periods(bench, rig, memory, rng, 10)
    spent = _median(lambda: _many_periods(bench, rig, memory, rng, PERIODS))
    return spent / (PERIODS * drive.converter.sampling_period)


def check_c_reference(anchors: Path) -> Path:
    """Return the C reference's source; BadInput without it, or without a compiler."""
    source = anchors / "reference_rk4.c"
    if not source.is_file() or not shutil.which("gcc"):
        raise BadInput(f"the C reference needs gcc and '{source}'; give the folder with --anchors")
    return source


def c_reference(anchors: Path) -> float:
    """Return the cost of one step of `reference_rk4.c` (mode 0, gcc -O3 -march=native) in ns;
    BadInput without source or compiler."""
    source = check_c_reference(anchors)
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "reference"
        subprocess.run(
            ["gcc", "-O3", "-march=native", str(source), "-o", str(program), "-lm"], check=True
        )
        out = subprocess.run(
            [str(program), "0", str(C_STEPS), "5"], check=True, capture_output=True, text=True
        )
    return float(re.findall(r"([\d.]+) ns/RK4-step", out.stdout)[0])


def peer_case() -> tuple[Drive, Scenario]:
    """Return motor, speed and load profile of motulator's `poly` case in `peer_motulator.py`."""
    drive = load_drive("ipm")
    motor = dataclasses.replace(drive.motor, magnet_flux=0.2, inertia=1e-3, viscous_friction=0.0)
    converter = dataclasses.replace(
        drive.converter,
        sampling_period=125e-6,
        pwm_frequency=8000.0,
        dc_bus_voltage=300.0,
        current_noise=0.0,
        current_resolution=0.0,
    )
    injection = dataclasses.replace(drive.injection, frequency=4000.0, amplitude=60.0)
    drive = dataclasses.replace(drive, motor=motor, converter=converter, injection=injection)
    load = current_for_torque(motor, 0.2 * 2.0, closed_loop=False)[0] / motor.rated_current
    speed = 0.1 * 2.0 * np.pi * 50.0 / motor.rated_omega
    segments = (
        Segment(0.125),
        Segment(0.125, load),
        Segment(0.125, load, speed),
        Segment(0.125, load, 0.0, 0.125),
        Segment(0.125, load, -speed, 0.125),
        Segment(0.125, load, -speed),
        Segment(0.125, load, 0.0),
        Segment(0.125, 0.0, 0.0),
    )
    return drive, Scenario("peer", segments, "free", "speed", start_up=False, start_angle=0.0)


def closed_loop(estimator: str) -> tuple[float, float]:
    """Return CPU seconds per simulated second on the peer's case, and the error's rms in degrees
    after 1/8."""
    drive, scenario = peer_case()
    method = load_estimator(estimator)
    runs = [simulate(drive, scenario, method) for _ in range(9)]
    recording = runs[0].recording
    rms = error_of(recording.between(scenario.duration / 8.0, scenario.duration)).rms
    return statistics.median(r.cpu_seconds for r in runs[1:]) / scenario.duration, rms or 0.0


def effects_cost() -> dict[str, float]:
    """Return cost over that without effects on the peer's case: all neutral, one tiny effect, every
    effect.

    The four kinds of run take turns, so that the machine's moods cancel in the ratios.
    """
    drive, scenario = peer_case()
    method, everything = load_estimator("qnull"), {"current_sampling.jitter": 1e-7}
    for name in effect_names():
        if name != "saturation":  # shares two coefficients with cross_saturation
            everything = typical(name, drive.motor, drive.converter) | everything
    cases = {
        "none": None,
        "neutral": {"dead_time.time": 0.0},
        "one_effect": {"coulomb_friction.torque": 1e-9},
        "all_effects": everything,
    }
    costs: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(9):
        for name, on in cases.items():
            costs[name].append(simulate(drive, scenario, method, effects=on).cpu_seconds)
    middle = {name: statistics.median(times[1:]) for name, times in costs.items()}
    return {
        f"{name}_to_none_cpu": middle[name] / middle["none"] for name in cases if name != "none"
    }


def peer(
    anchors: Path, python: str, case: str = "poly", seconds: float = 1.0
) -> tuple[float, float]:
    """Return motulator's CPU seconds per simulated second and error rms (degrees) on the same case
    of its script; BadInput where it cannot be run."""
    script = anchors / SCRIPT
    call = [
        python,
        str(script),
        "--t",
        str(seconds),
        "--reps",
        str(PEER_REPETITIONS),
        "--only",
        case,
    ]
    pattern, said = re.compile(case + r"\s+0 .*?\|\s*([\d.]+) \(.*?\|.*?\|\s*([\d.]+) /"), []
    try:
        running = subprocess.Popen(
            call, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
    except OSError:
        raise BadInput(
            f"'{python}' cannot be run; give a Python >= 3.12 with motulator 0.18"
        ) from None
    with running as process:
        for line in process.stdout or ():
            found = pattern.search(line)
            if found:  # the averaged-voltage case comes first; what follows takes minutes
                process.kill()
                return float(found[1]), float(found[2])
            said.append(line.strip())
    last = next((line for line in reversed(said) if line), "no output")
    raise BadInput(
        f"motulator did not run in '{python}' ({last}); give a Python >= 3.12 with motulator 0.18"
    )


def warm_start() -> float:
    """Return the wall seconds of a whole short command in a new process, everything compiled."""
    call = [
        sys.executable,
        "-m",
        "sandbox.cli",
        "simulate",
        "--duration",
        "0.01",
        "--json-only",
        "--quiet",
        "--out",
    ]
    with tempfile.TemporaryDirectory() as out:
        times = []
        for _ in range(4):
            begun = time.perf_counter()
            subprocess.run([*call, out], check=True)
            times.append(time.perf_counter() - begun)
    return statistics.median(times[1:])


def bench(anchors: Path | None, python: str) -> dict[str, Any]:
    """Return `measured` figures and, where the reference programs are given, `ratios` of ours to
    theirs."""
    if anchors:
        check_c_reference(anchors)
    measured = {PLANT: plant_second(), "warm_start_s": warm_start()}
    errors: dict[str, float] = {}
    for name in ("qnull", "inversion", "ekf"):
        cost, errors[name] = closed_loop(name)
        measured[f"closed_loop_{name}_cpu_s_per_s"], measured[f"closed_loop_{name}_rms_deg"] = (
            cost,
            errors[name],
        )
    ratios = effects_cost()
    if anchors:
        ratios["plant_to_c"] = measured[PLANT] / (c_reference(anchors) * 1e-9 / C_STEP)
        cost, rms = peer(anchors, python)
        measured["peer_cpu_s_per_s"], measured["peer_rms_deg"] = cost, rms
        for name, error in errors.items():
            ratios[f"peer_to_{name}_cpu"] = cost / measured[f"closed_loop_{name}_cpu_s_per_s"]
            ratios[f"{name}_to_peer_rms"] = error / rms
    return {"measured": measured, "ratios": ratios}


WORDS = {
    PLANT: ("a simulated second of the plant alone, saturated", "ms of CPU"),
    "warm_start_s": ("a short command from start to end, everything compiled", "s"),
    "closed_loop_(.+)_cpu_s_per_s": ("a simulated second in closed loop, {}", "ms of CPU"),
    "closed_loop_(.+)_rms_deg": ("position error of that run, {}, rms", "°"),
    "neutral_to_none_cpu": ("CPU with an effect of size zero, to that without effects", "x"),
    "one_effect_to_none_cpu": ("CPU with one effect, to that without effects", "x"),
    "all_effects_to_none_cpu": ("CPU with every effect, to that without effects", "x"),
    "plant_to_c": ("CPU of the plant, to that of the C reference", "x"),
    "peer_cpu_s_per_s": ("a simulated second in motulator", "ms of CPU"),
    "peer_rms_deg": ("position error of motulator, rms", "°"),
    "peer_to_(.+)_cpu": ("CPU of motulator, to that of {}", "x"),
    "(.+)_to_peer_rms": ("position error of {}, to that of motulator", "x"),
}


def in_words(name: str, value: float) -> tuple[str, str]:
    """Return what a figure is, in words, and its value with its unit."""
    for pattern, (words, unit) in WORDS.items():
        found = re.fullmatch(pattern, name)
        if found:
            size = 1e3 * value if unit.startswith("ms") else value
            return words.format(*found.groups()), f"{size:.3g}{'' if unit == '°' else ' '}{unit}"
    return name, f"{value:.4g}"


def _median(work: Callable[[], None], repetitions: int = 5) -> float:
    times = []
    for _ in range(repetitions):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return statistics.median(times)
