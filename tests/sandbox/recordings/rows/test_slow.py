"""A log of each 16th PWM period, against the switched bench that runs every one of them."""

import dataclasses
import itertools

import numpy as np
import pytest

import sandbox
from model.effects.library import check_inside, complete
from model.errors import BadInput
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.rows.slow import _deviation, interpolated, with_slow_rows, without_jumps
from sandbox.replay.motion.smoothing import Motion
from sandbox.replay.replay import prepare, replay
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from tests.sandbox.replay.benches import DRIVE

FAST = dataclasses.replace(DRIVE.converter, sampling_period=62.5e-6, pwm_frequency=None)
HELD, ROWS, PAIRS = 16, 120, 6
SLOW = dataclasses.replace(FAST, sampling_period=HELD * 62.5e-6, pwm_frequency=16000.0)
EXACT = 2e-5  # of rated current, as test_replay has it
MOTION = 0.1  # standard deviations: 1 % of the square of what an innovation has anyway
COUNT = 2.0 * np.pi * PAIRS / DRIVE.converter.encoder_counts / np.sqrt(12.0)
COUNTED = COUNT * DRIVE.motor.magnet_flux / DRIVE.motor.inductance_q / DRIVE.motor.rated_current
EFFECTS = {
    "none": {},
    "dead_time": {"dead_time.time": 2e-6},
    "early": {"current_sampling.delay": -8e-6},
    "late": {"pwm_delay.delay": 25e-6},
    "drop": {"device_drop.threshold": 0.8},
    "filter": {"current_filter.time_constant": 1e-4},
}


def slow_log(effects, rotor, way, speed=60.0):
    """Return a log of the switched bench whose commands are held for a row, or go straight in the
    rotor's frame."""
    b, n = quiet(bench(DRIVE.motor, FAST, effects)), HELD * ROWS
    k = np.arange(n)
    turning = speed if rotor == "driven" else 0.0
    theta, row = 0.3 + PAIRS * turning * FAST.sampling_period * k, k // HELD
    size = np.interp(
        k / HELD, np.arange(ROWS), 12.0 + 6.0 * turning * 0.1 + 4.0 * np.sin(np.arange(ROWS) / 6.0)
    )
    u = size * np.exp(1j * (theta + 1.6))
    if way == "held":
        u = u[HELD * row]
    more = (
        {"theta": theta, "speed": np.full(n, turning)}
        if rotor != "free"
        else {"theta": 0.3, "load_torque": 0.0 * k}
    )
    r = switched(b, rotor, u.real, u.imag, 400.0, **more)
    own = slice(None, None, HELD)
    columns = {
        "t": SLOW.sampling_period * np.arange(ROWS),
        "u_alpha": u.real[own],
        "u_beta": u.imag[own],
    }
    columns |= {name: r[name][own] for name in ("theta", "i_a", "i_b", "i_c")} | {
        "u_dc": np.full(ROWS, 400.0)
    }
    if rotor == "free":
        columns["load_torque"] = np.zeros(ROWS)
    one = CampaignRecording("log.csv", rotor, "none", columns)
    drive = dataclasses.replace(DRIVE, converter=SLOW)
    return with_slow_rows(Campaign("slow", drive, (one,), {}, {}, False))


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("rotor", ["locked", "driven", "free"])
@pytest.mark.parametrize("way", ["held", "interpolated"])
def test_replay_is_the_bench_that_runs_every_period(name, rotor, way):
    """The last row of interpolated commands is no longer followed by one, so it is left out.  A
    free rotor's angle is known between rows as well as a count is: as much flux over inductance may
    be left, by
    chance."""
    got = stated(slow_log(EFFECTS[name], rotor, way), way)
    found = replay(prepare(got, EFFECTS[name]), [EFFECTS[name]])
    (own,), (moved,) = found.currents, found.motion
    r = got.recordings[0]
    miss = np.stack([r.i_a, r.i_b, r.i_c], axis=1) - own[:, :, 0]
    print(
        np.abs(miss[:-1]).max() / DRIVE.motor.rated_current,
        None if moved is None else np.abs(moved).max(),
    )
    allowed = (COUNTED if rotor == "free" else EXACT) * DRIVE.motor.rated_current
    assert np.sqrt(np.mean(np.sum(miss[10:-1] ** 2, axis=1) * 2 / 3)) < allowed
    assert moved is None or np.sqrt(np.mean(moved[:-1] ** 2)) < MOTION


@pytest.mark.parametrize("rotor", ["locked", "driven", "free"])
@pytest.mark.parametrize("way", ["held", "interpolated"])
def test_recordings_show_what_commands_do_between_rows(rotor, way):
    """Beside errors of the nominal model, or nothing tells: a free rotor hardly turns here, and
    with 2 us of dead time legs lose 12.8 V, as much as a locked rotor is given."""
    for name in EFFECTS:
        assert told_way(slow_log(EFFECTS[name], rotor, way)) == (
            way if rotor != "free" and name != "dead_time" else "nothing"
        )


