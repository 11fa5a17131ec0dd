"""Long recordings: which parts stand for them, and that a replay starts in mid-recording as if it
had come there.

Numbers come from the definition of the choice, from counting rows, and from the replay of the whole
recording.
"""

import dataclasses
import json
import math

import numpy as np
import pytest

import sandbox
from model.drive_files import load_drive
from model.effects.library import effect_names
from model.errors import BadInput
from sandbox.gap import excerpts as cutting
from sandbox.gap.excerpts import (
    CUT_TO,
    LEAST,
    MAX_SAMPLES,
    PARTS,
    SETTLED,
    Stretch,
    excerpted,
    farthest_first,
    mark_of,
    rows_to_settle,
)
from sandbox.gap.pages.page import part_rows
from sandbox.gap.report.answers import caveats
from sandbox.gap.report.diagnosis_json import excerpts
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.writing import write_campaign
from tests.sandbox.gap.conftest import CASES, DEAD_TIME, record
from tests.sandbox.gap.conftest import DRIVE as BENCH
from tests.schemas import misfits

DRIVE = load_drive("ipm")
PERIOD = DRIVE.converter.sampling_period


def recording(n, file="run.parquet", rotor="driven", loaded=None):
    """Return n rows at half of rated speed without current, but with rated i_q in rows `loaded`
    (first, last)."""
    k = np.arange(n)
    theta = 0.5 * DRIVE.motor.pole_pairs * DRIVE.motor.rated_speed_rpm * math.pi / 30.0 * PERIOD * k
    theta = np.full(n, 0.3) if rotor == "locked" else theta
    size = np.zeros(n)
    if loaded:
        size[slice(*loaded)] = DRIVE.motor.rated_current
    abc = [size * np.cos(theta + math.pi / 2.0 - j * math.tau / 3.0) for j in range(3)]
    volts = {"u_alpha": np.zeros(n), "u_beta": np.zeros(n), "u_dc": np.full(n, 400.0)}
    columns = {
        "t": k * PERIOD,
        **volts,
        "theta": theta,
        **dict(zip(("i_a", "i_b", "i_c"), abc, strict=True)),
    }
    return CampaignRecording(file, rotor, "none", columns)


def campaign(*recordings, drive=DRIVE):
    """Return a campaign of recordings."""
    return Campaign("long", drive, recordings, {}, {}, False)


