"""What an injection costs the drive: losses, torque ripple, sound, link ripple, volts; worked out
of a recording.

Three waveforms of the current are compared, each at `points` instants of every PWM period:
  full   the recorded samples, and between them what the commanded, centred pulses do to the flux;
  base   the same of currents and voltages averaged, in the rotor's frame, over AVERAGED injection periods;
  line   base without pulses: straight lines between the averaged samples.
What is added by injection, and by the noise that it lets into the control, is full against base;
the PWM's own ripple is in both.  Of a quantity x the added mean square is
<|x_full - x_line|^2> - <|x_base - x_line|^2>.

Models, and their limits:
- Copper: 3/2 R |i|^2 at the constant resistance (no skin effect of its own at the injection's
  frequency).
- Iron: eddy currents of the plant's `iron_loss` effect, 3/2 R_c |i_c|^2 with tau di_c/dt =
  (dpsi/dt)/R_c - i_c; none where the plant has none, as a motor's file states no core loss.  Excess
  loss and hysteresis are left out.
- Torque: of the air gap, from current and flux.  What the shaft makes of it is not asked.
- Sound: a *proxy* to compare methods on one motor, no sound pressure.  The radial force on the
  teeth goes with the square of the air gap's flux, so its part that is the same all round is taken
  as |psi|^2 over that at rated i_q, and the tangential one as torque over rated torque; both
  A-weighted, their squares added, in dB above REFERENCE.  Left out are vibration of the stator (its
  resonances may lie anywhere), the housing, slots and the force's other orders: a motor with a
  resonance near the injection's frequency is louder, and differently so, than this says.
- Link: current that the link's capacitor has to give beside its mean, averaged over each PWM
  period.  Its voltage ripple is this current over 2 pi f C; no drive file states C.
"""  # noqa: E501

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.compiled import kernel
from model.energy import SOLVED, flux_newton, hessian
from model.parameters import Drive, Motor
from sandbox.drive.inside import commanded, shift_of, shift_pulses
from sandbox.drive.recording import Recording
from sandbox.evaluation.sound import loudest, weighted_power
from sandbox.plant.gates.modulation import Modulation, modulated, modulation_of
from sandbox.recordings.injection import samples_per_period

AVERAGED = 4  # injection periods: what changes more slowly is the load's doing
WINDOW = 512  # samples looked at, the last ones of a segment
# Hz, at least: instants at which the current is worked out; half of it is beyond what is heard
RATE = 48e3
FEWEST = 8  # of them in a period
REFERENCE = 1e-3  # of the radial force at rated current, or of rated torque: 0 dB of the proxy


@dataclass(frozen=True)
class InjectionCost:
    """What is added by the injection over a stretch in which the drive has settled.

    copper_w, iron_w: W, iron_w None where the plant has no core loss; loss_share: both over the
    copper loss at rated current; torque_nm: rms (N m); torque_ripple: the same over rated torque;
    sound_db: see the module's text; tone_db: of it the loudest tone alone, far below it where the
    sound hisses; link_a: rms (A); injected_v: largest voltage beside the average (V), which the
    control cannot have.
    """

    copper_w: float
    iron_w: float | None
    loss_share: float
    torque_nm: float
    torque_ripple: float
    sound_db: float
    tone_db: float
    link_a: float
    injected_v: float

    @property
    def loss_w(self) -> float:
        """Copper and iron loss (W)."""
        return self.copper_w + (self.iron_w or 0.0)


class Samples(NamedTuple):
    """Currents (A) and voltages (V) of the rotor's frame, one a PWM period.

    legs: s, by how much their pulses are late; theta: rad, electrical, at the period's beginning;
    u_dc: V, by which duties are formed.
    """

    i: NDArray[np.complex128]
    u: NDArray[np.complex128]
    theta: Array
    u_dc: Array
    legs: Array


class Waveforms(NamedTuple):
    """Currents (A) and fluxes of the currents (Wb) of the rotor's frame at every instant, and
    torque (N m)."""

    i: NDArray[np.complex128]
    phi: NDArray[np.complex128]
    torque: Array


