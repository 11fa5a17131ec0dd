"""Compiling is said once, with the time that it takes: of what this call asks for, what the cache
does not hold."""

from __future__ import annotations

import json
import logging
import sys
import threading
from types import SimpleNamespace

import pytest

from model.drive_files import load_drive
from model.kernels import notice
from model.kernels.cache import ASKED, KernelCache, Name
from model.kernels.memory import COURSES, Memory
from model.kernels.notice import Watch
from model.kernels.sources import ROOT
from tests.sandbox.public.naming import python

UNKNOWN = "compiling once (the next time it is known how long)"
FILE = "compiling.json"
OUTER, INNER, OTHER = (Name("model.gone", f, "", "0") for f in ("outer", "inner", "other"))


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


@pytest.fixture
def quiet(monkeypatch):
    """Nothing of these tests is kept at the end of pytest."""
    monkeypatch.setattr(notice.atexit, "register", lambda _: None)


class Called:
    """Kernels of a watch, called by name: asked for, and compiled."""

    def __init__(self, watch, folder):
        self.watch, self.folder = watch, folder

    def __call__(self, happens, name):
        kind = "numba:compile"
        if happens == "ask":
            kind, data = ASKED, name
        else:
            cache = KernelCache(load_drive, self.folder)
            cache.named = lambda _: name
            data = {"dispatcher": SimpleNamespace(_cache=cache), "args": ()}
        event = SimpleNamespace(kind=kind, data=data)
        (self.watch.on_end if happens == "end" else self.watch.on_start)(event)


def kept(watch, took, inside, *courses):
    watch.path.write_text(Memory(took, inside, {watch.command: list(courses)}).text())


@pytest.mark.parametrize(
    ("known", "share", "said_then"),
    [
        (None, 1.0, UNKNOWN),
        (0.4, 1.0, UNKNOWN),
        (74.1, 0.9, "compiling once, about 75 s of the processor"),
        (39.8, 0.2, "compiling once, about 40 s of the processor, 200 s as busy as it is now"),
    ],
)
def test_it_is_said_once_it_has_taken_two_seconds(
    known, share, said_then, tmp_path, monkeypatch, caplog, quiet
):
    """Whatever was compiled last time may have been next to nothing: then nothing is known.  On a
    busy machine both.  The first second on the clock counts, too: 0.9 s and 0.2 s."""
    # a call with --quiet before may have left it higher
    caplog.set_level(logging.WARNING, "sensorless")
    watch = Watch(tmp_path / FILE)
    if known is not None:
        kept(watch, {OUTER: known}, {}, (OUTER,))
    Clocks(monkeypatch, [0.0, 1.0, 1.0, 1.5, 2.5, 4.0], share)
    call, said = Called(watch, tmp_path), []
    watch.on_start(SimpleNamespace(kind=ASKED, data=OUTER))
    for happens in ("start", "end", "start", "start", "start"):
        call(happens, INNER)
        said.append(len(caplog.records))
    assert said == [0, 0, 0, 0, 1]  # at 0 and 1, at 1, 1.5 and 2.5 s
    assert caplog.messages == [said_then]


def test_what_is_kept_is_each_kernels_own_processor_time(tmp_path, monkeypatch, quiet):
    """Ten seconds on the clock with a fifth of the processor, of which four in a kernel inside:
    1.2 s and 0.8 s; a call that compiles one part hides nothing of the whole."""
    watch = Watch(tmp_path / FILE)
    Clocks(monkeypatch, [0.0, 3.0, 7.0, 10.0], 0.2)
    call = Called(watch, tmp_path)
    for happens, name in (
        ("ask", OUTER),
        ("start", OUTER),
        ("ask", INNER),
        ("start", INNER),
        ("end", INNER),
        ("end", OUTER),
    ):
        call(happens, name)
    watch.remember()
    part = Watch(tmp_path / FILE)
    Clocks(monkeypatch, [0.0, 5.0], 0.2)
    for happens in ("ask", "start", "end"):
        Called(part, tmp_path)(happens, INNER)
    part.remember()
    memory = part.known()
    assert memory.took == {OUTER: pytest.approx(1.2), INNER: pytest.approx(1.0)}
    assert memory.inside[OUTER] == (INNER,)
    assert memory.courses == {watch.command: [(OUTER,), (INNER,)]}


