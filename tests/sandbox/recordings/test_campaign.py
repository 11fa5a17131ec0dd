"""A campaign folder survives a round trip, and what is wrong in one is named."""

import dataclasses

import numpy as np
import pytest

from model.drive_files import load_drive, load_limits
from model.effects.card import Ordinary
from model.errors import BadInput
from model.parameters import Limits
from sandbox.cli import main
from sandbox.recordings.campaign import NO_LIMITS, Campaign, CampaignRecording, read_folder
from sandbox.recordings.writing import write_campaign
from tests.data import recordings_folder

N = 40


def _columns(**changes):
    names = ("u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "u_dc", "load_torque")
    rng = np.random.default_rng(1)
    columns = {"t": np.arange(N) * 250e-6, **{n: rng.normal(size=N) for n in names}}
    return {k: v for k, v in {**columns, **changes}.items() if v is not None}


def _campaign(columns=None):
    recording = CampaignRecording("locked_d.parquet", "locked", "d", columns or _columns())
    return Campaign(
        "bench",
        load_drive("ipm"),
        (recording,),
        {"resistance": 0.01},
        {"current_gain": 0.002},
        False,
    )


def _edit(folder, old, new):
    path = folder / "campaign.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_what_is_written_is_read_again(tmp_path):
    wanted = _campaign()
    found = read_folder(write_campaign(tmp_path / "c", wanted))
    assert dataclasses.replace(found.drive.motor, name="ipm") == wanted.drive.motor
    assert found.drive.converter == wanted.drive.converter
    assert found.drive.injection == wanted.drive.injection
    assert found.uncertainty == wanted.uncertainty
    assert found.background == wanted.background
    for name, values in wanted.recordings[0].columns.items():
        np.testing.assert_array_equal(found["locked_d"].columns[name], values)


def test_a_benchs_limits_are_read_and_written(tmp_path):
    bare = write_campaign(tmp_path / "bare", _campaign())
    assert "limits" not in (bare / "campaign.toml").read_text()
    assert read_folder(bare).limits == NO_LIMITS
    stated = Limits(current=3, voltage=60.0, can=("locked", "driven"))
    folder = write_campaign(tmp_path / "c", dataclasses.replace(_campaign(), limits=stated))
    assert read_folder(folder).limits == stated
    assert load_limits(folder / "campaign.toml") == stated  # what `sensorless plan --motor` reads
    for old, new, message in (
        ("current = 3", "current = 0", r"campaign.toml: \[limits\] current = 0.0 is out of range"),
        (
            "voltage = 60.0",
            "link = 60.0",
            r"unknown key in \[limits\] 'link'; did you mean 'fixed_link'\?",
        ),
        (
            '["locked", "driven"]',
            '["lokced"]',
            "unknown kind of rotor 'lokced'; did you mean 'locked'",
        ),
        (
            '["locked", "driven"]',
            '"locked"',
            r"\[limits\] can = 'locked' is no list; give some of locked, driven, free",
        ),
        ('["locked", "driven"]', "[]", "can = \\[\\] is no list"),
    ):
        text = (folder / "campaign.toml").read_text()
        _edit(folder, old, new)
        with pytest.raises(BadInput, match=message):
            read_folder(folder)
        with pytest.raises(BadInput, match=message):
            load_limits(folder / "campaign.toml")
        (folder / "campaign.toml").write_text(text)


def test_words_of_a_provenance_survive(tmp_path):
    wanted = _campaign()
    drive = dataclasses.replace(
        wanted.drive, provenance={"a b, c": 'said "so"', "plain-key_1": "x"}
    )
    found = read_folder(write_campaign(tmp_path / "c", dataclasses.replace(wanted, drive=drive)))
    assert found.drive.provenance == drive.provenance


def test_a_folder_is_written_whole_or_not_at_all(tmp_path):
    bad = _campaign(_columns())
    # pyarrow refuses two dimensions
    object.__setattr__(bad.recordings[0], "columns", {"t": np.zeros((2, 2))})
    with pytest.raises(ValueError, match=r"."):  # pyarrow's own
        write_campaign(tmp_path / "c", bad)
    assert list(tmp_path.iterdir()) == []
    write_campaign(tmp_path / "c", _campaign())
    with pytest.raises(BadInput, match="exists already"):
        write_campaign(tmp_path / "c", _campaign())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"i_b": None}, "column 'i_b' is missing"),
        ({"i_b": np.zeros(N - 1)}, "column 'i_b' has 39 rows, 't' has 40"),
        ({"u_dc": np.r_[np.zeros(7), np.nan, np.zeros(N - 8)]}, "row 7 of column 'u_dc' is nan"),
        ({"i_bb": np.zeros(N)}, "unknown column 'i_bb'; did you mean 'i_b'"),
    ],
)
def test_a_wrong_table_names_column_and_row(changes, message):
    with pytest.raises(BadInput, match=message):
        _campaign(_columns(**changes))


