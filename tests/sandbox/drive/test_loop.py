"""The loop's timing, sensors and memory."""

from __future__ import annotations

import dataclasses
import tracemalloc

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.energy import flux_from_current
from model.errors import BadInput, Diverged, PhysicsError
from model.frames import phases, rotate
from sandbox.drive.design import design
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import LONGEST, simulate
from sandbox.switched.advance import replay
from sandbox.switched.bench_numbers import bench, quiet

DRIVE = load_drive("ipm_exchanged")
QUIET = dataclasses.replace(
    DRIVE, converter=dataclasses.replace(DRIVE.converter, current_noise=0.0, current_resolution=0.0)
)
STEP = Scenario("step", (Segment(0.02), Segment(0.1, 0.8, 0.02)), rotor="free", reference="speed")


# rad: 1e-5 of rated current (what a step of the exact plant may miss of the resistive drop) over a
# ripple of a fifth of it, whose q part turns with half the angle (`ipm_exchanged`: (1/L_d - 1/L_q)
# L_d = -0.5)
POSITION = 1e-5 / (0.2 * 0.5)


def test_recorded_voltages_drive_the_switched_bench_through_the_run():
    """Voltages as recorded (acting from their own sample on) through the other plant give the
    recording again."""
    run = simulate(QUIET, STEP, load_estimator("qnull"), seed=1)
    r, motor = run.recording, DRIVE.motor
    k = int(np.argmax(r.t > run.start_time + 0.02))
    part = slice(k, k + 120)
    out = replay(
        quiet(bench(motor, QUIET.converter)),
        "free",
        r.u_alpha[part],
        r.u_beta[part],
        r.u_dc[part],
        load_torque=r.load_torque[part],
        theta=r.theta[k],
        speed=r.omega[k] / motor.pole_pairs,
        current=rotate(r.i_d[k], r.i_q[k], r.theta[k]),
    )
    for name in ("i_a", "i_b", "i_c"):  # 1e-5 of rated current: see POSITION
        np.testing.assert_allclose(
            out[name], getattr(r, name)[part], atol=1e-5 * motor.rated_current
        )
    np.testing.assert_allclose(out["position"], r.theta[part], atol=POSITION)


def test_sensors_read_phase_currents_with_noise_and_counts():
    run = simulate(
        DRIVE, Scenario("s", (Segment(2.0, 1.0, ramp=0.1),)), load_estimator("qnull"), seed=5
    )
    r, c = run.recording, DRIVE.converter
    np.testing.assert_allclose(
        r.i_a / c.current_resolution, np.round(r.i_a / c.current_resolution), atol=1e-6
    )
    true = np.array(
        [phases(*rotate(a, b, t)) for a, b, t in zip(r.i_d, r.i_q, r.theta, strict=True)]
    )
    noise = np.column_stack([r.i_a, r.i_b, r.i_c]) - true
    # uniform count, dithered by the noise
    expected = np.hypot(c.current_noise, c.current_resolution / np.sqrt(12.0))
    # n samples: relative deviation of a standard deviation 1/sqrt(2 n), four sigma
    np.testing.assert_allclose(
        noise.std(axis=0), expected, rtol=4 / np.sqrt(2 * noise.shape[0]) + 0.01
    )
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.05
    # no half count of offset: four sigma of a mean of n
    assert np.abs(noise.mean(axis=0)).max() < 4 * expected / np.sqrt(noise.shape[0]) + 1e-5


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
    scenario = Scenario(
        "d", (Segment(0.2, 0.5, 0.05, ramp=0.1), Segment(0.1, 0.5, 0.05)), rotor="driven"
    )
    run = simulate(DRIVE, scenario, load_estimator("qnull"))
    late = run.recording.between(run.start_time + 0.15, 9.0)
    np.testing.assert_allclose(late.omega, 0.05 * DRIVE.motor.rated_omega, rtol=1e-9)


LATE = 20e-6  # s, of the pulses: a twelfth of the period
LATER = {"pwm_delay.delay": LATE}


