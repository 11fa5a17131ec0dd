"""Gains from margins: current loop, tracking loop and speed loop, designed with python-control.

Each loop is written down as the sampled loop that the kernel runs, averaged over the carrier's
phase (one-period computing delay, held voltage, averages over the injection), and its one free
bandwidth is the largest that keeps the phase margin asked for and stays below the injection.
`control` takes 1.5 s to import, so finished designs are kept on disk under a hash of everything
they depend on.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.contract import Belief, Tuning
from estimators.published import PUBLISHED, Gains
from model.energy import AnyEnergy, flux_newton, hessian, min_eigenvalue
from model.errors import BadInput
from model.kernels.folders import cache_home
from model.kernels.kept import note_damage
from model.kernels.kept import read as read_kept
from model.kernels.kept import write as write_kept
from model.kernels.sources import source_key
from model.parameters import OVERLOAD, Drive, Motor
from model.saliency import LEAST_SALIENCY, tracking_sign
from sandbox.drive.control import Control
from sandbox.recordings.injection import carrier, samples_per_period

PHASE_MARGIN = 60.0  # degrees, of current and speed loop at their worst points
# degrees; a load step is lost at a slow tracking loop sooner than at a lively one
TRACKING_MARGIN = 45.0
LEAST_MODULUS = 0.4  # distance of the current loop from -1 at the highest speed
LOOPS = {"current", "tracking", "speed"}
DAMPING = 1.0  # tracking loop: kp = 2 DAMPING w0, ki = w0^2
INTEGRAL_SPLIT = 5.0  # speed loop: integral action this far below the bandwidth
SETTLE_TIMES = 8.0  # starting up waits this many time constants of the current loop
AVERAGE_TIME = 0.016  # s of ripple averaged in each step of starting up
VOLTAGE_UNCERTAINTY = 0.0025  # of the DC bus, one sigma: what a compensated inverter leaves (EKF)
# current and tracking loop cross over this far below the injection they share the current with
INJECTION_RATIO = 8.0
# a file for --scenario, in words
KNOWN_START = 'a scenario of [scenario], like = "{}", start_up = false'

Complex = NDArray[np.complex128]
# (grid, bandwidth): loop, kp, ki
Response = Callable[[NDArray[np.float64], float], tuple[Complex, float, float]]


class SampledMotor(NamedTuple):
    """A motor as its loops see it."""

    n: int  # samples of an injection period
    h: float  # s, sampling period
    resistance: float  # ohm
    low: float  # H, smallest incremental inductance
    high: float  # H, largest
    torque_gain: float  # electrical acceleration per q current, rad/s^2 per A
    share: float  # see `tracking_response`
    published: Gains | None = None  # of the tracking loop, in place of designed ones


@dataclass(frozen=True)
class Loop:
    """One loop as designed: bandwidth (rad/s), gains, margins at its worst point, and the speed it
    is good for."""

    bandwidth: float
    kp: float
    ki: float
    phase_margin_deg: float
    gain_margin: float
    disk_margin: float
    crossover: float
    highest: float = math.inf


@dataclass(frozen=True)
class Design:
    """Gains of one drive: what the kernel needs, and the loops they come from."""

    control: Control
    tuning: Tuning
    loops: dict[str, Loop]
    published: bool = False  # whether the tracking loop has a firmware's gains
    reads_ripple: bool = True  # the estimator's, or that of starting up

    @property
    def top_omega(self) -> float:
        """Electrical speed (rad/s) up to which the current loop holds, see `top_speed`."""
        return self.loops["current"].highest


def belief_of(drive: Drive, name: str) -> Belief:
    """Return the saturated or the linear belief about a drive's motor."""
    motor = drive.motor
    energy: AnyEnergy = motor.energy if name == "saturated" else motor.linear_energy
    return Belief(
        energy, motor.magnet_flux, motor.resistance, float(motor.pole_pairs), motor.inertia
    )


