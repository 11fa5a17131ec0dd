"""Numbers on the command line."""

import pytest

from sandbox.cli.arguments import number


def test_a_decimal_comma_is_named():
    with pytest.raises(ValueError, match=r"'0,5' is no number; write 0\.5, with a point"):
        number("0,5")


@pytest.mark.parametrize("text", ["1,2,3", "a,5", "1_000", "nan,1", ""])
def test_what_is_no_number_gets_no_advice(text):
    with pytest.raises(ValueError, match=r"is no number$"):
        number(text)
