"""Designed loops: margins recomputed with python-control's own transfer functions, and closed-loop
poles."""

from __future__ import annotations

import dataclasses
import math
import re
from importlib import import_module

import control
import numpy as np
import pytest

from estimators.published import PUBLISHED
from estimators.registry import estimator_names, load_estimator
from model.drive_files import load_drive, motor_names
from model.errors import BadInput
from model.mapped import ALPHAS
from model.parameters import OVERLOAD
from sandbox.drive import design as ds
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate

H, N = 250e-6, 8


def window():
    return control.tf([1.0 / N] * N, [1.0] + [0.0] * (N - 1), H)


@pytest.mark.parametrize("name", motor_names())
def test_current_loop_margin_at_its_worst_point_and_better_elsewhere(name):
    motor = load_drive(name).motor
    loop = ds.design(load_drive(name)).loops["current"]
    z = control.tf("z")
    z.dt = H
    low, high = ds.extreme_inductances(motor.energy, OVERLOAD * motor.rated_current)
    margins = []
    for inductance in (low, motor.inductance_d, motor.inductance_q, high):
        winding = control.sample_system(control.tf([1], [inductance, motor.resistance]), H, "zoh")
        controller = control.tf([loop.kp, loop.ki * H - loop.kp], [1, -1], H)
        whole = controller * winding * control.tf([1], [1, 0], H) * window()
        assert np.abs(control.feedback(whole, 1).poles()).max() < 1.0
        margins.append(control.stability_margins(whole, method="frd")[1])
    assert margins[0] == pytest.approx(loop.phase_margin_deg, abs=0.5)
    assert loop.crossover <= 2 * np.pi * 500.0 / ds.INJECTION_RATIO * 1.001
    assert min(margins) > 59.9


