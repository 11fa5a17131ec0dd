"""The averaged kernel against the switched bench: sampled currents of a driven motor, rms in rated currents.

Bounds are the figures of sandbox/switched/AVERAGING.md with room of a third; the sensors' noise is 1.7e-3.  What an
average cannot follow: curvature of saturation and rotation over the ripple (7e-5 to 9e-5 without effects), the soft
sign within one period (dead time, device drop), i_c under pulses with a core faster than the edges' spacing.
"""

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.effects import library
from model.parameters import load_drive
from sandbox.scenario import Scenario, Segment
from sandbox.simulate import simulate
from tests.sandbox.averaged import gap

DRIVE = load_drive("ipm")
MANY = {
    "iron_loss.core_resistance": 2e3, "skin_effect.resistance": 3.0, "pwm_delay.delay": 2e-5,
    "winding_asymmetry.delta_a": 0.3, "inductance_harmonics.gamma_6": 0.3, "flux_harmonics.psi_d6": 1e-3,
}  # fmt: skip
CASES = [  # effects, bound at 20 rad/s, at 100 rad/s
    ({}, 9e-5, 1.3e-4),
    ({"pwm_delay.delay": 3e-5}, 7e-5, 5e-5),
    ({"pwm_delay.delay": 9e-5}, 1.0e-4, 8e-5),  # beyond the zero vector: volt-seconds pass to the next period
    ({"current_sampling.delay": 5e-6}, 9e-5, 1.2e-4),
    ({"current_sampling.delay": -5e-6}, 9e-5, 1.2e-4),
    ({"current_filter.time_constant": 5e-6}, 9e-5, 1.1e-4),
    ({"current_filter.time_constant": 3e-5}, 7e-5, 1.8e-4),
    ({"current_filter.time_constant": 1e-4}, 8e-5, 1.9e-4),
    ({"iron_loss.core_resistance": 2e3, "iron_loss.time_constant": 1e-4}, 1.3e-4, 2.6e-4),
    ({"iron_loss.core_resistance": 2e3, "iron_loss.time_constant": 2e-5}, 1.6e-4, 3.8e-4),
    ({"pwm_delay.delay": 2e-5, "current_filter.time_constant": 3e-5}, 9e-5, 3.2e-4),
    ({"current_sampling.delay": -5e-6, "current_filter.time_constant": 3e-5}, 7e-5, 2e-4),
    ({"iron_loss.core_resistance": 2e3, "iron_loss.time_constant": 1e-4, "current_filter.time_constant": 3e-5},
     7e-5, 1.8e-4),
    ({"dead_time.time": 2e-6}, 2.7e-4, 4.5e-4),
    ({"dead_time.time": -1e-6}, 2e-4, 4e-4),  # over-compensated by 2 us the zero crossings feed themselves: 3e-3
    ({"dead_time.time": 2e-6, "pwm_delay.delay": 2e-5}, 2.7e-4, 5e-4),
    ({"device_drop.threshold": 2.0}, 3.4e-4, 3.4e-4),
    ({"dead_time.time": 2e-6, "device_drop.threshold": 1.0}, 4.3e-4, 6.3e-4),
    ({"dead_time.time": 5e-6}, 6e-4, 8e-4),
    ({"dead_time.time": 2e-6, "current_filter.time_constant": 3e-5}, 3e-4, 5.2e-4),
    ({"dead_time.time": 2e-6, "iron_loss.core_resistance": 2e3}, 3.2e-4, 4e-4),
    ({"iron_loss.core_resistance": 2e3, "current_sampling.delay": 1e-5}, 1e-4, 1.6e-4),
    ({"current_sampling.delay": 6e-5}, 2e-4, 4.5e-4),  # beyond the zero vector
    ({"pwm_delay.delay": 9e-5, "current_filter.time_constant": 3e-5}, 1e-4, 5.7e-4),
    ({"dc_link_error.sag": 30.0}, 9e-5, 1.3e-4),
    ({"dc_link_error.sag": 30.0, "dead_time.time": 2e-6, "current_sampling.delay": 1e-5}, 3e-4, 5e-4),
    (MANY, 1.8e-4, 5e-4),
]  # fmt: skip
ELECTRICAL = [n for n in library.effect_names() if library.load_effect(n).subsystem != "mechanics"]


@pytest.mark.parametrize("speed", [20.0, 100.0])
@pytest.mark.parametrize(("effects", "slow", "fast"), CASES, ids=lambda x: str(x) if isinstance(x, dict) else "")
def test_samples_agree(effects, slow, fast, speed):
    assert gap(effects, speed) < (slow if speed == 20.0 else fast)


@pytest.mark.parametrize("name", ELECTRICAL)
def test_every_electrical_effect_at_typical_size_agrees(name):
    """Below 0.05 % of rated current each, dead time the largest; an effect itself is 1 to 100 times that."""
    assert gap(library.typical(name, DRIVE.motor, DRIVE.converter), 50.0) < 5e-4


MOTION = Scenario("m", (Segment(0.05), Segment(0.25, 0.5, 0.05, ramp=0.05)), rotor="free", reference="speed")
MECHANICAL = [n for n in library.effect_names() if library.load_effect(n).subsystem == "mechanics"]


@pytest.mark.parametrize(
    "name", ["dead_time", "iron_loss", "pwm_delay", "current_offset", "encoder_offset", *MECHANICAL]
)
def test_closed_loop_runs_agree(name):
    """A whole sensored run: same mean position error within 0.05 degrees, same motion within noise."""
    drive = load_drive("ipm_exchanged")
    effects = library.typical(name, drive.motor, drive.converter)
    runs = [
        simulate(drive, MOTION, load_estimator("qnull"), closed_loop=False, seed=4, effects=effects, plant=plant)
        for plant in ("averaged", "switched")
    ]
    a, s = (r.recording.between(r.start_time + 0.15, 9.0) for r in runs)
    assert np.degrees(a.error).mean() == pytest.approx(np.degrees(s.error).mean(), abs=0.05)
    assert a.omega == pytest.approx(s.omega, abs=0.02 * np.abs(s.omega).max())
