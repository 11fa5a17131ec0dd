"""Which estimator for this motor, in sentences; the pages of comparison, single run and
protocol."""

from __future__ import annotations

import dataclasses
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from sandbox.evaluation import choice
from sandbox.evaluation.compare import Comparison
from sandbox.evaluation.pages import compare_page, protocol_page
from sandbox.evaluation.pages.compare_sheets import sheets
from sandbox.evaluation.pages.compare_trace import write_trace
from sandbox.evaluation.pages.protocol_cells import cell, reading
from sandbox.evaluation.protocol import Protocol, Unit
from sandbox.evaluation.protocol import Row as Finished
from sandbox.evaluation.protocol_tests import Outcome
from sandbox.evaluation.score import ErrorDeg, Row
from sandbox.evaluation.sweep.tolerances import ToleranceRow, with_gains
from sandbox.public.protocols import ProtocolResult
from sandbox.public.runs import ComparisonResult
from sandbox.public.sweeps import ToleranceResult

VOID = {"meta", "br", "wbr", "link", "img"}


def row(estimator, belief, mean, p95, *, load=1.0, held=True, closed=True):
    lost = mean is None
    error = ErrorDeg(mean, None if lost else abs(mean), p95, p95)
    return Row(estimator, belief, closed, load, 0.0, error, p95, None, lost, held, 0.0, 1.0)


class Page(HTMLParser):
    """A page's text and drawings; every element must be closed in turn."""

    def __init__(self, path):
        super().__init__()
        self.open, self.drawings, self.words, self.links = [], 0, [], []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)
        self.drawings += tag == "svg"
        self.links += [
            v for k, v in attributes if k in ("src", "href", "xlink:href") and not v.startswith("#")
        ]

    def handle_startendtag(self, tag, attributes):
        self.links += [
            v for k, v in attributes if k in ("src", "href", "xlink:href") and not v.startswith("#")
        ]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "script"} & set(self.open):
            self.words.append(data)

    @property
    def text(self):
        return re.sub(r"\s+", " ", "".join(self.words))


def check_self_contained(page):
    """Nothing is fetched; black and white are the page's own, light or dark."""
    assert page.links == []
    assert "url(http" not in page.source
    assert "#000000" not in page.source
    assert "prefers-color-scheme: dark" in page.source


def test_the_best_are_those_near_it_that_keep_lock():
    rows = [
        row("a", "saturated", 0.1, 0.5),
        row("a", "linear", -9.0, 9.5),
        row("b", "saturated", 0.2, 0.6),
        row("c", "saturated", 0.0, 0.9),
        row("d", "saturated", 0.0, 0.3, held=False),
        row("e", "saturated", None, None),
        row("e", "saturated", 0.0, 0.2),
        row("f", "saturated", 0.0, 0.1, closed=False),
    ]
    found = choice.standings(rows)
    # c is 0.4 worse than a, more than NEAR_DEG
    assert [s.estimator for s in choice.best(found)] == ["a", "b"]
    text = choice.which(found)
    assert text.startswith("a or b with the saturated belief: in every segment within 0.6°")
    assert "d with the saturated belief missed the speed in 1 of 1 segments" in text
    assert "e with the saturated belief lost lock in 1 of 2 segments" in text
    assert "a 9.00° at 100 % load → 0.10°" in choice.gained(found)
    assert choice.which(choice.standings([row("e", "linear", None, None)])).startswith(
        "None of these"
    )
    alone = choice.which(choice.standings([row("a", "saturated", 0.1, 0.5)]))
    assert "too near" not in alone
    nothing = choice.standings([row("a", b, 0.1, 0.5) for b in ("linear", "saturated")])
    assert choice.gained(nothing).startswith("Nothing to speak of")
    worse = choice.standings([row("a", "linear", 0.1, 0.5), row("a", "saturated", 3.0, 3.5)])
    assert choice.gained(worse).startswith("The worst mean error grows.")
    better = choice.standings([row("b", "linear", 5.0, 6.0), row("b", "saturated", 1.0, 2.0)])
    assert choice.gained((*worse, *better)).startswith(
        "The worst mean error falls for some and grows for others."
    )
    many = [row(name, "linear", 5.0 + k, 5.3 + k) for k, name in enumerate("abcdef")]
    many += [row(name, "saturated", 0.1, 0.4) for name in "abcdef"]
    assert choice.gained(choice.standings(many)) == (
        "The worst mean error falls. Linear → saturated belief: 5.00° (a) to 10.00° (f) "
        "→ 0.10° (a) to 0.10° (f)."
    )
    assert choice.which(choice.standings(many)).startswith(
        "a, b, c or 3 others with the saturated belief:"
    )


