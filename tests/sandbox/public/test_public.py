"""The page of public Python: lazy, documented, accepted kinds of arguments, results as tables, files and traces."""

from __future__ import annotations

import dataclasses
import doctest
import inspect
import json
import os
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import sandbox
from sandbox.cli import build_parser, commands, main
from sandbox.drive.locked_test import paper_campaign
from sandbox.output.tables import folded, print_table

ROOT = Path(__file__).resolve().parents[3]
SHORT = sandbox.Scenario("short", (sandbox.Segment(0.2), sandbox.Segment(0.2, 1.0, ramp=0.05, settle=0.1)))
FUNCTIONS = [name for name in sandbox.__all__ if inspect.isfunction(getattr(sandbox, name))]
TESTED: set[str] = set()


def of(*names):
    """Mark a test as one of these names of the page."""
    TESTED.update(names)
    return lambda test: test


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_has_a_numpydoc_text(name):
    function = getattr(sandbox, name)
    text = inspect.getdoc(function)
    parameters = inspect.signature(function).parameters
    if parameters:
        assert "Parameters\n----------" in text
        assert "Raises\n------" in text
    if inspect.signature(function).return_annotation != "None":
        assert "Returns\n-------" in text
    assert "Examples\n--------\n>>> " in text
    assert ">>> from sandbox import" in text
    for parameter in parameters:
        assert f"\n{parameter} : " in text, parameter


@pytest.mark.parametrize("name", FUNCTIONS)
def test_examples_run(name):
    function = getattr(sandbox, name)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    for example in doctest.DocTestFinder(recurse=False).find(function, name, module=False):
        runner.run(example)
    assert runner.failures == 0
    assert runner.tries > 0


def test_a_module_of_the_same_name_leaves_the_function():
    """The rooms `sandbox.replay` and `sandbox.sweep` bear names of the page's functions."""
    for name in ("replay", "sweep"):
        import_module(f"sandbox.{name}")
        assert inspect.isfunction(getattr(sandbox, name))


def python(code, folder, **more):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **more}
    script = folder / "script.py"
    script.write_text(code)
    return subprocess.run([sys.executable, str(script)], cwd=folder, env=environment, capture_output=True, text=True)


def test_importing_the_page_is_light(tmp_path):
    heavy = ("numba", "rerun", "matplotlib", "control", "scipy", "rich", "numpy", "pyarrow", "model")
    code = f"import sys, sandbox; print(set({heavy}) & set(sys.modules))"
    assert python(code, tmp_path).stdout.strip() == "set()"


@pytest.mark.parametrize(
    ("place", "name"),
    [("model.py", "model"), ("estimators.py", "estimators"), ("model/__init__.py", "model")],
)
def test_a_users_own_module_of_our_name_is_named(place, name, tmp_path):
    file = tmp_path / place
    file.parent.mkdir(exist_ok=True)
    file.write_text("x = 1\n")
    for code in ("from sandbox import simulate", f"import {name}\nfrom sandbox import simulate"):
        done = python(code, tmp_path)
        said = done.stderr.strip().splitlines()[-1]
        assert done.returncode == 1
        assert said.startswith(f"ImportError: '{file}' hides the package '{name}'")
        assert f"rename that file or folder, for example to my_{name}" in said


def test_a_folder_without_package_hides_nothing(tmp_path):
    (tmp_path / "model").mkdir()
    done = python("from sandbox import list_scenarios; print(len(list_scenarios()))", tmp_path)
    assert done.stdout.strip() == "3", done.stderr