def extreme_inductances(m: AnyEnergy, radius: float) -> tuple[float, float]:
    """Return the smallest and largest incremental inductance (H) in a disc of currents (A), as far
    as it is valid."""
    values = [1.0 / m.gamma_d, 1.0 / m.gamma_q]
    for size, angle in product((0.5 * radius, radius), np.linspace(0.0, math.pi, 19)):
        # symmetric in i_q
        d, q, status = flux_newton(m, size * math.cos(angle), size * math.sin(angle), 0.0, 0.0)
        if not status:
            dd, dq, qq = hessian(m, d, q)
            low = float(min_eigenvalue(dd, dq, qq))
            values += [1.0 / (dd + qq - low), 1.0 / low]
    return min(values), max(values)


def design(
    drive: Drive, start_up: bool = True, published: bool = False, injects: bool = True
) -> Design:
    """Return gains for a drive; without starting up the estimator is told the first position.

    published: whether the estimator's tracking loop takes the gains that `[injection] tracking`
    names (`Estimator.takes_published`); the speed loop is then designed around them.  What a Kalman
    filter is told (`speed_variance`) follows the designed bandwidth in any case.
    injects: whether the estimator reads a ripple; without one, and without starting up, a motor
    needs no saliency, and the tracking loop sees the angle's error at once (share 1).
    BadInput for a motor without magnets.
    """
    motor, converter, injection = drive.motor, drive.converter, drive.injection
    n, h = samples_per_period(injection, converter), converter.sampling_period
    reads_ripple = injects or start_up
    if reads_ripple:
        check_saliency(motor.energy)
    if not motor.magnet_flux > 0.0:
        raise BadInput(
            "[motor] magnet_flux = 0: with i_d = 0 such a motor has no torque to "
            "control; give a value > 0 Wb"
        )
    wave = carrier(injection, converter)
    plant = sampled(drive)
    loops = remembered_loops(plant)
    bandwidth = loops["tracking"].bandwidth
    law = PUBLISHED.get(injection.tracking) if published else None
    if law is not None:
        gains = law(n * h, 1.0 / motor.inductance_d, 1.0 / motor.inductance_q)
        loops = remembered_loops(plant._replace(published=gains))
    current, track, speed = loops["current"], loops["tracking"], loops["speed"]
    control = Control(
        n,
        h,
        current.kp,
        current.kp,
        current.ki,
        current.ki,
        motor.magnet_flux,
        speed.kp,
        speed.ki,
        OVERLOAD * motor.rated_current,
        converter.command_limit,
        injection.amplitude,
    )
    power = float(np.dot(wave.primitive, wave.primitive))
    tuning = Tuning(
        n,
        int(motor.inductance_q > motor.inductance_d),
        math.ceil(SETTLE_TIMES / current.bandwidth / (n * h)) if start_up else 0,
        math.ceil(AVERAGE_TIME / (n * h)) if start_up else 0,
        h,
        injection.amplitude,
        power,
        float(np.max(np.abs(wave.primitive))),
        wave.lag,
        track.kp,
        track.ki,
        motor.rated_current,
        *_variances(drive, power, n, bandwidth),
    )
    return Design(control, tuning, loops, law is not None, reads_ripple)


def _variances(drive: Drive, power: float, n: int, bandwidth: float) -> tuple[float, float, float]:
    """Return the variances a sample of a current (A^2), of a flux (Wb^2) and of the speed
    ((rad/s)^2), the last as a tracking loop of a bandwidth (rad/s) follows it.

    power: sum of the squares of the carrier's integral over its n samples.
    """
    motor, converter, h = drive.motor, drive.converter, drive.converter.sampling_period
    apart = abs(motor.inductance_q / motor.inductance_d - 1.0) if is_salient(motor) else 1.0
    saliency = drive.injection.amplitude * apart / motor.inductance_q
    variance = 2.0 / 3.0 * (converter.current_noise**2 + converter.current_resolution**2 / 12.0)
    flux_variance = (VOLTAGE_UNCERTAINTY * converter.dc_bus_voltage * h) ** 2
    # what blurs a sample of the q ripple, A^2
    seen = variance + flux_variance / motor.inductance_q**2
    angle_variance = seen / (saliency**2 * power / n)  # rad^2 a sample
    return variance, flux_variance, bandwidth**4 * angle_variance * h**2


