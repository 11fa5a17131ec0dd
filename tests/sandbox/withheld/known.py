"""Truths, diagnoses and rows whose worth is known; a drawn campaign's truth as a replay takes
it."""

import math
from types import SimpleNamespace

import numpy as np

from sandbox.withheld.scoring.rows import BLIND, LEFT_OUT, RESOLVED, row

ALPHAS = [f"alpha_{n}" for n in ("30", "12", "40", "22", "04")]


def truth_of(effects=("dead_time",), kind="one", sizes=(1.0,), parameters=None):
    """Return one entry of a seal."""
    values = {"dead_time.time": 2e-6} if parameters is None else parameters
    return {
        "effects": list(effects),
        "kind": kind,
        "family": "ipm",
        "sizes": list(sizes),
        "parameters": values,
    }


def diagnosis_of(
    *hypotheses, verdict="explained", members=None, subsystem="inverter", before=3.0, shrunk=0.9
):
    """Return a diagnosis of (effects, probability) pairs, its parameters around the truth."""
    time = {"dead_time.time": {"value": 2e-6, "ci95": [1.9e-6, 2.1e-6], "unit": "s"}}
    return {
        "verdict": verdict,
        "gap": {"before": before, "after": 1.0, "closed": shrunk},
        "where": [{"subsystem": subsystem, "share": 1.0}],
        "hypotheses": [
            {"effects": list(e), "probability": p, "parameters": time} for e, p in hypotheses
        ],
        "ambiguity_set": [list(e) for e, _ in hypotheses[:1]] if members is None else members,
        "cost": {"simulations": 100, "seconds": 2.0},
    }


class Oracle:
    """A diagnosis that knows the answers of `check`; counts its calls, fails on one campaign while
    told to."""

    def __init__(self, failing=None):
        self.calls, self.failing = [], failing

    def __call__(self, folder, exclude):
        self.calls.append((folder.name, exclude))
        if folder.name == self.failing:
            raise RuntimeError("no memory")
        none, unknown = (
            diagnosis_of(([], 1.0), verdict="no_gap", shrunk=None, before=1.0),
            diagnosis_of((["unknown"], 1.0)),
        )
        answers = {"w001": none, "w002": unknown, "w004": none}
        answers["w003"] = diagnosis_of((["dead_time", "inertia"], 0.8), (["inertia"], 0.2))
        found = answers.get(folder.name, diagnosis_of((["dead_time"], 0.9), ([], 0.1)))
        return SimpleNamespace(json=unknown if exclude else found)


def twelve():
    """Return rows of twelve campaigns: right, wrong, failed, ambiguous, none, outside, several, in
    all three parts."""
    pair = [["dead_time"], ["device_drop"]]
    asks = {
        "next_recording": {
            "entry": "free_coast",
            "seconds": 1.0,
            "power": 0.925,
            "gain": 3.0,
            "description": "x",
        }
    }
    ambiguous = (
        diagnosis_of(
            (["dead_time"], 0.6), (["device_drop"], 0.4), verdict="ambiguous", members=pair
        )
        | asks
    )
    none = diagnosis_of(
        ([], 1.0 - 1e-4), (["inertia"], 1e-4), verdict="no_gap", shrunk=None, before=1.0
    )
    unknown = diagnosis_of(
        (["unknown"], 0.97), (["iron_loss", "unknown"], 0.02), (["iron_loss"], 0.01)
    )
    both = diagnosis_of((["dead_time", "inertia"], 0.8), (["inertia"], 0.2), shrunk=1.0 / 3.0)
    right = diagnosis_of((["dead_time"], 0.123456789), (["device_drop"], 1e-7 / 3.0))
    wrong = diagnosis_of((["iron_loss"], 0.97), (["dead_time"], 0.03), subsystem="machine")
    outside, several = (
        truth_of(("unknown",), "outside", (1.0,), {}),
        truth_of(("dead_time", "inertia"), "several"),
    )
    nothing, small = truth_of((), "none", (), {}), truth_of(sizes=(0.2500001,))
    cases = [
        (truth_of(), right),
        (truth_of(), wrong),
        (truth_of(), {"failed": "no memory"}),
        (truth_of(), ambiguous),
        (nothing, none),
        (nothing, none),
        (nothing, wrong),
        (outside, unknown),
        (outside, right),
        (several, both),
        (several, right),
        (small, none),
    ]
    by = {"code": "abc", "made": "2026-01-01T00:00:00+00:00", "cpu_seconds": 1.5}
    named = [(f"w{k:03d}", t, {**d, **by}) for k, (t, d) in enumerate(cases)]
    out = [row("diagnosis", BLIND, *n) for n in named]
    out.append(row("diagnosis", LEFT_OUT, "w000", truth_of(), {**unknown, "code": "abc"}))
    out.append(row("diagnosis", RESOLVED, "w003", truth_of(), {**right, "code": "abc"}))
    return out


def true_set(drawn, campaign):
    """Return the truth as a replay of the campaign takes it: true motor, plant, and every ordinary
    deviation."""
    true, stated, own = drawn.true.motor, drawn.stated, drawn.as_json()["bench"]
    values = dict(drawn.plant)
    values |= {
        "stator_resistance.resistance": true.resistance,
        "magnet_flux.magnet_flux": true.magnet_flux,
    }
    values |= {
        "inertia.inertia": true.inertia,
        "viscous_friction.coefficient": true.viscous_friction,
    }
    values |= {f"saturation.{a}": getattr(true, a) for a in ALPHAS}
    values |= {
        f"inductance.scale_{x}": getattr(true, f"inductance_{x}")
        / getattr(stated, f"inductance_{x}")
        for x in "dq"
    }
    values |= {
        f"bench.{k}": own[k] for k in ("common_offset", "load_torque_offset", "soft_current")
    }
    locked = [r.theta for r in campaign.recordings if r.rotor == "locked"]
    read = float(np.mean(locked[0])) if locked else drawn.theta
    wobble = drawn.plant.get("encoder_eccentricity.amplitude_mech", 0.0) * true.pole_pairs
    wobble *= math.sin(
        drawn.theta / true.pole_pairs + drawn.plant.get("encoder_eccentricity.phase", 0.0)
    )
    return values | {
        "bench.lock_angle": drawn.theta + drawn.plant["encoder_offset.offset"] + wobble - read
    }
