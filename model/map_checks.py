"""What a flux map says against itself: its torque against its fluxes, its cells against its points,
slopes of its fit.

Each check gives sentences; the map is used all the same.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.map_fit import squared_errors
from model.map_points import MapPoints
from model.spline import SplineEnergy, hessian
from model.spline_energy import Choice

# Torque over 3/2 p (psi_d i_q - psi_q i_d).  The conventions that are mixed differ by sqrt(3/2) at
# least, so half of that, on a logarithmic scale, is what a measured torque may differ by without a
# word: losses, drift of the magnets.
TORQUE_OFF = 1.5**0.25
REMEDY = "correct them or leave their cells empty"
FEW, WILD = 0.05, 10.0  # of the points; times the median distance from the line: a wild torque
# a wild flux: the smaller over the larger distance; least, of its span (measured maps have 0.03)
ALIKE, LEAST_WILD = 0.7, 0.04
REWEIGHTED, NAMED = 30, 3  # steps to the line of least absolute deviations; points in a sentence
SAME_FACTOR = 1.05  # a factor nearer than that to one of a convention is taken for it
LOOSE = 0.3  # of the torque's own rms: what a line through the fluxes' torque may leave
# times beyond the slopes of a map's nearest steps: a fit's inductance there is the fit's own
SLOPE_OFF = 2.0
NEAREST = 3  # steps of a map on each side of a point: a measured map has single wrong ones
MEANT = (
    (math.sqrt(2.0), "the currents or the fluxes are rms values; both must be peak values"),
    (2.0, "currents and fluxes are rms values, or [motor] pole_pairs is half of what it is"),
    (0.5, "[motor] pole_pairs holds poles, not pairs of them"),
    (
        2.0 / 3.0,
        (
            "currents and fluxes are of the power-invariant transformation; both must be "
            "phase peak values"
        ),
    ),
    (math.sqrt(2.0 / 3.0), "the currents or the fluxes are of the power-invariant transformation"),
    (1.0 / math.sqrt(3.0), "the fluxes are between two terminals; they must be of a phase"),
    (1e3, "the fluxes are in kWb, the currents in kA, or the torque is in mN m"),
    (1e-3, "the fluxes are in mWb, the currents in mA, or the torque is in kN m"),
)


class TorqueLine(NamedTuple):
    """A map's torque as a line over that of its fluxes for one pole pair: its slope, and the rms
    (of the torque's own about its mean) that it leaves; NaN where the map has no torque."""

    slope: float
    left: float


NO_TORQUE = TorqueLine(math.nan, math.nan)


def torque_line(p: MapPoints) -> TorqueLine:
    """Return how a map's column of torque lies over the torque of its fluxes (an offset is
    friction's), single wild points left out."""
    if p.torque is None:
        return NO_TORQUE
    good = np.isfinite(p.torque) & ~wild_torques(p)
    own, stated_torque = _own_torque(p)[good], p.torque[good]
    if len(stated_torque) < 3 or not np.std(own) > 0.0 or not np.std(stated_torque) > 0.0:
        return NO_TORQUE
    slope, offset = np.polyfit(own, stated_torque, 1)
    return TorqueLine(
        float(slope), float(np.std(stated_torque - slope * own - offset) / np.std(stated_torque))
    )


def _own_torque(p: MapPoints) -> Array:
    """Return the torque (N m) of a map's fluxes for one pole pair."""
    return np.asarray(1.5 * (p.psi_d * p.i_q - p.psi_q * p.i_d))


def wild_torques(p: MapPoints) -> NDArray[np.bool_]:
    """Return which points' torque lies far from the line of all others; none where there are more
    than FEW of them: then it is the line that is in doubt.

    The line is that of least absolute deviations, which single points do not turn.
    """
    wild = np.zeros(len(p.i_d), dtype=bool)
    if p.torque is None:
        return wild
    good = np.isfinite(p.torque)
    x, y = _own_torque(p)[good], p.torque[good]
    if len(x) < 3 or not np.std(x) > 0.0:
        return wild
    columns, weight = np.column_stack([x, np.ones(len(x))]), np.ones(len(x))
    for _ in range(REWEIGHTED):
        line = np.linalg.lstsq(columns * weight[:, None], y * weight, rcond=None)[0]
        off = np.abs(y - columns @ line)
        weight = 1.0 / np.sqrt(np.maximum(off, 1e-6 * np.max(np.abs(y)) + 1e-300))
    far = off > max(LOOSE * float(np.std(columns @ line)), WILD * float(np.median(off)))
    if np.count_nonzero(far) <= max(1.0, FEW * len(x)):
        wild[good] = far
    return wild


def wild_notes(p: MapPoints, name: str) -> list[str]:
    """Return a sentence on the points whose torque is left out as wild, with their currents as the
    simulator takes them."""
    wild = wild_torques(p)
    if p.torque is None or not np.any(wild):
        return []
    good = np.isfinite(p.torque) & ~wild
    slope, offset = np.polyfit(_own_torque(p)[good], p.torque[good], 1)
    shown = [
        f"{p.torque[k]:.4g} N m at {p.where(k)}, where the fluxes give "
        f"{slope * _own_torque(p)[k] + offset:.4g}"
        for k in np.flatnonzero(wild)[:NAMED]
    ]
    count = int(np.count_nonzero(wild))
    more = f" (and {count - NAMED} more)" if count > NAMED else ""
    return [f"{name}: the column of torque has wild points: {'; '.join(shown)}{more}; {REMEDY}"]


def torque_notes(line: TorqueLine, pole_pairs: int, name: str) -> list[str]:
    """Return a sentence where a map's torque contradicts its fluxes."""
    if not math.isfinite(line.slope):
        return []
    own = "3/2 pole_pairs (psi_d i_q - psi_q i_d)"
    if line.left > LOOSE:
        return [
            f"{name}: the column of torque does not follow its fluxes: a line over {own} leaves "
            f"{100 * line.left:.0f} % of it; check which axis is which, their signs, and "
            "the magnet's axis"
        ]
    factor = line.slope / pole_pairs
    if factor > 0.0 and max(factor, 1.0 / factor) < TORQUE_OFF:
        return []
    turned = (
        ""
        if factor > 0.0
        else " with the other sign: i_q, psi_q or the torque is counted the other way;"
    )
    size = abs(factor)
    if max(size, 1.0 / size) < TORQUE_OFF:
        return [f"{name}: the column of torque is {own}{turned} turn one of them round"]
    meant = [text for value, text in MEANT if max(size / value, value / size) < SAME_FACTOR]
    pairs = size * pole_pairs
    if not meant and abs(pairs - round(pairs)) < 0.02 * pairs and round(pairs) >= 1:
        meant = [f"[motor] pole_pairs is {round(pairs)}"]
    guess = " or ".join(meant) or "check the units of currents, fluxes and torque, and pole_pairs"
    return [
        f"{name}: the column of torque is {size:.4g} times {own}{turned} {guess}".replace(
            "i_d) ", "i_d): ", 1
        )
    ]


def wild_flux_notes(p: MapPoints, name: str) -> list[str]:
    """Return a sentence where single points of a grid stand off the cubics through two neighbours
    on each side, by the same along both axes: a knee of saturation bends along one, a wild point is
    off whichever way it is come to.  The two outermost lines have no such neighbours.
    """
    grid, order = p.grid(), p.on_grid()
    if grid is None or order is None or min(order.shape) < 5:
        return []
    out = []
    inside = slice(2, -2)
    for label, psi in (("psi_d", grid.psi_d), ("psi_q", grid.psi_q)):
        along_d = _off_neighbours(grid.i_d, psi)[:, inside]
        along_q = _off_neighbours(grid.i_q, psi.T).T[inside]
        both = np.where(along_d * along_q > 0.0, np.minimum(abs(along_d), abs(along_q)), 0.0)
        alike = both > ALIKE * np.maximum(abs(along_d), abs(along_q))
        usual = float(np.median(np.maximum(abs(along_d), abs(along_q))))
        wild = alike & (both > max(WILD * usual, LEAST_WILD * float(np.ptp(psi))))
        rows = [(int(j) + 2, int(k) + 2) for j, k in np.argwhere(wild)]
        if not 0 < len(rows) <= max(1, FEW * psi.size):
            continue
        texts = [
            f"{psi[j, k]:.4g} Wb at {p.where(order[j, k])}, where its neighbours give "
            f"{psi[j, k] - along_d[j - 2, k - 2]:.4g}"
            for j, k in rows[:NAMED]
        ]
        more = f", and {len(rows) - NAMED} more" if len(rows) > NAMED else ""
        out.append(f"{name}: {label} has wild points: {'; '.join(texts)}{more}; {REMEDY}")
    return out


def off_fit_notes(energy: SplineEnergy, p: MapPoints, name: str) -> list[str]:
    """Return a sentence where single points that fill no grid stand off the fit to all of them;
    energy: of total fluxes."""
    if p.on_grid() is not None:
        return []
    off = np.sqrt(squared_errors(energy, p))
    span = math.hypot(float(np.ptp(p.psi_d)), float(np.ptp(p.psi_q)))
    wild = np.flatnonzero(off > max(WILD * float(np.median(off)), LEAST_WILD * span))
    if not 0 < len(wild) <= max(1, FEW * len(off)):
        return []
    worst = wild[np.argsort(-off[wild])]
    texts = [f"{p.where(k)}, {off[k]:.3g} Wb off the fit to all" for k in worst[:NAMED]]
    more = f", and {len(wild) - NAMED} more" if len(wild) > NAMED else ""
    return [f"{name}: wild points: {'; '.join(texts)}{more}; {REMEDY}"]


def _off_neighbours(x: Array, values: Array) -> Array:
    """Return by how much values (n, m) at x (n,) are off the cubic through two neighbours on each
    side, (n - 4, m)."""
    out = []
    for k in range(2, len(x) - 2):
        near = [k - 2, k - 1, k + 1, k + 2]
        weights = [math.prod((x[k] - x[j]) / (x[i] - x[j]) for j in near if j != i) for i in near]
        out.append(values[k] - np.tensordot(weights, values[near], 1))
    return np.array(out)


def cell_notes(p: MapPoints, choice: Choice, name: str) -> list[str]:
    """Return a sentence where a fit has more cells than there are points to hold them."""
    cells = choice[0][0] * choice[0][1]
    if cells <= len(p.i_d):
        return []
    return [
        f"{name}: {choice[0][0]} x {choice[0][1]} = {cells} cells for {len(p.i_d)} points: between "
        "its points the fit follows its own smoothness; give fewer in [flux_map], or leave cells "
        "and smooth away, and they are chosen"
    ]


def slope_notes(energy: SplineEnergy, p: MapPoints, name: str) -> list[str]:
    """Return a sentence for each axis along which a fit's inductance leaves what the map's own
    steps say.

    At a point of a grid the slope of a smooth flux lies between those of the nearest steps; what is
    SLOPE_OFF times beyond the smallest and largest of the 2 x NEAREST around it is told.  energy:
    of total fluxes.
    """
    grid = p.grid()
    if grid is None:
        return []
    out = []
    for axis, (x, psi, label) in enumerate(
        ((grid.i_d, grid.psi_d, "L_dd"), (grid.i_q, grid.psi_q, "L_qq"))
    ):
        steps = np.diff(psi, axis=axis) / np.expand_dims(np.diff(x), 1 - axis)
        low, high = _nearest(steps, axis)
        own = _inductance(energy, grid.psi_d, grid.psi_q, axis)
        least = np.maximum(low, 1e-3 * np.max(np.abs(steps)))  # a step of noise may fall
        off = np.maximum(own / np.maximum(high, least), least / own)
        k = tuple(int(n) for n in np.unravel_index(np.argmax(off), off.shape))
        if off[k] > SLOPE_OFF:
            out.append(
                f"{name}: at i_d = {grid.i_d[k[0]]:.4g} A, i_q = {grid.i_q[k[1]]:.4g} A the fit's "
                f"{label} is {1e3 * own[k]:.3g} mH, the nearest points of the map give "
                f"{1e3 * low[k]:.3g} to {1e3 * high[k]:.3g} mH: give fewer cells or more smooth in "
                "[flux_map], or leave both away"
            )
    return out


def _nearest(steps: Array, axis: int) -> tuple[Array, Array]:
    """Return the smallest and largest slope among the NEAREST steps before and after each point."""
    wide = [(NEAREST, NEAREST) if k == axis else (0, 0) for k in range(2)]
    padded = np.pad(steps, wide, mode="symmetric" if steps.shape[axis] >= NEAREST else "edge")
    n = steps.shape[axis] + 1
    around = np.stack([np.take(padded, range(k, k + n), axis=axis) for k in range(2 * NEAREST)])
    return around.min(axis=0), around.max(axis=0)


def _inductance(energy: SplineEnergy, psi_d: Array, psi_q: Array, axis: int) -> Array:
    """Return L_dd (axis 0) or L_qq (H) of a fit at fluxes (Wb)."""
    out = np.empty(psi_d.shape)
    for k in np.ndindex(psi_d.shape):
        dd, dq, qq = hessian(energy, float(psi_d[k]), float(psi_q[k]))
        out[k] = (qq if axis == 0 else dd) / (dd * qq - dq * dq)
    return out
