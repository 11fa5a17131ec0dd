"""Figure 2: i_d from rest under a square wave, 500 Hz, mean 23 V, amplitude 30 V (SPM), and eq.
(iprocd)."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from experiments.drawing import COLOURS, new_figure, save
from model.drive_files import load_drive
from model.energy import currents, flux_from_current, hessian

MEAN, AMPLITUDE, FREQUENCY, FINE = 23.0, 30.0, 500.0, 100


def response(name: str, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return t (s), i_d (A) and the triangle F with amplitude pi / 2, on a grid of FINE points a
    period."""
    motor = load_drive(name).motor
    h, half = 1 / (FREQUENCY * FINE), FINE // 2
    k, flux, i = np.arange(round(duration / h)), 0.0, []
    for n in range(len(k) // half):
        u, t = MEAN + AMPLITUDE * (1.0 if n % 2 == 0 else -1.0), h * np.arange(half + 1)
        rate = lambda _, x, u=u: u - motor.resistance * currents.py_func(motor.energy, x, 0.0)[0]  # noqa: E731
        d = solve_ivp(rate, (0.0, t[-1]), [flux], "DOP853", t, rtol=1e-10, atol=1e-12).y[0]
        i.append(currents.py_func(motor.energy, d[:-1], 0.0)[0])
        flux = d[-1]
    i = np.concatenate(i)
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
        column[1].plot(
            1e3 * t[zoom], line, "--", color=COLOURS["model"], label="mean + i~ F(Omega t)"
        )
        column[1].set(xlabel="t (ms)", ylabel="i_d (A)", ylim=(mean - 0.5, mean + 0.5))
        column[1].legend(fontsize=8, loc="lower right")
        numbers[name] = {
            "mean": mean,
            "ripple_formula": formula,
            "ripple_simulated": peak,
            "ratio": peak / formula,
        }
    figure.suptitle("Fig. 2  time response of i_d, square wave 30 V at 500 Hz on 23 V")
    save("figure_2_ripple", {"motors": numbers}, figure)


if __name__ == "__main__":
    main()