def test_a_comparison_on_one_page(small_comparison, tmp_path):
    path = tmp_path / "compare.html"
    compare_page.write_comparison(path, small_comparison)
    page = Page(path)
    check_self_contained(page)
    first = page.text.index("Which estimator for this motor?")
    assert first < page.text.index("What does believing") < page.text.index("All estimators")
    assert "with the saturated belief: in every segment within" in page.text
    # costs; two estimators over load; of the best: time, currents, flux, spectra; the rotor is
    # locked, so no angle
    assert page.drawings == 7
    assert "What the injection costs" in page.text
    assert "against the rotor's angle" not in page.text
    assert path.stat().st_size < 1_000_000


def test_tolerances_stand_on_the_page_and_are_not_advised_then(small_comparison, tmp_path):
    """Made-up rows: linear 5°, saturated 0.5° if all is known, 1.4° within ±10 %: (5 - 1.4) /
    (5 - 0.5) = 80 % left."""
    rows = [
        ToleranceRow("qnull", belief, x, 8, 0, error, error)
        for belief, errors in (("linear", (5.0, 5.0)), ("saturated", (0.5, 1.4)))
        for x, error in zip((0.0, 0.1), errors, strict=True)
    ]
    alone = ComparisonResult(small_comparison)
    page = Page(alone.to_html(tmp_path / "alone.html"))
    assert "compare --tolerances" in page.text
    found = ToleranceResult("ipm", "two_steps", with_gains(rows))
    both = Page(dataclasses.replace(alone, tolerances=found).to_html(tmp_path / "both.html"))
    check_self_contained(both)
    assert "compare --tolerances" not in both.text
    assert compare_page.KNOWN in both.text
    assert re.search(r"<td class='n'[^>]*>80</td>", both.source)
    assert both.drawings == page.drawings + 1


def test_the_figure_of_costs_shows_each_estimator_that_closes_the_loop(small_comparison, tmp_path):
    """Three panels, error, loss and sound, with a mark each for both beliefs of both estimators."""
    path = tmp_path / "cost.svg"
    figure = ComparisonResult(small_comparison).plot_cost(path)
    error, loss, _ = figure.axes
    assert sorted(t.get_text() for t in error.get_yticklabels()) == ["ekf", "qnull"]
    assert [sum(len(line.get_xdata()) for line in a.lines) for a in (error, loss)] == [4, 4]
    assert "what the injection costs" in path.read_text(encoding="utf-8")


def test_runs_without_lock_and_strange_names_have_a_page(small_comparison, tmp_path):
    """All lost: no mean to draw, no best; a motor called like a tag is no tag."""
    lost = ErrorDeg(None, None, None, None)
    none = {"error_deg": lost, "lost_lock": True, "transient_max_deg": None}
    runs = tuple(
        dataclasses.replace(run, rows=tuple(dataclasses.replace(r, **none) for r in run.rows))
        for run in small_comparison.runs
    )
    motor = dataclasses.replace(small_comparison.drive.motor, name="<svg onload=x>")
    drive = dataclasses.replace(small_comparison.drive, motor=motor)
    c = Comparison(
        drive,
        small_comparison.scenario,
        runs,
        small_comparison.properties | {"dead_time.time": 1e-6},
    )
    compare_page.write_comparison(tmp_path / "lost.html", c)
    page = Page(tmp_path / "lost.html")
    assert "None of these: no estimator kept lock" in page.text
    assert "is in it but what was added, dead_time.time = 1e-06 s." in page.text
    assert "<svg onload" not in page.source
    compare_page.write_run(
        tmp_path / "run.html", Comparison(drive, c.scenario, c.runs[:1], c.properties)
    )
    assert "It lost lock in 2 of 2 segments" in Page(tmp_path / "run.html").text


def test_a_run_s_page_says_that_the_speed_was_missed_and_what_the_motor_cannot_mean(
    small_comparison, tmp_path
):
    run = small_comparison.runs[0]
    missed = dataclasses.replace(
        run, rows=tuple(dataclasses.replace(r, reference_held=False) for r in run.rows)
    )
    motor = dataclasses.replace(small_comparison.drive.motor, magnet_flux=98.1)
    drive = dataclasses.replace(small_comparison.drive, motor=motor)
    c = Comparison(drive, small_comparison.scenario, (missed,), small_comparison.properties)
    compare_page.write_run(tmp_path / "run.html", c)
    text = Page(tmp_path / "run.html").text
    assert (
        "kept lock, but the rotor's own speed was not the one asked for in 2 of 2 stretches" in text
    )
    assert "Caution: rated_current gives 1059 N m" in text


