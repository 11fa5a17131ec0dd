"""What recordings say of a flux map that is off: by how much, what it would leave as stated, and
the motor with it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from model.array_types import Array
from model.effects.library import true_motor
from model.errors import BadInput
from model.mapped import MappedMotor, corrected
from model.parameters import Motor
from sandbox.gap.evidence.algebra import algebra, prior_of
from sandbox.gap.evidence.fit import Fit, rms_of
from sandbox.gap.evidence.normal import LOCK
from sandbox.plant.sets import ANGLE_OFFSET
from sandbox.replay.map_error import gradients, rotor_currents
from sandbox.replay.replay import replay


@dataclass(frozen=True)
class MapFound:
    """By how much the current at a flux is off where recordings are, A rms and at most; normalised
    rms of all residuals with the map as found, and with it as stated, all else fitted anew (as the
    equations at the fit's point say); reached: i_d from and to, i_q from and to, A, and the largest
    current."""

    rms: float
    largest: float
    residual: float
    as_stated: float
    reached: tuple[float, float, float, float, float]

    def text(self, rated: float) -> str:
        """Return one sentence; rated: current, A."""
        return (
            "The flux map was fitted, too: where recordings are, the current at a flux is "
            f"{self.rms:.3g} A rms off ({100.0 * self.rms / rated:.2g} % of rated_current), at "
            f"most {self.largest:.3g} A. With the map as stated residuals would be "
            f"{self.as_stated:.2f} times the noise floor, with the one found they are "
            f"{self.residual:.2f}. The map beside motor.toml is the one found. {self.limits}"
        )

    @property
    def limits(self) -> str:
        """How far the map found is told, in one sentence."""
        d, to_d, q, to_q, most = self.reached
        return (
            f"It is told as far as recordings reach, {most:.3g} A (i_d {d:.3g} to {to_d:.3g} A, "
            f"i_q {q:.3g} to {to_q:.3g} A): beyond, it only goes on smoothly, and its inductances "
            "and saliency there may be wrong, so that an estimator may lose lock on it; record "
            "larger currents to have it told there."
        )


def map_found(found: Fit) -> MapFound | None:
    """Return what a fit says of its motor's flux map; None where it has none that may be off."""
    p, values = found.point.prepared, found.point.values
    error = p.map_error
    if error is None:
        return None
    drive = p.campaign.drive
    motor = true_motor(drive.motor, dict(values), keep_map=True)
    mode = error.modes @ error.x
    off, paths = [], []
    turned = found.point.turned()
    for r, read in zip(turned.recordings, replay(turned, [values]).currents, strict=True):
        lock = values[LOCK] if r.rotor == "locked" else 0.0
        path = rotor_currents(read[:, :, 0], r.motion.angle - values[ANGLE_OFFSET] + lock)
        paths.append(path)
        off.append(gradients(motor.energy, mode, error.cells, path))
    size = np.sum(np.concatenate(off) ** 2, axis=1)
    largest = math.sqrt(float(np.max(size)))
    d, q = np.concatenate(paths).T
    reached = (*_ends(d), *_ends(q), float(np.max(np.hypot(d, q))))
    mean = math.sqrt(float(np.mean(size)))
    return MapFound(mean, largest, rms_of(found), as_stated(found), reached)


def _ends(x: Array) -> tuple[float, float]:
    return float(np.min(x)), float(np.max(x))


def as_stated(found: Fit) -> float:
    """Return the normalised rms that a fit's other coordinates leave with the map as stated."""
    own, prior = algebra(found.normal), prior_of(found.coordinates)
    of_map = np.array([c.form == "map" for c in found.coordinates])
    x = own.most_probable(prior.with_deviation(np.where(of_map, 0.0, prior.deviation))).x - own.x
    count = float(sum(s.n.sum() for s in found.normal.segments))
    return math.sqrt(max(0.0, own.ssr - 2.0 * float(x @ own.g) + float(x @ own.a @ x)) / count)


def with_map_found(motor: Motor, found: Fit) -> tuple[Motor, bytes | None]:
    """Return a motor with the flux map of a fit, and the file it is read from; as it is where none
    was fitted."""
    if found.point.prepared.map_error is None or not isinstance(motor, MappedMotor):
        return motor, None
    try:
        return corrected(motor, found.point.prepared.map_error.energy())
    except BadInput:
        # no energy of a motor any more: values beside it stand, the map as it was stated
        return motor, None
