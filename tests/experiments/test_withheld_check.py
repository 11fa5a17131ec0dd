"""What the check publishes is computed from its rows and opened seals alone."""

import hashlib
import json
import math

import pytest

from experiments import drawing, screens, shares_truth, withheld_check
from experiments.withheld_check import CHECKS, OWN, RESULTS, if_chances_held, keep, recompute
from model.errors import BadInput
from sandbox.output.tables import many
from sandbox.withheld.scoring.metrics import by_subsystem
from sandbox.withheld.scoring.rows import read_rows, write_rows
from sandbox.withheld.scoring.tables_of_rows import by_method
from tests.sandbox.withheld.known import twelve

SEALED = {"kind": "mixed", "seed": 3, "style": "scored", "sizes": "published"}


@pytest.fixture
def results(tmp_path, monkeypatch):
    """Rows of twelve campaigns, of the project's method and a simple one, beside their seal; checks
    of that size.
    Figures are left out: what is committed has them all (below)."""
    monkeypatch.setattr(screens, "write", lambda drawn, path: None)
    for name, check in CHECKS.items():
        monkeypatch.setitem(CHECKS, name, check._replace(campaigns=12, seed=3, kind="mixed"))
    rows = twelve()
    rows += [type(r)(**{**vars(r), "method": "bic"}) for r in rows]
    write_rows(tmp_path / "mixed.rows.jsonl", rows)
    seal = SEALED | {"campaigns": {r.campaign: dict(r.truth) for r in rows}}
    (tmp_path / "mixed.truth.json").write_text(json.dumps(seal))
    return tmp_path


def test_all_published_files_follow_from_rows_and_seal(results):
    """Every figure of the JSON and of the table is that of `score` on the same rows; a second time,
    byte for byte. What is left of a run without rows goes."""
    (results / "pairs.json").write_text("{}")
    assert recompute(results) == ["mixed"]
    assert not (results / "pairs.json").exists()
    own = by_method(twelve())[0]
    content = json.loads((results / "mixed.json").read_text())
    assert {k: content[k] for k in own.figures} == {k: f.as_json() for k, f in own.figures.items()}
    assert content["command"] == "withheld"
    text = (results / "README.md").read_text()
    assert hashlib.sha256((results / "mixed.truth.json").read_bytes()).hexdigest() in text
    top = own.figures["top1"]
    found = "{:.3g}\u00a0% ({:.3g}\u00a0% to {:.3g}\u00a0%; 5)".format(
        *(100 * x for x in (top.value, top.low, top.high))
    )
    assert (
        f"| One effect was wrong, and the diagnosis named it first. | {found} |  |  | `top1` |"
        in text
    )
    assert (
        "![Chances stated and met, smallest sizes found, and shares with their limits](mixed.svg)"
        in text
    )
    assert "- w001: dead time; named iron loss" in text
    assert text.startswith("Made 2026-01-01 ")
    assert "`; 12 of 12 campaigns diagnosed, code `abc`." in text
    assert "Not run: narrow campaigns: pairs that look alike (12); campaigns of" in text
    assert list(json.loads((results / "mixed_baselines.json").read_text())["methods"]) == [
        "diagnosis",
        "bic",
    ]
    assert "| bic | 0 | 0 | 12 | 1 | – |" in text
    before = {p.name: p.read_bytes() for p in results.iterdir() if p.suffix != ".svg"}
    recompute(results)
    assert {p.name: p.read_bytes() for p in results.iterdir() if p.suffix != ".svg"} == before


@pytest.mark.parametrize(
    ("stated", "half", "most"),
    [
        ([0.75], "0.25", "0.75"),  # right in three of four draws
        ([1.0] * 4, "0.00", "0.00"),
        # both right, one, none: 0.1, 0.4, 0.9 in 0.81, 0.18, 0.01 of draws
        ([0.9, 0.9], "0.10", "0.40"),
    ],
)
def test_few_campaigns_show_an_error_of_chances_by_luck(stated, half, most):
    found = (
        f"in {many(len(stated), 'campaign')} they would differ by {half} from the share that "
        "was right (half of"
    )
    said = if_chances_held(stated)[0]
    assert found in said
    assert f"by {most} at most in 95 %" in said


def test_the_page_names_campaigns_where_a_simple_method_is_better(results):
    """A method with two answers exchanged: right in w001, where the diagnosis is wrong, and wrong
    in w000."""
    own = twelve()
    answers = {r.campaign: r.answer for r in own if r.part == "blind"}
    swapped = {**answers, "w000": answers["w001"], "w001": answers["w000"]}
    rows = [
        type(r)(**{**vars(r), "method": "gp", "answer": swapped[r.campaign]})
        for r in own
        if r.part == "blind"
    ]
    write_rows(results / "mixed.rows.jsonl", [*own, *rows])
    recompute(results)
    assert "| gp | 1 | 1 | 10 | 1 | w001 (dead time) |" in (results / "README.md").read_text()