def test_a_gap_in_time_names_its_row(tmp_path):
    t = np.arange(N) * 250e-6
    t[20:] += 250e-6
    with pytest.raises(BadInput, match=r"locked_d.parquet: t steps by 0.0005 s from row 19 to 20"):
        read_folder(write_campaign(tmp_path / "c", _campaign(_columns(t=t))))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('rotor = "locked"', 'rotor = "lokced"', "unknown rotor 'lokced'; did you mean 'locked'"),
        ('injection_axis = "d"', 'injection_axis = "x"', "unknown injection_axis 'x'"),
        ("locked_d.parquet", "locked_x.parquet", "locked_x.parquet: the file does not exist"),
        ("resistance = 12.15", "resistance = -1", "resistance = -1.0 is out of range"),
        ("[background]", "[backgrund]", "unknown table 'backgrund'; did you mean 'background'"),
        ("[background]", "[columns]", r"\[columns\] stands in a file of its own; move it"),
        ("current_gain = 0.002", "current_gain = -1", "current_gain = -1 is no standard deviation"),
        (
            "current_gain = 0.002",
            "current_gain = inf",
            "current_gain = inf is no standard deviation",
        ),
        ("current_gain = 0.002", "current_gain = 1e-160", "give one from 1e-09 to 100, or 0"),
        (
            "current_gain = 0.002",
            "encoder_offset = 4.0",
            "encoder_offset = 4.0 is .* give one from 1e-09 to 3.142 rad",
        ),
        (
            'rotor = "locked"',
            'rotor = ["locked"]',
            r"rotor = \['locked'\] in \[\[recording\]\] is not a text",
        ),
    ],
)
def test_a_wrong_file_names_its_key(tmp_path, old, new, message):
    folder = write_campaign(tmp_path / "c", _campaign())
    _edit(folder, old, new)
    with pytest.raises(BadInput, match=message):
        read_folder(folder)


@pytest.mark.parametrize("name", ['["a"]', "3", "true", "1979-05-27"])
@pytest.mark.parametrize("table", ["campaign", "motor"])
def test_a_name_that_is_no_text_is_refused_in_one_sentence(tmp_path, capsys, table, name):
    folder = write_campaign(tmp_path / "c", _campaign())
    lines = [
        x for x in (folder / "campaign.toml").read_text().split("\n") if not x.startswith("name = ")
    ]
    lines.insert(lines.index(f"[{table}]") + 1, f"name = {name}")
    (folder / "campaign.toml").write_text("\n".join(lines))
    assert main(["identify", str(folder), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"sensorless identify: campaign.toml: [{table}] name = ")
    assert error.endswith("is not a text; put it in quotes\n")
    assert error.count("\n") == 1


def test_a_folder_that_is_none_is_named(tmp_path):
    with pytest.raises(BadInput, match="is not a folder"):
        read_folder(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match="does not exist"):
        read_folder(tmp_path / "empty")


def test_a_bench_campaign_without_ratings_is_read_and_copied(tmp_path):
    campaign = read_folder(recordings_folder() / "practice" / "p01", rotors=("locked",))
    motor = campaign.drive.motor
    assert campaign.rated_from_data
    assert len(campaign.recordings) == 5
    assert motor.resistance == 12.15
    assert 1.92 < motor.rated_current < 2.7
    again = read_folder(write_campaign(tmp_path / "copy", campaign))
    assert again.drive.motor == motor
    assert again.rated_from_data


def test_a_deviation_is_as_stated_or_usual():
    """A share of what `[background]` states in the parameter's unit, or of the usual one in units
    of the drive's; of a motor's value as `[uncertainty]` states it, of the truth about what is
    stated: 5 % of 2 ohm are 0.1 ohm/(1 - 3 x 0.05)."""
    campaign = _campaign()
    gain = Ordinary("current_gain", 0.01, share=0.5)
    offset = Ordinary("current_offset", 0.001, "rated current", 0.5)
    resistance = Ordinary("resistance", 0.05, of_motor=True)
    unstated = dataclasses.replace(resistance, stated="inertia")
    assert campaign.deviation_of(gain, 0.0) == 0.5 * 0.002
    assert campaign.deviation_of(resistance, 2.0) == pytest.approx(0.02 / 0.97)
    rated = campaign.drive.motor.rated_current
    assert campaign.deviation_of(offset, 0.0) == pytest.approx(0.5 * 0.001 * rated)
    assert campaign.deviation_of(unstated, 2.0) == pytest.approx(0.1 / 0.85)
