"""Inertia, Coulomb and viscous friction of a real motor from a 2 Hz current sine; held out: steady
rolling.

python experiments/real_friction.py
"""

from __future__ import annotations

from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
from real_results import BLUE, GREY, ORANGE, keep

from experiments.real_drives import laas
from model.datasets import fetch

LIMITS = (
    "The torque constant is 1.5 × back-EMF (peak values assumed), not measured; all torques scale "
    "with it. Below 30 rad/s cogging hides the shape of Coulomb friction (speeds left out, the "
    "tanh's width is chosen, not fitted); a delay of the current shifts inertia into viscous "
    "friction: B is known to a factor of two or three only."
)


def main() -> None:
    """Fit, draw, print, keep."""
    folder = fetch("laas_bldc")
    found = laas.friction(laas.read(folder / "acceleration.txt"))
    steady = [laas.read(folder / f"rolling_data{n}.txt") for n in ("", 1, 2)]
    seen = [(float(r.speed.mean()), float(r.current.mean())) for r in steady]
    values = {
        name: getattr(found, name) for name in ("torque_constant", "inertia", "coulomb", "viscous")
    }
    checks = {
        "steady_current_measured_A": [round(i, 4) for _, i in seen],
        "steady_current_predicted_A": {
            "value": round(found.steady[0], 4),
            "range": [round(x, 4) for x in found.steady[1:]],
        },
    }

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    constant = 1e3 * found.torque_constant.value
    part = slice(0, 1500)
    time = 1e-3 * np.arange(1500)
    left.plot(time, constant * found.current[part], color=BLUE, label="K i$_q$, measured")
    left.plot(time, constant * found.inertial[part], color=GREY, lw=1, label="J dω/dt")
    model = found.inertial + found.current_at(found.speed)
    left.plot(time, constant * model[part], color=ORANGE, ls="--", label="J dω/dt + friction")
    left.set(xlabel="time (s)", ylabel="torque (mN m)", ylim=(-13, 18))
    left.set_title(
        f"J = {1e6 * found.inertia.value:.2f} [{1e6 * found.inertia.low:.2f}, "
        f"{1e6 * found.inertia.high:.2f}] "
        "× 10$^{-6}$ kg m$^2$"
    )
    left.legend(loc="upper center", ncols=3)
    rest = constant * (found.current - found.inertial)
    edges = np.linspace(-155, 155, 32)
    middle = 0.5 * (edges[1:] + edges[:-1])
    cells = [rest[(found.speed >= a) & (found.speed < b)] for a, b in pairwise(edges)]
    low, mid, high = (np.array([np.quantile(c, q) for c in cells]) for q in (0.1, 0.5, 0.9))
    right.errorbar(
        middle,
        mid,
        (mid - low, high - mid),
        fmt="o",
        ms=4,
        color=BLUE,
        label="K i$_q$ − J dω/dt, 10–90 %",
    )
    speed = np.linspace(-155, 155, 800)
    right.plot(
        speed,
        constant * found.current_at(speed),
        color=ORANGE,
        label="T$_c$ tanh(ω / 2 rad/s) + B ω",
    )
    right.axvspan(-30, 30, color="0.93", label="cogging hides it, left out")
    right.plot(
        *np.array([(w, constant * i) for w, i in seen]).T,
        "kx",
        ms=8,
        mew=2,
        label="steady rolling, held out",
    )
    right.set(xlabel="speed (rad/s mechanical)", ylabel="friction torque (mN m)", ylim=(-3.8, 4.9))
    coulomb, viscous = found.coulomb, found.viscous
    right.set_title(
        f"T$_c$ = {1e3 * coulomb.value:.2f} [{1e3 * coulomb.low:.2f}, "
        f"{1e3 * coulomb.high:.2f}] mN m,  "
        f"B = {1e6 * viscous.value:.1f} [{1e6 * viscous.low:.1f}, {1e6 * viscous.high:.1f}] µN m s"
    )
    right.legend(loc="upper left", ncols=2)
    keep(figure, "real_friction", "laas_bldc", values, checks, LIMITS)


if __name__ == "__main__":
    main()
