"""A quartic energy as the one cell of a flux map."""

import numpy as np

from model.spline import SplineEnergy


def one_cell(m, low, high):
    """Return a quartic energy as the one cell of a map on [low, high]^2 Wb: its polynomial shifted
    and scaled."""
    from numpy.polynomial import polynomial as P

    side = high - low
    terms = {
        (2, 0): 0.5 * m.gamma_d,
        (0, 2): 0.5 * m.gamma_q,
        (3, 0): m.alpha_30,
        (1, 2): m.alpha_12,
    }
    terms |= {(4, 0): m.alpha_40, (2, 2): m.alpha_22, (0, 4): m.alpha_04}
    cell = np.zeros((5, 5))
    for (a, b), value in terms.items():
        x, y = P.polypow([low, side], a), P.polypow([low, side], b)
        cell[: a + 1, : b + 1] += value * np.outer(x, y)
    return SplineEnergy(cell[None, None], low, low, 1.0 / side, 1.0 / side, m.gamma_d, m.gamma_q)
