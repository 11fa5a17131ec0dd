"""Which orders do THOR's slots make, and how do their amplitudes depend on the currents?

First the tables: rms of each order of the flux over the currents within the rated one, and the
share of its energy that one amplitude and phase, the same at all currents, would explain; then the
shares that co-energies explain which are even in (i_q, angle) and of first, second, third degree in
the currents: amplitudes that are constant, grow with the current, grow with its square.  Then the
recordings made of them, beside the tables' mean over the angle as nominal flux map: the share of
the residual's excess that each order of the rotor's frame holds.  Last, of the
harmonics that the diagnosis named there (`real_cases`): the share of the tables' orders that they
explain.

Run: python -m experiments.thor_orders   (15 s)
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.diagnosed_cases import thor_with_map
from experiments.drawing import RESULTS, save, shared
from experiments.real_drives import thor
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location.decompose import decompose
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import read_folder
from sandbox.replay.replay import prepare

SHOWN = 6  # orders listed
SIZES = ("gamma", "back", "pulse", "alpha_30", "alpha_12", "alpha_21", "alpha_03")


def of_tables(table: thor.Thor) -> dict[int, dict[str, float]]:
    """Return for the largest orders their rms (Wb, both axes) and the share that a constant
    amplitude explains."""
    i_d, i_q = np.meshgrid(table.i_d, table.i_q, indexing="ij")
    own = np.hypot(i_d, i_q) <= thor.RATED_CURRENT
    found = {}
    for n in range(1, len(table.theta) // 2):
        wave = 2.0 * np.exp(-1j * n * table.theta)
        parts = [(psi * wave).mean(2)[own] for psi in (table.psi_d, table.psi_q)]
        energy = sum(float(np.mean(np.abs(x) ** 2)) for x in parts)
        constant = sum(float(np.abs(np.mean(x)) ** 2) for x in parts)
        found[n] = {"rms_Wb": float(np.sqrt(0.5 * energy)), "constant": constant / energy}
        found[n] |= {
            f"degree_{k}": of_coenergy(
                i_d[own] / thor.RATED_CURRENT, i_q[own] / thor.RATED_CURRENT, *parts, k
            )
            for k in (1, 2, 3)
        }
    largest = sorted(found, key=lambda n: -found[n]["rms_Wb"])[:SHOWN]
    return {n: found[n] for n in largest}


def of_coenergy(x, y, psi_d, psi_q, degree: int) -> float:
    """Return the share of an order's energy that a co-energy up to some degree in the currents
    explains.

    x, y: i_d, i_q (m,); psi_d, psi_q: complex amplitudes (m,) of cos - j sin.  A machine that is
    its own mirror image has terms of even degree in i_q with the cosine and of odd degree with the
    sine; fluxes are the slopes of both.
    """
    columns = []
    for total in range(1, degree + 1):
        for k in range(total + 1):
            d = (total - k) * x ** max(total - k - 1, 0) * y**k
            q = k * x ** (total - k) * y ** max(k - 1, 0)
            columns.append(np.concatenate([d, q]) * (-1j if k % 2 else 1.0))
    a, b = np.array(columns).T, np.concatenate([psi_d, psi_q])
    a, b = np.concatenate([a.real, a.imag]), np.concatenate([b.real, b.imag])
    left = b - a @ np.linalg.lstsq(a, b, rcond=None)[0]
    return float(1.0 - left @ left / (b @ b))


def of_diagnosis(table: thor.Thor, values: Mapping[str, float]) -> dict[int, float]:
    """Return which share of the tables' orders the harmonics explain that the diagnosis named, at
    currents recorded.

    values: its parameters by their public names.  Nothing is simulated: a harmonic current di at a
    flux moves the flux at a given current by -L di, to first order, with L the incremental
    inductances of the tables' mean.
    """
    d, q = table.psi_d.mean(2), table.psi_q.mean(2)
    slopes = [np.gradient(x, table.i_d, table.i_q) for x in (d, q)]
    d = (d - d[np.argmin(np.abs(table.i_d)), np.argmin(np.abs(table.i_q))])[..., None]
    q = q[..., None]
    i_d, i_q = np.meshgrid(table.i_d, table.i_q, indexing="ij")
    own = (i_d >= -16.0) & (i_d <= 0.0) & (i_q >= 2.0) & (i_q <= 19.0)  # A: where thor_bench goes
    moved = [np.zeros(table.psi_d.shape) for _ in range(2)]
    for part in [f"inductance_harmonics.{k}" for k in range(1, 7)]:
        size = {n: values.get(f"{part}.{n}", 0.0) for n in (*SIZES, "order", "phase")}
        if part.endswith(".1"):
            size |= {"gamma": values.get("inductance_harmonics.gamma_6", 0.0), "order": 6.0}
        x = size["order"] * table.theta + size["phase"]
        even, odd = size["gamma"] + size["back"], size["gamma"] - size["back"]
        cos, sin = np.cos(x), np.sin(x)
        moved[0] += cos * (
            (even + size["pulse"]) * d + 3.0 * size["alpha_30"] * d**2 + size["alpha_12"] * q**2
        )
        moved[0] += sin * (odd * q + 2.0 * size["alpha_21"] * d * q)
        moved[1] += cos * ((size["pulse"] - even) * q + 2.0 * size["alpha_12"] * d * q)
        moved[1] += sin * (odd * d + size["alpha_21"] * d**2 + 3.0 * size["alpha_03"] * q**2)
    flux = [
        -sum(slope[..., None] * i for slope, i in zip(row, moved, strict=True)) for row in slopes
    ]
    for k in range(1, 7):
        part, end = ("flux_harmonics", "6") if k == 1 else (f"flux_harmonics.{k}", "")
        x = values.get(f"{part}.order", 6.0) * table.theta + values.get(f"{part}.phase", 0.0)
        flux[0] += values.get(f"{part}.psi_d{end}", 0.0) * np.cos(x)
        flux[1] += values.get(f"{part}.psi_q{end}", 0.0) * np.sin(x)
    out = {}
    for n in (18, 6, 12, 36):
        wave = np.exp(-1j * n * table.theta)
        seen, stated = (
            np.stack([(x * wave).mean(2)[own] for x in p])
            for p in ((table.psi_d, table.psi_q), flux)
        )
        out[n] = 1.0 - float(np.sum(np.abs(seen - stated) ** 2) / np.sum(np.abs(seen) ** 2))
    return out


def of_residual() -> dict[int, float]:
    """Return the shares of the residual's excess in the largest orders, before anything is
    fitted."""
    with tempfile.TemporaryDirectory() as folder:
        campaign = read_folder(thor_with_map(Path(folder)))
        start = ParameterPoint(
            prepare(campaign), complete(campaign.drive.motor, campaign.drive.converter)
        )
    shares: dict[int, float] = {}
    for n, share in decompose(start, shown(start)).electrical.items():
        shares[abs(n)] = shares.get(abs(n), 0.0) + share
    return {n: shares[n] for n in sorted(shares, key=lambda n: -shares[n])[:SHOWN]}


def main() -> None:
    """Print and keep both."""
    table = thor.read(shared("SENSORLESS_DATA", "realdata") / "thor_fea" / "thor_fea.npz")
    tables, residual = of_tables(table), of_residual()
    for n, row in tables.items():
        degrees = ", ".join(f"{row[f'degree_{k}']:.0%}" for k in (1, 2, 3))
        print(
            f"order {n}: {1e3 * row['rms_Wb']:.2f} mWb rms, a constant explains "
            f"{row['constant']:.0%}, even energies of degree 1, 2, 3 {degrees}"
        )
    print(
        "of the residual's excess: "
        + ", ".join(f"order {n} {share:.1%}" for n, share in residual.items())
    )
    case = json.loads((RESULTS / "real_cases.json").read_text())["cases"]["thor_own_map"]
    named = of_diagnosis(table, case["parameters"])
    print(
        "explained by what was named: "
        + ", ".join(f"order {n} {share:.0%}" for n, share in named.items())
    )
    save("thor_orders", {"tables": tables, "residual": residual, "named": named})


if __name__ == "__main__":
    main()
