"""Cogging of a real motor from a slow scan, up and down; held out: the way down, and the speed's
ripple while rolling.

python experiments/real_cogging.py
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from real_results import BLUE, GREY, ORANGE, keep

from experiments.real_drives import laas
from experiments.real_drives.fitted import Fitted
from model.datasets import fetch

LIMITS = (
    "Amplitudes are currents × a torque constant that is not measured (1.5 × back-EMF, peak "
    "values assumed). Orders 12, 24, 36, 72 are electrical 1, 2, 3, 6: faults of the current "
    "sensors look the same in i_q; order 18 (slots) is torque for certain. Phases refer to the "
    "encoder's arbitrary zero. One motor, one turn each way."
)


def main() -> None:
    """Fit, draw, print, keep."""
    folder = fetch("laas_bldc")
    friction = laas.friction(laas.read(folder / "acceleration.txt"))
    constant = friction.torque_constant.value
    up, down = laas.scan_halves(laas.read(folder / "quasi_static_scan.txt"))
    (there, error), (back, error_back) = laas.cogging(up), laas.cogging(down)
    predicted = -there[0] + laas.harmonics(down.position) @ there[1:]
    share = 1.0 - np.mean((down.current - predicted) ** 2) / np.mean((down.current - back[0]) ** 2)
    sizes, sizes_back = laas.amplitudes(there), laas.amplitudes(back)
    noise = 2.07 * np.hypot(error[1::2], error[2::2])  # Student, 23 degrees of freedom
    values = {"torque_constant": friction.torque_constant}
    for order, a, b, half in zip(laas.ORDERS, sizes, sizes_back, noise, strict=True):
        half = max(half, abs(a - b))
        mean = 0.5 * (a + b) * constant
        basis = "jackknife over sectors, and up against down"
        values[f"order_{order}"] = Fitted(
            mean, mean - half * constant, mean + half * constant, "N m", basis
        )
    hold = 0.5 * constant * (there[0] - back[0])
    spread = 2.07 * constant * np.hypot(error[0], error_back[0])
    values["hold_friction"] = Fitted(
        hold, hold - spread, hold + spread, "N m", "jackknife over sectors"
    )
    rolling = [
        friction.inertia.value * laas.speed_ripple(laas.read(folder / f"rolling_data{n}.txt"), 18)
        for n in ("", 1, 2)
    ]
    checks = {
        "down_predicted_from_up_share": round(float(share), 3),
        "order_18_from_rolling_Nm": [float(f"{x:.3g}") for x in rolling],
    }

    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11, 4.6), layout="constrained", width_ratios=(1.5, 1)
    )
    scale = 1e3 * constant
    window = [(run, (run.position > 0) & (run.position < 2 * np.pi / 6)) for run in (up, down)]
    for (run, inside), colour, name in zip(
        window, (BLUE, GREY), ("up, fitted", "down, held out"), strict=True
    ):
        left.plot(
            np.rad2deg(run.position[inside]),
            scale * run.current[inside],
            ".",
            ms=2.5,
            color=colour,
            label=name,
        )
    angle = np.linspace(0.0, 2 * np.pi / 6, 800)
    wave = laas.harmonics(angle) @ there[1:]
    left.plot(np.rad2deg(angle), scale * (there[0] + wave), color=ORANGE, label="fit to up")
    left.plot(
        np.rad2deg(angle),
        scale * (wave - there[0]),
        color=ORANGE,
        ls="--",
        label="prediction of down",
    )
    left.set(
        xlabel="angle (° mechanical; a sixth of the turn)",
        ylabel="holding torque (mN m)",
        xlim=(0, 60),
    )
    left.set_title(f"Fit to the way up explains {100 * share:.0f} % of the way down")
    left.set_ylim(top=1.35 * scale * up.current.max())
    left.legend(loc="upper left", ncols=2, markerscale=5)
    place = np.arange(len(laas.ORDERS))
    bars = [values[f"order_{k}"] for k in laas.ORDERS]
    half = [1e3 * (b.high - b.value) for b in bars]
    colours = [ORANGE if k % laas.POLE_PAIRS else BLUE for k in laas.ORDERS]
    right.bar(place, [1e3 * b.value for b in bars], yerr=half, color=colours, capsize=3)
    right.plot(
        np.full(3, laas.ORDERS.index(18)),
        [1e3 * x for x in rolling],
        "kx",
        label="order 18 from speed ripple",
    )
    right.bar(0, 0, color=ORANGE, label="cogging for certain (slot orders)")
    right.bar(0, 0, color=BLUE, label="cogging or current sensors")
    right.set_xticks(place, [str(k) for k in laas.ORDERS])
    right.set(
        xlabel="order per mechanical turn", ylabel="amplitude (mN m)", yscale="log", ylim=(0.05, 12)
    )
    right.set_title("Order 72 = LCM(18 slots, 24 poles) leads")
    right.legend(loc="upper left")
    right.grid(axis="x", visible=False)
    keep(figure, "real_cogging", "laas_bldc", values, checks, LIMITS)


if __name__ == "__main__":
    main()
