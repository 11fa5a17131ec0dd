"""The documentation builds without a warning, loads nothing from a network, and shows the drawings
of its scripts."""

from __future__ import annotations

import ast
import html
import importlib
import inspect
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from cyclopts import CycloptsError

from model.effects.card import PORTS
from model.effects.library import effect_names, load_effect
from model.errors import BadInput
from sandbox.cli import parse
from sandbox.plant import period
from tests import screens

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    *sorted(DOCS.glob("*/*.md")),
    DOCS / "index.md",
    *sorted((DOCS / "tutorials").glob("*.py")),
    *(
        ROOT / name
        for name in (
            "estimators/README.md",
            "estimators/LIMITS.md",
            "estimators/c/README.md",
            "sandbox/plant/README.md",
            "sandbox/evaluation/sweep/README.md",
            "sandbox/recordings/IMPORTING.md",
            "sandbox/recordings/CHECKING.md",
            "sandbox/recordings/RECORDING.md",
            "sandbox/gap/README.md",
        )
    ),
]


@pytest.fixture(scope="module")
def built():
    """The folder of pages, built as anybody builds it; pages that have not changed are not made
    anew."""
    environment = {**os.environ, "MPLBACKEND": "agg"}
    call = [sys.executable, str(DOCS / "build.py")]
    done = subprocess.run(
        call, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr  # every warning is an error
    return DOCS / "_build" / "html"


def test_every_field_of_the_objects_page_has_a_meaning(monkeypatch):
    """A comment beside it in its source, in words; a unit alone says nothing."""
    monkeypatch.syspath_prepend(str(DOCS / "extensions"))
    pages = importlib.import_module("field_pages")
    tables = [
        c for classes in pages.OBJECTS.values() for c in classes if not pages.has_parameters(*c)
    ]
    # the others list their parameters themselves: tests/sandbox/public/test_page.py
    assert len(tables) == 5
    for module, name in tables:
        noted = pages.comments(module, name)
        assert noted
        for field, (_, comment) in noted.items():
            assert len(comment.split()) > 1, f"{name}.{field}: '{comment}'"


def test_pages_load_nothing_from_a_network(built):
    loads = re.compile(r'<(?:script|img|link|iframe)\b[^>]*\b(?:src|href)="(?:https?:)?//[^"]*"')
    pages = sorted(built.rglob("*.html"))
    assert len(pages) > 40
    for page in pages:
        assert not loads.findall(page.read_text(encoding="utf-8")), page


def test_each_tutorial_was_run_and_comes_as_a_notebook(built):
    for source in sorted((DOCS / "tutorials").glob("plot_*.py")):
        page = (built / "gallery" / f"{source.stem}.html").read_text(encoding="utf-8")
        assert f"{source.stem}.ipynb" in page
        assert "sphx-glr-script-out" in page or 'class="drawing' in page
        assert "Traceback" not in page


@pytest.fixture
def wide_tables(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "extensions"))
    return importlib.import_module("wide_tables")


def test_no_table_is_wider_than_its_page(built, wide_tables):
    """By its longest words: within the page at 1280 pixels; at 390 it fits, or its rows become
    cards."""
    for page in sorted(built.rglob("*.html")):
        if "_downloads" in page.parts:
            continue
        for text in wide_tables.TABLE.findall(page.read_text(encoding="utf-8")):
            table = wide_tables.table_of(text)
            found = f"{page.relative_to(built)}: {table.heads}, at least {table.least:.0f} px"
            assert table.least <= wide_tables.DESK, found
            narrow = not table.heads or table.least <= wide_tables.PHONE
            assert narrow or text.startswith('<table class="cards'), found


def planted(columns, word):
    heads = "".join(f"<th>{k}</th>" for k in range(columns))
    cells = "".join(f"<td>{word}</td>" for _ in range(columns))
    return (
        "<table "
        f'class="docutils"><thead><tr>{heads}</tr></thead><tbody><tr>{cells}</tr></tbody></table>'
    )


def test_a_table_that_is_too_wide_is_found(wide_tables):
    """Nine words of 20 letters need 9 x (20 letters + margins) = 1476 px; four of them fit a desk,
    not a telephone."""
    (wide,) = wide_tables.tables(planted(9, "incommensurabilities"))
    assert wide.least == pytest.approx(9 * (20 * wide_tables.LETTER + wide_tables.AROUND))
    assert wide.least > wide_tables.DESK
    (cards,) = wide_tables.tables(planted(4, "incommensurabilities"))
    assert wide_tables.PHONE < cards.least < wide_tables.DESK
    fitted = wide_tables.fitted(planted(4, "incommensurabilities"))
    assert 'class="cards docutils"' in fitted
    assert fitted.count("data-head=") == 4
    assert "data-head" not in wide_tables.fitted(planted(2, "short"))


needs_browser = pytest.mark.skipif(
    screens.browser() is None, reason="no Chromium here: pages are not rendered"
)


@needs_browser
def test_every_page_fits_a_telephone_and_a_desk(built, tmp_path):
    pages = [
        p.relative_to(built).as_posix()
        for p in sorted(built.rglob("*.html"))
        if "_downloads" not in p.parts
    ]
    assert len(pages) > 50
    assert screens.findings(built, pages, tmp_path) == []


