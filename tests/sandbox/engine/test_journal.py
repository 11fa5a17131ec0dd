"""The journal of a long run: what is whole counts, nothing else; the code it hangs on."""

from sandbox.engine import journal
from sandbox.engine.journal import Journal


def test_half_and_changed_lines_count_as_not_written(tmp_path):
    path = tmp_path / "new" / "journal.jsonl"
    kept = Journal(path)
    kept.add("a", {"x": 1})
    kept.add("b", [1.5, None])
    kept.add("mine", 3, lasting=False)
    assert Journal(path).entries == {"a": {"x": 1}, "b": [1.5, None]}
    with path.open("ab") as file:
        file.write(b'0123 ["c", {"x"')  # as an interruption leaves it
    after = Journal(path)
    after.add("a", {"x": 2})
    assert Journal(path).entries == {"a": {"x": 2}, "b": [1.5, None]}
    path.write_bytes(path.read_bytes().replace(b"1.5", b"2.5"))
    assert Journal(path).entries == {"a": {"x": 2}}


def test_what_is_no_journal_holds_nothing(tmp_path):
    for number, text in enumerate((b"", b"\xff\0\n\n", b'{"schema": 1}', b"a b c")):
        path = tmp_path / str(number)
        path.write_bytes(text)
        assert Journal(path).entries == {}
    assert Journal(tmp_path / "nowhere").entries == {}
    assert Journal(None).entries == {}


def test_effects_of_the_user_s_own_are_part_of_the_code(tmp_path, monkeypatch):
    mine, found = tmp_path / "mine.py", []
    monkeypatch.setenv(journal.own.VARIABLE, str(mine))
    for text in ("x = 1", "x = 2", "x = 1"):
        mine.write_text(text)
        journal.state_of_code.cache_clear()
        found.append(journal.state_of_code("model/frames.py"))
    journal.state_of_code.cache_clear()
    assert found[0] == found[2] != found[1]
    assert journal.state_of_code("model/energy.py") != journal.state_of_code("model/frames.py")
