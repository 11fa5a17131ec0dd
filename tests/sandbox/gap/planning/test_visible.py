"""Numbers of what recordings could tell, of a bench's plan and of its table, by hand."""

import dataclasses
import math

import numpy as np
import pytest

from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.planning import bench_plan, visible
from sandbox.gap.planning.visible import CLEAR, FAINT, Visible
from sandbox.recordings.campaign import NO_LIMITS, CampaignRecording
from tests.sandbox.gap.conftest import DRIVE
from tests.sandbox.gap.entries import named


@pytest.mark.parametrize(
    ("z", "word"),
    [(CLEAR, "clear"), (0.9 * CLEAR, "faint"), (FAINT, "faint"), (0.9 * FAINT, "not")],
)
def test_only_what_is_clear_is_what_an_experiment_tells(z, word):
    own = Visible({"a": z}, ())
    assert own.words("a") == word
    assert bench_plan.Planned(named(), "", own, ()).tells == (("a",) if word == "clear" else ())


def recorded(i_a, theta, name="r"):
    """Return a recording with a current along a, and an angle."""
    n = len(i_a)
    columns = {
        "t": np.arange(n) * 1e-3,
        "i_a": i_a,
        "i_b": np.zeros(n),
        "i_c": np.zeros(n),
        "theta": theta,
    }
    columns |= {"u_alpha": np.zeros(n), "u_beta": np.zeros(n), "u_dc": np.full(n, 400.0)}
    return CampaignRecording(f"{name}.parquet", "driven", "none", columns)


def risen(n, begin, size=1.0):
    """Return a rise of a size within 500 samples."""
    return size * np.clip((np.arange(n) - begin) / 500.0, 0.0, 1.0)


@pytest.mark.parametrize("begin", [0, 250, 500, 1000])
def test_an_excerpt_is_the_500_samples_that_move_most(begin):
    """Looked for every 250 samples."""
    found = visible.excerpt_of(recorded(risen(1500, begin), np.zeros(1500)), 40, 1e-3)
    assert len(found.t) == 500
    assert (found.t[0], found.i_a[0]) == (0.0, 0.0)
    assert found.i_a[-1] == pytest.approx(499.0 / 500.0)


def test_an_excerpt_of_a_turning_rotor_is_where_currents_move():
    """A rotor turns by 0.1 rad all the while (1500 samples), and only in the end does its current
    rise."""
    r = recorded(risen(1500, 1000), risen(1500, 0, 0.1))
    assert np.array_equal(visible.excerpt_of(r, 40, 1e-3).i_a, r.i_a[1000:])


@pytest.mark.parametrize(("begin", "before"), [(0, 0), (250, 40), (1000, 40)])
def test_before_an_excerpt_states_settle(begin, before):
    r = recorded(risen(1500, begin), np.zeros(1500))
    found = visible.excerpt_of(r, 40, 1e-3)
    assert len(found.settling["i_a"] if found.settling else ()) == before
    assert found.starts_at == pytest.approx(begin * 1e-3)
    assert np.array_equal(found.with_settling().i_a, r.i_a[begin - before : begin + 500])


def test_an_excerpt_ends_with_the_recording():
    """The 500 samples from 250 on would be one too many of 749."""
    found = visible.excerpt_of(recorded(risen(749, 249), np.zeros(749)), 40, 1e-3)
    assert len(found.t) == 500
    assert found.i_a[-1] == pytest.approx(250.0 / 500.0)


def test_what_is_short_is_looked_at_whole():
    whole = recorded(np.zeros(500), np.zeros(500))
    assert visible.excerpt_of(whole, 40, 1e-3) is whole


def test_what_ordinary_deviations_leave_by_hand():
    """3 less 1 x 1 / (2 + 4) of the coordinate beside it, whose deviation is a half; a wide one
    takes nothing."""
    a = np.array([[2.0, 1.0, 1.0], [1.0, 3.0, 1.0], [1.0, 1.0, 9.0]])
    assert visible.left_of(a, np.array([4.0, 0.0, 0.0]), [1]) == pytest.approx(
        np.array([[17.0 / 6.0]])
    )


def test_a_typical_move_by_hand():
    """A share is a whole step; else 1/1.5 of the deviation that an effect's prior has."""
    own = [
        Coordinate("s", 0.0, 3.0, "share", ("a.b",)),
        Coordinate("l", 0.0, 3.0, "linear", ("a.b",)),
    ]
    assert visible.typical_move(own, {"s": 0, "l": 1}, ["l", "s"]) == pytest.approx([2.0, 1.0])


