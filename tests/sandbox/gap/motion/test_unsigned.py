"""Currents without a sign are told, and no current that only drives."""

import dataclasses

import numpy as np
import pytest

from sandbox.gap.motion.unsigned import unsigned
from tests.sandbox.gap.motion.shafts import COUNT, both_ways, campaign, shaft, thrown

KINDS = {
    "controlled": lambda seed: shaft(seed, both_ways, dry=0.02, viscous=1e-4),
    "thrown": lambda seed: thrown(seed, 2e-3, COUNT),
}


def without_sign(r):
    return dataclasses.replace(r, torque=np.abs(r.torque))


@pytest.mark.parametrize("kind", KINDS)
def test_a_current_without_a_sign_is_told(kind):
    (found,) = unsigned(campaign(*(without_sign(KINDS[kind](seed)) for seed in (1, 2))))
    assert "is never negative" in found.text
    assert "log the current with its sign" in found.text


@pytest.mark.parametrize("kind", KINDS)
def test_a_current_with_a_sign_is_not(kind):
    assert unsigned(campaign(*map(KINDS[kind], (1, 2)))) == []


def test_a_motor_that_only_drives_is_not():
    """It speeds up, and friction slows it down."""
    run = shaft(3, lambda t: 20.0 + 5.0 * np.sin(t), dry=0.05, viscous=1e-3)
    assert float(run.torque.min()) > 0.0
    assert unsigned(campaign(run)) == []