def test_a_campaign_of_usual_length_is_left_as_it_is():
    own = campaign(recording(MAX_SAMPLES // 2), recording(MAX_SAMPLES // 2, "more.parquet"))
    assert excerpted(own) is own
    longer = campaign(recording(MAX_SAMPLES + 1))
    assert excerpted(longer, math.inf) is longer
    assert 0.9 * CUT_TO < excerpted(longer).excerpts.samples_used <= CUT_TO
    assert excerpted(own, MAX_SAMPLES - 1).excerpts is not None


def test_twenty_five_seconds_at_ten_kilohertz_are_used_whole_and_ten_of_a_longer_run():
    """The largest campaign of the blind checks (169 920 samples) is below the first number, the
    usual one (84 960) below the second: what the checks say holds for what is cut."""
    own = campaign(recording(250_000))
    assert excerpted(own) is own
    assert 90_000 < excerpted(campaign(recording(250_002))).excerpts.samples_used <= 100_000


def test_a_wrong_start_falls_to_seven_thousandths_before_an_excerpt():
    motor = DRIVE.motor
    rows = rows_to_settle(motor, PERIOD)
    slowest = max(motor.inductance_d, motor.inductance_q) / motor.resistance
    assert 0.8 * math.exp(-5.0) < math.exp(-rows * PERIOD / slowest) <= math.exp(-5.0)


def test_states_that_never_settle_leave_six_blocks_of_a_campaign(monkeypatch):
    monkeypatch.setattr(cutting, "rows_to_settle", lambda motor, period: 10**9)
    parts = excerpted(campaign(recording(288_000)), 96_000).excerpts.parts
    assert [part.rows for part in parts] == [16_000] * 6


def test_blocks_are_a_twenty_fourth_of_what_is_used(monkeypatch):
    monkeypatch.setattr(cutting, "rows_to_settle", lambda motor, period: 100)
    parts = excerpted(campaign(recording(288_000)), 96_000).excerpts.parts
    assert [part.rows for part in parts] == [4_000] * 24


def test_blocks_are_described_in_shares_of_rated_values():
    """Rated load torque is 1; ten times the rated current counts as three; kinds of rotor lie ten
    apart, and the first and last of four blocks three quarters of a tenth."""
    run = recording(400, loaded=(0, 400))
    run.columns["load_torque"] = np.full(400, DRIVE.motor.rated_torque)
    for phase in ("i_a", "i_b", "i_c"):
        run.columns[phase] = 10.0 * run.columns[phase]
    marks = np.array(
        [mark_of(campaign(run), Stretch(0, k, k + 100, 0)) for k in range(0, 400, 100)]
    )
    assert marks.shape == (4, 18)  # mean and scatter of eight signals, rotor, time
    assert marks[:, 1] == pytest.approx(3.0)  # i_q
    assert marks[:, 2] == pytest.approx(0.5, rel=1e-6)  # speed, as `recording` turns
    assert marks[:, 5] == pytest.approx(1.0)  # load
    assert np.ptp(marks[:, 17]) == pytest.approx(0.075)
    kinds = [
        mark_of(campaign(recording(100, rotor=r)), Stretch(0, 0, 100, 0))[16]
        for r in ("locked", "driven", "free")
    ]
    assert kinds == [0.0, 10.0, 20.0]


def test_the_farthest_comes_next():
    # worked out by hand, from 3: 10 is 7 away; then 0 (3 away, from 3); then 5 (2 away)
    marks = np.array([[0.0], [3.0], [10.0], [5.0], [0.0]])
    assert farthest_first(marks, [1] * 5, [1], 4) == [1, 2, 0, 3]
    assert farthest_first(marks, [1] * 5, [1], 99) == [1, 2, 0, 3]  # the other 0 is like one taken
    # the farthest does not fit: nor is the rest taken
    assert farthest_first(marks, [1, 1, 3, 1, 1], [1], 3) == [1]
    assert farthest_first(marks, [1] * 5, [2, 3], 3) == [2, 3, 0]


def test_what_happens_once_in_a_long_recording_is_chosen():
    n = 40 * LEAST
    rare = slice(700_100, 701_000)  # 0.1 % of the rows
    cut = excerpted(campaign(recording(n, loaded=(rare.start, rare.stop))), LEAST)
    held = [e for e in cut.excerpts.parts if e.first < rare.stop and rare.start < e.first + e.rows]
    assert held
    assert cut.excerpts.samples_used <= LEAST
    assert cut.excerpts.samples_recorded == n


def test_equal_blocks_spread_over_the_recording():
    n = 40 * LEAST
    cut = excerpted(campaign(recording(n)), LEAST)
    first = np.sort([e.first for e in cut.excerpts.parts])
    assert PARTS - 2 <= len(first) <= PARTS
    # twelve by halving gaps (none larger than 1/8 then), twelve evenly over what is left: none
    # larger than 1/12 and two blocks
    assert np.max(np.diff(np.concatenate([[0], first, [n]]))) <= n / 12 + 2 * LEAST / PARTS


def test_every_kind_of_rotor_is_there():
    own = campaign(
        recording(30 * LEAST),
        recording(LEAST, "still.parquet", "locked"),
        recording(LEAST, "free.parquet", "free"),
    )
    assert {r.rotor for r in excerpted(own, LEAST)} == {"locked", "driven", "free"}


@pytest.mark.parametrize("most", [LEAST, 20_123, 50_000])
@pytest.mark.parametrize("rotor", ["driven", "free"])
def test_a_part_holds_its_own_rows_and_those_in_which_states_settle(most, rotor):
    own = campaign(recording(5 * LEAST, rotor=rotor), recording(100, "short.parquet"))
    cut = excerpted(own, most)
    assert len({r.file for r in cut}) == len(cut)
    inductance = max(DRIVE.motor.inductance_d, DRIVE.motor.inductance_q)
    rows = math.ceil(0.5 * SETTLED * inductance / DRIVE.motor.resistance / PERIOD) * 2
    whole = {r.file: r for r in own}
    for e, r in zip(cut.excerpts.parts, cut, strict=True):
        long = whole[e.of]
        assert np.array_equal(r.theta, long.theta[e.first : e.first + e.rows])
        assert r is long or not np.shares_memory(r.theta, long.theta)
        assert r.t[0] == 0.0
        assert r.starts_at == pytest.approx(e.first * PERIOD, abs=1e-9)
        assert e.first % 2 == 0
        n = min(e.first, rows if rotor == "driven" else 2 * (e.rows // 2))
        assert len(r.settling.get("t", ())) == n
        assert n % 2 == 0  # halves of a PWM period (double update) stay what they are
        if n:
            assert np.array_equal(r.settling["theta"], long.theta[e.first - n : e.first])
            assert r.with_settling().starts_at == pytest.approx((e.first - n) * PERIOD, abs=1e-9)


def test_of_few_recordings_each_is_used_and_of_many_every_kind():
    few = campaign(
        *(recording(LEAST, f"{k}.parquet") for k in range(11)), recording(100, "short.parquet")
    )
    assert {e.of for e in excerpted(few, LEAST).excerpts.parts} == {r.file for r in few}
    assert excerpted(few, LEAST).excerpts.unused == []
    rare = dataclasses.replace(recording(900, "injected.parquet"), injection_axis="d")
    many = campaign(*(recording(LEAST, f"{k}.parquet") for k in range(60)), rare)
    cut = excerpted(many, LEAST)
    assert "injected.parquet" in {r.file for r in cut}
    assert len(cut.excerpts.unused) == 61 - len({e.of for e in cut.excerpts.parts})


def test_two_seconds_at_ten_kilohertz_are_the_least():
    cutting.check_samples(20_000)
    with pytest.raises(BadInput, match="give 20000 or more"):
        cutting.check_samples(19_999)


def test_too_few_samples_are_refused():
    with pytest.raises(BadInput, match="too few"):
        excerpted(campaign(recording(100)), LEAST - 1)
    with pytest.raises(BadInput, match="too few"):
        excerpted(campaign(recording(100)), math.nan)


def test_where_states_settle_slowly_parts_are_longer_and_fewer():
    inductance = max(DRIVE.motor.inductance_d, DRIVE.motor.inductance_q)
    # 5 L/R: 2000 rows
    motor = dataclasses.replace(DRIVE.motor, resistance=SETTLED * inductance / (1999.5 * PERIOD))
    cut = excerpted(
        campaign(recording(5 * LEAST), drive=dataclasses.replace(DRIVE, motor=motor)), LEAST
    )
    assert max(len(r.settling.get("t", ())) for r in cut) == 2000
    assert 8 <= len(cut) <= LEAST // 2000


MAP = [(0, 20_000), (24_000, 60_000)]  # rows of a recording within its map, as told


def within_map(monkeypatch, stretches):
    """Let the stretches of every recording within the motor's map be these."""
    monkeypatch.setattr(cutting, "stretches_within", lambda motor, r, least: stretches)


def test_a_recording_is_cut_where_it_leaves_the_map(monkeypatch):
    within_map(monkeypatch, MAP)
    cut = excerpted(campaign(recording(60_000, rotor="free")))
    assert [(e.first, e.rows) for e in cut.excerpts.parts] == [(0, 20_000), (24_000, 36_000)]
    assert (cut.excerpts.samples_recorded, cut.excerpts.samples_within_map) == (60_000, 56_000)
    assert cut.excerpts.samples_used == 56_000
    # the rows before the second part lie beyond the map: states cannot settle there
    assert [len(r.settling) for r in cut] == [0, 0]
    assert [r.of for r in cut] == ["run.parquet"] * 2


def test_blocks_of_a_long_one_keep_within_the_map(monkeypatch):
    within_map(monkeypatch, MAP)
    cut = excerpted(campaign(recording(60_000)), LEAST)
    assert 0.8 * LEAST < cut.excerpts.samples_used <= LEAST
    for e, r in zip(cut.excerpts.parts, cut, strict=True):
        (since,) = [a for a, b in MAP if a <= e.first and e.first + e.rows <= b]
        assert len(r.settling.get("t", ())) == min(
            e.first - since, rows_to_settle(DRIVE.motor, PERIOD)
        )


def test_nothing_within_the_map_is_said(monkeypatch):
    within_map(monkeypatch, [])
    with pytest.raises(BadInput, match=r"\[flux_map\]: currents of every recording leave the map"):
        excerpted(campaign(recording(100)))


def test_contract_and_page_list_the_parts():
    cut = excerpted(campaign(recording(3 * LEAST)), LEAST)
    found = excerpts(cut.excerpts)
    assert found["samples_recorded"] == 3 * LEAST
    assert found["samples_used"] == sum(s["rows"] for s in found["parts"])
    assert {"of": "run.parquet", "of_rows": 3 * LEAST}.items() <= found["parts"][0].items()
    assert excerpts(None) is None
    period = DRIVE.converter.sampling_period
    for row, e in zip(part_rows(cut.excerpts, period), found["parts"], strict=True):
        times = (f"{period * x:.2f}" for x in (e["first"], e["first"] + e["rows"], 3 * LEAST))
        assert row == [e["file"], "run.parquet", *times]


def test_a_long_campaign_is_diagnosed_in_parts_and_its_files_replay_it_whole(tmp_path):
    """Dead time of the switched bench, 28 000 samples of which 20 000 are used; its values meet the
    whole of it."""
    rng = np.random.default_rng(5)
    long = tuple(record(*case, {"dead_time.time": DEAD_TIME}, rng, n=7000) for case in CASES)
    folder = write_campaign(tmp_path / "long", Campaign("long", BENCH, long, {}, {}, False))
    left = ("dead_time", "stator_resistance", "current_gain")
    found = sandbox.diagnose(
        folder, samples=LEAST, exclude=[e for e in effect_names() if e not in left], jobs=1
    )
    got = json.loads(json.dumps(found.as_json()))
    assert got["hypotheses"][0]["effects"] == ["dead_time"]
    low, high = got["hypotheses"][0]["parameters"]["dead_time.time"]["ci95"]
    assert (
        abs(got["hypotheses"][0]["parameters"]["dead_time.time"]["value"] - DEAD_TIME)
        < 4.0 * (high - low) / 3.92
    )
    assert misfits("diagnosis", {"schema": 1, "command": "diagnose", "version": "", **got}) == []
    assert got["excerpts"]["samples_recorded"] == 28_000
    (said,) = [text for text in caveats(found.answers) if text.startswith("Of 28,000 samples")]
    assert "those that differ most" in said
    assert "flux map" not in said
    found.refitted.write(tmp_path)
    again = sandbox.replay(folder, tmp_path / "effects.toml", motor=tmp_path / "motor.toml")
    assert set(again.rms) == {r.file for r in long}
    # rms of 21 000 readings of noise: 1 within 4 / sqrt(2 x 21 000)
    assert max(again.rms.values()) < 1.02
