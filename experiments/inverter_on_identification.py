"""What the inverter's voltage error at standstill costs: bias of both methods, and width of the
exact fit's intervals.

Staircases of the paper on a rotor at 0.7 rad; every leg loses `threshold` volts against its current
(2 V is 1.25 us of dead time at 400 V and 4 kHz), sign taken linearly through zero within 1.5 % of
rated current.
"""

from __future__ import annotations

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from model.drive_files import load_drive
from model.levels import NAMES
from sandbox.recordings.identify import identify
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign

THRESHOLDS = (0.0, 1.0, 2.0, 4.0)


def main(name: str = "ipm_exchanged") -> None:
    """Tabulate and draw the worst relative bias of R, L_d, L_q and of the alphas."""
    drive, rows = load_drive(name), []
    for volts in THRESHOLDS:
        bench = LockedBench(
            theta=0.7,
            threshold=volts,
            width=0.015 * drive.motor.rated_current,
            noise=0.002,
            resolution=0.0024,
        )
        found = identify(paper_campaign(drive, bench=bench))
        row: dict[str, object] = {"threshold": volts}
        for method, fit in found.fits.items():
            row[method] = {n: fit.values[n] / getattr(drive.motor, n) - 1 for n in NAMES}
        exact = found.fits["exact"]
        row["exact_sd"] = {n: exact.sd[n] / abs(exact.values[n]) for n in NAMES}
        row["found_threshold"] = exact.nuisance["voltage_threshold"]
        rows.append(row)
    figure, axes = new_figure(1, 2, 5.0, 3.6)
    for axis, names, title in zip(
        axes[0], (NAMES[:3], NAMES[3:]), ("R, L_d, L_q", "alphas"), strict=True
    ):
        for method, colour in (("first_order", "first"), ("exact", "model")):
            worst = [max(abs(r[method][n]) for n in names) for r in rows]  # type: ignore[index]
            axis.plot(THRESHOLDS, 100 * np.array(worst), "o-", color=COLOURS[colour], label=method)
        axis.set(
            title=title,
            yscale="log",
            xlabel="voltage lost by each leg (V)",
            ylabel="worst relative error (%)",
        )
        axis.legend(fontsize=8)
    save("inverter_on_identification", {"motor": name, "rows": rows}, figure)


if __name__ == "__main__":
    main()