def tracking_by_hand(motor, gains):
    """Return the open tracking loop as a transfer function."""
    d, ki = 0.75 * N - 0.5, H * H * gains.ki
    share = motor.inductance_q / (motor.inductance_q - motor.inductance_d)
    axis = np.array([H * gains.kp + ki, -H * gains.kp])
    taps = np.repeat([0.5, 1.0, 0.5], N // 2) / N
    through, shift = np.polymul(axis, taps), np.eye(13)[0]  # z^12
    frame = (
        np.polymul(through, [1, 0])
        if share < 0
        else np.polymul(np.polysub(axis, [ki * d, -ki * d]), shift)
    )
    return control.tf(
        np.polyadd(share * frame, (1 - share) * through), np.polymul([1, -2, 1], shift), H
    )


@pytest.mark.parametrize("name", motor_names())
def test_tracking_loop_by_transfer_function(name):
    """Poles inside the circle, and the phase at the crossover, from polynomials over (z-1)^2 z^12
    by hand."""
    drive = load_drive(name)
    loop = ds.design(drive).loops["tracking"]
    whole = tracking_by_hand(drive.motor, loop)
    assert np.abs(control.feedback(whole, 1).poles()).max() < 1.0 - 1e-6
    at = complex(whole(np.exp(1j * loop.crossover * H)))
    assert abs(at) == pytest.approx(1.0, rel=2e-3)
    assert np.degrees(np.angle(-at)) % 360 == pytest.approx(loop.phase_margin_deg, abs=0.3)
    assert loop.phase_margin_deg >= ds.TRACKING_MARGIN - 0.1
    assert loop.crossover <= 2 * np.pi * 500.0 / ds.INJECTION_RATIO * 1.001


@pytest.mark.parametrize("tracking", sorted(PUBLISHED))
@pytest.mark.parametrize("name", ["ipm", "ipm_exchanged", "spm_exchanged"])
def test_published_gains_are_taken_or_refused_as_the_poles_say(name, tracking):
    """VESC's 1200 1/s are too much for the IPM as printed at 500 Hz; where poles are inside, they
    are taken."""
    drive = load_drive(name)
    drive = dataclasses.replace(
        drive, injection=dataclasses.replace(drive.injection, tracking=tracking)
    )
    gains = PUBLISHED[tracking](
        N * H, 1.0 / drive.motor.inductance_d, 1.0 / drive.motor.inductance_q
    )
    worst = np.abs(control.feedback(tracking_by_hand(drive.motor, gains), 1).poles()).max()
    assert (worst > 1.0) == ((name, tracking) == ("ipm", "vesc"))
    if worst > 1.0:
        with pytest.raises(
            BadInput,
            match="no margin at an injection of 500 Hz; inject faster, or leave tracking out",
        ):
            ds.design(drive, published=True)
        return
    made = ds.design(drive, published=True)
    assert made.loops["tracking"].bandwidth == made.loops["tracking"].crossover
    assert (
        (made.tuning.kp, made.tuning.ki)
        == (made.loops["tracking"].kp, made.loops["tracking"].ki)
        == gains
    )


@pytest.mark.parametrize("tracking", sorted(PUBLISHED))
def test_published_gains_act_on_type_2_loops_only(tracking):
    """All others, and what Kalman filters are told of the speed, stay as designed to the bit."""
    plain = load_drive("ipm_exchanged")
    drive = dataclasses.replace(
        plain, injection=dataclasses.replace(plain.injection, tracking=tracking)
    )
    designed, published = ds.design(plain), ds.design(drive, published=True)
    assert ds.design(drive) == designed
    assert published.tuning == designed.tuning._replace(
        kp=published.tuning.kp, ki=published.tuning.ki
    )
    scene = Scenario("s", (Segment(0.05, 0.5),), start_up=False)
    runs = [
        simulate(each, scene, load_estimator("ekf")).recording.theta_hat for each in (plain, drive)
    ]
    assert np.array_equal(*runs)
    own = {name for name in estimator_names() if load_estimator(name).takes_published}
    assert own == {
        "qnull",
        "inversion",
        "rotating",
        "hfi45",
        "vesc_hfi",
        "random_frequency",
        "table",
        "arbitrary",
        "fluxdemod",
        "monitor",
    }


def test_a_ramp_of_speed_lags_as_published_gains_say():
    """Acceleration over VESC's ki (10 x 0.3 over the injection's period) behind the rotor, 250
    times the designed lag.

    Without load, ten integral times (40 ms) after the ramp began; the noise of this mean is below 2
    mrad.
    """
    drive, h = load_drive("ipm_exchanged"), 50e-6
    converter = dataclasses.replace(drive.converter, sampling_period=h, pwm_frequency=1.0 / h)
    injection = dataclasses.replace(
        drive.injection, frequency=0.5 / h, amplitude=100.0, tracking="vesc"
    )
    drive = dataclasses.replace(drive, converter=converter, injection=injection)
    scene = Scenario("s", (Segment(0.8, 0.0, 0.5, ramp=0.8),), "driven", start_up=False)
    run = simulate(drive, scene, load_estimator("vesc_hfi"))
    lag = 0.5 * drive.motor.rated_omega / 0.8 / (10.0 * 0.3 / (2.0 * h))
    assert run.recording.between(0.4, 0.79).error.mean() == pytest.approx(lag, abs=4e-3)


def test_estimators_hold_with_published_gains():
    """20 kHz, two samples an injection period, rated load at a tenth of rated speed; 1 degree as
    elsewhere."""
    drive, h = load_drive("ipm_exchanged"), 50e-6
    converter = dataclasses.replace(drive.converter, sampling_period=h, pwm_frequency=1.0 / h)
    scene = Scenario(
        "s", (Segment(0.2, 1.0, 0.1, ramp=0.1), Segment(0.1, 1.0, 0.1)), "driven", start_up=False
    )
    for tracking, name in (("vesc", "vesc_hfi"), ("mesc", "hfi45")):
        injection = dataclasses.replace(
            drive.injection, frequency=0.5 / h, amplitude=100.0, tracking=tracking
        )
        run = simulate(
            dataclasses.replace(drive, converter=converter, injection=injection),
            scene,
            load_estimator(name),
        )
        assert abs(np.degrees(run.recording.between(0.2, 0.3).error.mean())) < 1.0


def test_tracking_model_tells_where_the_loop_rings():
    """For the IPM as printed (share -1) the model's phase margin vanishes between 230 and 400
    rad/s: so it rings."""
    drive = load_drive("ipm")
    grid, plant = (
        ds.frequency_grid(H),
        ds.SampledMotor(N, H, np.nan, np.nan, np.nan, np.nan, share=-0.993),
    )
    assert ds.crossing(ds.tracking_loop(plant, grid, 230.0)[0], grid)[0] > 15.0
    assert ds.crossing(ds.tracking_loop(plant, grid, 400.0)[0], grid)[0] < -5.0
    assert spread(drive, 230.0) < 1.0
    assert spread(drive, 400.0) > 5.0


def spread(drive, w0):
    """Return the standard deviation of the error (degrees) at standstill with tracking bandwidth
    w0."""
    sim = import_module("sandbox.drive.simulate")  # the name in `sandbox` is the function
    gains = ds.design(drive)
    tuned = dataclasses.replace(gains, tuning=gains.tuning._replace(kp=2 * w0, ki=w0**2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sim, "design", lambda *_: tuned)
        run = sim.simulate(
            drive, Scenario("still", (Segment(0.5),)), load_estimator("qnull"), seed=1
        )
    return float(np.degrees(run.recording.between(run.start_time + 0.3, 9.0).error).std())


@pytest.mark.skipif(
    not hasattr(control, "disk_margins"), reason="control below 0.10.2 has no disk margins"
)
def test_disk_margin_is_python_controls():
    """Balanced disk margin of the current loop as a transfer function."""
    motor = load_drive("ipm_exchanged").motor
    loop = ds.design(load_drive("ipm_exchanged")).loops["current"]
    low, _ = ds.extreme_inductances(motor.energy, OVERLOAD * motor.rated_current)
    winding = control.sample_system(control.tf([1], [low, motor.resistance]), H, "zoh")
    whole = (
        control.tf([loop.kp, loop.ki * H - loop.kp], [1, -1], H)
        * winding
        * control.tf([1], [1, 0], H)
        * window()
    )
    omega = np.geomspace(1.0, 0.999 * np.pi / H, 4000)
    assert loop.disk_margin == pytest.approx(control.disk_margins(whole, omega)[0], rel=2e-3)


def test_speed_loop_by_simulation():
    """A step of the designed loop: crossover sets the rise, 60 degrees of phase margin keep the
    overshoot small.

    (The SPM's assumed magnet is so strong that the feed-forward's kick alone carries most of a
    step.)
    """
    drive = load_drive("ipm_exchanged")
    loop = ds.design(drive).loops["speed"]
    wait = 12.0 / loop.crossover
    scenario = Scenario(
        "s", (Segment(0.2), Segment(wait, 0.0, 0.01)), rotor="free", reference="speed"
    )
    r = simulate(drive, scenario, load_estimator("ekf"), closed_loop=False).recording
    t, w = r.t - (r.t[-1] - wait), r.omega / (0.01 * drive.motor.rated_omega)
    reached = t[np.argmax((t > 0) & (w > 0.63))]
    # first order with that crossover: 1/crossover
    assert 0.5 / loop.crossover < reached < 1.8 / loop.crossover
    assert w.max() < 1.35


def test_design_is_remembered(tmp_path, monkeypatch):
    monkeypatch.setenv("SENSORLESS_CACHE", str(tmp_path))
    first = ds.design(load_drive("ipm"))
    files = list((tmp_path / "designs").glob("*.kept"))
    assert len(files) == 1
    monkeypatch.setattr(ds, "design_loops", lambda *a: pytest.fail("designed again"))
    assert ds.design(load_drive("ipm")) == first
    monkeypatch.undo()
    monkeypatch.setenv("SENSORLESS_CACHE", str(tmp_path))
    text = files[0].read_text()
    for damage in (
        "{ broken",
        text.replace("1", "2", 1),
        re.sub(r"(\"kp\": \d)", r"\g<1>7", text),
    ):  # a number changed, too
        files[0].write_text(damage)
        assert ds.design(load_drive("ipm")) == first
        assert files[0].read_text() == text


def test_gains_scale_with_the_motor():
    """Twice the inertia halves the torque gain: the speed controller's gain doubles, its bandwidth
    stays."""
    drive = load_drive("ipm_exchanged")
    heavy = dataclasses.replace(
        drive, motor=dataclasses.replace(drive.motor, inertia=2 * drive.motor.inertia)
    )
    a, b = ds.design(drive).loops["speed"], ds.design(heavy).loops["speed"]
    assert b.bandwidth == pytest.approx(a.bandwidth, rel=1e-4)
    assert b.kp == pytest.approx(2 * a.kp, rel=1e-4)


def test_a_winding_far_faster_than_sampling_is_refused_at_once():
    """L/R = 1 ns: a tenth of it a step (LARGEST_DECAY), so 250 us take 2 500 000 steps, 3 s (12 000
    samples) hours."""
    drive = load_drive("ipm_exchanged")
    quick = {"resistance": 1e3, "inductance_d": 1e-6, "inductance_q": 2e-6} | dict.fromkeys(
        ALPHAS, 0.0
    )
    drive = dataclasses.replace(drive, motor=dataclasses.replace(drive.motor, **quick))
    with pytest.raises(
        BadInput,
        match=r"12000 samples of 2500000 plant steps of 1e-10 s are more than 4e\+09 steps",
    ):
        simulate(drive, Scenario("s", (Segment(3.0),), start_up=False), load_estimator("qnull"))


@pytest.mark.parametrize("name", motor_names())
def test_each_loop_is_as_fast_as_its_margin_and_its_crossover_let_it(name):
    """60 degrees (tracking: 45) or a crossover of an eighth of the injection's frequency, whichever
    comes first."""
    drive = load_drive(name)
    highest = 2.0 * np.pi * drive.injection.frequency / 8.0
    for kind, least in (("current", 60.0), ("tracking", 45.0), ("speed", 60.0)):
        loop = ds.design(drive).loops[kind]
        spare = min(loop.phase_margin_deg / least - 1.0, 1.0 - loop.crossover / highest)
        assert spare == pytest.approx(0.0, abs=3e-3), kind  # the grid's step in frequency


def test_starting_up_waits_eight_time_constants_and_averages_sixteen_milliseconds():
    """In whole periods of the injection, 2 ms: 8 ones; of the current loop's time constant the next
    larger number."""
    drive = load_drive("ipm_exchanged")
    found = ds.design(drive)
    assert found.tuning.average == 8
    assert found.tuning.settle == math.ceil(8.0 / found.loops["current"].bandwidth / 2e-3)
    got = ds.design(drive, start_up=False).tuning
    assert (got.settle, got.average) == (0, 0)


def test_what_a_voltage_may_be_off_is_a_four_hundredth_of_the_link():
    drive = load_drive("ipm_exchanged")
    # Wb in a sample
    sigma = 0.0025 * drive.converter.dc_bus_voltage * drive.converter.sampling_period
    assert ds.design(drive).tuning.flux_variance == pytest.approx(sigma**2)


@pytest.mark.parametrize("lag", [0.5, 2.0])
def test_a_double_integrator_starts_at_minus_180_degrees(lag):
    """(1 + j w) exp(-j lag w) / (j w)^2 with a gain that makes it cross at w = 1: its margin is 45
    degrees less the lag, the phase unwrapped from just above or just below -180 degrees."""
    w = np.geomspace(1e-3, 10.0, 4000)
    loop = (1.0 + 1j * w) * np.exp(-1j * lag * w) / (1j * w) ** 2 / np.sqrt(2.0)
    margin, at = ds.crossing(loop, w)
    assert at == pytest.approx(1.0, rel=5e-3)
    assert margin == pytest.approx(45.0 - np.degrees(lag), abs=0.5)


def test_disk_margin_of_an_integrator():
    """1/(j w): |1 - L| = |1 + L| at every w, so that the balanced sensitivity is 1/2 and the margin
    2."""
    w = np.geomspace(1e-2, 1e2, 500)
    assert ds.margins(1.0 / (1j * w), w)[2] == pytest.approx(2.0)


LAGS = {
    "never turned": lambda w: 1.0 / (1j * w),
    "never crossed": lambda w: 0.5 / (1j * w + 10.0),
    "late": lambda w: np.exp(-1e-3j * w) * 200.0 / (1j * w * (1.0 + 1j * w / 50.0)),
    "resonant": lambda w: (
        np.exp(-1e-3j * w) * 9e4 / ((300.0**2 - w**2 + 6j * w) * (0.1 + 1j * w / 50.0))
    ),
}


@pytest.mark.parametrize("name", LAGS)
def test_margins_are_those_that_control_finds(name):
    """By splines through the same grid, one frequency at a time."""
    w = np.geomspace(1e-2, 1e4, 1500)
    gain, phase, _, _, crossover, _ = control.stability_margins(control.frd(LAGS[name](w), w))
    found = ds.margins(LAGS[name](w), w)
    assert (found[0], found[1]) == pytest.approx((gain, phase), rel=1e-9)
    assert found[3] == pytest.approx(crossover, rel=1e-9, nan_ok=True)


def test_a_loop_of_several_variants_tells_the_least_margins():
    """b/(j w) with a lag of one or three samples: 90 degrees less lag x b.  The slower one has 60
    degrees at b = (pi/6)/(3 H), and the smaller disk; the bandwidth is the crossover of both."""
    w = ds.frequency_grid(H)
    variants = [
        lambda w, b, lag=lag: (b / (1j * w) * np.exp(-1j * lag * w), b, 0.0) for lag in (H, 3.0 * H)
    ]
    for order in (variants, variants[::-1]):
        found = ds.tuned_loop(order, H, 60.0, 1.0 / H)
        assert found.bandwidth == pytest.approx(math.pi / 18.0 / H, rel=1e-3)
        assert found.phase_margin_deg == pytest.approx(60.0, abs=0.05)
        disks = [ds.margins(loop(w, found.bandwidth)[0], w)[2] for loop in variants]
        assert found.disk_margin == disks[1] < disks[0]


def test_the_speed_up_to_which_the_current_loop_holds():
    """The winding's recursion i(k+1) = p i(k) + g u(k-1) with p turned by omega, polynomials over
    (z-1) by hand: below the speed found the sensitivity's peak is within its limit, above it is
    not."""
    drive = load_drive("ipm_exchanged")
    loop, motor = ds.design(drive).loops["current"], drive.motor
    inductances = ds.extreme_inductances(motor.energy, OVERLOAD * motor.rated_current)
    z = np.exp(1j * np.linspace(-np.pi, np.pi, 40_001)[1:-1] + 1e-9j)

    def modulus(omega):
        """Return the least distance of the open loop from -1."""
        out = []
        for inductance in inductances:
            p = np.exp(-(motor.resistance / inductance + 1j * omega) * H)
            g = (1.0 - np.exp(-motor.resistance / inductance * H)) / motor.resistance
            above = (
                np.polyval([loop.kp, loop.ki * H - loop.kp], z)
                * g
                * np.polyval(np.full(N, 1.0 / N), z)
            )
            out.append(
                np.min(np.abs(1.0 + above / np.polyval(np.polymul([1, -1], [1, -p]), z) / z**N))
            )
        return min(out)

    assert modulus(0.93 * loop.highest) >= ds.LEAST_MODULUS - 2e-3
    assert modulus(1.001 * loop.highest) < ds.LEAST_MODULUS + 2e-3


def test_readings_of_three_phases_blur_each_axis_by_two_thirds():
    """A vector of three readings with a deviation s each has sqrt(2/3) s along any axis; a step of
    resolution q adds q^2/12 to each."""
    drive = load_drive("ipm_exchanged")
    noisy = dataclasses.replace(drive.converter, current_noise=0.03, current_resolution=0.06)
    tuning = ds.design(dataclasses.replace(drive, converter=noisy)).tuning
    assert tuning.current_variance == pytest.approx(2.0 / 3.0 * (0.03**2 + 0.06**2 / 12.0))
