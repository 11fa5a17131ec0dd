"""Sweeps: rows are what single runs give, and the same to the bit whoever runs them and however
often they stop."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import sandbox
from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.cli import main
from sandbox.drive.design import design
from sandbox.drive.scenario import Scenario, Segment
from sandbox.engine.journal import Journal
from sandbox.engine.processes import Workers, spread
from sandbox.evaluation.protocol import protocol
from sandbox.evaluation.sweep.blocks import arrow_schema, run_block, schema_of, tasks_of
from sandbox.evaluation.sweep.cases import EACH_TIME, made_ready, run_case
from sandbox.evaluation.sweep.plan import read_sweep, sweep_of
from sandbox.evaluation.sweep.summary import below, errors_of, groups_of, interval
from sandbox.evaluation.sweep.sweep import rows_of, run_sweep
from sandbox.evaluation.sweep.tolerances import Question, tolerances
from sandbox.output.files import aside_of

DEAD = 999_999_999  # no process has this number: they end at 2^22

SCENE = {
    "scenario": {"start_up": False},
    "segment": [{"duration": 0.02, "load": 1.0, "settle": 0.01}],
}
SMALL = SCENE | {  # 40 runs in 4 blocks of 10
    "grid": {"belief": ["linear", "saturated"]},
    "random": {
        "points": 20,
        "draw": {
            "seed": {"integers": [0, 999]},
            "true_factor": {
                "magnet_flux": {"normal": [1.0, 0.02]},
                "inductance_q": {"uniform": [0.9, 1.1]},
            },
        },
    },
}


def digests(folder):
    """Return what the journal says of each block: first run, rows, checksum."""
    return [(b["start"], b["rows"], b["sha256"]) for b in blocks_in(Path(folder))]


def blocks_in(folder):
    """Return what a folder's journal says of its blocks, by first run."""
    entries = Journal(folder / "journal.jsonl").entries.items()
    return sorted((b for name, b in entries if name != "sweep"), key=lambda b: b["start"])


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The small sweep by one process, in one go."""
    folder = tmp_path_factory.mktemp("reference")
    run_sweep(sweep_of(SMALL), folder)
    found = digests(folder)
    assert [(start, rows) for start, rows, _ in found] == [(0, 10), (10, 10), (20, 10), (30, 10)]
    return found


def one_row(**run):
    """Return the row of a sweep of one run."""
    plan = sweep_of(SCENE | {"run": run})
    return run_case(plan, plan.case(0)).row


def test_a_row_is_what_a_single_run_gives():
    scene = Scenario(
        "own",
        (Segment(0.05), Segment(0.05, 1.0, ramp=0.01, settle=0.03)),
        start_up=False,
        settle=0.02,
    )
    effects = {
        "dead_time.time": 1e-7,
        "stator_resistance.resistance": 13.0,
        "inductance.scale_d": 1.05,
    }
    single = sandbox.simulate(
        "ipm_exchanged", scene, "ekf", belief="linear", effects=effects, seed=7
    )
    resistance = load_drive("ipm_exchanged").motor.resistance
    plan = sweep_of(
        {
            "run": {
                "estimator": "ekf",
                "belief": "linear",
                "seed": 7,
                "effects": {"dead_time": {"time": 1e-7}},
                "true_factor": {"resistance": 13.0 / resistance, "inductance_d": 1.05},
            },
            "segment": [
                {"duration": 0.05},
                {"duration": 0.05, "load": 1.0, "ramp": 0.01, "settle": 0.03},
            ],
            "scenario": {"start_up": False, "settle": 0.02},
        }
    )
    row = run_case(plan, plan.case(0)).row
    wanted = single.error_deg
    assert (row.mean_deg, row.rms_deg, row.p95_deg, row.max_deg) == (
        wanted.mean,
        wanted.rms,
        wanted.p95,
        wanted.max,
    )
    means = [r.error_deg.mean for r in single.rows]
    assert row.worst_mean_deg == max(means, key=abs)
    assert row.rms_mean_deg == pytest.approx(np.sqrt(np.mean(np.square(means))), rel=1e-12)


def test_a_row_has_what_the_injection_costs_where_it_is_asked_for():
    scene = Scenario("own", (Segment(0.1, 1.0, ramp=0.02, settle=0.05),), start_up=False)
    (wanted,) = sandbox.simulate(
        "ipm_exchanged", scene, "qnull", effects={"iron_loss.core_resistance": 900.0}
    ).rows
    tables = {
        "run": {
            "estimator": "qnull",
            "injection_cost": True,
            "effects": {"iron_loss": {"core_resistance": 900.0}},
        },
        "scenario": {"start_up": False},
        "segment": [{"duration": 0.1, "load": 1.0, "ramp": 0.02, "settle": 0.05}],
    }
    plan = sweep_of(tables)
    row = run_case(plan, plan.case(0)).row
    cost = wanted.cost
    assert (row.loss_w, row.torque_ripple, row.sound_db) == (
        cost.loss_w,
        cost.torque_ripple,
        cost.sound_db,
    )
    assert cost.iron_w > 0.0
    assert one_row().loss_w is None


def test_a_belief_without_alphas_is_the_linear_one():
    alphas = {f"alpha_{n}": 0.0 for n in ("30", "12", "40", "22", "04")}
    assert one_row(believed_factor=alphas) == one_row(belief="linear")
    assert one_row(believed_factor=alphas) != one_row()


def test_bandwidths_scale_the_designed_gains():
    designed = design(load_drive("ipm_exchanged"), False)
    plan = sweep_of(SCENE | {"run": {"bandwidth_factor": {"tracking": 0.5, "current": 2.0}}})
    base = tuple((k, v) for k, v in plan.case(0).items() if k.partition(".")[0] not in EACH_TIME)
    found = made_ready(plan.text, base).setup.design
    assert found.tuning.kp == 0.5 * designed.tuning.kp  # kp = 2 w0, ki = w0^2
    assert found.tuning.ki == 0.25 * designed.tuning.ki
    assert (found.control.kp_d, found.control.ki_q) == (
        2.0 * designed.control.kp_d,
        2.0 * designed.control.ki_q,
    )


def test_a_failing_case_is_a_row_with_its_sentence():
    limit = one_row(scenario_factor={"load": 3.0})
    assert limit.status == "refused"
    assert "current limit" in limit.sentence
    bus = one_row(drive_value={"dc_bus_voltage": 40.0})  # 23 V in the circle, 30 V injected
    assert bus.status == "failed"
    assert "injection of 30 V exceeds" in bus.sentence
    both = one_row(
        true_factor={"resistance": 1.1}, effects={"stator_resistance": {"resistance": 13.0}}
    )
    assert "set the same value" in both.sentence
    assert bus.mean_deg is None


@pytest.mark.parametrize(
    ("family", "field", "factor", "bounds"),
    [
        # those of `inductance.scale_q`, itself a factor
        ("true_factor", "inductance_q", 7.0, "[0.2, 5]"),
        # 1e-5 and 1e3 ohm over the motor's 12.15 ohm
        ("true_factor", "resistance", 0.0, "[8.23e-07, 82.3]"),
        ("believed_factor", "inductance_q", 0.0, "[1e-07, 10] H"),
    ],
)
def test_a_refused_factor_is_told_by_the_key_of_the_sweeps_file(family, field, factor, bounds):
    row = one_row(**{family: {field: factor}})
    assert row.status == "refused"
    assert row.sentence.startswith(family)
    assert field in row.sentence
    assert "scale_" not in row.sentence
    assert bounds in row.sentence


def test_groups_count_what_has_no_result_as_beyond_any_error():
    plan = sweep_of(SCENE | {"grid": {"scenario_factor": {"load": [1.0, 3.0]}, "seed": [1, 2, 3]}})
    table = rows_of(plan)
    fine, refused = (np.isfinite(errors_of(table)[k : k + 3]).tolist() for k in (0, 3))
    assert (fine, refused) == ([True] * 3, [False] * 3)
    groups = groups_of(plan, table)
    assert [g.ok for g in groups] == [1, 1, 1, 0, 0, 0]
    assert groups[5].median_deg is None
    errors = np.array([1.0, 2.0, 3.0, np.inf])
    assert (below(errors, 0.75), below(errors, 0.8)) == (3.0, None)
    hundred = np.arange(1.0, 10001.0)
    # 10 000 values, 95 %: 1.96 sqrt(0.95 x 0.05 x 10 000) = 42.7 ranks to either side
    assert interval(hundred, 0.95) == (9458.0, 9543.0)


def test_errors_of_either_sign_do_not_cancel():
    """Loads of +100 and -100 % err by opposite angles, with a linear belief by degrees (README: 6.9
    at 120 %)."""
    loads = [{"duration": 0.2, "load": x, "ramp": 0.05, "settle": 0.12} for x in (1.0, -1.0)]
    plan = sweep_of(
        {"scenario": {"start_up": False}, "segment": loads}
        | {"grid": {"belief": ["linear", "saturated"]}}
    )
    table = rows_of(plan)
    linear, saturated = errors_of(table)
    assert abs(table["mean_deg"][0].as_py()) < 1.0
    assert linear == pytest.approx(abs(table["worst_mean_deg"][0].as_py()))
    assert linear > 4.0 > 1.0 > saturated


def test_table_and_schema_say_the_same(tmp_path):
    plan = sweep_of(SMALL)
    table = rows_of(plan)
    assert table.schema == arrow_schema(plan)
    assert [c["name"] for c in schema_of(plan)] == table.column_names
    assert table["run"].to_pylist() == list(range(40))
    assert table["point"].to_pylist() == [n // 2 for n in range(40)]
    assert set(table["status"].to_pylist()) == {"ok"}


def test_two_processes_give_the_same_to_the_bit(reference, tmp_path):
    run_sweep(sweep_of(SMALL), tmp_path / "out", Workers(2))
    assert digests(tmp_path / "out") == reference


def test_a_cluster_that_loses_a_worker_gives_the_same_to_the_bit(reference, tmp_path):
    distributed = pytest.importorskip(
        "distributed", reason="dask.distributed is not installed (extra `dask`)"
    )
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = client.run(os.getpid)

        def kill_one(done, total):
            """Kill a worker once a first block is there."""
            if pids:
                os.kill(pids.popitem()[1], signal.SIGKILL)
                pids.clear()

        run_sweep(sweep_of(SMALL), tmp_path / "out", Workers(cluster=client), progress=kill_one)
        assert list(spread(abs, [-3], Workers(1, cluster.scheduler_address))) == [3]
        found = protocol(["qnull"], ["ipm_exchanged"], ["bandwidth"], workers=Workers(1, client))
    here = protocol(["qnull"], ["ipm_exchanged"], ["bandwidth"])
    assert [(r.unit, r.outcome) for r in found.rows] == [(r.unit, r.outcome) for r in here.rows]
    assert digests(tmp_path / "out") == reference


def test_an_interrupted_sweep_goes_on_where_it_was(reference, tmp_path):
    plan = sweep_of(SMALL)

    def stop(done, total):
        """Stop after the second block."""
        if done == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(plan, tmp_path, progress=stop)
    assert digests(tmp_path) == reference[:2]
    first, second = sorted((tmp_path / "runs").iterdir())
    kept = first.stat().st_mtime_ns
    second.write_bytes(second.read_bytes()[:-9])  # half a file is not taken for a whole one
    half = aside_of((tmp_path / "runs" / "block-000000020.parquet").resolve())
    # of a process killed
    half.with_name(half.name.replace(f"-{os.getpid()}-", f"-{DEAD}-")).write_bytes(b"half")
    found = []
    run_sweep(plan, tmp_path, progress=lambda done, total: found.append((done, total)))
    assert found == [(10, 40), (20, 40), (30, 40), (40, 40)]  # first what is kept
    assert digests(tmp_path) == reference
    assert first.stat().st_mtime_ns == kept
    assert len(list((tmp_path / "runs").iterdir())) == 4


def test_a_folder_of_another_sweep_is_left_alone(tmp_path):
    run_sweep(sweep_of(SCENE), tmp_path)
    before = digests(tmp_path)
    other = sweep_of(SCENE | {"run": {"seed": 1}})
    with pytest.raises(BadInput, match=r"holds another sweep.*--again"):
        run_sweep(other, tmp_path)
    assert digests(tmp_path) == before
    run_sweep(other, tmp_path, afresh=True)
    assert digests(tmp_path) != before


def test_a_folder_without_a_block_yet_is_gone_on_with(tmp_path):
    """Where the disk was full, or a kill came, between the folder and its journal; blocks without
    one stay refused."""
    (tmp_path / "runs").mkdir()
    run_sweep(sweep_of(SCENE), tmp_path)
    (tmp_path / "journal.jsonl").unlink()
    with pytest.raises(BadInput, match="has no readable journal"):
        run_sweep(sweep_of(SCENE), tmp_path)


def test_another_state_of_the_code_is_refused():
    task = tasks_of(sweep_of(SCENE))[0]
    with pytest.raises(BadInput, match="another state of the code"):
        run_block(task._replace(code="another"))


def test_traces_are_the_recordings_samples(tmp_path):
    pytest.importorskip("xarray", reason="xarray is not installed (extra `sweep`)")
    pytest.importorskip("zarr", reason="zarr is not installed (extra `sweep`)")
    plan = SCENE | {
        "grid": {"duration": [0.01, 0.02], "seed": [1, 2, 3, 4, 5, 6]},
        "traces": {"channels": ["i_q", "error"], "stride": 4},
    }

    def stop(done, total):
        """Stop after the first block."""
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sandbox.sweep(plan, tmp_path, jobs=1, progress=stop)
    traces = sandbox.sweep(plan, tmp_path, jobs=1).traces()
    scene = Scenario("own", (Segment(0.02, 1.0, settle=0.01),), start_up=False)
    whole = sandbox.simulate("ipm_exchanged", scene, "qnull", seed=6).recording
    assert traces["i_q"].shape == (12, 20)  # 80 samples of 250 us, every fourth
    assert np.array_equal(traces["i_q"][11], whole.i_q[::4])
    assert np.array_equal(traces["error"][11], whole.error[::4])
    short = np.asarray(traces["error"][5])  # 10 ms: 40 samples, then nothing
    assert np.isfinite(short[:10]).all()
    assert np.isnan(short[10:]).all()


def test_tolerances_leave_all_of_the_gain_when_nothing_is_off():
    scene = {
        "scenario": {"start_up": False},
        "segment": [{"duration": 0.15, "load": 1.0, "settle": 0.1}],
    }
    rows = tolerances(Question("ipm_exchanged", scene, ["qnull"], draws=8), [0.2])
    exact, off = (
        next(r for r in rows if r.belief == "saturated" and r.tolerance == t) for t in (0.0, 0.2)
    )
    assert exact.gain_left == 1.0
    assert off.gain_left < 1.0
    assert off.median_deg <= off.p95_deg
    linear = [r for r in rows if r.belief == "linear"]
    # q-null's linear belief takes the null for the magnet: no number of it moves it at standstill,
    # only the noise does
    noise = rows_of(
        sweep_of(scene | {"run": {"belief": "linear"}, "grid": {"seed": list(range(8))}})
    )["mean_deg"]
    assert linear[0].median_deg == pytest.approx(
        linear[1].median_deg, abs=4.0 * np.std(noise.to_numpy(), ddof=1)
    )
    with pytest.raises(BadInput, match="out of range; give 0 to 50 %"):
        tolerances(Question("ipm_exchanged", scene, ["qnull"]), [0.9])


# seconds of work: a signal has to meet it before it is done, on a machine that does other things,
# too
LONG = """
[scenario]
start_up = false
[[segment]]
duration = 1.0
load = 1.0
[random]
points = 120
[random.draw]
seed = {integers = [0, 999]}
"""


def command(place, *more):
    """Start `sensorless sweep` on two processes, Ctrl-C not ignored (as it is where a shell runs
    the tests with &)."""
    call = [
        sys.executable,
        "-m",
        "sandbox.cli",
        "sweep",
        str(place / "long.toml"),
        "--out",
        str(place / "out"),
        *more,
    ]
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    return subprocess.Popen(
        call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heard
    )


def children(pid):
    """Return the processes that a process has started."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*"):
        with contextlib.suppress(OSError):  # a thread that has just ended
            found += [int(n) for n in (task / "children").read_text().split()]
    return found


