"""Progress on a terminal: every bar opens, tells, and is silent where nobody watches."""

import io
import threading
from contextlib import contextmanager, redirect_stderr, suppress

import pytest

from model.compiled import WATCH
from sandbox.output import tables
from sandbox.output.tables import effort_bar, progress_bar, rate_bar


class Terminal(io.StringIO):
    """A stream that says it is a terminal and keeps what is written."""

    def isatty(self):
        return True


@pytest.fixture(autouse=True)
def hundred_columns(monkeypatch):
    """Let the terminal be as wide on every machine."""
    for name, value in (("COLUMNS", "100"), ("TERM", "xterm")):
        monkeypatch.setenv(name, value)


@contextmanager
def watched(out=None):
    """Put a stream in place of the standard error, by default a terminal; return it."""
    with redirect_stderr(out or Terminal()) as seen:
        yield seen


def test_a_fraction():
    with watched() as seen, progress_bar("comparing", False) as progress:
        progress(0.5)
    assert "comparing" in seen.getvalue()


def test_a_rate_from_before_the_first_number_to_the_last():
    """Nothing is known when it opens, not even how many there will be."""
    with watched() as seen, rate_bar("sweep", False) as progress:
        for done in (0, 500, 1000):
            progress(done, 1000)
    assert "sweep" in seen.getvalue()
    assert "1,000 of 1,000 runs" in seen.getvalue()


def test_an_effort_beyond_what_is_usual():
    with watched() as seen, effort_bar("diagnosing", False, 1000.0) as (stage, count):
        stage("fitting")
        count(1600.0)
    assert "1,600 simulations" in seen.getvalue()


def test_nobody_watches(monkeypatch):
    """Quiet: nothing. Without a terminal: nothing in the first minute, then a line a minute."""
    out, clock = io.StringIO(), [0.0]
    monkeypatch.setattr(tables.time, "monotonic", lambda: clock[0])
    with (
        watched(out),
        progress_bar("a", True) as one,
        rate_bar("b", True) as two,
        effort_bar("c", True, 1.0) as (stage, count),
    ):
        assert one is two is None
        clock[0] = 1e3
        stage("d")
        count(1.0)
    assert out.getvalue() == ""
    with (
        watched(out),
        progress_bar("a", False) as one,
        rate_bar("b", False) as two,
        effort_bar("c", False, 1.0) as (stage, count),
    ):
        stage("fitting")
        for clock[0] in (1030.0, 1061.0, 1090.0, 1125.0):
            one(0.5)
            two(3, 12)
            count(1e3)
    assert out.getvalue().splitlines() == [
        "a: 50 %, 61 s",
        "b: 3 of 12 runs, 61 s",
        "c: fitting, 2,000 simulations, 61 s",
        "a: 50 %, 125 s",
        "b: 3 of 12 runs, 125 s",
        "c: fitting, 4,000 simulations, 125 s",
    ]


def test_a_step_that_takes_long_is_told_meanwhile(monkeypatch):
    """Nothing is reported, as while the first step is compiled: lines come all the same."""

    class Pipe(io.StringIO):
        written = threading.Event()

        def flush(self):
            super().flush()
            self.written.set()

    out = Pipe()
    for name in ("PAUSE", "BEAT"):
        monkeypatch.setattr(tables, name, 1e-3)
    with watched(out), progress_bar("planning", False):
        assert out.written.wait(60.0)  # however slow the machine is
    assert out.getvalue().startswith("planning: 0 %, 0 s")
    out.written.clear()
    with watched(out), effort_bar("diagnosing", False, 1.0):
        assert out.written.wait(60.0)
    assert "diagnosing: reading, 0 s" in out.getvalue()


def test_a_bar_without_a_fraction_shows_no_share():
    """0 % that stands still looks as if nothing happened."""
    with watched() as seen, progress_bar("planning", False) as progress:
        progress(0.0)
    assert "%" not in seen.getvalue()
    with watched() as seen, progress_bar("planning", False) as progress:
        progress(0.25)
    assert "25%" in seen.getvalue()


def test_what_holds_a_bar_up_is_told(monkeypatch):
    """0 % for a minute is the compiler's, and the line says so; a bar does."""
    out, clock = io.StringIO(), [0.0]
    monkeypatch.setattr(tables.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(WATCH, "active", 1)
    with watched(out), progress_bar("planning", False) as progress:
        clock[0] = 61.0
        progress(0.0)
        monkeypatch.setattr(WATCH, "active", 0)
        clock[0] = 122.0
        progress(0.2)
    lines = ["planning: 0 % (compiling), 61 s", "planning: 20 %, 122 s"]
    assert out.getvalue().splitlines() == lines
    monkeypatch.setattr(tables.time, "monotonic", tables.time.perf_counter)
    monkeypatch.setattr(WATCH, "active", 1)
    with watched() as seen, progress_bar("planning", False) as progress:
        progress(0.0)
    assert "planning (compiling)" in seen.getvalue()


def test_no_bar_is_seen_where_a_call_is_refused():
    """Only the first report starts it: what is refused before any work shows the sentence alone."""
    for bar, more in ((progress_bar, ()), (rate_bar, ()), (effort_bar, (1.0,))):
        with watched() as seen, suppress(ValueError), bar("planning", False, *more):
            raise ValueError
        assert seen.getvalue() == ""
