"""Cost of the spline energy against the quartic: one evaluation, a period of a replay, a whole
comparison.

The same motor twice: as the quartic, and as the spline fitted to a flux map computed from it.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numba
import numpy as np

from experiments.drawing import save
from experiments.spline_twin import twin
from model import energy
from model.drive_files import load_drive
from model.energy import AnyEnergy
from model.parameters import Drive
from sandbox.drive.scenario import load_scenario
from sandbox.evaluation.compare import compare
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.grouping import ROOMS
from sandbox.replay.replay import plan, prepare, run_block

SIDE = ROOMS[-1]  # sets side by side: a full block
COUNT, TURNS, GOALS = 200_000, 40, {"evaluation_ns": 3.0, "replay_ns": 2.5, "compare_cpu_s": 4.0}


@numba.njit(error_model="numpy")
def chain(m, n):
    """Evaluate currents n times, each at a flux that depends on the one before."""
    d, q = 0.01, 0.02
    for _ in range(n):
        a, b = energy.currents(m, d, q)
        d, q = 0.01 + 1e-9 * a, 0.02 + 1e-9 * b
    return d + q


def replayed(drive: Drive) -> Callable[[], float]:
    """Return a timer of a replay, ns a period and set, SIDE sets side by side: a square wave on a
    driven rotor."""
    n, h, motor = 4000, drive.converter.sampling_period, drive.motor
    k, omega = np.arange(n), 0.5 * motor.rated_omega
    angle = omega * h * (k + 0.5)
    u = (np.where(k % 8 < 4, 30.0, -30.0) + 1j * omega * motor.magnet_flux) * np.exp(1j * angle)
    columns = {
        "t": k * h,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "theta": omega * h * k,
        "u_dc": np.full(n, 400.0),
    }
    columns |= {f"i_{x}": np.zeros(n) for x in "abc"}
    campaign = Campaign(
        "cost", drive, (CampaignRecording("driven", "driven", "d", columns),), {}, {}, False
    )
    prepared = prepare(campaign, steps=1)
    sets = [
        {"stator_resistance.resistance": motor.resistance * (1.0 + 1e-3 * j)} for j in range(SIDE)
    ]
    block, out, moved = plan(prepared, sets)[0], np.empty((n, 3, SIDE)), np.empty((1, SIDE))

    def timed() -> float:
        """Return ns."""
        t = time.perf_counter()
        run_block(prepared, prepared.recordings[0], block, out, moved, 0)
        return (time.perf_counter() - t) / (n * SIDE) * 1e9

    return timed


def best(work: dict[str, Callable[[], float]], turns: int) -> dict[str, float]:
    """Return the least time of each, taken turn by turn so that a busy machine slows all."""
    least = dict.fromkeys(work, np.inf)
    for f in work.values():
        f()
    for _ in range(turns):
        for name, f in work.items():
            least[name] = min(least[name], f())
    return least


def per_call(f: Callable[..., float], m: AnyEnergy) -> Callable[[], float]:
    """Return a timer of f(m, COUNT) in ns a turn of its loop."""

    def timed() -> float:
        """Return ns a turn."""
        t = time.perf_counter()
        f(m, COUNT)
        return (time.perf_counter() - t) / COUNT * 1e9

    return timed


def main() -> None:
    """Measure and write the ratios."""
    drives = {"quartic": load_drive("ipm_exchanged")}
    drives["spline"] = twin(drives["quartic"])
    energies = {name: d.motor.energy for name, d in drives.items()}
    scenario = load_scenario("staircase")

    def whole(name: str) -> Callable[[], float]:
        """Return a timer of a whole comparison, CPU s."""
        return lambda: sum(run.cpu_seconds for run in compare(drives[name], scenario).runs)

    costs = {
        "evaluation_ns": best({k: per_call(chain, m) for k, m in energies.items()}, TURNS),
        "replay_ns": best({k: replayed(d) for k, d in drives.items()}, TURNS),
        "compare_cpu_s": best({k: whole(k) for k in drives}, 3),
    }
    ratios = {k: v["spline"] / v["quartic"] for k, v in costs.items()}
    save("spline_cost", {"costs": costs, "ratios": ratios, "goals": GOALS})
    print(ratios)


if __name__ == "__main__":
    main()
