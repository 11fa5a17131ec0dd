"""What currents are read wrongly by, in amperes: the sensors' part of a gap as it is, not as a
voltage.

An error of a reading is no voltage: told as one, a constant offset would grow with speed and
inductance.  So it is told by its size, by how much of it is constant in each phase, and by where in
speed and current it is larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from model.array_types import Array
from sandbox.gap.words import amperes
from sandbox.replay.replay import Residual

PHASES = "abc"
MOSTLY = 0.5  # share from which a part is most of the whole


@dataclass(frozen=True)
class Readings:
    """Errors of the measured currents: rms of a phase (A, noise taken off), its mean in each phase
    (A) and the share of its squares that each mean has; amplitude (4, 4): rms (A) by speed and
    current, NaN where nothing was recorded."""

    rms: float
    means: dict[str, float]
    constant: dict[str, float]
    amplitude: Array


def readings(shown: Sequence[Residual], noise_std: float, amplitude: Array) -> Readings:
    """Return the errors of readings from residuals in units of the noise (its standard deviation in
    A); amplitude: rms in those units, as in `Readings`."""
    x = np.concatenate([r.current[:, :, 0] for r in shown])
    squares = max(float(np.sum(x**2 - 1.0)), 0.0)
    means = x.mean(axis=0)
    excess = np.maximum(len(x) * means**2 - 1.0, 0.0)  # a mean of noise alone has 1
    share = np.minimum(excess / squares, 1.0) if squares > 0.0 else np.zeros(3)
    return Readings(
        noise_std * float(np.sqrt(squares / x.size)),
        _by_phase(noise_std * means),
        _by_phase(share),
        noise_std * amplitude,
    )


def described(r: Readings) -> str:
    """Return what the measured currents are wrong by, as a clause."""
    share = sum(r.constant.values())
    text = f"an error of the measured currents, {amperes(r.rms)} rms a phase"
    if share <= MOSTLY:
        return text
    means = ", ".join(f"{amperes(m, sign=True)} in {p}" for p, m in r.means.items())
    return f"{text}; {100.0 * min(share, 1.0):.0f} % of it is constant ({means})"


def _by_phase(values: Array) -> dict[str, float]:
    return dict(zip(PHASES, map(float, values), strict=True))
