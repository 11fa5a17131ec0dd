"""Logs without an encoder: an angle of a speed, of Hall states, of counted steps, of nothing at a locked rotor."""

import dataclasses
import math
import re

import numpy as np
import pytest

import sandbox
from model.drive_files import load_drive
from model.errors import BadInput
from sandbox import Scenario, Segment, read_campaign
from sandbox.identification.ordinary import fit_ordinary
from sandbox.recordings.angle.commutation import APART_60, APART_120, STEP, between, states_angle
from sandbox.recordings.angle.zero import UNSTATED, UNTOLD, with_zero
from sandbox.recordings.campaign import CampaignRecording, Made
from sandbox.recordings.importing import read_recordings, source_of
from sandbox.recordings.motion_log import motion_only, read_motion, with_replayable

DRIVE = load_drive("ipm_exchanged")
H = DRIVE.converter.sampling_period
N = 2000
ZERO = 1.1  # rad, of the rotor at the first row
RPM = 60.0 / math.tau


def turning(speed):
    """Return columns of the linear motor in closed form at speeds (n,), rad/s electrical: i_d = 0, i_q = 1 A."""
    m, t = DRIVE.motor, np.arange(len(speed)) * H
    theta = ZERO + np.concatenate([[0.0], np.cumsum(0.5 * H * (speed[1:] + speed[:-1]))])
    turn = np.exp(1j * theta)
    flux = (1j * m.inductance_q + m.magnet_flux) * turn
    u = np.append(np.diff(flux), 0.0) / H + m.resistance * 1j * 0.5 * (turn + np.append(turn[1:], turn[-1]))
    a, b, c = ((1j * turn * np.exp(-2j * math.pi / 3 * k)).real for k in range(3))
    own = {"t": t, "u_alpha": u.real, "u_beta": u.imag, "i_a": a, "i_b": b, "i_c": c, "u_dc": np.full(len(t), 400.0)}
    return own, theta


def written(folder, columns, mapping="", rotor="free"):
    """Write a log and its map; return the map's path."""
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "run.csv", rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    motor = ("pole_pairs", "resistance", "magnet_flux", "inductance_d", "inductance_q", "inertia")
    text = f'[[recording]]\nfile = "run.csv"\nrotor = "{rotor}"\n[motor]\nrated_current = 1.2\n'
    text += "".join(f"{k} = {getattr(DRIVE.motor, k)}\n" for k in motor)
    text += f"[drive]\nsampling_period = {H}\ndc_bus_voltage = 400.0\ncurrent_noise = 0.002\n"
    (folder / "m.toml").write_text(text + mapping)
    return folder / "m.toml"


def read(folder, *args, **more):
    return read_recordings(folder, written(folder, *args, **more))


def off(angle, theta):
    """Return how far angles are from true ones (n,), degrees."""
    return np.degrees(np.angle(np.exp(1j * (angle - theta))))


SWING = 300.0 + 60.0 * np.sin(np.arange(N) / 200.0)


def test_the_angle_of_a_speed_has_the_zero_that_voltages_show(tmp_path):
    columns, theta = turning(SWING)
    found = read(tmp_path, {**columns, "erpm": np.round(SWING * RPM)}, '[columns]\nspeed = {column="erpm", unit="rpm"}')
    assert np.abs(off(found["run"].theta, theta)).max() < 1.0
    text = " ".join(f.text for f in found.findings)
    assert "the angle is made from 'erpm'" in text
    assert f"zero, {math.degrees(ZERO):.0f} degrees" in text
    assert "an offset of the angle cannot be told" in text


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3])
def test_a_zero_stays_open_by_what_the_inductance_may_be_off(tmp_path, share):
    """dL_q i_q over the flux, on the voltages of a motor whose L_q is off by so much, with 1 A and i_d = 0."""
    m = DRIVE.motor
    columns, theta = turning(SWING)
    mapping = '[columns]\nspeed = {column="erpm", unit="rpm"}\n'
    mapping += f"[uncertainty]\ninductance_q = {share}\n" if share != UNSTATED else ""
    path = written(tmp_path, {**columns, "erpm": SWING * RPM}, mapping)
    left = read_recordings(tmp_path, path)["run"].made.zero
    assert left == pytest.approx(math.hypot(share * m.inductance_q / m.magnet_flux, 0.01), rel=1e-3)
    text, stated = path.read_text(), f"inductance_q = {m.inductance_q}"
    path.write_text(text.replace(stated, f"inductance_q = {(1.0 + share) * m.inductance_q}"))
    moved = np.radians(np.abs(off(read_recordings(tmp_path, path)["run"].theta, theta)).mean())
    assert 0.6 * left < moved < 1.1 * left


