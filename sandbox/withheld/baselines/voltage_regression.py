"""A baseline without replay: voltage and torque residuals of the nominal model regressed on
signature functions.

Voltage left over in each period, from currents as read and the encoder's angle: u - R
i - (psi_k+1 - psi_k)/T_s, with psi the nominal flux of those currents, in means over BIN samples
(which average injection out); each effect has one or more columns (its first-order voltage).
Ordinary deviations are columns with priors.  The effect whose columns take most of the weighted
squares wins.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.compiled import kernel
from model.effects.library import effect_names, neutral
from model.energy import flux_newton
from model.mapped import ALPHAS
from model.parameters import Motor
from sandbox.gap.evidence.priors import ordinary as stated
from sandbox.recordings.campaign import Campaign, CampaignRecording, read_folder
from sandbox.replay.inputs import stated_noise_std
from sandbox.replay.replay import prepare
from sandbox.withheld.baselines.answer import Answer, answer
from sandbox.withheld.baselines.refit import inverse_root

Complex = NDArray[np.complex128]
# by parameter or effect: first-order voltages, whitened with the residual
Columns = dict[str, list[Complex]]
SHARE = 1e-3  # relative step of the flux' derivatives
RIPPLES = (100.0, 300.0)  # Hz
LAG = 4e-3  # s, smooths torques
# samples a mean is taken over: differences of noisy currents cancel inside, or they would pose as
# effects
BIN = 16


@kernel
def fluxes(m, i_d, i_q):
    """Return the fluxes phi_d + j phi_q (n,) of currents (A) by the nominal energy."""
    out = np.empty(len(i_d), dtype=np.complex128)
    d = q = 0.0
    for k in range(len(i_d)):
        d, q, _ = flux_newton(m, i_d[k], i_q[k], d, q)
        out[k] = complex(d, q)
    return out


def sign_vector(phases: NDArray[np.float64], soft: float) -> Complex:
    """Return the vector of the three currents' signs, linear within `soft` (A)."""
    s = np.clip(phases / soft, -1.0, 1.0)
    return np.asarray(
        (2.0 * s[:, 0] - s[:, 1] - s[:, 2]) / 3.0 + 1j * (s[:, 1] - s[:, 2]) / math.sqrt(3.0)
    )


class Currents:
    """A recording's currents, and the voltages that the nominal motor's flux takes at them."""

    def __init__(self, campaign: Campaign, r: CampaignRecording, theta: NDArray[np.float64]):
        """theta: electrical angle (n,) in rad."""
        self.motor, self.period = campaign.drive.motor, campaign.drive.converter.sampling_period
        i_alpha, i_beta = r.current
        self.i, self.turn = i_alpha + 1j * i_beta, np.exp(1j * theta)
        self.psi = self.flux(self.motor, self.i, self.turn)

    def flux(self, m: Motor, current: Complex, angle: Complex) -> Complex:
        """Return a motor's flux linkage (Wb, stationary) at currents (A) and angles (unit
        phasors)."""
        local = current / angle
        return np.asarray(
            (fluxes(m.energy, local.real.copy(), local.imag.copy()) + m.magnet_flux) * angle
        )

    def slope(self, psi: Complex) -> Complex:
        """Return the voltage (V) that a flux linkage takes between samples."""
        return np.asarray(np.diff(psi) / self.period)

    def by(self, field: str) -> Complex:
        """Return how that voltage answers to a motor's value."""
        h = SHARE * max(abs(getattr(self.motor, field)), 1e-9)
        values: Any = {field: getattr(self.motor, field) + h}
        changed = self.flux(replace(self.motor, **values), self.i, self.turn)
        return self.slope((changed - self.psi) / h)

    def read_as(self, change: Any) -> Complex:
        """Return the voltage seen where the true current is larger by `change` (V)."""
        changed = self.flux(self.motor, self.i + SHARE * change, self.turn)
        return self.slope(changed - self.psi) / SHARE + self.motor.resistance * middle(change)

    def late(self) -> Complex:
        """Return how the flux linkage answers to the angle's error (Wb a radian)."""
        turned = self.flux(self.motor, self.i, self.turn * np.exp(1j * SHARE))
        return np.asarray((turned - self.psi) / SHARE)


