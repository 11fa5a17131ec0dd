"""The page, the terminal's text and the trace of one real diagnosis: every number that they show is
one of the diagnosis."""

import re

import numpy as np
import pytest

from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location.decompose import ORDERS, decompose
from sandbox.gap.pages.page import FEWEST, print_answers, write_report
from sandbox.gap.pages.traces import write_traces
from tests.traces import read_bars, read_trace


@pytest.fixture(scope="module")
def page(small_answers, tmp_path_factory):
    """The report as its sections: heading -> what stands below it."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, small_answers)
    text = path.read_text(encoding="utf-8")
    heads = re.split(r"<h2>(.*?)</h2>", text)
    return dict(zip(heads[1::2], heads[2::2], strict=True))


@pytest.fixture(scope="module")
def trace(small_answers, tmp_path_factory):
    path = tmp_path_factory.mktemp("trace") / "diagnosis.rrd"
    write_traces(path, small_answers)
    found = read_trace(path) | read_bars(path)
    return {entity.replace("\\", ""): own for entity, own in found.items()}


def folded(text):
    """What a page folds: the line that opens it -> what is then seen."""
    return dict(re.findall(r"<summary>(.*?)</summary>(.*?)</details>", text, re.S))


def test_likely_hypotheses_stand_in_the_open_and_all_others_folded(page, small_answers):
    chances = [h.probability for h in small_answers.diagnosis.hypotheses]
    likely = [p for p in chances if p >= FEWEST]
    assert 0 < len(likely) < len(chances)
    shares = r"<td class='n'>([\d.]+)&nbsp;%</td><td class='n'>"
    assert [float(x) for x in re.findall(shares, page["Hypotheses"])] == [
        pytest.approx(100.0 * p, abs=0.05) for p in likely
    ]
    rest = folded("".join(page.values()))["Hypotheses that were tried and dropped"]
    assert len(re.findall(shares, rest)) == len(chances) - len(likely)


def test_the_page_says_what_it_compared_with_and_how_it_was_made(page, small_answers):
    d, kept = small_answers.diagnosis, folded("".join(page.values()))
    motor = d.campaign.drive.motor
    row = rf">rated_current</td><td[^>]*>{motor.rated_current:.7g}</td><td[^>]*>A peak</td>"
    assert re.search(row, kept["The nominal model"])
    made = kept["How it was made"]
    assert f"{d.size.nominal_nrmse:.3g} noise floors" in made
    assert f">{d.simulations}<" in made
    assert "dead" in kept["The effect dead time"]  # the card of what is named
    assert "\\n" not in kept["The effect dead time"]  # its lines are lines


def test_each_recording_has_its_row_and_share_of_the_gap(page, small_answers):
    d = small_answers.diagnosis
    rows = re.findall(
        r"<tr>(.*?)</tr>", folded(page["The gap, recording by recording"])["All figures"]
    )
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows][1:]
    assert [c[0].removesuffix(" (held out)") for c in cells] == [r.file for r in d.size.recordings]
    assert [(float(c[1]), float(c[2])) for c in cells] == [
        (pytest.approx(r.before, abs=0.005), pytest.approx(r.after, abs=0.005))
        for r in d.size.recordings
    ]
    assert sum(float(c[3].split("&")[0].split()[0]) for c in cells) == pytest.approx(100.0, abs=2.0)
    held = {r.file for r in d.size.recordings if r.held_out}
    assert {c[0].removesuffix(" (held out)") for c in cells if "held out" in c[0]} == held


def test_currents_are_drawn_where_the_gap_is_largest(page, small_answers):
    """The recording that holds most of the squares, its residual over time with its noise floor,
    40 ms of its currents, the spectrum: three figures."""
    own = shown(small_answers.diagnosis.before.point)
    squares = {x.file: float(np.sum(x.current**2)) for x in own}
    (head,) = (h for h in page if h.startswith("Residuals in "))
    assert head == f"Residuals in {max(squares, key=squares.get)}"
    assert page[head].count("<svg") == 3
    assert "sample by sample, 40 ms" in page[head]
    assert "measured" in page[head]


def test_the_terminal_has_the_same_in_short(small_answers, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    print_answers(small_answers)
    said, d = capsys.readouterr().out, small_answers.diagnosis
    for k, h in enumerate(d.hypotheses[:6]):
        assert f"{h.probability:.3f}" in said, k
    for r in d.size.recordings:
        (line,) = (x for x in said.splitlines() if r.file in x and f"{r.before:.2f}" in x)
        assert f"{r.after:.2f}" in line
        assert ("(held out)" in line) == r.held_out
    assert f"{d.simulations} simulations in " in said


def test_the_overview_of_a_trace_has_the_numbers_of_the_page(trace, small_answers):
    """Residuals by recording, and what is in each electrical order before and after, in shares of
    the gap before."""
    d = small_answers.diagnosis
    for name in ("before", "after"):
        rows = [getattr(r, name) for r in d.size.recordings]
        assert trace[f"Overview/recordings/{name}"] == pytest.approx(rows)
    parts = [decompose(p.point, shown(p.point)) for p in (d.before, d.after)]
    scale = parts[1].excess / parts[0].excess
    for name, part, share in zip(("before", "after"), parts, (1.0, scale), strict=True):
        expected = [100.0 * share * part.electrical.get(n, 0.0) for n in ORDERS]
        assert trace[f"Overview/electrical/{name}"] == pytest.approx(expected, abs=1e-9)


def test_a_trace_has_a_tab_of_each_recording_with_what_is_left(trace, small_answers):
    """Recorded less simulated is the residual, before and after, which is smaller; decibels of its
    spectrum are those of the residual over a thousandth of the noise floor."""
    d = small_answers.diagnosis
    for k, r in enumerate(d.start.prepared.recordings):
        tab = r.file.removesuffix(".parquet") + (", held out" if k in d.held_out else "")
        for axis in "dq":
            recorded, *simulated = trace[f"{tab}/current_{axis}"][1].T
            left = trace[f"{tab}/residual_{axis}"][1].T
            assert left == pytest.approx(recorded - np.array(simulated), abs=1e-9)
        assert len(recorded) == r.samples
        assert np.std(left[1]) < np.std(left[0])
