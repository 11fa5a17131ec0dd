"""A motor twice: as its quartic, and as the spline fitted to a flux map computed from it.

Needs no closed loop, which is compiled when it is imported.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from model import energy, spline_energy
from model.fluxmap import FluxMap
from model.mapped import ALPHAS, MappedMotor
from model.parameters import Drive, Motor


def twin(drive: Drive) -> Drive:
    """Return the drive with its quartic replaced by the spline fitted to a map of it, up to 2.7 x
    rated current."""
    motor, i = drive.motor, np.linspace(-2.7, 2.7, 33) * drive.motor.rated_current
    d, q = energy.flux_from_current(motor.energy, *np.meshgrid(i, i, indexing="ij"))
    points = FluxMap(motor.name, i, i, d + motor.magnet_flux, q).points()
    spline, magnet = spline_energy.centred(spline_energy.fit(*points, (14, 12), 1e-6))
    values = {f.name: getattr(motor, f.name) for f in dataclasses.fields(Motor)} | dict.fromkeys(
        ALPHAS, 0.0
    )
    values |= {
        "inductance_d": 1 / spline.gamma_d,
        "inductance_q": 1 / spline.gamma_q,
        "magnet_flux": magnet,
    }
    return dataclasses.replace(drive, motor=MappedMotor(**values, map_hash="twin", spline=spline))
