"""Effects at their edges: the smallest sizes allowed, an encoder's speed, bounds that a step must
resolve."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm

from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.effects import library
from model.errors import BadInput
from model.steps import LARGEST_DECAY
from sandbox.cli import main
from sandbox.drive.control import ENCODER_BANDWIDTH, speed_from
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.switched.advance import MODES, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import integrate
from tests.sandbox.plant.effect_motors import CONVERTER, NO_MAGNET, TS, L, R, U
from tests.sandbox.plant.exact import exact, switched


@pytest.mark.parametrize("tau", [4e-6, 5.6e-6, 1e-6])
def test_skin_effect_as_fast_as_a_real_windings(tau):
    """The switched bench by the matrix exponential, at the time constants fitted to THOR's winding
    and at the bound.

    Far above 1/tau the ladder is R_1 in series with x at rest; R_1 = 65 ohm takes R_1 tau = 0.3 mH
    off L at most.  The exact plant meets it: its lag is exact, a step's drop misses
    LARGEST_DECAY^2/24 of what it
    drives.
    """
    r_1, t = 65.0, 3 * TS
    effects = {"skin_effect.resistance": r_1, "skin_effect.time_constant": tau}
    m = np.array([[-(R + r_1) / L, r_1 / L, 1 / L], [1 / tau, -1 / tau, 0], [0, 0, 0]])
    b = quiet(bench(NO_MAGNET, CONVERTER, effects))
    state = start(b)
    integrate(state, b, MODES["locked"], complex(40.0 / U), 0.0, t, 0.0, 0.0)
    assert [state[Slot.I_ALPHA], state[Slot.SKIN_ALPHA]] == pytest.approx(
        (expm(m * t) @ [0.0, 0.0, 40.0])[:2], rel=1e-6
    )
    u = 60.0 * np.exp(0.3j) * np.where(np.arange(200) % 8 < 4, 1.0, -1.0)
    still, moved, found = (
        f(e, u, NO_MAGNET) for f, e in ((switched, {}), (switched, effects), (exact, effects))
    )
    missed = LARGEST_DECAY**2 / 24 * np.abs(still).max()
    assert np.abs(found - moved).max() < missed
    assert np.abs(still - moved).max() > 2.0 * missed


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        (
            {"coulomb_friction.torque": 100.0, "coulomb_friction.width": 1e-3},
            r"coulomb_friction\.width: 1e\+08 .*wider",
        ),
        ({"dc_link_error.sag": 45.0}, "dc_link_error.sag: 45 .*fifth of the link"),
        ({"cogging_torque.order_mech": 0.5}, r"give a number in \[1, 10000\]"),
        ({"skin_effect.time_constant": 1e-7}, r"give a number in \[1e-06, 1\] s"),
    ],
)
def test_sizes_beyond_what_is_resolved_are_refused(effects, words):
    with pytest.raises(BadInput, match=words):
        library.complete(NO_MAGNET, CONVERTER, effects)


@pytest.mark.parametrize("text", ["1_0e-6", "١e-6", "0x1"])
def test_numbers_only_python_understands_are_refused(text, capsys, tmp_path):
    with pytest.raises(BadInput, match=f"'{text}' is no number"):
        library.parse(f"dead_time.time={text}")
    assert main(["simulate", "--effects", f"dead_time.time={text}", "--out", str(tmp_path)]) == 2
    assert main(["simulate", "--duration", text]) == 2
    assert "is no number" in capsys.readouterr().err


def observed(angle, step, slope=0.0):
    memory = np.zeros(3)
    return np.array([speed_from(memory, 0, a, slope, step, TS) for a in angle])


def test_speed_from_counts_is_the_tracking_loop():
    """A ramp of speed r is followed late by 2 r/w (critically damped, double pole w); counts blur
    it a little."""
    n, rate, step = 4000, 50.0, 2 * math.pi * 6 / 4096
    t = TS * np.arange(n)
    fine = observed(0.5 * rate * t * t + 1.0, 1e-12)
    lag = 2.0 / ENCODER_BANDWIDTH
    assert (rate * t - fine)[2000:] == pytest.approx(np.full(n - 2000, rate * lag), rel=0.05)
    counted = observed(np.round((37.0 * t + 1.0) / step) * step, step)[1000:]
    assert counted.mean() == pytest.approx(37.0, abs=0.02)
    assert 0.02 < counted.std() < 0.5
    assert (observed(t, 0.0, slope=12.5) == 12.5).all()


def test_speed_from_counts_sees_the_eccentricity():
    """theta_read = theta + p A sin(theta/p): its speed swings by omega A, the tracking loop's gain
    being 1."""
    p, amplitude, omega, n = 6, 0.01, 60.0, 12000
    theta = omega * TS * np.arange(n)
    step = 2 * math.pi * p / 4096
    read = np.round((theta + p * amplitude * np.sin(theta / p)) / step) * step
    speed, turn = observed(read, step)[2000:], theta[2000:] / p
    swing = 2.0 * np.mean((speed - omega) * np.exp(-1j * turn))
    assert abs(swing) == pytest.approx(omega * amplitude, rel=0.05)


@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_open_loop_runs_on_its_counted_encoder(plant):
    """Counts are in the control (another run than without) and cost it less than a percent of
    speed."""
    drive = load_drive("ipm_exchanged")
    counted = dataclasses.replace(
        drive, converter=dataclasses.replace(drive.converter, encoder_counts=4096)
    )
    scenario = Scenario(
        "s", (Segment(0.1), Segment(0.6, 0.3, 0.1, ramp=0.2)), rotor="free", reference="speed"
    )
    omega = []
    for d in (drive, counted):
        run = simulate(d, scenario, load_estimator("qnull"), closed_loop=False, seed=2, plant=plant)
        omega.append(run.recording.between(run.start_time + 0.5, 9.0).omega)
    assert not np.array_equal(*omega)
    assert omega[1].mean() == pytest.approx(omega[0].mean(), rel=0.01)
    assert omega[1].std() < omega[0].std() + 0.01 * drive.motor.rated_omega
