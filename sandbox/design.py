"""Gains from margins: current loop, tracking loop and speed loop, designed with python-control.

Each loop is written down as the sampled loop that the kernel runs (one-period computing delay, held voltage,
average over an injection period) and its one free bandwidth is the largest that keeps the phase margin asked for.
`control` takes 1.5 s to import, so finished designs are kept on disk under a hash of everything they depend on.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.contract import Belief, Tuning
from model.compiled import cache_home
from model.energy import Energy, flux_newton, hessian, min_eigenvalue
from model.parameters import Drive
from sandbox.control import Control
from sandbox.injection import carrier, samples_per_period

PHASE_MARGIN = 60.0  # degrees, of every loop at its worst point
DAMPING = 1.0  # tracking loop: kp = 2 DAMPING w0, ki = w0^2
INTEGRAL_SPLIT = 5.0  # speed loop: integral action this far below the bandwidth
SETTLE_TIMES = 8.0  # starting up waits this many time constants of the current loop
AVERAGE_TIME = 0.016  # s of ripple averaged in each step of starting up
VOLTAGE_UNCERTAINTY = 0.0025  # of the DC bus, one sigma: what a compensated inverter leaves (EKF)
CURRENT_MARGIN = 1.25  # current limit over the largest load asked for

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Loop:
    """One loop as designed: bandwidth (rad/s), gains, and margins at its worst point."""

    bandwidth: float
    kp: float
    ki: float
    phase_margin_deg: float
    gain_margin: float
    disk_margin: float
    crossover: float


@dataclass(frozen=True)
class Design:
    """Gains of one drive: what the kernel needs, and the loops they come from."""

    control: Control
    tuning: Tuning
    loops: dict[str, Loop]


def belief_of(drive: Drive, name: str) -> Belief:
    """Return the saturated or the linear belief about a drive's motor."""
    motor = drive.motor
    energy = motor.energy if name == "saturated" else motor.linear_energy
    return Belief(energy, motor.magnet_flux, motor.resistance, float(motor.pole_pairs))


def smallest_inductance(m: Energy, radius: float) -> float:
    """Return the smallest incremental inductance (H) within a circle of currents (A), as far as the model is valid."""
    least = 1.0 / max(m.gamma_d, m.gamma_q)
    for angle in np.linspace(0.0, math.pi, 19):  # the model is symmetric in i_q
        d, q, status = flux_newton(m, radius * math.cos(angle), radius * math.sin(angle), 0.0, 0.0)
        if not status:
            dd, dq, qq = hessian(m, d, q)
            least = min(least, 1.0 / (dd + qq - min_eigenvalue(dd, dq, qq)))
    return least


def design(drive: Drive, start_up: bool = True, largest_load: float = 2.0) -> Design:
    """Return gains for a drive; `largest_load` (of rated current) sets the current limit."""
    motor, converter, injection = drive.motor, drive.converter, drive.injection
    n, h = samples_per_period(injection, converter), converter.sampling_period
    worst = smallest_inductance(motor.energy, 2.0 * motor.rated_current)
    torque_constant = 1.5 * motor.pole_pairs * motor.magnet_flux
    key = (n, h, motor.resistance, worst, motor.pole_pairs / motor.inertia * torque_constant)
    loops = _remembered(key)
    current, track, speed = loops["current"], loops["tracking"], loops["speed"]
    l_d, l_q = motor.inductance_d, motor.inductance_q
    ratio = current.ki / current.kp
    control = Control(
        n, h, current.kp, current.kp, current.kp * ratio, current.kp * ratio, motor.magnet_flux,
        speed.kp, speed.ki, max(2.0, CURRENT_MARGIN * largest_load) * motor.rated_current,
        converter.voltage_limit, injection.amplitude,
    )  # fmt: skip
    wave = carrier(injection, converter)
    power = float(np.dot(wave.primitive, wave.primitive))
    variance = 2.0 / 3.0 * (converter.current_noise**2 + converter.current_resolution**2 / 12.0)
    saliency = injection.amplitude * abs(1.0 / l_d - 1.0 / l_q)
    flux_variance = (VOLTAGE_UNCERTAINTY * converter.dc_bus_voltage * h) ** 2
    seen = variance + flux_variance / l_q**2  # what blurs a sample of the q ripple, A^2
    angle_variance = seen / (saliency**2 * power / n) if saliency else 0.0  # rad^2 a sample
    tuning = Tuning(
        n,
        math.ceil(SETTLE_TIMES / current.bandwidth / (n * h)) if start_up else 0,
        math.ceil(AVERAGE_TIME / (n * h)) if start_up else 0,
        h, injection.amplitude, power, float(np.max(np.abs(wave.primitive))), wave.lag, track.kp, track.ki,
        motor.rated_current, variance, flux_variance,
        track.bandwidth**4 * angle_variance * h**2,
    )  # fmt: skip
    return Design(control, tuning, loops)


