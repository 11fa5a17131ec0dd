"""Results say what made them; `verify` makes them once more and finds what was changed."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import numba
import pytest

import sandbox
from model.drive_files import MOTORS
from model.errors import BadInput
from sandbox.cli import main
from sandbox.public.calls import hashes
from tests.fuzz.whole import make_check
from tests.schemas import misfits

STILL = "[scenario]\nname = 'still'\nstart_up = false\n[[segment]]\nduration = 0.05\nload = 0.5\n"


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A motor, a scenario; the place to be."""
    (tmp_path / "m.toml").write_text((MOTORS / "ipm_exchanged.toml").read_text())
    (tmp_path / "s.toml").write_text(STILL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def audited(tmp_path_factory):
    """The folder with the result of an audit, made once for what only damages it."""
    return sandbox.audit("ipm").save(tmp_path_factory.mktemp("audited") / "out")


def made_by(path):
    return json.loads(Path(path).read_text())["made_by"]


def sha(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def test_a_result_says_what_made_it(home):
    call = [
        "simulate",
        "--motor",
        "m.toml",
        "--scenario",
        "s.toml",
        "--seed",
        "7",
        "--no-trace",
        "--out",
        "out",
    ]
    assert main([*call, "--effects", "dead_time.time=2e-6"]) == 0
    found = made_by("out/simulate.json")
    assert found["libraries"]["numba"] == numba.__version__
    assert found["commit"] is None or len(found["commit"].rstrip("+")) == 40
    told = found["call"]
    assert (told["function"], told["objects"]) == ("simulate", [])
    assert told["arguments"]["seed"] == 7
    assert told["arguments"]["effects"] == "dead_time.time=2e-6"
    assert told["inputs"] == {name: sha(name) for name in ("m.toml", "s.toml")}
    assert found["files"] == {
        name: sha(f"out/{name}") for name in ("simulate.html", "simulate.parquet", "simulate.png")
    }
    assert main(["verify", "out"]) == 0
    assert misfits("verify", Path("sensorless-out/verify/verify.json")) == []
    again = json.loads(Path("sensorless-out/verify/verify.json").read_text())
    assert (again["same"], again["largest"], again["differences"]) == (True, 0.0, [])
    assert again["values"] > 20


def test_what_was_changed_is_found(home, capsys):
    sandbox.audit("m.toml").save("out")
    assert sandbox.verify("out").same
    path = Path("out/audit.json")
    stated = json.loads(path.read_text())
    path.write_text(json.dumps(stated | {"valid_radius": stated["valid_radius"] * (1.0 + 1e-5)}))
    (found,) = sandbox.verify("out").differences
    assert found.where == "valid_radius"
    assert found.found == stated["valid_radius"]
    assert sandbox.verify("out", tolerance=1e-4).largest == pytest.approx(1e-5, rel=1e-4)
    assert main(["verify", "out", "--out", "said"]) == 1
    assert "valid_radius is" in capsys.readouterr().out
    path.write_text(json.dumps(stated))
    figure = Path("out/audit.png")
    figure.write_bytes(figure.read_bytes()[:1000])  # as a full disk leaves it
    assert [d.where for d in sandbox.verify("out").differences] == ["file 'audit.png'"]
    figure.unlink()
    assert not sandbox.verify("out").same


def test_other_inputs_are_told(home):
    sandbox.audit("m.toml").save("out")
    text = Path("m.toml").read_text()
    Path("m.toml").write_text(text + "# a word more\n")
    with pytest.raises(BadInput, match=r"input 'm.toml' is not the file"):
        sandbox.verify("out")
    Path("m.toml").unlink()
    with pytest.raises(BadInput, match=r"input 'm.toml' of the result is not here"):
        sandbox.verify("out")


def test_files_that_files_name_are_inputs(home):
    text = Path("m.toml").read_text().replace("[drive]\n", '[drive]\ninverter_table = "legs.csv"\n')
    Path("m.toml").write_text(text)
    Path("legs.csv").write_text("0,0\n1,2\n")
    sandbox.audit("m.toml").save("out")
    assert set(made_by("out/audit.json")["call"]["inputs"]) == {"m.toml", "legs.csv"}


def test_a_campaigns_tables_are_inputs(home):
    still = [
        "simulate",
        "--scenario",
        "s.toml",
        "--json-only",
        "--out",
        "out",
        "--record",
        "campaign",
    ]
    assert main(still) == 0
    assert main(["verify", "out"]) == 0  # with the bench's sensors, and recorded elsewhere
    assert not Path("recorded").exists()
    sandbox.replay("campaign").save("replayed")
    inputs = made_by("replayed/replay.json")["call"]["inputs"]
    assert set(inputs) == {"campaign/campaign.toml", "campaign/still.parquet"}
    assert sandbox.verify("replayed").largest == 0.0
    assert [p.name for p in Path("campaign").iterdir()].count("still.parquet") == 1


def test_a_sweep_is_made_again(home):
    plan = {
        "scenario": {"start_up": False},
        "segment": [{"duration": 0.02, "load": 1.0, "settle": 0.01}],
    }
    sandbox.sweep(plan | {"grid": {"belief": ["linear", "saturated"]}}, "swept", jobs=1).save()
    assert sandbox.verify("swept").largest == 0.0


def test_figures_of_a_check_follow_from_its_rows(home):
    make_check(home / "check")
    (home / "check" / "SHA256").write_text(sha("check/truth.sealed"))
    assert main(["withheld", "score", "check", "--finished", "--quiet"]) == 0
    assert sandbox.verify("check").same
    path = home / "check" / "withheld.json"
    path.write_text(path.read_text().replace('"top1": {\n  "value": ', '"top1": {\n  "value": 1'))
    assert not sandbox.verify("check").same


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda d: d.pop("made_by"), "does not say how it was made"),
        (lambda d: d["made_by"].update(call=None), "does not say how it was made"),
        (lambda d: d["made_by"]["call"].update(function="os.system"), "cannot be made once more"),
        (
            lambda d: d["made_by"]["call"].update(arguments={"cable": 1}),
            "another version of 'audit'",
        ),
        (lambda d: d["made_by"]["call"].update(inputs=[]), "damaged at made_by, 'inputs'"),
        (
            lambda d: d["made_by"]["call"]["arguments"].update(motor="../../x\x1b"),
            "unknown motor|does not exist",
        ),
    ],
)
def test_what_cannot_be_verified_is_refused_in_a_sentence(damage, said, audited, home):
    shutil.copytree(audited, "out")
    stated = json.loads(Path("out/audit.json").read_text())
    damage(stated)
    Path("out/audit.json").write_text(json.dumps(stated))
    with pytest.raises(BadInput, match=said):
        sandbox.verify("out")