def test_a_speed_that_is_a_little_off_is_followed(tmp_path):
    """0.2 % of 150 rad in 0.5 s are 0.3 rad."""
    columns, theta = turning(SWING)
    found = read(tmp_path, {**columns, "erpm": 1.002 * SWING * RPM}, '[columns]\nspeed = {column="erpm", unit="rpm"}')
    assert np.abs(off(found["run"].theta, theta)).max() < 1.5
    text = " ".join(f.text for f in found.findings)
    assert "it drifts by -0.3" in text
    assert float(re.search(r"\(([\d.e-]+) % stay open\)", text)[1]) < 0.05  # with the drift in: 0.3^2 / 12, 0.75 %


@pytest.mark.parametrize("order", [APART_120, APART_120[::-1], APART_60])
def test_hall_states_tell_a_sixth_of_a_turn(tmp_path, order):
    columns, theta = turning(SWING)
    hall = np.array(order)[np.floor(theta / STEP + 0.3).astype(int) % 6]
    found = read(tmp_path, {**columns, "h": hall}, '[columns]\nhall = {column="h"}', rotor="driven")
    assert (
        np.abs(off(found["run"].theta, theta)).max() < 5.2
    )  # a change lies anywhere within a row of 4.3 to 5.2 degrees
    assert found["run"].made.count == STEP
    assert "known to a sixth of an electrical turn" in " ".join(f.text for f in found.findings)


def test_three_sensors_and_counted_steps_are_states_too(tmp_path):
    columns, theta = turning(SWING)
    sixth = np.floor(theta / STEP + 0.3)
    code = np.array(APART_120)[sixth.astype(int) % 6]
    own = {"hall_a": code & 1, "hall_b": code >> 1 & 1, "hall_c": code >> 2}
    three = read(tmp_path, {**columns, **own}, rotor="driven")["run"].theta
    counted = read(tmp_path, {**columns, "tacho": sixth + 77}, '[columns]\nsteps = {column = "tacho"}', rotor="driven")
    np.testing.assert_allclose(three, counted["run"].theta + three[0] - counted["run"].theta[0], atol=1e-9)
    assert np.abs(off(three, theta)).max() < 5.2


def test_an_angle_passes_half_way_at_a_change_and_stays_in_its_sixth():
    sectors = np.array([0.0, 0, 0, 1, 1, 1, 2, 2, 1, 1])
    angle = between(sectors)
    assert np.all((angle >= STEP * sectors - 1e-12) & (angle <= STEP * (sectors + 1.0) + 1e-12))
    assert 0.5 * (angle[2] + angle[3]) == pytest.approx(STEP, rel=0.06)
    np.testing.assert_array_equal(between(np.full(5, 3.0)), np.full(5, 3.5 * STEP))


@pytest.mark.parametrize(
    ("codes", "message"),
    [
        ([1, 3, 9, 6, 4, 5], "row 2 of column 'h' is 9, no state of three Hall sensors"),
        ([1, 3, 4, 5, 1, 3], "row 2 of column 'h' is half a turn from the row before"),
        ([1, 3, 2.5, 6, 4, 5], "row 2 of column 'h' is no whole number"),
    ],
)
def test_states_that_cannot_be_are_refused(codes, message):
    with pytest.raises(BadInput, match=message):
        states_angle("f", {"hall": np.array(codes, dtype=float)}, {"hall": "h"})


