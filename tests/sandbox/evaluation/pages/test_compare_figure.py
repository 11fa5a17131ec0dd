"""The comparison figure shows each mean, bar, theory line and lost lock, and is written whole."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from model.errors import BadInput
from sandbox.evaluation.pages import compare_figure
from sandbox.output.files import write_whole

LOADS = (0.0, 0.5, 1.0, 1.8)


def _row(belief, closed, load, speed, lost):
    mean = -6.0 * load if belief == "linear" else 0.1
    error = SimpleNamespace(mean=mean, rms=abs(mean), p95=abs(mean) + 1.0, max=abs(mean) + 2.0)
    return SimpleNamespace(
        estimator="qnull",
        belief=belief,
        closed_loop=closed,
        load=load,
        speed_rpm=speed,
        error_deg=error,
        predicted_mean_deg=mean if belief == "linear" else None,
        lost_lock=lost,
    )


def _run(estimator, belief, closed, loads=LOADS, speeds=(60.0,) * 4, lost=()):
    rows = tuple(
        _row(belief, closed, load, speed, k in lost)
        for k, (load, speed) in enumerate(zip(loads, speeds, strict=True))
    )
    return SimpleNamespace(estimator=estimator, belief=belief, closed_loop=closed, rows=rows)


def _comparison(**changes):
    runs = tuple(
        _run(estimator, belief, closed, **changes)
        for estimator in ("qnull", "ekf")
        for closed in (True, False)
        for belief in ("saturated", "linear")
    )
    named = SimpleNamespace(name="ipm_exchanged"), SimpleNamespace(name="staircase")
    return SimpleNamespace(drive=named[0], scenario=named[1], runs=runs)


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
    comparison = _comparison(lost=(0, 1, 2, 3))
    none = SimpleNamespace(mean=None, rms=None, p95=None, max=None)
    for run in comparison.runs:
        for row in run.rows:
            row.error_deg = none
    comparison.runs = comparison.runs[:-2]
    compare_figure.comparison_figure(comparison, tmp_path / "lost.png")
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
    empty = _comparison()
    empty.runs = ()
    with pytest.raises(ValueError, match="at least one run"):
        compare_figure.comparison_figure(empty, tmp_path / "figure.png")
    assert not list(tmp_path.iterdir())


def test_a_narrow_figure_says_its_reading_whole():
    """One column of panels is narrower than the sentence below it."""
    comparison = _comparison()
    comparison.runs = [run for run in comparison.runs if run.estimator == "qnull"]
    figure = compare_figure.comparison_figure(comparison)
    figure.draw_without_rendering()
    said = figure.get_supxlabel()
    assert " ".join(said.split()) == " ".join(compare_figure.READING.split())
    (text,) = (t for t in figure.findobj(Text) if t.get_text() == said)
    extent = text.get_window_extent()
    assert extent.x0 >= 0.0
    assert extent.x1 <= figure.bbox.x1
