"""The loop's timing, sensors and memory."""

from __future__ import annotations

import dataclasses
import tracemalloc

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.errors import BadInput, PhysicsError
from model.frames import phases, rotate
from model.parameters import load_drive
from sandbox.reference import trajectory
from sandbox.scenario import Scenario, Segment
from sandbox.simulate import simulate

DRIVE = load_drive("ipm_exchanged")
QUIET = dataclasses.replace(
    DRIVE, converter=dataclasses.replace(DRIVE.converter, current_noise=0.0, current_resolution=0.0)
)
STEP = Scenario("step", (Segment(0.02), Segment(0.1, 0.8, 0.02)), rotor="free", reference="speed")


def test_recorded_voltages_drive_the_twin_through_the_run():
    """Voltages as recorded (acting from their own sample on) through SciPy give the recorded angle and currents."""
    run = simulate(QUIET, STEP, load_estimator("qnull"), seed=1)
    r = run.recording
    k = int(np.argmax(r.t > run.start_time + 0.02))
    n, start = 120, np.zeros(4)
    from model import energy as en

    d, q = en.flux_from_current(DRIVE.motor.energy, r.i_d[k], r.i_q[k])
    start[:] = float(d), float(q), r.omega[k], r.theta[k]
    u = np.column_stack([r.u_alpha, r.u_beta])[k : k + n]
    assert np.ptp(r.load_torque[k : k + n]) == 0.0
    twin = trajectory(DRIVE.motor, u, DRIVE.converter.sampling_period, start, load=r.load_torque[k])
    i_d = np.array([en.currents(DRIVE.motor.energy, s[0], s[1]) for s in twin[1:]])
    # 120 periods of RK4 at 12.5 us on a plant that forgets in 4 ms
    np.testing.assert_allclose(i_d[:, 0], r.i_d[k + 1 : k + n + 1], atol=1e-9)
    np.testing.assert_allclose(twin[1:, 3], r.theta[k + 1 : k + n + 1], atol=1e-8)


def test_sensors_read_phase_currents_with_noise_and_counts():
    run = simulate(DRIVE, Scenario("s", (Segment(2.0, 1.0, ramp=0.1),)), load_estimator("qnull"), seed=5)
    r, c = run.recording, DRIVE.converter
    np.testing.assert_allclose(r.i_a / c.current_resolution, np.round(r.i_a / c.current_resolution), atol=1e-6)
    alpha, beta = rotate.py_func(0, 0, 0)[0], 0.0
    true = np.array([phases(*rotate(a, b, t)) for a, b, t in zip(r.i_d, r.i_q, r.theta, strict=True)])
    noise = np.column_stack([r.i_a, r.i_b, r.i_c]) - true
    expected = np.hypot(c.current_noise, c.current_resolution / np.sqrt(12.0))  # uniform count, dithered by the noise
    # n samples: relative deviation of a standard deviation 1/sqrt(2 n), four sigma
    np.testing.assert_allclose(noise.std(axis=0), expected, rtol=4 / np.sqrt(2 * noise.shape[0]) + 0.01)
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.05
    assert (alpha, beta) == (0.0, 0.0)


def test_command_acts_one_period_after_its_sample():
    """The estimator's first axis command at k shows in the voltage that acts from k + 1 on."""
    run = simulate(QUIET, Scenario("s", (Segment(0.01),)), load_estimator("qnull"))
    r = run.recording
    u = np.hypot(r.u_alpha, r.u_beta)
    assert u[0] == 0.0
    assert u[1] == pytest.approx(30.0, abs=1e-6)


def test_stride_keeps_every_nth_sample_of_the_same_run():
    full = simulate(DRIVE, STEP, load_estimator("ekf"), seed=1).recording
    thin = simulate(DRIVE, STEP, load_estimator("ekf"), seed=1, stride=7).recording
    assert np.array_equal(full.table[::7], thin.table)


def test_memory_is_bounded_by_recorded_samples():
    long = Scenario("long", (Segment(20.0),))
    qnull = load_estimator("qnull")
    simulate(DRIVE, STEP, qnull)
    tracemalloc.start()
    run = simulate(DRIVE, long, qnull, stride=1000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert run.recording.table.shape[0] == -(-round((run.start_time + 20.0) / 250e-6) // 1000)
    assert peak < 400_000  # a full recording would be 12 MB


def test_driven_rotor_follows_its_speed():
    scenario = Scenario("d", (Segment(0.2, 0.5, 0.05, ramp=0.1), Segment(0.1, 0.5, 0.05)), rotor="driven")
    run = simulate(DRIVE, scenario, load_estimator("qnull"))
    late = run.recording.between(run.start_time + 0.15, 9.0)
    np.testing.assert_allclose(late.omega, 0.05 * DRIVE.motor.rated_omega, rtol=1e-9)


def test_plant_step_does_not_matter():
    """Halving a step that is already fine leaves the run where it is (no noise, so no chaos of counts)."""
    a = simulate(QUIET, STEP, load_estimator("qnull"), plant_step=25e-6).recording
    b = simulate(QUIET, STEP, load_estimator("qnull"), plant_step=6.25e-6).recording
    assert np.abs(a.theta_hat - b.theta_hat).max() < 1e-7


def test_flux_that_leaves_the_domain_ends_the_run():
    """A truth with alpha_04 < 0: Gamma_qq = 1/L_q + 12 alpha_04 phi_q^2 vanishes at 0.33 Wb, below rated current."""
    drive = load_drive("spm_exchanged")
    truth = drive.motor.energy._replace(alpha_12=0.0, alpha_22=0.0, alpha_04=-5.0)
    with pytest.raises(PhysicsError, match=r"after .* s the fluxes .* left the domain"):
        simulate(drive, Scenario("s", (Segment(0.3, 1.0),)), load_estimator("qnull"), truth=truth)


def test_nonsense_is_refused():
    with pytest.raises(BadInput, match="neither 'saturated' nor 'linear'"):
        simulate(DRIVE, STEP, load_estimator("qnull"), "quartic")
    with pytest.raises(BadInput, match="stride"):
        simulate(DRIVE, STEP, load_estimator("qnull"), stride=0)
    with pytest.raises(BadInput, match="plant_step"):
        simulate(DRIVE, STEP, load_estimator("qnull"), plant_step=-1.0)
