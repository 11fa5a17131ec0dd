"""Figure 5: ripple at a current angle of 60 degrees, which no fit has seen: model against data.

Data: exact ripple of the true motor with +-10 mA (two standard deviations).  Model: the exact fit
to the paper's on-axis test (noise on),
and the paper's own formulas with its own estimates from the same test.
"""

from __future__ import annotations

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from experiments.ripple_at_bias import formula_slopes, ripple_scale, true_slopes
from model.drive_files import load_drive
from sandbox.recordings.identify import identify
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign


def main() -> None:
    """Identify on axis, predict at 60 degrees."""
    figure, axes = new_figure(2, 2)
    numbers = {}
    for row, (name, top, step) in zip(
        axes, (("ipm_exchanged", 2.0, 0.3), ("spm_exchanged", 5.5, 0.5)), strict=True
    ):
        drive, rng = load_drive(name), np.random.default_rng(5)
        fits = identify(
            paper_campaign(drive, bench=LockedBench(noise=0.002, resolution=0.0024))
        ).fits
        size = np.arange(0.0, top + 1e-9, step)
        d, q, scale = size * np.cos(np.pi / 3), size * np.sin(np.pi / 3), ripple_scale(drive)
        truth = (
            scale * np.array([true_slopes(drive, x, y, "d") for x, y in zip(d, q, strict=True)]).T
        )
        data = truth + 0.005 / (np.pi / 2) * rng.normal(size=truth.shape)
        found = _with(drive, fits["exact"].values)
        exact = (
            scale * np.array([true_slopes(found, x, y, "d") for x, y in zip(d, q, strict=True)]).T
        )
        first = scale * np.array(formula_slopes(fits["first_order"].energy, d, q, "d"))
        for k, axis in enumerate(row):
            axis.plot(size, data[k], "o", mfc="none", color=COLOURS["data"], label="data, +-10 mA")
            axis.plot(size, exact[k], color=COLOURS["model"], label="exact fit on axis, predicted")
            axis.plot(size, first[k], "--", color=COLOURS["first"], label="paper's fit and formula")
            axis.set(title=name, xlabel="|i| (A), 60 degrees", ylabel=f"i~_{'dq'[k]} (A)")
            axis.legend(fontsize=8)
        numbers[name] = {
            "current": size,
            "data": data,
            "exact_rms_error": float(np.sqrt(np.mean((exact - truth) ** 2))),
            "first_order_rms_error": float(np.sqrt(np.mean((first - truth) ** 2))),
        }
    figure.suptitle("Fig. 5  ripple at a 60 degree current angle, d injection")
    save("figure_5_angle", {"motors": numbers}, figure)


def _with(drive, values):
    import dataclasses

    return dataclasses.replace(drive, motor=dataclasses.replace(drive.motor, **values))


if __name__ == "__main__":
    main()
