"""Least squares of a replayed campaign for the baselines: ordinary deviations with priors, effects without.

Gauss-Newton on the whole campaign: residuals over their floors, derivatives from `sandbox.replay.sensitivity`, normal
equations gathered recording by recording.  Plain least squares: intervals assume white residuals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from model.effects.dead_time import SOFT_SIGN
from sandbox.campaign import Campaign
from sandbox.gap.space import SOFT_SPREAD
from sandbox.replay.replay import Prepared, prepare, replay, residuals
from sandbox.replay.sensitivity import all_parameters, sensitivities
from sandbox.replay.sets import BENCH, complete

Array = NDArray[np.float64]
STIFFNESS, LOAD = "shaft_compliance.stiffness", "shaft_compliance.load_inertia"
QUADRATURE = {  # amplitude -> phase, so that an effect may be seen whatever its phase
    "dc_link_ripple.amplitude": "dc_link_ripple.phase",
    "encoder_eccentricity.amplitude_mech": "encoder_eccentricity.phase",
    "cogging_torque.amplitude": "cogging_torque.phase",
}


@dataclass(frozen=True)
class Normal:
    """Normal equations of a campaign at a set: matrix (p, p), right side (p,), residual sum and count by recording."""

    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    matrix: Array
    right: Array
    squares: Array
    counts: Array

    @property
    def rms(self) -> float:
        """Residual over the floor, all recordings."""
        return math.sqrt(float(np.sum(self.squares) / np.sum(self.counts)))


def priors(campaign: Campaign) -> dict[str, float]:
    """Return the standard deviations of the ordinary deviations by parameter, as [uncertainty] and [background] say."""
    u, b, motor = campaign.uncertainty, campaign.background, campaign.drive.motor
    out = {
        "stator_resistance.resistance": u.get("resistance", 0.01) * motor.resistance,
        "magnet_flux.magnet_flux": u.get("magnet_flux", 0.01) * motor.magnet_flux,
        "inertia.inertia": u.get("inertia", 0.03) * motor.inertia,
        "viscous_friction.coefficient": u.get("viscous_friction", 0.15) * motor.viscous_friction,
        "encoder_offset.offset": b.get("encoder_offset", 0.002),
        "dead_time.time": b.get("dead_time", 4e-8),
        "bench.load_torque_offset": b.get("load_torque_offset", 0.003 * motor.rated_torque),
        "bench.common_offset": b.get("current_offset", 1e-3 * motor.rated_current),
    }
    counts = campaign.drive.converter.encoder_counts or 65536
    out["bench.lock_angle"] = math.tau * motor.pole_pairs / counts / math.sqrt(12.0)
    out["bench.soft_current"] = SOFT_SPREAD * SOFT_SIGN * motor.rated_current
    out |= {f"inductance.scale_{x}": u.get(f"inductance_{x}", 0.015) for x in "dq"}
    for n in ("30", "12", "40", "22", "04"):
        out[f"saturation.alpha_{n}"] = u.get(f"alpha_{n}", 0.04) * abs(getattr(motor, f"alpha_{n}"))
    out |= {f"current_gain.gain_{x}": b.get("current_gain", 0.0015) for x in "abc"}
    out |= {f"current_offset.offset_{x}": b.get("current_offset", 1e-3 * motor.rated_current) for x in "ab"}
    return {name: s for name, s in out.items() if s > 0.0}


def normal(prepared: Prepared, names: Sequence[str], at: Mapping[str, float]) -> Normal:
    """Return the normal equations of some parameters at a set."""
    s = sensitivities(prepared, names, dict(at))
    found = residuals(prepared, replay(prepared, [at]))
    p = len(s.names)
    matrix, right, squares, counts = np.zeros((p, p)), np.zeros(p), [], []
    for k, (r, inputs) in enumerate(zip(found, prepared.recordings, strict=True)):
        parts = [(s.currents[k].reshape(-1, p) / prepared.floor, r.current.reshape(-1))]
        if r.motion is not None:
            parts.append((-np.asarray(s.motion[k]), r.motion[:, 0]))
        if r.angle is not None:
            parts.append((np.asarray(s.angle[k]) / inputs.angle_floor, r.angle[:, 0]))
        for j, y in parts:
            matrix += j.T @ j
            right += j.T @ y
        squares.append(sum(float(y @ y) for _, y in parts))
        counts.append(sum(len(y) for _, y in parts))
    return Normal(s.names, s.coordinates, matrix, right, np.array(squares), np.array(counts))


def step(n: Normal, at: Mapping[str, float], centre: Mapping[str, float], sd: Mapping[str, float],
         chosen: Sequence[str]) -> tuple[Array, Array, float]:  # fmt: skip
    """Return the least-squares step of the chosen parameters, its covariance, and the cost it would leave.

    sd: priors about `centre`; a parameter without one is free.  Cost: residual and prior terms together.
    """
    pick = [n.names.index(name) for name in chosen]
    weight = np.array([1.0 / sd[name] ** 2 if name in sd else 0.0 for name in chosen])
    off = np.array([at[name] - centre[name] if name in sd else 0.0 for name in chosen])
    a, b = n.matrix[np.ix_(pick, pick)] + np.diag(weight), n.right[pick] - weight * off
    scale = inverse_root(np.diag(a))
    inverse = np.linalg.pinv(a * np.outer(scale, scale), rcond=1e-10, hermitian=True) * np.outer(scale, scale)
    dx = inverse @ b
    return dx, inverse, float(np.sum(n.squares) + weight @ off**2 - b @ dx)


def inverse_root(diagonal: Array) -> Array:
    """Return what scales a matrix' diagonal to 1; 0 where a column moves nothing, which leaves it out."""
    least = 1e-24 * float(np.max(diagonal, initial=1e-200))
    return np.where(diagonal > least, 1.0 / np.sqrt(np.maximum(diagonal, least)), 0.0)