@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_a_step_of_load_comes_when_it_is_asked_for_also_with_late_pulses(plant):
    """From its sample on the speed falls by T t/J, the angle by half T t^2/J; nothing answers it
    for two periods.

    Beside a run without the step; 2 %: back-EMF and torque change by 1 % in so short a time, on
    both plants.  The step of the exact plant in which the load comes is taken with its mean torque:
    an angle of less than T d h/(2 J).  (With load and speed taken at the pattern's start it was off
    by T t d/J: 2 d/t of it, 16 % after one period.)
    """
    motor, h = DRIVE.motor, DRIVE.converter.sampling_period
    parts = [(Segment(0.02), Segment(0.02, load)) for load in (0.0, 0.8)]
    still, run = (
        simulate(
            QUIET,
            Scenario("s", p, rotor="free"),
            load_estimator("qnull"),
            effects=LATER,
            plant=plant,
        )
        for p in parts
    )
    k = int(np.argmax(run.recording.load_torque > 0.0))
    at = slice(k, k + 3)
    t = run.recording.t[at] - run.recording.t[k]
    slowing = motor.pole_pairs * run.recording.load_torque[k] / motor.inertia
    speed, angle = (
        (getattr(run.recording, x) - getattr(still.recording, x))[at] for x in ("omega", "theta")
    )
    np.testing.assert_allclose(speed, -slowing * t, rtol=0.02, atol=1e-3 * slowing * LATE)
    np.testing.assert_allclose(
        angle, -0.5 * slowing * t * t, rtol=0.02, atol=0.5 * slowing * LATE * h
    )


@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_a_driven_rotor_keeps_to_its_ramp_also_with_late_pulses(plant):
    """Speed straight up the ramp, the angle its integral, at the samples; 1e-9 of the speed:
    rounding.

    The step of the exact plant in which the ramp begins, or ends, is taken with its mean
    acceleration: off by less than slope x delay x period/2 of angle (with motion taken at the
    pattern's start it was off by speed x delay, 1e-3).
    """
    top, ramp = 0.05 * DRIVE.motor.rated_omega, 0.1
    scenario = Scenario("d", (Segment(0.05), Segment(0.2, 0.5, 0.05, ramp=ramp)), rotor="driven")
    run = simulate(DRIVE, scenario, load_estimator("qnull"), effects=LATER, plant=plant)
    t = run.recording.t - run.start_time - 0.05
    on = np.clip(t, 0.0, ramp)
    np.testing.assert_allclose(run.recording.omega, top * on / ramp, atol=1e-9 * top)
    turned = 0.5 * top * on**2 / ramp + top * np.maximum(t - ramp, 0.0)
    corner = 0.5 * top / ramp * LATE * DRIVE.converter.sampling_period
    np.testing.assert_allclose(run.recording.theta, 1.0 + turned, rtol=1e-9, atol=corner)


def test_steps_of_the_plant_converge_on_the_other_plant():
    """Second order in the step (a free rotor's torque is that of flux and current straight through
    a segment)."""
    qnull = load_estimator("qnull")
    truth = simulate(QUIET, STEP, qnull, plant="switched").recording.theta_hat
    whole, coarse, fine = (
        np.abs(simulate(QUIET, STEP, qnull, plant_step=h).recording.theta_hat - truth).max()
        for h in (LONGEST, 12.5e-6, 1.5625e-6)
    )
    assert whole < POSITION
    assert np.log2(coarse / fine) / 3.0 == pytest.approx(2.0, abs=0.3)


def test_flux_that_leaves_the_domain_ends_the_run():
    """A truth with alpha_04 < 0: Gamma_qq = 1/L_q + 12 alpha_04 phi_q^2 vanishes at 0.33 Wb, below
    rated current."""
    drive = load_drive("spm_exchanged")
    truth = drive.motor.energy._replace(alpha_12=0.0, alpha_22=0.0, alpha_04=-5.0)
    with pytest.raises(Diverged, match=r"after .* s the fluxes .* left the domain"):
        simulate(drive, Scenario("s", (Segment(0.3, 1.0),)), load_estimator("qnull"), truth=truth)


