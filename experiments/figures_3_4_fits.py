"""Figures 3 and 4: ripple against bias, (saturation1) and (saturation3q), both motors; why the
printed SPM cannot be.

Circles: ripple a bench would see, simulated through the exact model (+-10 mA, two standard
deviations, on its peak). Where the model as
printed stops being convex there is none.  Solid: the paper's formula with its parameters.
"""

from __future__ import annotations

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from experiments.ripple_at_bias import formula_slopes, ripple_scale, true_slopes
from model.drive_files import load_drive
from model.energy import boundary_on_ray
from model.errors import PhysicsError
from sandbox.replay.identification.locked_test import paper_levels

NOISE = 0.005  # A on the peak of the ripple
ROWS = ("ipm", "ipm_exchanged", "spm", "spm_exchanged")


def curve(name: str, bias: str) -> dict[str, object]:
    """Return currents, simulated and predicted ripple amplitudes (A, factor of F) for d
    injection."""
    drive = load_drive(name)
    i, rng = paper_levels(drive), np.random.default_rng(3)
    component = 0 if bias == "d" else 1
    measured = []
    for x in i:
        pair = (float(x), 0.0) if bias == "d" else (0.0, float(x))
        try:
            measured.append(true_slopes(drive, *pair, "d")[component])
        except PhysicsError:
            measured.append(np.nan)
    fine = np.linspace(i[0], i[-1], 321)
    zero = np.zeros_like(fine)
    formula = formula_slopes(
        drive.motor.energy, *((fine, zero) if bias == "d" else (zero, fine)), "d"
    )[component]
    scale = ripple_scale(drive)
    noise = NOISE / (np.pi / 2) * rng.normal(size=len(i))
    result = {
        "current": i,
        "ripple": scale * np.array(measured) + noise,
        "fine": fine,
        "formula": scale * formula,
    }
    if name == "spm" and bias == "d":
        result["convexity_ends_at"] = boundary_on_ray(drive.motor.energy, -8.0, 0.0)[0]
        negative = fine[np.asarray(formula) < 0]
        result["formula_negative_between"] = [float(negative.min()), float(negative.max())]
    return result


def main() -> None:
    """Draw both figures."""
    for number, bias, what in (
        (3, "d", "(saturation1)"),
        (4, "q", "(saturation3q), cross-saturation"),
    ):
        figure, axes = new_figure(2, 2)
        numbers = {}
        for axis, name in zip(axes.flat, ROWS, strict=True):
            c = curve(name, bias)
            axis.plot(c["fine"], c["formula"], color=COLOURS["first"], label="paper's formula")
            axis.plot(
                c["current"],
                c["ripple"],
                "o",
                mfc="none",
                color=COLOURS["data"],
                label="exact model, +-10 mA",
            )
            if "convexity_ends_at" in c:
                axis.axvspan(-8, c["convexity_ends_at"], color="0.9", zorder=0)
                low, high = c["formula_negative_between"]  # type: ignore[misc]
                axis.axvspan(low, high, ymax=0.25, color=COLOURS["first"], alpha=0.3, zorder=1)
                text = f"left of {c['convexity_ends_at']:.2f} A the energy is not convex:\n"
                text += "no such motor; formula < 0 (orange)"
                axis.annotate(
                    text, (-7.8, 0.97), xycoords=("data", "axes fraction"), va="top", fontsize=8
                )
            axis.set(
                title=name, xlabel=f"i_{bias} (A)", ylabel="i~_d (A)" if bias == "d" else "i~_q (A)"
            )
            axis.legend(fontsize=8, loc="lower right")
            numbers[name] = c
        figure.suptitle(f"Fig. {number}  ripple against bias, {what}")
        save(f"figure_{number}_fit", {"motors": numbers}, figure)


if __name__ == "__main__":
    main()