@needs_browser
def test_the_browser_finds_what_does_not_fit(tmp_path):
    pages = tmp_path / "pages"
    pages.mkdir()
    small = (
        '<svg class="drawing" aria-label="small" viewBox="0 0 900 20"><text y="9" '
        'font-size="9">so</text></svg>'
    )
    body = f'<div style="overflow-x:auto">{planted(9, "incommensurabilities")}</div>{small}'
    (pages / "bad.html").write_text(f"<!doctype html><body>{body}</body>", encoding="utf-8")
    found = screens.findings(pages, ["bad.html"], tmp_path)
    assert sum("table" in text and "too wide" in text for text in found) == 2
    assert any(text.startswith("bad.html at 390: letters of") for text in found)


def test_formulas_of_all_effects_can_be_drawn():
    from latex2mathml.converter import convert

    for name in effect_names():
        formulas = load_effect(name).formulas
        assert formulas, name
        assert all(convert(formula).startswith("<math") for formula in formulas)


def test_every_effect_and_port_has_its_place_in_the_drawing(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "drawings"))
    drive = importlib.import_module("drive")
    assert {port for block in drive.BLOCKS.values() for port in block.ports} == set(PORTS)
    assert sorted(name for names in drive.by_block().values() for name in names) == sorted(
        effect_names()
    )
    places = drive.by_block()
    assert "dead_time" in places["pulses"]
    assert "cogging_torque" in places["shaft"]
    assert "magnet_flux" in places["iron"]
    for text in drive.drawings().values():
        assert all(f'#{name.replace("_", "-")}"' in text for name in effect_names())


def test_equations_are_drawn_by_the_browser(built):
    page = (built / "explanation" / "energy.html").read_text(encoding="utf-8")
    assert page.count("<math") > 20


def test_the_page_of_the_plant_lists_every_port():
    text = (DOCS / "explanation" / "plant.md").read_text(encoding="utf-8")
    listed = re.findall(r"`(\w+)`", "".join(re.findall(r"^\|([^|]*)\|", text, re.M)))
    assert set(listed) == set(PORTS)


def calls_of(text):
    """Return every `sensorless ...` of a page, in sentences (between backticks) and in blocks (at a
    line's begin)."""
    inline = re.findall(r"(?<!`)`{1,2}(?:\.venv/bin/)?sensorless ([^`\n]+)`", text)
    lines = re.findall(r"^(?:# {4,5})?(?:\.venv/bin/)?sensorless (.+)$", text, re.M)
    calls = [shlex.split(call, comments=True) for call in (*inline, *lines)]
    return [words for words in calls if len(words) > 1]  # one word alone speaks of a command


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_call_on_a_page_is_one_the_command_line_takes(page):
    for words in calls_of(page.read_text(encoding="utf-8")):
        try:
            parse(words)
        except (CycloptsError, BadInput) as error:
            raise AssertionError(f"sensorless {' '.join(words)}: {error}") from None


def test_calls_are_found():
    sentence = "Type `sensorless bench` or `sensorless bench --peer`:\n"
    block = "```sh\nsensorless list motors   # names\n```\n#     sensorless view x.rrd\n"
    assert calls_of(sentence + block) == [
        ["bench", "--peer"],
        ["list", "motors"],
        ["view", "x.rrd"],
    ]


@pytest.mark.parametrize(
    ("script", "folder"),
    [("conventions", DOCS / "_static"), ("travel", ROOT / "sandbox" / "plant")],
)
def test_drawings_are_those_of_their_script(monkeypatch, script, folder):
    monkeypatch.syspath_prepend(str(DOCS / "drawings"))
    for name, text in importlib.import_module(script).drawings().items():
        assert (folder / name).read_text(encoding="utf-8") == text, name


def test_the_drawing_of_a_period_has_every_call_of_travel(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "drawings"))
    drawn = importlib.import_module("travel")
    groups = (drawn.START, drawn.INSIDE, drawn.PLAIN, drawn.FULL, drawn.END, drawn.CLOSE)
    named = [name for g in groups for s in g.steps for name in s.calls.split(", ")]
    (travel,) = ast.parse(inspect.getsource(period.travel.py_func)).body
    calls = [n.func for n in ast.walk(travel) if isinstance(n, ast.Call)]
    called = {getattr(f, "attr", getattr(f, "id", "")) for f in calls}
    nothing_of_it = {"borrowed", "ceil", "len", "max", "min", "range"}
    assert set(named) == called - nothing_of_it


def test_the_tutorial_quotes_the_kept_diagnosis():
    """Its headings in quotes are those of the kept page, its sentence on where the gap lies is one
    of the diagnosis."""
    text = (DOCS / "tutorials" / "plot_5_diagnosis.py").read_text(encoding="utf-8")
    marked = (DOCS / "stored" / "report.html").read_text(encoding="utf-8")
    page = html.unescape(re.sub(r"<[^>]*>", "", marked)).replace("\xa0", " ")
    kept = json.loads((DOCS / "stored" / "diagnosis.json").read_text(encoding="utf-8"))
    headings = re.findall(r'^# "([A-Z][^"]*)"$', text, re.MULTILINE)
    assert len(headings) >= 6
    assert [h for h in headings if h not in page] == []
    quoted = re.findall(r'"(\d+ % of the gap[^"]*)"', text)
    assert quoted
    found = [finding["text"] for finding in kept["where"]]
    assert [q for q in quoted if not any(q in f for f in found)] == []
    assert [f for f in found if f not in page] == []