def test_a_disturbed_reading_repeats_the_one_before():
    codes = np.repeat(APART_120, 100).astype(float)
    angle, count = states_angle("f", {"hall": codes}, {})
    assert count == STEP
    codes[250] = 7.0
    np.testing.assert_allclose(states_angle("f", {"hall": codes}, {})[0], angle)


def test_signals_of_the_drives_frame_need_more_than_states(tmp_path):
    columns, theta = turning(SWING)
    own = {n: columns[n] for n in ("t", "u_dc", "i_a", "i_b")} | {"u_d": 0.0 * theta, "u_q": 30.0 + 0.0 * theta}
    hall = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
    with pytest.raises(BadInput, match="'hall' shows to 60 degrees only; log phase currents, or map the log's speed"):
        read(tmp_path, {**own, "hall": hall})


def test_rows_without_stamps_are_counted_by_the_sampling_period(tmp_path):
    columns, theta = turning(SWING)
    own = {n: x for n, x in columns.items() if n != "t"} | {"erpm": SWING * RPM}
    found = read(tmp_path, own, '[columns]\nspeed = {column="erpm", unit="rpm"}', rotor="driven")
    assert np.abs(off(found["run"].theta, theta)).max() < 1.0


def test_a_speed_of_zero_throughout_is_a_locked_rotor(tmp_path):
    columns, _ = turning(np.zeros(N))
    mapping = '[columns]\nspeed = {column="erpm", unit="rpm"}'
    with pytest.raises(
        BadInput, match="'erpm' is zero throughout, so the rotor stands still; give it rotor = \"locked"
    ):
        read(tmp_path, {**columns, "erpm": np.zeros(N)}, mapping, rotor="driven")


def test_an_angle_that_stands_as_its_states_do_is_taken_as_read(tmp_path):
    """Signals of the drive's frame need no states then."""
    m, one = DRIVE.motor, np.ones(N)
    i = {"i_d": 0.0 * one, "i_q": one, "u_d": 0.0 * one, "u_q": m.resistance * one}
    own = {"t": np.arange(N) * H, "theta": ZERO * one, "hall": 3 * one, **i, "u_dc": 400.0 * one}
    found = read(tmp_path, own, rotor="driven")["run"]
    np.testing.assert_allclose(found.theta, ZERO)
    assert found.made is None


@pytest.mark.parametrize("order", [APART_120, APART_120[::-1]])
def test_states_follow_the_speed_between_their_changes(order):
    """A speed that swings and reverses, read to 1 rpm: the angle is off by what states are, read from row to row (one
    row of 360 rad/s is 0.09 rad), and no longer by a good part of a sixth where the rotor turns round."""
    t = np.arange(4000) * H
    speed = 60.0 + 300.0 * np.cos(6.0 * t)
    theta = ZERO + np.concatenate([[0.0], np.cumsum(0.5 * H * (speed[1:] + speed[:-1]))])
    codes = np.array(order, float)[np.floor(theta / STEP).astype(int) % 6]
    turned = np.concatenate(
        [[0.0], np.cumsum(0.5 * H * (np.round(speed[1:] * RPM) + np.round(speed[:-1] * RPM)) / RPM)]
    )
    sense = 1.0 if order == APART_120 else -1.0
    followed, count = states_angle("f", {"hall": codes}, {}, turned)
    alone, step = states_angle("f", {"hall": codes}, {})
    errors = [np.angle(np.exp(1j * (sense * x - theta))) for x in (followed, alone)]
    one, two = (np.abs(e - np.angle(np.mean(np.exp(1j * e)))) for e in errors)
    assert one.max() < 0.1 < two.max()
    assert 4.0 * one.std() < count < 0.5 * step


