"""The comparison figure shows each mean, bar, theory line and lost lock, and is written whole."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from model.errors import BadInput
from sandbox.evaluation.pages import compare_figure
from sandbox.evaluation.score import ErrorDeg
from sandbox.output.files import write_whole
from tests.sandbox.evaluation.pages.made_runs import NO_ERROR, comparison_of, row_of, run_of

LOADS = (0.0, 0.5, 1.0, 1.8)


def _row(belief, closed, load, speed, lost):
    mean = -6.0 * load if belief == "linear" else 0.1
    error = ErrorDeg(mean, abs(mean), abs(mean) + 1.0, abs(mean) + 2.0)
    predicted = mean if belief == "linear" else None
    more = {"speed_rpm": speed, "predicted_mean_deg": predicted, "lost_lock": lost}
    return row_of(belief, closed, load, error, **more)


def _run(estimator, belief, closed, loads=LOADS, speeds=(60.0,) * 4, lost=()):
    rows = [
        _row(belief, closed, load, speed, k in lost)
        for k, (load, speed) in enumerate(zip(loads, speeds, strict=True))
    ]
    return run_of(belief, closed, rows, estimator)


def _comparison(**changes):
    return comparison_of(
        _run(estimator, belief, closed, **changes)
        for estimator in ("qnull", "ekf")
        for closed in (True, False)
        for belief in ("saturated", "linear")
    )


def _panel(runs):
    axes = Figure().subplots()
    compare_figure.draw_panel(axes, runs, compare_figure.by_load(runs))
    return axes


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".svg", b"<?xml")])
def test_figure_is_written_whole(tmp_path, suffix, magic):
    path = tmp_path / f"comparison{suffix}"
    compare_figure.comparison_figure(_comparison(), path)
    assert path.read_bytes().startswith(magic)
    assert list(tmp_path.iterdir()) == [path]


def test_means_bars_and_theory_are_the_rows(tmp_path):
    run = _run("qnull", "linear", closed=True)
    axes = _panel([run])
    means = [float(bar.lines[0].get_ydata()[0]) for bar in axes.containers]
    assert means == [row.error_deg.mean for row in run.rows]
    ends = [bar.lines[2][0].get_segments()[0][:, 1] for bar in axes.containers]
    outer = [max(abs(np.array(end))) for end in ends]
    np.testing.assert_allclose(outer, [row.error_deg.p95 for row in run.rows])
    dashed = next(line for line in axes.lines if line.get_linestyle() == "--")
    np.testing.assert_array_equal(dashed.get_xdata(), 100.0 * np.array(LOADS))
    np.testing.assert_array_equal(dashed.get_ydata(), [row.predicted_mean_deg for row in run.rows])


def test_lost_lock_is_a_cross_on_the_edge_without_a_mean():
    axes = _panel([_run("qnull", "linear", closed=True, lost=(3,))])
    assert len(axes.containers) == 3
    crosses = [line for line in axes.lines if line.get_marker() == "x"]
    assert [float(y) for line in crosses for y in line.get_ydata()] == [0.0]
    assert "lost lock" in [text.get_text() for text in axes.texts]


def test_segments_are_named_where_load_does_not_vary():
    runs = [_run("qnull", "linear", closed=True, loads=(1.0,) * 4, speeds=(30.0, 5.0, -5.0, -30.0))]
    axes = _panel(runs)
    assert [label.get_text() for label in axes.get_xticklabels()] == [
        "100\n30",
        "100\n5",
        "100\n-5",
        "100\n-30",
    ]


def test_all_lost_and_missing_errors_can_be_drawn(tmp_path):
    whole = _comparison(lost=(0, 1, 2, 3))
    runs = [
        replace(run, rows=tuple(replace(row, error_deg=NO_ERROR) for row in run.rows))
        for run in whole.runs[:-2]
    ]
    compare_figure.comparison_figure(replace(whole, runs=tuple(runs)), tmp_path / "lost.png")
    assert (tmp_path / "lost.png").stat().st_size > 10_000


def test_unknown_suffix_and_no_runs_are_errors(tmp_path):
    with pytest.raises(
        BadInput,
        match=r"cannot draw to 'figure.doc': use a name that ends in \.png, \.svg or \.pdf",
    ):
        compare_figure.comparison_figure(_comparison(), tmp_path / "figure.doc")
    with pytest.raises(
        BadInput, match=r"cannot write '.*none.figure.png': there is no folder '.*none'; make it"
    ):
        compare_figure.comparison_figure(_comparison(), tmp_path / "none" / "figure.png")
    with pytest.raises(BadInput, match="there is no folder"):
        write_whole(tmp_path / "none" / "page.html", b"")
    assert not list(tmp_path.iterdir())
    empty = comparison_of(())
    with pytest.raises(ValueError, match="at least one run"):
        compare_figure.comparison_figure(empty, tmp_path / "figure.png")
    assert not list(tmp_path.iterdir())


def test_a_narrow_figure_says_its_reading_whole():
    """One column of panels is narrower than the sentence below it."""
    comparison = comparison_of(run for run in _comparison().runs if run.estimator == "qnull")
    figure = compare_figure.comparison_figure(comparison)
    figure.draw_without_rendering()
    said = figure.get_supxlabel()
    assert " ".join(said.split()) == " ".join(compare_figure.READING.split())
    (text,) = (t for t in figure.findobj(Text) if t.get_text() == said)
    extent = text.get_window_extent()
    assert extent.x0 >= 0.0
    assert extent.x1 <= figure.bbox.x1