def sampled(drive: Drive) -> SampledMotor:
    """Return a drive's motor as its loops see it."""
    motor, between = drive.motor, drive.motor.inductance_q - drive.motor.inductance_d
    return SampledMotor(
        samples_per_period(drive.injection, drive.converter),
        drive.converter.sampling_period,
        motor.resistance,
        *extreme_inductances(motor.energy, OVERLOAD * motor.rated_current),
        torque_gain=1.5 * motor.pole_pairs**2 * motor.magnet_flux / motor.inertia,
        share=motor.inductance_q / between if is_salient(motor) else 1.0,
    )


def is_salient(motor: Motor) -> bool:
    """Tell whether the inductances at zero current differ enough for injection."""
    return abs(1.0 - motor.inductance_q / motor.inductance_d) > LEAST_SALIENCY


def check_saliency(energy: AnyEnergy) -> None:
    """Raise BadInput where a motor shows no ripple that tells its angle."""
    try:
        tracking_sign(energy)
    except BadInput as error:
        raise BadInput(
            f"{error}, or an estimator that injects nothing (active_flux), at speed, with the "
            f"angle known at the start: {KNOWN_START.format('speed_steps')}"
        ) from None


def remembered_loops(plant: SampledMotor) -> dict[str, Loop]:
    """Return `design_loops(plant)`, from disk where this version has designed them before."""
    code = source_key(Path(__file__).resolve())
    version = hashlib.sha256(f"{code} {plant!r}".encode()).hexdigest()[:24]
    path = cache_home() / "designs" / f"{version}.kept"
    stored = read_kept(path)
    if stored is not None:
        try:
            known = {name: Loop(**loop) for name, loop in json.loads(stored).items()}
            numbers = [x for loop in known.values() for x in astuple(loop)]
            gains = [x for loop in known.values() for x in (loop.bandwidth, loop.kp, loop.ki)]
            if (
                set(known) == LOOPS
                and all(type(x) is float for x in numbers)
                and all(map(math.isfinite, gains))
            ):
                return known  # a gain margin may be infinite
        except (ValueError, TypeError, AttributeError, RecursionError):
            pass
        note_damage(path)
    loops = design_loops(plant)
    write_kept(path, json.dumps({name: asdict(loop) for name, loop in loops.items()}).encode())
    return loops


def design_loops(plant: SampledMotor) -> dict[str, Loop]:
    """Return the three loops."""
    h = plant.h
    highest = 2.0 * math.pi / (plant.n * h) / INJECTION_RATIO
    inner = tuned_loop([partial(current_loop, plant)], h, PHASE_MARGIN, highest)
    inner = replace(inner, highest=top_speed(plant, inner))
    if plant.published is None:
        tracking = tuned_loop([partial(tracking_loop, plant)], h, TRACKING_MARGIN, highest)
    else:
        tracking = published_loop(plant, plant.published)
    gains = Gains(tracking.kp, tracking.ki)
    followed = [
        partial(_closed_current, plant, inner, inductance) for inductance in (plant.low, plant.high)
    ]
    ends = [partial(speed_loop, plant, follow, gains) for follow in followed]
    speed = tuned_loop(ends, h, PHASE_MARGIN, highest)
    return {"current": inner, "tracking": tracking, "speed": speed}


def frequency_grid(h: float) -> NDArray[np.float64]:
    """Return the frequencies (rad/s) at which loops are looked at, up to half the sampling rate."""
    return np.geomspace(1e-2, 0.9999 * math.pi / h, 6000)