def by_states(places, row=H, n=8000):
    """Return the true angle (n,) of a rotor that swings, and the one made of sensors at some places (rad) and a speed.

    The speed is read to 1 rpm.
    """
    t = np.arange(n) * row
    speed = 80.0 + 30.0 * np.sin(9.0 * t)
    theta = np.concatenate([[0.0], np.cumsum(0.5 * row * (speed[1:] + speed[:-1]))])
    edges = STEP * np.arange(int(theta[-1] / STEP) + 3) + np.resize(places, int(theta[-1] / STEP) + 3)
    codes = np.array(APART_120, float)[np.searchsorted(edges, theta, side="right") % 6]
    seen = np.round(speed * RPM) / RPM
    turned = np.concatenate([[0.0], np.cumsum(0.5 * row * (seen[1:] + seen[:-1]))])
    return theta, *states_angle("f", {"hall": codes}, {}, turned)


def test_an_angle_of_states_is_smoother_than_their_rows():
    """A change is known to a row of 0.02 rad (0.006 rad rms, uniform); some changes together tell it better."""
    theta, angle, count = by_states(np.zeros(6))
    error = angle - theta
    assert np.std(error) < 0.5 * 0.02 / math.sqrt(12.0)
    assert np.std(error) < count / math.sqrt(12.0) < 3.0 * 0.02 / math.sqrt(12.0)


def test_sensors_off_their_places_are_measured():
    """Five degrees off, the same in each turn; what is common to all is the zero."""
    places = np.radians([5.0, -3.0, 1.0, -4.0, 2.0, -1.0])
    theta, angle, _ = by_states(places)
    error = angle - theta
    assert np.std(error) < 0.2 * np.std(places)


def standing(stand, off, start, places=None, row=1e-3):
    """Return true angle, made angle (n,), what it lies between, and the edges (n,) of the sixth that the states show.

    A rotor stands (s), turns 4 s at 80 rad/s and stands; its speed column reads `off` too much (rad/s).
    """
    n, places = round(stand / row), np.zeros(6) if places is None else places
    speed = np.repeat([0.0, 80.0, 0.0], [n, round(4.0 / row), n])
    theta = start + np.concatenate([[0.0], np.cumsum(0.5 * row * (speed[1:] + speed[:-1]))])
    count = int(theta[-1] / STEP) + 3
    edges = STEP * np.arange(count) + np.resize(places, count)
    sixth = np.searchsorted(edges, theta, side="right")
    turned = np.concatenate([[0.0], np.cumsum(0.5 * row * (speed[1:] + speed[:-1]) + row * off)])
    made, width = states_angle("f", {"hall": np.array(APART_120, float)[sixth % 6]}, {}, turned)
    zero = STEP * (sixth[0] - 1)  # states count from the first one
    return theta - zero, made, width, edges[sixth - 1] - zero, edges[sixth] - zero


PLACES = np.radians([5.0, -3.0, 1.0, -4.0, 2.0, -1.0])


@pytest.mark.parametrize("places", [None, PLACES])
@pytest.mark.parametrize(("stand", "off"), [(20.0, 0.2), (20.0, -0.2), (5.0, 0.4)])
@pytest.mark.parametrize("start", [0.3, 0.8])
def test_a_rotor_that_stands_keeps_the_sixth_that_its_states_show(stand, off, start, places):
    """The speed alone would go on by 2 to 4 rad; a sensor's place is known better than the 0.08 rad of a row."""
    theta, angle, count, low, high = standing(stand, off, start, places)
    assert np.all((angle > low - 0.08) & (angle < high + 0.08))
    assert np.sqrt(np.mean((angle - theta) ** 2)) < count <= STEP
    still = np.abs(np.gradient(theta)) == 0.0
    assert np.all((angle[still] > low[still] - 0.01) & (angle[still] < high[still] + 0.01))


def test_a_rotor_that_stands_between_a_sensor_and_its_place_is_left_there():
    """The first sensor stands 5 degrees late, the rotor 3 degrees beyond where it should: the sixth before is shown.

    With a speed that reads right nothing is held, and a row is what the angle is known to.
    """
    theta, angle, count, *_ = standing(5.0, 0.0, 6.0 * STEP + math.radians(3.0), PLACES)
    error = angle - theta
    assert np.abs(error - np.mean(error)).max() < 0.01
    assert count < 2.0 * 0.08


