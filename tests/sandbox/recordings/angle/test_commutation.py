"""Angles of Hall states and of counted steps: which sixth, between changes, at rest, what they
leave open."""

import math

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.recordings.angle.commutation import APART_60, APART_120, STEP, between, states_angle
from tests.sandbox.recordings.made_angles import DRIVE, RPM, SWING, ZERO, H, N, off, read, turning


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
    counted = read(
        tmp_path,
        {**columns, "tacho": sixth + 77},
        '[columns]\nsteps = {column = "tacho"}',
        rotor="driven",
    )
    np.testing.assert_allclose(
        three, counted["run"].theta + three[0] - counted["run"].theta[0], atol=1e-9
    )
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


@pytest.mark.parametrize("order", [APART_120, APART_60])
def test_many_disturbed_readings_are_blamed_themselves(order):
    """Two in a hundred rows, from row 7 on: not the sensors' places, 60 or 120 degrees apart."""
    codes = np.tile(np.repeat(order, 100), 4).astype(float)
    bad = 0.0 if order is APART_120 else 5.0
    codes[7::50] = bad
    with pytest.raises(BadInput, match=f"row 7 of column 'hall' is {bad:g}, no state"):
        states_angle("f", {"hall": codes}, {})


def test_signals_of_the_drives_frame_need_more_than_states(tmp_path):
    columns, theta = turning(SWING)
    own = {n: columns[n] for n in ("t", "u_dc", "i_a", "i_b")} | {
        "u_d": 0.0 * theta,
        "u_q": 30.0 + 0.0 * theta,
    }
    hall = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
    with pytest.raises(
        BadInput,
        match="'hall' shows to 60 degrees only; log phase currents, or map the log's speed",
    ):
        read(tmp_path, {**own, "hall": hall})


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
    """A speed that swings and reverses, read to 1 rpm: the angle is off by what states are, read
    from row to row (one row of 360 rad/s is 0.09 rad), and no longer by a good part of a sixth
    where the rotor turns round."""
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
    """Return the true angle (n,) of a rotor that swings, and the one made of sensors at some places
    (rad) and a speed.

    The speed is read to 1 rpm.
    """
    t = np.arange(n) * row
    speed = 80.0 + 30.0 * np.sin(9.0 * t)
    theta = np.concatenate([[0.0], np.cumsum(0.5 * row * (speed[1:] + speed[:-1]))])
    edges = STEP * np.arange(int(theta[-1] / STEP) + 3) + np.resize(
        places, int(theta[-1] / STEP) + 3
    )
    codes = np.array(APART_120, float)[np.searchsorted(edges, theta, side="right") % 6]
    seen = np.round(speed * RPM) / RPM
    turned = np.concatenate([[0.0], np.cumsum(0.5 * row * (seen[1:] + seen[:-1]))])
    return theta, *states_angle("f", {"hall": codes}, {}, turned)


def test_an_angle_of_states_is_smoother_than_their_rows():
    """A change is known to a row of 0.02 rad (0.006 rad rms, uniform); some changes together tell
    it better."""
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
    """Return true angle, made angle (n,), what it lies between, and the edges (n,) of the sixth
    that the states show.

    A rotor stands (s), turns 4 s at 80 rad/s and stands; its speed column reads `off` too much
    (rad/s).
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
    """The speed alone would go on by 2 to 4 rad; a sensor's place is known better than the 0.08 rad
    of a row."""
    theta, angle, count, low, high = standing(stand, off, start, places)
    assert np.all((angle > low - 0.08) & (angle < high + 0.08))
    assert np.sqrt(np.mean((angle - theta) ** 2)) < count <= STEP
    still = np.abs(np.gradient(theta)) == 0.0
    assert np.all((angle[still] > low[still] - 0.01) & (angle[still] < high[still] + 0.01))


def test_a_rotor_that_stands_between_a_sensor_and_its_place_is_left_there():
    """The first sensor stands 5 degrees late, the rotor 3 degrees beyond where it should: the sixth
    before is shown.

    With a speed that reads right nothing is held, and a row is what the angle is known to.
    """
    theta, angle, count, *_ = standing(5.0, 0.0, 6.0 * STEP + math.radians(3.0), PLACES)
    error = angle - theta
    assert np.abs(error - np.mean(error)).max() < 0.01
    assert count < 2.0 * 0.08


def test_what_an_angle_of_states_leaves_open_counts_as_noise(tmp_path):
    """The current of a rotor's frame whose angle goes to another error at each change: Euler's
    steps of its equation, within a factor of two, as the changes' spectrum is not that of one
    frequency."""
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
