"""A diagnosis within little memory: the same answers to the bit, what is cut short, what is
refused."""

import dataclasses
import os

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.evidence.fit import coordinates_of, fit
from sandbox.gap.evidence.normal import ParameterPoint, counted, normal
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.shortened import share, shortened
from sandbox.plant.sets import complete
from sandbox.replay import memory
from sandbox.replay.memory import Kept, Spill, spare
from sandbox.replay.replay import prepare, replay
from sandbox.replay.segments import ChannelSlopes, Gathering
from sandbox.replay.stretches import Stretch, stretches
from tests.sandbox.gap.conftest import CASES, DEAD_TIME, DRIVE, small_campaign
from tests.sandbox.replay.benches import campaign

# a late pattern: readings of one stretch belong to the next one
EFFECTS = ("dead_time", "pwm_delay")
# bytes: slopes of the small campaign are 3.1 MB, of which a quarter of this is kept; stretches of
# 400
TIGHT = 3e6


def point(left=np.inf):
    """Return a point of a campaign whose voltages come late, of which so many bytes are to
    spare."""
    effects = {"dead_time.time": DEAD_TIME, "pwm_delay.delay": 4e-6}
    prepared = dataclasses.replace(prepare(small_campaign(effects, CASES[1:])), spare=left)
    turned = {prepared.recordings[0].file: 1e-4}
    values = complete(DRIVE.motor, DRIVE.converter, {"pwm_delay.delay": 3e-6})
    return ParameterPoint(prepared, values, turned)


def equations(left, workers=1):
    """Return the normal equations at a point, and at two others with the same slopes."""
    at = point(left)
    n = normal(at, coordinates_of(at, EFFECTS), workers=workers)
    step = np.array([0.1 * c.deviation for c in n.coordinates]) * (np.arange(len(n.x)) < 3)
    others = [
        dataclasses.replace(at.moved(n.coordinates, n.x + k * step), turns=at.turns) for k in (1, 2)
    ]
    return [n, *n.at_each(others, workers=workers)]


def test_slopes_in_a_file_are_the_same_to_the_bit():
    """Recordings in stretches of three blocks, slopes written and read: every number as in memory,
    on two threads."""
    for one, other in zip(equations(np.inf), equations(TIGHT, 2), strict=True):
        assert not any(isinstance(r, Kept) for r in one.rows)
        assert all(isinstance(r, Kept) for r in other.rows)
        assert np.array_equal(one.x, other.x)
        for a, b in zip(one.segments, other.segments, strict=True):
            assert (a.recording, a.channel) == (b.recording, b.channel)
            for name in ("places", "a", "g", "ssr", "n"):
                assert np.array_equal(getattr(a, name), getattr(b, name)), name
        for a, b in zip(one.rows, other.rows, strict=True):
            assert np.array_equal(a, np.asarray(b))
            assert np.array_equal(a.reshape(-1), b.reshape(-1))


def test_a_free_rotor_and_an_eccentric_encoder_go_on_from_stretch_to_stretch():
    """Motion, twist of the shaft and the encoder's error at a stretch's end are those that the next
    begins with."""
    recorded = campaign({}, cases=(("free", 0.0), ("driven", 20.0)))
    motor, shaft = recorded.drive.motor, "shaft_compliance"
    wanted = {
        "encoder_eccentricity.amplitude_mech": 1e-3,
        "pwm_delay.delay": 1e-5,
        f"{shaft}.stiffness": 50.0,
    }
    values = complete(
        motor, recorded.drive.converter, {**wanted, f"{shaft}.load_inertia": 0.5 * motor.inertia}
    )
    found = []
    for left in (np.inf, 1e5):  # 100 kB: stretches of one block, 200 samples
        prepared = dataclasses.replace(prepare(recorded, steps=1), spare=left)
        n = normal(
            ParameterPoint(prepared, values),
            coordinates_of(ParameterPoint(prepared, values), ("coulomb_friction",)),
        )
        found.append([n, n.at(ParameterPoint(prepared, values))])
    for one, other in zip(*found, strict=True):
        assert {s.channel for s in one.segments} == {"current", "motion", "angle"}
        for a, b in zip(one.segments, other.segments, strict=True):
            assert all(np.array_equal(getattr(a, x), getattr(b, x)) for x in ("a", "g", "ssr", "n"))


def test_a_fit_is_the_same_to_the_bit():
    one, other = (fit(point(left), ("dead_time",), weights_of(3)) for left in (np.inf, TIGHT))
    assert one.objective == other.objective
    assert one.simulations == other.simulations
    assert dict(one.point.values) == dict(other.point.values)


@pytest.mark.parametrize(("left", "waits"), [(1.09e7, True), (1.11e7, False)])
def test_a_quarter_of_what_is_left_may_be_slopes(left, waits):
    """26 columns (23 ordinary coordinates, an effect's, two turns) of 1200 samples of 3, 4 and 4
    readings: 2.75 MB."""
    at = point(left)
    n = normal(at, coordinates_of(at, EFFECTS))
    assert isinstance(n.rows[0], Kept) is waits


