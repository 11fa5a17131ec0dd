"""A machine whose flux map is a formula: what is read from its map is compared with it."""

import numpy as np

from model.drive_files import load_drive
from model.energy import flux_from_current
from model.fluxmap import FluxMap, write_map


def machine(i_d, i_q):
    """Fluxes (Wb) of a saturating machine, gradients of the co-energy (J, A)

    0.1 d + 2e-3 d^2 + 4 ln(1 + 1e-3 q^2) - 1e-5 d q^2 / (1 + 0.01 q^2): reciprocal, even in q,
    convex here.
    """
    square = np.asarray(i_q) ** 2
    psi_d = 0.1 + 4e-3 * i_d - 1e-5 * square / (1.0 + 0.01 * square)
    return psi_d, 8e-3 * i_q / (1.0 + 1e-3 * square) - 2e-5 * i_d * i_q / (1.0 + 0.01 * square) ** 2


def write_square(path):
    """Write the map of the drive `ipm_exchanged`: 17 x 17 points, 0.4 A apart, up to 3.2 A."""
    motor, i = load_drive("ipm_exchanged").motor, np.linspace(-3.2, 3.2, 17)
    d, q = flux_from_current(motor.energy, *np.meshgrid(i, i, indexing="ij"))
    write_map(path, FluxMap("mine", i, i, d + motor.magnet_flux, q))
