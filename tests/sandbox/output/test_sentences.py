"""How sentences begin and end."""

from sandbox.output.sentences import capital, stopped


def test_a_sentence_begins_with_a_capital_and_ends_once():
    assert capital("dead time of 2 us") == "Dead time of 2 us"
    assert capital("L_d is off") == "L_d is off"
    assert capital("") == ""
    assert [stopped(x) for x in ("no gap", "no gap.", "Left?")] == ["no gap.", "no gap.", "Left?"]
