"""What a recording gives to every parameter set alike: pulses, edges, the rotor's motion, the
motion filter's gains."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from model.array_types import Array
from model.compiled import kernel
from model.effects.library import true_motor
from model.energy import flux_newton
from model.errors import BadInput
from model.frames import stationary
from model.parameters import Converter, Motor
from sandbox.plant import additions, ports
from sandbox.plant.gates.modulation import is_plain, modulated, modulation_of
from sandbox.plant.mechanics import begin_bristles, bend, swing
from sandbox.plant.sampling import misread
from sandbox.plant.sets import batch_of, complete, features_of
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.rows.commands import every_period
from sandbox.replay.kernel import TRACK
from sandbox.replay.motion.smoothing import (
    GAINS,
    Motion,
    driven_motion,
    free_motion,
    locked_motion,
    motion_gains,
)

LOAD_SHARE = 0.01  # where [background] is silent
SENSOR_STEPS = (
    # of a fixed-point iteration on the linear inverse of the sensors: exact after one where they
    # are linear
    4
)
AT_REST = 0.05  # of rated current: a first reading beyond is a start under current
LEGS = np.array([[1.0, 0.0], [-0.5, math.sqrt(0.75)], [-0.5, -math.sqrt(0.75)]])


class Start(NamedTuple):
    """How readings answer to the flux at a first sample that nobody has read (`unread_start`): two
    orthonormal shapes (m, 3, 2) of the first m samples, and the shares (2,) that whitening takes
    off them."""

    shape: Array
    share: Array

    def taken_off(self, x: Array) -> None:
        """Whiten readings or their slopes (n, 3, k) from the first sample on, in place."""
        m, shape = len(self.shape), self.shape.reshape(-1, 2)
        taken = (self.share * shape) @ (shape.T @ x[:m].reshape(3 * m, -1))
        x[:m] -= taken.reshape(x[:m].shape)


@dataclass(frozen=True)
class Inputs:
    """One recording's inputs: what all sets share, the readings (n, 3) in A, and the motion."""

    file: str
    rotor: str
    track: Any  # (n held,) of `kernel.TRACK`
    read: Array
    motion: Motion
    angle_noise_std: float  # rad rms of one encoder reading
    pole_pairs: float
    loaded: bool  # current flows at the first sample
    turning: bool  # a free rotor turns there, by more than the motion filter takes for standing
    of: str = ""  # file of the recording that this one is a part of, or its own
    first: int = 0  # samples from that recording's beginning to the first one here
    held: int = 1  # PWM periods a sample: more than one in a slow log
    # of the samples before: states settle in them, they are no part of the residual
    settling: Inputs | None = None
    zero: float = 0.0  # rad: standard deviation of the angle's zero, of one that was made
    start: Start | None = None  # None: the flux at the first sample counts as known
    hold: float = 0.0  # ohm: readings hold the replay as so large a resistance would (`held`)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.read)

    @property
    def angle_name(self) -> str:
        """Name of the angle that it is turned by, a file: parts of a locked recording stand at the
        same one."""
        return (self.of or self.file) if self.rotor == "locked" else self.file

    @property
    def angle_read(self) -> Array:
        """The encoder's reading (n,), rad."""
        return np.asarray(self.track["read"][:: self.held])

    def first_current(self) -> Array:
        """Return the current (2,) in A as read at the first sample, stationary frame."""
        return np.asarray((2.0 / 3.0) * self.read[0] @ LEGS)

    def mean_duty(self) -> Array:
        """Return the vector (n, 2) of the duties commanded, mean from row to row: mean voltage over
        the link's."""
        return np.asarray((2.0 / 3.0) * self.duty() @ LEGS)

    def duty(self) -> Array:
        """Return the legs' duties (n, 3), mean from row to row."""
        return np.stack(
            [self.track[f"d_{x}"].reshape(-1, self.held).mean(axis=1) for x in "abc"], axis=1
        )

    def cut(self, first: int, last: int) -> Inputs:
        """Return samples first to last - 1, that start from the current read there."""
        own, m = slice(first, last), self.motion
        motion = Motion(m.angle[own], m.speed[own], m.eccentric)
        return replace(
            self,
            track=self.track[self.held * first : self.held * last],
            read=self.read[own],
            motion=motion,
            loaded=self.loaded or first > 0,
            turning=self.turning or first > 0,
            first=self.first + first,
            settling=None if first else self.settling,
            start=None,
        )

    def turned(self, shift: float, period: float) -> Inputs:
        """Return the same with the motion turned by an angle (rad, electrical), also where states
        settle; period: s from row to row."""
        motion = replace(self.motion, angle=self.motion.angle + shift)
        fine = motion.finer(self.held, period)
        track = with_columns(self.track, course_of(fine, self.pole_pairs, period / self.held))
        settling = None if self.settling is None else self.settling.turned(shift, period)
        return replace(self, motion=motion, track=track, settling=settling)

    def encoder(self, batch: Any, first: int = 0, last: int | None = None) -> Array:
        """Return the encoder's reading (n, lanes) that a batch predicts for a driven rotor, samples
        first to last."""
        x = self.motion.angle[first:last]
        out = np.repeat(x[:, None], len(batch["offset"]), axis=1)
        if not self.motion.eccentric:
            readings_off(batch, x / self.pole_pairs, out)
        return out


