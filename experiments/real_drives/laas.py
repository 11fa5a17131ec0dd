"""LAAS motor: cogging, friction and inertia from three kinds of runs (data set `laas_bldc`).

Angles are the encoder's (mechanical rad, its zero is arbitrary), currents are i_q as the drive
reports it, A.
The torque constant K is not measured: K = 1.5 × (back-EMF per mechanical rad/s), if the drive's
currents and voltages are peak values (its firmware says 300 rpm/V, which is the same back-EMF, and
12 pole pairs).

    K i_q = J domega/dt + T_c tanh(omega / width) + B omega      (current sine: inertia, friction)
    K i_q = cogging(theta) ± T_hold                              (slow scan up and down; sign of the direction)

An order that is a multiple of 12 (electrical 1, 2, 3, 6) in i_q may also be a fault of the current
sensors; order 18 (the slots) cannot.  Cogging of 18 slots and 24 poles comes at their least common
multiple, 72.
"""  # noqa: E501

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from experiments.real_drives.fitted import Fitted, jackknife
from model.errors import BadInput

POLE_PAIRS = 12
WIDTH = 2.0  # rad/s, of the Coulomb friction's tanh: chosen, these runs cannot tell it
ORDERS = (12, 18, 24, 36, 48, 54, 72, 90)
COLUMNS = {
    "Time": "time",
    "Position": "position",
    "Velocity": "speed",
    "Iq": "current",
    "Uq": "voltage",
}


@dataclass(frozen=True)
class Run:
    """One file: time (s), position (rad), speed (rad/s), current (A) and, where recorded, voltage
    (V), else zeros."""

    time: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    current: np.ndarray
    voltage: np.ndarray


@dataclass(frozen=True)
class Friction:
    """Torque constant, inertia and friction, with the smoothed samples (speed, current, its
    inertial part)."""

    torque_constant: Fitted
    inertia: Fitted
    coulomb: Fitted
    viscous: Fitted
    speed: np.ndarray
    current: np.ndarray
    inertial: np.ndarray
    steady: tuple[float, float, float]

    def current_at(self, speed: np.ndarray) -> np.ndarray:
        """Return the current (A) that friction takes at steady speeds (rad/s)."""
        torque = self.coulomb.value * np.tanh(speed / WIDTH) + self.viscous.value * speed
        return torque / self.torque_constant.value