def test_what_an_angle_of_states_leaves_open_counts_as_noise(tmp_path):
    """The current of a rotor's frame whose angle goes to another error at each change: Euler's steps of its equation,
    within a factor of two, as the changes' spectrum is not that of one frequency."""
    m, n = DRIVE.motor, 4000
    columns, theta = turning(np.full(n, 150.0))
    codes = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
    own = {**columns, "hall": codes, "rpm": np.full(n, 150.0 * RPM)}
    found = read(tmp_path, own, '[columns]\nspeed = {column="rpm", unit="rpm"}')
    (r,) = found.recordings
    turns = np.arange(0.0, theta[-1], STEP)
    errors = np.random.default_rng(0).standard_normal(len(turns)) * r.made.count / math.sqrt(12.0)
    x = np.interp(np.linspace(0.0, turns[-1], 20 * n), turns, errors)
    h, inductance = H / 20.0, min(m.inductance_d, m.inductance_q)
    drive = -m.magnet_flux * (np.gradient(x, h) + 150j * x)
    i, squares = 0j, 0.0
    for v in drive:
        i += h / inductance * (v - (m.resistance + 150j * inductance) * i)
        squares += abs(i) ** 2
    expected = math.sqrt(0.5 * squares / len(drive))
    assert 0.5 < found.unseen / expected < 2.0
    assert "leaves currents open by" in " ".join(f.text for f in found.findings)


