"""Why a SynRM's standstill test parts from its own flux map: its authors' voltages, the currents'
delay, and an angle.

The files hold a flux beside voltages and currents.  Their own difference gives back, to rounding,
how the authors integrated it (trapezoids): u - dPsi/dt = R i + offset, R the same in all tests, the
offset one voltage a test and axis.

Corrected one after the other, with the map fitted anew each time to both single-axis tests and the
first half of the cross test:

1. as filed: R of `synrm_standstill`, commanded voltages, currents as they stand;
2. currents earlier by the delay that `synrm_standstill` finds;
3. R and voltage offsets of the authors;
4. the cross test turned by the angle that `model.map_quality.quality` proposes for the points of
   its first half (the single-axis tests are filed with exactly no current across, so nothing is
   known of their angle).

Each is simulated from its voltages alone.  Run: python -m experiments.synrm_as_integrated   (20 s)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments import synrm_standstill as filed
from experiments.drawing import save, shared
from experiments.standstill import SMALL, fit_axes, simulate
from model import spline_energy as spline
from model.errors import PhysicsError
from model.map_points import MapPoints
from model.map_quality import quality
from model.spline import SplineEnergy

Array = NDArray[np.float64]
FLOOR = 0.0045  # A: current_noise of synrm_standstill.toml
# cells and smoothness; the finer one where the points allow it
CELLS = (((12, 14), 1e-3), ((12, 8), 3e-3))
SETTLED, LAST = 5, 5  # samples at the beginning and the end that a moved current does not reach


@dataclass(frozen=True)
class Corrected:
    """A test after corrections: t (n,), voltages, currents and flux along d and q, each (2, n), in
    s, V, A, Wb."""

    t: Array
    u: Array
    i: Array
    psi: Array


def of_authors(name: str) -> tuple[float, Array]:
    """Return R (ohm) and the voltage offsets (V, on d and q) by which a test's filed flux is its
    filed voltage."""
    a = _table(name)
    h = float(a["t"][1] - a["t"][0])
    out, resistance = np.zeros(2), []
    for k, axis in enumerate("dq"):
        u, i = (0.5 * (a[f"{x}{axis}"][1:] + a[f"{x}{axis}"][:-1]) for x in "UI")
        if not i.any():
            continue
        slope, out[k] = np.polyfit(i, u - np.diff(a[f"Psi_{axis}"]) / h, 1)
        resistance.append(float(slope))
    return float(np.mean(resistance)), out


def _table(name: str) -> NDArray[np.void]:
    folder = shared("SENSORLESS_DATA", "realdata") / "synrm_standstill"
    return np.asarray(np.genfromtxt(folder / filed.FILES[name], delimiter=",", names=True))


def corrected(
    resistance: float, delay: float, offsets: Mapping[str, Array], angle: float
) -> dict[str, Corrected]:
    """Return the tests with R (ohm), currents earlier by a delay (s), less voltage offsets (V), the
    cross test in a frame turned by an angle (rad)."""
    out = {}
    for name in filed.FILES:
        a = _table(name)
        t, h, n = a["t"] - a["t"][0], float(a["t"][1] - a["t"][0]), len(a["t"]) - LAST
        i = np.stack([np.interp(t + delay, t, a[f"I{x}"]) for x in "dq"])
        u = np.stack([a[f"U{x}"] for x in "dq"]) - offsets[name][:, None]
        steps = h * (u[:, :-1] - 0.5 * resistance * (i[:, 1:] + i[:, :-1]))
        psi = np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)
        turn = angle if name == "cross" else 0.0
        # as MapPoints.turned
        frame = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        out[name] = Corrected(
            t[:n], *(np.ascontiguousarray((frame @ x)[:, :n]) for x in (u, i, psi))
        )
    return out


def half(c: Corrected) -> slice:
    """Return the samples of the first half of a test."""
    return slice(SETTLED, len(c.t) // 2)


def map_points(tests: Mapping[str, Corrected]) -> Array:
    """Return i_d, i_q (A), psi_d, psi_q (Wb) (m, 4) of the samples that the map is fitted to,
    mirrored in both axes."""
    parts = [
        np.vstack([c.i, c.psi])[:, half(c) if k == "cross" else slice(SETTLED, None)]
        for k, c in tests.items()
    ]
    p = np.hstack(parts)
    return np.vstack([(p * np.array([a, b, a, b])[:, None]).T for a in (1, -1) for b in (1, -1)])


def proposed_angle(tests: Mapping[str, Corrected]) -> float:
    """Return the angle (rad) that the cross test's points of the first half propose, 0 where they
    propose none."""
    c = tests["cross"]
    found = quality(MapPoints("cross test", *c.i[:, half(c)], *c.psi[:, half(c)], ()))
    return found.angle or 0.0


def fitted(points: Array) -> SplineEnergy:
    """Return the map through points (m, 4); PhysicsError where they contradict each other."""
    i_d, i_q, psi_d, psi_q = points.T
    try:
        return spline.fit(psi_d, psi_q, i_d, i_q, *CELLS[0])
    except PhysicsError:
        return spline.fit(psi_d, psi_q, i_d, i_q, *CELLS[1])


def misses(tests: Mapping[str, Corrected], resistance: float) -> dict[str, float]:
    """Return, for each test and for the half of the cross test held out, the rms over the floor by
    which currents simulated from the voltages alone miss those measured (per axis, as phases have
    it)."""
    m, out = fitted(map_points(tests)), dict[str, float]()
    for name, c in tests.items():
        h, found = float(c.t[1] - c.t[0]), np.empty((len(c.t), 2))
        simulate(m, resistance, 0.0, SMALL, c.u[0], c.u[1], h, c.psi[0, 0], c.psi[1, 0], 10, found)
        square = np.mean((found.T - c.i) ** 2, axis=0) / FLOOR**2
        out[name] = float(np.sqrt(np.mean(square)))
        if name == "cross":
            out["cross_held_out"] = float(np.sqrt(np.mean(square[len(c.t) // 2 :])))
    return out


def steps() -> dict[str, tuple[float, dict[str, Corrected]]]:
    """Return R (ohm) and the tests after each correction, by what has been corrected last."""
    data = filed.tests()
    own = fit_axes([(data["d"], 0), (data["q"], 1)])
    none = {name: np.zeros(2) for name in filed.FILES}
    said = {name: of_authors(name) for name in filed.FILES}
    resistance, offsets = said["d"][0], {name: offset for name, (_, offset) in said.items()}
    late = corrected(resistance, own.delay, offsets, 0.0)
    return {
        "as filed": (own.resistance, corrected(own.resistance, 0.0, none, 0.0)),
        "currents earlier": (own.resistance, corrected(own.resistance, own.delay, none, 0.0)),
        "R and offsets of the authors": (resistance, late),
        "cross test turned": (
            resistance,
            corrected(resistance, own.delay, offsets, proposed_angle(late)),
        ),
    }


def main() -> None:
    """Print and keep what each correction leaves."""
    said = {name: of_authors(name) for name in filed.FILES}
    rows = {label: misses(tests, resistance) for label, (resistance, tests) in steps().items()}
    angle = proposed_angle(steps()["R and offsets of the authors"][1])
    for label, row in rows.items():
        print(f"{label:30s}", "  ".join(f"{k} {v:.1f}" for k, v in row.items()))
    print(
        f"R {said['d'][0]:.6g} ohm, offsets "
        f"{ ({k: v[1].tolist() for k, v in said.items()}) } V, angle {angle:.4f} rad"
    )
    authors = {
        k: {"resistance": r, "offset_d_V": float(o[0]), "offset_q_V": float(o[1])}
        for k, (r, o) in said.items()
    }
    save("synrm_as_integrated", {"authors": authors, "angle": angle, "rms_over_floor": rows})


if __name__ == "__main__":
    main()