def test_only_what_the_cache_lacks_is_counted():
    """One that is held takes nothing, nor what is inside it; two that share a kernel take it
    once."""
    memory = Memory({OUTER: 5.0, INNER: 3.0, OTHER: 1.0}, {OUTER: (INNER,), OTHER: (INNER,)}, {})

    def seconds(*held):
        return sum(memory.took[n] for n in memory.all_of((OUTER, OTHER), held.__contains__))

    assert seconds() == 9.0
    assert seconds(INNER) == 6.0
    assert seconds(OUTER) == 4.0
    assert seconds(OUTER, OTHER) == 0.0


def test_the_call_that_is_most_alike_tells():
    """By what was asked for so far; of two alike the last one; no more than COURSES of them."""
    memory = Memory()
    for course in ((OUTER,), (INNER, OTHER), (INNER,)):
        memory.keep("check", dict.fromkeys(course), {}, {}, set())
    assert memory.course_of("check", [OTHER]) == (INNER, OTHER)
    assert memory.course_of("check", [INNER]) == (INNER,)
    assert memory.course_of("plan", [INNER]) == ()
    for k in range(9):
        memory.keep("check", {Name("m", f"f{k}", "", "0"): None}, {}, {}, set())
    assert len(memory.courses["check"]) == COURSES


def test_a_function_whose_types_have_changed_is_held_where_the_others_are(monkeypatch):
    """Its signatures here are none of those that come with the package: a later state of its
    source.  Where one is the same, another one is yet to be compiled."""
    new, old, more = (OUTER._replace(signature=x) for x in "123")
    monkeypatch.setattr(Name, "held", property(lambda n: n == new))
    assert Memory({old: 9.0}).held_here(Memory({new: 8.0}))(old)
    assert not Memory({new: 8.0, more: 9.0}).held_here(Memory({new: 8.0}))(more)
    assert not Memory({old: 9.0}).held_here(Memory())(old)
    monkeypatch.setattr(Name, "held", False)
    assert not Memory({old: 9.0}).held_here(Memory({new: 8.0}))(old)


def test_a_slower_machine_takes_longer_by_as_much_as_its_first_kernels():
    memory = Memory({OUTER: 2.0, INNER: 0.1})
    assert memory.pace({OUTER: 5.0, OTHER: 9.0}) == pytest.approx(2.5)
    assert memory.pace({INNER: 5.0}) == 1.0  # too short to tell


def test_a_memory_that_was_written_is_read_again():
    """What no command asks for is left out."""
    memory = Memory({OUTER: 2.0, INNER: 0.5, OTHER: 1.0}, {OUTER: (INNER,)}, {"check": [(OUTER,)]})
    again = Memory.read(memory.text())
    assert again.took == {OUTER: 2.0, INNER: 0.5}
    assert again.inside == {OUTER: (INNER,), INNER: ()}
    assert again.courses == memory.courses


@pytest.mark.parametrize(
    "text",
    ['{"x": 1' + "0" * 400 + "}", "[" * 100_000, '{"kernels": [["a"]], "courses": {}}', "[]"],
)
def test_what_cannot_be_read_is_forgotten(text):
    assert Memory.read(text) == Memory()