def _remembered(key: tuple[float, ...]) -> dict[str, Loop]:
    """Return the loops for `key`, from disk where this version has designed them before."""
    version = hashlib.sha256(Path(__file__).read_bytes() + repr(key).encode()).hexdigest()[:24]
    path = cache_home() / "designs" / f"{version}.json"
    try:
        return {name: Loop(**loop) for name, loop in json.loads(path.read_text()).items()}
    except (OSError, ValueError, TypeError):
        pass
    loops = design_loops(*key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_suffix(f".{os.getpid()}")
        aside.write_text(json.dumps({name: asdict(loop) for name, loop in loops.items()}))
        aside.replace(path)
    except OSError:  # no home to write to: design again next time
        pass
    return loops


def design_loops(n: int, h: float, resistance: float, inductance: float, torque_gain: float) -> dict[str, Loop]:
    """Return the three loops; `torque_gain` is electrical acceleration per q current, rad/s^2 per A."""
    current = _tuned(partial(current_loop, n, h, resistance, inductance), h)
    tracking = _tuned(partial(tracking_loop, n, h), h)
    inner = partial(_closed_current, n, h, resistance, inductance, current.bandwidth)
    speed = _tuned(partial(speed_loop, n, h, torque_gain, inner, tracking.bandwidth), h)
    return {"current": current, "tracking": tracking, "speed": speed}


def _grid(h: float) -> NDArray[np.float64]:
    return np.geomspace(1e-2, 0.9999 * math.pi / h, 6000)


def _window(n: int, z: Complex) -> Complex:
    """Average over the last n samples."""
    return np.asarray(sum(z**-k for k in range(n)) / n)


def current_loop(
    n: int, h: float, resistance: float, inductance: float, w: NDArray[np.float64], bandwidth: float
) -> tuple[Complex, float, float]:
    """Return open loop and PI gains: one period of delay, held voltage (together 1.5 periods), n-sample average."""
    import control

    z = np.exp(1j * w * h)
    kp, ki = bandwidth * inductance, bandwidth * resistance  # the zero cancels the winding's pole
    winding = control.sample_system(control.tf([1.0], [inductance, resistance]), h, method="zoh")
    held = np.asarray(winding(z))
    return (kp + ki * h / (z - 1)) * held / z * _window(n, z), kp, ki


def tracking_loop(n: int, h: float, w: NDArray[np.float64], bandwidth: float) -> tuple[Complex, float, float]:
    """Return open loop and gains of the type-2 loop behind n-sample demodulation.

    The window's whole delay is counted; demodulating from the present frame takes its own part of it out again,
    so the real margin is larger (`tests/sandbox/test_design.py` says by how much).
    """
    z = np.exp(1j * w * h)
    kp, ki = 2.0 * DAMPING * bandwidth, bandwidth**2
    return _window(n, z) * (kp * h + ki * h * h * z / (z - 1)) / (z - 1), kp, ki


def _closed_current(
    n: int, h: float, resistance: float, inductance: float, bandwidth: float, w: NDArray[np.float64]
) -> Complex:
    """Return actual current over its reference: the average sits in the feedback path."""
    z = np.exp(1j * w * h)
    loop, _, _ = current_loop(n, h, resistance, inductance, w, bandwidth)
    return loop / _window(n, z) / (1.0 + loop)


def speed_loop(
    n: int, h: float, torque_gain: float, inner: Callable[..., Complex], tracking: float, w: Any, bandwidth: float
) -> tuple[Complex, float, float]:
    """Return open loop and PI gains of the speed controller around current loop and speed estimate."""
    z = np.exp(1j * w * h)
    follow, t_kp, t_ki = tracking_loop(n, h, w, tracking)
    # speed estimate over speed: the integral path of the closed tracking loop
    estimate = follow / (1.0 + follow) * (t_ki * h * z / (z - 1)) / (t_kp + t_ki * h * z / (z - 1))
    estimate *= (z - 1) / (1j * w * h)  # angle is the integral of speed; sampled difference against derivative
    kp = bandwidth / torque_gain
    ki = kp * bandwidth / INTEGRAL_SPLIT
    return (kp + ki * h / (z - 1)) * inner(w) * torque_gain / (1j * w) * estimate, kp, ki


def _margins(loop: Complex, w: NDArray[np.float64], h: float) -> tuple[float, float, float, float]:
    """Return gain margin, phase margin (degrees), disk margin and crossover (rad/s) of an open loop."""
    import control

    gain, phase, _, _, crossover, _ = control.stability_margins(control.frd(loop, w))
    disk = 1.0 / float(np.max(np.abs((1.0 - loop) / (1.0 + loop) / 2.0)))  # balanced sensitivity (S - T) / 2
    return float(gain), float(phase), disk, float(crossover)


def _tuned(loop: Callable[[Any, float], tuple[Complex, float, float]], h: float) -> Loop:
    """Return the loop at the largest bandwidth with the phase margin asked for."""
    from scipy.optimize import brentq

    w = _grid(h)

    def lacking(log_bandwidth: float) -> float:
        return _phase_margin(loop(w, math.exp(log_bandwidth))[0], w) - PHASE_MARGIN

    bandwidth = math.exp(brentq(lacking, math.log(0.1), math.log(0.3 / h), xtol=1e-6))
    response, kp, ki = loop(w, bandwidth)
    gain, phase, disk, crossover = _margins(response, w, h)
    return Loop(bandwidth, kp, ki, phase, gain, disk, crossover)


def _phase_margin(loop: Complex, w: NDArray[np.float64]) -> float:
    """Return the phase margin in degrees at the first crossover, phase unwrapped from low frequency."""
    size, phase = np.abs(loop), np.unwrap(np.angle(loop))
    k = int(np.argmax(size < 1.0))
    if k == 0:
        return 180.0 if size[0] < 1.0 else -180.0
    lead = 2.0 * np.pi if phase[0] > 0.5 * np.pi else 0.0  # a double integrator starts at -180, not +180 degrees
    return float(np.degrees(phase[k] - lead)) + 180.0
