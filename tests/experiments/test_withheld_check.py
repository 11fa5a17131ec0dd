"""What the check publishes is computed from its rows and opened seals alone."""

import hashlib
import json

import pytest

from experiments import withheld_check
from experiments.withheld_check import CHECKS, RESULTS, recompute
from model.errors import BadInput
from sandbox.validation.scoring.rows import write_rows
from sandbox.validation.scoring.tables_of_rows import by_method
from tests.sandbox.validation.test_withheld_rows import twelve


@pytest.fixture
def results(tmp_path):
    """Rows of twelve campaigns, of the project's method and a simple one, beside their seal."""
    rows = twelve()
    rows += [type(r)(**{**vars(r), "method": "bic"}) for r in rows]
    write_rows(tmp_path / "mixed.rows.jsonl", rows)
    seal = {"campaigns": {r.campaign: dict(r.truth) for r in rows}}
    (tmp_path / "mixed.truth.json").write_text(json.dumps(seal))
    return tmp_path


def test_all_published_files_follow_from_rows_and_seal(results):
    """Every figure of the JSON and of the table is that of `score` on the same rows; a second time, byte for byte."""
    assert recompute(results) == ["mixed"]
    own = by_method(twelve())[0]
    content = json.loads((results / "mixed.json").read_text())
    assert {k: content[k] for k in own.figures} == {k: f.as_json() for k, f in own.figures.items()}
    assert content["command"] == "withheld"
    text = (results / "README.md").read_text()
    assert hashlib.sha256((results / "mixed.truth.json").read_bytes()).hexdigest() in text
    top = own.figures["top1"]
    assert f"| top1 | ≥ 0.95 | {top.value:.3g} [{top.low:.3g}, {top.high:.3g}], n = 5 |" in text
    assert "w001 dead time -> iron loss" in text
    assert text.startswith("Made 2026-01-01 ")
    assert list(json.loads((results / "baselines.json").read_text())["methods"]) == ["diagnosis", "bic"]
    before = {p.name: p.read_bytes() for p in results.iterdir() if p.suffix != ".png"}
    recompute(results)
    assert {p.name: p.read_bytes() for p in results.iterdir() if p.suffix != ".png"} == before


def test_both_tables_of_sizes_stand_side_by_side(results):
    """Where both were run: a row a metric, published sizes first."""
    write_rows(results / "ladder.rows.jsonl", [r for r in twelve() if r.campaign != "w001"])
    (results / "ladder.truth.json").write_bytes((results / "mixed.truth.json").read_bytes())
    assert recompute(results) == ["mixed", "ladder"]
    text = (results / "README.md").read_text()
    assert "| metric | goal | diagnosis | by the ladder |" in text
    one, other = (by_method([r for r in twelve() if r.campaign != w])[0].figures["top1"] for w in ("", "w001"))
    cells = [f"{f.value:.3g} [{f.low:.3g}, {f.high:.3g}], n = {f.n}" for f in (one, other)]
    assert f"| top1 | ≥ 0.95 | {cells[0]} | {cells[1]} |" in text


def test_rows_of_another_seal_or_of_several_states_of_the_code_are_refused(results):
    rows = twelve()
    write_rows(results / "controls.rows.jsonl", [type(r)(**{**vars(r), "code": "new"}) for r in rows])
    (results / "controls.truth.json").write_bytes((results / "mixed.truth.json").read_bytes())
    with pytest.raises(BadInput, match="this page mixes 2 states of the code"):
        recompute(results)
    (results / "controls.truth.json").write_text(json.dumps({"campaigns": {}}))
    with pytest.raises(BadInput, match="its truth is not the sealed one"):
        recompute(results)


def test_without_rows_there_is_nothing_to_compute(tmp_path):
    with pytest.raises(BadInput, match="holds no rows of a check"):
        recompute(tmp_path)


def test_one_state_of_the_code_and_enough_controls_for_one_percent():
    """No alarm in 400 excludes 0.75 % (0.05^(1/400)); one still excludes 1.2 %."""
    assert CHECKS["controls"].count >= 400
    assert len({c.seed for c in CHECKS.values()}) == len(CHECKS)
    assert set(CHECKS) == {"mixed", "pairs", "controls", "ladder"}


def test_a_check_is_made_and_scored_by_the_command_line(tmp_path, monkeypatch):
    """Both steps with the check's own seed, kind and sizes; what is kept are the rows and the seal."""
    calls = []

    def fake(*arguments):
        """Note a call; leave what `score` leaves."""
        calls.append([str(a) for a in arguments])
        folder = tmp_path / "work" / "ladder"
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("withheld.rows.jsonl", "truth.sealed"):
            (folder / name).write_text(name)

    monkeypatch.setattr(withheld_check, "sensorless", fake)
    withheld_check.run("ladder", tmp_path / "work", 1, tmp_path / "results")
    assert [c[1] for c in calls] == ["make", "score"]
    assert calls[0][calls[0].index("--sizes") + 1] == "ladder"
    assert sorted(p.name for p in (tmp_path / "results").iterdir()) == ["ladder.rows.jsonl", "ladder.truth.json"]


@pytest.mark.skipif(not list(RESULTS.glob("*.rows.jsonl")), reason="no rows of a check are kept yet")
def test_what_is_committed_follows_from_the_rows_that_are_committed(tmp_path):
    """The table's text, and every number to twelve digits (another machine sums in another order)."""
    for path in (*RESULTS.glob("*.rows.jsonl"), *RESULTS.glob("*.truth.json")):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    names = recompute(tmp_path)
    assert (tmp_path / "README.md").read_text() == (RESULTS / "README.md").read_text()
    for name in names:
        found, kept = (json.loads((place / f"{name}.json").read_text()) for place in (tmp_path, RESULTS))
        for metric, figure in kept["methods"]["diagnosis"].items():
            if isinstance(figure, dict) and set(figure) == {"value", "low", "high", "n"}:
                assert found[metric] == pytest.approx(figure, rel=1e-12, nan_ok=True), (name, metric)