@pytest.mark.parametrize("way", ["held", "interpolated"])
def test_dead_time_is_not_taken_for_held_commands(way):
    """Where it holds the currents at zero the voltage is the magnet's, whatever the commands do."""
    found = {
        (dead, speed): told_way(slow_log({"dead_time.time": dead}, "driven", way, speed))
        for dead in (5e-7, 1e-6, 2e-6, 4e-6)
        for speed in (5.0, 20.0, 60.0, 200.0)
    }
    assert set(found.values()) == {way, "nothing"}
    assert {found[dead, speed] for dead in (5e-7, 1e-6) for speed in (20.0, 60.0, 200.0)} == {way}
    assert found[2e-6, 20.0] == found[2e-6, 60.0] == "nothing"


def told_way(told):
    """Return what a campaign's finding says of its commands: "held", "interpolated" or
    "nothing"."""
    text = told.findings[0].text
    assert told.drive.converter.between_rows == (
        "held" if "commands held" in text else "interpolated"
    )
    if "nothing in the recordings tells" in text:
        assert told.drive.converter.between_rows == "held"
        return "nothing"
    assert "as the recordings show" in text
    return told.drive.converter.between_rows


def test_more_recordings_of_a_gap_are_no_surer():
    """The same misfit is in each of them."""
    one = slow_log({}, "driven", "held")
    many = dataclasses.replace(one, recordings=one.recordings * 5)
    assert interpolated(many) == pytest.approx(interpolated(one))
    assert interpolated(slow_log({}, "free", "held"))[1] == np.inf


@pytest.mark.parametrize("kept", [0.0, 0.9])
def test_deviation_of_a_fitted_shape_is_that_of_drawn_misfits(kept):
    """A slow wave beside white noise, and noise of which 0.9 stays from one window to the next:
    2000 draws."""
    rng, n, sizes, found = np.random.default_rng(2), 60, [], []
    shape = np.exp(2j * np.pi * np.arange(n) / 40.0)
    for _ in range(2000):
        x = rng.standard_normal(n + 50) + 1j * rng.standard_normal(n + 50)
        for k in range(1, len(x)):
            x[k] += kept * x[k - 1]
        x = x[50:]
        sizes.append(np.vdot(shape, x) / n)  # of the real and of the imaginary shape
        found.append(
            _deviation(np.concatenate([shape.real, shape.imag]), np.concatenate([x.real, x.imag]))
        )
    most = np.sqrt(np.mean(np.abs(sizes) ** 2))  # both parts at once, as where phases agree
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(most, rel=0.1)


def test_injection_between_rows_is_refused():
    found = slow_log({}, "locked", "held")
    own = dataclasses.replace(found.recordings[0], injection_axis="d")
    with pytest.raises(
        BadInput, match=r"injection of 500 Hz needs .* log every PWM period while injecting"
    ):
        with_slow_rows(dataclasses.replace(found, recordings=(own,)))


def test_rows_that_are_no_whole_number_of_periods_are_refused():
    with pytest.raises(BadInput, match="whole multiple"):
        dataclasses.replace(SLOW, pwm_frequency=15500.0)


def test_one_row_a_period_is_so_to_1e_6():
    """An own PWM frequency that is near, not equal, is a mistake in the file."""
    dataclasses.replace(FAST, pwm_frequency=16000.0 * (1.0 + 5e-7))
    for wrong in (1.0 + 5e-6, 1.0005, 0.9995):
        with pytest.raises(BadInput, match="do not belong together"):
            dataclasses.replace(FAST, pwm_frequency=16000.0 * wrong)


def test_a_simulated_drive_samples_in_every_period():
    """A slow log's rows are no control periods: what runs a drive says so, and which sampling
    period is right."""
    slow = dataclasses.replace(DRIVE, converter=SLOW)
    for run in (
        sandbox.simulate,
        sandbox.export_drive,
        lambda drive: sandbox.export_estimator("qnull", drive),
    ):
        with pytest.raises(
            BadInput,
            match=r"16000 Hz is 16 times 1 / sampling_period.* give sampling_period = 6.25e-05",
        ):
            run(slow)


@pytest.mark.parametrize("frequency", [9000.0, 17000.0])
def test_the_sampling_period_that_is_told_is_taken(frequency):
    slow = dataclasses.replace(SLOW, sampling_period=9.0 / frequency, pwm_frequency=frequency)
    with pytest.raises(BadInput) as found:
        check_inside(DRIVE.motor, slow, complete(DRIVE.motor, slow))
    right = dataclasses.replace(slow, sampling_period=float(str(found.value).split()[-1]))
    check_inside(DRIVE.motor, right, complete(DRIVE.motor, right))


