"""Flux maps as nominal models: which drives have one, what their engineer believes of it, and the
file that states it.

A map is misjudged by what the library's effects on the magnetics add to a map, so that the truth
lies within what a diagnosis can fit.  To the energy H of the current-induced fluxes d, q (Wb) are
added

    1/2 (1/L_d' - 1/L_d) d^2 and the same of q   an air gap other than the measured sample's: a current that grows with
                                                 the flux, as steep where the iron saturates as
                                                 where it does not
    alpha_30 d^3 + alpha_12 d q^2 + ...          iron that saturates otherwise

and the magnet's flux is another.  H is of degree 4 in each flux on every cell of a map, so these
terms change its coefficients and nothing else, and a file of two points a cell in each direction
gives the same map when it is read.
"""  # noqa: E501

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from model.array_types import Array
from model.datasets import VARIABLE, locate
from model.energy import currents, flux_from_current, hessian
from model.mapped import ALPHAS, MappedMotor, hash_of
from model.parameters import Motor
from model.spline import DEGREE, SplineEnergy
from model.spline_energy import FLOOR, MARGIN
from sandbox.recordings.writing import StatedMap
from sandbox.withheld.making.mapped_drive import DATA, identified

MAPS = {"mapped": DATA}  # families of drives with a flux map, each with its data set
SHARE = 0.5  # of a mixed check
FILE = "flux_map.csv"
POINTS_A_CELL = 2
# points of a file have no noise: no smoothing to speak of (currents within 1e-5 of rated, a test
# says)
SMOOTH = 1e-6
POWERS = dict(zip(ALPHAS, ((3, 0), (1, 2), (4, 0), (2, 2), (0, 4)), strict=True))  # of d and q
OF_ALPHAS = ("saturation", "cross_saturation")


def map_families() -> tuple[str, ...]:
    """Return the families with a flux map whose data set is on this machine."""
    return tuple(family for family, data in MAPS.items() if locate(data) is not None)


def no_maps() -> str:
    """Return what is missing where no campaign can have a flux map as its nominal model, and how to
    get it."""
    return (
        f"no campaign can have a flux map as its nominal model: data set '{DATA}' is not here; set "
        f"{VARIABLE} to a folder that has it, or load motor '{DATA}' once, which downloads it"
    )


def changed(motor: Motor, values: Mapping[str, float]) -> Motor:
    """Return the motor with some values replaced; alphas of a flux map are those added to it (its
    own are 0)."""
    new: dict[str, Any] = dict(values)
    if not isinstance(motor, MappedMotor):
        return dataclasses.replace(motor, **new)
    terms = {POWERS[name]: new.pop(name) for name in ALPHAS if name in new}
    gamma = {
        axis: 1.0 / float(new.get(f"inductance_{axis}", getattr(motor, f"inductance_{axis}")))
        for axis in "dq"
    }
    own = motor.spline
    terms |= {(2, 0): 0.5 * (gamma["d"] - own.gamma_d), (0, 2): 0.5 * (gamma["q"] - own.gamma_q)}
    spline = with_terms(own, terms)._replace(gamma_d=gamma["d"], gamma_q=gamma["q"])
    return dataclasses.replace(motor, **new, spline=spline, map_hash=hash_of(spline), origin=None)


def with_terms(m: SplineEnergy, terms: Mapping[tuple[int, int], float]) -> SplineEnergy:
    """Return the energy with a polynomial added: terms by the powers of d and q (Wb), each 4 at the
    most."""
    d, q = (
        _powers(low, per, n) for low, per, n in zip(m[1:3], m[3:5], m.cells.shape[:2], strict=True)
    )
    more = sum(size * np.einsum("ia,jb->ijab", d[a], q[b]) for (a, b), size in terms.items())
    return m._replace(cells=np.ascontiguousarray(m.cells + more))


def _powers(low: float, per: float, cells: int) -> Array:
    """Return (power, cell, k): the coefficients by x^k of (low + (cell + x) / per)^power."""
    corner, out = low + np.arange(cells) / per, np.zeros((DEGREE + 1, cells, DEGREE + 1))
    for power in range(DEGREE + 1):
        for k in range(power + 1):
            out[power, :, k] = math.comb(power, k) * corner ** (power - k) / per**k
    return out


def like_map(motor: Motor, effect: str) -> Motor:
    """Return the motor from which an effect's size is drawn: a map's quartic for saturation, else
    the motor itself."""
    return identified(motor) if isinstance(motor, MappedMotor) and effect in OF_ALPHAS else motor


def can_be_stated(stated: MappedMotor, true: Motor, most: float) -> bool:
    """Tell whether a stated map is convex wherever the true motor takes its flux with currents up
    to `most` (A), and as clearly so that a fit to its points, which keeps the least curvature off
    zero, gives it back."""
    angle, size = (
        x.ravel() for x in np.meshgrid(np.linspace(0.0, math.tau, 25), np.linspace(0.0, most, 13))
    )
    d, q = flux_from_current(true.energy, size * np.cos(angle), size * np.sin(angle))
    dd, dq, qq = hessian.py_func(stated.energy, d, q)
    # along the softest direction
    curvature = 0.5 * (dd + qq) - np.sqrt(0.25 * (dd - qq) ** 2 + dq**2)
    return bool(np.min(curvature) > FLOOR * min(stated.spline.gamma_d, stated.spline.gamma_q))


def stated_map(motor: Motor) -> StatedMap | None:
    """Return a motor's flux map as a campaign states it, total fluxes over a grid of them; None
    where it has none."""
    if not isinstance(motor, MappedMotor):
        return None
    m = motor.spline
    cells = m.cells.shape[0], m.cells.shape[1] // 2
    span = cells[0] / m.per_d / (1.0 + 2.0 * MARGIN)  # a fit's box goes beyond its points by MARGIN
    low, high_q = m.low_d + MARGIN * span, -m.low_q / (1.0 + MARGIN)
    along_d = np.linspace(low, low + span, POINTS_A_CELL * cells[0] + 1)
    along_q = np.linspace(-high_q, high_q, POINTS_A_CELL * 2 * cells[1] + 1)
    d, q = (x.ravel() for x in np.meshgrid(along_d, along_q, indexing="ij"))
    rows = zip(*currents.py_func(m, d, q), d + motor.magnet_flux, q, strict=True)
    text = "i_d,i_q,psi_d,psi_q\n" + "".join(
        ",".join(f"{x:.12g}" for x in row) + "\n" for row in rows
    )
    table = {"file": FILE, "magnet": "d", "cells": list(cells), "smooth": SMOOTH}
    return StatedMap(table, text.encode())
