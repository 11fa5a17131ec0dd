"""The plant of a closed loop: one parameter set, the rotor moved by the plant itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from model.effects import library
from model.energy import AnyEnergy
from model.parameters import Converter, Motor
from model.spline import SplineEnergy
from model.steps import step_for_orders, step_for_turn, step_for_winding
from sandbox.drive.loop import LoopPlant
from sandbox.plant import additions as add
from sandbox.plant.batch import blank_room
from sandbox.plant.sets import batch_of, features_of, machine_rows, timing_of


def longest_step(
    motor: Motor, values: Mapping[str, float], features: int, top_omega: float
) -> float:
    """Return the plant's longest step (s) for speeds up to top_omega (rad/s, electrical).

    motor: the true one.  Where the machine changes with the angle, the sixth order is the least
    that is resolved.
    """
    energy = motor.energy
    if isinstance(energy, SplineEnergy):  # a map stays as it is; effects add to it
        added = machine_rows(motor, values)
        energy = energy._replace(
            gamma_d=energy.gamma_d + added["gamma_d"], gamma_q=energy.gamma_q + added["gamma_q"]
        )
    step = min(step_for_winding(motor.resistance, energy), step_for_turn(top_omega))
    if features & add.ANGULAR:
        step = min(step, step_for_orders((), top_omega))
    return min(step, library.longest_step(motor, values, top_omega))


def closed_bench(
    motor: Motor,
    converter: Converter,
    values: Mapping[str, float],
    rotor: str,
    theta: float,
    step: float,
    truth: AnyEnergy | None = None,
) -> LoopPlant:
    """Return the plant at rest without current at an electrical angle (rad).

    motor: the nominal one; values: completed parameters; rotor: `locked`, `driven` or `free`; step:
    s, the longest;
    truth: another magnetic model than the motor's.
    """
    library.check_inside(motor, converter, values)
    features = features_of(motor, values) | add.MOVED
    w = batch_of(motor, converter, [values], 1)
    if rotor == "free":
        features |= add.MOTION
    else:
        features &= ~add.TWIST
        for row in ("inertia_inv", "motor_inv", "load_inv", "load_share"):
            w[row][:] = 0.0
    flux_map = _magnetics(w, motor, truth)
    w["off_c"][:], w["off_s"][:] = 1.0, 0.0
    timing = timing_of(w, converter.sampling_period, 1)
    longest = min(timing.longest, step)
    bench = LoopPlant(w, flux_map, timing._replace(longest=longest), features, blank_room(1))
    return turned_to(looked_into(bench) if w["jitter"][0] > 0.0 else bench, theta)


def looked_into(bench: LoopPlant) -> LoopPlant:
    """Return a plant whose current may be held at any instant of its period."""
    return bench._replace(timing=bench.timing._replace(first=-1.0, last=1.0))


def turned_to(bench: LoopPlant, theta: float) -> LoopPlant:
    """Return a plant like a fresh one at rest without current at another electrical angle (rad)."""
    # a copy, twenty times as fast as .copy()
    w = np.frombuffer(bytearray(bench.w.tobytes()), bench.w.dtype)[0]
    rest = np.zeros((2, 1))
    c, s = np.array([math.cos(theta)]), np.array([math.sin(theta)])
    add.at_rest(w, c, s, rest)
    d, q = w["magnet"] + rest[0], rest[1]
    w["psi_alpha"], w["psi_beta"] = c * d - s * q, s * d + c * q
    w["eddy_alpha"], w["eddy_beta"] = w["psi_alpha"], w["psi_beta"]
    w["angle"][:] = theta
    return bench._replace(w=w, room=blank_room(1))


def _magnetics(w: Any, motor: Motor, truth: AnyEnergy | None) -> SplineEnergy | None:
    """Return the plant's flux map (None for a quartic), the batch holding what is added to it."""
    if truth is None:
        return motor.energy if isinstance(motor.energy, SplineEnergy) else None
    if isinstance(truth, SplineEnergy):
        if not isinstance(motor.energy, SplineEnergy):
            for row in (
                "gamma_d",
                "gamma_q",
                "cubic_d",
                "cubic_q",
                "quartic_d",
                "quartic_dq",
                "quartic_q",
            ):
                w[row][:] = 0.0
        return truth
    w["gamma_d"][:], w["gamma_q"][:] = truth.gamma_d, truth.gamma_q
    w["cubic_d"][:], w["cubic_q"][:] = 3.0 * truth.alpha_30, truth.alpha_12
    w["quartic_d"][:], w["quartic_dq"][:] = 4.0 * truth.alpha_40, truth.alpha_22
    w["quartic_q"][:] = 4.0 * truth.alpha_04
    return None


def rotor_flux(bench: LoopPlant) -> tuple[float, float]:
    """Return phi_d, phi_q (Wb), the flux in the rotor frame less the constant magnet flux."""
    w = bench.w
    theta = float(w["angle"][0] + w["pairs"][0] * w["load_share"][0] * w["twist"][0])
    c, s = math.cos(theta), math.sin(theta)
    a, b = float(w["psi_alpha"][0]), float(w["psi_beta"][0])
    return c * a + s * b - float(w["magnet"][0]), c * b - s * a