@of("list_motors", "list_scenarios", "list_estimators", "list_effects", "list_datasets")
@pytest.mark.parametrize("kind", ["estimators", "effects", "motors", "scenarios", "datasets"])
def test_lists_compile_nothing(kind, tmp_path):
    """With an empty cache, too; estimators do not even bring in numba."""
    code = f"import sys\nfrom sandbox.cli import main\nassert main(['list', '{kind}']) == 0\n"
    code += "assert 'numba' not in sys.modules\n" * (kind == "estimators")
    begun = time.perf_counter()
    done = python(code, tmp_path, SENSORLESS_CACHE=str(tmp_path / "cache"))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert not list((tmp_path / "cache").rglob("*.nb?"))  # numba's files of compiled code
    assert time.perf_counter() - begun < 3.0  # 0.3 to 0.6 s on a free machine; the goal is 1.5 s
    listed = getattr(sandbox, f"list_{kind}")()
    assert list(listed) == [line.split()[0] for line in done.stdout.splitlines()]


def test_listed_estimators_say_what_their_objects_say():
    assert sandbox.list_estimators() == {
        name: sandbox.load_estimator(name).summary for name in sandbox.list_estimators()
    }


def test_compiling_is_said_once_and_only_when_it_happens(tmp_path):
    """A kernel of our own in an empty cache: one line on stderr; from the cache: none."""
    code = "from model.frames import wrapped\nfrom model.energy import Energy, hessian\n"
    code += "print(hessian(Energy(1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.1, 0.2))\n"
    cache = {"SENSORLESS_CACHE": str(tmp_path / "cache")}
    first, second = python(code, tmp_path, **cache), python(code, tmp_path, **cache)
    assert first.stdout == second.stdout != ""
    assert first.stderr == "compiling once, about 30 s\n"
    assert second.stderr == ""
    known = json.loads((tmp_path / "cache" / "compile-seconds.json").read_text())
    assert all(0.0 < seconds < 60.0 for seconds in known.values())


@pytest.fixture(scope="module")
def run():
    return sandbox.simulate("ipm_exchanged", SHORT, "inversion", belief="linear", seed=2)


@of("simulate", "load_motor", "load_scenario", "load_estimator", "BadInput", "PhysicsError")
def test_simulate_takes_names_files_and_objects(run, tmp_path):
    """The same run by name, by path, and by object, to the bit."""
    from model.drive_files import MOTORS

    scenario = tmp_path / "short.toml"
    scenario.write_text(
        "[[segment]]\nduration = 0.2\n[[segment]]\nduration = 0.2\nload = 1.0\nramp = 0.05\nsettle = 0.1\n"
    )
    drive, own = sandbox.load_motor("ipm_exchanged"), sandbox.load_estimator("inversion")
    for motor, scene, estimator in (
        (MOTORS / "ipm_exchanged.toml", scenario, "inversion"),
        (drive, SHORT, own),
    ):
        again = sandbox.simulate(motor, scene, estimator, belief="linear", seed=2)
        assert np.array_equal(again.recording.table, run.recording.table)
    with pytest.raises(sandbox.BadInput, match="motor = 3 is neither a name nor a file nor a Drive"):
        sandbox.simulate(3)
    with pytest.raises(sandbox.BadInput, match="did you mean 'qnull'"):
        sandbox.simulate(drive, SHORT, "qnul")
    with pytest.raises(sandbox.PhysicsError, match="convex"):
        sandbox.simulate("spm")


@of("Scenario", "Segment")
def test_a_run_as_table_frame_figure_trace_and_folder(run, tmp_path):
    assert len(repr(run)) < 200
    assert "\n" not in repr(run)
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
    names = ["simulate.csv", "simulate.json", "simulate.parquet", "simulate.png", "simulate.rrd"]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == names
    kept = pq.read_table(tmp_path / "out" / "simulate.parquet")
    assert kept.schema.field("i_d").metadata[b"unit"] == b"A"
    assert (tmp_path / "out" / "simulate.csv").read_text().startswith('"t (s)","i_a (A)"')
    content = json.loads((tmp_path / "out" / "simulate.json").read_text())
    assert (content["figure"], content["table"], content["trace"]) == tuple(
        f"simulate.{kind}" for kind in ("png", "parquet", "rrd")
    )
    assert run.to_rerun(str(tmp_path / "alone.rrd")).is_file()


