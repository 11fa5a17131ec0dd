"""Mutations: the rules by hand, the map names files that are there, what stays kept, what the table says."""

import json
from collections import Counter
from pathlib import Path

import pytest

from experiments import mutations as mu
from experiments.mutation_rules import mutations

ROOT = Path(__file__).resolve().parents[2]
SOURCE = b'''"""Text 3.0 + 4."""
LIMIT = 4.0
def f(x, y):
    if x < -y and x > 0.5:
        raise ValueError(f"{x + 1} is too much")
    return max(x * y, x) + LIMIT  # caf\xc3\xa9
'''
CHANGED = {
    ("number", "2.0"), ("number", "6.0"), ("logic", "(x < -y) or (x > 0.5)"), ("comparison", "(x) >= (-y)"),
    ("comparison", "(x) <= (0.5)"), ("sign", "(y)"), ("number", "0.25"), ("number", "0.75"),
    ("operator", "(max(x * y, x)) - (LIMIT)"), ("dropped", "(max(x * y, x))"), ("call", "min(x * y, x)"),
    ("operator", "(x) / (y)"), ("dropped", "(x)"),
}  # fmt: skip


def test_every_rule_by_hand():
    """Numbers, signs, comparisons, terms; neither texts nor refusals."""
    found = mutations("f.py", SOURCE)
    assert {(m.rule, m.new) for m in found} == CHANGED
    assert {m.constant for m in found} == {"", "LIMIT"}
    for m in found:
        changed = m.applied(SOURCE)
        compile(changed, "f.py", "exec")
        assert changed.count(b"\n") == SOURCE.count(b"\n")
        assert changed != SOURCE


def test_the_map_names_what_is_there():
    """Every file once, every test a file; all of the diagnosis is there."""
    groups = mu.groups()
    assert max(Counter(f for g in groups for f in g.files).values()) == 1
    assert all((ROOT / t.partition("::")[0]).is_file() for g in groups for t in g.tests)
    gap = {p.relative_to(ROOT).as_posix() for p in (ROOT / "sandbox" / "gap").rglob("*.py")}
    assert {f for f in gap if not f.endswith("__init__.py")} <= {f for g in groups for f in g.files}
    assert len(mu.by_hand()) == 13  # each is found in its file, once
    assert all(mu.group_of(m.file) for m in mu.by_hand())


def test_one_change_of_every_constant_is_drawn(monkeypatch):
    """Of a group of one file: its constants once each, then others at random up to the number asked for."""
    file = "sandbox/gap/search/subsets.py"
    monkeypatch.setattr(mu, "groups", lambda: [mu.Group((file,), (), 1.0)])
    drawn = [m for m in mu.sample(40) if m.rule != "by hand"]
    assert len(drawn) == 40 - 13
    names = Counter(m.constant for m in drawn)
    assert [names[n] for n in ("WEIGHED", "MOVES", "STILL", "NUMBER", "MORE", "THINS")] == [1, 1, 1, 1, 0, 0]
    assert mu.sample(40) == mu.sample(40)


@pytest.mark.parametrize(("noticed", "tests", "stays"), [("t", "old", True), ("", "old", False), ("", None, True)])
def test_an_answer_holds_while_file_and_tests_do(tmp_path, noticed, tests, stays):
    """Of a file that was another then nothing is known; of two answers the last counts; a line cut off does not."""
    file = "sandbox/gap/search/estimates.py"
    own = mu.digest(*mu.group_of(file).tests) if tests is None else tests
    last = mu.Answer(file, "1: a -> b", "number", "", noticed, 1.0, mu.digest(file), own)
    kept = tmp_path / "m.jsonl"
    lines = [last._replace(seconds=2.0), last, last._replace(change="2: a -> b", state="another")]
    kept.write_text("\n".join(json.dumps(a._asdict()) for a in lines) + '\n{"file": "cut o')
    assert mu.answers(kept) == {last.key: last}
    assert mu.holds(last) is stays
    assert not mu.holds(None)


def test_the_table_counts_and_lists():
    a = mu.Answer("sandbox/gap/search/subsets.py", "1: a | b -> c", "number", "", "", 1.0, "s", "t")
    lines = mu.table([a, a._replace(change="2", noticed="test"), a._replace(file="model/levels.py", noticed="test")],
                     {"model": 7, "sandbox/gap/search": 9})  # fmt: skip
    assert "| model | 7 | 1 | 1 | 100 % |" in lines
    assert "| sandbox/gap/search | 9 | 2 | 1 | 50 % |" in lines
    assert "| all | 16 | 3 | 2 | 67 % |" in lines
    assert lines[-1] == "| `sandbox/gap/search/subsets.py` | `1: a \\| b -> c` | open; the tests have changed since |"