@kernel
def readings_off(w, turn, out):
    """Add to readings (n, lanes) of the angle what they are off at mechanical angles turn (n,)
    (rad)."""
    for k in range(len(turn)):
        for j in range(w.psi_alpha.size):
            out[k, j] += misread(w, j, turn[k])


def with_columns(track: Any, columns: Mapping[str, Array]) -> Any:
    """Return a copy of a track with some of its columns replaced."""
    out = track.copy()
    for name, values in columns.items():
        out[name] = values
    return out


def course_of(motion: Motion, pole_pairs: float, period: float) -> dict[str, Array]:
    """Return the columns of a track that a motion gives: a cubic through angles and speeds of both
    samples."""
    a, v = motion.angle, motion.speed
    b, w = np.append(a[1:], a[-1] + period * v[-1]), np.append(v[1:], v[-1])
    middle = 0.5 * (a + b) + 0.125 * period * (v - w)
    turn = a / pole_pairs
    course = {
        "cos": np.cos(middle),
        "sin": np.sin(middle),
        "rate": 1.5 * (b - a) / period - 0.25 * (v + w),
        "bend": 0.5 * (w - v) / period,
        "jerk": ((v + w) - 2.0 * (b - a) / period) / period**2,
        "speed": v,
        "turn": turn,
        "middle_turn": middle / pole_pairs,
        "middle_omega": 0.5 * (v + w) / pole_pairs,
    }
    return {name: np.asarray(x) for name, x in course.items()}


def stated_noise_std(converter: Converter) -> float:
    """Return the rms (A) of one current reading about its true value: noise and counts; BadInput
    where neither is stated."""
    std = math.hypot(converter.current_noise, converter.current_resolution / math.sqrt(12.0))
    if std <= 0.0:
        raise BadInput(
            "[drive] current_noise and current_resolution are both 0, so no residual can "
            "be judged; give at least one"
        )
    return std


def inputs_of(campaign: Campaign, r: CampaignRecording, base: Mapping[str, float]) -> Inputs:
    """Return a recording's inputs; base: the set at which a free rotor is smoothed."""
    if not r.settling:
        return _of_rows(campaign, r, base)
    whole, first = _of_rows(campaign, r.with_settling(), base), len(r.settling["t"])
    return replace(whole.cut(first, whole.samples), settling=whole.cut(0, first))


