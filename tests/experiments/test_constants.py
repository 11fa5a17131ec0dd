"""The sensitivity of answers to constants: what is scaled, where it acts, what is told of it; one real diagnosis."""

import gc
import importlib
import json
import math
import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest

from experiments.constants import (
    CONSTANTS,
    FACTORS,
    RESULTS,
    Constant,
    Trial,
    answered,
    answers,
    campaigns_of,
    changed,
    label_of,
    listed_for,
    main,
    places_of,
    remembered,
    truths_of,
)
from experiments.constants_page import Listed, change, page, table, tried
from experiments.recalled import MEMORY, recalled
from model.errors import BadInput
from sandbox.gap.evidence import priors
from sandbox.gap.search import multistart, posterior
from sandbox.recordings.writing import write_campaign
from sandbox.withheld.scoring.running import code_digest
from tests.data import recordings_folder
from tests.sandbox.gap.conftest import CASES, small_campaign

WIDE = next(k for k, c in enumerate(CONSTANTS) if c.name == "WIDE")


def answer(*effects, case="p", constant="", factor=1.0, probability=0.9, members=None, verdict="explained"):
    """Return one line of answers."""
    told = [list(effects)] if members is None else members
    return {
        "case": case, "constant": constant, "factor": factor, "code": code_digest(), "verdict": verdict,
        "effects": list(effects), "probability": probability, "ambiguity_set": told, "simulations": 10,
    }  # fmt: skip


@pytest.mark.parametrize("constant", CONSTANTS, ids=lambda c: c.label)
def test_every_constant_is_there_and_scales(constant):
    """In its module, and changed in all that import it by name; back afterwards."""
    modules = [importlib.import_module(m) for m in places_of(constant)]
    before = getattr(modules[0], constant.name)
    for factor in FACTORS:
        with changed(constant, factor):
            assert all(getattr(m, constant.name) != before for m in modules)
    assert all(getattr(m, constant.name) == before for m in modules)


def test_what_scaling_means():
    assert Constant("m", "A", "", "").scaled(0.5, 2.0) == 1.0
    assert Constant("m", "A", "", "").scaled(1350, 0.5) == 675
    assert Constant("m", "A", "", "").scaled((1.0, 4.0), 0.5) == (0.5, 2.0)
    assert Constant("m", "A", "", "", place=1).scaled((1.0, 4.0), 0.5) == (1.0, 2.0)
    odds = Constant("m", "A", "", "", odds=True).scaled((0.5, 0.25, 0.25), 2.0)  # 0.5, 0.5, 1 of 2
    assert odds == pytest.approx((0.25, 0.25, 0.5))


def test_a_constant_acts_where_it_is_imported():
    """WIDE of `priors` is used in `multistart` too, under its own name there."""
    assert "sandbox.gap.search.multistart" in places_of(CONSTANTS[WIDE])
    with changed(CONSTANTS[WIDE], 2.0):
        assert multistart.WIDE == priors.WIDE == 3.0
    number = next(c for c in CONSTANTS if c.name == "NUMBER")

    def odds():
        """Return the log odds of two effects against none, before any data."""
        return posterior.log_prior(["dead_time", "inertia"]) - posterior.log_prior([])

    before = odds()
    with changed(number, 2.0):  # every further effect twice as likely against none
        assert odds() == pytest.approx(before + math.log(4.0))
    gone = Constant("evidence.priors", "GONE", "", "")
    with pytest.raises(BadInput, match=r"has no constant GONE; correct constants\.toml"), changed(gone, 2.0):
        pass


def test_changes_in_words():
    truth, before = ["a_b"], answer("a_b", case="p1")
    assert change(before, answer("a_b", case="p1", probability=0.5), truth) == ""
    wrong = answer("c", case="p1", probability=0.968)
    assert change(before, wrong, truth) == "p1: explained, c (0.968), wrong, truth outside the ambiguity set"
    both = answer("a_b", case="p1", members=[["c"]])
    assert change(before, both, truth) == "p1: truth outside the ambiguity set"
    assert change(wrong, before, truth) == "p1: explained, a b (0.900), right"
    assert change(before, {"case": "p1", "failed": "no"}, truth) == "p1: fails"
    assert change(before, wrong, None) == "p1: explained, c (0.968)"


