"""Duties and a motion stated outright, through the replay's kernel and through the readable
reference."""

import dataclasses

import numpy as np

from model.drive_files import load_drive
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import LEGS, Inputs, course_of, with_columns
from sandbox.replay.kernel import TRACK
from sandbox.replay.motion.smoothing import Motion
from sandbox.replay.replay import Prepared
from tests.sandbox.plant.reference import Reference

DRIVE = load_drive("ipm")
SPEED = 600.0  # rad/s electrical: 0.15 rad a period


def from_duties(drive, duty, angle, speed, rotor="driven", load=0.0, eccentric=True):
    """Return inputs of a rotor whose angle is read as `angle` (n,) without error, no current at the
    first sample.

    Innovations are left as they come: rad, of a rotor that nothing corrects.
    """
    n, pairs, period = len(duty), float(drive.motor.pole_pairs), drive.converter.sampling_period
    motion = Motion(np.asarray(angle, float), np.asarray(speed, float), eccentric)
    columns = {f"d_{x}": d for x, d in zip("abc", np.transpose(duty), strict=True)} | course_of(
        motion, pairs, period
    )
    track = with_columns(
        np.zeros(n, TRACK),
        columns | {"load": load, "read": motion.angle, "scale": 1.0, "link": 1.0},
    )
    inputs = Inputs(
        "stated duties", rotor, track, np.zeros((n, 3)), motion, 1.0, pairs, False, False
    )
    return Prepared(Campaign("stated duties", drive, (), {}, {}, False), (inputs,), 1, 1.0, {})


def duties(n, speed=SPEED, size=0.25, drive=DRIVE, theta=0.3):
    """Return duties (n, 3) of a voltage that turns with the rotor, a square wave along its d axis
    on top."""
    k = np.arange(n)
    middle = theta + speed * drive.converter.sampling_period * (k + 0.5)
    u = (size * np.exp(1.6j) + 0.08 * np.where(k % 8 < 4, 1, -1)) * np.exp(1j * middle)
    legs = np.stack([u.real, u.imag], axis=1) @ LEGS.T
    return np.clip(0.5 + legs - 0.5 * (legs.max(axis=1) + legs.min(axis=1))[:, None], 0.0, 1.0)


def turning(n, speed=SPEED, drive=DRIVE, theta=0.3):
    """Return the angle and speed (n,) of a rotor at constant speed (rad/s electrical)."""
    return theta + speed * drive.converter.sampling_period * np.arange(n), np.full(n, speed)


def reference(drive, values, duty, speed=SPEED, theta=0.3, **more):
    """Return readings and states of the readable reference: at constant speed, or (speed None)
    moved by its torque."""
    v = complete(drive.motor, drive.converter, values)
    true = theta - v["encoder_offset.offset"] + v["encoder_offset.latency"] * (speed or 0.0)
    trajectory = None if speed is None else lambda t: (true + speed * t, speed)
    plant = Reference(
        drive.motor,
        v,
        drive.converter.sampling_period,
        drive.converter.dc_bus_voltage,
        trajectory,
        **more,
    )
    return plant.run(duty, plant.start(true))


def apart(drive, one, other):
    """Return the rms difference of two courses of three readings (n, 3) as a vector, over rated
    current; the first sample, which may come before the first pattern, left out."""
    miss = (np.asarray(one) - np.asarray(other))[1:]
    return float(np.sqrt(np.mean(np.sum(miss**2, axis=1) * 2.0 / 3.0))) / drive.motor.rated_current


def finer(prepared, steps):
    """Return the same with more steps a period."""
    return dataclasses.replace(prepared, steps=steps)
