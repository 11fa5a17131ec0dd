"""Dead time and device drop on four real drives: a voltage along the current, seen in v_q only
without d-current.

python experiments/real_dead_time.py
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from real_results import BLUE, GREY, ORANGE, keep

from experiments.real_drives import moteus
from model.datasets import fetch

LIMITS = (
    "No i_q, DC link or PWM frequency on file: the voltage is measured, a dead time follows only "
    "if 24 V and 30 kHz (the drive's default) hold, and at the small no-load current it is a "
    "lower bound (the sign of a current inside its ripple is soft). R, and device drop against "
    "dead time, cannot be told. hoverboard is too noisy to decide."
)


def main() -> None:
    """Fit, draw, print, keep."""
    figure, panels = plt.subplots(2, 2, figsize=(9.5, 7.2), layout="constrained")
    values, checks = {}, {}
    files = sorted(fetch("moteus_ld").glob("ld_*.json"))
    for axes, path in zip(panels.flat, files, strict=True):
        sweep = moteus.read(path)
        lines = moteus.intercepts(sweep)
        drop = moteus.inverter_drop(lines)
        values[f"{sweep.name}.voltage"] = drop.voltage
        values[f"{sweep.name}.offset"] = drop.offset
        checks[sweep.name] = {
            "held_out_rms_V": round(drop.held_out_with, 4),
            "held_out_rms_without_effect_V": round(drop.held_out_without, 4),
            "current_q_below_A": round(drop.current_q_below, 2),
            "dead_time_s_if_24V_30kHz": float(
                f"{moteus.dead_time(drop.voltage.value, 24.0, 30e3):.3g}"
            ),
            "resistance_on_file_ohm": sweep.resistance,
            "flux_at_zero_current_Wb": float(f"{lines.slope[0]:.4g}"),
            "flux_fitted_by_the_drive_Wb": sweep.own_flux,
        }
        i_d = np.linspace(1.05 * lines.i_d.min(), 0.0, 600)
        axes.axhline(0.0, color=GREY, lw=0.8)
        axes.errorbar(
            lines.i_d,
            lines.intercept,
            1.96 * lines.error,
            fmt="o",
            color=BLUE,
            capsize=3,
            label="intercept, 95 %",
        )
        clear = drop.voltage.low > 0.0
        axes.plot(
            i_d,
            drop.model(i_d),
            color=ORANGE,
            ls="-" if clear else ":",
            label="V i$_q$/|i| + offset",
        )
        verdict = (
            f"V = {drop.voltage.value:.2f} [{drop.voltage.low:.2f}, {drop.voltage.high:.2f}] V"
        )
        axes.set_title(f"{sweep.name}: {verdict}" + ("" if clear else ", undecided"))
        if not clear:
            axes.set_ylim(bottom=-0.45)
        axes.text(
            0.03,
            0.97 if clear else 0.04,
            f"level left out: {1e3 * drop.held_out_with:.0f} mV rms,\n"
            f"without the effect {1e3 * drop.held_out_without:.0f} mV",
            transform=axes.transAxes,
            va="top" if clear else "bottom",
            fontsize=9,
        )
    panels[0, 0].legend(loc="center left")
    for axes in panels[1]:
        axes.set_xlabel("d-current (A)")
    for axes in panels[:, 0]:
        axes.set_ylabel("intercept of v$_q$ − R i$_q$ over speed (V)")
    figure.suptitle(
        "Inverter drop on moteus drives: in v$_q$ without d-current, turned into v$_d$ with it"
    )
    keep(figure, "real_dead_time", "moteus_ld", values, checks, LIMITS)


if __name__ == "__main__":
    main()