def test_both_tables_of_sizes_stand_side_by_side(results):
    """Where both were run: a row a metric, published sizes first."""
    write_rows(results / "ladder.rows.jsonl", [r for r in twelve() if r.campaign != "w001"])
    seal = json.loads((results / "mixed.truth.json").read_text()) | {"sizes": "ladder"}
    (results / "ladder.truth.json").write_text(json.dumps(seal))
    assert recompute(results) == ["mixed", "ladder"]
    text = (results / "README.md").read_text()
    assert "| what was counted | diagnosis | by the ladder | name |" in text
    assert "`; 11 of 12 campaigns diagnosed" in text
    one, other = (
        by_method([r for r in twelve() if r.campaign != w])[0].figures["top1"] for w in ("", "w001")
    )
    cells = [f"{100 * f.value:.3g}\u00a0% ({f.n})" for f in (one, other)]
    assert f"| right name first | {cells[0]} | {cells[1]} | `top1` |" in text


def test_causes_outside_are_ranked_beside_the_known_campaigns_of_the_mixed_check(results):
    rows = [r for r in twelve() if r.method == OWN]
    outside = [r for r in rows if r.truth["kind"] == "outside"]
    write_rows(results / "outside.rows.jsonl", outside)
    (results / "outside.truth.json").write_bytes((results / "mixed.truth.json").read_bytes())
    assert recompute(results) == ["mixed", "outside"]
    text = (results / "README.md").read_text()
    table = (
        text[text.index("## Causes outside the library by subsystem") :]
        .split("\n\n")[2]
        .splitlines()
    )
    assert (
        table[0]
        == "| the cause lies in | seen | blamed beside it | blamed in its place | told apart |"
    )
    mixed = [r for r in rows if r.part == "blind"]
    auroc = by_subsystem(by_method(outside)[0].judged, by_method(mixed)[0].judged)
    assert [line.split(" | ")[0] for line in table[2:]] == [f"| {s}" for s in auroc]
    for line, figures in zip(table[2:], auroc.values(), strict=True):
        assert line.endswith(f"; {figures['auroc'].n}) |")
        assert f"| {figures['auroc'].value:.3g} (" in line


def test_rows_of_another_seal_or_of_several_states_of_the_code_are_refused(results):
    rows = twelve()
    write_rows(
        results / "controls.rows.jsonl", [type(r)(**{**vars(r), "code": "new"}) for r in rows]
    )
    (results / "controls.truth.json").write_bytes((results / "mixed.truth.json").read_bytes())
    with pytest.raises(BadInput, match="this page mixes 2 states of the code"):
        recompute(results)
    (results / "controls.truth.json").write_text(json.dumps({"campaigns": {}}))
    with pytest.raises(BadInput, match="its truth is not the sealed one"):
        recompute(results)


@pytest.mark.parametrize(
    "other", [{"seed": 4}, {"sizes": "ladder"}, {"style": "practice"}, {"kind": "controls"}]
)
def test_the_seal_is_of_the_check_that_the_page_names(results, other):
    seal = json.loads((results / "mixed.truth.json").read_text())
    (results / "mixed.truth.json").write_text(json.dumps(seal | other))
    with pytest.raises(
        BadInput, match=r"'mixed' was sealed as .* with 12 campaigns, not as .*; correct CHECKS"
    ):
        recompute(results)


def test_no_campaign_more_or_less_was_sealed_and_none_counts_twice(results, monkeypatch):
    rows = twelve()
    write_rows(results / "mixed.rows.jsonl", [*rows, rows[0]])
    with pytest.raises(BadInput, match="two rows of one diagnosis"):
        recompute(results)
    monkeypatch.setitem(CHECKS, "mixed", CHECKS["mixed"]._replace(campaigns=13))
    with pytest.raises(BadInput, match=r"with 12 campaigns, not as .* with 13"):
        recompute(results)


def test_without_rows_there_is_nothing_to_compute(tmp_path):
    with pytest.raises(BadInput, match="holds no rows of a check"):
        recompute(tmp_path)


def test_one_state_of_the_code_and_enough_controls():
    """No alarm in 300 excludes the goal of 1 %: 1 - 0.05^(1/300) = 0.0099; 298 would not.  Of one
    to three effects at least 100 are drawn."""
    assert 1.0 - 0.05 ** (1.0 / CHECKS["controls"].campaigns) < 0.01
    assert 1.0 - 0.05 ** (1.0 / 298) > 0.01
    assert CHECKS["mixed"].campaigns >= 100
    assert len({c.seed for c in CHECKS.values()}) == len(CHECKS)
    assert set(CHECKS) == {"mixed", "pairs", "many", "outside", "controls", "ladder"}