@pytest.mark.parametrize(
    ("cosine", "sizes", "found"),
    [
        (0.9, (CLEAR, CLEAR), None),
        (0.99, (CLEAR, CLEAR), 0.99),
        (-0.99, (FAINT, FAINT), 0.99),
        (0.99, (CLEAR, 0.9 * FAINT), None),
    ],
)
def test_two_effects_look_alike_where_moves_of_either_sign_nearly_coincide(cosine, sizes, found):
    """Moves of 2 and 3 along slopes of length 1 and 4; both are to be seen at all."""
    a = 1e-3 * np.array([[1.0, 4.0 * cosine], [4.0 * cosine, 16.0]])
    got = visible.alike_pairs(
        a,
        np.zeros(2),
        {"e": ["e"], "f": ["f"]},
        {"e": 0, "f": 1},
        {"e": np.array([2.0]), "f": np.array([3.0])},
        dict(zip("ef", sizes, strict=True)),
    )
    assert got == (() if found is None else (("e", "f", pytest.approx(found)),))


def test_the_most_alike_are_told_first():
    a = np.array([[1.0, 0.985, 0.99], [0.985, 1.0, 0.0], [0.99, 0.0, 1.0]])
    groups, one = {e: [e] for e in "efg"}, dict.fromkeys("efg", np.ones(1))
    found = visible.alike_pairs(
        a, np.zeros(3), groups, {"e": 0, "f": 1, "g": 2}, one, dict.fromkeys("efg", 9.0)
    )
    assert [x[:2] for x in found] == [("e", "g"), ("e", "f")]


def test_experiments_are_in_the_order_of_what_they_add(monkeypatch):
    monkeypatch.setattr(bench_plan, "settings", lambda *_: "")
    got = [
        ("x", {"a": 9.0, "b": 5.9}),
        ("y", {"a": 6.1, "b": 6.1}),
        ("z", {"b": 99.0, "c": 9.0}),
        ("w", {"c": 7.0}),
    ]
    found = bench_plan.ordered(DRIVE, [(named(n), Visible(sizes, ())) for n, sizes in got])
    assert [(p.entry.name, p.adds) for p in found] == [("y", ("a", "b")), ("z", ("c",))]


def test_setpoints_are_told_every_millisecond():
    """At 4 kHz every fourth sample; 6 pole pairs at 60 pi rad/s: 300 rpm; half of 400 V."""
    entry = named(link=0.5, injection=(5.0, 3.0))
    entry = dataclasses.replace(
        entry, i_d=np.arange(8.0), i_q=-np.arange(8.0), speed=np.full(8, 60.0 * math.pi)
    )
    first, second = bench_plan.setpoints(entry, DRIVE)
    expected = {
        "t_s": 1e-3,
        "i_d_A": 4.0,
        "i_q_A": -4.0,
        "speed_rpm": 300.0,
        "injected_d_V": 5.0,
        "injected_q_V": 3.0,
        "link_V": 200.0,
    }
    assert second == pytest.approx(expected)
    assert first == pytest.approx(expected | {"t_s": 0.0, "i_d_A": 0.0, "i_q_A": 0.0})


def test_an_eccentric_disc_is_no_more_than_a_misaligned_one_where_the_angle_stays():
    """The offset counts as far off as the effect has it: precision 1/0.075^2 instead of
    1/0.003^2."""
    assert visible.reads_angle("encoder_eccentricity")
    assert not visible.reads_angle("encoder_offset")
    assert not visible.reads_angle("e")
    moved = {"encoder_offset": [Coordinate("o", 0.0, 0.075, "linear", ("encoder_offset.offset",))]}
    found = visible.misaligned(np.array([4.0, 0.003**-2]), {"x": 0, "o": 1}, moved)
    assert found == pytest.approx([4.0, 0.075**-2])
    # reading off by 0.03 rad, read 0.001 rad exactly, beside that offset: 0.03/hypot(0.001, 0.075)
    # deviations
    a = 1e6 * np.array([[1.0, 1.0], [1.0, 1.0]])
    left = float(visible.left_of(a, np.array([0.0, found[1]]), [0])[0, 0])
    assert 0.03 * math.sqrt(left) == pytest.approx(0.03 / math.hypot(0.001, 0.075))


def test_what_all_experiments_tell_together_is_listed():
    alone, whole = Visible({"a": 7.0, "b": 5.0}, ()), Visible({"a": 9.0, "b": 7.0, "c": 1.0}, ())
    planned = bench_plan.Plan(
        DRIVE, (bench_plan.Planned(named(), "", alone, ("a",)),), whole, NO_LIMITS
    )
    assert planned.adds == ("b",)
