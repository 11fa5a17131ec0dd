"""Numbers on the command line."""

import pytest

from sandbox.cli.arguments import number, positive_int, seed_number


def test_a_decimal_comma_is_named():
    with pytest.raises(ValueError, match=r"'0,5' is no number; write 0\.5, with a point"):
        number("0,5")


@pytest.mark.parametrize("text", ["1,2,3", "a,5", "1_000", "nan,1", ""])
def test_what_is_no_number_gets_no_advice(text):
    with pytest.raises(ValueError, match=r"is no number$"):
        number(text)


def test_whole_numbers_are_taken_as_they_stand():
    assert positive_int("250") == 250
    assert seed_number("0") == 0
    assert seed_number("123456789012345678") == 123456789012345678
    for text in ("0", "-1", "1.0", "²", "1e3", ""):
        with pytest.raises(ValueError, match="whole number of at least 1"):
            positive_int(text)
    with pytest.raises(ValueError, match="at most 18 digits"):
        seed_number("1234567890123456789")