def test_a_check_is_made_and_scored_by_the_command_line(tmp_path, monkeypatch):
    """Both steps with the check's own seed, kind and sizes; what is kept are the rows and the
    seal."""
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
    assert sorted(p.name for p in (tmp_path / "results").iterdir()) == [
        "ladder.rows.jsonl",
        "ladder.truth.json",
    ]


def test_a_finished_check_is_kept_without_running_anything(results, tmp_path):
    """Its rows and seal under the check's name; what `score` has not left is named."""
    folder = tmp_path / "work"
    folder.mkdir()
    with pytest.raises(
        BadInput, match=r"holds no withheld\.rows\.jsonl; run `sensorless withheld score`"
    ):
        keep("mixed", folder, tmp_path / "out")
    (results / "mixed.rows.jsonl").rename(folder / "withheld.rows.jsonl")
    (results / "mixed.truth.json").rename(folder / "truth.sealed")
    keep("mixed", folder, tmp_path / "out")
    assert recompute(tmp_path / "out") == ["mixed"]


def test_shares_are_compared_with_the_effect_alone_taken_out_and_with_the_mean_of_places(
    tmp_path, monkeypatch
):
    """Three effects by hand: stated 0.5 (last 0.3, first 0.5), a negative one -0.1 (-0.2, -0.2),
    one not named (0.2, 0.0).  Last: 0.2, 0.1, 0.2 off; mean of places: 0.1, 0.1, 0.1.  Of two
    stated intervals the negative one misses."""
    rows = [
        shares_truth.Row("w000", "dead_time", 0.3, 0.5, 0.5, 0.4, 0.6, 0.36),
        shares_truth.Row("w000", "dc_link_error", -0.2, -0.2, -0.1, -0.15, -0.05, -0.2),
        shares_truth.Row("w001", "inertia", 0.2, 0.0, 0.0, 0.0, 0.0, 0.0),
    ]
    found = shares_truth.compared(rows)
    assert found["rms_last"] == pytest.approx(math.sqrt((0.04 + 0.01 + 0.04) / 3.0))
    assert found["rms_true"] == pytest.approx(0.1)
    # 0.36 for 0.3, exact, 0 for 0.2
    assert found["rms_alone"] == pytest.approx(math.sqrt((0.06**2 + 0.04) / 3.0))
    assert (found["campaigns"], found["n"], found["in_interval"], found["n_stated"]) == (
        2,
        3,
        0.5,
        2,
    )
    assert shares_truth.compared(rows[2:])["in_interval"] is None
    monkeypatch.setattr(drawing, "RESULTS", tmp_path)
    shares_truth.write(rows)
    kept = json.loads((tmp_path / "shares_truth.json").read_text())
    assert {"rms_alone", "rms_last", "rms_true", "n"} <= set(kept)
    assert (tmp_path / "shares_truth.png").is_file()


@pytest.mark.skipif(
    not list(RESULTS.glob("*.rows.jsonl")), reason="no rows of a check are kept yet"
)
def test_what_is_committed_follows_from_the_rows_that_are_committed(tmp_path):
    """The table's text, every number of every document to twelve digits (another machine sums in
    another order), and no file that does not follow but the notes."""
    for path in (*RESULTS.glob("*.rows.jsonl"), *RESULTS.glob("*.truth.json")):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    recompute(tmp_path)
    assert {p.name for p in RESULTS.iterdir()} - {"NOTES.md"} == {
        p.name for p in tmp_path.iterdir()
    }
    assert (tmp_path / "README.md").read_text() == (RESULTS / "README.md").read_text()
    for path in (p for p in tmp_path.glob("*.json") if not p.name.endswith(".truth.json")):
        found, got = (json.loads((place / path.name).read_text()) for place in (tmp_path, RESULTS))
        assert_alike(found | {"version": None}, got | {"version": None}, path.stem)


def test_at_least_300_campaigns_are_diagnosed():
    """As the goals ask for, 300 of them controls; each once, by the project's own method."""
    blind = {
        p.name: [r for r in read_rows(p) if (r.method, r.part) == (OWN, "blind")]
        for p in RESULTS.glob("*.jsonl")
    }
    assert len(blind["controls.rows.jsonl"]) >= 300
    assert sum(len(rows) for name, rows in blind.items() if not name.startswith("ladder")) >= 300


def assert_alike(found, told, where):
    """Assert that two documents are the same, numbers to twelve digits; where: what is compared."""
    if isinstance(told, dict):
        assert set(found) == set(told), where
        pairs = [(found[k], v, f"{where}.{k}") for k, v in told.items()]
    elif isinstance(told, list):
        assert len(found) == len(told), where
        pairs = [(*both, where) for both in zip(found, told, strict=True)]
    else:
        assert found == (pytest.approx(told, rel=1e-12) if isinstance(told, float) else told), where
        return
    for one, other, place in pairs:
        assert_alike(one, other, place)
