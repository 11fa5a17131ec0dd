"""The probes of `cost_before`: run in a tree of the project's history, old or new, they print CPU
seconds as JSON.

Run by cost_before: python cost_probe.py TREE [CAMPAIGN ...]; nothing but names that both trees have
is used, looked up where each has them.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from collections.abc import Callable
from typing import Any

sys.path.insert(0, sys.argv[1])
REPEATS = 3
SETS = 48  # whole batches, before (16) and now (24)
LINK = ("cross_saturation",)  # planted as another motor, not as a number


def anywhere(name: str, *modules: str) -> Any:
    """Return what a name stands for in the first module that there is."""
    for module in modules:
        try:
            return getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError):
            continue
    raise ImportError(name)


load_drive = anywhere("load_drive", "model.drive_files", "model.parameters")
load_estimator = anywhere("load_estimator", "estimators.registry")
simulate = anywhere("simulate", "sandbox.drive.simulate", "sandbox.simulate")
scenario = ("sandbox.drive.scenario", "sandbox.scenario")
Scenario, Segment = anywhere("Scenario", *scenario), anywhere("Segment", *scenario)
typical, effect_names = (anywhere(n, "model.effects.library") for n in ("typical", "effect_names"))
campaigns = ("sandbox.recordings.campaign", "sandbox.campaign")
try:
    read_folder = anywhere("read_folder", *campaigns)
except ImportError:
    read_folder = anywhere("read_campaign", *campaigns)
prepare, replay = (anywhere(n, "sandbox.replay.replay") for n in ("prepare", "replay"))
CURVE = "leg_voltage"  # which older checkouts lack
STEPS = Scenario("steps", (Segment(0.5), Segment(1.5, load=1.2, ramp=0.1)), rotor="locked")


def least(run: Callable[[], float]) -> float:
    """Return the least of what a probe gives, the first one (which compiles) left out."""
    run()
    return min(run() for _ in range(REPEATS))


def timed(run: Callable[[], object]) -> float:
    """Return the CPU seconds of a call."""
    begun = time.process_time()
    run()
    return time.process_time() - begun


def closed_loop(motor: str, effects: dict[str, float]) -> float:
    """Return CPU seconds of the loop for one second of `qnull`, without preparing it."""
    drive = load_drive(motor)
    found = simulate(drive, STEPS, load_estimator("qnull"), effects=effects)
    return float(found.cpu_seconds) / STEPS.duration


def every(motor: str) -> dict[str, float]:
    """Return all effects at typical size, each by its public numbers."""
    drive = load_drive(motor)
    names = [n for n in effect_names() if n not in (*LINK, CURVE)]
    return {k: v for n in names for k, v in typical(n, drive.motor, drive.converter).items()}


def replayed(folder: str, effect: str) -> float:
    """Return nanoseconds a period and set for SETS sets of one effect ('' for none) on a
    campaign."""
    campaign = read_folder(folder)
    prepared = prepare(campaign)
    sizes = typical(effect, campaign.drive.motor, campaign.drive.converter) if effect else {}
    first = next(iter(sizes), "stator_resistance.resistance")
    middle = sizes.get(first, campaign.drive.motor.resistance)
    sets = [{**sizes, first: middle * (1.0 + 1e-3 * k)} for k in range(SETS)]
    return 1e9 * least(lambda: timed(lambda: replay(prepared, sets))) / SETS / prepared.samples


def main() -> None:
    """Print what every probe measures."""
    out = {
        "closed loop, no effects (CPU s a second)": least(lambda: closed_loop("ipm_exchanged", {})),
        "closed loop, all effects (CPU s a second)": least(
            lambda: closed_loop("ipm_exchanged", every("ipm_exchanged"))
        ),
    }
    for folder in sys.argv[2:]:
        name = folder.rstrip("/").rpartition("/")[2]
        for effect in ("", "dead_time", "iron_loss", "current_filter"):
            out[
                f"replay, {effect.replace('_', ' ') or 'no effect'}, {name} (ns a period and set)"
            ] = replayed(folder, effect)
        diagnose = anywhere("diagnose", "sandbox.gap.diagnose")
        found = []
        spent = timed(lambda: found.append(diagnose(folder, workers=1)))  # noqa: B023
        spent = timed(lambda: found.append(diagnose(folder, workers=1)))  # noqa: B023  the first one compiled
        samples = sum(len(r.columns["t"]) for r in read_folder(folder).recordings)
        out[f"diagnosis of {name} (CPU s)"] = spent
        out[f"replay, a diagnosis' mean, {name} (ns a period and simulation)"] = (
            1e9 * spent / found[-1].simulations / samples
        )
    print(json.dumps(out))


if __name__ == "__main__":
    main()
