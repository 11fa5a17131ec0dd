"""Blocked gates: closed forms, and the exact plant beside the switched bench, which finds
events."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.switched.advance import MODES, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.gates.blocked import coast
from tests.sandbox.plant.exact import Exact

DRIVE = load_drive("ipm_exchanged")
MOTOR, LINK, H = DRIVE.motor, DRIVE.converter.dc_bus_voltage, DRIVE.converter.sampling_period
QUIET = dataclasses.replace(
    DRIVE, converter=dataclasses.replace(DRIVE.converter, current_noise=0.0, current_resolution=0.0)
)
BOUND = 50e-6  # of rated current: what is asked of plants with blocked gates
QNULL = load_estimator("qnull")


def parts(speed, load, **keys):
    """Return a scenario: under load, blocked, again under load."""
    return Scenario(
        "blocked",
        (
            Segment(0.05, load, speed),
            Segment(0.02, 0.0, speed, blocked=True, score=False),
            Segment(0.05, load, speed),
        ),
        start_up=False,
        **keys,
    )


def test_open_terminals_show_what_the_magnets_induce():
    """No current, and u = j omega phi_m exp(j theta), mean of the period: sinc(omega h/2) of its
    middle."""
    omega = 300.0
    plant = Exact({}, MOTOR, "driven", 0.3, omega / MOTOR.pole_pairs, QUIET.converter)
    for k in range(20):
        current = plant.advance(0j, blocked=True)
        assert abs(current) < 1e-5 * MOTOR.rated_current
        found = complex(*plant.bench.room["given"]) / H
        theta = 0.3 + omega * H * (k + 0.5)
        x = 0.5 * omega * H
        induced = 1j * omega * MOTOR.magnet_flux * np.exp(1j * theta) * math.sin(x) / x
        assert found == pytest.approx(induced, rel=1e-5)


def test_a_current_dies_away_against_the_link():
    """At rest a current along phase a meets two thirds of the link: i = (i_0 + v/R) exp(-R
    t/L) - v/R until it is 0."""
    linear = dataclasses.replace(
        MOTOR, alpha_30=0.0, alpha_12=0.0, alpha_40=0.0, alpha_22=0.0, alpha_04=0.0
    )
    plant = Exact({}, linear, "locked", 0.0, 0.0, QUIET.converter)
    for _ in range(40):
        plant.advance(60.0 + 0j)
    v, r, inductance = 2.0 / 3.0 * LINK, linear.resistance, linear.inductance_d
    first = plant.advance(0j, blocked=True).real
    assert first > v * H / inductance  # more than one period takes away
    left = (first + v / r) * math.exp(-r * H / inductance) - v / r
    assert plant.advance(0j, blocked=True) == pytest.approx(left, abs=1e-6 * MOTOR.rated_current)
    for _ in range(3):
        last = plant.advance(0j, blocked=True)
    assert last == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("load", [1.0, -1.5])
@pytest.mark.parametrize("speed", [0.0, 0.05, 0.3])
def test_currents_are_those_of_the_switched_bench(speed, load):
    scenario = parts(speed, load, rotor="driven")
    runs = [
        simulate(QUIET, scenario, QNULL, closed_loop=False, plant=p).recording
        for p in ("exact", "switched")
    ]
    off = np.hypot(runs[0].i_d - runs[1].i_d, runs[0].i_q - runs[1].i_q) / MOTOR.rated_current
    blocked = (runs[0].t > 0.05 + 2 * H) & (runs[0].t < 0.07)
    for name, part in (
        ("before", runs[0].t < 0.05),
        ("blocked", blocked),
        ("after", runs[0].t > 0.07),
    ):
        print(f"{name}: {off[part].max() * 1e6:.2f} ppm of rated current")
    left = np.hypot(runs[1].i_d, runs[1].i_q)[blocked]
    print("currents, A:", left[:4], left[-1])
    assert off.max() < BOUND


def test_beyond_the_link_the_diodes_rectify():
    """Magnets that induce more than the link between two legs: current flows into it; both plants
    the same."""
    omega = 1.2 * LINK / math.sqrt(3.0) / MOTOR.magnet_flux
    fast = dataclasses.replace(MOTOR, rated_speed_rpm=omega / MOTOR.pole_pairs * 30.0 / math.pi)
    b = quiet(bench(fast, QUIET.converter))
    x = start(b, 0.3)
    x[Slot.SPEED] = omega / fast.pole_pairs
    plant, most, off = (
        Exact({}, fast, "driven", 0.3, omega / fast.pole_pairs, QUIET.converter),
        0.0,
        0.0,
    )
    for _ in range(60):
        theirs = complex(x[Slot.I_ALPHA], x[Slot.I_BETA])
        ours = plant.advance(0j, blocked=True)
        coast(x, b, MODES["driven"], 0.0, 0.0)
        most, off = max(most, abs(theirs)), max(off, abs(ours - theirs))
    print(f"up to {most:.3f} A, off {off / MOTOR.rated_current * 1e6:.2f} ppm")
    assert most > 0.1 * MOTOR.rated_current
    assert off < BOUND * MOTOR.rated_current


def test_refusals():
    for value in (1, "yes"):
        with pytest.raises(BadInput, match="blocked"):
            Segment(0.1, blocked=value)
    with pytest.raises(BadInput, match="current_d"):
        Segment(0.1, current_d=0.1, blocked=True)
    with pytest.raises(BadInput, match="samples at t_k"):
        simulate(QUIET, parts(0.0, 1.0), QNULL, plant="switched", effects={"pwm_delay.delay": 1e-5})
