"""A drive with a measured flux map behind it, whose nominal model is the energy identified from it.

The identified energy is the paper's quartic, fitted to the map as far as a campaign's currents go.
It cannot follow the map to the noise floor, so what is true of such a campaign is a saturation that
the library does not hold.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.datasets import VARIABLE, locate
from model.energy import flux_from_current
from model.mapped import ALPHAS, without_map
from model.parameters import Motor

FLUX_MAP = "flux_map"  # what stands in the seal
SUBSYSTEM = "machine"  # where it lies
DATA = "baldor_pmsyrm"
USED = 1.8  # times rated current: where the energy is fitted
POINTS = 31  # a side


def missing() -> str | None:
    """Return why no campaign can be made of the map; None where the data set is there."""
    if locate(DATA) is not None:
        return None
    return (
        f"no campaign with a measured flux map: data set '{DATA}' is not here; set "
        f"{VARIABLE} to a folder that has it"
    )


def identified(motor: Motor) -> Motor:
    """Return a motor whose quartic energy is the least-squares fit of grad H = i over currents up
    to USED."""
    top = USED * motor.rated_current
    i_d, i_q = (x.ravel() for x in np.meshgrid(*2 * [np.linspace(-top, top, POINTS)]))
    inside = np.hypot(i_d, i_q) <= top
    i_d, i_q = i_d[inside], i_q[inside]
    rows_d, rows_q = terms(*flux_from_current(motor.energy, i_d, i_q))
    c, *_ = np.linalg.lstsq(
        np.concatenate([rows_d, rows_q]), np.concatenate([i_d, i_q]), rcond=None
    )
    values = {name: getattr(without_map(motor), name) for name in Motor.__dataclass_fields__}
    values |= {"inductance_d": 1.0 / float(c[0]), "inductance_q": 1.0 / float(c[1])}
    return Motor(**values | dict(zip(ALPHAS, (float(x) for x in c[2:]), strict=True)))


def terms(
    d: NDArray[np.float64], q: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what gamma_d, gamma_q and the five alphas each add to i_d and i_q, eqs. (id), (iq);
    (n, 7) each."""
    o = np.zeros_like(d)
    return (
        np.column_stack([d, o, 3 * d**2, q**2, 4 * d**3, 2 * d * q**2, o]),
        np.column_stack([o, q, o, 2 * d * q, o, 2 * d**2 * q, 4 * q**3]),
    )
