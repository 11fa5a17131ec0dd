"""What no effect of the library explains is put down to whoever can have shown it."""

import numpy as np
import pytest

from sandbox.gap.location.outside import excesses, shares
from sandbox.replay.replay import Residual

NONE = {"machine": 0.0, "inverter": 0.25, "sensor": 0.75, "mechanics": 0.0}
RNG = np.random.default_rng(3)
ANGLE = 2.0 * np.pi * (np.arange(3000)[:, None] / 300.0 - np.arange(3) / 3.0)


def shown(current, motion=None):
    """Residuals in noise floors with noise of their own size."""
    noisy = current + RNG.standard_normal(current.shape)
    moved = None if motion is None else (motion + RNG.standard_normal(motion.shape))[:, None]
    return Residual("a", "free", current=noisy[:, :, None], motion=moved, angle=None)


def test_a_bent_sensor_is_told_by_the_sum_of_readings():
    """cos^3 = 3/4 cos + 1/4 cos of the triple, which is alike in all phases: a tenth of the
    squares, by hand."""
    sizes = excesses([shown(20.0 * np.cos(ANGLE) ** 3)])
    assert sizes["sum"] / sizes["current"] == pytest.approx(0.1, rel=0.05)
    found = shares(sizes, NONE)
    assert max(found, key=lambda s: found[s]) == "sensor"
    assert found["sensor"] > 0.9


def test_what_a_machine_can_do_is_the_machines_although_sensors_could_mimic_it():
    found = shares(excesses([shown(20.0 * np.cos(5.0 * ANGLE))]), NONE)
    assert max(found, key=lambda s: found[s]) == "machine"
    assert sum(found.values()) == pytest.approx(1.0)


def test_what_only_motion_shows_is_the_mechanics():
    found = shares(excesses([shown(np.zeros((3000, 3)), np.full(3000, 5.0))]), NONE)
    assert found["mechanics"] > 0.95


def test_noise_is_no_excess():
    """Then the library's spans stand: nothing else is known."""
    assert shares(excesses([shown(np.zeros((3000, 3)))]), NONE) == NONE