def test_without_pandas_one_sentence(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(sandbox.BadInput, match="pip install pandas"):
        run.to_dataframe()
    assert run.to_table().num_rows > 0


OWN = """
import dataclasses
import sandbox
ESTIMATOR = dataclasses.replace(sandbox.load_estimator("qnull"), name="{name}", summary="mine")
"""


@pytest.fixture
def own_file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(OWN.format(name="mine"))
    return path


@of("compare")
def test_an_estimator_of_ones_own_by_file_and_object(own_file, tmp_path, capsys):
    """A copy of `qnull` under another name errs as `qnull` does, to the bit."""
    mine = sandbox.load_estimator(own_file)
    assert (mine.name, sandbox.load_estimator(str(own_file))) == ("mine", mine)
    result = sandbox.compare("ipm_exchanged", SHORT, ["qnull", mine])
    by_name = {name: [r.error_deg for r in result.rows if r.estimator == name] for name in ("qnull", "mine")}
    assert by_name["qnull"] == by_name["mine"]
    assert result.to_table().num_rows == len(result.rows) == 16
    assert "worst mean error" in repr(result)
    out = tmp_path / "out"
    call = ["compare", "--scenario", "speed_steps", "--estimators", "qnull", "--estimator", str(own_file)]
    options = build_parser().parse_args(call)
    assert commands.names_of(options.estimators) + options.estimator == ["qnull", str(own_file)]
    scene = tmp_path / "s.toml"
    scene.write_text("[[segment]]\nduration = 0.2\n")
    call = ["simulate", "--scenario", str(scene), "--estimator", str(own_file), "--json-only", "--out", str(out)]
    assert main(call) == 0
    assert json.loads((out / "simulate.json").read_text())["estimator"] == "mine"
    assert [p.name for p in out.iterdir()] == ["simulate.json"]
    capsys.readouterr()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (OWN.format(name="ekf"), "'ekf' is the name of a built-in estimator"),
        ("x = 1", "defines no ESTIMATOR"),
        ("import nothing_of_this_name", "cannot be run: ModuleNotFoundError"),
    ],
)
def test_wrong_estimator_files(text, sentence, tmp_path):
    path = tmp_path / "wrong.py"
    path.write_text(text)
    with pytest.raises(sandbox.BadInput, match=sentence):
        sandbox.load_estimator(path)
    with pytest.raises(sandbox.BadInput, match="does not exist"):
        sandbox.load_estimator(tmp_path / "nowhere.py")


@of("load_estimator_library", "export_estimator")
def test_estimators_in_c_from_the_page(tmp_path):
    """What they do: tests/estimators/test_library.py and test_c.py."""
    with pytest.raises(sandbox.BadInput, match="does not exist"):
        sandbox.load_estimator_library(tmp_path / "none.so")
    with pytest.raises(sandbox.BadInput, match="is neither a name nor a file nor a library"):
        sandbox.load_estimator_library(3)
    export = sandbox.export_estimator("qnull", "ipm_exchanged")
    assert repr(export) == "<Export: qnull for ipm_exchanged, sensorless_estimator.h, qnull.c, motor.h, check.c>"
    assert {p.name for p in export.save(tmp_path / "out").iterdir()} == {*export.files, "export-estimator.json"}
    with pytest.raises(sandbox.BadInput, match="unknown estimator in C"):
        sandbox.export_estimator("ukf")


def test_two_estimators_of_one_name_are_refused():
    one = dataclasses.replace(sandbox.load_estimator("qnull"), name="same")
    other = dataclasses.replace(one, summary="another")
    with pytest.raises(sandbox.BadInput, match="two estimators are called 'same'"):
        sandbox.compare("ipm_exchanged", SHORT, [one, other])


