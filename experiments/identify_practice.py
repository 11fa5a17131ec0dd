"""Does the exact fit find the true motor of every practice campaign, whatever effect was put into
the drive?

The identification sees the campaign folder alone; the truth files are opened here, afterwards.
"""

from __future__ import annotations

import tomllib

import numpy as np

from experiments.drawing import COLOURS, RESULTS, new_figure, save, shared
from model.levels import NAMES
from sandbox.recordings.identify import Identification, identify

TRUTH = dict(zip(NAMES, ("R", "Ld", "Lq", "a30", "a12", "a40", "a22", "a04"), strict=True))


def judge(found: Identification, truth: dict[str, float]) -> dict[str, object]:
    """Return relative errors, errors in standard deviations, and what the fit says of itself."""
    fit, nominal = found.fits["exact"], found.campaign.drive.motor
    wanted = {n: truth[TRUTH[n]] for n in NAMES}
    inside = [a <= wanted[n] <= b for n in NAMES for a, b in [fit.ci95(n)]]
    return {
        "error": {n: fit.values[n] / wanted[n] - 1 for n in NAMES},
        "nominal_error": {n: getattr(nominal, n) / wanted[n] - 1 for n in NAMES},
        "z": {n: (fit.values[n] - wanted[n]) / fit.sd[n] for n in NAMES},
        "sd": {n: fit.sd[n] / abs(wanted[n]) for n in NAMES},
        "intervals_that_hold": float(np.mean(inside)),
        "misfit": fit.misfit,
        "nuisance": fit.nuisance,
        "remarks": found.remarks,
    }


def table(campaigns: dict[str, dict]) -> str:
    """Return the markdown table: errors in percent, those beyond two standard deviations with their
    size."""
    head = (
        "| campaign | effect | "
        + " | ".join(TRUTH.values())
        + " | intervals that hold | misfit |\n"
    )
    lines = [head, "|---" * (len(NAMES) + 4) + "|\n"]
    for name, c in campaigns.items():
        cells = []
        for n in NAMES:
            mark = f" ({c['z'][n]:+.1f} σ)" if abs(c["z"][n]) > 2 else ""
            cells.append(f"{100 * c['error'][n]:+.2f}{mark}")
        effects = ", ".join(c["effects"]) or "none"
        row = [name, effects, *cells, f"{c['intervals_that_hold']:.0%}", f"{c['misfit']:.2f}"]
        lines.append("| " + " | ".join(row) + " |\n")
    return "".join(lines)


def main() -> None:
    """Identify every practice campaign; write table, numbers and a figure of the errors in standard
    deviations."""
    folder = shared("SENSORLESS_RECORDINGS", "recordings") / "practice"
    campaigns: dict[str, dict] = {}
    for path in sorted(folder.glob("p*.truth.toml")):
        name = path.name.split(".")[0]
        found = identify(folder / name)
        truth = tomllib.loads(path.read_text())
        campaigns[name] = {"effects": truth["effects"], **judge(found, truth["true_motor"])}
    figure, axes = new_figure(1, 1, 9.0, 4.0)
    axis = axes[0, 0]
    axis.axhspan(-1.96, 1.96, color="0.93", zorder=0)
    for k, c in enumerate(campaigns.values()):
        x = k + np.linspace(-0.3, 0.3, len(NAMES))
        axis.plot(
            x, [np.clip(c["z"][n], -6, 6) for n in NAMES], "o", color=COLOURS["model"], markersize=4
        )
    labels = [f"{k}\n{', '.join(c['effects']) or 'none'}" for k, c in campaigns.items()]
    axis.set_xticks(range(len(labels)), labels, rotation=35, ha="right", fontsize=8)
    axis.set(
        ylabel="error / standard deviation",
        ylim=(-6.3, 6.3),
        title="exact fit: R, L_d, L_q, five alphas (±6: more)",
    )
    save("identify_practice", {"campaigns": campaigns}, figure)
    (RESULTS / "identify_practice.md").write_text(table(campaigns), encoding="utf-8")
    print(table(campaigns))


if __name__ == "__main__":
    main()
