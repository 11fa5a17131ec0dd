"""How well do quartic, spline energy and piecewise-linear table carry measured and computed flux
maps?

Each is fitted to every other grid line of the map and judged on the rest: flux at given current,
torque, and incremental inductances against central differences of the whole map.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from experiments.drawing import COLOURS, new_figure, save, shared
from model import energy as quartic
from model import spline_energy as spline
from model.energy import Energy
from model.errors import PhysicsError
from model.fluxmap import FluxMap, read_map

# file, axis of the magnet, pole pairs, rated current (A peak) by name plate (Baldor),
# motulator's example (THOR), half the map (Brusa)
MAPS = {
    "brusa": ("brusa_hsm1/brusa_meas.npz", "d", 5, 72.5),
    "baldor": ("baldor_pmsyrm/baldor_meas.npz", "d", 2, 12.4),
    "thor": ("thor_fea/thor_fea.npz", "-q", 2, 22.0),
}


def quartic_fit(m: FluxMap, limit: float) -> tuple[Energy, float]:
    """Return the quartic energy and magnet flux of least squares on grad H = i, over currents up to
    a limit (A)."""
    psi_d, psi_q, i_d, i_q = m.points()
    near = np.hypot(i_d, i_q) <= limit
    psi_d, psi_q, i_d, i_q = psi_d[near], psi_q[near], i_d[near], i_q[near]
    k = int(np.argmin(np.hypot(i_d, i_q)))
    magnet = psi_d[k] - i_d[k] * np.ptp(psi_d) / np.ptp(i_d)
    for _ in range(30):
        d, q, o = psi_d - magnet, psi_q, np.zeros_like(psi_d)
        rows_d = np.column_stack([d, o, 3 * d**2, q**2, 4 * d**3, 2 * d * q**2, o])
        rows_q = np.column_stack([o, q, o, 2 * d * q, o, 2 * d**2 * q, 4 * q**3])
        one = np.concatenate([np.ones_like(d), o])
        c, *_ = np.linalg.lstsq(
            np.column_stack([np.concatenate([rows_d, rows_q]), one]),
            np.concatenate([i_d, i_q]),
            rcond=None,
        )
        *coefficients, constant = c
        energy = Energy(*(float(x) for x in coefficients))
        # a constant current means the magnet flux is elsewhere
        magnet -= 0.5 * constant / energy.gamma_d
    return energy, float(magnet)


def carried(
    train: FluxMap, rated: float, x: np.ndarray, y: np.ndarray
) -> dict[str, tuple[np.ndarray, ...]]:
    """Return psi_d, psi_q, L_dd, L_dq, L_qq of the three models at currents (NaN where a model does
    not hold)."""
    m, magnet = quartic_fit(train, 1.25 * rated)
    out = {}
    rows = []
    for a, b in zip(x.ravel(), y.ravel(), strict=True):
        try:
            d, q = quartic.flux_from_current(m, a, b)
            rows.append((float(d) + magnet, float(q), *map(float, quartic.inductances(m, a, b))))
        except PhysicsError:
            rows.append(5 * (np.nan,))
    out["quartic"] = tuple(np.array(rows).T.reshape(5, *x.shape))
    s = spline.fit_map(train)
    out["spline"] = (*spline.flux_from_current(s, x, y), *spline.inductances(s, x, y))
    table = [
        RegularGridInterpolator((train.i_d, train.i_q), f, bounds_error=False, fill_value=None)
        for f in (train.psi_d, train.psi_q)
    ]
    psi = [t((x, y)) for t in table]
    h = 1e-4 * np.ptp(train.i_d)  # inside the cell above the point: the table's own slope
    dd, dq, qq = (
        (t((x + a, y + b)) - f) / h
        for t, f, a, b in (
            (table[0], psi[0], h, 0),
            (table[0], psi[0], 0, h),
            (table[1], psi[1], 0, h),
        )
    )
    out["table"] = (*psi, dd, dq, qq)
    return out


def judge(name: str) -> tuple[dict[str, object], dict[str, np.ndarray]]:
    """Return the figures of one map, and a cut along i_q for the drawing."""
    file, axis, pairs, rated = MAPS[name]
    full = read_map(shared("SENSORLESS_DATA", "realdata") / file, axis)
    train = full.every(2)
    x, y = np.meshgrid(full.i_d, full.i_q, indexing="ij")
    held = np.ones(x.shape, dtype=bool)
    held[::2, ::2] = False
    held &= (x <= train.i_d[-1]) & (y <= train.i_q[-1])
    torque = 1.5 * pairs * (full.psi_d * y - full.psi_q * x)
    ring = np.abs(np.hypot(x, y) / rated - 1) < 0.06
    k = np.argmax(np.where(ring, torque, -np.inf))
    rated_flux, rated_torque = (
        float(np.hypot(full.psi_d, full.psi_q).flat[k]),
        float(torque.flat[k]),
    )
    measured = torque if full.torque is None else full.torque
    fd = (
        np.gradient(full.psi_d, full.i_d, axis=0),
        np.gradient(full.psi_d, full.i_q, axis=1),
        np.gradient(full.psi_q, full.i_q, axis=1),
    )
    inner = held.copy()
    inner[[0, -1]] = inner[:, [0, -1]] = False
    scale = float(np.median(fd[2][inner]))
    numbers: dict[str, object] = {
        "rated_current": rated,
        "rated_flux": rated_flux,
        "rated_torque": rated_torque,
        "held_out_points": int(held.sum()),
        "map_not_reciprocal_rms": _rms((fd[1] - np.gradient(full.psi_q, full.i_d, axis=0))[inner])
        / scale,
        "map_torque_rms": float(np.sqrt(np.mean((torque - measured)[held] ** 2)) / rated_torque),
        "map_points_not_passive": int(np.sum(fd[0] * fd[2] - fd[1] ** 2 <= 0))
        + int(np.sum(fd[0] <= 0)),
    }
    for model, (psi_d, psi_q, *found) in carried(train, rated, x, y).items():
        valid = held & np.isfinite(psi_d)
        flux = np.hypot(psi_d - full.psi_d, psi_q - full.psi_q)
        t = 1.5 * pairs * (psi_d * y - psi_q * x) - measured
        good, size = inner & valid, np.hypot(x, y)
        error = np.array([a - b for a, b in zip(found, fd, strict=True)])
        numbers[model] = {
            "flux_rms": _rms(flux[valid]) / rated_flux,
            "flux_rms_within_rated": _rms(flux[valid & (size <= rated)]) / rated_flux,
            "flux_rms_beyond_a_quarter": _rms(flux[valid & (size > 0.25 * rated)]) / rated_flux,
            "torque_rms": _rms(t[valid]) / rated_torque,
            "torque_rms_within_rated": _rms(t[valid & (size <= rated)]) / rated_torque,
            "inductance_rms": _rms(error[:, good].ravel()) / scale,
            "inductance_rms_beyond_a_quarter": _rms(error[:, good & (size > 0.25 * rated)].ravel())
            / scale,
            "inductance_median": float(np.median(np.abs(error[:, good]))) / scale
            if good.any()
            else np.nan,
            "outside_valid_domain": int(np.sum(held & ~np.isfinite(psi_d))),
        }
    cut = np.linspace(full.i_q[0], full.i_q[-1], 401)
    lines = {k: l_qq for k, (*_, l_qq) in carried(train, rated, np.zeros_like(cut), cut).items()}
    zero = int(np.argmin(np.abs(full.i_d)))
    return numbers, {"i_q": cut, **lines, "grid": full.i_q, "difference": fd[2][zero]}


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x)))) if x.size else np.nan


def main() -> None:
    """Judge all maps; draw L_qq along i_q at i_d = 0, where a table shows its stairs."""
    figure, axes = new_figure(1, 3, 4.6, 3.6)
    numbers = {}
    for axis, name in zip(axes[0], MAPS, strict=True):
        numbers[name], cut = judge(name)
        axis.plot(
            cut["grid"], 1e3 * cut["difference"], ".", color="0.5", label="differences of the map"
        )
        for model, colour in (("table", "first"), ("quartic", "linear"), ("spline", "model")):
            axis.plot(
                cut["i_q"], 1e3 * cut[model], color=COLOURS[colour], linewidth=1.2, label=model
            )
        axis.set(
            title=f"{name}, i_d = 0",
            xlabel="i_q (A)",
            ylabel="L_qq (mH)",
            ylim=(0, 1.3e3 * np.max(cut["difference"])),
        )
        axis.legend(fontsize=8)
    save("flux_maps", {"maps": numbers}, figure)


if __name__ == "__main__":
    main()