def test_a_table_has_a_row_for_what_was_tried():
    own = label_of(WIDE)
    found = [
        answer("a", case="p1"), answer("a", case="p2"), answer("a", case="p1", constant=own, factor=0.5),
        answer("c", case="p2", constant=own, factor=0.5),
        answer("a", case="p1", constant=own, factor=2.0, probability=0.7),
    ]  # fmt: skip
    base = {a["case"]: a for a in found[:2]}
    listed = [Listed(own, "a width", "practice"), Listed("other", "never tried", "")]
    rows = table(tried(found, base, {"p2": ["a"]}, listed))[2:]
    assert len(rows) == 2
    assert "p2: explained, c (0.900), wrong, truth outside the ambiguity set | 1.000 |" in rows[0]
    assert "| none of 1 | 0.200 |" in rows[1]


def test_a_page_counts_what_changes():
    """Of four answers one is wrong now and one has lost the truth; the constant that changes nothing is named apart."""
    listed = [Listed("a.ONE", "one", "practice"), Listed("b.TWO", "two", "practice"), Listed("c.THREE", "three", "")]
    found = [
        answer("x", case="p1"), answer("x", case="p1", constant="a.ONE", factor=0.5, members=[["y"]]),
        answer("y", case="p1", constant="a.ONE", factor=2.0),
        answer("x", case="p1", constant="b.TWO", factor=0.5, probability=0.88),
        answer("x", case="p1", constant="b.TWO", factor=2.0),
    ]  # fmt: skip
    text = "\n".join(page(found, {"p1": ["x"]}, listed))
    assert "1 campaigns were diagnosed with each of 2 constants" in text
    assert "2 of the 4 answers change" in text
    assert "In 1 of them the first hypothesis is wrong." in text
    assert "| p1 | x | explained | x | 0.900 |" in text
    assert "\n`b.TWO` (two)." in text


def test_a_constant_that_has_moved_keeps_its_words():
    found = [answer("x", constant="search.before.POINTS"), answer("x", constant="search.before.GONE")]
    told = {c.label: c.what for c in listed_for(found)}
    assert told["search.before.POINTS"] == told["search.neighbours.POINTS"] != ""
    assert told["search.before.GONE"] == "no longer there"


def test_a_page_is_of_one_state_of_the_code(tmp_path):
    for code in ("one", "other"):
        with (tmp_path / "constants.jsonl").open("a") as file:
            file.write(json.dumps({**answer("x"), "code": code}) + "\n")
    with pytest.raises(BadInput, match="several states of the code"):
        main([str(tmp_path), "--results", str(tmp_path), "--recompute"])
    (tmp_path / "constants.jsonl").write_text(json.dumps({**answer("x"), "code": "old"}) + "\n")
    main([str(tmp_path), "--results", str(tmp_path), "--recompute"])
    assert "(`old`, " in (tmp_path / "constants.md").read_text()


