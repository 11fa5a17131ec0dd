"""Replays that readings hold, against closed forms."""

import dataclasses
import math

import numpy as np
import pytest

from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.held import held, released, remembering, wider
from sandbox.replay.replay import block_of, prepare, replay, residuals
from sandbox.replay.walking import Running
from tests.sandbox.replay.benches import NOISE, ROUND, record

PERIOD = ROUND.converter.sampling_period
SAMPLES = 10.0
N = 4000


def at_rest(noise=0.0):
    """Return a campaign of one recording at rest, no voltage, readings of noise (A)."""
    recorded, rng = record({}, "locked", n=N, drive=ROUND), np.random.default_rng(5)
    still = {k: np.zeros(N) for k in ("u_alpha", "u_beta")}
    still |= {k: noise * rng.standard_normal(N) for k in ("i_a", "i_b", "i_c")}
    recorded = dataclasses.replace(recorded, columns=recorded.columns | still)
    return prepare(Campaign("own", ROUND, (recorded,), {}, {}, False), steps=1)


def test_what_is_missed_is_forgotten_in_so_many_samples():
    """A current that is off by x at the first sample, all else known: each period takes e^-(R T/L)
    by itself and 1/(1 + N) by the reading.  Tolerance: the midpoint step's r^3/24."""
    p = held(at_rest(), remembering(ROUND, SAMPLES))
    (r,) = p.recordings
    nominal = complete(ROUND.motor, ROUND.converter)
    running = Running.begun(ROUND, p.steps, r, block_of(p, [0], [nominal]))
    size, inductance = 0.1, ROUND.motor.inductance_d
    running.batch["psi_alpha"] += inductance * size
    out = np.empty((r.samples, 3, running.lanes))
    running.on(r.samples, out, np.empty((1, running.lanes)))
    each = math.exp(-ROUND.motor.resistance * PERIOD / inductance) - 1.0 / (1.0 + SAMPLES)
    k = np.arange(40)
    np.testing.assert_allclose(out[:40, 0, 0], size * each**k, rtol=1e-5 * 40)


@pytest.mark.parametrize("samples", [4.0, 10.0, 50.0])
def test_noise_that_comes_back_is_counted(samples):
    """White noise of readings alone: the residual is that of a replay by voltages, over `wider`.
    What is predicted, p, follows readings before, of variance g/(2 - g) in both components of the
    current, and so does the excess p^2 - 2 n p, n the noise: over 2 x 4000 of them, which hold two
    thirds of the square of three phases, its mean scatters by 2 sqrt(g/(2 - g)/8000).  Were the
    third that is common counted as coming back, J would be off by more than four of these."""
    p, g = at_rest(NOISE), 1.0 / (1.0 + samples)
    ohms = remembering(ROUND, samples)
    own = held(p, ohms)
    (found,) = residuals(own, replay(own, [{}]))
    scatter = 2.0 / 3.0 * math.sqrt(g / (2.0 - g) / 8000.0)
    assert found.rms()[0] == pytest.approx(residual_alone(p), abs=4.0 * scatter)
    assert wider(ROUND, ohms) ** 2 == pytest.approx(1.0 / 3.0 + 2.0 / 3.0 * 2.0 / (2.0 - g))


def residual_alone(p):
    """Return the residual's rms of a replay by voltages."""
    return residuals(p, replay(p, [{}]))[0].rms()[0]


def test_a_released_replay_is_the_one_by_voltages():
    """The same bits, and the readings' own noise."""
    p = at_rest(NOISE)
    back = released(held(held(p, 3.0), 7.0))
    assert back.noise_std == pytest.approx(p.noise_std, rel=1e-12)
    np.testing.assert_array_equal(replay(back, [{}]).currents[0], replay(p, [{}]).currents[0])
