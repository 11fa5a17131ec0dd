"""What the switched bench's load does beside the torque it is told, against energies and sums by
hand."""

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.switched.advance import MODES, replay, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import advance
from sandbox.switched.phase_machine import accelerations
from sandbox.switched.unlisted import unlisted
from tests.sandbox.switched.all_effects import unaccounted

DRIVE = load_drive("ipm_exchanged")
# nothing else moves its rotor
BARE = dataclasses.replace(DRIVE.motor, magnet_flux=0.0, viscous_friction=0.0)
ALONE = quiet(bench(BARE, DRIVE.converter))
POLES, INERTIA = BARE.pole_pairs, BARE.inertia


def turned(b, speed, n=2000, load=0.0):
    """Return mechanical angle (rad) and speed (rad/s) of a free rotor without voltage, and time
    (s)."""
    u = np.zeros(n)
    out = replay(b, "free", u, u, 400.0, speed=speed, load_torque=load)
    return out["position"] / POLES, out["speed"], np.arange(n) * DRIVE.converter.sampling_period


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_crank_alone_keeps_its_kinetic_energy(direction):
    """J(angle) omega^2 is constant: omega = omega_0 sqrt(J(0) / J(angle)); over one turn it swings
    by 2 x 10 %."""
    b = unlisted(ALONE, {"crank": 0.2 * INERTIA, "crank_phase": 0.4})
    angle, speed, _ = turned(b, direction * 40.0)
    inertia = INERTIA * (1.0 + 0.2 * np.cos(2.0 * angle + 0.4))
    assert speed == pytest.approx(direction * 40.0 * np.sqrt(inertia[0] / inertia), rel=1e-8)
    assert abs(angle[-1]) > 2.0 * math.pi
    assert np.ptp(speed) > 0.15 * 40.0


def test_a_load_out_of_true_takes_work_once_in_its_turns():
    """J omega^2 / 2 + lobe n (cos(phase) - cos(angle / n + phase)) is constant, n = 2.5 turns."""
    lobe = 0.2 * INERTIA * 30.0**2 / 2.5
    b = unlisted(ALONE, {"lobe": lobe, "lobe_turns": 2.5, "lobe_phase": 1.1})
    angle, speed, _ = turned(b, 30.0, 4000)
    work = lobe * 2.5 * (math.cos(1.1) - np.cos(angle / 2.5 + 1.1))
    assert speed == pytest.approx(np.sqrt(30.0**2 - 2.0 * work / INERTIA), rel=1e-8)
    assert angle[-1] > 2.5 * 2.0 * math.pi
    assert np.ptp(speed) > 0.1 * 30.0


def test_a_load_machine_lags_what_it_is_told():
    """Constant torque T from t = 0 on: T (1 - q^(k+1)) acts in period k, q = exp(-T_s / lag);
    speeds are its sum."""
    load, lag = 0.3 * INERTIA * 100.0, 0.02
    _, speed, t = turned(unlisted(ALONE, {"load_lag": lag}), 40.0, 1000, load)
    period = DRIVE.converter.sampling_period
    acting = load * (1.0 - np.exp(-period / lag) ** np.arange(1, 1001))
    expected = 40.0 - period / INERTIA * np.concatenate([[0.0], np.cumsum(acting)[:-1]])
    assert speed == pytest.approx(expected, rel=1e-9)
    _, at_once, _ = turned(ALONE, 40.0, 1000, load)
    # what the lag saves, in all
    assert speed[-1] - at_once[-1] == pytest.approx(load * lag / INERTIA, rel=0.02)
    assert t[-1] > 10.0 * lag


def test_all_of_it_turns_with_the_load_behind_a_shaft():
    """At an angle of the load of theta / p - twist; the motor's side as without."""
    plain = ALONE._replace(load_inertia=3e-3, stiffness=50.0, damping=0.1)
    b = unlisted(
        plain,
        {"crank": 1e-3, "crank_phase": 0.2, "lobe": 0.3, "lobe_turns": 3.0, "lobe_phase": -0.5},
    )
    at = (1.0, 0.2, 0.3, 10.0, -12.0, 1e-3)
    without, found = accelerations(plain, *at), accelerations(b, *at)
    angle = 0.3 / POLES - 1e-3
    torque = (
        without[1] * 3e-3
        - 0.3 * math.sin(angle / 3.0 - 0.5)
        + 1e-3 * math.sin(2.0 * angle + 0.2) * 144.0
    )
    assert found[0] == without[0]
    assert found[1] == pytest.approx(torque / (3e-3 + 1e-3 * math.cos(2.0 * angle + 0.2)))


def test_energy_closes_with_every_load():
    """Electrical in = losses + what the load takes + change of what is stored, behind a shaft that
    twists."""
    effects = {"shaft_compliance.stiffness": 40.0, "shaft_compliance.load_inertia": 0.5 * INERTIA}
    b = quiet(bench(DRIVE.motor, DRIVE.converter, effects))._replace(audit=1.0)
    b = unlisted(b, {"crank": 0.2 * INERTIA, "lobe": 0.3, "lobe_turns": 2.5, "fan": 1e-4})
    state = start(b, theta=0.2, speed=30.0)
    before = unaccounted(b, state)
    for k in range(400):
        turn = POLES * 30.0 * k * b.period
        advance(
            state, b, MODES["free"], -30.0 * math.sin(turn), 30.0 * math.cos(turn), 400.0, 0.15, 0.0
        )
    assert abs(state[Slot.OUTPUT]) > 0.1
    assert unaccounted(b, state) == pytest.approx(before, abs=2e-5 * state[Slot.LOSS])


def test_loads_that_cannot_be_are_refused():
    with pytest.raises(BadInput, match=r"crank = .* kg m\^2 leaves no inertia; give less than"):
        unlisted(ALONE, {"crank": INERTIA})
    with pytest.raises(
        BadInput, match=r"lobe = 0\.1 alone does nothing sound; give lobe_turns > 0"
    ):
        unlisted(ALONE, {"lobe": 0.1})
