"""Iron loss of THOR (finite elements) against the effect's constant core resistance, over flux and
frequency.

python experiments/real_iron_loss.py
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from real_results import BLUE, GREY, ORANGE, keep

from experiments.real_drives import thor
from model.datasets import fetch

LIMITS = (
    "Finite elements with sinusoidal currents: no PWM loss, no measurement; frequency enters by "
    "SyR-e's own rule. Loss grows less than (frequency × flux)², so R_c grows about as the root "
    "of frequency: one constant fits one frequency. Where the flux is small (strong negative "
    "d-current) the loss stays and R_c falls far below. No time constant: a loss table under "
    "sinusoidal current holds none."
)


def main() -> None:
    """Fit, draw, print, keep."""
    machine = thor.read(fetch("thor_fea") / "thor_fea.npz")
    rated = thor.core_resistance(machine, thor.RATED_FREQUENCY)
    outside = (np.abs(machine.loss_i) > thor.RATED_CURRENT) & (
        np.abs(machine.loss_i) <= 2 * thor.RATED_CURRENT
    )
    inside = np.abs(machine.loss_i) <= thor.RATED_CURRENT
    omega = 2 * np.pi * thor.RATED_FREQUENCY
    loss = machine.iron_loss(thor.RATED_FREQUENCY)
    model = 1.5 * (omega * np.abs(machine.loss_psi)) ** 2 / rated.value
    error = float(np.sqrt(np.mean((model - loss)[outside] ** 2)) / np.mean(loss[outside]))
    frequency = np.linspace(10.0, 200.0, 60)
    curve = np.array([thor.core_resistance(machine, f).value for f in frequency])
    power = float(np.polyfit(np.log(frequency), np.log(curve), 1)[0])
    values = {"core_resistance": rated}
    checks = {
        "held_out_currents_rms_error_of_mean_loss": round(error, 3),
        "held_out_at_half_rated_frequency_ohm": round(
            thor.core_resistance(machine, 0.5 * thor.RATED_FREQUENCY).value, 1
        ),
        "held_out_at_twice_rated_frequency_ohm": round(
            thor.core_resistance(machine, 2 * thor.RATED_FREQUENCY).value, 1
        ),
        "exponent_of_frequency": round(power, 2),
    }

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    flux = np.abs(machine.loss_psi)
    left.plot(
        flux[outside],
        loss[outside],
        ".",
        ms=3,
        color=GREY,
        label="rated to twice rated current, held out",
    )
    left.plot(
        flux[inside], loss[inside], ".", ms=4, color=BLUE, label="up to rated current, fitted"
    )
    line = np.linspace(0, flux[outside].max(), 100)
    left.plot(
        line, 1.5 * (omega * line) ** 2 / rated.value, color=ORANGE, label="1.5 (ω|ψ|)² / R$_c$"
    )
    left.set(xlabel="flux |ψ| (Wb peak)", ylabel=f"iron loss at {thor.RATED_FREQUENCY:.0f} Hz (W)")
    left.set_ylim(0, 1.3 * loss[outside].max())
    left.set_title(
        f"R$_c$ = {rated.value:.0f} Ω; 95 % of the points need {rated.low:.0f} to "
        f"{rated.high:.0f} Ω"
    )
    left.legend(loc="upper left")
    right.plot(
        frequency, curve, color=BLUE, label=f"fitted at each frequency: about f$^{{{power:.2f}}}$"
    )
    right.axhline(rated.value, color=ORANGE, label="the effect: constant")
    right.plot(
        thor.RATED_FREQUENCY, rated.value, "o", color=ORANGE, label="fitted here (rated frequency)"
    )
    right.set(xlabel="electrical frequency (Hz)", ylabel="core resistance (Ω)", ylim=(0, None))
    right.set_title("A constant R$_c$ holds near one frequency only")
    right.legend(loc="lower right")
    keep(figure, "real_iron_loss", "thor_fea", values, checks, LIMITS)


if __name__ == "__main__":
    main()