def test_a_motion_is_as_smooth_between_rows():
    """Finer instants of a cubic: its own values there, and speeds that are the slope of them."""
    motion = Motion(np.array([0.1, 0.5, 0.8]), np.array([30.0, 50.0, 10.0]))
    fine = motion.finer(1000, 0.01)
    assert np.array_equal(fine.angle[::1000], motion.angle)
    assert np.allclose(fine.speed[::1000], motion.speed)
    assert np.allclose(np.gradient(fine.angle, 1e-5)[5:2000], fine.speed[5:2000], rtol=0, atol=0.02)


def stated(told, way):
    """Return a campaign that says what its commands do."""
    converter = dataclasses.replace(told.drive.converter, between_rows=way)
    return dataclasses.replace(told, drive=dataclasses.replace(told.drive, converter=converter))


def turning_log(voltage, drive):
    """Return a recording of a rotor at 360 rad/s with commands u_q (n,) in V, currents of 0.3 A."""
    n = len(voltage)
    t = SLOW.sampling_period * np.arange(n)
    theta = 360.0 * t
    u, i = 1j * voltage * np.exp(1j * theta), 0.3j * np.exp(1j * theta)
    phases = {f"i_{x}": (i * np.exp(-2j * np.pi / 3.0 * k)).real for k, x in enumerate("abc")}
    columns = {
        "t": t,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "theta": theta,
        "u_dc": np.full(n, 400.0),
        **phases,
    }
    return CampaignRecording("log.csv", "driven", "none", columns)


def test_a_log_is_cut_where_commands_jump_between_rows():
    """Two steps of 20 V: three parts; the first rows of the latter two, three times L/R, let
    currents settle."""
    drive = stated(
        Campaign("slow", dataclasses.replace(DRIVE, converter=SLOW), (), {}, {}, False),
        "interpolated",
    ).drive
    k = np.arange(300)
    r = turning_log(
        30.0 + np.where((k >= 100) & (k < 200), 20.0, 0.0) + 0.01 * np.cos(1.7 * k), drive
    )
    parts, (finding,) = without_jumps(r, drive)
    settle = int(
        np.ceil(3.0 * DRIVE.motor.inductance_d / DRIVE.motor.resistance / SLOW.sampling_period)
    )
    assert [(p.file, p.of, len(p.t), len(p.settling.get("t", ()))) for p in parts] == [
        ("log-1.csv", "log.csv", 100, 0),
        ("log-2.csv", "log.csv", 100 - settle, settle),
        ("log-3.csv", "log.csv", 100 - settle, settle),
    ]
    assert parts[1].starts_at == pytest.approx((100 + settle) * SLOW.sampling_period)
    assert np.array_equal(parts[1].with_settling().theta, r.theta[100:200])
    assert "jumps between two rows (2 times, by 20 V after row" in finding.text
    assert (
        without_jumps(turning_log(30.0 + 20.0 * k / 300.0 + 0.01 * np.cos(1.7 * k), drive), drive)[
            0
        ][0].file
        == "log.csv"
    )


@pytest.mark.parametrize("decay", [None, 2.0])
def test_what_scattering_commands_leave_open_counts_as_noise(decay):
    """White commands of 1 V: the error of a mean of both ends, gathered by R and L row by row;
    decay: R T / L_d."""
    rng = np.random.default_rng(1)
    n, h, m = 4000, SLOW.sampling_period, DRIVE.motor
    m = m if decay is None else dataclasses.replace(m, resistance=decay * m.inductance_d / h)
    drive = dataclasses.replace(DRIVE, motor=m, converter=SLOW)
    noise = rng.standard_normal(n) + 1j * rng.standard_normal(n)
    r = turning_log(30.0 * np.ones(n), drive)
    u = r.u_alpha + 1j * r.u_beta + noise * np.exp(1j * r.theta)
    r = dataclasses.replace(r, columns={**r.columns, "u_alpha": u.real, "u_beta": u.imag})
    squares = []
    for inductance in (m.inductance_d, m.inductance_q):
        i, x, keeps = 0.0, [], np.exp(-m.resistance * h / inductance)
        for a, b in itertools.pairwise(noise.real):
            i = keeps * i + (1.0 - keeps) / m.resistance * 0.5 * (a + b)
            x.append(i)
        squares.append(np.mean(np.square(x[200:])))
    found = with_slow_rows(stated(Campaign("slow", drive, (r,), {}, {}, False), "interpolated"))
    # 4000 rows, some 500 of them independent
    assert found.unseen == pytest.approx(np.sqrt(np.mean(squares)), rel=0.1)
    assert f"leaves currents open by {found.unseen:.3g} A rms" in found.findings[-1].text


def test_two_rows_show_no_scatter():
    drive = dataclasses.replace(DRIVE, converter=SLOW)
    found = Campaign("slow", drive, (turning_log(30.0 * np.ones(2), drive),), {}, {}, False)
    assert with_slow_rows(stated(found, "interpolated")).unseen == 0.0
