"""What there is, listed: nothing is compiled for it, and compiling is said once."""

from __future__ import annotations

import json
import logging
import threading
from types import SimpleNamespace

import pytest

import sandbox
from model.drive_files import load_drive
from model.kernels import notice
from model.kernels.notice import Watch
from sandbox.cli import main
from tests.sandbox.public.naming import of, python


@of(
    "list_motors",
    "list_scenarios",
    "list_estimators",
    "list_effects",
    "list_datasets",
    "list_tests",
)
@pytest.mark.parametrize(
    "kind", ["estimators", "effects", "motors", "scenarios", "datasets", "tests"]
)
def test_lists_compile_nothing(kind, tmp_path):
    """With an empty cache, too; estimators and tests do not even bring in numba."""
    code = f"import sys\nfrom sandbox.cli import main\nassert main(['list', '{kind}']) == 0\n"
    code += "assert 'numba' not in sys.modules\n" * (kind in ("estimators", "tests"))
    done = python(code, tmp_path, SENSORLESS_CACHE=str(tmp_path / "cache"))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert not list((tmp_path / "cache").rglob("*.nb?"))  # numba's files of compiled code
    listed = getattr(sandbox, f"list_{kind}")()
    assert list(listed) == [line.split()[0] for line in done.stdout.splitlines()]


WRONG_NAMES = {
    "motor": ["simulate", "--motor", "nosuch"],
    "scenario": ["simulate", "--scenario", "nosuch"],
    "estimator": ["simulate", "--estimator", "nosuch"],
    "file": ["compare", "--estimator", "nosuch.py"],
    "effect": ["compare", "--effects", "nosuch.time=1"],
    "motor to compare": ["compare", "--motor", "nosuch"],
    "motor of the protocol": ["protocol", "--motors", "nosuch"],
    "estimator of the protocol": ["protocol", "--estimators", "nosuch"],
    "test": ["protocol", "--tests", "nosuch"],
}


def test_wrong_names_are_refused_before_anything_is_compiled(tmp_path):
    """One process for all of them, its cache empty; a mapping's effects, which no command reads, at
    the end."""
    code = f"""
from sandbox import BadInput, compare
from sandbox.cli import main
for call in {list(WRONG_NAMES.values())}:
    assert main(call) == 2, call
try:
    compare(effects={{"nosuch.time": 1.0}})
except BadInput as error:
    assert "nosuch.time" in str(error)
else:
    raise AssertionError
"""
    done = python(code, tmp_path, SENSORLESS_CACHE=str(tmp_path / "cache"))
    assert done.returncode == 0, done.stderr
    said = done.stderr.splitlines()
    assert len(said) == len(WRONG_NAMES)
    assert all("nosuch" in line for line in said)
    assert not list((tmp_path / "cache").rglob("*.nb?"))


def test_listed_estimators_say_what_their_objects_say():
    assert sandbox.list_estimators() == {
        name: sandbox.load_estimator(name).summary for name in sandbox.list_estimators()
    }


def test_listed_tests_are_those_of_the_protocol():
    from sandbox.evaluation.protocol import TESTS

    assert list(sandbox.list_tests()) == list(TESTS)


UNKNOWN = "half a minute to some minutes (the next time it is known how long)"


class Clocks:
    """A clock, and a processor that compiling has for a share of the time; both go on from reading
    to reading."""

    def __init__(self, monkeypatch, instants, share=1.0):
        self.instants, self.now, self.share = iter(instants), 0.0, share
        monkeypatch.setattr(notice.time, "perf_counter", self.tick)
        for name in ("process_time", "thread_time"):
            monkeypatch.setattr(notice.time, name, lambda: self.share * self.now)

    def tick(self):
        self.now = next(self.instants)
        return self.now


@pytest.mark.parametrize(
    ("known", "share", "said_then"),
    [
        (None, 1.0, UNKNOWN),
        (0.4, 1.0, UNKNOWN),
        (75.0, 0.9, "up to about 75 s of the processor"),
        (40.0, 0.2, "up to about 40 s of the processor, 200 s as busy as it is now"),
    ],
)
def test_compiling_is_said_once_it_has_taken_two_seconds(
    known, share, said_then, tmp_path, monkeypatch, caplog
):
    """Whatever was compiled last time may have been next to nothing: then nothing is known.  On a
    busy machine both."""
    # a call with --quiet before may have left it higher
    caplog.set_level(logging.WARNING, "sensorless")
    watch = Watch(tmp_path / "compile-seconds-of-functions.json")
    if known is not None:
        watch.path.write_text(json.dumps({watch.call: {"model.gone:f": known}}))
    Clocks(monkeypatch, [0.0, 1.0, 1.0, 1.5, 2.5, 4.0], share)
    monkeypatch.setattr(notice.atexit, "register", lambda _: None)
    compiled = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=load_drive)})
    said = []
    for happens in (watch.on_start, watch.on_end, watch.on_start, watch.on_start, watch.on_start):
        happens(compiled)
        said.append(len(caplog.records))
    assert said == [0, 0, 0, 0, 1]  # at 0 and 1, at 1, 1.5 and 2.5 s
    assert caplog.messages == [f"compiling once, {said_then}"]


