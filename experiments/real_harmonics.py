"""6k harmonics of THOR's flux by angle: magnet flux, one-gamma inductance harmonic, and the torque
they imply.

python experiments/real_harmonics.py
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from real_results import BLUE, GREY, ORANGE, keep

from experiments.real_drives import thor
from model.datasets import fetch

LIMITS = (
    "Finite elements, no measurement; 90 angles, so orders up to 42. Orders 12 and 18 are as "
    "large as 6 without current, and with it far larger in torque: order 6 alone is a small part "
    "of the ripple. gamma_6 explains little of the change with current and depends on the range "
    "fitted: for this motor the one-parameter form is a size, no model."
)


def main() -> None:
    """Fit, draw, print, keep."""
    machine = thor.read(fetch("thor_fea") / "thor_fea.npz")
    psi_d, psi_q = thor.flux_harmonics(machine)
    half = 0.5 * thor.RATED_CURRENT
    gamma, explained, seen, fitted = thor.inductance_harmonic(machine, half)
    gamma_rated, explained_rated, _, _ = thor.inductance_harmonic(machine, thor.RATED_CURRENT)
    built, table = thor.harmonic_torque(machine)
    inside = np.hypot(*np.meshgrid(machine.i_d, machine.i_q, indexing="ij")) <= thor.RATED_CURRENT
    share = 1.0 - np.sum(np.abs(built - table)[inside] ** 2) / np.sum(np.abs(table[inside]) ** 2)
    a, b = int(np.argmin(np.abs(machine.i_d))), int(np.argmin(np.abs(machine.i_q)))
    magnet = float(machine.psi_d[a, b].mean())
    values = {
        "psi_d6": psi_d,
        "psi_q6": psi_q,
        "gamma_6": gamma,
        "gamma_6_to_rated_current": gamma_rated,
    }
    checks = {
        "magnet_flux_Wb": round(magnet, 5),
        "gamma_6_explained_share": round(explained, 3),
        "gamma_6_explained_share_to_rated_current": round(explained_rated, 3),
        "torque_order_6_from_fluxes_explained_share": round(float(share), 4),
        "psi_d_orders_12_18_Wb": [
            float(f"{thor.flux_harmonics(machine, k)[0].value:.3g}") for k in (12, 18)
        ],
        "psi_q_orders_12_18_Wb": [
            float(f"{thor.flux_harmonics(machine, k)[1].value:.3g}") for k in (12, 18)
        ],
    }

    figure, panels = plt.subplots(1, 3, figsize=(14, 4.6), layout="constrained")
    theta = np.rad2deg(machine.theta)
    for table_, fit, offset, colour, name in (
        (
            machine.psi_d[a, b] - magnet,
            psi_d.value * np.cos(6 * machine.theta),
            0.0,
            BLUE,
            "ψ$_d$ − mean",
        ),
        (
            machine.psi_q[a, b],
            psi_q.value * np.sin(6 * machine.theta),
            -2.6,
            ORANGE,
            "ψ$_q$ (shifted by −2.6)",
        ),
    ):
        panels[0].plot(theta, 1e3 * table_ + offset, ".-", ms=4, lw=0.7, color=colour, label=name)
        panels[0].plot(
            theta, 1e3 * fit + offset, color="k", lw=1.5, label="order 6" if offset else None
        )
    panels[0].set(
        xlabel="rotor angle (° electrical)",
        ylabel="flux without current (mWb)",
        xlim=(-90, 30),
        ylim=(-4.2, 2.6),
    )
    panels[0].set_title(
        f"ψ$_{{d6}}$ = {1e3 * psi_d.value:.2f}, ψ$_{{q6}}$ = {1e3 * psi_q.value:.2f} mWb"
    )
    panels[0].legend(loc="upper left", ncols=2)
    panels[1].plot(1e3 * fitted, 1e3 * seen, ".", color=BLUE)
    ends = 1e3 * np.array([fitted.min(), fitted.max()])
    panels[1].plot(ends, ends, color=ORANGE)
    panels[1].set(
        xlabel="change of ψ's order 6 by γ$_6$, to half rated current (mWb)",
        ylabel="in the tables (mWb)",
    )
    panels[1].set_title(f"γ$_6$ = {gamma.text()} explains {100 * explained:.0f} %")
    for part, colour, name in ((np.real, BLUE, "cos 6θ"), (np.imag, GREY, "sin 6θ")):
        panels[2].plot(part(table[inside]), part(built[inside]), ".", color=colour, label=name)
    span = np.abs(table[inside]).max()
    panels[2].plot([-span, span], [-span, span], color=ORANGE, label="equal")
    panels[2].set(
        xlabel="order-6 torque in the tables (N m)", ylabel="from the fluxes' harmonics (N m)"
    )
    panels[2].set_title(f"Fluxes predict {100 * share:.0f} % of the torque's order 6")
    panels[2].legend(loc="upper left")
    keep(figure, "real_harmonics", "thor_fea", values, checks, LIMITS)


if __name__ == "__main__":
    main()