def read(path: Path) -> Run:
    """Return a LAAS text file's columns by name; BadInput where one is missing."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        header = [name.strip() for name in lines[0].split(",")]
        table = np.array([line.split(",") for line in lines[1:]], dtype=float)
        columns = {
            field: table[:, header.index(name)] for name, field in COLUMNS.items() if name in header
        }
        return Run(**{"voltage": np.zeros(len(table)), **columns})
    except (OSError, ValueError, IndexError, TypeError) as error:
        raise BadInput(
            f"file '{path}' is no LAAS run ({error}); see the data set 'laas_bldc'"
        ) from None


def harmonics(angle: np.ndarray, orders: tuple[int, ...] = ORDERS) -> np.ndarray:
    """Return columns cos, sin of each order (samples, 2 × orders)."""
    return np.hstack([np.c_[np.cos(k * angle), np.sin(k * angle)] for k in orders])


def scan_halves(run: Run) -> tuple[Run, Run]:
    """Return the up-going and the down-going half of a slow scan."""
    turn = int(np.argmax(run.position))
    fields = ("time", "position", "speed", "current", "voltage")
    up, down = (
        {f: getattr(run, f)[part] for f in fields} for part in (slice(0, turn), slice(turn, None))
    )
    return Run(**up), Run(**down)


def cogging(run: Run, orders: tuple[int, ...] = ORDERS) -> tuple[np.ndarray, np.ndarray]:
    """Return (coefficients, standard errors) of mean and cos, sin of each order in the current (A)
    of one half.

    The errors leave out one twenty-fourth of a turn at a time.
    """
    design = np.c_[np.ones(len(run.position)), harmonics(run.position, orders)]

    def fit(mask: np.ndarray) -> np.ndarray:
        """Return mean and harmonics (A) fitted to the positions of a mask."""
        return np.linalg.lstsq(design[mask], run.current[mask], rcond=None)[0]

    return jackknife(fit, np.floor(run.position / (2.0 * np.pi / 24)).astype(int))


def amplitudes(coefficients: np.ndarray) -> np.ndarray:
    """Return the amplitude of each order from coefficients that begin with the mean."""
    return np.hypot(coefficients[1::2], coefficients[2::2])


def friction(
    run: Run, above: float = 30.0, cutoff: float = 25.0, predict_at: float = 50.7
) -> Friction:
    """Return inertia and friction from a run whose current is a slow sine; all signals are
    low-passed alike (Hz).

    Only speeds above `above` (rad/s) count: below, cogging and the low-pass hide the friction's
    shape.  The jackknife (two seconds at a time) is far too narrow here, so the intervals are the
    range over what was chosen: `above` 20 to 50 rad/s, `cutoff` 15 to 40 Hz, current delayed by 0
    to 2 ms (delay and viscous friction look alike under a sine). `steady` is the current (A)
    predicted at `predict_at` (rad/s): value and range.
    """
    choices = [(a, f, d) for a in (20.0, 30.0, 50.0) for f in (15.0, 25.0, 40.0) for d in (0, 1, 2)]
    values, _, samples = _friction(run, above, cutoff, 0)
    others = [_friction(run, *choice) for choice in choices]
    low = np.min([v - 2.0 * e for v, e, _ in others], axis=0)
    high = np.max([v + 2.0 * e for v, e, _ in others], axis=0)
    basis = "range over speeds, filter and delay chosen, widened by the jackknife over 2 s blocks"
    units = ("N m/A", "kg m^2", "N m", "N m s/rad")
    values, low, high = (_with_steady(x, predict_at) for x in (values, low, high))
    steady = [_with_steady(v, predict_at)[-1] for v, _, _ in others]
    constant, inertia, coulomb, viscous = (
        Fitted(float(values[k]), float(low[k]), float(high[k]), unit, basis)
        for k, unit in enumerate(units)
    )
    speed, current, acceleration = samples
    inertial = inertia.value / constant.value * acceleration
    predicted = (float(values[-1]), float(min(steady)), float(max(steady)))
    return Friction(constant, inertia, coulomb, viscous, speed, current, inertial, predicted)


def speed_ripple(run: Run, order: int, cutoff: float = 200.0) -> float:
    """Return the acceleration's amplitude (rad/s^2) at a mechanical order while rolling at steady
    speed.

    The drive low-passes its speed (first order, 200 Hz in its firmware), which is undone here.
    """
    orders = tuple(sorted({1, 2, 12, 18, 24, 36, order}))
    time = run.time - run.time.mean()
    found = np.linalg.lstsq(
        np.c_[np.vander(time, 3), harmonics(run.position, orders)], run.speed, rcond=None
    )[0][3:]
    place = 2 * orders.index(order)
    omega = order * float(np.mean(run.speed))
    lag = np.hypot(1.0, omega / (2.0 * np.pi * cutoff))
    return float(np.hypot(found[place], found[place + 1]) * omega * lag)


def _with_steady(x: np.ndarray, speed: float) -> np.ndarray:
    """Append the steady current (A) at a speed to (K, J, T_c, B)."""
    constant, _, dry, viscous = x
    return np.r_[x, (dry + viscous * speed) / constant]


def _friction(
    run: Run, above: float, cutoff: float, delay: int
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return (K, J, T_c, B), jackknife errors, and (speed, current, acceleration) for one set of
    choices."""
    step = 1e-3
    time = np.arange(run.time[0], run.time[-1], step)  # the file's own steps are 1 ms with jitter
    low_pass = butter(4, cutoff, fs=1.0 / step, output="sos")
    smooth = [
        sosfiltfilt(low_pass, np.interp(time, run.time, x))
        for x in (run.position, run.current, run.voltage)
    ]
    speed = np.gradient(smooth[0], step)
    acceleration = np.gradient(speed, step)
    inner = slice(300, -300)  # the filter's ends
    current, voltage = np.roll(smooth[1], delay)[inner], smooth[2][inner]
    speed, acceleration = speed[inner], acceleration[inner]
    ones = np.ones_like(speed)
    motion = np.c_[acceleration, np.tanh(speed / WIDTH), speed, ones]
    fast = np.abs(speed) > above
    electric = np.c_[speed, current, ones]

    def fit(mask: np.ndarray) -> np.ndarray:
        """Return K, J, T_c and B of a mask (SI units); friction and inertia from its fast samples
        only."""
        k = 1.5 * np.linalg.lstsq(electric[mask], voltage[mask], rcond=None)[0][0]
        return np.r_[
            k, k * np.linalg.lstsq(motion[mask & fast], current[mask & fast], rcond=None)[0][:3]
        ]

    values, errors = jackknife(fit, np.arange(len(speed)) // 2000)
    return values, errors, (speed, current, acceleration)
