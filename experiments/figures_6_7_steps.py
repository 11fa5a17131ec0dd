"""Figures 6 and 7: large steps of u_d, saturated against linear (IPM), and the flux by integrating
u - R i.

"Measured" is the true motor's simulation with 2 mA noise, sampled at 4 kHz; the models are the
exact fit to the paper's test and that fit without its alphas.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from model.drive_files import load_drive
from model.energy import flux_from_current
from model.parameters import Drive
from sandbox.recordings.identify import identify
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign, staircase

LEVELS = np.array([-1.9, 1.9, -1.0, 1.0, -1.9])
DWELL = 40  # injection periods of 2 ms, so 80 ms a step


def step_test(drive: Drive, bench: LockedBench | None = None):
    """Return t (s), u_d (V), i_d (A) of steps between LEVELS at locked rotor, no injection."""
    r = staircase(drive, "steps", "none", np.column_stack([LEVELS, 0 * LEVELS]), DWELL, bench)
    return r.t, r.u_alpha, r.current[0]


def main(name: str = "ipm") -> None:
    """Draw both figures."""
    drive = load_drive(name)
    fit = identify(paper_campaign(drive, bench=LockedBench(noise=0.002, resolution=0.0024))).fits[
        "exact"
    ]
    found = dataclasses.replace(drive, motor=dataclasses.replace(drive.motor, **fit.values))
    alphas = {n: 0.0 for n in fit.values if n.startswith("alpha")}
    linear = dataclasses.replace(drive, motor=dataclasses.replace(found.motor, **alphas))
    t, u, i = step_test(drive, LockedBench(noise=0.002, resolution=0.0024, seed=8))
    predicted = {"saturated": step_test(found)[2], "linear": step_test(linear)[2]}
    figure, axes = new_figure(2, 1, 8.0, 2.8)
    axis, rest = axes[:, 0]
    for kind, colour in (("saturated", "model"), ("linear", "linear")):
        rest.plot(1e3 * t, predicted[kind] - i, color=COLOURS[colour], linewidth=0.9)
    rest.set(xlabel="t (ms)", ylabel="model less data (A)", xlim=(75, 200))
    axis.set_xlim(75, 200)
    axis.plot(1e3 * t, i, ".", ms=2.5, color=COLOURS["data"], label="data")
    axis.plot(
        1e3 * t, predicted["saturated"], color=COLOURS["model"], label="identified, saturated"
    )
    axis.plot(
        1e3 * t, predicted["linear"], "--", color=COLOURS["linear"], label="saturation left out"
    )
    axis.set(ylabel="i_d (A)", title=f"Fig. 6  large steps of u_d ({name})")
    axis.legend(fontsize=8)
    rms = {k: float(np.sqrt(np.mean((x - i) ** 2))) for k, x in predicted.items()}
    save("figure_6_step", {"motor": name, "rms_error": rms, "noise": 0.002}, figure)
    h, start = t[1], flux_from_current(found.motor.energy, LEVELS[0], 0.0)[0]
    middle = 0.5 * (i[1:] + i[:-1])
    flux = start + h * np.concatenate(
        [[0.0], np.cumsum(u[:-1] - fit.values["resistance"] * middle)]
    )
    grid = np.linspace(-1.9, 1.9, 77)
    model = flux_from_current(found.motor.energy, grid, 0.0)[0]
    figure, axes = new_figure(1, 1, 6.0, 4.2)
    axis = axes[0, 0]
    axis.plot(i, flux, ".", ms=2.5, color=COLOURS["data"], label="integral of u - R i")
    axis.plot(grid, model, color=COLOURS["model"], label="identified")
    axis.plot(
        grid,
        fit.values["inductance_d"] * grid,
        "--",
        color=COLOURS["linear"],
        label="saturation left out",
    )
    axis.set(xlabel="i_d (A)", ylabel="phi_d (Wb)", title=f"Fig. 7  saturation curve ({name})")
    axis.legend(fontsize=8)
    error = float(np.sqrt(np.mean((flux - np.interp(i, grid, model)) ** 2)))
    save("figure_7_flux", {"motor": name, "rms_error": error, "span": float(np.ptp(model))}, figure)


if __name__ == "__main__":
    main()
