"""Long recordings: which stretches stand for them, and that a replay starts in mid-recording as if it had come there.

Numbers come from the definition of the choice, from counting rows, and from the replay of the whole recording.
"""

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.gap.excerpts import CUT_TO, LEAD, LEAST, MOST, PARTS, excerpted, farthest_first
from sandbox.gap.pages.page import stretch_rows
from sandbox.gap.report.diagnosis_json import excerpts
from sandbox.recordings.campaign import Campaign, CampaignRecording

DRIVE = load_drive("ipm")
PERIOD = DRIVE.converter.sampling_period


def recording(n, file="run.parquet", rotor="driven", loaded=None):
    """Return n rows at half of rated speed without current, but with rated i_q in rows `loaded` (first, last)."""
    k = np.arange(n)
    theta = 0.5 * DRIVE.motor.pole_pairs * DRIVE.motor.rated_speed_rpm * math.pi / 30.0 * PERIOD * k
    theta = np.full(n, 0.3) if rotor == "locked" else theta
    size = np.zeros(n)
    if loaded:
        size[slice(*loaded)] = DRIVE.motor.rated_current
    abc = [size * np.cos(theta + math.pi / 2.0 - j * math.tau / 3.0) for j in range(3)]
    volts = {"u_alpha": np.zeros(n), "u_beta": np.zeros(n), "u_dc": np.full(n, 400.0)}
    columns = {"t": k * PERIOD, **volts, "theta": theta, **dict(zip(("i_a", "i_b", "i_c"), abc, strict=True))}
    return CampaignRecording(file, rotor, "none", columns)


def campaign(*recordings, drive=DRIVE):
    """Return a campaign of recordings."""
    return Campaign("long", drive, recordings, {}, {}, False)


def test_a_campaign_of_usual_length_is_left_as_it_is():
    own = campaign(recording(MOST // 2), recording(MOST // 2, "more.parquet"))
    assert excerpted(own) is own
    longer = campaign(recording(MOST + 1))
    assert excerpted(longer, math.inf) is longer
    assert 0.9 * CUT_TO < excerpted(longer).excerpts.used <= CUT_TO
    assert excerpted(own, MOST - 1).excerpts is not None


def test_the_farthest_comes_next():
    # worked out by hand: mean 3.6, so 3 first; 10 is 7 away; then 0 (3 away, from 3); then 5 (2 away)
    marks = np.array([[0.0], [3.0], [10.0], [5.0], [0.0]])
    assert farthest_first(marks, [1] * 5, 4) == [1, 2, 0, 3]
    assert farthest_first(marks, [1] * 5, 99) == [1, 2, 0, 3]  # the other 0 is like one chosen
    assert farthest_first(marks, [1, 1, 3, 1, 1], 3) == [1]  # the farthest does not fit: the rest is not chosen either


def test_what_happens_once_in_a_long_recording_is_chosen():
    n = 40 * LEAST
    rare = slice(700_100, 701_000)  # 0.1 % of the rows
    cut = excerpted(campaign(recording(n, loaded=(rare.start, rare.stop))), LEAST)
    held = [e for e in cut.excerpts.stretches if e.first < rare.stop and rare.start < e.first + e.rows]
    assert held
    assert cut.excerpts.used <= LEAST
    assert cut.excerpts.samples == n


def test_equal_stretches_spread_over_the_recording():
    n = 40 * LEAST
    cut = excerpted(campaign(recording(n)), LEAST)
    first = np.sort([e.first for e in cut.excerpts.stretches])
    assert len(first) in (PARTS - 1, PARTS)
    # farthest first halves the gaps: with 24 of 960 equal blocks none is larger than 1/16 of the whole, and a block
    assert np.max(np.diff(np.concatenate([[0], first, [n]]))) <= n / 16 + 2 * LEAST / PARTS


def test_every_kind_of_rotor_is_there():
    own = campaign(
        recording(30 * LEAST), recording(LEAST, "still.parquet", "locked"), recording(LEAST, "free.parquet", "free")
    )
    assert {r.rotor for r in excerpted(own, LEAST)} == {"locked", "driven", "free"}


def test_a_stretch_holds_its_own_rows_and_those_that_lead_in():
    own = campaign(recording(5 * LEAST), recording(100, "run-1.parquet"))
    cut = excerpted(own, LEAST)
    names = [r.file for r in cut]
    assert len(set(names)) == len(names)
    inductance = max(DRIVE.motor.inductance_d, DRIVE.motor.inductance_q)
    rows = math.ceil(0.5 * LEAD * inductance / DRIVE.motor.resistance / PERIOD) * 2
    whole = {r.file: r for r in own}
    for e, r in zip(cut.excerpts.stretches, cut, strict=True):
        long = whole[e.of]
        assert np.array_equal(r.theta, long.theta[e.first : e.first + e.rows])
        assert not np.shares_memory(r.theta, long.theta)
        assert r.t[0] == 0.0
        assert r.clock == pytest.approx(e.first * PERIOD, abs=1e-9)
        assert e.first % 2 == 0
        n = min(e.first, rows, LEAST // PARTS)
        assert len(r.lead.get("t", ())) == n
        if n:
            assert np.array_equal(r.lead["theta"], long.theta[e.first - n : e.first])


def test_too_few_samples_are_refused():
    with pytest.raises(BadInput, match="too few"):
        excerpted(campaign(recording(100)), LEAST - 1)
    with pytest.raises(BadInput, match="too few"):
        excerpted(campaign(recording(100)), math.nan)


def test_a_slow_motor_leads_in_for_no_longer_than_a_stretch():
    motor = dataclasses.replace(DRIVE.motor, resistance=1e-4)
    cut = excerpted(campaign(recording(5 * LEAST), drive=dataclasses.replace(DRIVE, motor=motor)), LEAST)
    assert max(len(r.lead.get("t", ())) for r in cut) == LEAST // PARTS


def test_the_contract_lists_the_stretches():
    cut = excerpted(campaign(recording(3 * LEAST)), LEAST)
    told = excerpts(cut.excerpts)
    assert told["samples"] == 3 * LEAST
    assert told["used"] == sum(s["rows"] for s in told["stretches"])
    assert {"of": "run.parquet", "of_rows": 3 * LEAST}.items() <= told["stretches"][0].items()
    assert excerpts(None) is None
    period = DRIVE.converter.sampling_period
    for row, e in zip(stretch_rows(cut.excerpts, period), told["stretches"], strict=True):
        times = (f"{period * x:.2f}" for x in (e["first"], e["first"] + e["rows"], 3 * LEAST))
        assert row == [e["file"], "run.parquet", *times]
