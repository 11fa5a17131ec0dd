"""What was not run is said: the summary names each missing thing, how many tests it cost, and
where."""

from types import SimpleNamespace

from tests.conftest import skipped_lines


def test_skips_are_grouped_by_reason():
    def skip(node, why):
        return SimpleNamespace(nodeid=node, longrepr=("file.py", 3, f"Skipped: {why}"))

    reports = [
        skip("a.py::x", "no data"),
        skip("a.py::y", "no data"),
        skip("b.py::z", "no data"),
        skip("b.py", "mdf"),
    ]
    assert skipped_lines(reports) == [
        "1 not run, mdf: b.py (1)",
        "3 not run, no data: a.py (2), b.py (1)",
    ]