def test_a_command_never_called_here_is_known_from_another_machine(tmp_path, monkeypatch):
    """Nine of ten seconds that come with the package are of kernels that are still there."""
    usual = Memory.read(notice.USUAL.read_text(encoding="utf-8"))
    assert {"compare", "simulate", "check", "identify", "diagnose", "plan"} <= usual.courses.keys()
    here = sum(s for n, s in usual.took.items() if of_source(n))
    assert here > 0.9 * sum(usual.took.values()), "run python -m experiments.compile_seconds"
    monkeypatch.setattr(sys, "argv", ["sensorless", "compare"])
    watch = Watch(tmp_path / FILE)
    assert watch.command == "compare"
    (course,) = usual.courses["compare"]
    watch.asked = dict.fromkeys(course)
    nothing = Memory(usual.took, usual.inside)
    monkeypatch.setattr(Name, "held", False)
    assert watch.expected() == pytest.approx(sum(usual.took[n] for n in nothing.all_of(course)))


def of_source(name):
    """Return whether a kernel's function still stands in its file."""
    file = ROOT.joinpath(*name.module.split(".")).with_suffix(".py")
    composed = name.module == "sandbox.plant.ports"
    last = name.function.rpartition(".")[2]
    return composed or (file.is_file() and f"def {last}(" in file.read_text())


def test_what_the_cache_holds_is_held(tmp_path):
    """In an empty cache nothing is; once compiled, it is, whether its module is loaded or not."""
    code = "from model.compiled import WATCH\nfrom model.energy import Energy, hessian\n"
    code += "print(len(WATCH.asked))\n"
    code += "hessian(Energy(1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.1, 0.2)\n"
    code += "print(*(n.held for n in WATCH.asked), {*WATCH.took} == WATCH.met)\n"
    cache = {"SENSORLESS_CACHE": str(tmp_path / "cache")}
    done = python(code, tmp_path, **cache)
    assert done.stdout.split() == ["0", "True", "True"]
    later = "from model.kernels.memory import Memory\nfrom pathlib import Path\nimport sys\n"
    later += f"m = Memory.read(Path({str(tmp_path / 'cache' / FILE)!r}).read_text())\n"
    later += "print(all(n.held for n in m.took), len(m.took) > 0, 'model.energy' in sys.modules)\n"
    assert python(later, tmp_path, **cache).stdout.split() == ["True", "True", "False"]


def test_time_in_which_two_threads_compile_counts_once(tmp_path, monkeypatch, quiet):
    """From 0 to 3 s and from 1 to 4 s (one waits for the other): 4 s, not 6."""
    watch = Watch(tmp_path / FILE)
    clock = iter([0.0, 1.0, 3.0, 4.0])
    monkeypatch.setattr(notice.time, "perf_counter", lambda: next(clock))
    call = Called(watch, tmp_path)
    both, first_over = threading.Event(), threading.Event()

    def second():
        call("start", OUTER)
        both.set()
        first_over.wait()
        call("end", OUTER)

    call("start", INNER)
    other = threading.Thread(target=second)
    other.start()
    both.wait()
    call("end", INNER)
    first_over.set()
    other.join()
    assert watch.seconds == 4.0


def test_it_is_said_only_when_it_happens(tmp_path):
    """A kernel of our own in an empty cache: at most one line on stderr; from the cache: none."""
    code = "from model.frames import wrapped\nfrom model.energy import Energy, hessian\n"
    code += "print(hessian(Energy(1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.1, 0.2))\n"
    cache = {"SENSORLESS_CACHE": str(tmp_path / "cache")}
    first, second = python(code, tmp_path, **cache), python(code, tmp_path, **cache)
    assert first.stdout == second.stdout != ""
    lines = first.stderr.splitlines()  # where it took less than 2 s, nothing
    assert len(lines) <= 1
    assert all(line == UNKNOWN for line in lines)
    assert second.stderr == ""
    memory = Memory.read((tmp_path / "cache" / FILE).read_text())
    assert 0.0 < sum(memory.took.values()) < 60.0
    assert json.loads((tmp_path / "cache" / FILE).read_text())["courses"]
