"""A measured linear axis whose authors published its four numbers: the EMPS benchmark
(electro-mechanical positioning system; Janot, Gautier, Brunot 2019, 1 kHz), with metres for
radians."""

import numpy as np
import pytest
import scipy.io

from sandbox.gap.motion.judging import judge
from sandbox.recordings.motion_log import MotionCampaign, MotionRecording
from tests.data import real_data

PUBLISHED = {
    "inertia": 95.11,
    "viscous": 203.5,
    "dry": 20.39,
    "offset": 3.16,
}  # kg, N s/m, N, N (its sign: of the axis)


def test_the_published_numbers_come_out_and_nothing_else():
    """Within 5 %: what was asked for, not derived; ours are 0.3, 3.5, 4.1 and 2.4 % off."""
    file = real_data() / "emps" / "DATA_EMPS.mat"
    if not file.is_file():
        pytest.skip(f"no file '{file}'")
    data = {k: np.ravel(v) for k, v in scipy.io.loadmat(file).items() if not k.startswith("_")}
    push = data["vir"] * data["gtau"][0]
    run = MotionRecording("emps", data["t"], data["qm"], push, np.zeros(len(push)))
    told = judge(MotionCampaign("emps", 1.0, None, 0.0, {}, None, 0.0, (run,), (), "no voltages"))
    assert set(told.best.effects) == {"coulomb_friction", "viscous_friction"}
    assert told.best.shaft.terms.orders == ()
    for name, value in PUBLISHED.items():
        assert told.best.shaft.value(name) == pytest.approx(value, rel=0.05), name