def test_nonsense_is_refused():
    with pytest.raises(BadInput, match="neither 'saturated' nor 'linear'"):
        simulate(DRIVE, STEP, load_estimator("qnull"), "quartic")
    with pytest.raises(BadInput, match="stride"):
        simulate(DRIVE, STEP, load_estimator("qnull"), stride=0)
    with pytest.raises(BadInput, match="plant_step"):
        simulate(DRIVE, STEP, load_estimator("qnull"), plant_step=-1.0)


def test_controller_stays_within_the_inverter_and_does_not_wind_up():
    """A demand far beyond the voltage: output on the circle at once, and off it as soon as the
    error turns."""
    from sandbox.drive import control as ct

    gains, state = design(QUIET).control, np.zeros(ct.SIZE)
    for _ in range(4000):  # a second of saturation
        u = ct.current_control(state, gains, 0.0, 0.0, 0.0, 40.0, 0.0, gains.amplitude)
    assert np.hypot(*u) == pytest.approx(gains.voltage_limit - gains.amplitude, rel=1e-12)
    u = ct.current_control(state, gains, 0.0, 40.5, 0.0, 40.0, 0.0, gains.amplitude)
    assert np.hypot(*u) < gains.voltage_limit - gains.amplitude - 1.0
    # an estimator that injects nothing has all of it
    u = ct.current_control(np.zeros(ct.SIZE), gains, 0.0, 0.0, 0.0, 40.0, 0.0, 0.0)
    assert np.hypot(*u) == pytest.approx(gains.voltage_limit, rel=1e-12)


def test_commanded_voltage_stays_within_the_inverter():
    low = dataclasses.replace(
        QUIET, converter=dataclasses.replace(QUIET.converter, dc_bus_voltage=100.0)
    )
    r = simulate(
        low, Scenario("s", (Segment(0.05), Segment(0.25, 1.8))), load_estimator("qnull")
    ).recording
    assert np.hypot(r.u_alpha, r.u_beta).max() <= 100.0 / np.sqrt(3.0) * (1 + 1e-9)
    assert r.i_q[r.t > r.t[-1] - 0.1].mean() == pytest.approx(1.8 * 1.2, abs=0.02)


def test_an_estimator_that_injects_nothing_has_the_whole_voltage():
    """The link is chosen so that |R i + j w psi| needs all but half of the injection's 30 V:
    enough for `active_flux`, which injects nothing, too little beside an injection."""
    motor = QUIET.motor
    load, speed = 0.3, 0.6
    i_q, omega = load * motor.rated_current, speed * motor.rated_omega
    d, q = flux_from_current(motor.energy, 0.0, i_q)
    need = np.hypot(omega * q, motor.resistance * i_q + omega * (d + motor.magnet_flux))
    link = np.sqrt(3.0) * (need + 0.5 * QUIET.injection.amplitude)
    converter = dataclasses.replace(QUIET.converter, dc_bus_voltage=float(link))
    tight = dataclasses.replace(QUIET, converter=converter)
    ramp = (Segment(0.2, 0.0, 0.0), Segment(0.6, load, speed, ramp=0.3))
    scene = Scenario("tight", ramp, rotor="driven", start_up=False)
    r = simulate(tight, scene, load_estimator("active_flux"), closed_loop=False).recording
    assert r.i_q[r.t > r.t[-1] - 0.1].mean() == pytest.approx(i_q, rel=0.02)
    with pytest.raises(PhysicsError, match=r"beside an injection of 30 V; lower load, speed or"):
        simulate(tight, scene, load_estimator("qnull"), closed_loop=False)
    lower = dataclasses.replace(converter, dc_bus_voltage=float(np.sqrt(3.0) * 0.98 * need))
    lower = dataclasses.replace(tight, converter=lower)
    with pytest.raises(PhysicsError, match=r"leaves [0-9.]+ V; lower load or speed, or raise"):
        simulate(lower, scene, load_estimator("active_flux"), closed_loop=False)


def test_feed_forward_is_the_back_emf():
    """Without error and integral the q voltage is omega phi_m, of the sense of the speed asked
    for."""
    from sandbox.drive import control as ct

    gains = design(QUIET).control
    for omega in (50.0, -80.0):
        u_d, u_q = ct.current_control(np.zeros(ct.SIZE), gains, 0.1, 0.4, 0.1, 0.4, omega, 0.0)
        assert (u_d, u_q) == (0.0, pytest.approx(omega * DRIVE.motor.magnet_flux, rel=1e-12))


