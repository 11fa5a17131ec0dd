"""Do the 95 % intervals of the exact fit hold?  400 simulated tests a motor, sensors with noise and
resolution.

Full chain each time: recordings, steady stretches, demodulation, joint fit.
"""

from __future__ import annotations

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from model.drive_files import load_drive
from model.levels import NAMES
from sandbox.recordings.identify import identify
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign

REPETITIONS, LEVELS, DWELL = 400, 7, 120


def study(name: str, repetitions: int = REPETITIONS) -> np.ndarray:
    """Return (repetitions, 8) normalised errors (estimate - truth) / sd."""
    drive = load_drive(name)
    top = 1.6 * drive.motor.rated_current
    z = []
    for k in range(repetitions):
        c = drive.converter
        bench = LockedBench(
            theta=0.4, noise=c.current_noise, resolution=c.current_resolution, seed=3 * k
        )
        fit = identify(paper_campaign(drive, np.linspace(-top, top, LEVELS), DWELL, bench)).fits[
            "exact"
        ]
        z.append([(fit.values[n] - getattr(drive.motor, n)) / fit.sd[n] for n in NAMES])
    return np.array(z)


def main() -> None:
    """Run the study and draw coverage with its own 95 % intervals."""
    figure, axes = new_figure(1, 3, 4.2)
    numbers = {}
    for axis, name in zip(axes[0], ("ipm", "ipm_exchanged", "spm_exchanged"), strict=True):
        z = study(name)
        share = np.mean(np.abs(z) < 1.959964, axis=0)
        spread = 1.96 * np.sqrt(0.95 * 0.05 / len(z))
        axis.axhspan(93, 97, color="0.93", zorder=0)
        axis.errorbar(
            range(8), 100 * share, 100 * spread, fmt="o", color=COLOURS["model"], capsize=3
        )
        axis.set(title=name, ylim=(90, 100), ylabel="intervals that hold the truth (%)")
        axis.set_xticks(
            range(8),
            [n.replace("inductance", "L").replace("resistance", "R") for n in NAMES],
            rotation=60,
        )
        numbers[name] = {
            "repetitions": len(z),
            "coverage": dict(zip(NAMES, share, strict=True)),
            "all_parameters": float(np.mean(share)),
            "mean_z": dict(zip(NAMES, z.mean(axis=0), strict=True)),
        }
    save(
        "interval_coverage",
        {"motors": numbers, "levels": LEVELS, "periods_per_level": DWELL},
        figure,
    )


if __name__ == "__main__":
    main()