def _window(n: int, z: Complex) -> Complex:
    """Average over the last n samples."""
    return np.asarray(sum(z**-k for k in range(n)) / n)


def current_loop(
    plant: SampledMotor, w: NDArray[np.float64], bandwidth: float
) -> tuple[Complex, float, float]:
    """Return open loop and PI gains: one period of delay, held voltage (together 1.5 periods),
    n-sample average.

    Proportional gain for the smallest inductance, where the loop is fastest; zero at the slowest
    winding pole, so that no inductance in between has less margin.
    """
    kp, ki = bandwidth * plant.low, bandwidth * plant.low * plant.resistance / plant.high
    return _current_loop(plant, kp, ki, plant.low, w), kp, ki


def _current_loop(
    plant: SampledMotor, kp: float, ki: float, inductance: float, w: NDArray[np.float64]
) -> Complex:
    import control

    h = plant.h
    z = np.exp(1j * w * h)
    winding = control.sample_system(
        control.tf([1.0], [inductance, plant.resistance]), h, method="zoh"
    )
    return np.asarray((kp + ki * h / (z - 1)) * np.asarray(winding(z)) / z * _window(plant.n, z))


def top_speed(plant: SampledMotor, loop: Loop) -> float:
    """Return the electrical speed (rad/s) up to which the current loop keeps a modulus margin of
    LEAST_MODULUS.

    At speed omega the winding's pole seen from the rotor frame is complex, R/L + j omega; with the
    delay and the average in the loop, cross-coupling eats the margin: held voltage, all in the
    rotor frame, both senses.
    """
    n, h, resistance = plant.n, plant.h, plant.resistance
    nu = np.concatenate([-frequency_grid(h)[::-1], frequency_grid(h)])[::8]
    z = np.exp(1j * nu * h)
    best = math.inf
    for inductance in (plant.low, plant.high):
        gain = -math.expm1(-resistance / inductance * h) / resistance
        pi = loop.kp + loop.ki * h / (z - 1)
        for omega in np.geomspace(1.0, 0.5 / h, 120):
            pole = np.exp(-(resistance / inductance + 1j * omega) * h)
            if np.min(np.abs(1.0 + pi * gain / (z - pole) / z * _window(n, z))) < LEAST_MODULUS:
                best = min(best, float(omega))
                break
    return best


def tracking_loop(
    plant: SampledMotor, w: NDArray[np.float64], bandwidth: float
) -> tuple[Complex, float, float]:
    """Return open loop and gains of the type-2 loop around demodulation; w: (n,) rad/s at which the
    loop is returned."""
    gains = Gains(2.0 * DAMPING * bandwidth, bandwidth**2)
    return tracking_response(plant, w, gains), *gains


def published_loop(plant: SampledMotor, gains: Gains) -> Loop:
    """Return the tracking loop with gains that a firmware publishes, its crossover as bandwidth.

    BadInput where it would not be stable.
    """
    w = frequency_grid(plant.h)
    response = tracking_response(plant, w, gains)
    gain, phase, disk, crossover = margins(response, w)
    if not (phase > 0.0 and gain > 1.0):
        raise BadInput(
            f"[injection] tracking: published gains of {gains.kp:.4g} 1/s and {gains.ki:.4g} 1/s^2 "
            f"leave this loop no margin at an injection of {1.0 / (plant.n * plant.h):.4g} Hz; "
            "inject faster, or leave tracking out"
        )
    return Loop(crossover, *gains, phase, gain, disk, crossover)