@of("protocol")
def test_protocol_takes_objects_and_shows_goals(own_file, tmp_path, capsys):
    drive = sandbox.load_motor("ipm_exchanged")
    result = sandbox.protocol([own_file], [drive], ["load_step"], keep=tmp_path)
    assert [(r.unit.estimator, r.unit.motor) for r in result.protocol.rows] == [("mine", "ipm_exchanged")] * 2
    assert not list(tmp_path.glob(".protocol-*"))  # of objects and files nothing waits for another call
    import_module("sandbox.evaluation.protocol").show(result.protocol)
    said = capsys.readouterr().out
    assert "≤ 1 (3)°" in said
    assert "as theory ±0.3°" not in said or "✓" in said
    assert result.to_table().column("motor").to_pylist()[0] == "ipm_exchanged"
    with pytest.raises(sandbox.BadInput, match="no trace"):
        result.to_rerun(tmp_path / "x.rrd")


def test_goal_beside_every_verdict():
    p, t = import_module("sandbox.evaluation.protocol"), import_module("sandbox.evaluation.protocol_tests")
    outcome = t.Outcome((), {"mean_deg": 12.9, "p95_deg": 14.0, "lost": 0}, True)
    for test in p.TESTS:
        for belief in ("saturated", "linear"):
            row = p.Row(p.Unit("m", test, "e", belief), outcome, 0.0)
            text = p.cell(row)
            assert text.partition("✓ ")[2] == p.goal_of(row) != ""
    linear = p.cell(p.Row(p.Unit("m", "creep", "e", "linear"), outcome, 0.0))
    assert linear == "12.90 (14.0) ✓ as theory ±0.3°"


