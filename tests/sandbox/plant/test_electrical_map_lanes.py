"""Currents and inductances of many lanes on a flux map: in one cell as in several, lane by lane
those of the map."""

from __future__ import annotations

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import currents as of_energy
from model.spline import currents, hessian
from model.spline_energy import fit
from sandbox.plant.batch import blank
from sandbox.plant.electrical import mapped, stiffen


@pytest.fixture(scope="module")
def spline():
    """A spline of the saturated quartic motor, cells of some 0.03 Wb."""
    energy = load_drive("ipm").motor.energy
    d, q = np.meshgrid(np.linspace(-0.3, 0.3, 31), np.linspace(-0.3, 0.3, 31), indexing="ij")
    return fit(d.ravel(), q.ravel(), *(x.ravel() for x in of_energy(energy, d, q)), (20, 20))


@pytest.mark.parametrize("lanes", [1, 8, 24])
@pytest.mark.parametrize("spread", [1e-6, 0.2])
def test_lanes_have_the_map_s_currents_and_inductances(spline, lanes, spread):
    """spread: Wb, within a cell and over some twelve; the rotor at 0.3 rad, no magnet: the
    stationary flux turned."""
    rng = np.random.default_rng(lanes)
    w = blank(lanes)
    d, q = (
        0.041 + spread * rng.uniform(-0.5, 0.5, lanes),
        0.023 + spread * rng.uniform(-0.5, 0.5, lanes),
    )
    d[0] += 0.4 * (spread > 0.1)  # the first lane outside the map
    w["z_d"], w["z_q"] = d, q
    # beside the map's: currents and inductances add up
    w["gamma_d"], w["gamma_q"], w["off_c"] = 2.0, 3.0, 1.0
    mapped(w, spline)
    found = np.array([currents(spline, *z) for z in zip(d, q, strict=True)])
    np.testing.assert_allclose(w["i_d"], found[:, 0] + 2.0 * d, rtol=1e-12)
    np.testing.assert_allclose(w["i_q"], found[:, 1] + 3.0 * q, rtol=1e-12)
    c, s = np.cos(0.3), np.sin(0.3)
    w["psi_alpha"], w["psi_beta"] = c * d - s * q, s * d + c * q
    stiffen(w, spline, c, s)
    turn = np.array([[c, -s], [s, c]])
    for j in range(lanes):
        dd, dq, qq = hessian(spline, d[j], q[j])
        own = turn @ np.array([[dd + 2.0, dq], [dq, qq + 3.0]]) @ turn.T
        got = [[w["stiff_aa"][j], w["stiff_ab"][j]], [w["stiff_ab"][j], w["stiff_bb"][j]]]
        np.testing.assert_allclose(got, own, rtol=1e-11)
