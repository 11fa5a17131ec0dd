"""By how much the plant's error falls when its steps double."""

import dataclasses

import numpy as np
import pytest

from sandbox.replay.replay import replay
from tests.sandbox.plant.stated_duties import DRIVE, apart, duties, finer, from_duties, turning

LINEAR = dataclasses.replace(
    DRIVE,
    motor=dataclasses.replace(
        DRIVE.motor, **dict.fromkeys([f"alpha_{n}" for n in ("30", "12", "40", "22", "04")], 0.0)
    ),
)
# of at most a sixteenth, ... of a period: nearly all segments halve, not only those between edges
STEPS = (8, 16, 32)


def errors(drive, values, speed, size=0.25):
    """Return the rms differences from 256 steps a period over rated current."""
    duty = duties(40, speed, size, drive)
    prepared = from_duties(drive, duty, *turning(40, speed, drive))
    best = replay(finer(prepared, 256), [values]).currents[0][:, :, 0]
    return [
        apart(drive, replay(finer(prepared, n), [values]).currents[0][:, :, 0], best) for n in STEPS
    ]


@pytest.mark.parametrize(
    ("drive", "values", "speed", "order"),
    [
        (LINEAR, {}, 0.0, 2.8),  # constant inverse inductances: third order
        # beside R the drop is that of the middle alone
        (LINEAR, {"winding_asymmetry.delta_a": 0.5}, 0.0, 1.5),
        # inverse inductances of the period's start: second order in the end, of small size
        (DRIVE, {}, 0.0, 1.5),
        (DRIVE, {}, 600.0, 1.5),
        (DRIVE, {"iron_loss.core_resistance": 2e3}, 600.0, 1.5),
        (DRIVE, {"skin_effect.resistance": 4.0}, 600.0, 1.5),
        (DRIVE, {"inductance_harmonics.gamma_6": 1.5}, 600.0, 1.5),
        (DRIVE, {"flux_harmonics.psi_d6": 0.005}, 600.0, 1.5),
        (DRIVE, {"current_filter.time_constant": 3e-5, "current_sampling.delay": 6e-5}, 600.0, 1.5),
        (DRIVE, {"dead_time.time": 2e-6, "bench.soft_current": 0.6}, 600.0, 1.5),
    ],
)
def test_order(drive, values, speed, order):
    found = errors(drive, values, speed)
    print(values, speed, [f"{x:.1e}" for x in found], np.log2(np.array(found[:-1]) / found[1:]))
    assert found[0] < 3e-6  # ... and at eight steps nothing is left that matters
    assert np.log2(found[0] / found[-1]) / (len(STEPS) - 1) > order
