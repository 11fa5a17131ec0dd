"""Numbers of the switched bench from an effect's values: the shaft's spring and damper against
their eigenvalues."""

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.switched.bench_numbers import bench


def test_a_compliant_shaft_swings_with_its_resonance_and_its_damping_ratio():
    """Twist, speed of the rotor and of the load: d twist = w - w_l, J_m dw = -K twist - D
    (w - w_l), the load the other way; the swing's eigenvalues are of size sqrt(K (1/J_m + 1/J_l)),
    and -zeta of that is their real part."""
    drive = load_drive("ipm")
    own = {
        "shaft_compliance.stiffness": 50.0,
        "shaft_compliance.load_inertia": 4e-4,
        "shaft_compliance.damping_ratio": 0.03,
    }
    b = bench(drive.motor, drive.converter, own)
    k, d, m, load = b.stiffness, b.damping, b.inertia, b.load_inertia
    assert (k, load) == (50.0, 4e-4)
    assert m + load == pytest.approx(drive.motor.inertia)  # all of the shaft's
    swing = np.linalg.eigvals(
        [[0.0, 1.0, -1.0], [-k / m, -d / m, d / m], [k / load, d / load, -d / load]]
    )
    swing = swing[np.argmax(swing.imag)]
    assert abs(swing) == pytest.approx(np.sqrt(k * (1.0 / m + 1.0 / load)))
    assert -swing.real / abs(swing) == pytest.approx(0.03)
