"""How long tests take, kept in durations.json: which are slow (the marker), and which files come
first in a whole run.

Seconds of CPU, those of a test's own processes included, so that a loaded machine changes little.
Written by

    pytest --store-durations tests/some/folder

for the files that ran; tests below LEAST are left out.  A test is one function, all its parameters
together; an entry of a file alone holds until its tests have been measured.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

HERE = Path(__file__).resolve().parent
KEPT = HERE / "durations.json"
LEAST = 0.5  # s
SLOW = 2.0  # s: what is left without these tests takes three minutes on two cores


def used() -> float:
    """Return the seconds of CPU that this process and those it waited for have taken."""
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system


def test_of(node: str) -> str:
    """Return a test's function, without its parameters, below the tests' folder."""
    return node.partition("[")[0].removeprefix("tests/")


def file_of(test: str) -> str:
    """Return a test's file."""
    return test.partition("::")[0]


def read() -> dict[str, float]:
    """Return the seconds of every test that takes LEAST and more."""
    return dict(json.loads(KEPT.read_text(encoding="utf-8"))) if KEPT.is_file() else {}


def store(seconds: dict[str, float], files: Iterable[str]) -> None:
    """Keep what tests took in place of all that was known of these files."""
    known = {test: s for test, s in read().items() if file_of(test) not in set(files)}
    found = known | {test: round(s, 1) for test, s in seconds.items() if s >= LEAST}
    KEPT.write_text(json.dumps(dict(sorted(found.items())), indent=0) + "\n", encoding="utf-8")


def is_slow(test: str, seconds: dict[str, float]) -> bool:
    """Return whether a test takes SLOW and more, or its file where nobody knows which of its tests
    do."""
    return seconds.get(test, seconds.get(file_of(test), 0.0)) >= SLOW


def by_file(seconds: dict[str, float]) -> Counter[str]:
    """Return the seconds of each file."""
    found: Counter[str] = Counter()
    for test, s in seconds.items():
        found[file_of(test)] += s  # type: ignore[assignment]
    return found