def test_it_goes_on_where_it_stopped(tmp_path):
    for name in ("p01", "p02"):
        (tmp_path / "in" / name).mkdir(parents=True)
        (tmp_path / "in" / name / "campaign.toml").touch()
    (tmp_path / "in" / "p01.truth.toml").write_text('effects = ["dead_time"]')
    seen = []

    def how(folder):
        """Answer by what WIDE is; fail once."""
        seen.append((folder.name, priors.WIDE))
        if len(seen) == 2:
            raise BadInput("no hypothesis")
        best = {"effects": ["dead_time"] if priors.WIDE < 2.0 else ["inertia"], "probability": 0.75}
        return {
            "verdict": "explained",
            "hypotheses": [best],
            "ambiguity_set": [best["effects"]],
            "cost": {"simulations": 1},
        }

    call = [str(tmp_path / "in"), "--only", "WIDE", "--results", str(tmp_path / "out")]
    main([*call, "--cases", "p01"], how)
    assert [w for _, w in seen] == [1.5, 0.75, 3.0]
    assert answers(tmp_path / "out" / "constants.jsonl")[1]["failed"] == "BadInput: no hypothesis"
    with (tmp_path / "out" / "constants.jsonl").open("a") as file:
        file.write('{"case": "p0')  # cut off
    main(call, how)
    assert [n for n, _ in seen[3:]] == ["p02"] * 3
    text = (tmp_path / "out" / "constants.md").read_text()
    assert "| 0.5 | p01: fails |" in text
    assert (
        "p01: explained, inertia (0.750), wrong, truth outside the ambiguity set; p02: explained, inertia (0.750)"
        in text
    )
    with pytest.raises(BadInput, match="no such campaign"):
        main([*call, "--cases", "p99"], how)


def test_a_real_diagnosis_with_a_constant_changed(tmp_path):
    """The smallest campaign there is, one recording: an answer in the contract's words, as it is and with a change."""
    folder = write_campaign(tmp_path / "quiet", small_campaign({}, CASES[-1:]))
    plain, other = (answered(Trial(folder, index, 2.0)) for index in (None, WIDE))
    assert "failed" not in plain
    assert {"verdict", "effects", "probability", "ambiguity_set"} <= set(plain) == set(other)
    assert (plain["constant"], other["constant"]) == ("", "evidence.priors.WIDE")
    assert plain["probability"] != other["probability"]


def test_what_is_remembered_changes_no_answer(tmp_path):
    """The same diagnoses one after the other, their simulations found again, and each by itself: equal to the bit."""
    folder = write_campaign(tmp_path / "quiet", small_campaign({}, CASES[-1:]))
    trials = [Trial(folder, None, 1.0), Trial(folder, WIDE, 2.0), Trial(folder, None, 1.0)]
    MEMORY.open("")
    together = [answered(t) for t in trials]
    found = MEMORY.found
    MEMORY.open("")
    alone = [answered(t) for t in trials[:2]]
    assert found > MEMORY.found  # the third was asked for what the first had computed
    assert together == [*alone, alone[0]]
    gc.collect()
    assert not MEMORY.inputs  # no recording outlives its diagnosis: eighty diagnoses would fill any memory
    with recalled("another"):
        assert not MEMORY.whole


def test_a_constant_of_the_slopes_is_remembered_by_nobody():
    own = {c.label for k, c in enumerate(CONSTANTS) if isinstance(remembered(Trial(Path("p"), k, 2.0)), nullcontext)}
    assert own == {"BLOCK", "MOVING", "FARTHEST"}  # those that `evidence.normal` holds or imports


def test_campaigns_and_truths_of_what_was_made_blindly(tmp_path):
    """As `withheld make` writes them; a cause outside the library has no truth among sets of effects."""
    (tmp_path / "campaigns" / "w000").mkdir(parents=True)
    (tmp_path / "campaigns" / "w000" / "campaign.toml").touch()
    sealed = {"w000": {"effects": ["inertia"], "outside": None}, "w001": {"effects": [], "outside": "fan"}}
    (tmp_path / "truth.sealed").write_text(json.dumps({"campaigns": sealed}))
    assert [p.name for p in campaigns_of(tmp_path)] == ["w000"]
    assert truths_of(tmp_path) == {"w000": ["inertia"]}


def test_the_page_that_is_kept_follows_from_its_rows(tmp_path):
    """Rows and truths alone make the page again; that of practice needs its truths."""
    practice = recordings_folder() / "practice"
    shutil.copy(RESULTS / "constants.jsonl", tmp_path)
    main([str(practice), "--results", str(tmp_path), "--recompute"])
    assert (tmp_path / "constants.md").read_text() == (RESULTS / "constants.md").read_text()
