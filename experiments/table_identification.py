"""The paper's parameter table: print, its uncertainty predicted from +-10 mA, and the bias of its
method on exact data.

Predicted: independent 10 mA at every level's ripple peak through the whole split estimate
("independent"), and the share that comes through L_d and L_q alone ("through L": a level's noise
averages out, an error of L does not).
"""

from __future__ import annotations

import numpy as np

from experiments.drawing import COLOURS, new_figure, save
from experiments.ripple_at_bias import formula_slopes
from model.drive_files import load_drive
from model.energy import Energy
from model.identification import first_order
from model.levels import NAMES, D, Levels, Q
from model.parameters import Drive
from sandbox.recordings.identify import identify
from sandbox.replay.identification.locked_test import paper_campaign, paper_levels

PRINT = {
    "ipm": (5e-3, 1e-3, 0.11, 0.61, 1.34, 2.80, 0.42),
    "spm": (10e-3, 2e-3, 0.11, 0.27, 0.28, 1.03, 0.17),
}


def formula_levels(drive: Drive) -> Levels:
    """Return the paper's test with slopes that obey its own formulas (so also for the impossible
    printed SPM)."""
    i, m = paper_levels(drive), drive.motor.energy
    zero, n = np.zeros_like(i), len(i)
    current = np.column_stack([np.concatenate([i, zero, zero]), np.concatenate([zero, i, i])])
    axis = np.repeat([D, D, Q], n)
    slope = np.empty((3 * n, 2))
    for a, name in ((D, "d"), (Q, "q")):
        slope[axis == a] = np.column_stack(formula_slopes(m, *current[axis == a].T, name))
    wave = np.zeros((3 * n, 8, 2))
    wave[np.arange(3 * n), :, axis] = drive.injection.amplitude * np.where(
        np.arange(8) < 4, 1.0, -1.0
    )
    sd = np.ones_like(slope)
    h, r = drive.converter.sampling_period, drive.motor.resistance
    return Levels(h, axis, r * current, current, slope, sd, sd, wave, np.zeros(3 * n))


def predicted(drive: Drive, current: float = 0.01) -> dict[str, np.ndarray]:
    """Return standard deviations (7,) of L_d, L_q and the alphas by the two readings of +-10 mA."""
    levels = formula_levels(drive)
    full = np.array([first_order(levels, current).sd[n] for n in NAMES[1:]])
    peak = np.max(np.abs(levels.flux))
    l_d, l_q = drive.motor.inductance_d, drive.motor.inductance_q
    # one dedicated run each, eq. (LdLq)
    d_ld, d_lq = l_d**2 * current / peak, l_q**2 * current / peak
    e = drive.motor.energy
    relative = np.array([d_ld / l_d, d_lq / l_q, 2 * d_ld / l_d, 2 * d_lq / l_q, 2 * d_lq / l_q])
    return {
        "independent": full,
        "through_L": np.concatenate([[d_ld, d_lq], np.abs(e[2:]) * relative]),
    }


def main() -> None:
    """Write the table and draw predicted over printed for both readings of the rows."""
    figure, axes = new_figure(1, 2, 5.5, 3.8)
    uncertainty, bias = {}, {}
    for axis, name in zip(axes[0], PRINT, strict=True):
        for shift, rows in ((-0.1, name), (0.1, f"{name}_exchanged")):
            p = predicted(load_drive(rows))
            stated = np.array(PRINT[name])
            if rows != name:
                stated = stated[[1, 0, 2, 3, 4, 5, 6]]
            uncertainty[rows] = {
                n: {"printed": stated[k], **{kind: v[k] for kind, v in p.items()}}
                for k, n in enumerate(NAMES[1:])
            }
            for kind, mark in (("through_L", "o"), ("independent", "_")):
                colour = COLOURS["data"] if rows == name else COLOURS["model"]
                axis.plot(
                    np.arange(7) + shift,
                    p[kind] / stated,
                    mark,
                    color=colour,
                    label=f"{rows}, {kind}",
                )
            score = float(np.exp(np.sqrt(np.mean(np.log(p["through_L"] / stated)[2:] ** 2))))
            uncertainty[rows]["typical_factor_alphas_through_L"] = score  # type: ignore[assignment]
        axis.axhspan(0.5, 2.0, color="0.92", zorder=0)
        axis.set(yscale="log", title=name.upper(), ylabel="predicted / printed uncertainty")
        axis.set_xticks(range(7), [n.replace("inductance", "L") for n in NAMES[1:]], rotation=45)
        axis.legend(fontsize=7)
    for name in ("ipm", "ipm_exchanged", "spm_exchanged"):
        motor = load_drive(name).motor
        fits = identify(paper_campaign(load_drive(name))).fits
        bias[name] = {
            n: {k: f.values[n] / getattr(motor, n) - 1 for k, f in fits.items()}
            | {"true": getattr(motor, n)}
            for n in NAMES
        }
        assert isinstance(fits["exact"].energy, Energy)
    save("table_identification", {"uncertainty": uncertainty, "relative_bias": bias}, figure)


if __name__ == "__main__":
    main()
