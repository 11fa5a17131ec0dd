"""What a sweep's figure draws: of each group the share of drives below each error."""

import numpy as np

from sandbox.evaluation.sweep.curves import MOST_CURVES, yield_figure
from sandbox.output.plots import colour_of


def test_each_group_is_a_curve_of_its_beliefs_colour():
    """Four drives of which one lost lock: half of them err by 2 degrees at most, and the curve ends
    at 75 %."""
    errors = np.array([4.0, 1.0, np.inf, 2.0])
    figure = yield_figure({"qnull linear": errors, "qnull saturated": errors / 10.0}, "own")
    linear, saturated, share = figure.axes[0].get_lines()
    np.testing.assert_allclose(linear.get_xydata(), [[1.0, 25.0], [2.0, 50.0], [4.0, 75.0]])
    np.testing.assert_allclose(saturated.get_xdata(), [0.1, 0.2, 0.4])
    colours = [colour_of("linear"), colour_of("saturated")]
    assert [line.get_color() for line in (linear, saturated)] == colours
    assert list(share.get_ydata()) == [95.0, 95.0]


def test_no_more_curves_than_can_be_told_apart():
    many = {f"group {k}": np.array([1.0 + k]) for k in range(MOST_CURVES + 3)}
    lines = yield_figure(many, "own").axes[0].get_lines()
    assert [x.get_label() for x in lines[:-1]] == [f"group {k}" for k in range(MOST_CURVES)]