def middle(x: Any) -> Any:
    """Return means of neighbours."""
    return 0.5 * (x[1:] + x[:-1])


def columns_of(
    campaign: Campaign, r: CampaignRecording, theta: NDArray[np.float64]
) -> tuple[Complex, Columns]:
    """Return the residual voltage (n - 1,) of a recording and all first-order voltages (V per
    unit)."""
    own, u = Currents(campaign, r, theta), r.u_alpha + 1j * r.u_beta
    residual = u[:-1] - own.motor.resistance * middle(own.i) - own.slope(own.psi)
    out = {
        **_of_machine(own, r, theta),
        **_of_inverter(own, r, u, campaign.drive.converter.dc_bus_voltage),
        **_of_sensors(own, r, theta),
    }
    if r.rotor == "free":
        omega = np.gradient(theta, own.period)
        out |= mechanical(campaign, r, theta, omega, own.psi, own.i)
    return residual, out


def _of_machine(own: Currents, r: CampaignRecording, theta: NDArray[np.float64]) -> Columns:
    motor, i, turn, psi, axis = own.motor, own.i, own.turn, own.psi, np.exp(2j * np.pi / 3.0)
    slope = own.slope
    return {
        "stator_resistance": [middle(i)],
        "magnet_flux": [slope(turn)],
        "inductance": [
            own.by("inductance_d") * motor.inductance_d,
            own.by("inductance_q") * motor.inductance_q,
        ],
        "saturation": [own.by(name) for name in ALPHAS],
        "cross_saturation": [own.by("alpha_12"), own.by("alpha_22")],
        "flux_harmonics": [slope(turn * np.cos(6 * theta)), slope(1j * turn * np.sin(6 * theta))],
        "inductance_harmonics": [
            slope(np.exp(6j * theta) * np.conj(psi - motor.magnet_flux * turn) * turn)
        ],
        "iron_loss": [own.read_as(np.gradient(psi, own.period))],
        "skin_effect": [middle(i - smoothed(i, 2e-4 / own.period))],
        "winding_asymmetry": [middle(r.i_a + 0j) * 2 / 3, middle(r.i_b * axis) * 2 / 3],
    }


def _of_inverter(own: Currents, r: CampaignRecording, u: Complex, link: float) -> Columns:
    """u: V as commanded (n,); link: V."""
    phases = np.stack([r.i_a, r.i_b, r.i_c], axis=1)
    signs = middle(sign_vector(phases, 0.015 * own.motor.rated_current))
    return {
        "dead_time": [signs / own.period * link],
        "device_drop": [signs, middle(own.i)],
        "dc_link_error": [-u[:-1]],
        "dc_link_ripple": [
            u[:-1] * f(math.tau * h * r.t[:-1]) for h in RIPPLES for f in (np.sin, np.cos)
        ],
        "pwm_delay": [u[:-1] - np.concatenate([[0.0], u[:-2]])],
    }


def _of_sensors(own: Currents, r: CampaignRecording, theta: NDArray[np.float64]) -> Columns:
    read_as, late, axis, p = own.read_as, own.late(), np.exp(2j * np.pi / 3.0), own.motor.pole_pairs
    n = len(r.t)
    return {
        "current_gain": [-read_as(r.i_a * 2 / 3 + 0j), -read_as(r.i_b * axis * 2 / 3)],
        "current_offset": [-read_as(np.ones(n) + 0j), -read_as(1j * np.ones(n))],
        "current_filter": [read_as(np.gradient(own.i, own.period))],
        "current_sampling": [-read_as(np.concatenate([[0.0], np.diff(own.i)]) / own.period)],
        "encoder_offset": [-own.slope(late)],
        "encoder_eccentricity": [
            -own.slope(late * np.sin(theta / p)),
            -own.slope(late * np.cos(theta / p)),
        ],
    }


