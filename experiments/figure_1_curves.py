"""Figure 1: flux-current magnetisation curves of the IPM, exact and by the paper's first-order
formulas."""

from __future__ import annotations

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from model import first_order
from model.drive_files import load_drive
from model.energy import flux_from_current


def main(name: str = "ipm") -> None:
    """Draw phi_d(i_d, i_q constant) and phi_q(i_d constant, i_q)."""
    m = load_drive(name).motor.energy
    i, held = np.linspace(-2.0, 2.0, 81), (-2.0, -1.0, 0.0, 1.0, 2.0)
    figure, axes = new_figure(1, 2)
    numbers: dict[str, object] = {"motor": name, "current": i}
    for axis, kind, other in zip(axes[0], "dq", "qd", strict=True):
        for k, c in enumerate(held):
            pair = (i, c) if kind == "d" else (c, i)
            flux = flux_from_current(m, *pair)["dq".index(kind)]
            first = first_order.fluxes(m, *np.broadcast_arrays(*pair))["dq".index(kind)]
            colour = COLOURS["model"] if c == 0 else COLOURS["data" if c > 0 else "other"]
            style = {0: "-", 1: "--", 2: ":"}[round(abs(c))]
            axis.plot(i, flux, style, color=colour, linewidth=1.3, label=f"i_{other} = {c:g} A")
            if c == 0.0:
                axis.plot(
                    i,
                    first,
                    color=COLOURS["first"],
                    linewidth=1.0,
                    label=f"first order, i_{other} = 0",
                )
            numbers[f"phi_{kind}_at_i_{other}_{c:g}"] = flux
            numbers[f"first_order_error_{kind}_{k}"] = float(np.max(np.abs(first - flux)))
        axis.set(
            xlabel=f"i_{kind} (A)", ylabel=f"phi_{kind} (Wb)", title=f"phi_{kind}, i_{other} held"
        )
        axis.legend(fontsize=8)
    figure.suptitle(f"Fig. 1  magnetisation curves ({name})")
    save("figure_1_curves", numbers, figure)


if __name__ == "__main__":
    main()
