"""Thirty mistakes planted in a campaign are named by the pre-flight, all at once; clean campaigns
pass in silence."""

import dataclasses
import functools
import json
import math
import re
import tomllib

import numpy as np
import pytest

from sandbox import check
from sandbox.cli import main
from sandbox.recordings.campaign import EXAMPLE, read_folder
from sandbox.recordings.checks.balance import PHASES, percent
from sandbox.recordings.checks.pace import off_pace
from sandbox.recordings.preflight import REFUSED, noticed, quantum, ratings
from sandbox.recordings.writing import write_campaign
from tests.data import cases_folder, recordings_folder

U = ("u_alpha", "u_beta")
# 0: at standstill with injection, 1: slow with injection, 2: fast, free
KEPT = ("locked_d", "run_slow", "coast_down")


@functools.cache
def bench(name="p05"):
    """Three recordings of a practice campaign."""
    campaign = read_folder(recordings_folder() / "practice" / name)
    cut = [
        dataclasses.replace(
            campaign[f], columns={n: x[:5000] for n, x in campaign[f].columns.items()}
        )
        for f in KEPT
    ]
    return dataclasses.replace(campaign, recordings=tuple(cut))


def all_of(change):
    """A mistake in every recording."""
    return lambda c: tuple(
        dataclasses.replace(r, columns={**r.columns, **change(r)}) for r in c.recordings
    )


def one(k, change):
    """A mistake in one recording."""
    return lambda c: tuple(
        dataclasses.replace(r, columns={**r.columns, **change(r)}) if m == k else r
        for m, r in enumerate(c.recordings)
    )


def scaled(names, factor):
    return lambda r: {n: factor * r[n] for n in names}


def held(name, begin, end):
    def change(r):
        x = r[name].copy()
        x[begin:end] = x[begin]
        return {name: x}

    return change


def clipped(r):
    limit = 0.6 * max(np.max(np.abs(r[n])) for n in PHASES)
    return {n: np.clip(r[n], -limit, limit) for n in PHASES}


def jump(r):
    return {"theta": r.theta + 4.0 * (np.arange(len(r.t)) >= 900)}


PAIRS = 3.0  # of p05
MISTAKES = [
    ("currents in mA", all_of(scaled(PHASES, 1e3)), "in mA"),
    ("currents in kA", all_of(scaled(PHASES, 1e-3)), "in kA"),
    ("angle in degrees", all_of(lambda r: {"theta": np.degrees(r.theta)}), "in degrees"),
    ("mechanical angle", all_of(lambda r: {"theta": r.theta / PAIRS}), "mechanical"),
    (
        "mechanical degrees",
        all_of(lambda r: {"theta": np.degrees(r.theta / PAIRS)}),
        "mechanical degrees",
    ),
    ("turns", all_of(lambda r: {"theta": r.theta / math.tau}), "in turns"),
    ("backwards", all_of(scaled(("theta",), -1.0)), "backwards"),
    ("zero a quarter off", all_of(lambda r: {"theta": r.theta + math.pi / 2}), "90 degrees ahead"),
    ("b and c swapped", all_of(lambda r: {"i_b": r.i_c, "i_c": r.i_b}), "swapped"),
    ("a and b swapped", all_of(lambda r: {"i_a": r.i_b, "i_b": r.i_a}), "swapped"),
    ("cyclic order", all_of(lambda r: {"i_a": r.i_b, "i_b": r.i_c, "i_c": r.i_a}), "swapped"),
    ("currents out of the motor", all_of(scaled(PHASES, -1.0)), "out of the motor"),
    ("one phase in mA", all_of(scaled(("i_c",), 1e3)), "in mA"),
    ("one phase's sign", all_of(scaled(("i_b",), -1.0)), "its sign is wrong"),
    ("voltages in kV", all_of(scaled(U, 1e-3)), "in kV"),
    ("voltages in mV", all_of(scaled(U, 1e3)), "in mV"),
    ("voltages per unit", all_of(lambda r: {n: r[n] / r.u_dc for n in U}), "per unit"),
    ("u_beta's sign", all_of(scaled(("u_beta",), -1.0)), "u_beta has the wrong sign"),
    ("link in kV", all_of(scaled(("u_dc",), 1e-3)), "is u_dc in kV"),
    (
        "link lost",
        one(1, lambda r: {"u_dc": np.where(np.arange(len(r.t)) == 17, 0.0, r.u_dc)}),
        "row 17 of column",
    ),
    ("rms currents", all_of(scaled(PHASES, 0.5**0.5)), "rms for peak"),
    ("line voltages", all_of(scaled(U, 3.0**0.5)), "line for phase voltage"),
    ("a column mapped twice", one(1, lambda r: {"i_b": r.i_a}), "mapped twice"),
    ("an open phase", one(2, lambda r: {"i_b": 0.0 * r.i_b, "i_c": -r.i_a}), "open"),
    ("stuck sensor", one(1, held("i_b", 3000, 3400)), "stuck"),
    ("full converter", one(2, clipped), "full|saturated"),
    ("stuck encoder", one(2, held("theta", 500, 600)), "encoder is stuck"),
    ("angle jumps", one(2, jump), "jumps by"),
    ("locked that turns", None, "while rotor = 'locked'"),
    ("load torque in mN m", one(1, scaled(("load_torque",), 1e3)), "mN m"),
    ("kelvin", one(2, lambda r: {"temperature": np.full(len(r.t), 320.0)}), "kelvin|temperature"),
    ("pole pairs", all_of(lambda r: {"theta": 0.75 * r.theta}), "times as fast"),
]


