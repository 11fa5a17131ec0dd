"""How far a flux map, and the fit to it, can be believed.

A machine that looks the same in both directions has psi_d even and psi_q odd in i_q.  Polynomials
with and without that symmetry tell how far a map breaks it, and at which angle it would break it
least.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from model.map_fit import held_out
from model.map_points import MapPoints
from model.spline_energy import Choice

DEGREE = 6  # of the polynomials that tell the asymmetry
FARTHEST = math.radians(15.0)  # angle that is looked for
ONE_SIDED = 0.25  # of the range of i_q: less on one side tells no asymmetry
TELLING = 1.4  # times the asymmetry must fall for an angle to be proposed
SAME = 1e-5  # of the largest flux: a map is written with that many digits, or was made symmetric
# of the range of i_d: less than that beyond 0 leaves no room for the polarity test
NO_STARTING = 0.02


@dataclass(frozen=True)
class Quality:
    """How far a map can be believed.

    points: with a value; largest: Wb, its largest flux; held_out, held_out_edge: Wb rms of the fit
    in use on points that it has not seen, inside the map and on its edge (None: no fit to the rest
    is found); asymmetry: Wb rms between +i_q and -i_q (None: the map has one sign only); angle: rad
    that would explain most of it (None: none does); asymmetry_turned: what that would leave.
    """

    points: int
    largest: float
    held_out: float | None
    held_out_edge: float | None
    asymmetry: float | None
    angle: float | None
    asymmetry_turned: float | None
    notes: tuple[str, ...]

    def sentences(self) -> list[str]:
        """Return what a person should know."""
        out = list(self.notes)
        if self.held_out is not None and self.held_out_edge is not None:
            out.append(
                f"fit of the map: {self._of_largest(self.held_out)} rms on points held out inside "
                f"it, {self._of_largest(self.held_out_edge)} rms on its edge, of {self.points} "
                f"points; 100 % is the largest flux, {1e3 * self.largest:.3g} mWb"
            )
        if self.asymmetry is not None:
            same = self.asymmetry < SAME * self.largest
            out.append(
                "+i_q and -i_q are the same"
                if same
                else f"+i_q and -i_q differ by {self._of_largest(self.asymmetry)} rms"
            )
        if self.angle is not None and self.asymmetry_turned is not None:
            out.append(
                f"an angle offset of {math.degrees(self.angle):.2f} degrees explains that but for "
                f"{1e3 * self.asymmetry_turned:.3g} mWb: try angle = {self.angle:.4f} "
                "more in [flux_map]"
            )
        return out

    def _of_largest(self, flux: float) -> str:
        """Return a flux (Wb) with its share of the largest."""
        return f"{1e3 * flux:.3g} mWb ({100.0 * flux / self.largest:.2g} %)"


def quality(p: MapPoints, choice: Choice = ((10, 8), 1e-3)) -> Quality:
    """Return how far a map can be believed; choice: cells and smoothness of the fit in use."""
    notes = list(p.notes)
    span = float(np.ptp(p.i_d))
    if float(np.max(p.i_d)) < NO_STARTING * span:
        notes.append(
            f"{p.name}: the map ends at i_d = {float(np.max(p.i_d)):.3g} A, so the polarity test "
            "of starting up leaves it; give start_up = false in the scenario"
        )
    missed, largest = held_out(p, *choice), float(np.max(np.hypot(p.psi_d, p.psi_q)))
    inside, edge = (x if math.isfinite(x) else None for x in missed)
    if min(-float(np.min(p.i_q)), float(np.max(p.i_q))) < ONE_SIDED * float(np.ptp(p.i_q)):
        return Quality(len(p.i_d), largest, inside, edge, None, None, None, tuple(notes))
    now, angle = asymmetry(p), best_angle(p)
    after = asymmetry(p, angle)
    is_clear = (
        now > TELLING * after and abs(angle) > math.radians(0.2) and abs(angle) < 0.99 * FARTHEST
    )
    turned = angle if is_clear else None
    return Quality(len(p.i_d), largest, inside, edge, now, turned, after, tuple(notes))


def asymmetry(p: MapPoints, angle: float = 0.0) -> float:
    """Return the rms (Wb) by which a map, turned by an angle, differs between +i_q and -i_q."""
    t = p.turned(angle)
    scale = float(np.max(np.hypot(t.i_d, t.i_q)))
    x, y = t.i_d / scale, t.i_q / scale
    powers = [(a, b) for a in range(DEGREE + 1) for b in range(DEGREE + 1 - a)]
    columns = np.stack([x**a * y**b for a, b in powers], axis=1)
    odd = np.array([b % 2 == 1 for _, b in powers])
    found = np.linalg.lstsq(columns, np.stack([t.psi_d, t.psi_q], axis=1), rcond=1e-10)[0]
    wrong = (columns[:, odd] @ found[odd, 0], columns[:, ~odd] @ found[~odd, 1])
    return math.sqrt(sum(float(np.mean(x**2)) for x in wrong))


def best_angle(p: MapPoints) -> float:
    """Return the angle (rad) by which a map, turned, is least different between +i_q and -i_q."""
    angles = np.linspace(-FARTHEST, FARTHEST, 31)
    k = int(np.argmin([asymmetry(p, a) for a in angles]))
    low, high = angles[max(k - 1, 0)], angles[min(k + 1, len(angles) - 1)]
    for _ in range(24):  # thirds of an interval in which there is one minimum
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        low, high = (low, b) if asymmetry(p, a) < asymmetry(p, b) else (a, high)
    return float(0.5 * (low + high))
