"""The menu of recordings on motors whose flux map ends: no current beyond it, and as it was on
others."""

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import SOLVED, flux_newton
from model.map_points import read_points
from sandbox.gap.planning.in_map import furthest_d, held
from sandbox.gap.planning.menu import HALF_WAVE, demand, menu
from tests.data import real_data

TOML = """
[motor]
pole_pairs = 2
resistance = 0.63
inertia = 0.05
rated_current = 12.4
rated_torque = 29.7
rated_speed_rpm = 1800.0
[flux_map]
file = "half.csv"
cells = [10, 8]
smooth = 1e-3
[drive]
sampling_period = 0.000125
dc_bus_voltage = 540.0
"""


@pytest.fixture(scope="module")
def half(tmp_path_factory):
    """Baldor's measured map cut to i_d <= 0, i_q >= 0, as finite elements usually give it."""
    p = read_points(real_data() / "baldor_pmsyrm" / "baldor_meas.npz")
    kept = (p.i_d <= 0.0) & (p.i_q >= 0.0)
    rows = np.stack([x[kept] for x in (p.i_d, p.i_q, p.psi_d, p.psi_q)], axis=1)
    folder = tmp_path_factory.mktemp("half")
    np.savetxt(folder / "half.csv", rows, delimiter=",", header="i_d,i_q,psi_d,psi_q", comments="")
    (folder / "half.toml").write_text(TOML)
    return load_drive(folder / "half.toml")


def test_every_experiment_s_currents_lie_in_the_map(half):
    energy, swing = half.motor.energy, HALF_WAVE * half.converter.sampling_period
    entries = menu(half, 0.1)
    # where the map has room
    assert any(float(e.i_d.min()) < -0.5 * half.motor.rated_current for e in entries)
    for e in entries:
        for i_d, i_q in {
            (round(a, 6), round(b, 6)) for a, b in zip(e.i_d[::40], e.i_q[::40], strict=True)
        }:
            d, q, status = flux_newton(energy, i_d, i_q, 0.0, 0.0)
            assert status == SOLVED, (e.name, i_d, i_q)
            for side in (-1.0, 1.0):  # a whole half period of the injection to either side
                x = (d + side * swing * e.injection[0] - energy.low_d) * energy.per_d
                y = (q + side * swing * e.injection[1] - energy.low_q) * energy.per_q
                # always asked for, though this map ends there and an injection goes beyond
                no_current = i_d == 0.0
                assert no_current or -1e-6 <= x <= energy.cells.shape[0] + 1e-6
                assert -1e-6 <= y <= energy.cells.shape[1] + 1e-6
        if e.rotor != "free":
            assert all(np.isfinite(x).all() for x in demand(e, half, lambda torque: torque))


def test_motors_whose_model_has_room_keep_the_menu():
    drive = load_drive("ipm_exchanged")
    for e in menu(drive, 0.05):
        i_d, i_q = held(e.i_d, e.i_q, drive.motor.energy, (1.0, 1.0))
        assert i_d is e.i_d
        assert i_q is e.i_q
    rated = drive.motor.rated_current
    assert furthest_d(drive.motor.energy, 0.4 * rated) == 0.4 * rated
    wide = load_drive("baldor_pmsyrm")  # 20 A each way, rated 12.4 A
    for e in menu(wide, 0.05):
        i_d, i_q = held(0.5 * e.i_d, 0.5 * e.i_q, wide.motor.energy, (0.0, 0.0))
        np.testing.assert_array_equal(i_d, 0.5 * e.i_d)
        np.testing.assert_array_equal(i_q, 0.5 * e.i_q)


def test_the_largest_current_on_d_is_the_map_s_own(half):
    """Bisection against the edge of the box: the current where psi_d is the largest of the map's
    fit."""
    from model.spline import currents

    e = half.motor.energy
    edge = currents(e, e.low_d + e.cells.shape[0] / e.per_d, 0.0)[0]
    assert furthest_d(e, 5.0) == pytest.approx(edge, rel=1e-4)