def smoothed(x: Complex, samples: float) -> Complex:
    """Return x behind a first-order lag of so many samples."""
    from scipy.signal import lfilter

    decay = math.exp(-1.0 / samples)
    return np.asarray(lfilter([1.0 - decay], [1.0, -decay], x))


def mechanical(
    campaign: Campaign, r: CampaignRecording, theta, omega, psi: Complex, i: Complex
) -> Columns:
    """Return mechanical torques (N m) on their own block: under "" the residual, then each
    effect's."""
    motor, period = campaign.drive.motor, campaign.drive.converter.sampling_period
    p, load = motor.pole_pairs, np.asarray(r.columns.get("load_torque", np.zeros(len(theta))))
    torque = 1.5 * p * np.imag(np.conj(psi) * i)
    speed = omega / p
    lag, width = LAG / period, neutral(motor)["coulomb_friction.width"]

    def slow(x) -> Complex:
        """Return what a lag lets through."""
        return smoothed(np.asarray(x, dtype=complex), lag)[:-1]

    return {
        "": [
            slow(
                torque
                - load
                - motor.viscous_friction * speed
                - motor.inertia * np.gradient(speed, period)
            )
        ],
        "coulomb_friction": [slow(np.tanh(speed / width))],
        "viscous_friction": [slow(speed)],
        "inertia": [slow(np.gradient(speed, period))],
        "cogging_torque": [slow(-f(k * theta)) for k in (4, 6, 12) for f in (np.sin, np.cos)],
        "shaft_compliance": [slow(np.gradient(np.gradient(torque - load, period), period))],
    }


def by_voltage(folder: Path, exclude: tuple[str, ...] = ()) -> Answer:
    """Answer by the effect whose columns explain most of what ordinary deviations leave."""
    started, campaign = time.perf_counter(), read_folder(folder)
    prepared = prepare(campaign, steps=1)
    blocks: list[tuple[Complex, Columns, float, float | None]] = []
    for r, inputs in zip(campaign.recordings, prepared.recordings, strict=True):
        residual, columns = columns_of(campaign, r, inputs.motion.angle)
        torque = columns.pop("", None)
        if torque is not None:
            names = (
                "coulomb_friction",
                "viscous_friction",
                "inertia",
                "cogging_torque",
                "shaft_compliance",
            )
            # smoothed samples are not independent
            alone = 0.5 * campaign.drive.converter.sampling_period / LAG
            blocks.append((torque[0], {k: columns.pop(k) for k in names}, alone, None))
        mean = {k: [binned(c) for c in own] for k, own in columns.items()}
        blocks.append((binned(residual), mean, 1.0, voltage_noise(campaign)))
    gram, places = normal_matrix(blocks)
    ordinary, weight = background(campaign, places)
    count = sum(share * len(y) for y, _, share, _ in blocks)
    base = left_over(gram, ordinary, weight)
    costs = {}
    for effect in effect_names():
        if effect not in exclude and effect in places:
            own = places[effect]
            free = np.where(np.isin(np.arange(len(weight)), own), 0.0, weight)
            used = sorted({*ordinary, *own})
            costs[effect] = left_over(gram, used, free) + len(own) * math.log(count)
    best = min(costs.values())
    before, after = math.sqrt(base / count), math.sqrt(best / count)
    ranked: list[Any] = [
        ((e,), math.exp(-0.5 * min(c - best, 1400.0)), {}) for e, c in sorted(costs.items())
    ]
    ranked.append(((), math.exp(-0.5 * min(max(base - best, 0.0), 1400.0)), {}))
    return answer(
        campaign, ranked, (math.sqrt(gram[0, 0] / count), before, min(after, before)), started, 0
    )