@kernel
def _walk(m, how, i_d, i_q, theta, u_alpha, u_beta, u_dc, legs, h, out):
    """Fill out (4, n, points) with i_d, i_q (A), phi_d, phi_q (Wb) of n periods h (s); return
    whether flux was found.

    i_d, i_q, theta: (n + 1,), at the periods' ends; u_a, u_b: V, stationary frame.
    """
    points = out.shape[2]
    d, q, status = flux_newton(m, i_d[0], i_q[0], 0.0, 0.0)
    for k in range(out.shape[1]):
        d, q, status = flux_newton(m, i_d[k], i_q[k], d, q)
        if status != SOLVED:
            return False
        dd, dq, qq = hessian(m, d, q)
        duty = modulated(how, u_alpha[k], u_beta[k], u_dc[k])
        whole_alpha, whole_beta = commanded(h, h, duty, legs[k], u_dc[k])
        c, s = math.cos(theta[k]), math.sin(theta[k])
        for j in range(points):
            x = j / points
            a, b = commanded(x * h, h, duty, legs[k], u_dc[k])
            a, b = a - x * whole_alpha, b - x * whole_beta
            r_d, r_q = c * a + s * b, c * b - s * a
            out[0, k, j] = i_d[k] + x * (i_d[k + 1] - i_d[k]) + dd * r_d + dq * r_q
            out[1, k, j] = i_q[k] + x * (i_q[k + 1] - i_q[k]) + dq * r_d + qq * r_q
            d, q, status = flux_newton(m, out[0, k, j], out[1, k, j], d, q)
            if status != SOLVED:
                return False
            out[2, k, j], out[3, k, j] = d, q
    return True