def tracking_response(plant: SampledMotor, w: NDArray[np.float64], gains: Gains) -> Complex:
    """Return the open loop of the type-2 loop around demodulation.

    An error of the estimate makes q ripple in two ways, y_q = (Gamma_dd - Gamma_qq) e: the frame it
    is looked at from is turned (`share` = Gamma_dd over the difference), and so is the axis of
    injection (1 - share).  The second acts one sample later and through the window.  The first
    does, too, where each sample is looked at from its own axis (share < 0, L_d > L_q); looked at
    from the present frame it acts at once, except that the frame is turned back with the estimated
    speed, d samples on average.
    """
    n, h, share, (kp, ki) = plant.n, plant.h, plant.share, gains
    z, d = np.exp(1j * w * h), 0.75 * n - 0.5
    angle = (kp * h + ki * h * h * z / (z - 1)) / (z - 1)
    window = _demodulation(n, z)
    frame = angle * window if share < 0.0 else angle - ki * h * h * d / (z - 1)
    return np.asarray(share * frame + (1.0 - share) * angle * window / z)


def _demodulation(n: int, z: Complex) -> Complex:
    """Weights 1/2, 1, 1/2 over three half periods."""
    return np.asarray(0.5 * (1.0 + z ** (-n // 2)) * _window(n, z))


def _closed_current(
    plant: SampledMotor, tuned: Loop, inductance: float, w: NDArray[np.float64]
) -> Complex:
    """Return actual current over its reference at an inductance: the average sits in the feedback
    path."""
    z = np.exp(1j * w * plant.h)
    loop = _current_loop(plant, tuned.kp, tuned.ki, inductance, w)
    return loop / _window(plant.n, z) / (1.0 + loop)


def speed_loop(
    plant: SampledMotor,
    inner: Callable[..., Complex],
    tracking: Gains,
    w: NDArray[np.float64],
    bandwidth: float,
) -> tuple[Complex, float, float]:
    """Return open loop and PI gains of the speed controller around current loop and the tracking
    loop's speed; w: (n,) rad/s at which the loop is returned."""
    n, h, torque_gain = plant.n, plant.h, plant.torque_gain
    z = np.exp(1j * w * h)
    loop = tracking_response(plant, w, tracking)
    # Angle to speed estimate: what the window lets through, then the loop's integral path.
    estimate = _demodulation(n, z) / (1.0 + loop) * tracking.ki * h * z / (z - 1)
    kp = bandwidth / torque_gain
    ki = kp * bandwidth / INTEGRAL_SPLIT
    return (kp + ki * h / (z - 1)) * inner(w) * torque_gain / (1j * w) ** 2 * estimate, kp, ki


def swings(plant: SampledMotor, loops: Mapping[str, Loop], inductance: float, turn: float) -> bool:
    """Tell whether the speed loop swings where the axis that is tracked turns with the q current.

    inductance: H, at that current; turn: rad/A.  The speed loop then has a second path beside the
    rotor, C F (k/(j w)^2 + turn) S, C the controller, F the current loop, S from axis to speed; it
    is designed with the first one alone.  It swings where the whole crosses the negative real axis
    beyond -1.
    """
    w = frequency_grid(plant.h)
    inner = _closed_current(plant, loops["current"], inductance, w)
    tracking = Gains(loops["tracking"].kp, loops["tracking"].ki)
    z, loop = np.exp(1j * w * plant.h), tracking_response(plant, w, tracking)
    seen = _demodulation(plant.n, z) / (1.0 + loop) * tracking.ki * plant.h * z / (z - 1)
    control = loops["speed"].kp + loops["speed"].ki * plant.h / (z - 1)
    whole = control * inner * seen * (plant.torque_gain / (1j * w) ** 2 + turn)
    across = np.flatnonzero(np.diff(np.sign(whole.imag)))
    return bool(np.any(whole.real[across] < -1.0))


def tuned_loop(loops: Sequence[Response], h: float, margin: float, highest: float) -> Loop:
    """Return the largest bandwidth with which every variant of a loop keeps its phase margin and
    crossover.

    margin: degrees; highest: crossover, rad/s.  The margins returned are the smallest of the
    variants.
    """
    from scipy.optimize import brentq

    w = frequency_grid(h)

    def spare(log_bandwidth: float) -> float:
        """Return how far (a share) the worst loop is inside both limits at a bandwidth (log of
        rad/s)."""
        found = (crossing(loop(w, math.exp(log_bandwidth))[0], w) for loop in loops)
        return min(
            min(phase / margin - 1.0, 1.0 - crossover / highest) for phase, crossover in found
        )

    ends = math.log(0.1), math.log(1.5 / h)
    if not spare(ends[0]) > 0.0 > spare(ends[1]):
        raise BadInput(
            f"no bandwidth gives a loop the margin of {margin:g} degrees at a sampling "
            f"period of {h:.4g} s; check the "
            "motor's resistance, inductances and alphas (SI units), or sample faster"
        )
    bandwidth = math.exp(brentq(spare, *ends, xtol=1e-6))
    _, kp, ki = loops[0](w, bandwidth)
    gains, phases, disks, crossovers = zip(
        *(margins(loop(w, bandwidth)[0], w) for loop in loops), strict=True
    )
    return Loop(bandwidth, kp, ki, min(phases), min(gains), min(disks), max(crossovers))


def margins(loop: Complex, w: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return gain margin, phase margin (degrees), disk margin and crossover (rad/s) of an open
    loop.

    What `control.stability_margins` finds on splines through the grid; it asks them for one
    frequency at a time, five times as long as all of a design takes now.
    """
    from scipy.interpolate import splev, splprep
    from scipy.optimize import brentq

    spline, _ = splprep([loop.real, loop.imag], u=w, w=1.0 / (np.abs(loop) + 0.001), s=0.0)

    def at(omega: Any) -> Any:
        """Return the open loop at frequencies (rad/s), of which there may be none."""
        real, imag = splev(omega, spline) if np.size(omega) else np.empty((2, 0))
        return real + 1.0j * imag

    def zeros(size: Callable[[Any], Any], on_grid: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where a function of the open loop changes its sign; after these places of the
        grid."""
        return np.array(
            [brentq(lambda x: size(at(x)), w[k], w[k + 1]) for k in np.flatnonzero(on_grid)]
        )

    def turned(z: Any) -> Any:
        """Return the phase (rad) from 180 degrees."""
        return np.angle(-z)

    def larger(z: Any) -> Any:
        """Return by how much the loop is larger than 1."""
        return np.abs(z) - 1.0

    known = at(w)
    opposed = (np.diff(np.sign(turned(known))) != 0.0) & (known.real[:-1] <= 0.0)
    gains = 1.0 / np.abs(at(zeros(turned, opposed)))
    crossovers = zeros(larger, np.diff(np.sign(larger(known))))
    phases = np.remainder(np.angle(at(crossovers), deg=True), 360.0) - 180.0
    least = int(np.argmin(np.abs(phases))) if len(phases) else -1
    # balanced sensitivity (S - T) / 2
    disk = 1.0 / float(np.max(np.abs((1.0 - loop) / (1.0 + loop) / 2.0)))
    return (
        float(gains[np.argmin(np.abs(np.log(gains)))]) if len(gains) else math.inf,
        float(phases[least]) if len(phases) else math.inf,
        disk,
        float(crossovers[least]) if len(phases) else math.nan,
    )


def crossing(loop: Complex, w: NDArray[np.float64]) -> tuple[float, float]:
    """Return phase margin (degrees) and frequency (rad/s) of the first crossover, phase unwrapped
    from below."""
    size, phase = np.abs(loop), np.unwrap(np.angle(loop))
    k = int(np.argmax(size < 1.0))
    if k == 0:
        return (180.0, 0.0) if size[0] < 1.0 else (-180.0, float(w[-1]))
    # a double integrator starts at -180, not +180 degrees
    lead = 2.0 * np.pi if phase[0] > 0.5 * np.pi else 0.0
    return float(np.degrees(phase[k] - lead)) + 180.0, float(w[k])