def test_a_single_run_draws_both_speeds_on_one_panel(small_comparison):
    run = small_comparison.runs[0]
    ((head, lines),) = compare_page.speeds({"saturated": run})
    assert head.startswith("speed")
    assert list(lines) == ["true", "estimated"]
    assert [
        head.split("\n")[0] for head, _ in compare_page.speeds({"linear": run, "saturated": run})
    ] == [
        "true speed",
        "estimated",
    ]


def unit(estimator, test, passed, belief="saturated", **metrics):
    return Finished(Unit("m", test, estimator, belief), Outcome((), metrics, passed), 0.1)


ROWS = (
    unit("start", "start", True, polarity_right=1.0),
    unit("a", "creep", True, mean_deg=0.2, p95_deg=0.4),
    unit("a", "creep", True, "linear", mean_deg=9.0, p95_deg=9.5),
    unit("a", "cost", None, step_ns=300.0),
    unit("b", "creep", True, mean_deg=0.3, p95_deg=0.6),
    unit("b", "cost", None, step_ns=100.0),
    unit("c", "creep", False, mean_deg=2.0, p95_deg=4.0),
    unit("c", "cost", None, step_ns=10.0),
)


def test_the_protocol_recommends_by_goals_then_cost():
    assert protocol_page.which(ROWS, "m") == (
        "b or a with the saturated belief: each meets the one goal there is. "
        "Only 3 of the protocol's 12 tests were run. b costs least, 100 ns a step on this machine."
    )
    more = [
        unit(n, "creep", True, b, mean_deg=x)
        for n in "efghi"
        for b, x in (("linear", 7.0), ("saturated", 0.1))
    ]
    assert protocol_page.gained([*ROWS, *more], "m").endswith(
        "belief: 7° (e) to 9° (a) → 0.1° (e) to 0.2° (a)."
    )
    late = unit("b", "load_step", True, mean_deg=0.1, p95_deg=0.2, speed_missed=3)
    assert protocol_page.which([*ROWS, late], "m").endswith(
        "all 2 goals. Only 4 of the protocol's 12 tests were run. "
        "But with b the speed asked for was not reached in time in load_step (○)."
    )
    assert (
        protocol_page.gained(ROWS, "m")
        == "Worst mean error, linear → saturated belief: a 9° → 0.2°."
    )


def test_a_missed_speed_has_no_tick_and_comes_after_one_that_was_reached():
    """The error is within its goal in both; slower to pay is still the better one that gets
    there."""
    rows = [
        unit("dear", "creep", True, mean_deg=0.55, p95_deg=1.3, speed_missed=0),
        unit("dear", "cost", None, step_ns=9.0),
        unit("slow", "creep", True, mean_deg=0.55, p95_deg=1.3, speed_missed=1),
        unit("slow", "cost", None, step_ns=1.0),
    ]
    assert [cell(row) for row in rows[::2]] == [
        "0.55 (1.3) ✓ ≤ 1 (3)°",
        "0.55 (1.3), 1 slow ○ ≤ 1 (3)°",
    ]
    assert protocol_page.which(rows, "m").startswith(
        "dear with the saturated belief: meets the one goal there is."
    )
    assert "slow: the speed asked for not reached in time" in reading(Protocol(tuple(rows), 0))
    assert reading(Protocol(tuple(rows), 0)).endswith(
        "○: what stands beside it holds, but the speed asked for was not reached in time."
    )
    assert ProtocolResult(Protocol(tuple(rows), 0)).summary() == (
        "2 tests, 4 results, 2 of 2 judged met their goals, 1 of these without reaching "
        "the speed asked for in time"
    )


def test_what_holds_without_being_good_is_told_beside_the_recommendation():
    lax = [
        unit(n, "robustness", True, mean_deg=x, p95_deg=20.0)
        for n, x in (("a", 3.14), ("b", 12.9), ("c", 50.0))
    ]
    turned = [unit(n, "attraction", True, back=0.49, reversed=0.51, elsewhere=0.0) for n in "ab"]
    assert protocol_page.which([*ROWS, *lax, *turned], "m").endswith(
        "machine. `robustness` asks for no more than 'lock kept'; the worst mean error there is "
        "3.14 to 12.9°. `attraction` asks for no more than 'no third rest'; the share that ends "
        "at the wrong pole is 51 %."
    )