def binned(x: Complex) -> Complex:
    """Return means over BIN samples, the rest left away."""
    n = len(x) // BIN
    return np.asarray(x[: n * BIN].reshape(n, BIN).mean(axis=1))


def voltage_noise(campaign: Campaign) -> float:
    """Return the mean square (V^2) that the sensors' noise leaves in a residual voltage: that of
    flux differences."""
    motor, converter = campaign.drive.motor, campaign.drive.converter
    vector = 4.0 / 3.0 * stated_noise_std(converter) ** 2
    inductance = 0.5 * (motor.inductance_d**2 + motor.inductance_q**2)
    return 2.0 * vector * inductance / (BIN * converter.sampling_period) ** 2


def normal_matrix(
    blocks: list[tuple[Complex, Columns, float, float | None]],
) -> tuple[NDArray[np.float64], dict[str, list[int]]]:
    """Return the Gram matrix of residual (place 0) and all columns; places by name.

    A block is (residual, columns, share of independent samples, its noise squared); without noise
    given, over the scatter that all its columns together leave.
    """
    places: dict[str, list[int]] = {}
    n = 1
    for _, columns, *_ in blocks:
        for name, own in columns.items():
            if name not in places:
                places[name] = list(range(n, n + len(own)))
                n += len(own)
    gram = np.zeros((n, n))
    for y, columns, share, variance in blocks:
        table = np.zeros((n, len(y)), dtype=complex)
        table[0] = y
        for name, own in columns.items():
            table[places[name]] = np.array(own)
        own_gram = (np.conj(table) @ table.T).real
        if variance is None:
            every = [p for name in columns for p in places[name]]
            variance = left_over(own_gram, every, np.zeros(n)) / len(y)
        gram += own_gram * share / variance
    return gram, places


def background(
    campaign: Campaign, places: dict[str, list[int]]
) -> tuple[list[int], NDArray[np.float64]]:
    """Return the places of the ordinary deviations and their prior weights, at all places."""
    sd = {c.names[0]: c.deviation for c in stated(campaign)}
    weight = np.zeros(1 + max(max(p) for p in places.values()))
    motor = campaign.drive.motor
    sizes = {
        "stator_resistance": [sd["stator_resistance.resistance"]],
        "magnet_flux": [sd["magnet_flux.magnet_flux"]],
        "inductance": [sd["inductance.scale_d"], sd["inductance.scale_q"]],
        "saturation": [sd.get(f"saturation.{name}", 1e-9) for name in ALPHAS],
        "current_gain": 2 * [1.5 * sd["current_gain.gain_a"]],
        "current_offset": 2
        * [sd["current_offset.offset_a"] + 0.1 * stated_noise_std(campaign.drive.converter)],
        "encoder_offset": [sd["encoder_offset.offset"]],
        "dead_time": [sd["dead_time.time"]],
        "inertia": [sd["inertia.inertia"]],
        "viscous_friction": [
            sd.get("viscous_friction.coefficient", 0.15 * motor.viscous_friction + 1e-9)
        ],
    }
    ordinary = []
    for name, own in sizes.items():
        if name not in places:  # no rotor was free
            continue
        for place, size in zip(places[name], own, strict=True):
            weight[place] = 1.0 / size**2
            ordinary.append(place)
    return ordinary, weight


def left_over(gram: NDArray[np.float64], used: list[int], weight: NDArray[np.float64]) -> float:
    """Return the squares that a ridge regression on some places leaves, prior terms included."""
    a = gram[np.ix_(used, used)] + np.diag(weight[used])
    b = gram[used, 0]
    scale = inverse_root(np.diag(a))
    x = np.linalg.lstsq(a * np.outer(scale, scale), scale * b, rcond=1e-10)[0]
    return float(gram[0, 0] - b @ (scale * x))
