"""What tests take is kept by file, and says which are slow."""

import json

from tests import durations


def test_what_ran_replaces_what_was_known_of_its_file_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(durations, "KEPT", tmp_path / "kept.json")
    durations.store({"a.py::one": 3.04, "a.py::two": 0.1, "b.py::three": 9.0}, ["a.py", "b.py"])
    assert durations.read() == {"a.py::one": 3.0, "b.py::three": 9.0}
    durations.store({"a.py::two": 5.0}, ["a.py"])
    assert durations.read() == {"a.py::two": 5.0, "b.py::three": 9.0}
    # of a whole file, until it is measured
    (tmp_path / "kept.json").write_text(json.dumps({"c.py": 60.0}))
    assert durations.is_slow("c.py::any", durations.read())
    durations.store({"c.py::any": 0.1, "c.py::more": durations.SLOW}, ["c.py"])
    assert [durations.is_slow(f"c.py::{n}", durations.read()) for n in ("any", "more", "new")] == [
        False,
        True,
        False,
    ]


def test_parameters_of_a_test_count_together():
    assert (
        durations.test_of("tests/model/test_energy.py::test_it[2-x]")
        == "model/test_energy.py::test_it"
    )
    assert durations.by_file({"a.py::one": 1.0, "a.py::two": 2.0, "b.py::one": 4.0}) == {
        "a.py": 3.0,
        "b.py": 4.0,
    }


def test_entries_name_files_that_are_there():
    assert all((durations.HERE / durations.file_of(test)).is_file() for test in durations.read())


def test_a_file_whose_tests_were_measured_has_no_entry_of_its_own():
    """It would mark all its quick tests as slow, as these are not kept."""
    known = durations.read()
    assert not {durations.file_of(test) for test in known if "::" in test} & set(known)
