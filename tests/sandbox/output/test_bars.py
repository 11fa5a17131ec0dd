"""Progress on a terminal: every bar opens, tells, and is silent where nobody watches."""

import io
import sys

from sandbox.output.tables import effort_bar, progress_bar, rate_bar


class Terminal(io.StringIO):
    """A stream that says it is a terminal and keeps what is written."""

    def isatty(self):
        return True


def terminal(monkeypatch):
    """Return a terminal of 100 columns in place of the standard error (in a test: pytest sets it anew before)."""
    out = Terminal()
    monkeypatch.setattr(sys, "stderr", out)
    for name, value in (("COLUMNS", "100"), ("TERM", "xterm")):
        monkeypatch.setenv(name, value)
    return out


def test_a_fraction(monkeypatch):
    seen = terminal(monkeypatch)
    with progress_bar("comparing", False) as progress:
        progress(0.5)
    assert "comparing" in seen.getvalue()


def test_a_rate_from_before_the_first_number_to_the_last(monkeypatch):
    """Nothing is known when it opens, not even how many there will be."""
    seen = terminal(monkeypatch)
    with rate_bar("sweep", False) as progress:
        for done in (0, 500, 1000):
            progress(done, 1000)
    assert "sweep" in seen.getvalue()
    assert "1,000 of 1,000 runs" in seen.getvalue()


def test_an_effort_beyond_what_is_usual(monkeypatch):
    seen = terminal(monkeypatch)
    with effort_bar("diagnosing", False, 1000.0) as (stage, count):
        stage("fitting")
        count(1600.0)
    assert "1,600 simulations" in seen.getvalue()


def test_nobody_watches(monkeypatch):
    out = io.StringIO()
    monkeypatch.setattr(sys, "stderr", out)
    with progress_bar("a", False) as one, rate_bar("b", False) as two, effort_bar("c", False, 1.0) as (stage, count):
        assert one is two is None
        stage("d")
        count(1.0)
    assert out.getvalue() == ""
