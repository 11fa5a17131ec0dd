"""A flux map's file that holds its energy: read back to the last digit, and refused where its
points are others."""

import io

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import flux_from_current as exact
from model.errors import BadInput
from model.fluxmap import FluxMap
from model.map_energy import energy_file, with_stiffness
from model.mapped import mapped_motor
from model.spline_energy import centred, fit, flux_from_current

MOTOR = {
    "name": "own",
    "pole_pairs": 3,
    "resistance": 2.15,
    "inertia": 1e-3,
    "viscous_friction": 1e-4,
    "rated_current": 4.0,
    "rated_torque": 5.0,
    "rated_speed_rpm": 1500.0,
}
CHOICE = (6, 5), 1e-4


@pytest.fixture(scope="module")
def whole():
    motor, i = load_drive("ipm_exchanged").motor, np.linspace(-2.0, 2.0, 15)
    d, q = exact(motor.energy, *np.meshgrid(i, i, indexing="ij"))
    m = FluxMap("ipm", i, i, d + motor.magnet_flux, q)
    e, magnet = centred(fit(*m.points(), *CHOICE))
    x, y = (a.ravel() for a in np.meshgrid(m.i_d, m.i_q, indexing="ij"))
    return with_stiffness(e), magnet, energy_file(e, magnet, CHOICE, x, y)


def test_a_motor_has_the_energy_of_the_file(whole, tmp_path):
    e, magnet, body = whole
    (tmp_path / "map.npz").write_bytes(body)
    motor = mapped_motor(MOTOR, {"file": "map.npz"}, tmp_path)
    assert np.array_equal(motor.spline.cells, e.cells)
    assert motor.spline[1:] == pytest.approx(e[1:], rel=1e-12)
    assert motor.magnet_flux == magnet
    again = mapped_motor(MOTOR, {"file": "map.npz"}, tmp_path)  # from where fits are kept
    assert np.array_equal(again.spline.cells, e.cells)


def test_other_programs_read_its_points(whole, tmp_path):
    e, magnet, body = whole
    (tmp_path / "map.npz").write_bytes(body)
    own = np.load(tmp_path / "map.npz")
    d, q = flux_from_current(e, own["i_d"][:7], own["i_q"][:7])
    np.testing.assert_allclose(own["psi_d"][:7], d + magnet, atol=1e-12)
    np.testing.assert_allclose(own["psi_q"][:7], q, atol=1e-12)


def test_cells_that_are_stated_fit_the_points_anew(whole, tmp_path):
    (tmp_path / "map.npz").write_bytes(whole[2])
    motor = mapped_motor(MOTOR, {"file": "map.npz", "cells": [5, 4], "smooth": 1e-3}, tmp_path)
    assert motor.spline.cells.shape[:2] == (5, 8)


@pytest.mark.parametrize("turned", [{"magnet": "q"}, {"angle": 0.1}])
def test_a_frame_that_is_not_the_energys_is_refused(whole, tmp_path, turned):
    (tmp_path / "map.npz").write_bytes(whole[2])
    with pytest.raises(BadInput, match="apart from its points'; remove 'energy'"):
        mapped_motor(MOTOR, {"file": "map.npz", **turned}, tmp_path)


@pytest.mark.parametrize(("name", "value"), [("psi_q", 1.01), ("energy", 1.01)])
def test_points_of_another_map_are_refused(whole, tmp_path, name, value):
    arrays = dict(np.load(io.BytesIO(whole[2])))
    np.savez(tmp_path / "map.npz", **(arrays | {name: value * arrays[name]}))
    with pytest.raises(BadInput, match=r"gives currents .* A apart"):
        mapped_motor(MOTOR, {"file": "map.npz"}, tmp_path)


@pytest.mark.parametrize(("place", "value"), [(2, 0.0), (5, 0.0), (6, 1e9), (7, -1.0), (0, np.nan)])
def test_scales_that_no_fit_has_are_refused(whole, tmp_path, place, value):
    arrays = dict(np.load(io.BytesIO(whole[2])))
    arrays["energy_scales"][place] = value
    np.savez(tmp_path / "map.npz", **arrays)
    with pytest.raises(BadInput, match="no energy of a flux map; remove 'energy'"):
        mapped_motor(MOTOR, {"file": "map.npz"}, tmp_path)


def test_an_energy_of_another_shape_is_refused(whole, tmp_path):
    arrays = dict(np.load(io.BytesIO(whole[2])))
    np.savez(tmp_path / "map.npz", **(arrays | {"energy": arrays["energy"][:, :, :9]}))
    with pytest.raises(BadInput, match=r"has shape .* no energy of a flux map"):
        mapped_motor(MOTOR, {"file": "map.npz"}, tmp_path)
