"""A real SynRM at standstill (10 kHz, square-wave voltages): R, voltage error and flux map from the
recording alone.

Fitted: both single-axis tests and the first half of the cross test.  Held out: the cross test's
second half, and the authors' reference map (whose current grid is not published: its two extents
are fitted, so only its shape counts).
"""

from __future__ import annotations

import numpy as np

from experiments.drawing import COLOURS, new_figure, save, shared
from experiments.standstill import SMALL, StepTest, fit_axes, flux_of, simulate
from model import spline_energy as spline
from model.errors import PhysicsError

FILES = {"d": "UD130_500.csv", "q": "UQ100_500.csv", "cross": "UD110Q200_1000.csv"}


def tests() -> dict[str, StepTest]:
    """Return the three recordings; only time, voltages and currents are read."""
    folder = shared("SENSORLESS_DATA", "realdata") / "synrm_standstill"
    out = {}
    for name, file in FILES.items():
        a = np.genfromtxt(folder / file, delimiter=",", names=True)
        out[name] = StepTest(*(np.ascontiguousarray(a[c]) for c in ("t", "Ud", "Uq", "Id", "Iq")))
    return out


def points(data, fit, half: bool):
    """Return psi_d, psi_q, i_d, i_q of the fitted samples, mirrored in d (a SynRM is symmetric in
    both axes)."""
    parts = [flux_of(data[k], fit) for k in ("d", "q")]
    cross = flux_of(data["cross"], fit)
    parts.append(tuple(x[: len(x) // 2] if half else x for x in cross))
    p = [np.concatenate(x) for x in zip(*parts, strict=True)]
    return [
        np.concatenate([p[0], -p[0]]),
        np.concatenate([p[1], p[1]]),
        np.concatenate([p[2], -p[2]]),
        np.concatenate([p[3], p[3]]),
    ]


def main() -> None:
    """Identify, compare, draw measured against simulated currents for the whole recording."""
    data = tests()
    fit = fit_axes([(data["d"], 0), (data["q"], 1)])
    m = spline.fit(*points(data, fit, half=True), (12, 8), 3e-3)
    figure, axes = new_figure(3, 1, 9.0, 2.6)
    numbers: dict[str, object] = {"fit": fit.__dict__}
    for axis, (name, test) in zip(axes[:, 0], data.items(), strict=True):
        out, h = np.empty((len(test.t), 2)), float(test.t[1] - test.t[0])
        psi_d, psi_q, i_d, i_q = flux_of(test, fit)
        largest = float(np.max(np.hypot(i_d, i_q)))
        simulate(
            m,
            fit.resistance,
            fit.threshold,
            SMALL * largest,
            test.u_d,
            test.u_q,
            h,
            psi_d[0],
            psi_q[0],
            10,
            out,
        )
        later = slice(len(test.t) // 2, None)
        numbers[name] = {
            "current_rms_error": np.sqrt(np.mean((out[:, 0] - i_d) ** 2 + (out[:, 1] - i_q) ** 2)),
            "current_rms_error_second_half": np.hypot(
                _rms((out[:, 0] - i_d)[later]), _rms((out[:, 1] - i_q)[later])
            ),
            "current_rms": np.sqrt(np.mean(i_d**2 + i_q**2)),
            "largest_current": largest,
        }
        numbers[name] |= flux_error(m, psi_d[later], psi_q[later], i_d[later], i_q[later])  # type: ignore[operator]
        for k, c in enumerate("dq"):
            if np.any((i_d, i_q)[k]):
                axis.plot(
                    1e3 * (test.t - test.t[0]),
                    (i_d, i_q)[k],
                    ".",
                    ms=3,
                    color=COLOURS["data" if c == "d" else "first"],
                    label=f"i_{c} measured",
                )
                axis.plot(
                    1e3 * (test.t - test.t[0]),
                    out[:, k],
                    color=COLOURS["model" if c == "d" else "other"],
                    linewidth=1.1,
                    label=f"i_{c} simulated",
                )
        axis.set(
            ylabel="A",
            title=f"{name} test" + (" (second half held out)" if name == "cross" else ""),
        )
        axis.legend(fontsize=7, ncols=2, loc="upper right")
    axes[-1, 0].set_xlabel("t (ms)")
    numbers["reference_map"] = against_reference(m)
    save("synrm_standstill", numbers, figure)


def flux_error(m, psi_d, psi_q, i_d, i_q) -> dict[str, float]:
    """Return rms flux error (Wb) at measured currents inside the map, and the share of samples
    outside."""
    errors = []
    for a, b, c, d in zip(psi_d, psi_q, i_d, i_q, strict=True):
        try:
            x, y = spline.flux_from_current(m, c, d)
            errors.append(float(np.hypot(x - a, y - b)))
        except PhysicsError:
            continue
    rms = float(np.sqrt(np.mean(np.square(errors)))) if errors else np.nan
    return {"flux_rms_second_half": rms, "share_outside_map": 1 - len(errors) / len(psi_d)}


def _rms(x) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def against_reference(m) -> dict[str, float]:
    """Return extents of the reference's grid that fit best, and rms difference of flux there."""
    z = np.load(
        shared("SENSORLESS_DATA", "realdata") / "synrm_standstill" / "filtered_gt_cache.npz"
    )
    best: dict[str, float] = {"flux_rms": np.inf}
    for top_d in np.arange(2.5, 4.8, 0.1):
        for top_q in np.arange(2.5, 4.8, 0.1):
            x, y = np.meshgrid(np.linspace(-top_d, top_d, 40), np.linspace(-top_q, top_q, 40))
            try:
                d, q = spline.flux_from_current(m, x[::3, ::3], y[::3, ::3])
            except PhysicsError:
                continue
            e_d, e_q = d - z["Psid_gt"][::3, ::3], q - z["Psiq_gt"][::3, ::3]
            rms = float(np.sqrt(np.mean(e_d**2 + e_q**2)))
            if rms < best["flux_rms"]:
                best = {
                    "flux_rms": rms,
                    "d_rms": _rms(e_d),
                    "q_rms": _rms(e_q),
                    "largest_i_d": top_d,
                }
                best |= {"largest_i_q": top_q, "largest_flux": float(np.max(z["Psid_gt"]))}
    return best


if __name__ == "__main__":
    main()
