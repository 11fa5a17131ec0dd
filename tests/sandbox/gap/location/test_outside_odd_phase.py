"""One phase that misses more than the others: a star's fault of one leg is found at exactly two to
one."""

from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.location.outside import odd_phase
from sandbox.replay.replay import Residual

TURNS, PER = 40, 60


def at(*errors, rotor="driven", angle=None, turns=TURNS, seed=8):
    """A point and residuals (noise floors, noise of 1 among them) of one recording."""
    n = turns * PER
    angle = 2.0 * np.pi * np.arange(n) / PER if angle is None else angle
    noise = np.random.default_rng(seed).standard_normal((n, 3))
    recording = SimpleNamespace(rotor=rotor, motion=SimpleNamespace(angle=angle))
    point = SimpleNamespace(prepared=SimpleNamespace(recordings=[recording]))
    return point, [
        Residual(
            "a",
            rotor,
            (noise + np.stack([e * np.ones(n) for e in errors], axis=1))[:, :, None],
            None,
            None,
        )
    ]


def fault(size, even=0.0):
    """Squares 4 s^2, s^2, s^2 of a fault of phase b in a star, `even` beside it everywhere."""
    return tuple(np.sqrt(own * size**2 + even) for own in (1.0, 4.0, 1.0))


@pytest.mark.parametrize("size", [3.0, 20.0])
def test_a_fault_of_one_leg_is_two_to_one(size):
    """Currents e, -e/2, -e/2; a mean of squares of 2400 samples with noise s.d. 2 s at s = 3 is
    known to 2 %."""
    found = odd_phase(*at(-size, 2.0 * size, -size))
    assert found.phase == "b"
    assert found.times == pytest.approx(2.0, rel=0.05)
    assert "Phase b misses 2.0 times" in found.text


@pytest.mark.parametrize(("even", "told"), [(0.0, True), (0.5, True), (0.9, False), (9.0, False)])
def test_three_quarters_have_to_be_one_phases(even, told):
    """6 of 6 + 3 q: q = 2/3 is three quarters, 0.8 at q = 1/2, 0.69 at q = 0.9."""
    assert (odd_phase(*at(*fault(9.0, even * 81.0))) is not None) == told


def test_noise_makes_no_phase_odd():
    """Of 200 draws of noise alone three standard errors are passed by at most 3 (0.13 % one-sided,
    three phases)."""
    assert sum(odd_phase(*at(0.0, 0.0, 0.0, seed=k)) is not None for k in range(200)) <= 3


def test_a_sensors_own_fault_leaves_nothing_in_the_others():
    found = odd_phase(*at(0.0, 0.0, 9.0))
    assert found.phase == "c"
    # 81 against a mean of noise's squares within 3 x 0.03
    assert found.times is None or found.times > 20.0


def test_a_current_that_stands_still_in_one_phase_is_no_fault():
    """Half of the time the rotor stands and its error is along a, turning it is even; a locked one
    does not count."""
    turning = 2.0 * np.pi * np.arange(TURNS * PER // 2) / PER
    angle = np.concatenate([turning, turning[-1] + np.zeros(TURNS * PER // 2)])
    along = [9.0 * np.cos(angle - 2.0 * np.pi * k / 3.0) for k in range(3)]
    assert odd_phase(*at(*along, angle=angle)) is None
    assert odd_phase(*at(-9.0, 18.0, -9.0, rotor="locked")) is None


@pytest.mark.parametrize(("turns", "told"), [(9, False), (12, True)])
def test_ten_turns_are_needed(turns, told):
    """Of the last turn a sample is missing."""
    assert (odd_phase(*at(-9.0, 18.0, -9.0, turns=turns)) is not None) == told


def test_little_more_than_three_standard_errors_over_turns_suffice():
    """12 turns with squares 1 + m +- s in phase b, in the others 1 as noise has: the mean m over
    its standard error s / sqrt(11) is 3.7."""
    turns, m = 13, 50.0  # of the last turn a sample is missing
    squares = 1.0 + m + np.resize([1.0, -1.0], turns) * m * np.sqrt(11.0) / 3.7
    own, others = np.sqrt(np.repeat(squares, PER)), np.ones(turns * PER)
    point, _ = at(0.0, 0.0, 0.0, turns=turns)
    current = np.stack([others, own, others], axis=1)[:, :, None]
    assert odd_phase(point, [Residual("a", "driven", current, None, None)]).phase == "b"


@pytest.mark.parametrize(("per", "told"), [(8, False), (14, True)])
def test_a_turn_has_at_least_twelve_samples(per, told):
    angle = 2.0 * np.pi * np.arange(TURNS * PER) / per
    assert (odd_phase(*at(-9.0, 18.0, -9.0, angle=angle)) is not None) == told


def test_a_fault_moves_with_its_sensor_as_the_advice_says():
    """Two whole diagnoses of a sensor whose core remembers (3 % of rated current) say so: phase a
    misses 2.4 times as much, and b 3.5 times once they are exchanged."""
    before = odd_phase(*at(9.0, 0.0, 0.0))
    assert "sensors of phases a and b" in before.exchange
    assert "Where phase b then misses more, it is that sensor's fault" in before.exchange
    assert odd_phase(*at(0.0, 9.0, 0.0)).phase == "b"
