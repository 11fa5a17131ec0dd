"""Position error of a stretch of a run, and the theory's word on its mean."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from model.errors import PhysicsError
from model.parameters import Drive, Motor
from model.saliency import current_for_torque, local_angle, self_consistent_angle
from sandbox.drive.recording import Recording
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import torque_at_load
from sandbox.evaluation.injection_cost import InjectionCost

LOST_ANGLE = math.radians(45.0)
LOST_TIME = 0.1  # s beyond LOST_ANGLE that count as lost lock
SPEED_SHARE = 0.1  # of the speed asked for: how far the mean speed may be from it
# Their linear belief has a stationary point where the q ripple vanishes; the filter's moves with
# its model of R.
WITH_THEORY = (
    "qnull",
    "random_frequency",
    "inversion",
    "table",
    "arbitrary",
    "pwm_ripple",
    "pll3",
    "mechanical",
)


@dataclass(frozen=True)
class ErrorDeg:
    """Position error in electrical degrees; None where lock was lost (a mean over slipped poles
    says nothing)."""

    mean: float | None
    rms: float | None
    p95: float | None
    max: float | None


@dataclass(frozen=True)
class Row:
    """One evaluated segment of one run.

    speed_rpm: asked for, or imposed; true_speed_rpm: the rotor's own, the mean over the window's
    second half;
    predicted_mean_deg: for small ripple, see `predicted_mean`; reference_held: whether a speed
    asked for was reached, see `speed_held`; cost: of the injection, None where lock was lost or the
    samples cannot tell; why_lost, why_missed: one sentence where lock was lost, or a speed was not
    reached, and something simple says why.
    """

    estimator: str
    belief: str
    closed_loop: bool
    load: float
    speed_rpm: float
    error_deg: ErrorDeg
    transient_max_deg: float | None
    predicted_mean_deg: float | None
    lost_lock: bool
    reference_held: bool
    t_start: float
    t_end: float
    true_speed_rpm: float | None = None
    cost: InjectionCost | None = None
    why_lost: str | None = None
    why_missed: str | None = None


def is_lost(recording: Recording) -> bool:
    """Tell whether lock is lost: a pole slipped, or the error was beyond 45 degrees for more than
    100 ms in all.

    A slip is a change of theta - theta_hat, not wrapped, by more than half a turn; of a stretch
    shorter than 100 ms all must lie beyond.
    """
    t, beyond = recording.t, np.abs(recording.error) > LOST_ANGLE
    if t.size < 2:
        return bool(beyond.any())
    slip = np.ptp(recording.theta - recording.theta_hat) > math.pi
    return bool(slip or np.mean(beyond) * (t[-1] - t[0]) > min(LOST_TIME, 0.98 * (t[-1] - t[0])))


def error_of(recording: Recording, lost: bool = False) -> ErrorDeg:
    """Return the error statistics of a recording; p95 and max are of the error's size."""
    return statistics(np.degrees(recording.error), lost)


def statistics(e: NDArray[np.float64], lost: bool = False) -> ErrorDeg:
    """Return the statistics of position errors (degrees)."""
    if lost or e.size == 0:
        return ErrorDeg(None, None, None, None)
    size = np.abs(e)
    return ErrorDeg(float(e.mean()), float(np.sqrt(np.mean(e**2))), _p95(size), float(size.max()))


def _p95(size: NDArray[np.float64]) -> float:
    """Return np.percentile(size, 95), which takes ten times as long for a short run's samples."""
    whole, part = divmod(0.95 * (size.size - 1), 1.0)
    k = int(whole)
    if part == 0.0:
        return float(np.partition(size, k)[k])
    a, b = (float(x) for x in np.partition(size, (k, k + 1))[k : k + 2])
    return b - (b - a) * (1.0 - part) if part >= 0.5 else a + (b - a) * part