def test_voltage_survives_a_jump_of_the_control_frame():
    """`reorient` turns integrators and window with the frame: the stator voltage does not jump."""
    from sandbox.drive import control as ct

    state = np.zeros(ct.SIZE)
    gains = design(QUIET).control
    for _ in range(200):
        i_d, i_q = ct.average(state, 0.1, 0.8, gains.period)
        u = ct.current_control(state, gains, i_d, i_q, 0.0, 0.9, 0.0, 0.0)
    before = rotate(*u, 0.3)
    state[ct.Slot.FRAME] = 0.3
    ct.reorient(state, 0.3 + np.pi, 0.0)
    i_d, i_q = ct.average(state, *rotate(0.1, 0.8, -np.pi), gains.period)
    u = ct.current_control(state, gains, i_d, i_q, *rotate(0.0, 0.9, -np.pi), 0.0, 0.0)
    after = rotate(*u, 0.3 + np.pi)
    assert after == (pytest.approx(before[0], abs=0.5), pytest.approx(before[1], abs=0.5))


def test_fast_frames_are_no_jumps():
    """A frame that turns by more than a fifth of a radian a sample with its own speed is left
    alone."""
    from sandbox.drive import control as ct

    state = np.zeros(ct.SIZE)
    state[ct.Slot.INTEGRAL_Q] = 5.0
    for k in range(1, 9):
        ct.reorient(state, 0.3 * k, 0.3)
    assert state[ct.Slot.INTEGRAL_Q] == 5.0


@pytest.mark.parametrize(
    ("segment", "words"),
    [
        (Segment(0.2, 3.0), "load 300 % exceeds the current limit of 250 %"),
        (Segment(0.2, 0.0, 0.95), r"speed 95 % \(1710 rpm\) is beyond [0-9.]+ rpm"),
    ],
)
def test_what_the_drive_cannot_do_is_refused(segment, words):
    scenario = Scenario("s", (segment,), rotor="free", reference="speed")
    with pytest.raises(BadInput, match=words):
        simulate(DRIVE, scenario, load_estimator("qnull"))


def test_the_highest_speed_allowed_is_held():
    """Just below the design's top speed the current loop still holds its reference, the encoder in
    control."""
    top = 0.95 * design(QUIET).top_omega / DRIVE.motor.rated_omega
    scenario = Scenario(
        "s", (Segment(0.6, 0.3, top, ramp=0.5), Segment(0.3, 0.3, top)), rotor="driven"
    )
    r = simulate(QUIET, scenario, load_estimator("ekf"), closed_loop=False).recording
    late = r.t > r.t[-1] - 0.1
    assert r.i_q[late].mean() == pytest.approx(0.3 * 1.2, abs=0.03)
    assert np.abs(r.i_d[late].mean()) < 0.03


def test_polarity_that_cannot_be_found_is_refused():
    motor = dataclasses.replace(
        DRIVE.motor, alpha_30=0.0, alpha_12=0.0, alpha_40=0.0, alpha_22=0.0, alpha_04=0.0
    )
    linear = dataclasses.replace(DRIVE, motor=motor)
    with pytest.raises(BadInput, match=r"polarity cannot be found.*start_up = false"):
        simulate(linear, Scenario("s", (Segment(0.1),)), load_estimator("qnull"))
    simulate(linear, Scenario("s", (Segment(0.1),), start_up=False), load_estimator("qnull"))


def test_wrong_estimators_are_told():
    qnull = load_estimator("qnull")
    for wrong, words in (
        ("qnull", "no Estimator"),
        (dataclasses.replace(qnull, step=lambda *a: None), "give compiled=False"),
        (
            dataclasses.replace(qnull, step=lambda *a: (0.0, 0.0), compiled=False),
            "must return an Estimate",
        ),
    ):
        with pytest.raises(BadInput, match=words):
            simulate(DRIVE, Scenario("s", (Segment(0.01),)), wrong)
    with pytest.raises(BadInput, match="seed"):
        simulate(DRIVE, STEP, qnull, seed=-1)