def test_each_log_of_a_table_has_its_own_angle(tmp_path):
    """A logger that was started again: clock, place and sense of the rotor begin anew, as in a file of its own."""
    mapping = '[columns]\nspeed = {column="rpm", unit="rpm"}\nhall = {column="h"}'
    logs, thetas = [], []
    for speed in (SWING, -0.5 * SWING):
        columns, theta = turning(speed)
        hall = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
        logs.append({**columns, "h": hall, "rpm": np.round(speed * RPM)})
        thetas.append(theta)
    alone = [read(tmp_path, log, mapping, rotor="driven")["run"] for log in logs]
    joined = {n: np.concatenate([log[n] for log in logs]) for n in logs[0]}
    found = read(tmp_path, joined, mapping, rotor="driven")
    assert [r.file for r in found.recordings] == ["run-1.csv", "run-2.csv"]
    for r, own, theta in zip(found.recordings, alone, thetas, strict=True):
        np.testing.assert_allclose(r.theta, own.theta, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(r.t, own.t, rtol=0.0, atol=1e-9)
        assert r.made == own.made
        assert np.abs(off(r.theta, theta)).max() < 5.2
    made = [f for f in found.findings if "the angle is made from" in f.text]
    assert [f.file for f in made] == ["run.csv"]


def mixed(folder, first, then):
    """Write a campaign of two logs that differ; return its map's path."""
    mapping = written(folder, first)
    (folder / "run.csv").rename(folder / "first.csv")
    written(folder, then)
    text = mapping.read_text()
    mapping.write_text('[[recording]]\nfile = "first.csv"\nrotor = "free"\n' + text)
    return mapping


@pytest.mark.parametrize("turned", [False, True])
def test_recordings_without_voltages_are_left_out_beside_others(tmp_path, turned):
    """Whichever is the first: it is replayed what can be, and the other one is told."""
    columns, theta = turning(SWING)
    whole = {**columns, "theta": theta}
    without = {n: x for n, x in whole.items() if not n.startswith("u_")}
    mapping = mixed(tmp_path, *((whole, without) if turned else (without, whole)))
    assert motion_only(source_of(tmp_path, mapping)) is None
    found = read_recordings(tmp_path, mapping)
    assert [r.file for r in found.recordings] == ["first.csv" if turned else "run.csv"]
    (said,) = (f.text for f in found.findings if "left out" in f.text)
    assert said.startswith("run.csv" if turned else "first.csv")
    both = source_of(tmp_path, mixed(tmp_path, without, without))
    assert motion_only(both).startswith("no voltages were recorded, so electrical effects")
    assert len(read_motion(both, motion_only(both)).recordings) >= 1


def test_a_voltage_that_is_not_whole_is_named(tmp_path):
    columns, theta = turning(SWING)
    part = {n: x for n, x in columns.items() if n != "u_beta"}
    why = motion_only(source_of(tmp_path, written(tmp_path, {**part, "theta": theta})))
    assert why.startswith(
        "u_alpha without u_beta tell no voltage (log or map all of them), so electrical effects are no"
    )
    two = {**{n: x for n, x in part.items() if n != "u_alpha"}, "theta": theta, "d_a": 0 * theta, "d_b": 0 * theta}
    assert motion_only(source_of(tmp_path, written(tmp_path, two))).startswith(
        "d_a and d_b without d_c tell no voltage"
    )


def test_states_beside_an_encoder_are_left_out_of_a_diagnosis(tmp_path):
    columns, theta = turning(SWING)
    hall = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
    states, whole = {**columns, "hall": hall}, {**columns, "theta": theta}
    mapping = mixed(tmp_path, states, {**whole, "i_a": columns["i_a"] + 0.001})
    assert motion_only(source_of(tmp_path, mapping)) is None
    found = with_replayable(read_recordings(tmp_path, mapping))
    assert [r.file for r in found.recordings] == ["run.csv"]
    assert any(f.text.startswith("first.csv: 'hall' tell the angle to a sixth") for f in found.findings)
    alone = read_recordings(tmp_path / "first.csv", mapping)
    assert with_replayable(alone) is alone


def test_a_free_rotor_with_states_alone_is_judged_by_its_motion(tmp_path):
    columns, theta = turning(SWING)
    hall = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
    why = motion_only(source_of(tmp_path, written(tmp_path, {**columns, "hall": hall})))
    assert why.startswith("'hall' tell the angle to a sixth of an electrical turn")
    assert motion_only(source_of(tmp_path, written(tmp_path, {**columns, "theta": theta, "hall": hall}))) is None


@pytest.mark.parametrize("order", [APART_120, APART_120[::-1]])
def test_phase_currents_beside_states_become_a_torque_by_voltages_or_not_at_all(tmp_path, order):
    """i_q = 1 A on a linear motor, i_d = 0: 1.5 p flux; read 5.2 degrees off, as states are, a share 1 - cos is lost,
    and i_d = sin brings the reluctance torque (L_d - L_q) i_d i_q."""
    columns, theta = turning(SWING)
    columns["h"] = np.array(order)[np.floor(theta / STEP + 0.3).astype(int) % 6]
    m, angle = DRIVE.motor, math.radians(5.2)
    off = 1.0 - math.cos(angle) + math.sin(angle) * abs(m.inductance_d - m.inductance_q) / m.magnet_flux
    torque, hall = 1.5 * m.pole_pairs * m.magnet_flux, '[columns]\nhall = {column="h"}'
    source = source_of(tmp_path, written(tmp_path, columns, hall))
    motion = read_motion(source, motion_only(source))
    np.testing.assert_allclose(motion.recordings[0].torque, torque, rtol=off)
    columns = {n: x for n, x in columns.items() if n not in ("u_alpha", "u_beta")}
    source = source_of(tmp_path, written(tmp_path, columns, hall))
    with pytest.raises(
        BadInput, match="an angle made from 'h', whose zero is unknown; map i_q, a torque, or the rotor's"
    ):
        read_motion(source, motion_only(source))
    source = source_of(tmp_path, written(tmp_path, {**columns, "i_q": np.ones(N)}, hall))
    np.testing.assert_allclose(read_motion(source, motion_only(source)).recordings[0].torque, torque)


LOCKED = Scenario(
    "step", (Segment(0.02), Segment(0.1, load=0.5), Segment(0.1, load=-0.3, current_d=0.3)), rotor="locked",
    start_up=False, reference="current",
)  # fmt: skip
SPIN = Scenario(
    "spin", (Segment(0.05), Segment(0.2, load=0.4, speed=0.3, ramp=0.1), Segment(0.2, load=-0.3, speed=0.5, ramp=0.1)),
    rotor="driven", start_up=False,
)  # fmt: skip


def simulated(folder, scenario, effects=None):
    sandbox.simulate(DRIVE, scenario, "qnull", closed_loop=False, effects=effects, record=folder, seed=2)
    return read_campaign(folder).recordings[0]


def test_a_locked_rotor_without_an_angle_shows_its_axis(tmp_path):
    r = simulated(tmp_path / "record", LOCKED)
    own = {n: x for n, x in r.columns.items() if n not in ("theta", "load_torque")}
    found = read(tmp_path, own, rotor="locked")["run"]
    away = math.remainder(float(found.theta[0] - r.theta[0]), math.pi)  # an ellipse has two ends
    assert abs(math.degrees(away)) < 3.0
    assert np.ptp(found.theta) == 0.0


def test_resistance_and_flux_are_identified_without_an_encoder(tmp_path):
    """R 20 % and flux 10 % off, by a log that holds erpm in whole revolutions a minute."""
    m = DRIVE.motor
    planted = {"resistance": 1.2 * m.resistance, "magnet_flux": 0.9 * m.magnet_flux}
    r = simulated(
        tmp_path / "record", SPIN,
        {"stator_resistance.resistance": planted["resistance"], "magnet_flux.magnet_flux": planted["magnet_flux"]},
    )  # fmt: skip
    own = {n: x for n, x in r.columns.items() if n not in ("theta", "load_torque")}
    own["erpm"] = np.round(np.gradient(r.theta, r.t) * RPM)
    mapping = '[columns]\nspeed = {column = "erpm", unit = "rpm"}'
    alphas = {n: getattr(m, n) for n in ("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04")}
    campaign = read(tmp_path, own, mapping, rotor="driven")
    motor = dataclasses.replace(campaign.drive.motor, **alphas)
    found = fit_ordinary(dataclasses.replace(campaign, drive=dataclasses.replace(campaign.drive, motor=motor)))
    for name, value in planted.items():
        assert found.values[name] == pytest.approx(value, abs=max(4.0 * found.deviations[name], 0.01 * value))


def test_each_angle_that_was_made_has_a_zero_of_its_own(tmp_path):
    """One recording read, two made with zeros 0.06 rad and -0.04 rad off."""
    simulated(tmp_path / "record", SPIN)
    campaign = read_campaign(tmp_path / "record")
    r = campaign.recordings[0]
    more = [
        dataclasses.replace(r, file=f, columns={**r.columns, "theta": r.theta + z}, made=Made("erpm", 0.0, 0.1))
        for f, z in (("second", 0.06), ("third", -0.04))
    ]
    found = fit_ordinary(dataclasses.replace(campaign, recordings=(r, *more)))
    zeros = {n: v for n, v in found.nuisance.items() if n.startswith(("angles.", "encoder"))}
    assert zeros == {"angles.second": pytest.approx(0.06, abs=0.006), "angles.third": pytest.approx(-0.04, abs=0.006)}
    assert found.values["magnet_flux"] == pytest.approx(DRIVE.motor.magnet_flux, rel=0.01)


def test_a_zero_that_no_voltage_shows_stays_as_it_is():
    """At standstill under a constant current all is R i."""
    columns, _ = turning(np.zeros(200))
    r = CampaignRecording("run.csv", "locked", "none", {**columns, "theta": np.zeros(200)}, made=Made("", 0.0))
    same, told = with_zero(r, DRIVE, 0.1)
    assert "makes no difference" in told.text
    np.testing.assert_array_equal(same.theta, r.theta)
    assert same.made.zero == UNTOLD
