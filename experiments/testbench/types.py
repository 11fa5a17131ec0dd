"""Containers that the compiled bench reads: one NamedTuple of floats and arrays for each part of
the drive.

Small fixed sets are tuples: the compiler keeps them out of the heap.  All angles electrical unless
a name says `mech`; currents positive into the motor; units SI.
"""

from typing import NamedTuple

import numpy as np

LOW, HIGH, FLOATING = 0, 1, 2  # what a leg's switches do
LOCKED, DRIVEN, FREE = 0, 1, 2  # what holds the rotor
VOLTAGE, CURRENT, SPEED = 0, 1, 2  # what the controller follows


class Magnetics(NamedTuple):
    """From flux linkages and angle to currents; see `magnetics.field`."""

    energy: tuple  # (7,) 1/L_d, 1/L_q (1/H), alpha_30, 12, 40, 22, 04
    power: tuple  # (7,) a_d, S, a_q, T, a_dq, U, V of the power-function saturation
    magnet: float  # Wb
    use_table: int
    grid: tuple  # (4,) first psi_d, first psi_q, steps (Wb)
    table_d: np.ndarray  # (n, m) i_d in A over psi_d, psi_q
    table_q: np.ndarray
    harmonics: tuple  # 3 rows: order, then psi_d cos, psi_d sin, psi_q cos, psi_q sin in Wb
    saliency: tuple  # (3,) gamma_6, gamma_12 in 1/H, inverse square of the flux that saturates them


class Losses(NamedTuple):
    """Resistances and losses of winding and core."""

    phases: tuple  # (3,) ohm
    contact: tuple  # (3,) cold ohm in phase a, relative rise per A^2, thermal time constant (s)
    skin: tuple  # (4, 2) ohm and time constant of each branch
    eddy: tuple  # (3, 2) conductance (1/ohm) and time constant of each mode
    excess: float  # A/V^0.5
    hysteresis: tuple  # (2,) 1/H and threshold (Wb) of the play operator
    drift: float  # relative rise of all resistances per second (temperature)
    core: bool  # any loss of the core
    rise: bool  # any branch of `skin`


class Inverter(NamedTuple):
    """Legs, their timing and the link."""

    period: float  # s
    dead_time_ideal: float  # s, edges late by the sign of the current
    zone: float  # A, sign goes linearly through zero inside
    dead_time: float  # s, both switches off
    capacitance: float  # F of a leg (twice that of one switch)
    drop_ideal: tuple  # (2,) V, ohm
    switch: tuple  # (3,) knee V, knee A, ohm
    diode: tuple  # (3,)
    delay: tuple  # (3,) s, of each leg
    counts: float  # counter steps of half a period, 0: no rounding
    link: float  # V nominal
    link_gain: float  # relative
    ripple: tuple  # (3,) V, Hz, rad
    source: tuple  # (6,) on (1), source ohm, source H, farad, rectifier ripple (relative), line Hz


class Mechanics(NamedTuple):
    """What turns."""

    pole_pairs: float
    inertia: float  # kg m^2, motor side (all of it where the shaft is stiff)
    load_inertia: float  # kg m^2 behind the shaft, 0: stiff
    shaft: tuple  # (3,) stiffness N m/rad, damping N m s/rad, half gap rad (mechanical)
    viscous: float
    coulomb: tuple  # (2,) N m, width rad/s
    # (5,) sliding N m, breakaway N m, Stribeck rad/s, bristle N m/rad, bristle damping
    lugre: tuple
    cogging: tuple  # 4 rows: N m, mechanical order, rad
    fan: float  # N m s^2
    periodic: tuple  # (3,) N m, ratio to the rotor's turn, rad: load torque that nobody asked for


class Sensors(NamedTuple):
    """What is read of currents and angle."""

    gain: tuple  # (3,)
    cubic: float  # relative at `full_scale`
    full_scale: float  # A
    offset: tuple  # (3,) A
    offset_drift: tuple  # (3,) A/s
    filter: tuple  # (3,) order (0, 1, 2), time constant s, damping
    delay: tuple  # (3,) s after t_k of each phase
    resolution: float  # A, 0: none
    hysteresis: float  # A, half width of the play
    clip: float  # A, soft limit, 0: none
    angle_offset: float
    angle_latency: float  # s
    eccentricity: tuple  # (4,) mech rad, rad, second harmonic mech rad, rad
    slip: float  # mech rad per mech rad turned
    lines: float  # counts per turn


class Control(NamedTuple):
    """The drive's own controller: what it believes."""

    inductance: tuple  # (2,) d, q for the gains
    resistance: float
    magnet: float
    bandwidth: float  # rad/s of the current loop
    speed_bandwidth: float
    torque_constant: float  # N m/A
    inertia: float
    limit: float  # A
    injection_period: int  # samples
    injection: float  # V
    injection_axis: int  # 0 none, 1 d, 2 q


class References(NamedTuple):
    """One recording: references sample by sample (k = -before .. n)."""

    rotor: int
    mode: int
    before: int  # samples run before the recording begins
    reference_d: np.ndarray  # V or A
    reference_q: np.ndarray  # nan: the speed controller asks
    speed: np.ndarray  # mech rad/s: imposed, or the speed reference
    load: np.ndarray  # N m asked
    load_error: np.ndarray  # N m that are not in the recording
    uneven: tuple  # 2 rows: relative amplitude, order, phase of an imposed speed
    start_angle: float  # rad electrical
    noise: np.ndarray  # (n, 3) A
    jitter: np.ndarray  # (n,) s
    link_noise: np.ndarray  # (n,) V


class World(NamedTuple):
    """What one period imposes from outside."""

    rotor: int
    load: float  # N m
    speed: float  # mech rad/s at `since`, of a driven rotor
    slope: float  # rad/s^2
    since: float  # s
    uneven: tuple
