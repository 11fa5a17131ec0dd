"""AC resistance of THOR's winding (SyR-e) against the skin effect's first-order form.

python experiments/real_skin_effect.py
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from real_results import BLUE, GREY, ORANGE, keep

from experiments.real_drives import thor
from model.datasets import fetch

LIMITS = (
    "A table computed from a formula (the fit leaves 1e-7), no measurement: the intervals say so "
    "and no more. Up to 1500 Hz only the product R_1 tau² matters; R_1 alone rests on a bend of "
    "0.3 % and is far outside what it was made for. Its inductance R_1 tau must be taken out of "
    "L_d and L_q, else it counts twice. No word on temperature of R."
)


def main() -> None:
    """Fit, draw, print, keep."""
    machine = thor.read(fetch("thor_fea") / "thor_fea.npz")
    shown = [int(np.argmin(np.abs(machine.temperature - t))) for t in (20.0, 70.0, 120.0)]
    f = machine.frequency
    fits = {k: thor.skin_effect(f, machine.factor[k], machine.resistance) for k in shown}
    below = f <= 1000.0
    part = thor.skin_effect(f[below], machine.factor[shown[0]][below], machine.resistance)
    missed = float(np.abs(part.factor(f[~below]) - machine.factor[shown[0]][~below]).max())
    values, checks = {}, {}
    for k, fit in fits.items():
        name = f"{machine.temperature[k]:.0f}_degC"
        values[f"{name}.resistance"], values[f"{name}.time_constant"] = (
            fit.resistance,
            fit.time_constant,
        )
        checks[f"{name}.R1_tau_H"] = float(f"{fit.resistance.value * fit.time_constant.value:.4g}")
        checks[f"{name}.R1_tau2_ohm_s2"] = float(
            f"{fit.resistance.value * fit.time_constant.value**2:.4g}"
        )
    checks["held_out_above_1000_Hz_largest_error_of_factor"] = float(f"{missed:.2g}")
    checks["dc_resistance_ohm"] = round(machine.resistance, 5)

    figure, axes = plt.subplots(figsize=(8, 4.8), layout="constrained")
    fine = np.linspace(0, 1500, 300)
    for colour, (k, fit) in zip((BLUE, ORANGE, GREY), fits.items(), strict=True):
        square = 1e9 * fit.resistance.value * fit.time_constant.value**2
        axes.plot(
            f,
            machine.factor[k],
            "o",
            ms=5,
            color=colour,
            label=f"table, {machine.temperature[k]:.0f} °C",
        )
        axes.plot(fine, fit.factor(fine), color=colour, label=f"fit: R$_1$τ² = {square:.2f} nΩ s²")
    axes.axvspan(1000, 1550, color="0.93")
    axes.text(
        1020, 1.03, f"held out for 20 °C: largest\nerror of the factor {missed:.0e}", fontsize=9
    )
    axes.set(
        xlabel="frequency (Hz)", ylabel="AC over DC resistance", xlim=(0, 1550), ylim=(0.95, 2.2)
    )
    axes.set_title("[R + R$_1$ (ωτ)² / (1 + (ωτ)²)] / R: in this range only R$_1$τ² matters")
    axes.legend(loc="upper left")
    keep(figure, "real_skin_effect", "thor_fea", values, checks, LIMITS)


if __name__ == "__main__":
    main()
