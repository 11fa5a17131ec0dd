"""What is drawn of readings: largest values of intervals, and the interval that is worst."""

import numpy as np

from sandbox.gap.pages.signals import peaks, worst_stretch


def test_the_largest_value_of_each_interval_is_drawn_with_its_sign():
    assert peaks(np.array([1.0, -3.0, 2.0, 0.5, 0.0, -0.1, 9.0]), 3) == [-3.0, 0.5]
    assert peaks(np.array([1.0, -2.0]), 1) == [1.0, -2.0]


def test_the_worst_interval_holds_most_squares():
    residual = np.zeros((10, 3))
    residual[6], residual[7, 1] = 1.0, -2.0
    assert worst_stretch(residual, 2) == (6, 8)
    assert worst_stretch(residual, 50) == (0, 10)