def test_results_of_objects_and_places_without_a_result(home):
    sandbox.audit(sandbox.load_motor("ipm")).save("out")
    with pytest.raises(BadInput, match=r"made from Python objects \(motor\)"):
        sandbox.verify("out")
    shutil.copy("out/audit.json", "out/other.json")
    with pytest.raises(
        BadInput,
        match=r"holds 2 results \(.*\.json, .*\.json\); give one of them, such as .*\.json",
    ):
        sandbox.verify("out")
    with pytest.raises(BadInput, match="no result at"):
        sandbox.verify("nowhere")
    with pytest.raises(BadInput, match="tolerance = -1"):
        sandbox.verify("out", tolerance=-1)


def test_inputs_are_hashed_beside_texts_that_no_file_can_be_called(tmp_path):
    folder = tmp_path / "/".join(["a" * 100] * 3)
    folder.mkdir(parents=True)
    text = (MOTORS / "ipm.toml").read_text()
    (folder / "map.csv").write_text("1")
    for more in ("", "x" * 340):
        (folder / "m.toml").write_text(text + f'note = "map.csv"\nwhy = "{more}"\n')
        found = hashes({"motor": str(folder / "m.toml"), "text": "y" * 300})
        assert [Path(name).name for name in found] == ["m.toml", "map.csv"]
    assert hashes({"campaign": str(folder / "nothing")}) == {}
