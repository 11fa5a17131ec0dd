"""No constant of the diagnosis without a test that notices another number, a measurement, or a reason."""

import pytest

from experiments import constants_tried as ct

SOURCE = b"""A, B = 1.5, (0, 2)  # caf\xc3\xa9
C: int = 1
DRAWS = 400
d = 4.0
E = {"x": 0.0, "y": -3.0}
"""
CHANGES = [
    ("C", 0, "1", "2"), ("DRAWS", 0, "400", "200"), ("DRAWS", 0, "400", "600"),
    ("E", 1, "3.0", "1.5"), ("E", 1, "3.0", "4.5"), ("A", 0, "1.5", "0.75"), ("A", 0, "1.5", "2.25"),
    ("B", 1, "2", "1"), ("B", 1, "2", "3"),
]  # fmt: skip


def test_every_number_of_every_constant_is_changed_both_ways():
    """Alone or assigned together, inside lists; zero is half of nothing; small names are no constants."""
    found = dict(ct._of("f.py", SOURCE))
    assert [tuple(n)[1:] for n in found] == CHANGES
    for number, m in found.items():
        assert m.applied(SOURCE) == SOURCE[: m.begin] + number.new.encode() + SOURCE[m.end :]


def test_every_number_is_noticed_or_has_a_reason():
    left = ct.unexplained()
    assert not left, (
        f"{[' '.join(map(str, n)) for n in left[:5]]}: run python -m experiments.constants_tried, "
        "then give what it does not notice a test, or a reason in constants_tried.toml"
    )


def test_the_tests_that_noticed_are_there():
    there = ct.answers()
    for number in ct.numbers():
        if number in there and "::" in (noticed := there[number].noticed):
            assert ct.is_there(noticed), number


def test_first_are_tried_the_tests_that_know_the_constant():
    """Those of its other numbers, each once; none that is gone."""
    mine = [ct.Number("f.py", "A", k, "2.0", new) for k, new in ((0, "1.0"), (0, "3.0"), (1, "1.0"), (1, "3.0"))]
    told = ["tests/experiments/test_constants_tried.py::test_first_are_tried_the_tests_that_know_the_constant[x]"] * 2
    there = {n: ct.Tried(n, t, "") for n, t in zip(mine, [*told, "tests/gone.py::test_x", ""], strict=True)}
    assert ct.known(mine[3], there) == (told[0].removesuffix("[x]"),)
    assert ct.known(mine[3]._replace(constant="B"), there) == ()


@pytest.mark.parametrize("entry", ct.REASONS, ids=lambda e: f"{e['file']} {e['constant']}")
def test_reasons_speak_of_what_is_there(entry):
    own = [n for n in ct.numbers() if n[:2] == (ct.GAP + entry["file"], entry["constant"])]
    assert own
    assert set(entry.get("numbers", [])) <= {n.old for n in own}
    assert entry["why"]


def test_the_page_follows_from_the_answers():
    assert (ct.RESULTS / "constants_tried.md").read_text(encoding="utf-8") == "\n".join(ct.page(ct.answers())) + "\n"
