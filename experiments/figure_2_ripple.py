"""Figure 2: i_d from rest under a square wave, 500 Hz, mean 23 V, amplitude 30 V (SPM), and eq. (iprocd)."""

from __future__ import annotations

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from model.energy import currents, flux_from_current, hessian
from model.parameters import load_drive
from sandbox.oldplant import Plant, advance

MEAN, AMPLITUDE, FREQUENCY, FINE = 23.0, 30.0, 500.0, 100


def response(name: str, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return t (s), i_d (A) and the triangle F with amplitude pi / 2, on a grid of FINE points a period."""
    motor = load_drive(name).motor
    h = 1 / (FREQUENCY * FINE)
    p = Plant(motor.energy, motor.magnet_flux, motor.resistance, float(motor.pole_pairs), 0.0, 0.0, h)
    k = np.arange(round(duration / h))
    f = np.where(k % FINE < FINE // 2, 1.0, -1.0)
    x, i = np.zeros(4), np.empty(len(k))
    for n in k:
        i[n] = currents(p.energy, x[0], x[1])[0]
        advance(x, p, MEAN + AMPLITUDE * f[n], 0.0, 0.0, 0.0, 1)
    tau = (k % FINE) / FINE
    return k * h, i, np.pi / 2 * np.where(tau < 0.5, 4 * tau - 1, 3 - 4 * tau)


def main() -> None:
    """Draw both readings of the SPM and give the steady ripple against the formula."""
    figure, axes = new_figure(2, 2, 5.0, 2.8)
    numbers = {}
    for column, name in zip(axes.T, ("spm", "spm_exchanged"), strict=True):
        motor = load_drive(name).motor
        t, i, triangle = response(name, 0.24)
        last = slice(-10 * FINE, None)
        mean = MEAN / motor.resistance
        d, q = flux_from_current(motor.energy, mean, 0.0)
        formula = AMPLITUDE * hessian(motor.energy, float(d), float(q))[0] / (2 * np.pi * FREQUENCY)
        peak = np.ptp(i[last]) / np.pi
        early, zoom = slice(0, 35 * FINE), slice(-3 * FINE, None)
        column[0].plot(1e3 * t[early], i[early], color=COLOURS["data"], linewidth=0.9)
        column[0].set(ylabel="i_d (A)", title=name)
        column[1].plot(1e3 * t[zoom], i[zoom], color=COLOURS["data"], label="simulated")
        line = mean + formula * triangle[zoom]
        column[1].plot(1e3 * t[zoom], line, "--", color=COLOURS["model"], label="mean + i~ F(Omega t)")
        column[1].set(xlabel="t (ms)", ylabel="i_d (A)", ylim=(mean - 0.5, mean + 0.5))
        column[1].legend(fontsize=8, loc="lower right")
        numbers[name] = {"mean": mean, "ripple_formula": formula, "ripple_simulated": peak, "ratio": peak / formula}
    figure.suptitle("Fig. 2  time response of i_d, square wave 30 V at 500 Hz on 23 V")
    save("figure_2_ripple", {"motors": numbers}, figure)


if __name__ == "__main__":
    main()
