"""Names from hostile files: refused at the door in one sentence, nothing written outside the output
folder."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from estimators.contract import Estimator
from estimators.registry import load_estimator
from model.drive_files import MOTORS, load_drive
from model.errors import LONGEST_SENTENCE, BadInput, PhysicsError, sentence, shown, unknown
from model.names import LONGEST, check_file, check_name, fitting, html_text
from sandbox.cli import main
from sandbox.recordings.campaign import Campaign, CampaignRecording, read_folder
from sandbox.recordings.findings import Finding
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.writing import write_campaign

HOSTILE = {
    "above": "../../out",
    "absolute": "/tmp/out",
    "backslash": "..\\out",
    "hidden": ".out",
    "dots": "..",
    "empty": "",
    "zero byte": "a\0b",
    "terminal": "\x1b[2J\x1b[31mred",
    "bell": "a\x07",
    "line break": "a\nb",
    "tab": "a\tb",
    "other way round": "a\u202egnp.exe",
    "long": "x" * 300,
    "long in bytes": "\U0001f9f2" * 60,
    "space": " a",
}
SAFE = ("ipm", "my motor, 3rd try", "Größe µ 電動機", "a.b", "[bold] $x$ <script>", "x" * LONGEST)
SHORT = "[scenario]\nname = {}\nsettle = 0.05\n[[segment]]\nduration = 0.1\n"


def refused(call, capsys):
    """Return the sentence with which a call is refused."""
    assert main(call) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert said.err[:-1].isprintable()
    assert len(said.err) < LONGEST_SENTENCE + 40
    return said.err


def files(folder):
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*"))


@pytest.mark.parametrize("kind", HOSTILE)
def test_no_hostile_name_of_a_scenario_or_motor_writes_anything(
    kind, tmp_path, capsys, monkeypatch
):
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.chdir(home)
    name = json.dumps(HOSTILE[kind], ensure_ascii=False)  # TOML reads the same escapes
    (home / "s.toml").write_text(SHORT.format(name))
    motor = (MOTORS / "ipm_exchanged.toml").read_text()
    (home / "m.toml").write_text(re.sub(r"(?m)^name = .*$", lambda _: f"name = {name}", motor))
    before = files(tmp_path)
    call = ["simulate", "--no-trace", "--out", "out", "--record", "recorded"]
    assert "[scenario] name" in refused([*call, "--scenario", "s.toml"], capsys)
    assert "[motor] name" in refused([*call, "--motor", "m.toml"], capsys)
    assert files(tmp_path) == before


@pytest.mark.parametrize("name", SAFE)
def test_every_other_name_is_a_name_and_a_file(name, tmp_path):
    assert check_name(name, "name") == name
    (tmp_path / name).write_text("")
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert fitting(name, "usual") == name


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_names_are_refused_and_made_to_fit(kind):
    with pytest.raises(BadInput, match="name = "):
        check_name(HOSTILE[kind], "name")
    made = fitting(HOSTILE[kind], "usual")
    assert check_name(made, "name") == made


def test_a_file_may_lie_in_a_folder_below():
    assert check_file("data/run 1.csv", "file") == "data/run 1.csv"
    for wrong in (*HOSTILE.values(), "a//b", "a/", "a/../../b", "./a", 5, None):
        if wrong not in ("x" * 300,):
            with pytest.raises(BadInput, match="file = "):
                check_file(wrong, "file")


@pytest.fixture
def folder(tmp_path):
    n = 40
    rng = np.random.default_rng(1)
    columns = {"t": np.arange(n) * 250e-6}
    columns |= {
        c: rng.normal(size=n) for c in ("u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "u_dc")
    }
    one = CampaignRecording("run.parquet", "locked", "d", columns)
    return write_campaign(
        tmp_path / "deep" / "c", Campaign("bench", load_drive("ipm"), (one,), {}, {}, False)
    )


@pytest.mark.parametrize("kind", HOSTILE)
@pytest.mark.parametrize("read", [read_folder, read_recordings])
def test_a_recording_stays_inside_its_campaign(kind, read, folder):
    """The file named is there, outside: it is refused all the same."""
    (folder.parent.parent / "out").write_bytes((folder / "run.parquet").read_bytes())
    toml = folder / "campaign.toml"
    text = toml.read_text()
    toml.write_text(text.replace('"run.parquet"', json.dumps(HOSTILE[kind], ensure_ascii=False)))
    with pytest.raises(BadInput, match=r"file in \[\[recording\]\] = "):
        read(folder)
    toml.write_text(text.replace('"bench"', json.dumps(HOSTILE[kind], ensure_ascii=False)))
    with pytest.raises(BadInput, match=r"\[campaign\] name = "):
        read_folder(folder)


def test_a_recording_from_python_cannot_leave_its_folder(tmp_path):
    with pytest.raises(BadInput, match="recording's file"):
        CampaignRecording("../run.parquet", "locked", "d", {})


def test_flux_maps_lie_beside_the_file_that_names_them(tmp_path):
    text = (MOTORS / "mapped" / "baldor_pmsyrm.toml").read_text()
    text = re.sub(r"(?m)^dataset = .*$", "", text)
    for wrong in ("..", "../", "a\\m.npz", "a\0.npz", "\x1b.npz", "../.hidden/m.npz"):
        (tmp_path / "m.toml").write_text(
            re.sub(
                r"(?m)^file = .*$",
                lambda _, w=wrong: f"file = {json.dumps(w, ensure_ascii=False)}",
                text,
            )
        )
        with pytest.raises(BadInput, match=r"\[flux_map\] file = "):
            load_drive(tmp_path / "m.toml")


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_names_of_estimators_are_refused(kind):
    with pytest.raises(BadInput, match="estimator's name = "):
        load_estimator(
            Estimator(HOSTILE[kind], "", lambda *_: None, lambda *_: None, compiled=False)
        )


def test_inverter_tables_lie_beside_the_file_that_names_them(tmp_path):
    text = (MOTORS / "ipm_exchanged.toml").read_text()
    (tmp_path / "t.csv").write_text("0,0\n1,2\n")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "m.toml").write_text(
        text.replace("[drive]\n", '[drive]\ninverter_table = "../t.csv"\n')
    )
    with pytest.raises(BadInput, match=r"\[drive\] inverter_table = '../t.csv'"):
        load_drive(tmp_path / "deep" / "m.toml")


def test_an_estimator_file_that_ends_the_program_is_refused(tmp_path):
    (tmp_path / "mine.py").write_text("raise SystemExit(7)\n")
    with pytest.raises(BadInput, match="SystemExit"):
        load_estimator(tmp_path / "mine.py")


def test_what_the_user_wrote_cannot_command_the_terminal(tmp_path, capsys):
    for call in (
        ["audit", "\x1b[2Jmotor"],
        ["audit", "a\nb"],
        ["list", "effects", "\x1b]0;title\x07"],
        ["\x1b[2J"],
        ["compare", "--estimators", "\x9b31m"],
        ["simulate", "--effects", "a.b\r=1"],
        ["audit", "x" * 5000],
        ["audit", "ipm", "--radius", "\x1b"],
        ["compare", "--seed", "\x1b\n"],
        ["view", "\x1b\n.rrd"],
    ):
        code = main(call)
        said = capsys.readouterr().err
        assert code == 2
        assert said.endswith("\n")
        assert said[:-1].isprintable()
        assert len(said) < LONGEST_SENTENCE + 100


def test_sentences_are_one_line_of_bounded_length():
    for error in (BadInput, PhysicsError):
        text = str(error("the value of 'a\nb\x1b' is " + "9" * 1000 + "; give one below 3"))
        assert text.isprintable()
        assert len(text) <= LONGEST_SENTENCE
        assert text.startswith("the value of 'a b\\x1b'")
        assert text.endswith("give one below 3")  # the remedy is kept
    assert sentence(sentence("a\x1b" * 300)) == sentence("a\x1b" * 300)
    many = unknown("column", "x", (f"column_{k}" for k in range(5000)))
    assert "(5000 in all)" in str(many)


def test_findings_and_pages_show_names_as_text():
    assert Finding("a.csv", "c", None, "column '\x1b[2J'").text == "column '\\x1b[2J'"
    assert shown("a\x1b\u202eb\ud800") == "a\\x1b\\u202eb\\ud800"
    seen = []

    class Page(HTMLParser):
        def handle_starttag(self, tag, attrs):
            seen.append(tag)

    Page().feed(f"<p>{html_text('<script>alert(1)</script><img src=x onerror=y>')}</p>")
    assert seen == ["p"]