@pytest.mark.parametrize(
    ("metrics", "said"),
    [
        ({"mean_deg": 2.0, "p95_deg": 4.0}, "(mean 2°, 95 % within 4°)"),
        (
            {"lost": 1, "judged": 7, "mean_deg": 2.0, "p95_deg": 4.0},
            "(lock lost in 1 of 7 segments)",
        ),
        ({"R +50 %: mean_deg": None, "nominal: mean_deg": 0.1}, "(lock lost with R +50 %)"),
        ({"elsewhere": 0.25}, "(25 % of wrong starts end at a third place)"),
    ],
)
def test_where_none_meets_every_goal_it_says_why(metrics, said):
    rows = [unit("c", "creep", False, **metrics)]
    assert protocol_page.which(rows, "m") == (
        f"None meets every goal. Nearest: c with the saturated belief, 0 of 1. "
        f"Only 1 of the protocol's 12 tests was run. c misses creep {said}."
    )


def test_a_protocol_on_one_page(tmp_path):
    broken = unit(
        "b",
        "robustness",
        False,
        lost=2,
        judged=65,
        **{"R +50 %: mean_deg": None, "nominal: mean_deg": 0.1},
    )
    protocol_page.write_protocol(tmp_path / "protocol.html", Protocol((*ROWS, broken), 0))
    page = Page(tmp_path / "protocol.html")
    check_self_contained(page)
    assert page.text.index("Which estimator for m?") < page.text.index("What is not in it?")
    assert page.drawings == 2  # worst mean error, cost
    assert "R +50 %: b lost lock." in page.text.replace("\xa0", " ")
    marked = re.findall(r"<td class='(\w+)'", page.source)
    assert (marked.count("good"), marked.count("bad")) == (
        4,
        3,
    )  # as in ROWS, 9° of theory not, and both cases of `robustness`


def test_the_page_names_only_the_tests_that_ran(tmp_path):
    """Two of twelve: no other stands in the caption, the legend or among the goals that are met."""
    rows = [
        unit("a", test, None if b == "linear" else True, b, mean_deg=0.2, p95_deg=0.4)
        for test in ("load_step", "static_map")
        for b in ("linear", "saturated")
    ]
    protocol_page.write_protocol(tmp_path / "protocol.html", Protocol(tuple(rows), 0))
    text = Page(tmp_path / "protocol.html").text.replace("\xa0", " ")
    assert (
        "a with the saturated belief: meets all 2 goals. Only 2 of the protocol's 12 "
        "tests were run."
    ) in text
    assert "Worst mean position error over static_map, load_step; dashed: the goal" in text
    assert "Tests that were not run: start, creep, hand_over," in text
    assert reading(Protocol(tuple(rows), 0)) == (
        "Worst mean (worst 95th percentile) of the position error, electrical degrees, up to 180 "
        "% load where the ripple carries information; ✓: the goal beside it is met."
    )
    more = (
        *rows,
        unit("a", "attraction", True, back=0.5, reversed=0.5, elsewhere=0.0),
        unit("a", "cost", None, step_ns=1.0),
    )
    said = reading(Protocol(more, 0))
    assert "attraction: started wrong" in said
    assert "cost: a step" in said
    assert said.endswith("○: what stands beside it holds, but starts end at the wrong pole.")


def test_a_trace_has_planes_and_spectra(small_comparison, tmp_path):
    from rerun.chunk import RrdReader

    found = sheets(small_comparison)
    assert list(found) == ["qnull", "ekf"]
    # locked: no angle
    assert list(found["ekf"]) == ["currents", "fluxes", "spectrum_current", "spectrum_error"]
    lines, _, labels = found["qnull"]["currents"].strips["map"]
    assert len(lines) == len(labels) > 3
    bars = found["qnull"]["spectrum_current"]
    highest = bars.x[np.argmax(bars.lines["saturated"])]  # its left edge
    assert highest <= small_comparison.drive.injection.frequency <= highest + bars.width
    write_trace(tmp_path / "x.rrd", small_comparison, found)
    entities = {str(chunk.entity_path) for chunk in RrdReader(tmp_path / "x.rrd").stream()}
    assert {
        f"/{e}/{own}"
        for e in found
        for own in ("currents/linear", "fluxes/magnet", "spectrum_error/linear")
    } <= entities


def test_an_open_loop_run_alone_has_its_tab(small_comparison):
    run = next(run for run in small_comparison.runs if not run.closed_loop)
    assert list(sheets(dataclasses.replace(small_comparison, runs=(run,)))) == [run.estimator]
