"""The trace holds the runs' own numbers, says how it was made, and appears whole or not at all."""

import errno
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from model.errors import BadInput
from sandbox import view
from sandbox.drive.recording import Recording
from sandbox.evaluation.pages import compare_trace
from sandbox.evaluation.pages.compare_tables import comparison_text
from sandbox.evaluation.score import ErrorDeg
from sandbox.output import trace
from tests.sandbox.evaluation.pages.made_runs import (
    NO_ERROR,
    comparison_of,
    recording_of,
    row_of,
    run_of,
)
from tests.traces import read_properties, read_trace

SAMPLES = 800
RATE = 4000.0


def _recording(seed, samples=SAMPLES):
    """Return a recording with one and a half turns, a noisy error and 500 Hz ripple on the
    currents."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) / RATE
    theta = 0.3 + 3 * np.pi * t / t[-1]
    theta_hat = theta + 0.1 * rng.standard_normal(samples)
    channels = ("omega", "omega_hat", "ripple_d", "ripple_q", "omega_ref", "load_torque", "i_q_ref")
    noise = {name: rng.standard_normal(samples) for name in channels}
    square = np.where(np.arange(samples) % 8 < 4, 0.2, -0.2)
    angles = {"t": t, "theta": theta, "theta_hat": theta_hat}
    currents = {"i_d": square, "i_q": 1.2 + square}
    states = {"load": np.where(t < 0.1, 0.5, 1.0), "tracking": (t > 0.02).astype(float)}
    return recording_of(angles | currents | states | noise)


def _row(belief, closed, load, start, predicted, lost=False):
    error = NO_ERROR if lost else ErrorDeg(-3.0, 3.1, 4.0, 5.0)
    times = {"t_start": start, "t_end": start + 0.04, "speed_rpm": 30.0}
    return row_of(
        belief, closed, load, error, predicted_mean_deg=predicted, lost_lock=lost, **times
    )


def _run(belief, closed, seed, samples=SAMPLES):
    predicted = -3.0 if belief == "linear" else None
    rows = (
        _row(belief, closed, 0.5, 0.05, predicted),
        _row(belief, closed, 1.0, 0.15, predicted, not closed),
    )
    return run_of(belief, closed, rows, recording=_recording(seed, samples))


def _comparison(samples=SAMPLES):
    kinds = [(belief, closed) for closed in (True, False) for belief in ("saturated", "linear")]
    return comparison_of(
        (_run(*kind, seed, samples) for seed, kind in enumerate(kinds)),
        **{"version": "0.1.0", "seed": 7, "inductance_d": 0.0113, "note": "synthetic"},
    )


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    comparison = _comparison()
    path = tmp_path_factory.mktemp("trace") / "comparison.rrd"
    compare_trace.write_trace(path, comparison)
    return comparison, path


def test_error_and_angles_are_the_recorded_samples(written):
    comparison, path = written
    found = read_trace(path)
    for run in comparison.runs:
        times, error = found[f"{run.name}/error"]
        np.testing.assert_array_equal(error[:, 0], np.rad2deg(run.recording.error))
        _, angles = found[f"{run.name}/angle"]
        np.testing.assert_array_equal(
            angles, np.column_stack([run.recording.theta, run.recording.theta_hat])
        )
        np.testing.assert_allclose(times, run.recording.t, rtol=0.0, atol=1e-9)


def test_currents_are_means_without_the_injected_ripple(written):
    comparison, path = written
    _, current = read_trace(path)[f"{comparison.runs[0].name}/current_q"]
    assert current.shape == (SAMPLES // compare_trace.SLOW, 1)
    np.testing.assert_allclose(current, 1.2, atol=1e-12)


def test_slow_channels_are_recorded_samples(written):
    comparison, path = written
    found, run = read_trace(path), comparison.runs[1]
    np.testing.assert_array_equal(
        found[f"{run.name}/ripple_q"][1][:, 0], run.recording.ripple_q[:: compare_trace.SLOW]
    )
    np.testing.assert_array_equal(
        found[f"{run.name}/speed"][1][:, 1], run.recording.omega_hat[:: compare_trace.SLOW]
    )
    np.testing.assert_array_equal(
        found["scenario/load"][1][:, 0], 100.0 * run.recording.load[:: compare_trace.SLOW]
    )


def test_prediction_is_there_only_where_theory_is(written):
    found = read_trace(written[1])
    assert "qnull/closed/saturated/predicted" not in found
    times, values = found["qnull/closed/linear/predicted"]
    np.testing.assert_allclose(times[:2], [0.05, 0.09])
    np.testing.assert_array_equal(values[:, 0], [-3.0, -3.0, np.nan] * 2)


def test_properties_say_how_it_was_made(written):
    made = read_properties(written[1])
    expected = {
        "motor": "ipm_exchanged",
        "scenario": "staircase",
        "sample_stride": "1",
        "version": "0.1.0",
    }
    assert made == expected | {"seed": "7", "inductance_d": "0.0113", "note": "synthetic"}


def test_a_property_may_change_its_type_between_traces(tmp_path):
    comparison = _comparison(samples=64)
    for seed in (7, "none", 2.5):
        seeded = replace(comparison, properties={"seed": seed})
        compare_trace.write_trace(tmp_path / "comparison.rrd", seeded)
        assert read_properties(tmp_path / "comparison.rrd")["seed"] == str(seed)


def test_rerun_verifies_the_file(written):
    rerun = Path(sys.executable).with_name("rerun")
    done = subprocess.run(
        [rerun, "rrd", "verify", written[1]], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_summary_holds_the_table_and_how_much_was_kept():
    text = comparison_text(_comparison(), {"seed": "7"}, 3, 48)
    assert "| +100 | +30 | -3.00 | lost lock |" in text
    assert "one recorded sample in 3" in text


def test_a_real_comparison_survives_the_round_trip(small_comparison, tmp_path):
    """The numbers of the run are found again in the file: mean error of each row from the trace
    alone."""
    compare_trace.write_trace(tmp_path / "real.rrd", small_comparison)
    found = read_trace(tmp_path / "real.rrd")
    for run in small_comparison.runs:
        t, error = found[f"{run.name}/error"]
        for row in run.rows:
            window = (t >= row.t_start - 1e-9) & (t < row.t_end - 1e-9)
            assert error[window].mean() == pytest.approx(row.error_deg.mean, rel=1e-12)


def test_long_runs_are_thinned_and_say_so(tmp_path, monkeypatch):
    monkeypatch.setattr(compare_trace, "FULL_RATE_SAMPLES", SAMPLES * 3 // 2)
    comparison, path = _comparison(), tmp_path / "long.rrd"
    compare_trace.write_trace(path, comparison)
    run = comparison.runs[0]
    found = read_trace(path)[f"{run.name}/error"][1]
    np.testing.assert_array_equal(found[:, 0], np.rad2deg(run.recording.error)[::3])
    assert read_properties(path)["sample_stride"] == "3"


def test_chunks_are_joined_in_order(tmp_path, monkeypatch):
    monkeypatch.setattr(trace, "CHUNK", 100)
    comparison = _comparison()
    compare_trace.write_trace(tmp_path / "chunks.rrd", comparison)
    error = read_trace(tmp_path / "chunks.rrd")["qnull/closed/saturated/error"][1]
    np.testing.assert_array_equal(error[:, 0], np.rad2deg(comparison.runs[0].recording.error))


def test_a_failed_write_leaves_the_old_file_alone(tmp_path):
    path = tmp_path / "comparison.rrd"
    path.write_bytes(b"old")
    whole = _comparison(samples=64)
    torn = replace(whole.runs[-1], recording=Recording(np.zeros((64, 2))))  # two of its channels
    with pytest.raises(IndexError, match="out of bounds"):
        compare_trace.write_trace(path, replace(whole, runs=(*whole.runs[:-1], torn)))
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_raises_what_it_is(tmp_path, monkeypatch):
    """rerun's own writer of files says it in a log and then raises something else."""
    monkeypatch.setattr(
        Path, "write_bytes", lambda *_: (_ for _ in ()).throw(OSError(errno.ENOSPC, "full"))
    )
    with pytest.raises(OSError, match="full"):
        compare_trace.write_trace(tmp_path / "comparison.rrd", _comparison(samples=64))
    assert list(tmp_path.iterdir()) == []