def cost(n: Normal, at: Mapping[str, float], centre: Mapping[str, float], sd: Mapping[str, float]) -> float:
    """Return residual and prior terms at the set where the normal equations were taken."""
    return float(np.sum(n.squares)) + sum(((at[k] - centre[k]) / s) ** 2 for k, s in sd.items())


def refused(n: Normal, at: Mapping[str, float], name: str, dx: float) -> bool:
    """Tell whether a step would leave a parameter's lower bound, where it stands already."""
    if n.coordinates[n.names.index(name)].startswith("1/"):
        return dx < 0.0
    p = BENCH.get(name) or library.parameters()[name]
    return dx < 0.0 and at[name] <= p.low


def rms(prepared: Prepared, at: Mapping[str, float]) -> float:
    """Return the residual over the floor at a set: all currents, motion and angles."""
    parts = []
    for r in residuals(prepared, replay(prepared, [at])):
        parts += [x.ravel() for x in (r.current, r.motion, r.angle) if x is not None]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def moved(at: Mapping[str, float], n: Normal, chosen: Sequence[str], dx: Array) -> dict[str, float]:
    """Return the set after a step, inside the parameters' bounds; coordinates "1/name" from infinity."""
    out = dict(at)
    for name, x in zip(chosen, dx, strict=True):
        value = float(at[name]) + float(x)
        if n.coordinates[n.names.index(name)].startswith("1/"):
            value = 1.0 / max(float(x), 1e-30)
        p = BENCH.get(name) or library.parameters()[name]
        out[name] = min(max(value, p.low), p.high)
    if math.isfinite(out.get(STIFFNESS, math.inf)) and not out.get(LOAD, 0.0) > 0.0:
        out[STIFFNESS], out[LOAD] = math.inf, 0.0  # a shaft without load is rigid
    return consistent(out)


def consistent(values: Mapping[str, float]) -> dict[str, float]:
    """Return the set with the cross part of saturation equal to saturation's own."""
    out = dict(values)
    for alpha in library.SHARED:
        if f"saturation.{alpha}" in out:
            out[f"cross_saturation.{alpha}"] = out[f"saturation.{alpha}"]
    return out


def start(campaign: Campaign) -> tuple[Prepared, dict[str, float]]:
    """Return the campaign prepared at its nominal set, and that set completed."""
    return prepare(campaign, steps=1), complete(campaign.drive.motor, campaign.drive.converter)


def refit(
    campaign: Campaign, prepared: Prepared, at: Mapping[str, float], free: Sequence[str], rounds: int
) -> dict[str, float]:
    """Return the set after Gauss-Newton rounds of the ordinary deviations and the free parameters of an effect.

    The campaign stays prepared as it is, so that costs of different effects compare.
    """
    centre = complete(campaign.drive.motor, campaign.drive.converter)
    sd = {k: s for k, s in priors(campaign).items() if k not in free}
    names = list(dict.fromkeys([*priors(campaign), *free]))
    values = dict(at)
    for _ in range(rounds):
        n = normal(prepared, names, values)
        values = moved(values, n, names, step(n, values, centre, sd, names)[0])
    return values


def parameters_of(effect: str) -> list[str]:
    """Return the parameters of an effect that a screening varies; the cross part under saturation's names."""
    if effect == "cross_saturation":
        return [f"saturation.{alpha}" for alpha in library.SHARED]
    own = [n for n in all_parameters() if n.partition(".")[0] == effect]
    skipped = ("frequency", "order_mech", "width", "stribeck_torque", "stribeck_speed", "damping_ratio", "phase")
    return [n for n in own if n.rpartition(".")[2] not in skipped]
