"""Looking at results: `show`, `view`, tables within eighty columns, commands that call the page."""

from __future__ import annotations

import dataclasses
import sys
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

import sandbox
from sandbox.cli import main, parse
from sandbox.evaluation import protocol_tests
from sandbox.output.tables import effort_bar, folded, further, print_table
from sandbox.public.protocols import ProtocolResult
from sandbox.public.runs import ComparisonResult
from tests.sandbox.public.naming import of

evaluated = import_module("sandbox.evaluation.protocol")  # the name in `sandbox` is the function


@of("show", "view")
def test_show_and_view_without_a_display(run, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    run.save(tmp_path, table=False)
    (tmp_path / "report.html").write_text("<html></html>")
    assert main(["show", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.count("\n") == 1
    assert "report.html" in said
    assert f"sensorless view {tmp_path / 'simulate.rrd'} --web" in said
    with pytest.raises(sandbox.BadInput, match="--web` shows it in a browser"):
        sandbox.view(tmp_path / "simulate.rrd")
    with pytest.raises(sandbox.BadInput, match="no result at"):
        sandbox.show(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(sandbox.BadInput, match="nothing to show"):
        sandbox.show(tmp_path / "empty")
    (tmp_path / "empty" / "audit").mkdir()
    with pytest.raises(sandbox.BadInput, match="a result has a page"):
        # an empty folder is no result
        sandbox.show(tmp_path / "empty")
    (tmp_path / "empty" / "audit" / "audit.json").write_text("{}")
    with pytest.raises(sandbox.BadInput, match=r"give one of the results below it: audit$"):
        sandbox.show(tmp_path / "empty")


def test_show_with_a_display_opens_page_and_trace(run, tmp_path, monkeypatch):
    opened = []
    showing = import_module("sandbox.public.showing")
    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(showing.webbrowser, "open", opened.append)
    monkeypatch.setattr(showing, "view", lambda path, web=False: opened.append(str(path)))
    run.save(tmp_path, table=False)
    assert "opened" in sandbox.show(tmp_path)
    assert opened == [(tmp_path / "simulate.html").as_uri(), str(tmp_path / "simulate.rrd")]


def test_tables_fit_eighty_columns(small_comparison, capsys, monkeypatch):
    """Folded, every cell kept; the columns that tell rows apart stand in each part."""
    monkeypatch.setenv("COLUMNS", "80")
    from sandbox.evaluation.pages.compare_tables import comparison_tables
    from sandbox.public.printed import print_comparison

    print_comparison(small_comparison)
    said = capsys.readouterr().out
    drawn = [line for line in said.splitlines() if line[:1] in "┏┃┡│└"]
    assert drawn
    assert max(map(len, drawn)) <= 80
    for _, heads, rows in comparison_tables(small_comparison):
        for cell in [*heads, *(c for row in rows for c in row)]:
            assert cell in said
    assert said.count("load %") == 2 * len(folded(heads, rows, 3, 80, 2))
    for line in (line for line in said.splitlines() if "ekf sat." in line or "ekf lin." in line):
        assert ("ekf sat." in line) == ("ekf lin." in line)
    assert folded(["k", *(10 * ["x" * 17])], [], 1, 80) == [
        [0, 1, 2, 3],
        [0, 4, 5, 6],
        [0, 7, 8, 9],
        [0, 10],
    ]


def test_columns_that_belong_together_are_not_parted():
    """79 columns: the first takes 4, each other 20, so three of them fit; a pair that fits nowhere
    is parted."""
    assert folded(["k", *(6 * ["x" * 17])], [], 1, 80, 2) == [[0, 1, 2], [0, 3, 4], [0, 5, 6]]
    assert folded(["k", *(2 * ["x" * 57])], [], 1, 80, 2) == [[0, 1], [0, 2]]


def test_a_column_of_theory_is_there_where_theory_predicts_something(
    small_comparison, tmp_path, capsys
):
    from sandbox.evaluation.pages.compare_page import write_run
    from sandbox.public.printed import print_comparison, print_run

    def said(c):
        """Return heads, printed text and page, of a comparison and of its first run."""
        alone = dataclasses.replace(c, runs=c.runs[:1])
        print_comparison(c)
        print_run(alone, SimpleNamespace(loops={}, published=False))
        write_run(tmp_path / "run.html", alone)
        return capsys.readouterr().out, (tmp_path / "run.html").read_text(encoding="utf-8")

    def without_theory(run):
        return dataclasses.replace(
            run, rows=tuple(dataclasses.replace(r, predicted_mean_deg=None) for r in run.rows)
        )

    printed, page = said(small_comparison)
    assert printed.count("theory °") >= 3  # both loops, and the run
    assert "theory °" in page
    assert "dashed: theory" in page
    without = dataclasses.replace(
        small_comparison, runs=tuple(map(without_theory, small_comparison.runs))
    )
    printed, page = said(without)
    assert "theory °" not in printed
    assert "theory" not in page


def test_a_table_in_a_pipe_is_whole(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    heads, row = [f"head {k}" for k in range(30)], ["123456.78"] * 30
    print_table("many", heads, [row])
    said = capsys.readouterr().out.splitlines()
    assert sum("head 0 " in line for line in said) == 1
    assert all(h in said[2] for h in heads)


def test_a_long_first_column_is_broken_and_numbers_are_not(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    print_table("files", ["recording", "before", "after"], [["x" * 90, "123456.78", "1.25"]])
    said = capsys.readouterr().out.splitlines()
    assert max(map(len, said)) == 80
    assert "123456.78" in said[4]
    assert sum(line.count("x") for line in said) == 90


CALLS = {
    "simulate": ["simulate"],
    "compare": ["compare"],
    "protocol": ["protocol", "--motors", "ipm"],
    "bench": ["bench"],
    "audit": ["audit", "ipm"],
    "maps": ["maps", "ipm"],
    "identify": ["identify", "folder"],
    "diagnose": ["diagnose", "folder"],
    "list_motors": ["list", "motors"],
    "list_effects": ["list", "effects"],
    "list_estimators": ["list", "estimators"],
    "list_scenarios": ["list", "scenarios"],
    "list_datasets": ["list", "datasets"],
    "list_tests": ["list", "tests"],
    "view": ["view", "x.rrd"],
    "show": ["show", "x"],
    "sweep": ["sweep", "x.toml"],
    "verify": ["verify", "x"],
    "check": ["check", "folder"],
    "plan": ["plan"],
}


@pytest.mark.parametrize("name", CALLS)
def test_commands_call_the_page(name, monkeypatch, tmp_path):
    """Every command of the command line but `withheld`, which is no function of the page."""

    class Called(Exception):
        """Raised where the page's function is called."""

    def called(*_, **__):
        raise Called

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sandbox, name, called)
    call = parse(CALLS[name])
    with pytest.raises(Called):
        call.run(*call.bound.args, **call.bound.kwargs)


def test_seed_and_jobs_are_told_where_they_do_something(capsys):
    for command, seed, jobs in (
        ("compare", True, True),
        ("simulate", True, False),
        ("protocol", True, True),
        ("audit", False, False),
        ("maps", False, False),
        ("identify", False, False),
        ("bench", False, False),
        ("diagnose", False, True),
        ("sweep", False, True),
        ("check", False, True),
        ("plan", False, True),
        ("replay", False, True),
        ("verify", False, False),
        ("export-estimator", False, False),
        ("motor", False, False),
    ):
        assert main([command, "--help"]) == 0
        said = capsys.readouterr().out
        assert ("--seed" in said, "--jobs" in said) == (seed, jobs), command
        assert ("[default: all cores]" in said) == (
            command in ("compare", "protocol", "diagnose", "sweep")
        ), command


def test_how_many_simulations_to_expect():
    """Half as many again wherever as many as expected are reached; nothing is drawn where nobody
    looks on."""
    assert [further(2000.0, n) for n in (0.0, 1999.0, 2000.0, 3000.0, 4600.0)] == [
        2000.0,
        2000.0,
        3000.0,
        4500.0,
        6750.0,
    ]
    with effort_bar("diagnosing", True, 2000.0) as (say, count):
        say("reading")
        count(1.0)


def test_a_number_too_small_to_be_seen_has_no_minus(capsys):
    """0.004 of a degree is printed as +0.00, whichever its sign; 0.006 is not zero."""
    from model.drive_files import load_drive
    from model.saliency import audit
    from sandbox.public.printed import print_audit

    drive = load_drive("ipm_exchanged")
    found = audit(drive.motor)
    angles = np.full_like(found.angle_local, np.radians(-0.004))
    angles[0] = np.radians(-0.006)
    print_audit(drive, dataclasses.replace(found, angle_local=angles))
    said = capsys.readouterr().out
    assert "-0.00" not in said
    assert "-0.01" in said


def test_a_repr_is_one_line_with_what_counts():
    """Values as the files of `ipm` and `staircase` state them: 0.3 s + 13 x 0.6 s = 8.1 s."""
    motor = "<Drive: ipm, 1.2 A peak, 1.06 N m, 1800 rpm, 400 V, injects 30 V at 500 Hz>"
    assert repr(sandbox.load_motor("ipm")) == motor
    scene = "<Scenario: staircase, 14 segments, 8.1 s, rotor locked, current controlled>"
    assert repr(sandbox.load_scenario("staircase")) == scene
    one = sandbox.Scenario("one", (sandbox.Segment(0.3),))
    assert repr(one) == "<Scenario: one, 1 segment, 0.3 s, rotor locked, current controlled>"


def test_a_protocol_counts_its_tests_once_and_its_rows_are_short():
    outcome = protocol_tests.Outcome((None,) * 24, {"mean_deg": 0.5}, True)
    units = [
        evaluated.Unit("ipm", "load_step", "qnull", belief) for belief in ("saturated", "linear")
    ]
    rows = (
        evaluated.Row(units[0], outcome, 1.0),
        evaluated.Row(units[1], outcome, 1.0, "the bus ends"),
    )
    assert repr(rows[0]) == "<Row: load_step, qnull saturated on ipm: passed, 24 points>"
    assert repr(rows[1]) == "<Row: load_step, qnull linear on ipm: the bus ends>"
    assert repr(outcome) == "<Outcome: passed, 24 points, 1 metrics>"
    summed = ProtocolResult(evaluated.Protocol(rows, 0)).summary()
    assert summed == "load_step alone, 2 results, 2 of 2 judged met their goals"
    more = (*rows, evaluated.Row(evaluated.Unit("ipm", "creep", "qnull", "linear"), outcome, 1.0))
    assert (
        ProtocolResult(evaluated.Protocol(more, 0))
        .summary()
        .startswith("2 tests, 3 results, 3 of 3")
    )


@pytest.mark.parametrize(
    ("means", "said"),
    [
        ((None, None), "lost"),
        ((1.0, -6.0), "6.00 deg"),
        ((-2.0, None), "2.00 deg (lost in 1 of 2)"),
    ],
)
def test_a_comparison_says_where_lock_was_lost(small_comparison, means, said):
    """Of runs that differ by their error alone: two of the linear model, one of the saturated."""
    (row, *_), run = small_comparison.rows, small_comparison.runs[0]
    errors = [("linear", mean) for mean in means] + [("saturated", 0.25)]
    rows = tuple(
        dataclasses.replace(
            row, belief=belief, error_deg=dataclasses.replace(row.error_deg, mean=m)
        )
        for belief, m in errors
    )
    one = dataclasses.replace(small_comparison, runs=(dataclasses.replace(run, rows=rows),))
    summed = f"ipm_exchanged, two_steps, qnull; worst mean error: linear {said}, saturated 0.25 deg"
    assert ComparisonResult(one).summary() == summed
