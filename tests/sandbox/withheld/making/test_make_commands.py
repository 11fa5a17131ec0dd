"""`sensorless withheld` from the command line."""

import hashlib
import json

from sandbox.cli import main
from sandbox.withheld.making import make as maker
from sandbox.withheld.making.make import campaign_of
from sandbox.withheld.scoring import blind as scorer
from tests.schemas import misfits


class Nothing:
    """A diagnosis that never finds a gap."""

    json = {  # noqa: RUF012
        "verdict": "no_gap",
        "gap": {"before": 1.0, "closed": None},
        "ambiguity_set": [[]],
        "hypotheses": [{"effects": [], "probability": 1.0}],
        "cost": {"seconds": 1.0},
    }


def test_make_and_score(tmp_path, monkeypatch, capsys, in_this_process):
    monkeypatch.setattr(maker, "campaign_of", lambda drawn, share: campaign_of(drawn, 0.02))
    folder = tmp_path / "check"
    assert (
        main(["withheld", "make", str(folder), "--count", "10", "--seed", "4", "--jobs", "1"]) == 0
    )
    digest = hashlib.sha256((folder / "truth.sealed").read_bytes()).hexdigest()
    assert capsys.readouterr().out.startswith(f"truth sealed, SHA-256 {digest}")

    monkeypatch.setattr(scorer, "standard", lambda folder, exclude: Nothing)
    assert main(["withheld", "score", str(folder), "--jobs", "1"]) == 0
    content = json.loads((folder / "withheld.json").read_text())
    assert content["command"] == "withheld"
    assert misfits("withheld", content) == []
    assert content["top1"] == {**content["top1"], "value": 0.0, "n": 6}
    assert content["false_alarm"] == {"value": 0.0, "low": 0.0, "high": 0.95, "n": 1}
    assert content["resolved"] == {"value": None, "low": None, "high": None, "n": 0}
    assert (folder / "withheld.png").is_file()
    assert len(list((folder / "diagnoses").glob("w*.json"))) == 10


def test_bad_calls_are_one_sentence(tmp_path, capsys):
    assert main(["withheld", "score", str(tmp_path)]) == 2
    assert "is no withheld check" in capsys.readouterr().err