def findings(campaign):
    return [n.finding.text for n in noticed(campaign)]


def planted(name, change):
    campaign = bench()
    if name == "locked that turns":
        r = campaign.recordings
        return dataclasses.replace(
            campaign, recordings=(*r[:2], dataclasses.replace(r[2], rotor="locked"))
        )
    return dataclasses.replace(campaign, recordings=change(campaign))


def test_thirty_planted_mistakes_are_named():
    missed = []
    for name, change, words in MISTAKES:
        told = findings(planted(name, change))
        if not any(re.search(words, text) for text in told):
            missed.append((name, told))
    assert len(MISTAKES) >= 30
    assert len(missed) <= 1, missed


def test_clean_campaigns_pass_without_a_word():
    for name in ("p01", "p05", "p06", "p10", "p11"):
        assert findings(bench(name)) == [], name


def test_the_sample_campaign_passes_without_a_word():
    """One of its rotors is driven at 360 rad/s, which moves the injected 500 Hz by 57 Hz unless one
    turns with it."""
    campaign = read_folder(EXAMPLE)
    assert findings(campaign) == []
    none = [
        dataclasses.replace(r, columns={**r.columns, **dict.fromkeys(U, 0.0 * r.t)})
        for r in campaign.recordings
    ]
    told = findings(dataclasses.replace(campaign, recordings=tuple(none)))
    assert sum("but the commands hold" in text for text in told) == len(none)


def test_wrong_statements_about_the_drive_are_noticed():
    campaign = bench()
    for field, value, words in (
        ("current_resolution", 0.1, "current_resolution"),
        ("encoder_counts", 512, "encoder_counts"),
    ):
        converter = dataclasses.replace(campaign.drive.converter, **{field: value})
        wrong = dataclasses.replace(
            campaign, drive=dataclasses.replace(campaign.drive, converter=converter)
        )
        assert any(words in text for text in findings(wrong)), field
    injection = dataclasses.replace(
        campaign.drive.injection, frequency=campaign.drive.injection.frequency / 4
    )
    wrong = dataclasses.replace(
        campaign, drive=dataclasses.replace(campaign.drive, injection=injection)
    )
    assert any("their strongest line" in text for text in findings(wrong))


def test_two_mistakes_are_told_at_once():
    campaign = planted("both", one(2, jump))
    both = dataclasses.replace(campaign, recordings=one(1, held("i_b", 3000, 3400))(campaign))
    told = [n.finding.text for n in noticed(both) if n.level == REFUSED]
    assert any("jumps by" in text for text in told)
    assert any("stuck" in text for text in told)


def test_what_stops_a_campaign_comes_first_without_hints_that_follow_from_it():
    """Currents in mA have steps of mA, too: correcting current_resolution would be wrong."""
    campaign = read_folder(EXAMPLE)
    recordings = all_of(scaled(PHASES, 1e3))(campaign)
    told = noticed(dataclasses.replace(campaign, recordings=recordings))
    assert told[0].level == REFUSED
    assert "currents are in mA" in told[0].finding.text
    assert not any("current_resolution" in n.finding.text for n in told)
    assert "e+0" not in told[0].finding.text