def injection_cost(
    drive: Drive,
    recording: Recording,
    motor: Motor,
    effects: Mapping[str, float] | None = None,
    shifted: bool = False,
) -> InjectionCost | None:
    """Return what the injection of a recorded stretch costs; None where it is too short, or
    thinned, to tell.

    motor: the true one; effects: of the plant, completed, of which its core loss counts; shifted:
    whether pulses were shifted leg by leg (`sandbox.drive.inside`).
    """
    h, n = drive.converter.sampling_period, samples_per_period(drive.injection, drive.converter)
    kept = max(WINDOW, 4 * AVERAGED * n)
    some = Recording(recording.table[-kept - 1 :])
    if len(some) <= 3 * AVERAGED * n or abs(some.t[1] - some.t[0] - h) > 1e-6 * h:
        return None
    points = max(FEWEST, math.ceil(RATE * h))
    samples = _samples(some, shift_of(drive.converter) if shifted else 0.0, h)
    mean = _averaged(samples, AVERAGED * n)
    own = _cut(samples, AVERAGED * n // 2)
    how = modulation_of(drive.converter)
    full, base, line = (
        _waveforms(motor, how, s, h, points) for s in (own, mean, mean._replace(u=0.0 * mean.u))
    )
    if full is None or base is None or line is None:
        return None
    copper = 1.5 * motor.resistance * _added(full.i, base.i, line.i)
    iron = _iron(effects or {}, motor, own.theta, (full, base, line), h / points)
    rated = 1.5 * motor.resistance * motor.rated_current**2
    torque = full.torque - base.torque
    size = float(np.sqrt(np.mean(torque**2)))
    return InjectionCost(
        copper,
        iron,
        (copper + (iron or 0.0)) / rated,
        size,
        size / motor.rated_torque,
        *sound_levels(motor, full, base, points / h),
        _link(own, mean, full, base),
        float(np.max(np.abs(own.u[:-1] - mean.u[:-1]))),
    )


def _samples(r: Recording, shift: float, h: float) -> Samples:
    """Return a recording's samples; voltages as seen from the rotor in the middle of their
    period."""
    legs = np.zeros((len(r), 3))
    if shift:
        for row, k in zip(legs, np.rint(r.t / h), strict=True):
            shift_pulses(row, int(k), shift)
    turned = np.exp(-1j * (r.theta + 0.5 * h * r.omega))
    return Samples(
        r.i_d + 1j * r.i_q,
        (r.u_alpha + 1j * r.u_beta) * turned,
        np.array(r.theta),
        np.array(r.u_dc),
        legs,
    )


def _cut(s: Samples, half: int) -> Samples:
    """Return the samples that have `half` more on either side."""
    some = slice(half, -half)
    return Samples(s.i[some], s.u[some], s.theta[some], s.u_dc[some], s.legs[some])


def _averaged(s: Samples, n: int) -> Samples:
    """Return currents and voltages averaged over n samples about each, the outer two by half;
    pulses centred."""
    weights = np.ones(n + 1) / n
    weights[[0, -1]] *= 0.5
    i, u = (np.convolve(x, weights, "valid") for x in (s.i, s.u))
    rest = _cut(s, n // 2)
    return Samples(i, u, rest.theta, rest.u_dc, np.zeros_like(rest.legs))


def _waveforms(
    motor: Motor, how: Modulation, s: Samples, h: float, points: int
) -> Waveforms | None:
    """Return the waveforms through samples; None where a current has no flux."""
    n = s.i.size - 1
    turn = np.exp(1j * 0.5 * (s.theta[:-1] + s.theta[1:]))
    u, out = s.u[:-1] * turn, np.empty((4, n, points))
    parts = [
        np.ascontiguousarray(x)
        for x in (s.i.real, s.i.imag, s.theta, u.real, u.imag, s.u_dc, s.legs)
    ]
    if not _walk(motor.energy, how, *parts, h, out):
        return None
    d, q, phi_d, phi_q = out.reshape(4, -1)
    torque = 1.5 * motor.pole_pairs * ((phi_d + motor.magnet_flux) * q - phi_q * d)
    return Waveforms(d + 1j * q, phi_d + 1j * phi_q, torque)


def _added(
    full: NDArray[np.complex128], base: NDArray[np.complex128], line: NDArray[np.complex128]
) -> float:
    """Return the added mean square, see the module's text."""
    return float(np.mean(np.abs(full - line) ** 2) - np.mean(np.abs(base - line) ** 2))


def _iron(
    effects: Mapping[str, float],
    motor: Motor,
    theta: Array,
    waveforms: tuple[Waveforms, ...],
    step: float,
) -> float | None:
    """Return the added loss by eddy currents of the core (W); None where the plant has none."""
    resistance = effects.get("iron_loss.core_resistance", math.inf)
    if not math.isfinite(resistance):
        return None
    periods = theta.size - 1
    x = np.linspace(0.0, periods, waveforms[0].phi.size, endpoint=False)
    turned, lag = (
        np.exp(1j * np.interp(x, np.arange(theta.size), theta)),
        effects["iron_loss.time_constant"],
    )
    currents = [
        branch_current(turned * (c.phi + motor.magnet_flux), step, resistance, lag)
        for c in waveforms
    ]
    return 1.5 * resistance * _added(*currents)


def branch_current(
    psi: NDArray[np.complex128], step: float, resistance: float, lag: float
) -> NDArray[np.complex128]:
    """Return i_c (A) of tau di_c/dt = (dpsi/dt)/R_c - i_c for a flux (Wb, stationary frame) every
    `step` seconds.

    psi goes straight between its instants; the branch begins settled at the flux's mean slope.
    """
    from scipy.signal import lfilter

    slope = np.diff(psi) / (step * resistance)
    keep = math.exp(-step / lag)
    found, _ = lfilter([1.0 - keep], [1.0, -keep], slope, zi=np.array([keep * np.mean(slope)]))
    return np.asarray(found)


def sound_levels(
    motor: Motor, full: Waveforms, base: Waveforms, rate: float
) -> tuple[float, float]:
    """Return the proxy for the sound (dB above REFERENCE) of waveforms against its base, and its
    loudest tone's.

    rate: Hz, of the instants.
    """
    d, q, _ = flux_newton(motor.energy, 0.0, motor.rated_current, 0.0, 0.0)
    flux = (d + motor.magnet_flux) ** 2 + q * q
    radial = (
        np.abs(full.phi + motor.magnet_flux) ** 2 - np.abs(base.phi + motor.magnet_flux) ** 2
    ) / flux
    tangential = (full.torque - base.torque) / motor.rated_torque
    power = weighted_power(radial, rate) + weighted_power(tangential, rate)
    return decibels(float(np.sum(power))), decibels(loudest(power))


def decibels(power: float) -> float:
    """Return a power in dB above REFERENCE squared, at least -120."""
    return 10.0 * math.log10(max(power, 1e-12 * REFERENCE**2) / REFERENCE**2)


def _link(own: Samples, mean: Samples, full: Waveforms, base: Waveforms) -> float:
    """Return the rms (A) of the link current's added part, averaged over each period."""
    n = own.i.size - 1
    currents = []
    for s, c in ((own, full), (mean, base)):
        i = c.i.reshape(n, -1).mean(axis=1)
        currents.append(1.5 * (s.u[:-1] * i.conj()).real / s.u_dc[:-1])
    added = currents[0] - currents[1]
    return float(np.sqrt(np.mean((added - added.mean()) ** 2)))
