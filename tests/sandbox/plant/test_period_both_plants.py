"""The closed loop on both plants, without noise: the same mean position error, effect by effect."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from estimators.registry import load_estimator
from experiments.spline_twin import twin
from model.drive_files import load_drive
from model.effects import library
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate

# degrees: 1e-5 of rated current (what a step of the exact plant may miss of the drop) over a ripple
# of a fifth of it, whose q part turns with half the angle (`ipm_exchanged`: (1/L_d - 1/L_q)
# L_d = -0.5)
SAME = np.degrees(1e-5 / (0.2 * 0.5))
QNULL = load_estimator("qnull")
LOADED = Segment(0.1, 0.8, ramp=0.05)
LOCKED = Scenario("locked", (Segment(0.02), LOADED, Segment(0.1, 0.8)))
DRIVEN = Scenario(
    "driven",
    (Segment(0.02), Segment(0.1, 0.8, 0.1, ramp=0.05), Segment(0.1, 0.8, 0.1)),
    rotor="driven",
)
FREE = Scenario(
    "free",
    (Segment(0.02), Segment(0.1, 0.3, 0.05, ramp=0.05), Segment(0.15, 0.3, 0.05)),
    rotor="free",
    reference="speed",
)
SHAFT = {"shaft_compliance.stiffness": 300.0, "shaft_compliance.load_inertia": 4e-4}
FRICTION = {
    "coulomb_friction.torque": 0.03,
    "coulomb_friction.stribeck_torque": 0.01,
    "viscous_friction.coefficient": 5e-4,
}
BRISTLES = {"coulomb_friction.presliding": 3e-3, "coulomb_friction.presliding_damping": 0.2}
COGGING = {
    "cogging_torque.amplitude": 0.05,
    "cogging_torque.order_mech": 12.0,
    "cogging_torque.2.amplitude": 0.02,
    "cogging_torque.2.order_mech": 24.0,
    "cogging_torque.2.phase": 1.0,
}
CORE = {
    "iron_loss.core_resistance": 2e3,
    "iron_loss.excess_current": 0.04,
    "iron_loss.hysteresis_current": 0.04,
}
CASES = {  # scenario, effects; the motor's quartic as a flux map where the name says so
    "bare": (LOCKED, {}),
    "driven": (DRIVEN, {}),
    "dead time, filter": (DRIVEN, {"dead_time.time": 1e-6, "current_filter.time_constant": 1e-5}),
    "early samples of late pulses": (
        LOCKED,
        {"pwm_delay.delay": 2e-5, "current_sampling.delay": -5e-6},
    ),
    "a link that rings": (
        DRIVEN,
        {
            "dc_link_error.sag": 2.0,
            "dc_link_error.resonance": 120.0,
            "dc_link_error.impedance": 8.0,
        },
    ),
    "phase after phase": (DRIVEN, {"current_sampling.channel_lag": 2e-6}),
    "a knee": (DRIVEN, {"device_drop.threshold": 1.0, "device_drop.knee_current": 0.3}),
    "late samples": (DRIVEN, {"current_sampling.delay": 5e-6}),
    "iron loss": (DRIVEN, {"iron_loss.core_resistance": 2e3, "iron_loss.time_constant": 1e-4}),
    "layers of conductors": (
        DRIVEN,
        {
            "skin_effect.resistance": 5.0,
            "skin_effect.layers": 3.0,
            "skin_effect.time_constant": 3e-5,
        },
    ),
    "core loss": (DRIVEN, CORE),
    "core loss, free": (FREE, CORE | {"dead_time.time": 1e-6}),
    "harmonics": (
        DRIVEN,
        {
            "flux_harmonics.psi_d6": 2e-3,
            "flux_harmonics.psi_q6": -1e-3,
            "inductance_harmonics.gamma_6": 0.5,
            "flux_harmonics.2.psi_d": 1e-3,
            "inductance_harmonics.2.gamma": 0.2,
            "inductance_harmonics.2.phase": 0.5,
        },
    ),
    "free": (FREE, {}),
    "mechanics": (FREE, COGGING | FRICTION | SHAFT),
    "bristles": (FREE, FRICTION | BRISTLES),
    "map": (DRIVEN, {}),
    "map, free": (FREE, {"dead_time.time": 1e-6, "iron_loss.core_resistance": 2e3}),
}


def quiet(mapped=False):
    """Return a drive whose sensors read exactly; mapped: its quartic as a flux map."""
    drive = load_drive("ipm_exchanged")
    drive = twin(drive) if mapped else drive
    exact = dataclasses.replace(drive.converter, current_noise=0.0, current_resolution=0.0)
    return dataclasses.replace(drive, converter=exact)


def last(run, seconds):
    """Return the end of a run."""
    return run.recording.between(run.recording.t[-1] - seconds, 99.0)


def means(scenario, effects, mapped=False):
    """Return the mean position error (degrees) of a run's last 0.1 s on the exact plant and on the
    switched bench."""
    runs = [
        simulate(quiet(mapped), scenario, QNULL, effects=effects, plant=plant)
        for plant in ("exact", "switched")
    ]
    found = [float(np.degrees(last(run, 0.1).error.mean())) for run in runs]
    print(f"exact {found[0]:.5f}, switched {found[1]:.5f} degrees, off {found[0] - found[1]:+.1e}")
    return found


@pytest.mark.parametrize("case", list(CASES))
def test_same_mean_position_error(case):
    exact, switched = means(*CASES[case], mapped=case.startswith("map"))
    assert exact == pytest.approx(switched, abs=SAME)


@pytest.mark.parametrize("name", library.effect_names())
def test_every_effect_at_typical_size_means_the_same(name):
    """Jitter, of which each plant draws its own, aside."""
    drive = quiet()
    sizes = {
        k: v
        for k, v in library.typical(name, drive.motor, drive.converter).items()
        if not k.endswith("jitter")
    }
    exact, switched = means(FREE, sizes)
    assert exact == pytest.approx(switched, abs=SAME)


def test_jitter_scatters_the_samples_alike():
    """Each plant draws its own: rms of reading less true current, of n samples known to 1/sqrt(2
    n), four sigma."""
    scatter = []
    for plant in ("exact", "switched"):
        effects = {"current_sampling.jitter": 3e-6, "current_sampling.delay": 5e-6}
        r = last(simulate(quiet(), DRIVEN, QNULL, effects=effects, plant=plant), 0.15)
        miss = r.i_a - r.i_d * np.cos(r.theta) + r.i_q * np.sin(r.theta)
        scatter.append(miss.std())
    assert scatter[0] == pytest.approx(scatter[1], rel=4.0 * np.sqrt(2.0) / np.sqrt(2.0 * len(r.t)))
