"""Saturated duties, pulses that vanish, edges that act in the next period, samples among them: the
switched bench.

Its Runge-Kutta steps are an eighth of its own.  Where dead time is long the sign's zone is made
wide: within a narrow one late edges over-correct (t_d U G over its width beyond one or two), and
any two integrators part company.
"""

import numpy as np
import pytest

from sandbox.replay.inputs import duties
from sandbox.replay.replay import replay
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from tests.sandbox.plant.stated_duties import DRIVE, SPEED, apart, finer, from_duties, turning

PERIOD, LINK, RATED = (
    DRIVE.converter.sampling_period,
    DRIVE.converter.dc_bus_voltage,
    DRIVE.motor.rated_current,
)
# the bench turns before the first late pattern, the replay starts with it
SAMPLES, SETTLED = 120, 60
K = np.arange(SAMPLES)
EXACT = 2e-5  # of rated current


def both(effects, u, speed, width=None, steps=4):
    """Return the rms difference of currents over rated current, and the duties (n, 3)."""
    values, b = dict(effects), quiet(bench(DRIVE.motor, DRIVE.converter, effects))
    b = b._replace(step=b.step / 8.0)
    if width:
        b, values = (
            b._replace(soft_current=width * RATED),
            {**values, "bench.soft_current": width * RATED},
        )
    angle, omega = turning(SAMPLES, speed)
    r = switched(
        b,
        "driven",
        u.real.copy(),
        u.imag.copy(),
        LINK,
        theta=angle,
        speed=omega / DRIVE.motor.pole_pairs,
    )
    duty = duties(u.real, u.imag, np.full(SAMPLES, LINK))
    found = replay(finer(from_duties(DRIVE, duty, angle, omega), steps), [values]).currents[0][
        :, :, 0
    ]
    read = np.stack([r[x] for x in ("i_a", "i_b", "i_c")], axis=1)
    return apart(DRIVE, found[SETTLED - 1 :], read[SETTLED - 1 :]), duty


def wave(size, speed):
    """Return a voltage (V) that turns with the rotor."""
    return size * np.exp(1j * (1.9 + speed * PERIOD * (K + 0.5)))


SWINGS = np.where(K % 4 < 2, 400.0, -400.0) * np.exp(0.7j)
SATURATED = {
    "fast": ({}, wave(300.0, 1800.0), 1800.0, None),
    "swings": ({}, SWINGS, 0.0, None),
    "swings, dead time": ({"dead_time.time": 3e-6}, SWINGS, 0.0, None),
    "swings, late": ({"dead_time.time": 3e-6, "pwm_delay.delay": 0.3 * PERIOD}, SWINGS, 0.0, None),
    "six steps": ({"dead_time.time": 3e-6}, wave(2000.0, 900.0), 900.0, None),
}


@pytest.mark.parametrize("name", SATURATED)
def test_legs_that_stay_on_or_off(name):
    """Eight steps: half a period at full voltage moves the flux far, up to five times rated
    current."""
    effects, u, speed, width = SATURATED[name]
    gap, duty = both(effects, u, speed, width, steps=8)
    assert duty.min() == 0.0
    assert duty.max() == 1.0
    assert gap < EXACT


NARROW = {
    "pulses shorter than the dead time": (
        {"dead_time.time": 5e-6},
        wave(228.0, 1200.0),
        1200.0,
        0.1,
    ),
    "edges closer than the dead time": ({"dead_time.time": 2e-5}, wave(8.0, 20.0), 20.0, 0.5),
    "edges closer, late": (
        {"dead_time.time": 2e-5, "pwm_delay.delay": 0.3 * PERIOD},
        wave(8.0, 20.0),
        20.0,
        0.5,
    ),
    "most of a half period": ({"dead_time.time": 4.5e-5}, wave(8.0, 20.0), 20.0, 1.0),
    "falls in the next period": ({"dead_time.time": 2e-5}, wave(225.0, 1200.0), 1200.0, 0.5),
    "falls in the next, late": (
        {"dead_time.time": 1e-5, "pwm_delay.delay": 0.45 * PERIOD},
        wave(225.0, 1200.0),
        1200.0,
        0.5,
    ),
}


@pytest.mark.parametrize("name", NARROW)
@pytest.mark.parametrize("steps", [4, 32])
def test_edges_that_wait(name, steps):
    """With 4 steps segments are longer than what edges wait, with 32 shorter: two ways through the
    kernel."""
    effects, u, speed, width = NARROW[name]
    gap, duty = both(effects, u, speed, width, steps)
    late = effects["dead_time.time"] / PERIOD
    assert (
        np.min(np.abs(np.diff(np.sort(np.concatenate([duty, 1.0 - duty], axis=1), axis=1)))) < late
    )
    assert gap < EXACT


@pytest.mark.parametrize("delay", [0.0, 0.2, 0.43])
@pytest.mark.parametrize("sample", [-0.45, -0.2, 0.2, 0.45])
@pytest.mark.parametrize(
    "more", [{}, {"dead_time.time": 2e-6, "current_filter.time_constant": 2e-5}], ids=["", "more"]
)
def test_samples_anywhere_in_the_period(sample, delay, more):
    """The bench turns before the first late pattern: what that leaves after 60 periods is below
    3e-5 (bound twice)."""
    back = SPEED * DRIVE.motor.magnet_flux
    u = wave(back, SPEED) + 30.0 * np.where(K % 8 < 4, 1, -1) * np.exp(0.3j)
    effects = {"current_sampling.delay": sample * PERIOD, "pwm_delay.delay": delay * PERIOD, **more}
    assert both(effects, u, SPEED)[0] < (EXACT if delay < 0.3 else 3.0 * EXACT)
