"""Cost of the spline energy against the quartic: one evaluation in a dependent chain, and an RK4 step of the flux."""

from __future__ import annotations

import time

import numba
import numpy as np

from experiments.drawing import save
from model import energy, spline_energy
from model.fluxmap import FluxMap
from model.parameters import load_drive

COUNT = 1_000_000


def runners(currents):
    """Return compiled loops over one model's currents: a chain of evaluations, and RK4 steps at locked rotor."""

    @numba.njit(error_model="numpy")
    def chain(m, d0, n):
        d, q = d0, 0.02
        for _ in range(n):
            a, b = currents(m, d, q)
            d, q = d0 + 1e-9 * a, 0.02 + 1e-9 * b
        return d + q

    @numba.njit(error_model="numpy")
    def steps(m, d0, n):
        d, q, h, r = d0, 0.02, 1.25e-5, 12.0
        for _ in range(n):
            a, b = currents(m, d, q)
            a, b = 3.0 - r * a, 1.0 - r * b
            c, e = currents(m, d + 0.5 * h * a, q + 0.5 * h * b)
            c, e = 3.0 - r * c, 1.0 - r * e
            f, g = currents(m, d + 0.5 * h * c, q + 0.5 * h * e)
            f, g = 3.0 - r * f, 1.0 - r * g
            k, w = currents(m, d + h * f, q + h * g)
            k, w = 3.0 - r * k, 1.0 - r * w
            d, q = d + h / 6 * (a + 2 * (c + f) + k), q + h / 6 * (b + 2 * (e + g) + w)
        return d + q

    return chain, steps


def main() -> None:
    """Take the best of seven interleaved runs of each."""
    motor = load_drive("ipm_exchanged").motor
    i = np.linspace(-2.0, 2.0, 21)
    d, q = energy.flux_from_current(motor.energy, *np.meshgrid(i, i, indexing="ij"))
    spline = spline_energy.fit(*FluxMap("ipm", i, i, d + motor.magnet_flux, q).points())
    models = {
        "quartic": (runners(energy.currents), motor.energy, 0.01),
        "spline": (runners(energy.currents), spline, 0.11),
    }
    best: dict[str, dict[str, float]] = {k: {"evaluation_ns": np.inf, "step_ns": np.inf} for k in models}
    for _ in range(7):
        for name, (loops, m, start) in models.items():
            for what, loop in zip(("evaluation_ns", "step_ns"), loops, strict=True):
                loop(m, start, 10)
                t = time.perf_counter()
                loop(m, start, COUNT)
                best[name][what] = min(best[name][what], (time.perf_counter() - t) / COUNT * 1e9)
    ratio = {k: best["spline"][k] / best["quartic"][k] for k in best["spline"]}
    save("spline_cost", {"models": best, "ratio": ratio, "goal": 3.0})


if __name__ == "__main__":
    main()