def _of_rows(campaign: Campaign, r: CampaignRecording, base: Mapping[str, float]) -> Inputs:
    """Return the inputs of a recording's own rows."""
    motor, converter = campaign.drive.motor, campaign.drive.converter
    period, n = converter.sampling_period, len(r.t)
    if np.any(r.u_dc <= 0.0):
        k = int(np.argmax(r.u_dc <= 0.0))
        raise BadInput(
            f"{r.file}: row {k} of column 'u_dc' is {r.u_dc[k]:g} V; duties need a "
            "positive link voltage"
        )
    count = (
        math.tau * motor.pole_pairs / converter.encoder_counts if converter.encoder_counts else 1e-4
    )
    count = r.made.count if r.made is not None and r.made.count else count
    variance = max(count, 1e-9) ** 2 / 12.0
    load = np.array(r.columns.get("load_torque", np.zeros(n)), dtype=float)
    motion = _motion(campaign, r, base, load, count)
    gains = np.zeros(n, GAINS)
    if r.rotor == "free":
        torque_error, rate = torque_noise(motor, converter), motor.pole_pairs / motor.inertia
        start = (count / period) ** 2
        gains = motion_gains(
            load, rate, period, variance, torque_error**2, load_share(campaign), start
        )
    held = converter.periods_a_row
    fine = motion.finer(held, period)
    u_alpha, u_beta, u_dc = every_period(r, converter, fine.angle)
    duty = np.ascontiguousarray(
        counted(legs_of(u_alpha, u_beta, u_dc, converter), converter.pwm_counts).T
    )
    columns = {f"d_{x}": d for x, d in zip("abc", duty, strict=True)}
    columns |= course_of(fine, motor.pole_pairs, converter.update_period)
    half = 1.0 - 2.0 * (np.arange(n) % 2) if converter.double else np.zeros(n * held)
    columns |= {"half": half, "link": link_of(r, converter, u_dc)}
    own = {"load": load, "read": np.array(r.theta, dtype=float), "scale": gains["scale"]}
    own |= {"gain_angle": gains["angle"], "gain_speed": gains["speed"]}
    own |= {"i_a": r.i_a, "i_b": r.i_b, "i_c": r.i_c}
    columns |= {name: np.repeat(x, held) for name, x in own.items()}
    track = with_columns(np.zeros(n * held, TRACK), columns)
    read_currents = np.ascontiguousarray(np.stack([r.i_a, r.i_b, r.i_c], axis=1))
    off = at_rest_reading(batch_of(motor, converter, [complete(motor, converter, base)], 1))
    current = math.hypot(*stationary(*(float(x) for x in read_currents[0] - off)))
    return Inputs(
        r.file,
        r.rotor,
        track,
        read_currents,
        motion,
        math.sqrt(variance),
        float(motor.pole_pairs),
        current > AT_REST * motor.rated_current,
        abs(float(motion.speed[0])) > count / period,
        r.origin,
        round(r.starts_at / period),
        held,
        zero=0.0 if r.made is None else r.made.zero,
    )


def link_of(r: CampaignRecording, converter: Converter, u_dc: Array) -> Array:
    """Return the link's voltage over [drive]'s nominal one, mean over the period from each reading
    u_dc (V) on (n,).

    A `measured` link goes straight from reading to reading; a steady one is what the recording says
    it is.
    """
    if converter.dc_link == "measured":
        after = np.append(u_dc[1:], u_dc[-1])
        return np.asarray(0.5 * (u_dc + after) / converter.dc_bus_voltage)
    return np.full(
        len(u_dc), (r.dc_bus_voltage or converter.dc_bus_voltage) / converter.dc_bus_voltage
    )


def counted(duty: Array, counts: int | None) -> Array:
    """Return duties as a PWM counter of so many counts in half a period has them (None: no rounding
    known)."""
    return duty if counts is None else np.round(duty * counts) / counts


def load_share(campaign: Campaign) -> float:
    """Return the standard deviation of the load machine's torque, a share of what was asked, sample
    by sample."""
    return campaign.background.get("load_torque_gain", LOAD_SHARE)


def torque_noise(motor: Motor, converter: Converter) -> float:
    """Return the standard deviation (N m) of the torque that a sample's measured currents tell."""
    reluctance = abs(motor.inductance_d - motor.inductance_q) * motor.rated_current
    return 1.5 * motor.pole_pairs * max(motor.magnet_flux, reluctance) * stated_noise_std(converter)


def legs_of(u_alpha: Array, u_beta: Array, u_dc: Array, converter: Converter) -> Array:
    """Return the legs' duties (n, 3) of commands (n,) in V as the drive that made a recording
    modulates."""
    how = modulation_of(converter)
    if is_plain(how):
        return duties(u_alpha, u_beta, u_dc)
    return np.array([modulated(how, *row) for row in zip(u_alpha, u_beta, u_dc, strict=True)])


def duties(u_alpha: Array, u_beta: Array, u_dc: Array) -> Array:
    """Return the legs' duties (n, 3): commanded phase voltages centred, limited to what legs can
    do."""
    legs = np.stack([u_alpha, u_beta], axis=1) @ LEGS.T
    middle = 0.5 * (legs.max(axis=1) + legs.min(axis=1))
    return np.asarray(np.clip(0.5 + (legs - middle[:, None]) / u_dc[:, None], 0.0, 1.0))


