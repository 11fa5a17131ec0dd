"""Runs of the page: what they take, and what a run becomes."""

from __future__ import annotations

import inspect
import json
import sys
from importlib import import_module

import numpy as np
import pyarrow.parquet as pq
import pytest

import sandbox
from sandbox.public import figures
from sandbox.public.result import Result
from tests.sandbox.public.naming import ROOT, SHORT, of


@of("simulate", "load_motor", "load_scenario", "load_estimator", "BadInput", "PhysicsError")
def test_simulate_takes_names_files_and_objects(run, tmp_path):
    """The same run by name, by path, and by object, to the bit."""
    from model.drive_files import MOTORS

    scenario = tmp_path / "short.toml"
    scenario.write_text(
        "[[segment]]\nduration = 0.2\n[[segment]]\nduration = 0.2\nload = 1.0\nramp = "
        "0.05\nsettle = 0.1\n"
    )
    drive, own = sandbox.load_motor("ipm_exchanged"), sandbox.load_estimator("inversion")
    for motor, scene, estimator in (
        (MOTORS / "ipm_exchanged.toml", scenario, "inversion"),
        (drive, SHORT, own),
    ):
        again = sandbox.simulate(motor, scene, estimator, belief="linear", seed=2)
        assert np.array_equal(again.recording.table, run.recording.table)
    with pytest.raises(
        sandbox.BadInput, match="motor = 3 is neither a name nor a file nor a Drive"
    ):
        sandbox.simulate(3)
    with pytest.raises(sandbox.BadInput, match="did you mean 'qnull'"):
        sandbox.simulate(drive, SHORT, "qnul")
    with pytest.raises(sandbox.PhysicsError, match="convex"):
        sandbox.simulate("spm")


@of("Scenario", "Segment")
def test_a_run_as_table_frame_figure_trace_and_folder(run, tmp_path):
    for seen in (run, run.comparison, run.recording):
        assert len(repr(seen)) < 200
        assert "\n" not in repr(seen)
    table = run.to_table()
    assert table.num_rows == run.recording.t.size == len(run.recording)
    assert table.schema.field("i_d").metadata == {b"unit": b"A"}
    assert table.schema.field("error").metadata == {b"unit": b"rad"}
    frame = run.to_dataframe()
    assert frame.attrs["units"]["omega"] == "rad/s"
    np.testing.assert_array_equal(frame["i_q"], run.recording.i_q)
    np.testing.assert_array_equal(run.recording.to_pandas()["i_q"], run.recording["i_q"])
    assert {"i_d", "theta_hat", "between"} <= set(dir(run.recording))
    assert len(run.plot().axes) == 4
    run.save(tmp_path / "out", csv=True)
    names = [f"simulate.{kind}" for kind in ("csv", "html", "json", "parquet", "png", "rrd")]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == names
    kept = pq.read_table(tmp_path / "out" / "simulate.parquet")
    assert kept.schema.field("i_d").metadata[b"unit"] == b"A"
    assert (tmp_path / "out" / "simulate.csv").read_text().startswith('"t (s)","i_a (A)"')
    content = json.loads((tmp_path / "out" / "simulate.json").read_text())
    assert tuple(content[key] for key in ("page", "figure", "table", "trace")) == tuple(
        f"simulate.{kind}" for kind in ("html", "png", "parquet", "rrd")
    )
    assert run.to_rerun(str(tmp_path / "alone.rrd")).is_file()


def test_figures_draw_in_axes_of_ones_own(run, tmp_path):
    """As many as there are panels, in any figure or part of one; what else is in it stays."""
    import matplotlib.pyplot as plt
    from matplotlib.figure import Figure

    mine = Figure()
    left, right = mine.subfigures(1, 2)
    axes, other = left.subplots(4, 1), right.subplots()
    assert run.plot(ax=axes) is mine
    drawn = run.plot().axes
    assert [a.get_ylabel() for a in axes] == [a.get_ylabel() for a in drawn]
    assert [len(a.lines) for a in axes] == [len(a.lines) for a in drawn]
    assert not other.lines
    assert mine.get_suptitle() == ""
    audit, (fig, pair) = sandbox.audit("ipm"), plt.subplots(1, 2)
    canvas = fig.canvas
    assert audit.plot(tmp_path / "mine.png", ax=list(pair)) is fig
    assert (tmp_path / "mine.png").read_bytes().startswith(b"\x89PNG")
    assert fig.canvas is canvas  # a window or a notebook goes on showing it
    plt.close(fig)
    assert pair[1].get_title() == "cross-saturation angle"
    one = Figure().subplots()
    title = "four recordings"
    assert figures.replay_figure(title, {"a": 1.2}, ax=one) is one.figure
    assert one.get_title() == title
    for wrong in (one, [one] * 3, "axes", [1, 2]):
        with pytest.raises(sandbox.BadInput, match=r"has 2 panels.*plt.subplots\(1, 2\)"):
            audit.plot(ax=wrong)


def test_every_figure_can_be_shown_by_a_notebook_and_takes_axes(run):
    """A notebook asks for `_repr_png_` where pyplot, which alone tells it of figures, was not
    loaded."""
    assert run.plot()._repr_png_().startswith(b"\x89PNG")

    def every(kind):
        return [kind, *(k for c in kind.__subclasses__() for k in every(c))]

    for name in sandbox.__all__:
        getattr(sandbox, name)  # loads the classes of its results
    for kind in every(Result):
        if "plot" in vars(kind):
            assert "ax" in inspect.signature(kind.plot).parameters, kind
            assert "ax: " in inspect.getdoc(kind.plot), kind


def test_without_pandas_one_sentence(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(sandbox.BadInput, match="pip install pandas"):
        run.to_dataframe()
    assert run.to_table().num_rows > 0


@of("describe")
def test_effects_leave_no_theory():
    """The theory knows the motor alone: with an effect in the plant none is stated."""
    result = sandbox.compare("ipm_exchanged", SHORT, "qnull", effects="dead_time.time=1e-6")
    assert {row.predicted_mean_deg for row in result.rows} == {None}
    assert result.as_json()["effects"] == {"dead_time.time": 1e-6}
    assert sandbox.describe("dead_time").startswith("dead_time")


@of("use_effects")
def test_effects_of_ones_own_are_refused_once_the_plant_is_there(tmp_path):
    """What they do: tests/sandbox/plant/test_sets_own_effects.py, in a process of its own."""
    import_module("sandbox.plant.electrical")
    with pytest.raises(sandbox.BadInput, match="compiled already"):
        sandbox.use_effects(ROOT / "experiments" / "my_effects.py")
    with pytest.raises(sandbox.BadInput, match="give a Python file"):
        sandbox.use_effects(tmp_path / "none.py")
