"""Could other readings of the SynRM's standstill test bring its own flux map below ten noise
floors?

`synrm_as_integrated` ends at 12.7 over all.  Here what it takes from the files is fitted instead:
the delay of each test, the angle of the cross test, its resistance (it may have been warmer),
unequal gains of its current sensors (at a rotor that stands: a part that turns the other way).
Fitted to both single-axis tests and the first
half of the cross test by what currents simulated from the voltages alone miss; the second half is
held out.

Run: python -m experiments.synrm_refitted   (2 min)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from experiments import synrm_as_integrated as read
from experiments import synrm_standstill as filed
from experiments.drawing import save
from experiments.standstill import SMALL, simulate
from model.errors import PhysicsError

Array = NDArray[np.float64]
TESTS = tuple(filed.FILES)
# delays of the tests (1e-4 s), angle (rad): near those of `synrm_as_integrated`
FIRST = (2.1, 2.1, 2.45, 0.0395)
STEPS = (0.3, 0.3, 0.2, 0.004)
MORE = {
    "delays and angle": (),
    "resistance of the cross test, too": (0.02,),
    "current gains, too": (0.01, 0.01),
}
TRIALS = 70


def tests_at(
    x: Array, authors: dict[str, tuple[float, Array]]
) -> tuple[dict[str, float], dict[str, read.Corrected]]:
    """Return R (ohm) of each test and the tests, read with delays, angle and what else there is: a
    share of R, or the two parts of a gain."""
    resistance, offsets = authors["d"][0], {name: offset for name, (_, offset) in authors.items()}
    own = dict.fromkeys(TESTS, resistance)
    if len(x) == 5:
        own["cross"] *= 1.0 + x[4]
    out = {
        name: read.corrected(own[name], 1e-4 * x[k], offsets, x[3])[name]
        for k, name in enumerate(TESTS)
    }
    if len(x) == 6:
        c = out["cross"]
        z = c.i[0] + 1j * c.i[1]
        z = z + complex(x[4], x[5]) * np.conj(z)
        i, h = np.stack([z.real, z.imag]), float(c.t[1] - c.t[0])
        steps = h * (c.u[:, :-1] - 0.5 * resistance * (i[:, 1:] + i[:, :-1]))
        psi = np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)
        out["cross"] = read.Corrected(c.t, c.u, i, psi)
    return own, out


def misses(x: Array, authors: dict[str, tuple[float, Array]]) -> dict[str, float]:
    """Return the rms over the floor of what was fitted ("fitted"), of all samples, and of the half
    held out."""
    resistance, tests = tests_at(x, authors)
    m, squares = read.fitted(read.map_points(tests)), {}
    for name, c in tests.items():
        h, found = float(c.t[1] - c.t[0]), np.empty((len(c.t), 2))
        simulate(
            m, resistance[name], 0.0, SMALL, c.u[0], c.u[1], h, c.psi[0, 0], c.psi[1, 0], 10, found
        )
        squares[name] = np.mean((found.T - c.i) ** 2, axis=0) / read.FLOOR**2
    half = len(squares["cross"]) // 2
    seen = np.concatenate([squares["d"], squares["q"], squares["cross"][:half]])
    held = squares["cross"][half:]
    parts = {"fitted": seen, "all": np.append(seen, held), "cross_held_out": held}
    return {k: float(np.sqrt(np.mean(v))) for k, v in parts.items()}


def best(authors: dict[str, tuple[float, Array]], more: tuple[float, ...]) -> Array:
    """Return the reading that misses least of what is fitted (Nelder and Mead); more: first steps
    beyond FIRST."""
    start = np.array([*FIRST, *[0.0] * len(more)])
    simplex = np.vstack([start, start + np.diag([*STEPS, *more])])

    def missed(x: Array) -> float:
        """Return the rms of what is fitted, infinite where no map goes through the points."""
        try:
            return misses(x, authors)["fitted"]
        except PhysicsError:
            return np.inf

    options = {"initial_simplex": simplex, "maxfev": TRIALS, "xatol": 1e-3, "fatol": 0.02}
    return np.asarray(minimize(missed, start, method="Nelder-Mead", options=options).x)


def main() -> None:
    """Print and keep what each reading leaves."""
    authors = {name: read.of_authors(name) for name in TESTS}
    rows = {}
    for label, more in MORE.items():
        x = best(authors, more)
        rows[label] = {"reading": [float(v) for v in x], **misses(x, authors)}
        said = ", ".join(f"{k} {rows[label][k]:.1f}" for k in ("fitted", "all", "cross_held_out"))
        print(f"{label:35s} {said}   {np.round(x, 4).tolist()}")
    save("synrm_refitted", {"rms_over_floor": rows})


if __name__ == "__main__":
    main()
