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
from tests.sandbox.averaged import both, both_free, gap, rms

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


ENCODER = ("encoder_offset", "encoder_eccentricity")  # leave the currents of given commands alone
SHARE = 0.2  # of an effect's own change of the sampled currents: what is left between the plants, common part included
OWN = 0.03  # the same without what is left between them anyway: worst is a skin effect at 100 rad/s, 0.023


def without_jitter(name):
    """Return an effect at typical size, without the jitter (each plant draws its own)."""
    sizes = library.typical(name, DRIVE.motor, DRIVE.converter)
    return {k: v for k, v in sizes.items() if not k.endswith("jitter")}


@pytest.mark.parametrize("speed", [20.0, 50.0, 100.0])
@pytest.mark.parametrize("name", [n for n in ELECTRICAL if n not in ENCODER])
def test_every_electrical_effect_is_the_same_by_a_share_of_its_own_change(name, speed):
    """Cross-saturation at 100 rad/s is the worst: 9.1e-5 are left without any effect, itself it makes 4.9e-4."""
    bare, exact = both({}, speed)
    averaged, switched = both(without_jitter(name), speed)
    change = rms(switched - exact)
    print(f"{name} at {speed:g} rad/s: change {change:.1e}, of it left {rms(averaged - switched) / change:.3f}")
    assert rms(averaged - switched) < SHARE * change
    assert rms((averaged - bare) - (switched - exact)) < OWN * change


@pytest.mark.parametrize("name", ENCODER)
def test_encoder_effects_leave_given_commands_alone(name):
    for plain, with_it in zip(both({}, 50.0, n=100), both(without_jitter(name), 50.0, n=100), strict=True):
        assert np.array_equal(plain, with_it)


@pytest.mark.parametrize("name", [n for n in library.effect_names() if library.load_effect(n).subsystem == "mechanics"])
def test_every_mechanical_effect_is_the_same_by_a_share_of_its_own_change(name):
    """Of the currents of a rotor that swings free in a held field."""
    bare, exact = both_free({})
    averaged, switched = both_free(without_jitter(name))
    change = rms(switched - exact)
    print(f"{name}: change {change:.1e}, of it left {rms(averaged - switched) / change:.4f}")
    assert rms(averaged - switched) < SHARE * change
    assert rms((averaged - bare) - (switched - exact)) < OWN * change


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