def blocks_of(place):
    """Return how many blocks the journal of a sweep names."""
    return len(blocks_in(place / "out"))


def wait_for_blocks(place, running, count):
    """Wait until a running command has kept so many blocks."""
    end = time.monotonic() + 600.0
    while blocks_of(place) < count and time.monotonic() < end and running.poll() is None:
        time.sleep(0.02)


def signalled(place, kind):
    """Return the exit code of a sweep that a signal met, its children, and what it printed; one
    that was done before is begun anew."""
    found, own, said = 0, [], ""
    for _ in range(6):
        running = command(place, "--jobs", "2")
        wait_for_blocks(place, running, blocks_of(place) + 1)
        own = children(running.pid)
        if kind == signal.SIGINT and own:
            # before that, a worker dies, which costs its block nothing but time
            with contextlib.suppress(ProcessLookupError):
                os.kill(own[-1], signal.SIGKILL)
            wait_for_blocks(place, running, blocks_of(place) + 2)
            own += children(running.pid)
        running.send_signal(kind)
        said = running.communicate(timeout=600)[1]  # until its resource tracker has ended, too
        found = running.returncode
        if found != 0:
            break
        shutil.rmtree(place / "out")
    return found, own, said


def alive(pid):
    """Tell whether a process is there (a zombie is not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for children in /proc")
def test_killed_workers_and_signals_leave_no_child_and_the_same_results(tmp_path):
    (tmp_path / "long.toml").write_text(LONG)
    for kind, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        found, own, said = signalled(tmp_path, kind)
        assert found == code
        rows = sum(b["rows"] for b in blocks_in(tmp_path / "out"))
        line = (
            f"sensorless sweep: interrupted; {rows} of 120 runs are kept; the same command goes on"
        )
        assert said.splitlines()[-1] == line  # no leaked semaphores behind it
        end = time.monotonic() + 120.0
        while any(map(alive, own)) and time.monotonic() < end:
            time.sleep(0.05)
        assert not [pid for pid in own if alive(pid)]
    plan, found = read_sweep(tmp_path / "long.toml"), []
    run_sweep(plan, tmp_path / "out", progress=lambda done, total: found.append(done))
    assert len(found) < len(tasks_of(plan))  # some were there
    run_sweep(plan, tmp_path / "whole")
    assert digests(tmp_path / "out") == digests(tmp_path / "whole")


def test_the_command_refuses_in_one_sentence(tmp_path):
    (tmp_path / "long.toml").write_text("[run]\nmotor = 'ipm_exchange'\n")
    done = command(tmp_path)
    _, wrong = done.communicate(timeout=600)
    assert done.returncode == 2
    assert wrong.strip().count("\n") == 0
    assert "did you mean 'ipm_exchanged'?" in wrong
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("percent", ["5,ten", "-5", "90", ""])
def test_tolerances_are_checked_before_anything_runs(percent, tmp_path, capsys):
    assert main(["compare", f"--tolerances={percent}", "--out", str(tmp_path / "out")]) == 2
    assert "no percentages from 0 to 50" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
