"""Operating cycles: what twelve recordings ask of a drive, sample by sample.

Two styles that share no pattern: `practice` follows the practice recordings (staircases upwards,
steps along the axes, speed steps), `scored` walks otherwise (levels in random order, vectors in
random directions, ramps and sines).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model.array_types import Array
from model.parameters import Drive
from sandbox.gap.planning.menu import FULL_RATE

KIND, FIRST, SECOND, LOAD = range(4)  # columns of `plan`
# what `plan` asks for: u_d, u_q; i_d, i_q; electrical speed, -
VOLTAGE, CURRENT, SPEED = 0.0, 1.0, 2.0


@dataclass(frozen=True)
class Cycle:
    """One recording as asked for.

    plan: (n, 4) kind, two references (V, A or rad/s electrical), load torque (N m); speed: (n,)
    rad/s electrical, imposed on a driven rotor.
    """

    file: str
    rotor: str
    injection_axis: str
    plan: Array
    speed: Array


@dataclass(frozen=True)
class Scale:
    """What a drive can do: samples a second (of a cycle's time), rated current and torque, usable
    speed, resistance."""

    rate: float
    current: float
    torque: float
    speed: float
    idle_speed: float
    resistance: float

    def samples(self, seconds: float) -> int:
        """Return the samples of so many seconds."""
        return round(self.rate * seconds)


def scale_of(drive: Drive, share: float = 1.0) -> Scale:
    """Return the scales of a drive; share: of the usual length."""
    motor, limit = drive.motor, 0.85 * drive.converter.voltage_limit
    rate = min(1.0 / drive.converter.sampling_period, FULL_RATE) * share
    loaded = limit / (motor.magnet_flux + motor.inductance_q * motor.rated_current)
    idle = min(0.8 * motor.rated_omega, limit / motor.magnet_flux)
    speed = min(0.8 * motor.rated_omega, loaded)
    return Scale(rate, motor.rated_current, motor.rated_torque, speed, idle, motor.resistance)


def held(n: int, levels: Array) -> Array:
    """Return n samples of levels (m, ...) held for equal times."""
    levels = np.asarray(levels, dtype=float)
    return np.asarray(levels[np.minimum(np.arange(n) * len(levels) // n, len(levels) - 1)])


def between(n: int, times: Array, values: Array) -> Array:
    """Return n samples of straight lines through (times in shares of the whole, values)."""
    return np.interp(np.arange(n) / n, times, values)


def cycle(
    file: str,
    rotor: str,
    axis: str,
    kind: float | Array,
    *references: float | Array,
    load: float | Array = 0.0,
    speed: float | Array = 0.0,
) -> Cycle:
    """Return a cycle from its columns, scalars spread over all samples; references: the first one a
    column, the second one 0 where it is left out."""
    first, second = (*references, 0.0)[:2]
    n = np.size(first)
    columns = [
        np.broadcast_to(np.asarray(c, dtype=float), (n,)) for c in (kind, first, second, load)
    ]
    return Cycle(
        file,
        rotor,
        axis,
        np.stack(columns, axis=1),
        np.array(np.broadcast_to(speed, (n,)), dtype=float),
    )