@pytest.mark.parametrize(
    ("file", "moved", "said"),
    [("run_fast", 0.5, "map it with offset = -0.5"), ("reversal", 0, "move theta up by 4 rows")],
)
def test_a_zero_of_the_angle_and_late_rows_are_not_told_of_one_another(file, moved, said):
    """Whichever leaves less of the voltage is the cause: at changing speeds the two differ."""
    campaign = read_folder(recordings_folder() / "practice" / "p01")
    r = campaign[file]
    columns = dict(r.columns)
    if moved:
        columns["theta"] = r.theta + moved
    else:
        columns = {n: x[:-4] if n == "theta" else x[4:] for n, x in columns.items()}
        columns["t"] = r.t[:-4]
    one = dataclasses.replace(r, columns=columns)
    told = [n.finding for n in noticed(dataclasses.replace(campaign, recordings=(one,)))]
    told = [f.text for f in told if "unexplained" in f.text]
    assert len(told) == 1
    assert said in told[0]


def test_shares_are_plain_numbers():
    assert [percent(x) for x in (0.004, 0.35, 2.0, 6.2e5)] == [
        "0.4 %",
        "35 %",
        "200 %",
        "620000 times all",
    ]


def test_the_step_of_readings():
    rng = np.random.default_rng(0)
    x = rng.standard_normal(4000)
    assert quantum(0.05 * np.round(x / 0.05)) == pytest.approx(0.05)
    assert quantum(x) is None


def test_noise_far_from_what_readings_show_is_suspicious():
    """The sensors have 3.3 times what is stated: the limit of what both may be is 3.  Four times
    their noise is refused, as no quiet block shows a third of it."""
    drive = bench().drive

    def stated(times):
        own = {
            k: times * getattr(drive.converter, k) for k in ("current_noise", "current_resolution")
        }
        converter = dataclasses.replace(drive.converter, **own)
        own_bench = dataclasses.replace(
            bench(), drive=dataclasses.replace(drive, converter=converter)
        )
        return [
            n for n in check(own_bench, effects=False).noticed if "A of noise" in n.finding.text
        ]

    assert stated(1.1) == []
    found = stated(1.0 / 3.3)
    assert [n.level for n in found] == ["suspicious"]
    assert "too far apart for both to be right" in found[0].finding.text
    refused = stated(4.0)  # beyond three times what they show nothing could be seen
    assert [n.level for n in refused] == ["refused"]
    assert "nothing could be seen below the stated noise" in refused[0].finding.text


def test_a_recording_of_three_rows_turns_too_little_to_tell():
    """Fewer rows than the four over which the voltage is smoothed."""
    short = all_of(lambda r: {n: x[:3] for n, x in r.columns.items()})(bench())
    assert off_pace(short, bench().drive) == []


def test_the_command_lists_what_it_found(tmp_path, capsys):
    good = write_campaign(tmp_path / "good", bench())
    assert main(["check", str(good), "--mistakes-only", "--out", str(tmp_path / "o")]) == 0
    assert "nothing wrong or suspicious" in capsys.readouterr().out
    wrong = write_campaign(tmp_path / "wrong", planted("angle jumps", one(2, jump)))
    assert main(["check", str(wrong), "--out", str(tmp_path / "o")]) == 2
    answer = json.loads((tmp_path / "o" / "check.json").read_text())
    assert answer["ok"] is False
    assert answer["findings"][0]["level"] == "refused"
    assert answer["effects"] == []
    assert main(["check", str(tmp_path / "nothing"), "--out", str(tmp_path / "o")]) == 2
    (tmp_path / "empty").mkdir()
    assert not check(tmp_path / "empty").ok


def test_a_map_that_states_nothing_is_told_and_a_preset_that_is_none_writes_nothing(
    tmp_path, capsys
):
    good, out = write_campaign(tmp_path / "good", bench()), tmp_path / "o"
    (tmp_path / "empty.toml").write_text("# nothing yet\n")
    (tmp_path / "other.toml").write_text("[tool.ruff]\nline-length = 100\n")
    for name, words in (("empty", "empty.toml states nothing"), ("other", "other.toml: unknown")):
        told = check(good, columns=tmp_path / f"{name}.toml", effects=False)
        assert not told.ok
        assert words in told.mistakes[0]
    assert main(["check", str(good), "--preset", "vecs", "--out", str(out)]) == 2
    assert "did you mean 'vesc'?" in capsys.readouterr().err
    assert main(["check", str(good), "--columns", "no.toml", "--out", str(out)]) == 2
    assert not out.exists()


