"""Shared fixtures: one short comparison for everything that only needs some runs, and the shared
data folder."""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from hypothesis import settings

from tests import balance, durations

# before numpy is loaded: threads of BLAS in several workers wait for each other in loops (a fit
# took 100 times as long)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
settings.register_profile("suite", deadline=None)  # the first call of a kernel compiles it
settings.load_profile("suite")

SHARED = Path(__file__).resolve().parents[2] / "shared"
for variable, folder in (("SENSORLESS_DATA", "realdata"), ("SENSORLESS_RECORDINGS", "recordings")):
    if (SHARED / folder).is_dir():  # data that are not part of the repository, beside the checkout
        os.environ.setdefault(variable, str(SHARED / folder))


def pytest_sessionstart(session):
    """Compile, on several workers, what all of them need: each another part."""
    worker = getattr(session.config, "workerinput", None)
    if worker is not None and balance.is_whole(session.config.args):
        balance.compile_share(int(worker["workerid"].removeprefix("gw")), worker["workercount"])


def pytest_addoption(parser):
    """Say how to keep what tests take."""
    parser.addoption(
        "--store-durations", action="store_true", help="keep what tests take (tests/durations.py)"
    )


def pytest_collection_modifyitems(items):
    """Long files first, so that no worker is left with one at the end; mark what is slow."""
    seconds = durations.read()
    files = durations.by_file(seconds)
    items.sort(key=lambda item: -files[durations.file_of(durations.test_of(item.nodeid))])
    for item in items:
        if durations.is_slow(durations.test_of(item.nodeid), seconds):
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Note the CPU that a test takes, its fixtures included; reports hand it on from workers."""
    item.begun = durations.used()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """See above."""
    if call.when == "teardown":
        item.user_properties.append(("cpu", durations.used() - item.begun))
    return (yield)


TOOK = Counter()  # seconds of each test


def pytest_runtest_logreport(report):
    """Add up what tests took, on the controller where there are workers."""
    if report.when == "teardown":
        TOOK[durations.test_of(report.nodeid)] += dict(report.user_properties).get("cpu", 0.0)


def pytest_sessionfinish(session):
    """Keep what tests took, where that is asked for."""
    if session.config.getoption("--store-durations") and not hasattr(session.config, "workerinput"):
        durations.store(TOOK, map(durations.file_of, TOOK))


@pytest.fixture(scope="session")
def small_comparison():
    """Two estimators on a two-step staircase, both beliefs, closed and open."""
    from model.drive_files import load_drive  # here: importing these compiles the closed loop
    from sandbox.drive.scenario import Scenario, Segment
    from sandbox.evaluation.compare import compare

    segments = (Segment(0.2), Segment(0.3, 1.0, ramp=0.05))
    scenario = Scenario("two_steps", segments, settle=0.15)
    return compare(load_drive("ipm_exchanged"), scenario, ("qnull", "ekf"), seed=3)


def skipped_lines(reports):
    """Return one line a reason: what was missing, how many tests it cost, in which files."""
    files = defaultdict(Counter)
    for report in reports:
        why = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        files[why.removeprefix("Skipped: ")][report.nodeid.partition("::")[0]] += 1
    return [
        f"{sum(where.values())} not run, {why}: "
        + ", ".join(f"{file} ({n})" for file, n in sorted(where.items()))
        for why, where in sorted(files.items())
    ]


def pytest_terminal_summary(terminalreporter):
    """Say what was skipped for which missing data: a run without them is no full run."""
    lines = skipped_lines(terminalreporter.stats.get("skipped", []))
    if lines:
        terminalreporter.section("not run")
        for line in lines:
            terminalreporter.write_line(line)