@of("audit", "maps")
def test_machine_results(tmp_path):
    audit, maps = sandbox.audit("ipm_exchanged"), sandbox.maps("ipm_exchanged", points=5)
    assert audit.passed
    assert audit.to_table().column("load").to_pylist()[18] == 0.0
    assert "valid up to 2.16 A" in repr(audit)
    table = maps.to_table()
    at_zero = [row for row in table.to_pylist() if row["i_d"] == row["i_q"] == 0.0]
    assert at_zero[0]["l_dd"] == pytest.approx(0.0458)  # inductance_d as printed
    assert table.schema.field("l_dd").metadata == {b"unit": b"H"}
    assert len(maps.plot().axes) == 12  # six maps, six colour bars
    maps.save(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["maps.json", "maps.npz", "maps.png"]


def test_another_motor_does_not_overwrite(tmp_path, capsys):
    for motor in ("spm", "ipm", "ipm"):
        assert main(["audit", motor, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.count("the earlier result of 'spm' is kept as audit-spm.json") == 1
    latest, earlier = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("audit", "audit-spm"))
    assert (latest["motor"], earlier["motor"]) == ("ipm", "spm")
    assert (earlier["command"], earlier["figure"]) == ("audit", "audit-spm.png")
    assert (tmp_path / earlier["figure"]).is_file()
    assert main(["audit", "spm", "--quiet", "--out", str(tmp_path)]) == 0
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == [f"audit{of}.{kind}" for of in ("-ipm", "") for kind in ("json", "parquet", "png")]


@pytest.fixture(scope="module")
def campaign():
    return paper_campaign(sandbox.load_motor("ipm_exchanged"))


@of("read_campaign")
def test_a_campaign_is_looked_into_by_name(campaign):
    file = campaign.recordings[0].file
    recording = campaign[file]
    assert sandbox.read_campaign(campaign) is campaign
    assert [r.file for r in campaign] == [r.file for r in campaign.recordings]
    np.testing.assert_array_equal(recording["i_a"], recording.columns["i_a"])
    assert {"i_a", "theta", "u_dc"} <= set(dir(recording))
    assert {"recordings", "drive", "to_pandas"} <= set(dir(campaign))
    with pytest.raises(sandbox.BadInput, match=r"unknown column of .*did you mean 'i_"):
        recording["i_A"]
    frame = campaign.to_pandas()
    assert len(frame) == sum(r.t.size for r in campaign)
    assert frame.columns[0] == "file"
    assert frame.attrs["units"]["u_alpha"] == "V"
    assert recording.to_pandas().shape == (recording.t.size, len(recording.columns))
    assert max(len(repr(campaign)), len(repr(recording))) < 300


@of("identify")
def test_identification_draws_what_was_measured(campaign, tmp_path):
    found = sandbox.identify(campaign)
    rows = found.to_table().to_pylist()
    resistance = next(r for r in rows if (r["method"], r["parameter"]) == ("exact", "resistance"))
    assert resistance["value"] == pytest.approx(12.15, rel=1e-3)  # planted
    assert resistance["unit"] == "ohm"
    figure = found.plot(tmp_path / "identify.png")
    levels, first = found.identification.levels, figure.axes[0]
    lines = {line.get_label(): line for line in first.get_lines()}
    measured = first.containers[0].lines[0]
    assert {"exact", "first_order"} <= set(lines)
    picked = import_module("sandbox.public.figures").staircase(levels, 0, 0)
    assert sorted(measured.get_xdata()) == pytest.approx(sorted(levels.current[picked, 0]))
    # the plant has no effect the exact model lacks: its line runs through the points, 1 % of the slope at the most
    np.testing.assert_allclose(lines["exact"].get_ydata(), measured.get_ydata(), rtol=0.01)


@of("replay")
def test_replay_meets_its_own_simulation(tmp_path):
    """A simulated bench replayed by the same effects lies at its noise floor, without them it does not."""
    effects = {"current_offset.offset_a": 0.05}
    folder = tmp_path / "bench"
    sandbox.simulate("ipm_exchanged", SHORT, effects=effects, record=folder)
    own = sandbox.replay(folder, effects)
    nominal = sandbox.replay(str(folder))
    assert own.rms["short.parquet"] == pytest.approx(1.0, abs=0.1)
    assert nominal.rms["short.parquet"] > 5.0  # 0.05 A of offset over a floor of some 2 mA
    table = own.to_table()
    assert {"file", "t", "i_a", "i_a_simulated"} <= set(table.column_names)
    assert own.to_rerun(tmp_path / "replay.rrd").is_file()
    assert "noise floors" in repr(own)
    nominal.save(tmp_path / "out")
    assert json.loads((tmp_path / "out" / "replay.json").read_text())["recordings"][0]["rms"] > 5.0


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


def test_show_with_a_display_opens_page_and_trace(run, tmp_path, monkeypatch):
    opened = []
    showing = import_module("sandbox.public.showing")
    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(showing.webbrowser, "open", opened.append)
    monkeypatch.setattr(showing, "view", lambda path, web=False: opened.append(str(path)))
    run.save(tmp_path, table=False)
    assert "opened" in sandbox.show(tmp_path)
    assert opened == [(tmp_path / "simulate.png").as_uri(), str(tmp_path / "simulate.rrd")]


def test_tables_fit_eighty_columns(small_comparison, capsys):
    """Folded, every cell kept; the columns that tell rows apart stand in each part."""
    from sandbox.output.tables import comparison_tables
    from sandbox.public.printed import print_comparison

    print_comparison(small_comparison)
    said = capsys.readouterr().out
    drawn = [line for line in said.splitlines() if line[:1] in "┏┃┡│└"]
    assert drawn
    assert max(map(len, drawn)) <= 80
    for _, heads, rows in comparison_tables(small_comparison):
        for cell in [*heads, *(c for row in rows for c in row)]:
            assert cell in said
    assert said.count("load %") == 2 * len(folded(heads, rows, 3, 80))
    assert folded(["k", *(10 * ["x" * 17])], [], 1, 80) == [[0, 1, 2, 3], [0, 4, 5, 6], [0, 7, 8, 9], [0, 10]]


def test_a_long_first_column_is_broken_and_numbers_are_not(capsys):
    print_table("files", ["recording", "before", "after"], [["x" * 90, "123456.78", "1.25"]])
    said = capsys.readouterr().out.splitlines()
    assert max(map(len, said)) == 80
    assert "123456.78" in said[4]
    assert sum(line.count("x") for line in said) == 90


@pytest.mark.parametrize("call", [["audit", "spm"], ["maps", "spm"], ["list", "estimators"]])
def test_commands_print_within_eighty_columns(call, tmp_path, capsys):
    assert main([*call, *(["--out", str(tmp_path)] if call[0] != "list" else [])]) == 0
    drawn = [line for line in capsys.readouterr().out.splitlines() if line[:1] in "┏┃┡│└"]
    assert max(map(len, drawn), default=0) <= 80


CALLS = {
    "simulate": ["simulate"], "compare": ["compare"], "protocol": ["protocol", "--motors", "ipm"], "bench": ["bench"],
    "audit": ["audit", "ipm"], "maps": ["maps", "ipm"], "identify": ["identify", "folder"],
    "diagnose": ["diagnose", "folder"], "list_motors": ["list", "motors"], "list_effects": ["list", "effects"],
    "list_estimators": ["list", "estimators"], "list_scenarios": ["list", "scenarios"],
    "list_datasets": ["list", "datasets"], "view": ["view", "x.rrd"], "show": ["show", "x"],
    "sweep": ["sweep", "x.toml"], "verify": ["verify", "x"],
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_commands_call_the_page(name, monkeypatch, tmp_path):
    """Every command of the command line but `withheld`, which is no function of the page."""

    class Called(Exception):
        """Raised where the page's function is called."""

    def called(*_, **__):
        raise Called

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sandbox, name, called)
    options = build_parser().parse_args(CALLS[name])
    with pytest.raises(Called):
        options.run(options)


def test_seed_and_jobs_are_told_where_they_do_something(capsys):
    for command, seed, jobs in (
        ("compare", True, True), ("simulate", True, False), ("protocol", True, True), ("audit", False, False),
        ("maps", False, False), ("identify", False, False), ("bench", False, False), ("diagnose", False, True),
        ("sweep", False, True),
    ):  # fmt: skip
        with pytest.raises(SystemExit):
            main([command, "--help"])
        said = capsys.readouterr().out
        assert ("--seed" in said, "--jobs" in said) == (seed, jobs), command


@of("describe")
def test_effects_leave_no_theory():
    """The theory knows the motor alone: with an effect in the plant none is stated."""
    result = sandbox.compare("ipm_exchanged", SHORT, "qnull", effects="dead_time.time=1e-6")
    assert {row.predicted_mean_deg for row in result.rows} == {None}
    assert result.as_json()["effects"] == {"dead_time.time": 1e-6}
    assert sandbox.describe("dead_time").startswith("dead_time")


@of("Sample", "Estimate", "Belief", "Tuning", "Estimator")
def test_an_estimator_is_written_with_the_page_alone(tmp_path):
    """One that says what it was told: the angle of a locked rotor, so the error is nil but for the first sample."""

    def step(state, sample: sandbox.Sample, belief: sandbox.Belief, tuning: sandbox.Tuning):
        assert belief.magnet_flux > 0.0
        return sandbox.Estimate(state["told"], 0.0, state["told"], 0.0, 1.0, 0.0, 0.0)

    told = sandbox.Estimator("told", "keeps what it was told", lambda b, t, angle=None: {"told": angle}, step, False)
    still = sandbox.Scenario("still", (sandbox.Segment(0.05),), start_up=False)
    assert sandbox.simulate("ipm", still, told, closed_loop=False).error_deg.max == pytest.approx(0.0, abs=1e-9)


@of("bench", "diagnose")
def test_results_of_long_work_are_results(tmp_path):
    """Those of minutes are tested with their commands; here that their results can do what all results can."""
    from sandbox.public.protocols import BenchResult
    from sandbox.public.recorded import DiagnosisResult
    from sandbox.public.result import Result

    measured = {"plant_step_ns": 45.0, "closed_loop_qnull_cpu_s_per_s": 0.01}
    result = BenchResult(measured, {"all_effects_to_none_cpu": 3.2})
    assert repr(result) == "<BenchResult: 45.0 ns a plant step, 0.01 CPU s a closed-loop second>"
    assert result.to_table().num_rows == 3
    assert [p.name for p in result.save(tmp_path).iterdir()] == ["bench.json"]
    assert issubclass(DiagnosisResult, Result)
    with pytest.raises(sandbox.BadInput, match="'nowhere'"):
        sandbox.diagnose("nowhere")
    with pytest.raises(sandbox.BadInput, match="unknown nominal model"):
        sandbox.diagnose("nowhere", nominal="quartic")


@of("sweep", "tolerances")
def test_results_of_many_runs(tmp_path):
    """What they hold: tests/sandbox/sweep."""
    scene = {"scenario": {"start_up": False}, "segment": [{"duration": 0.02, "load": 1.0, "settle": 0.01}]}
    done = sandbox.sweep(scene | {"grid": {"belief": ["linear", "saturated"]}}, tmp_path / "sweep", jobs=1)
    assert repr(done).startswith("<SweepResult: sweep, 2 runs, ")
    assert done.save(csv=True) == tmp_path / "sweep"
    names = {"manifest.json", "runs", "schema.json", "sweep.csv", "sweep.json", "sweep.png"}
    assert {p.name for p in (tmp_path / "sweep").iterdir()} == names
    assert done.to_dataframe().attrs["units"]["mean_deg"] == "deg"
    assert json.loads((tmp_path / "sweep" / "sweep.json").read_text())["status"] == {"ok": 2}
    short = sandbox.Scenario("short", (sandbox.Segment(0.02, 1.0, settle=0.01),), start_up=False)
    found = sandbox.tolerances("ipm_exchanged", short, "qnull", percent=[5], draws=2, jobs=1)
    assert [(r.belief, r.tolerance) for r in found.rows] == [(b, t) for t in (0, 0.05) for b in ("linear", "saturated")]
    found.save(tmp_path / "tolerances")
    names = {"tolerances.json", "tolerances.parquet", "tolerances.png"}
    assert {p.name for p in (tmp_path / "tolerances").iterdir()} == names
    with pytest.raises(sandbox.BadInput, match="no name or file"):
        sandbox.tolerances(sandbox.load_motor("ipm_exchanged"))


def test_every_name_is_there_and_has_a_test():
    assert set(sandbox.__all__) == set(sandbox._HOME) == TESTED
    assert len(sandbox.__all__) == len(set(sandbox.__all__))
    for name in sandbox.__all__:
        assert getattr(sandbox, name).__name__ == name
        assert inspect.getdoc(getattr(sandbox, name))
    with pytest.raises(AttributeError, match="simulat"):
        sandbox.simulat  # noqa: B018


@of("verify")
def test_verification_is_told_in_a_sentence(tmp_path):
    """What it finds: tests/sandbox/public/test_verify.py."""
    found = sandbox.verify(sandbox.audit("ipm").save(tmp_path))
    assert repr(found).startswith(f"<Verification: {tmp_path / 'audit.json'}: ")
    assert found.sentence().endswith("values of 'audit' are the same to the bit")


@of("use_effects")
def test_effects_of_ones_own_are_refused_once_the_plant_is_there(tmp_path):
    """What they do: tests/sandbox/plant/test_own_effects.py, in a process of its own."""
    import_module("sandbox.plant.electrical")
    with pytest.raises(sandbox.BadInput, match="compiled already"):
        sandbox.use_effects(ROOT / "experiments" / "my_effects.py")
    with pytest.raises(sandbox.BadInput, match="give a Python file"):
        sandbox.use_effects(tmp_path / "none.py")
