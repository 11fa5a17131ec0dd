"""The paper's first-order formulas, kept as its approximation, with the two misprints corrected.

At rated current they are no small corrections (IPM at 2 A: the relative terms of L_dd exceed 1);
everything else in the project uses `model.energy`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from model.array_types import Array
from model.energy import Energy


def fluxes(m: Energy, i_d: ArrayLike, i_q: ArrayLike) -> tuple[Array, Array]:
    """Return phi_d, phi_q in Wb to first order in the alphas, eqs. (phid), (phiq)."""
    l_d, l_q = 1.0 / m.gamma_d, 1.0 / m.gamma_q
    x, y = l_d * np.asarray(i_d, dtype=float), l_q * np.asarray(i_q, dtype=float)
    i_1 = (
        3 * m.alpha_30 * x**2
        + m.alpha_12 * y**2
        + 4 * m.alpha_40 * x**3
        + 2 * m.alpha_22 * x * y**2
    )
    i_2 = 2 * m.alpha_12 * x * y + 2 * m.alpha_22 * x**2 * y + 4 * m.alpha_04 * y**3
    return x - l_d * i_1, y - l_q * i_2


def inductances(m: Energy, i_d: ArrayLike, i_q: ArrayLike) -> tuple[Array, Array, Array]:
    """Return L_dd, L_dq, L_qq in H to first order in the alphas.

    The paper prints L_dd and L_qq with one factor L_d (L_q) missing in each correction, which is
    dimensionally wrong; these are the derivatives of its own fluxes (tests/model/test_energy.py
    shows both).
    """
    l_d, l_q = 1.0 / m.gamma_d, 1.0 / m.gamma_q
    x, y = l_d * np.asarray(i_d, dtype=float), l_q * np.asarray(i_q, dtype=float)
    dd = l_d * (1 - l_d * (6 * m.alpha_30 * x + 12 * m.alpha_40 * x**2 + 2 * m.alpha_22 * y**2))
    dq = -2 * l_d * l_q * y * (m.alpha_12 + 2 * m.alpha_22 * x)
    qq = l_q * (1 - l_q * (2 * m.alpha_12 * x + 2 * m.alpha_22 * x**2 + 12 * m.alpha_04 * y**2))
    return dd, dq, qq
