"""What a recording gives to every parameter set alike: pulses, edges, the rotor's motion, the motion filter's gains."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.compiled import kernel
from model.effects.coulomb_friction import drag
from model.effects.library import true_motor
from model.energy import flux_newton
from model.errors import BadInput
from model.frames import stationary
from model.parameters import Converter, Motor
from sandbox.campaign import Campaign, CampaignRecording
from sandbox.replay import lanes
from sandbox.replay.kernel import COLUMNS, EDGE, FIRST_A, SQUARE_BB
from sandbox.replay.sets import compile_set, complete
from sandbox.replay.smoothing import Motion, driven_motion, free_motion, locked_motion, motion_gains

Array = NDArray[np.float64]
LOAD_SHARE = 0.01  # where [background] is silent
AT_REST = 0.05  # of rated current: a first reading below is a start without current
LEGS = np.array([[1.0, 0.0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]])


@dataclass(frozen=True)
class Inputs:
    """One recording's inputs: table (n, COLUMNS), edges (n, 6, EDGE), turns (n, 2 steps + 1, 2), readings (n, 3) A."""

    file: str
    rotor: str
    table: Array
    edges: Array
    turns: Array
    read: Array
    motion: Motion
    angle_floor: float  # rad rms of one encoder reading
    pole_pairs: float
    loaded: bool  # current flows at the first sample
    link: float = 1.0  # nominal link voltage over the drive's

    def with_steps(self, period: float, steps: int) -> Inputs:
        """Return the same for another number of plant steps a period."""
        angle = self.motion.at(period, np.arange(2 * steps + 1) / (2.0 * steps))
        return replace(self, turns=np.ascontiguousarray(np.stack([np.cos(angle), np.sin(angle)], axis=-1)))

    def encoder(self, rows: Array) -> Array:
        """Return the encoder's reading (n, sets) that sets predict for a driven rotor; rows (ROWS, sets)."""
        x = self.motion.angle[:, None]
        if self.motion.eccentric:
            return np.asarray(np.broadcast_to(x, (len(x), rows.shape[1])))
        turn = x / self.pole_pairs
        return np.asarray(x + np.sin(turn) * rows[lanes.ECC_COS] + np.cos(turn) * rows[lanes.ECC_SIN])


def noise_floor(converter: Converter) -> float:
    """Return the rms (A) of one current reading about its true value: noise and counts."""
    floor = math.hypot(converter.current_noise, converter.current_resolution / math.sqrt(12.0))
    if floor <= 0.0:
        raise BadInput(
            "[drive] current_noise and current_resolution are both 0, so no residual can be judged; give at least one"
        )
    return floor


def inputs_of(campaign: Campaign, r: CampaignRecording, base: Mapping[str, float], steps: int) -> Inputs:
    """Return a recording's inputs; base: the set at which a free rotor is smoothed."""
    motor, converter = campaign.drive.motor, campaign.drive.converter
    period, n = converter.sampling_period, len(r.t)
    if np.any(r.u_dc <= 0.0):
        k = int(np.argmax(r.u_dc <= 0.0))
        raise BadInput(f"{r.file}: row {k} of column 'u_dc' is {r.u_dc[k]:g} V; duties need a positive link voltage")
    count = math.tau * motor.pole_pairs / converter.encoder_counts if converter.encoder_counts else 1e-4
    table = np.zeros((n, COLUMNS))
    duty = duties(r.u_alpha, r.u_beta, r.u_dc)
    table[:, 0:2] = (2.0 / 3.0) * duty @ LEGS
    table[:, 2:5] = duty
    table[:, FIRST_A : SQUARE_BB + 1] = ripple_moments(duty, period)
    load = np.asarray(r.columns.get("load_torque", np.zeros(n)))
    motion = _motion(campaign, r, base, load, count)
    table[:, 5] = motion.speed
    if motion.eccentric:
        turn = motion.angle / motor.pole_pairs
        table[:, 6], table[:, 7] = np.sin(turn), np.cos(turn)
    table[:, 8], table[:, 9] = load, r.theta
    variance = max(count, 1e-9) ** 2 / 12.0
    if r.rotor == "free":
        torque_error = torque_noise(motor, converter)
        table[:, 10:13] = motion_gains(
            load,
            motor.pole_pairs / motor.inertia,
            period,
            variance,
            torque_error**2,
            load_share(campaign),
            (count / period) ** 2,
        )
        table[:, 13] = motion.at(period, np.array([0.5]))[:, 0]
        table[:, 14] = 0.5 * (motion.speed + np.append(motion.speed[1:], motion.speed[-1]))
    read = np.ascontiguousarray(np.stack([r.i_a, r.i_b, r.i_c], axis=1))
    edges = edge_table(duty, period)
    v = complete(motor, converter, base)
    off_a, off_b = v["current_offset.offset_a"], v["current_offset.offset_b"]
    start = math.hypot(*stationary(read[0, 0] - off_a, read[0, 1] - off_b, read[0, 2] + off_a + off_b))
    first = Inputs(
        r.file, r.rotor, table, edges, np.empty((0, 0, 2)), read, motion, math.sqrt(variance), float(motor.pole_pairs),
        start > AT_REST * motor.rated_current,
        (r.dc_bus_voltage or converter.dc_bus_voltage) / converter.dc_bus_voltage,
    )  # fmt: skip
    return first.with_steps(period, steps)


