"""A flux map on the switched bench: made from a quartic's own numbers it is that quartic's
bench."""

import cmath

import numpy as np
import pytest

from model.drive_files import load_drive
from model.quartic import currents
from sandbox.switched.advance import replay
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.flux_map import flux_map_of
from sandbox.switched.phase_machine import current_and_torque, least_stiffness, stored_energy
from tests.sandbox.switched.one_cell import one_cell

IPM = load_drive("ipm")
SERIES = ("g_0", "g_2", "c_1", "c_3", "q_0", "q_2", "q_4")  # of the energy
SERIES_BENCH = quiet(bench(IPM.motor, IPM.converter))


MAP_BENCH = SERIES_BENCH._replace(
    flux_map=flux_map_of(one_cell(IPM.motor.energy, -0.4, 0.5)), **dict.fromkeys(SERIES, 0.0)
)


@pytest.mark.parametrize("theta", [0.0, 0.7, -2.9])
def test_current_torque_energy_and_stiffness_are_the_series(theta):
    """The quartic's currents (`model.quartic`), torque 3/2 p Im(psi* i), and the bench's own
    series."""
    phi = complex(0.11, -0.17)
    psi = (phi + IPM.motor.magnet_flux) * cmath.exp(1j * theta)
    i, torque = current_and_torque(MAP_BENCH, psi, theta)
    assert i * cmath.exp(-1j * theta) == pytest.approx(
        complex(*currents(IPM.motor.energy, phi.real, phi.imag))
    )
    assert torque == pytest.approx(1.5 * IPM.motor.pole_pairs * (psi.conjugate() * i).imag)
    assert torque == pytest.approx(current_and_torque(SERIES_BENCH, psi, theta)[1])
    assert stored_energy(MAP_BENCH, psi, theta) == pytest.approx(
        stored_energy(SERIES_BENCH, psi, theta)
    )
    assert least_stiffness(MAP_BENCH, psi, theta) == pytest.approx(
        least_stiffness(SERIES_BENCH, psi, theta)
    )


def test_a_replay_is_the_series_replay():
    k = np.arange(400)
    u = 0.3 * IPM.motor.rated_current * IPM.motor.resistance * np.exp(
        1j * k / 60
    ) + 20.0 * np.where(k % 8 < 4, 1, -1)
    found, known = (
        replay(
            b,
            "locked",
            u.real,
            u.imag,
            IPM.converter.dc_bus_voltage,
            theta=0.3,
            current=(0.2, -0.1),
        )
        for b in (MAP_BENCH, SERIES_BENCH)
    )
    for phase in ("i_a", "i_b", "i_c"):
        assert found[phase] == pytest.approx(known[phase], abs=1e-9)
