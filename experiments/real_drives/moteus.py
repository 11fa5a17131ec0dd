"""moteus: dead time and device drop from steady running at several d-currents (data set
`moteus_ld`).

The drive turned freely at commanded (v_d, v_q) and stored y = v_q - R i_q against the electrical
speed.  With L_d(i_d) i_d + magnet flux as slope, what the inverter swallows is the intercept: a
voltage V along the current,

    y = omega (phi_m + L_d i_d) + V i_q / |i| + offset,

so it stands in y at i_d = 0 and turns into the d axis, out of y, as soon as |i_d| >> i_q.  Not
recorded: i_q, the DC link, the PWM frequency, v_d.  An error of R shows as a constant (Delta R)
i_q, which `offset` absorbs: R itself cannot be told from these files.  The drive's own dead-time
compensation, if any, is already inside.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.real_drives.fitted import Fitted, interval
from model.errors import BadInput

# A, assumed: what motors of this size take turning freely
NO_LOAD_CURRENT = np.geomspace(0.05, 3.0, 60)


@dataclass(frozen=True)
class Sweep:
    """One motor's file: per level of d-current (A) the speeds (rad/s electrical) and y = v_q - R
    i_q (V)."""

    name: str
    pole_pairs: int
    resistance: float
    i_d: np.ndarray
    omega: tuple[np.ndarray, ...]
    y: tuple[np.ndarray, ...]
    own_flux: float
    own_inductance: float


@dataclass(frozen=True)
class Intercepts:
    """Straight lines through each level: slope (Wb), intercept and its standard error (V)."""

    i_d: np.ndarray
    slope: np.ndarray
    intercept: np.ndarray
    error: np.ndarray
    freedom: int


@dataclass(frozen=True)
class InverterDrop:
    """Voltage along the current, the offset, the q-current of the roll-off (best, largest allowed),
    held-out errors."""

    voltage: Fitted
    offset: Fitted
    current_q: float
    current_q_below: float
    held_out_with: float
    held_out_without: float

    def model(self, i_d: np.ndarray) -> np.ndarray:
        """Return the intercept (V) at d-currents (A)."""
        return (
            self.voltage.value * self.current_q / np.hypot(self.current_q, i_d) + self.offset.value
        )


def read(path: Path) -> Sweep:
    """Return a moteus file's content; BadInput where a key is missing."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        levels = sorted(data["raw"].items(), key=lambda item: -float(item[0]))
        return Sweep(
            path.stem.removeprefix("ld_"),
            int(data["params"]["poles"]) // 2,
            float(data["params"]["R"]),
            np.array([float(key) for key, _ in levels]),
            tuple(np.array([point["omega"] for point in points], float) for _, points in levels),
            tuple(np.array([point["y"] for point in points], float) for _, points in levels),
            float(data["fit"]["lambda_m"]),
            float(data["fit"]["B"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"file '{path}' is no moteus sweep ({error!r}); see the data set 'moteus_ld'"
        ) from None


def intercepts(sweep: Sweep) -> Intercepts:
    """Return the line through each level; the errors pool the residuals of all levels."""
    lines, spreads, freedom, squares = [], [], 0, 0.0
    for omega, y in zip(sweep.omega, sweep.y, strict=True):
        design = np.c_[np.ones_like(omega), omega]
        line = np.linalg.lstsq(design, y, rcond=None)[0]
        squares += float(np.sum((y - design @ line) ** 2))
        freedom += len(y) - 2
        lines.append(line)
        spreads.append(math.sqrt(np.linalg.inv(design.T @ design)[0, 0]))
    sigma = math.sqrt(squares / freedom)
    table = np.array(lines)
    return Intercepts(sweep.i_d, table[:, 1], table[:, 0], sigma * np.array(spreads), freedom)


def inverter_drop(lines: Intercepts) -> InverterDrop:
    """Return the drop that explains a sweep's intercepts; levels other than i_d = 0 are left out in
    turn to predict."""
    everything = np.ones(len(lines.i_d), bool)
    fits = [_fit(lines, everything, i_q) for i_q in NO_LOAD_CURRENT]
    costs = np.array([cost for _, _, cost in fits])
    best, freedom = int(np.argmin(costs)), len(lines.i_d) - 3
    # misfit beyond the lines' own scatter widens the intervals
    scale = max(1.0, costs[best] / freedom)
    allowed = np.flatnonzero(costs <= costs[best] + 3.84 * scale)
    basis = (
        "scatter of the lines' intercepts, widened by misfit; every q-current allowed by the "
        "roll-off"
    )
    bounds = []
    for which in (0, 1):
        parts = [
            interval(fits[k][0][which], math.sqrt(scale) * fits[k][1][which], freedom, "V", "")
            for k in allowed
        ]
        low, high = min(part.low for part in parts), max(part.high for part in parts)
        bounds.append(Fitted(float(fits[best][0][which]), low, high, "V", basis))
    with_drop, without = [], []
    for k in np.flatnonzero(lines.i_d != 0.0):
        kept = np.arange(len(lines.i_d)) != k
        i_q, (voltage, offset) = _best(lines, kept)
        with_drop.append(
            lines.intercept[k] - voltage * i_q / math.hypot(i_q, lines.i_d[k]) - offset
        )
        without.append(
            lines.intercept[k] - np.average(lines.intercept[kept], weights=lines.error[kept] ** -2)
        )
    i_q, below = float(NO_LOAD_CURRENT[best]), float(NO_LOAD_CURRENT[allowed[-1]])
    return InverterDrop(bounds[0], bounds[1], i_q, below, _rms(with_drop), _rms(without))


def dead_time(voltage: float, dc_link: float, pwm_frequency: float) -> float:
    """Return the dead time (s) whose fundamental, 4/pi u_dc f T along the current, is `voltage`
    (V)."""
    return math.pi / 4.0 * voltage / (dc_link * pwm_frequency)


def _fit(lines: Intercepts, kept: np.ndarray, i_q: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return ((voltage, offset), their standard errors, chi squared) at an assumed q-current."""
    weight = 1.0 / lines.error[kept]
    design = np.c_[i_q / np.hypot(i_q, lines.i_d[kept]), np.ones(kept.sum())] * weight[:, None]
    covariance = np.linalg.inv(design.T @ design)
    target = lines.intercept[kept] * weight
    values = covariance @ design.T @ target
    return values, np.sqrt(np.diag(covariance)), float(np.sum((target - design @ values) ** 2))


def _rms(errors: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def _best(lines: Intercepts, kept: np.ndarray) -> tuple[float, np.ndarray]:
    fits = [(_fit(lines, kept, i_q), i_q) for i_q in NO_LOAD_CURRENT]
    (values, _, _), i_q = min(fits, key=lambda item: item[0][2])
    return float(i_q), values