def load_share(campaign: Campaign) -> float:
    """Return the standard deviation of the load machine's torque, a share of what was asked, sample by sample."""
    return campaign.background.get("load_torque_gain", LOAD_SHARE)


def torque_noise(motor: Motor, converter: Converter) -> float:
    """Return the standard deviation (N m) of the torque that a sample's measured currents tell."""
    reluctance = abs(motor.inductance_d - motor.inductance_q) * motor.rated_current
    return 1.5 * motor.pole_pairs * max(motor.magnet_flux, reluctance) * noise_floor(converter)


def duties(u_alpha: Array, u_beta: Array, u_dc: Array) -> Array:
    """Return the legs' duties (n, 3): commanded phase voltages centred, limited to what legs can do."""
    legs = np.stack([u_alpha, u_beta], axis=1) @ LEGS.T
    middle = 0.5 * (legs.max(axis=1) + legs.min(axis=1))
    return np.asarray(np.clip(0.5 + (legs - middle[:, None]) / u_dc[:, None], 0.0, 1.0))


def ripple_moments(duty: Array, period: float) -> Array:
    """Return moments of the flux ripple of centred pulses of 1 V, columns of `kernel` from FIRST_A on (n, 5).

    Ripple rho(t) of a leg of duty D, t from the period's middle: (1 - D) t, from the pulse's end on D (T/2 - t), odd.
    First moment <t rho> = T^2 (D - D^3)/24 (s^2); mean products <rho rho> of two legs by parts (s^2).
    """
    first = (2.0 / 3.0) * (period**2 / 24.0) * (duty - duty**3) @ LEGS
    a, b = np.minimum(duty[:, :, None], duty[:, None, :]), np.maximum(duty[:, :, None], duty[:, None, :])
    rising = (1.0 - a) * (1.0 - b) * a**3 / 3.0
    between = a * (1.0 - b) * (b * b / 2.0 - b**3 / 3.0 - a * a / 2.0 + a**3 / 3.0)
    square = 0.25 * period**2 * (rising + between + a * b * (1.0 - b) ** 3 / 3.0)
    m = (4.0 / 9.0) * np.einsum("nij,ia,jb->nab", square, LEGS, LEGS)
    return np.column_stack([first, m[:, 0, 0], m[:, 0, 1], m[:, 1, 1]])


def edge_table(duty: Array, period: float) -> Array:
    """Return the six edges of each period in order of time (n, 6, EDGE): instant, unit flux till then, leg's vector."""
    order = np.argsort(-duty, axis=1, kind="stable")
    n, rows = len(duty), np.arange(len(duty))
    out = np.empty((n, 6, EDGE))
    for m in range(6):
        leg = order[:, m if m < 3 else 5 - m]
        side = -1.0 if m < 3 else 1.0
        t = 0.5 * (1.0 + side * duty[rows, leg]) * period
        on = np.clip(t[:, None] - 0.5 * (1.0 - duty) * period, 0.0, duty * period)
        out[:, m, 0], out[:, m, 1:3], out[:, m, 3:5] = t, (2.0 / 3.0) * on @ LEGS, LEGS[leg]
    return out


