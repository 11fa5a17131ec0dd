"""Levels of a staircase, intervals of a fit."""

from types import SimpleNamespace

import numpy as np
import pytest

from model.errors import BadInput
from model.levels import Fit, require_information


def test_an_interval_is_two_standard_deviations_wide_on_either_side():
    fit = SimpleNamespace(values={"resistance": 3.0}, sd={"resistance": 0.1})
    assert Fit.ci95(fit, "resistance") == pytest.approx((3.0 - 0.1959964, 3.0 + 0.1959964))


@pytest.mark.parametrize(
    ("levels", "said"),
    [
        ((0.0, 0.7, 10.0), "at least three"),  # 0.7 A is no level of its own beside 0
        ((-0.7, 3.0, 10.0), "no level at negative"),
        ((-10.0, 3.0, 0.7), "no level at|at least three"),
    ],
)
def test_levels_of_a_staircase_lie_eight_hundredths_of_the_largest_current_apart(levels, said):
    """Of 10 A: 0.8 A."""
    current = np.column_stack([levels, np.zeros(3)])
    with pytest.raises(BadInput, match=said):
        require_information(SimpleNamespace(current=current, pick=lambda axis, bias: np.arange(3)))
