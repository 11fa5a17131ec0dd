"""What commands print: folded to a terminal's width, written at one place, one line each where no
terminal is."""

from __future__ import annotations

import ast
import io
import sys
from pathlib import Path

import pytest

import sandbox
from sandbox.cli import main
from sandbox.cli.application import application
from sandbox.cli.refusals import commands_of
from sandbox.output.tables import many, print_prose, print_table
from sandbox.public.catalogue import estimator_card_text

TEXT = (
    "audited up to 180 % of rated current; see --continue and "
    + "/a/long/path" * 6
    + " for what was kept"
)


class Terminal(io.StringIO):
    """A stream that says it is a terminal and keeps what is written."""

    def isatty(self):
        return True


@pytest.fixture
def printed(monkeypatch):
    """A function that returns the lines which a call prints to a terminal of so many columns."""

    def lines(columns, call):
        out = Terminal()
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", out)
            for name, value in (("COLUMNS", str(columns)), ("TERM", "dumb")):
                patch.setenv(name, value)
            call()
        return out.getvalue().splitlines()

    return lines


def test_prose_is_folded_below_its_first_word_and_a_path_is_kept_whole(printed):
    assert printed(40, lambda: print_prose(TEXT, "note: ")) == [
        "note: audited up to 180 % of rated",
        "      current; see --continue and",
        "      " + "/a/long/path" * 6,
        "      for what was kept",
    ]


def test_prose_is_one_line_where_no_terminal_is(capsys):
    print_prose(TEXT, "note: ")
    assert capsys.readouterr().out == f"note: {TEXT}\n"


@pytest.mark.parametrize("columns", [60, 80, 100])
def test_a_tables_title_is_folded(columns, printed):
    said = printed(columns, lambda: print_table("what " * 40, ["name", "value"], [["a", "1"]]))
    assert max(map(len, said)) <= columns
    assert sum(line.count("what") for line in said) == 40


@pytest.mark.parametrize(
    "kind", ["motors", "effects", "estimators", "scenarios", "datasets", "presets"]
)
def test_lists_fit_eighty_columns(kind, printed):
    said = printed(80, lambda: main(["list", kind]))
    assert max(map(len, said)) <= 80
    assert len(said) >= len(getattr(sandbox, f"list_{kind}")())


@pytest.mark.parametrize("command", ["audit", "maps"])
def test_answers_fit_eighty_columns(command, printed, tmp_path, monkeypatch):
    """Tables, sentences and all; `spm` is the motor whose audit has most to say."""
    monkeypatch.chdir(tmp_path)
    said = printed(80, lambda: main([command, "spm", "--out", "here"]))
    assert max(map(len, said)) <= 80
    assert said[-1] == "results in here"
    assert any(line.startswith("└") for line in said)


@pytest.mark.parametrize("name", sandbox.list_estimators())
def test_cards_of_estimators_fit_eighty_columns(name, printed):
    """Those of effects: tests/model/effects/test_library.py. The dearest cost in words that was
    seen is that of Python."""
    cost = "saturated 123456, linear 123456 ns a step, measured now on ipm_exchanged (in Python)"
    card = estimator_card_text(sandbox.load_estimator(name), cost)
    assert max(map(len, card.splitlines())) <= 80
    assert printed(80, lambda: print_prose(card)) == card.splitlines()  # it is printed as it is


def calls(app, before=()):
    """Return the words of every command, those of the program itself included."""
    below = [(*before, name) for name in commands_of(app)]
    return [before, *(words for call in below for words in calls(app[call[-1]], call))]


def test_help_fits_eighty_columns(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    every = calls(application())
    assert len(every) > 20
    for words in every:
        assert main([*words, "--help"]) == 0
        assert [line for line in capsys.readouterr().out.splitlines() if len(line) > 80] == [], (
            words
        )


def test_prose_is_printed_at_one_place():
    """`print` elsewhere would not be folded; that on standard error is for refusals, which scripts
    read as one line."""
    root = Path(sandbox.__file__).parent
    found = []
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            bare = (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id == "print"
            )
            if bare and not any(word.arg == "file" for word in node.keywords):
                found.append(path.relative_to(root).as_posix())
    assert found == ["output/tables.py"]


def test_one_has_no_plural():
    assert [many(k, "run") for k in (0, 1, 2)] == ["0 runs", "1 run", "2 runs"]
