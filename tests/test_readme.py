"""The README's Python example runs, and says what the README says."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from estimators.registry import MODULES
from model.effects.library import effect_names

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("model", "estimators", "sandbox", "experiments", "docs", "tests")


def test_example_in_ten_lines():
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)[1]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    # 120 % load, estimate in control: the self-consistent angle of the linear belief
    assert float(done.stdout.split()[0]) == pytest.approx(-6.94, abs=0.2)


def test_links_lead_somewhere():
    """On every page of the repository; `made/` and `gallery/` are there once the documentation is
    built, which has pages of its own folder alone."""
    hidden = {".venv", "_build", "gallery", "made", "node_modules", "sensorless-out"}
    pages = [p for p in ROOT.rglob("*.md") if not {*p.relative_to(ROOT).parts} & hidden]
    assert len(pages) > 30
    for path in pages:
        text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
        for target in re.findall(r"\]\((?!https?:)([^)#\s]+)[^)]*\)", text):
            if not {"made", "gallery"} & {*Path(target).parts}:
                assert (path.parent / target).exists(), f"{path}: {target}"
                page = target.endswith(".md") and ROOT / "docs" in path.parents
                inside = (path.parent / target).resolve().is_relative_to(ROOT / "docs")
                assert inside or not page, f"{path}: {target} is no page of the documentation"


def test_pages_count_effects_and_estimators_right():
    """Effects by a number, estimators by a word."""
    for page in ("README.md", "docs/start/reading.md"):
        (count,) = re.findall(r"\b(\d+) effects\b", (ROOT / page).read_text())
        assert int(count) == len(effect_names()), page
    assert len(MODULES) == 20
    assert "[twenty estimators" in (ROOT / "README.md").read_text()


def test_files_that_pages_name_exist():
    """Names in backquotes with a folder, of Python files of ours, and tests by their name alone;
    results and the changelog speak of their own day."""
    ours = [str(p.relative_to(ROOT)) for room in ROOMS for p in (ROOT / room).rglob("*.py")]
    pages = [p for room in ROOMS for p in (ROOT / room).rglob("*.md") if "results" not in p.parts]
    assert len(pages) > 15
    for path in [ROOT / "README.md", *pages]:
        text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
        for name in re.findall(r"`((?:[\w.]+/)+\w+\.py|test_\w+\.py)`", text):
            assert any(f"/{own}".endswith(f"/{name}") for own in ours), f"{path}: {name}"


def test_a_newcomer_finds_the_core_in_two_steps():
    """The README leads to the page of rooms; its table names files, and functions that are defined
    in them."""
    assert "(sandbox/README.md)" in (ROOT / "README.md").read_text()
    room = ROOT / "sandbox"
    rows = (room / "README.md").read_text().partition("## Where to find what")[2].splitlines()
    named = [
        found for row in rows for found in re.findall(r"`(\w+)` in \[\w+\.py\]\(([^)]+)\)", row)
    ]
    wanted = {
        "late",
        "halfway",
        "plain_step",
        "hessian",
        "inductances",
        "_voltages",
        "in_volts",
        "noise_std_of",
        "evaluate",
        "_evidence",
        "log_evidence",
        "hypotheses",
    }
    assert wanted | {"hypotheses", "unmodeled", "share_closed", "which"} == {
        name for name, _ in named
    }
    for name, target in named:
        assert re.search(rf"^ *def {name}\(", (room / target).read_text(), re.M), (name, target)
    asked = (
        "dead time's volt-seconds",
        "Hessian",
        "become volts",
        "noise floor",
        "evidence of a set",
        "P(unknown)",
    )
    for got in (*asked, "`closed`", "effect added"):
        assert any(got in row for row in rows), got


HOP = re.compile(r"`(\w+)` in \[\w+\.py\]\(([^)]+)\)")


def test_each_hop_of_the_three_walks_is_named_by_one_before_it():
    """Functions and classes stand in the files named; the code of a hop before names each.  A
    sample goes through thirty files at most, as issue 51 asks."""
    page = ROOT / "sandbox" / "WALKS.md"
    walks = page.read_text().split("\n## ")[1:]
    assert len(walks) == 3
    for walk in walks:
        rows = [line for line in walk.splitlines() if line.startswith("| `")]
        hops = [HOP.match(row[2:]).groups() for row in rows]
        assert len(hops) > 10
        before = ""
        for name, target in hops:
            text = (page.parent / target).read_text()
            assert re.search(rf"^(def|class) {name}\b", text, re.M), (name, target)
            assert not before or re.search(rf"\b{name}\b", before), (name, target)
            before += text
    sample = {HOP.match(row[2:])[2] for row in walks[0].splitlines() if row.startswith("| `")}
    assert len(sample) <= 30


def test_continuous_integration_runs_the_second_command():
    """The line that `.ci/run` ends with is the README's, to the letter."""
    block = re.search(r"## Two commands.*?```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.S)[
        1
    ]
    second = block.splitlines()[1].partition("  #")[0].strip()
    assert second.endswith("/pytest")
    assert (ROOT / ".ci" / "run").read_text().splitlines()[-1] == second