def _motion(campaign: Campaign, r: CampaignRecording, base: Mapping[str, float], load: Array, count: float) -> Motion:
    motor, converter = campaign.drive.motor, campaign.drive.converter
    if r.rotor == "locked":
        if np.ptp(r.theta) > 4.0 * count:
            raise BadInput(f"{r.file}: rotor = 'locked', but theta moves by {np.ptp(r.theta):.3g} rad; correct 'rotor'")
        return locked_motion(r.theta)
    if r.rotor == "driven":
        return driven_motion(r.t, r.theta, motor.pole_pairs, count)
    v = complete(motor, converter, base)
    m = true_motor(motor, v)
    pairs, period = m.pole_pairs, converter.sampling_period
    i_alpha, i_beta = _true_currents(r, v)
    angle, speed = r.theta, np.zeros(len(r.theta))
    eccentric, phase = v["encoder_eccentricity.amplitude_mech"], v["encoder_eccentricity.phase"]
    row = compile_set(motor, converter, v, 1)
    for _ in range(2):
        turn = (angle - v["encoder_offset.offset"]) / pairs
        turn = turn - eccentric * np.sin(turn + phase)
        torque = torque_of(m.energy, m.magnet_flux, float(pairs), i_alpha, i_beta, pairs * turn)
        omega = speed / pairs
        net = torque - m.viscous_friction * omega
        net -= dry(
            *(v[f"coulomb_friction.{p}"] for p in ("torque", "width", "stribeck_torque", "stribeck_speed")), omega
        )
        net += v["cogging_torque.amplitude"] * np.sin(v["cogging_torque.order_mech"] * turn + v["cogging_torque.phase"])
        taken = load * (1.0 + v["bench.load_torque_gain"]) + v["bench.load_torque_offset"]
        mean = 0.5 * (net + np.append(net[1:], net[-1]))
        acceleration = pairs * ((mean - taken) / m.inertia + swing(row, net, taken))
        noise = pairs / m.inertia * np.hypot(torque_noise(motor, converter), load_share(campaign) * load)
        motion = free_motion(r.theta, acceleration, period, count, noise)
        angle, speed = motion.angle, motion.speed
    return motion


def _true_currents(r: CampaignRecording, v: Mapping[str, float]) -> tuple[Array, Array]:
    """Return the stationary currents (n,) behind the three sensors' gains and offsets."""
    off_a, off_b, common = (v[k] for k in ("current_offset.offset_a", "current_offset.offset_b", "bench.common_offset"))
    phases = [
        (read - off - common) / v[f"current_gain.gain_{x}"]
        for x, read, off in (("a", r.i_a, off_a), ("b", r.i_b, off_b), ("c", r.i_c, -off_a - off_b))
    ]
    alpha, beta = stationary(*phases)
    return np.asarray(alpha), np.asarray(beta)


@kernel
def swing(row, net, taken):
    """Return what a compliant shaft adds to the motor's acceleration, mean over the interval from each sample on, (n,)
    in rad/s^2 mechanical, from rest; the load's torque is constant in an interval."""
    out = np.zeros(len(net))
    if row[lanes.LOAD_SHARE] == 0.0:
        return out
    t = v = 0.0
    rate_2 = 1.0 / row[lanes.OSC_REST]
    damping = (row[lanes.OSC_11] - row[lanes.OSC_22]) / row[lanes.OSC_12]  # 2 x ratio x rate
    for k in range(len(net)):
        last = net[min(k + 1, len(net) - 1)]
        pulled = row[lanes.OSC_REST] * taken[k] * row[lanes.LOAD_INV]
        pushed = row[lanes.OSC_REST] * row[lanes.MOTOR_INV]
        first = rate_2 * (pushed * net[k] + pulled - t) - damping * v
        rest = pushed * 0.5 * (net[k] + last) + pulled
        t, v = (
            rest + row[lanes.OSC_11] * (t - rest) + row[lanes.OSC_12] * v,
            row[lanes.OSC_21] * (t - rest) + row[lanes.OSC_22] * v,
        )
        out[k] = 0.5 * row[lanes.LOAD_SHARE] * (first + rate_2 * (pushed * last + pulled - t) - damping * v)
    return out


@kernel
def dry(torque, width, stribeck_torque, stribeck_speed, omega):
    """Return the dry friction (n,) in N m at mechanical speeds (rad/s)."""
    out = np.empty(len(omega))
    for k in range(len(omega)):
        out[k] = drag(torque, width, stribeck_torque, stribeck_speed, omega[k])
    return out


@kernel
def torque_of(m, magnet_flux, pole_pairs, i_alpha, i_beta, theta):
    """Return the air-gap torque (n,) in N m of measured currents (A) at measured angles (rad)."""
    out = np.empty(len(theta))
    d = q = 0.0
    for k in range(len(theta)):
        c, s = math.cos(theta[k]), math.sin(theta[k])
        i_d, i_q = c * i_alpha[k] + s * i_beta[k], c * i_beta[k] - s * i_alpha[k]
        d, q, _ = flux_newton(m, i_d, i_q, d, q)
        out[k] = 1.5 * pole_pairs * ((d + magnet_flux) * i_q - q * i_d)
    return out