def test_stretches_by_hand():
    """Groups of at most so many samples; a long recording cut at multiples of a block, a last bit
    of one left on."""
    assert stretches([10, 20, 30], np.inf) == [[(0, 0, 10, 10), (1, 0, 20, 20), (2, 0, 30, 30)]]
    assert stretches([10, 20, 30], 30) == [[(0, 0, 10, 10), (1, 0, 20, 20)], [(2, 0, 30, 30)]]
    assert stretches([10, 65, 5], 35, 10) == [
        [(0, 0, 10, 10)],
        [(1, 0, 30, 65)],
        [(1, 30, 65, 65)],
        [(2, 0, 5, 5)],
    ]
    assert stretches([30], 30, 7) == [[(0, 0, 30, 30)]]
    assert stretches([25], 1, 10) == [[(0, 0, 10, 25)], [(0, 10, 25, 25)]]


def test_what_acts_in_one_stretch_alone_counts():
    """Two stretches of two samples: the first column acts in one, the third in the other, the
    second in none."""
    spill, own, columns = Spill(96), Gathering(0, 3, 4, ()), np.arange(3)
    for first, row in ((0, [1.0, 0.0, 0.0]), (2, [0.0, 0.0, 2.0])):
        part = ChannelSlopes(
            "motion",
            np.array([[row], [row]]),
            np.ones((2, 1)),
            columns,
            np.array([1.0, 1.0, -1.0]),
            5 + columns,
        )
        own.add(part, spill, Stretch(0, first, first + 2, 4), 4)
    segment, rows = own.squared(0, part, spill, 4)
    assert segment.places.tolist() == [5, 7]
    assert np.asarray(rows).tolist() == [[1.0, 0.0], [1.0, 0.0], [0.0, -2.0], [0.0, -2.0]]
    assert segment.a.tolist() == [[[2.0, 0.0], [0.0, 8.0]]]
    assert segment.g.tolist() == [[2.0, -4.0]]


def test_what_a_limit_leaves():
    """0.6 GB of its own, 700 bytes a sample; 0.1 GB to work in."""
    assert spare(8.0, 100_000) == pytest.approx(8e9 - 0.6e9 - 7e7)
    assert spare(0.8, 100_000) == pytest.approx(1.3e8)
    with pytest.raises(
        BadInput,
        match=r"--memory 0\.7 GB is too little for a campaign of 100000 samples; give 0\.8 or",
    ):
        spare(0.7, 100_000)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(BadInput, match="is no amount of memory"):
            spare(wrong, 1)


def test_too_little_memory_is_refused_before_anything_runs(small_folder):
    said = []
    with pytest.raises(
        BadInput, match=r"--memory 0\.5 GB is too little .* of 4800 samples; give 0\.8 or more"
    ):
        diagnosis_of(small_folder, memory=0.5, report=said.append)
    assert said == ["reading"]


def test_a_file_that_cannot_be(tmp_path, monkeypatch):
    """No room, no folder: one sentence that says what to do; the folder of temporary files is one's
    own to choose."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with pytest.raises(
        BadInput, match=r"1000000000\.0 GB of slopes fit neither into memory nor .* TMPDIR"
    ):
        Spill(1e18)
    held = Spill(24)
    held.write(0, np.array([[1.0, 2.0], [3.0, 4.0]]))
    held.write(8, np.array([[5.0]]))
    assert np.array_equal(held.read(0, (2, 2)), [[1.0, 5.0], [3.0, 4.0]])
    assert os.listdir(tmp_path) == []
    file = held.file
    del held
    assert file.closed
    monkeypatch.setenv("TMPDIR", str(tmp_path / "none"))
    with pytest.raises(BadInput, match="nor can a file hold them"):
        Spill(8)
    assert memory.spill_folder() == str(tmp_path / "none")


def test_regressions_are_made_on_what_memory_allows():
    """Half of what 3600 samples need: the middle half of each recording, the whole of it with
    more."""
    # bytes: 198 regressors of two numbers, made of as many, twice copied
    at = point(0.5 * 14e3 * 3600)
    assert share(at) == pytest.approx(0.5)
    short = shortened(at)
    assert [r.samples for r in short.prepared.recordings] == [600] * 3
    whole, part = at.prepared.recordings[1], short.prepared.recordings[1]
    assert np.array_equal(part.read, whole.read[300:900])
    assert np.array_equal(part.motion.angle, whole.motion.angle[300:900])
    assert part.loaded
    assert shortened(point()).prepared.samples == 3600
    alone, all_of_it = (replay(p.prepared, [p.values]).currents[1][:, :, 0] for p in (short, at))
    miss = np.abs(alone - all_of_it[300:900]) / at.prepared.noise_std
    # it starts from what was read, which is not what this point predicts
    assert miss[0].max() > 1.0
    assert miss[-1].max() < 1e-3  # and forgets that within L/R: 75 ms later to nothing


def test_what_is_simulated_is_counted():
    """Where it is listened to: equations cost one simulation and one a move (two of them turns),
    points one each."""
    found, at = [], point()
    with counted(found.append):
        n = normal(at, coordinates_of(at, ("dead_time",)))
        n.at_each([at, at])
    n.at(at)
    assert found == [n.simulations, 2.0]
    own = [c for c in n.coordinates if c.form != "turn" and not c.mechanical]  # no rotor is free
    assert n.simulations == 1 + len(own) + 2  # three recordings' turns are moved by two
