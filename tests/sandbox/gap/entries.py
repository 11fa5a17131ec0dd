"""A drive without saturation and entries of the menu, for numbers by hand."""

import dataclasses
import math

import numpy as np

from sandbox.gap.planning.menu import Entry
from tests.sandbox.gap.conftest import DRIVE

ALPHAS = dict.fromkeys(("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04"), 0.0)
MOTOR = dataclasses.replace(
    DRIVE.motor,
    pole_pairs=2,
    resistance=1.0,
    magnet_flux=0.16,
    inductance_d=0.05,
    inductance_q=0.1,
    rated_current=2.0,
    rated_speed_rpm=1200.0,
    **ALPHAS,
)
PERIOD = 1.0 / 1600.0  # s: t = k/1600 of a second


def drive_at(period=PERIOD, omega=None):
    """Return a drive of 100 V phase peak, 5 V injected; omega: rated speed in rad/s electrical."""
    rpm = MOTOR.rated_speed_rpm if omega is None else omega / MOTOR.pole_pairs * 30.0 / math.pi
    c = dataclasses.replace(
        DRIVE.converter,
        sampling_period=period,
        dc_bus_voltage=100.0 * math.sqrt(3.0),
        pwm_frequency=None,
    )
    own = dataclasses.replace(DRIVE.injection, frequency=1.0 / (8.0 * period), amplitude=5.0)
    return dataclasses.replace(
        DRIVE, motor=dataclasses.replace(MOTOR, rated_speed_rpm=rpm), converter=c, injection=own
    )


def entry_of(rotor="driven", i_d=0.0, i_q=0.0, speed=0.0, n=200, **more):
    """Return an entry at constant currents (A) and speed (rad/s), or with a course of each."""
    return Entry("x", "x", rotor, *(np.zeros(n) + x for x in (i_d, i_q, speed)), **more)


def named(name="x", seconds=1.0, **more):
    """Return an entry of eight samples at rest."""
    return Entry(name, name, "driven", *(np.zeros(8),) * 3, seconds=seconds, **more)
