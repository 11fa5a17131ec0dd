"""Sixth harmonic of the magnet flux in the rotor frame (5th and 7th of the back-EMF)."""

from __future__ import annotations

from model.compiled import inlined
from model.effects.card import At, Effect, Parameter
from model.frames import sixth


@inlined
def harmonic(psi_d6, psi_q6, c, s):
    """Return the harmonic part of the magnet flux (Wb) and its slope (Wb/rad) at cos, sin of the angle."""
    c_6, s_6 = sixth(c, s)
    d, q = flux(psi_d6, psi_q6, c_6, s_6)
    t_d, t_q = slope(psi_d6, psi_q6, c_6, s_6)
    return d, q, t_d, t_q


@inlined
def flux(psi_d6, psi_q6, cos_6, sin_6):
    """Return the harmonic part of the magnet flux (Wb) in the rotor frame."""
    return psi_d6 * cos_6, psi_q6 * sin_6


@inlined
def slope(psi_d6, psi_q6, cos_6, sin_6):
    """Return its derivative by the angle, Wb/rad."""
    return -6.0 * psi_d6 * sin_6, 6.0 * psi_q6 * cos_6


CARD = Effect(
    name="flux_harmonics",
    summary="sixth harmonic of the magnet flux in the rotor frame (5th and 7th of the back-EMF)",
    subsystem="machine",
    equation=("psi_d = phi_m + psi_d6 cos 6 theta, psi_q = psi_q6 sin 6 theta; torque -3/2 p dH/dtheta included"),
    source=(
        "Chapman, Sudhoff, Whitcomb, Multiple reference frame analysis of non-sinusoidal brushless DC "
        "drives, IEEE Trans. Energy Conversion 14 (1999) 440; torque from the energy H(phi, theta)"
    ),
    parameters=(
        Parameter("psi_d6", "Wb", 0.0, -1e2, 1e2, 0.01, "magnet flux"),
        Parameter("psi_q6", "Wb", 0.0, -1e2, 1e2, 0.006, "magnet flux"),
    ),
    axis="d and q",
    order="6",
    region="voltage grows with speed; also at zero current",
    confused_with=("inductance_harmonics", "dead_time", "cogging_torque"),
    separated_by="driven rotor at zero current: 5th and 7th of the back-EMF proportional to speed",
    at=(At("magnets", harmonic, ("psi_d6", "psi_q6")),),
)