def _motion(
    campaign: Campaign, r: CampaignRecording, base: Mapping[str, float], load: Array, count: float
) -> Motion:
    motor, converter = campaign.drive.motor, campaign.drive.converter
    if r.rotor == "locked":
        if np.ptp(r.theta) > 4.0 * count:
            raise BadInput(
                f"{r.file}: rotor = 'locked', but theta moves by {np.ptp(r.theta):.3g} "
                "rad; correct 'rotor'"
            )
        return locked_motion(r.theta)
    if r.rotor == "driven":
        return driven_motion(r.theta, motor.pole_pairs, converter.sampling_period, count)
    v = complete(motor, converter, base)
    m = true_motor(motor, v, keep_map=True)
    pairs, period = m.pole_pairs, converter.sampling_period
    angle, speed = r.theta, np.zeros(len(r.theta))
    batch, features = batch_of(motor, converter, [v], 1), features_of(motor, v)
    i_alpha, i_beta = _true_currents(r, batch)
    off = np.zeros((len(angle), 1))
    for _ in range(2):
        turn = (angle - batch["offset"][0] - off[:, 0] + batch["latency"][0] * speed) / pairs
        off[:] = 0.0
        readings_off(batch, turn, off)
        torque = torque_of(m.energy, m.magnet_flux, float(pairs), i_alpha, i_beta, pairs * turn)
        net = torque + of_shaft(batch, turn, speed / pairs)
        taken = load * (1.0 + v["bench.load_torque_gain"]) + v["bench.load_torque_offset"]
        mean = 0.5 * (net + np.append(net[1:], net[-1]))
        if features & additions.BRISTLES:
            mean -= of_bristles(batch, speed / pairs, period)
        twists = features & additions.TWIST
        swung = swinging(batch, features, net, taken, period) if twists else 0.0
        acceleration = pairs * ((mean - taken) / m.inertia + swung)
        noise = (
            pairs
            / m.inertia
            * np.hypot(torque_noise(motor, converter), load_share(campaign) * load)
        )
        motion = free_motion(r.theta, acceleration, period, count, noise)
        angle, speed = motion.angle, motion.speed
    return motion


def _true_currents(r: CampaignRecording, batch: Any) -> tuple[Array, Array]:
    """Return the stationary currents (n,) behind the three sensors."""
    read = np.stack([r.i_a, r.i_b, r.i_c], axis=1) - batch["common"][0]
    phases = np.array(read)
    slope = np.array([_one_reading(batch, x) for x in np.eye(3)]) - _one_reading(batch, np.zeros(3))
    shown = np.empty_like(phases)
    for _ in range(SENSOR_STEPS):
        readings(batch, phases, shown)
        phases += np.linalg.solve(slope.T, (read - shown).T).T
    alpha, beta = stationary(phases[:, 0], phases[:, 1], phases[:, 2])
    return np.asarray(alpha), np.asarray(beta)


def at_rest_reading(batch: Any) -> Array:
    """Return what the three sensors (3,) read without current, A."""
    return _one_reading(batch, np.zeros(3)) + batch["common"][0]


def _one_reading(batch: Any, phases: Array) -> Array:
    out = np.empty((1, 3))
    readings(batch, phases[None, :], out)
    return out[0]


@kernel
def readings(w, phases, out):
    """Write what the first lane's sensors make of phase currents (n, 3), A, the common offset
    apart, to out (n, 3)."""
    for k in range(len(phases)):
        out[k, 0], out[k, 1], out[k, 2] = ports.reading(
            w, 0, phases[k, 0], phases[k, 1], phases[k, 2]
        )


@kernel
def of_shaft(w, turn, omega):
    """Return what friction and torques bound to position give the rotor (n,), N m; of the batch's
    first lane."""
    out = np.empty(len(turn))
    for k in range(len(turn)):
        out[k] = (
            ports.torque(w, 0, turn[k], omega[k])
            - ports.friction(w, 0, omega[k])
            - ports.load(w, 0, omega[k])
        )
        for m in range(w.more_torque):
            out[k] += ports.further_torque(w, m, 0, turn[k], omega[k])
    return out


@kernel
def of_bristles(w, omega, period):
    """Return the torque of bristles against the motion, mean over the interval from each sample
    on, (n,) in N m, of the batch's first lane; it goes at the mean of both samples' speeds."""
    out = np.empty(len(omega))
    begin_bristles(w, omega[0])
    for k in range(len(omega)):
        out[k] = bend(w, 0, 0.5 * (omega[k] + omega[min(k + 1, len(omega) - 1)]), period)
    return out


@kernel
def swinging(w, features, net, taken, period):
    """Return what a compliant shaft adds to the motor's acceleration, mean over the interval from
    each sample on, (n,) in rad/s^2 mechanical, from rest: the load's share of the slip's change;
    the load's torque is constant in it."""
    out = np.zeros(len(net))
    w.twist[0] = w.slip[0] = 0.0
    for k in range(len(net)):
        before = w.slip[0]
        w.net[0], w.taken[0] = 0.5 * (net[k] + net[min(k + 1, len(net) - 1)]), taken[k]
        swing(w, features, period)
        out[k] = w.load_share[0] * (w.slip[0] - before) / period
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