def speed_held(recording: Recording) -> bool:
    """Tell whether the mean true speed of a window's second half, when a change has died away, is
    the one asked for.

    It may be off by SPEED_SHARE of what was asked for, or else by what leaves the rotor within
    LOST_ANGLE of where the speed asked for would have taken it: an estimate in lock may wander so
    far, and so no drive
    without an encoder can be asked to hold a mean any closer.  A creep that stands still, or goes
    the wrong way, is not held.
    """
    t, true, wanted = (
        x[x.size // 2 :] for x in (recording.t, recording.omega, recording.omega_ref)
    )
    if t.size < 2:
        return True
    span = float(t[-1] - t[0]) * t.size / (t.size - 1)
    asked = float(wanted.mean())
    return abs(float(true.mean()) - asked) <= max(SPEED_SHARE * abs(asked), LOST_ANGLE / span)


def true_rpm(drive: Drive, recording: Recording) -> float | None:
    """Return the mean speed (rpm) of the rotor itself over a window's second half, None of an empty
    one."""
    true = recording.omega[recording.t.size // 2 :]
    return float(true.mean()) * 30.0 / (math.pi * drive.motor.pole_pairs) if true.size else None


def settled_part(recording: Recording, rows: tuple[Row, ...]) -> Recording:
    """Return the samples that lie in any of the rows' windows."""
    t = recording.t
    inside = np.zeros(t.size, dtype=bool)
    for row in rows:
        inside |= (t >= row.t_start - 1e-9) & (t < row.t_end - 1e-9)
    return Recording(recording.table[inside])


def rows_of(
    drive: Drive,
    scenario: Scenario,
    recording: Recording,
    start_time: float,
    estimator: str,
    belief: str,
    closed: bool,
) -> tuple[Row, ...]:
    """Return one row for each scored segment."""
    rows: list[Row] = []
    t = start_time
    for s in scenario.segments:
        begin, end = t + scenario.settle_of(s), t + s.duration
        if s.score:
            whole, settled = recording.between(t, end), recording.between(begin, end)
            lost = is_lost(whole)
            predicted = (
                predicted_mean(drive, scenario, s, closed) if estimator in WITH_THEORY else None
            )
            if belief == "saturated" and estimator in WITH_THEORY:
                predicted = 0.0
            load, speed_rpm = s.load, s.speed * drive.motor.rated_speed_rpm
            error, most = error_of(settled, lost), error_of(whole, lost).max
            held = scenario.reference != "speed" or speed_held(settled)
            row = Row(
                estimator,
                belief,
                closed,
                load,
                speed_rpm,
                error,
                most,
                predicted,
                lost,
                held,
                begin,
                end,
                true_rpm(drive, settled),
            )
            rows.append(row)
        t = end
    return tuple(rows)


def predicted_mean(
    drive: Drive, scenario: Scenario, segment: Segment, closed: bool
) -> float | None:
    """Return the theory's mean error (degrees) of a linear belief; None where no lock exists.

    Open (encoder controls): local formula at the reference current.  Closed: self-consistent
    solution.  Under speed control the current is the one that carries load and viscous friction at
    that error.
    """
    angle = _predicted(
        drive.motor,
        torque_at_load(drive, segment.load),
        segment.load,
        segment.current_d,
        segment.speed,
        scenario.reference == "speed",
        closed,
    )
    return None if math.isnan(angle) else math.degrees(angle)


@cache
def _predicted(
    motor: Motor,
    torque: float,
    load: float,
    load_d: float,
    speed: float,
    by_torque: bool,
    closed: bool,
) -> float:
    if by_torque:
        torque += motor.viscous_friction * speed * motor.rated_omega / motor.pole_pairs
        try:
            return current_for_torque(motor, torque, closed)[1]
        except PhysicsError:
            return math.nan
    i_d, i_q = load_d * motor.rated_current, load * motor.rated_current
    if closed:
        return self_consistent_angle(motor.energy, i_d, i_q)
    return float(local_angle(motor.energy, i_d, i_q))
