"""What the exact fit expects of the levels: its unknowns by name, and the residuals that they
leave.

Every level is predicted through the periodic solution of `model.ripple`, read as the bench reads
it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.compiled import kernel
from model.energy import Energy
from model.frames import rotate
from model.levels import NAMES, NONE, Levels
from model.ripple import periodic, slopes

MOTOR = len(NAMES)  # unknowns of the motor, before those of the bench


class MotorUnknowns(NamedTuple):
    """The motor's own unknowns, in the order of NAMES."""

    resistance: float  # ohm
    inductance_d: float  # H
    inductance_q: float  # H
    alphas: Array  # (5,) A/Wb^2, A/Wb^3

    @classmethod
    def of(cls, unknowns: Array) -> MotorUnknowns:
        """Return the motor's part of all unknowns."""
        resistance, inductance_d, inductance_q, *alphas = unknowns[:MOTOR]
        return cls(resistance, inductance_d, inductance_q, np.array(alphas))

    @property
    def energy(self) -> Energy:
        """The magnetic model."""
        return Energy(1 / self.inductance_d, 1 / self.inductance_q, *self.alphas)


class BenchUnknowns(NamedTuple):
    """What stands between motor and readings: the unknowns after the motor's own, in this order."""

    voltage_threshold: float  # V, of the inverter's error
    gain_a: float  # of a current sensor, less 1
    gain_b: float
    gain_c: float
    offset_a: float  # A
    offset_b: float
    width: float  # logarithm: of the zone of the inverter's error over the usual one
    delay: float  # s
    angles: Array  # rad, error of each lock angle

    @classmethod
    def of(cls, unknowns: NDArray[Any]) -> BenchUnknowns:
        """Return the bench's part of all unknowns, or of what belongs to each (free or not)."""
        angles = MOTOR + len(cls._fields) - 1
        return cls._make([*unknowns[MOTOR:angles].tolist(), unknowns[angles:]])


class _Chain(NamedTuple):
    """Inverter and sensors as the kernel takes them."""

    threshold: float  # V
    width: float  # A
    delay: float  # s
    gain: Array  # (2, 2) alpha-beta
    offset: Array  # (2,) A alpha-beta
    error: Array  # (n,) rad, of each level's lock angle


class _Tests(NamedTuple):
    """Levels as the kernel takes them: what was done at each, see `model.levels.Levels`."""

    theta: Array
    waveform: Array
    flux: Array
    current: Array
    period: float


@kernel
def _predict(m, resistance, chain, tests, voltage, slope):
    """Fill in mean voltage (V) and slopes (1/H), (n, 2) along d, q, as the bench reads them; return
    0 if solved."""
    n, samples = tests.flux.shape
    gain, offset = chain.gain, chain.offset
    v = np.empty((samples, 2))
    ripple = np.empty((samples, 2))
    for k in range(n):
        theta, error = tests.theta[k], chain.error[k]
        angle = theta + error
        # undo the sensors: true mean current
        a, b = rotate(tests.current[k, 0], tests.current[k, 1], theta)
        a, b = a - offset[0], b - offset[1]
        det = gain[0, 0] * gain[1, 1] - gain[0, 1] * gain[1, 0]
        x = (gain[1, 1] * a - gain[0, 1] * b) / det
        y = (gain[0, 0] * b - gain[1, 0] * a) / det
        i_d, i_q = rotate(x, y, -angle)
        for j in range(samples):
            v[j, 0], v[j, 1] = rotate(tests.waveform[k, j, 0], tests.waveform[k, j, 1], -error)
        u_d, u_q, status = periodic(
            m,
            resistance,
            chain.threshold,
            chain.width,
            angle,
            v,
            tests.period,
            chain.delay,
            i_d,
            i_q,
            ripple,
        )
        if status == 1:
            return 1
        for j in range(samples):
            a, b = rotate(ripple[j, 0], ripple[j, 1], angle)
            x, y = gain[0, 0] * a + gain[0, 1] * b, gain[1, 0] * a + gain[1, 1] * b
            ripple[j, 0], ripple[j, 1] = rotate(x, y, -theta)
        voltage[k, 0], voltage[k, 1] = rotate(u_d, u_q, error)
        slope[k, 0], slope[k, 1] = slopes(ripple, tests.flux[k])
    return 0


def sensor_gain(a: float, b: float, c: float) -> Array:
    """Return the 2x2 alpha-beta matrix of phase gains 1 + a, 1 + b, 1 + c."""
    s = math.sqrt(3.0)
    return np.array(
        [[1 + (4 * a + b + c) / 6, (c - b) * s / 6], [(c - b) / (2 * s), 1 + (b + c) / 2]]
    )


@dataclass(frozen=True)
class Problem:
    """Residuals of the exact fit as a function of the scaled unknowns (1 = start value, or prior
    sd)."""

    levels: Levels
    scale: Array
    locks: NDArray[np.int64]  # (n,) which lock angle a level belongs to
    prior: Array  # sd of the unknowns after the motor's own, inf where free
    width: float  # A
    # of the standard deviations of voltages and of slopes
    inflate: tuple[float, float] = (1.0, 1.0)

    def residuals(self, x: Array) -> Array | None:
        """Return the weighted residuals, None where a level lies outside the model's valid
        domain."""
        lv, unknowns = self.levels, x * self.scale
        motor, bench = MotorUnknowns.of(unknowns), BenchUnknowns.of(unknowns)
        if motor.resistance <= 0 or motor.inductance_d <= 0 or motor.inductance_q <= 0:
            return None
        voltage, slope = np.empty((len(lv.axis), 2)), np.empty((len(lv.axis), 2))
        tests = _Tests(lv.theta, lv.waveform, lv.flux, lv.current, lv.period)
        if _predict(motor.energy, motor.resistance, self.chain(bench), tests, voltage, slope):
            return None
        bias = (lv.voltage - voltage) / (lv.voltage_sd * self.inflate[0])
        rows = lv.axis != NONE
        ripple = ((lv.slope - slope) / (lv.slope_sd * self.inflate[1]))[rows]
        finite = np.isfinite(self.prior)
        return np.concatenate(
            [bias.ravel(), ripple.ravel(), unknowns[MOTOR:][finite] / self.prior[finite]]
        )

    def chain(self, bench: BenchUnknowns) -> _Chain:
        """Return inverter and sensors with a bench's unknowns."""
        gain = sensor_gain(bench.gain_a, bench.gain_b, bench.gain_c)
        offset = np.array([bench.offset_a, (bench.offset_a + 2 * bench.offset_b) / math.sqrt(3.0)])
        width = self.width * math.exp(min(max(bench.width, -5.0), 5.0))
        error = np.ascontiguousarray(bench.angles[self.locks])
        return _Chain(bench.voltage_threshold, width, bench.delay, gain, offset, error)

    def parted(self, r: Array) -> tuple[Array, Array]:
        """Return what residuals say of the voltages, and of the slopes."""
        voltages, injected = self.levels.voltage.size, int((self.levels.axis != NONE).sum())
        return r[:voltages], r[voltages : voltages + 2 * injected]