def test_tables_that_nothing_describes_get_a_draft(tmp_path, capsys):
    """The draft is TOML, names what it recognises, and is a map once the motor stands in it."""
    t = np.arange(400) * 2e-3
    rows = np.stack([1e3 * t, np.sin(3.0 * t), np.cos(3.0 * t), 0 * t], axis=1)
    np.savetxt(
        tmp_path / "run.csv",
        rows,
        delimiter=",",
        header="Time [ms],Position [rad],Iq [A],Mode",
        comments="",
    )
    out = tmp_path / "o"
    assert main(["check", str(tmp_path), "--out", str(out)]) == 2
    assert "a draft of a column map" in capsys.readouterr().out
    text = (out / "columns.toml").read_text()
    drafted = tomllib.loads(text)
    assert {k: v["column"] for k, v in drafted["columns"].items()} == {
        "t": "Time",
        "theta": "Position",
        "i_q": "Iq",
    }
    assert [r["file"] for r in drafted["recording"]] == ["run.csv"]
    assert "#   Mode: 0 to 0" in text
    assert "# sampling_period = 0.002" in text
    (out / "mine.toml").write_text(
        "[motor]\ntorque_constant = 0.05\npole_pairs = 4\ninertia = 1e-3\n" + text
    )
    found = check(tmp_path, columns=out / "mine.toml")
    assert found.ok
    assert "the motion alone is judged" in found.why
    assert not (tmp_path / "columns.toml").exists()  # nothing is written into a log's own folder


def test_stated_ratings_that_do_not_go_together_are_told_and_stand_ins_are_not():
    """An inertia in kg cm^2 takes 10 000 times as long to run up; a rated speed that stands in says
    nothing of it."""
    c = bench()
    motor = dataclasses.replace(c.drive.motor, inertia=1e4 * c.drive.motor.inertia)
    wrong = dataclasses.replace(c, drive=dataclasses.replace(c.drive, motor=motor), stand_ins=())
    assert any("inertia in kg cm^2" in f.text for f in ratings(wrong))
    assert ratings(dataclasses.replace(wrong, stand_ins=("rated_torque", "rated_speed_rpm"))) == []
    assert ratings(dataclasses.replace(c, stand_ins=())) == []


def test_ratings_that_stand_in_are_a_note():
    """What is stated is not told; a note is no mistake."""
    c = bench()
    stated = check(dataclasses.replace(c, stand_ins=()), effects=False)
    assert not any("does not state" in n.finding.text for n in stated.noticed)
    own = {
        **c.drive.provenance,
        "rated_current": "not stated; stands in: largest of the recordings",
    }
    drive = dataclasses.replace(c.drive, provenance=own)
    open_ = check(dataclasses.replace(c, drive=drive, stand_ins=("rated_current",)), effects=False)
    (told,) = [n for n in open_.noticed if "[motor] does not state" in n.finding.text]
    assert told.level == "note"
    assert (
        "does not state rated_current; this value stands in: rated_current = " in told.finding.text
    )
    assert "(largest of the recordings)" in told.finding.text
    assert open_.mistakes == stated.mistakes


def test_an_angle_some_rows_off_and_the_zero_that_it_looks_like_are_one(tmp_path):
    """A motor at nearly one speed, where a row is nearly an angle: either explains it."""
    case = cases_folder() / "11_line_values_in_motor"
    rows = np.loadtxt(case / "log.csv", delimiter=",", skiprows=1)
    header = (case / "log.csv").read_text().partition("\n")[0]
    at = header.split(",").index("theta")
    rows = np.insert(np.delete(rows[2:], at, 1), at, rows[:-2, at], 1)
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=header, comments="", fmt="%.9g")
    text = (case / "ke.toml").read_text().replace("0.5886", "0.0981")  # the right flux
    (tmp_path / "m.toml").write_text(text)
    (told,) = check(tmp_path, columns=tmp_path / "m.toml", effects=False).mistakes
    assert "move theta up by 2 rows; or, which is the same at one speed, 4.4 % of the" in told
    assert told.endswith("if theta is 15 degrees behind; then map it with offset = 0.2531")