def test_what_is_kept_is_the_processors_time(tmp_path, monkeypatch):
    """Ten seconds on the clock with a fifth of the processor are two; a part that is compiled later
    hides no whole."""
    monkeypatch.setattr(notice.atexit, "register", lambda _: None)
    compiled = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=load_drive)})
    kept = []
    for seconds in (10.0, 1.0, 20.0):
        watch = Watch(tmp_path / "compile-seconds-of-functions.json")
        Clocks(monkeypatch, [0.0, seconds], 0.2)
        watch.on_start(compiled)
        watch.on_end(compiled)
        watch.remember()
        kept.append(sum(watch.known()[watch.call].values()))
    assert kept == [2.0, 1.8, 4.0]


def test_a_run_that_compiles_a_part_hides_nothing_of_the_whole(tmp_path, monkeypatch):
    """Ten seconds, four of them of a function inside; later that one alone: still ten in all."""
    monkeypatch.setattr(notice.atexit, "register", lambda _: None)
    path = tmp_path / "kept.json"
    outer, inner = (
        SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=f)})
        for f in (load_drive, notice.watch)
    )
    whole = Watch(path)
    Clocks(monkeypatch, [0.0, 3.0, 7.0, 10.0])
    for happens, compiled in (
        (whole.on_start, outer),
        (whole.on_start, inner),
        (whole.on_end, inner),
        (whole.on_end, outer),
    ):
        happens(compiled)
    whole.remember()
    assert sorted(whole.known()[whole.call].values()) == [4.0, 6.0]
    part = Watch(path)
    Clocks(monkeypatch, [0.0, 4.0])
    part.on_start(inner)
    part.on_end(inner)
    part.remember()
    assert sum(part.known()[part.call].values()) == 10.0


def test_what_the_cache_holds_is_not_announced(tmp_path):
    """In an empty cache nothing is held; once compiled, it is."""
    code = "from model.energy import Energy, hessian\nfrom model.kernels.notice import kept\n"
    code += "print(kept('model.energy:hessian'), kept('model.nowhere:f'))\n"
    code += "hessian(Energy(1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.1, 0.2)\n"
    code += "print(kept('model.energy:hessian'))\n"
    done = python(code, tmp_path, SENSORLESS_CACHE=str(tmp_path / "cache"))
    assert done.stdout.split() == ["False", "False", "True"]


def test_time_in_which_two_threads_compile_counts_once(tmp_path, monkeypatch):
    """From 0 to 3 s and from 1 to 4 s (one waits for the other): 4 s, not 6."""
    watch = Watch(tmp_path / "compile-seconds-of-functions.json")
    clock = iter([0.0, 1.0, 3.0, 4.0])
    monkeypatch.setattr(notice.time, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(notice.atexit, "register", lambda _: None)
    compiled = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=load_drive)})
    both, first_over = threading.Event(), threading.Event()

    def second():
        watch.on_start(compiled)
        both.set()
        first_over.wait()
        watch.on_end(compiled)

    watch.on_start(compiled)
    other = threading.Thread(target=second)
    other.start()
    both.wait()
    watch.on_end(compiled)
    first_over.set()
    other.join()
    assert watch.seconds == 4.0


def test_compiling_is_said_only_when_it_happens(tmp_path):
    """A kernel of our own in an empty cache: at most one line on stderr; from the cache: none."""
    code = "from model.frames import wrapped\nfrom model.energy import Energy, hessian\n"
    code += "print(hessian(Energy(1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.1, 0.2))\n"
    cache = {"SENSORLESS_CACHE": str(tmp_path / "cache")}
    first, second = python(code, tmp_path, **cache), python(code, tmp_path, **cache)
    assert first.stdout == second.stdout != ""
    lines = first.stderr.splitlines()  # where it took less than 2 s, nothing
    assert len(lines) <= 1
    assert all(line.startswith(f"compiling once, {UNKNOWN}") for line in lines)
    assert second.stderr == ""
    known = json.loads((tmp_path / "cache" / "compile-seconds-of-functions.json").read_text())
    assert all(0.0 < sum(of.values()) < 60.0 for of in known.values())


def test_a_motor_and_a_scenario_have_cards(capsys):
    assert main(["list", "motors", "ipm_exchanged"]) == 0
    assert "magnet_flux           0.0981 Wb" in capsys.readouterr().out
    # its map is a data set, which is not asked for
    assert main(["list", "motors", "thor_fea"]) == 0
    assert "data set 'thor_fea'" in capsys.readouterr().out
    assert main(["list", "scenarios", "creep_reversal"]) == 0
    assert "2.5 s, load 150 %, speed 0.2 % of rated" in " ".join(capsys.readouterr().out.split())
    assert main(["list", "presets", "vesc"]) == 2
    assert "'presets' have no cards" in capsys.readouterr().err


def test_an_unknown_option_is_refused_in_its_command_s_name(capsys):
    assert main(["bench", "--foo"]) == 2
    assert (
        capsys.readouterr().err
        == "sensorless bench: unknown option '--foo'; see `sensorless bench --help`\n"
    )


def test_limits_given_in_the_call_are_not_said_to_stand_in_a_file():
    with pytest.raises(sandbox.BadInput, match=r"^current = -1.0 is out of range"):
        sandbox.plan(current=-1.0)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: sandbox.simulate(duration="1 s"), "duration = '1 s' is no number"),
        (lambda: sandbox.audit(radius="2"), "radius = '2' is no number"),
        (lambda: sandbox.maps(points="5"), "points = '5' is no whole number"),
        (lambda: sandbox.plan(jobs=None), "jobs = None is no whole number"),
        (lambda: sandbox.maps(points=True), "points = True is no whole number"),
    ],
)
def test_an_argument_that_should_be_a_number_is_refused(call, said):
    with pytest.raises(sandbox.BadInput, match=said):
        call()