def test_no_runs_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="at least one run"):
        compare_trace.write_trace(tmp_path / "none.rrd", comparison_of(()))


def test_view_names_what_is_missing(tmp_path):
    with pytest.raises(BadInput, match=r"no trace at .*none\.rrd"):
        view(tmp_path / "none.rrd")


def test_view_starts_the_viewer_of_this_environment(written, monkeypatch):
    """In a window, in a browser here, and served to a browser elsewhere where there is no
    display."""
    calls = []
    code = iter((0, 101, 0, 0))

    def run(command, **_):
        calls.append(command)
        return SimpleNamespace(returncode=next(code))

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setenv("DISPLAY", ":7")
    viewer = str(Path(sys.executable).with_name("rerun"))
    view(written[1])
    assert calls == [[viewer, str(written[1])]]
    with pytest.raises(BadInput, match="exit code 101"):
        view(written[1])
    view(written[1], web=True)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    view(written[1], web=True)
    assert [call[1:-1] for call in calls[2:]] == [["--web-viewer"], ["--serve-web"]]


def test_import_does_not_load_rerun():
    code = (
        "import sys, sandbox.output.trace, sandbox.output.plots; print({'rerun', "
        "'matplotlib'} & set(sys.modules))"
    )
    root = Path(trace.__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, cwd=root, capture_output=True, text=True
    )
    assert done.stdout.strip() == "set()"
