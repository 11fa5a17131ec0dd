"""A machine whose flux map is a formula: what is read from its map is compared with it."""

import numpy as np


def machine(i_d, i_q):
    """Fluxes (Wb) of a saturating machine, gradients of the co-energy (J, A)

    0.1 d + 2e-3 d^2 + 4 ln(1 + 1e-3 q^2) - 1e-5 d q^2 / (1 + 0.01 q^2): reciprocal, even in q,
    convex here.
    """
    square = np.asarray(i_q) ** 2
    psi_d = 0.1 + 4e-3 * i_d - 1e-5 * square / (1.0 + 0.01 * square)
    return psi_d, 8e-3 * i_q / (1.0 + 1e-3 * square) - 2e-5 * i_d * i_q / (1.0 + 0.01 * square) ** 2
