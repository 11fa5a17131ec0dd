"""How a current's sign goes through zero: the bench's width and shape, against the switched bench
and closed forms."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from model.effects.device_drop import mean_of_tanh
from sandbox.plant import mechanics
from sandbox.plant.batch import blank
from sandbox.replay.inputs import duties
from sandbox.replay.replay import replay
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.unlisted import with_sign
from tests.sandbox.plant.stated_duties import DRIVE, apart, finer, from_duties, turning

PERIOD, LINK, RATED = (
    DRIVE.converter.sampling_period,
    DRIVE.converter.dc_bus_voltage,
    DRIVE.motor.rated_current,
)
SAMPLES, SETTLED, SPEED = 240, 60, 120.0
WIDTH = 0.02 * RATED
CLIPS = 0.017  # largest difference of three soft signs from tanh (below)
DROP = {"device_drop.threshold": 1.0}
LATE = {"dead_time.time": 2e-6}


def missed(effects, shape, said):
    """Return the rms difference of currents over rated current: the bench's sign of a shape, the
    plant told `said`."""
    b = with_sign(quiet(bench(DRIVE.motor, DRIVE.converter, effects)), shape, WIDTH)
    b = b._replace(step=b.step / 8.0)
    angle, omega = turning(SAMPLES, SPEED)
    u = 0.03 * LINK * np.exp(1j * (1.9 + SPEED * PERIOD * (np.arange(SAMPLES) + 0.5)))
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
    found = replay(
        finer(from_duties(DRIVE, duty, angle, omega), 4), [{**effects, **said}]
    ).currents[0][:, :, 0]
    read = np.stack([r[x] for x in ("i_a", "i_b", "i_c")], axis=1)
    return apart(DRIVE, found[SETTLED - 1 :], read[SETTLED - 1 :])


def remaining():
    """Return the rms difference of three soft signs from tanh, over that of one soft sign 1.3 times
    as wide."""
    x = np.linspace(-4.0, 4.0, 801)
    three = np.array([mean_of_tanh(v, v) for v in x])
    return np.sqrt(
        np.mean((three - np.tanh(x)) ** 2)
        / np.mean((np.clip(x / 1.3, -1.0, 1.0) - np.tanh(x)) ** 2)
    )


@pytest.mark.parametrize("effects", [LATE, DROP], ids=["dead time", "drop"])
def test_a_round_sign_is_that_of_the_switched_bench(effects):
    """Told tanh, the plant meets a bench whose sign is one; told a straight line it misses by far
    more.

    Bounds, of rated current: 2e-5, what the plant may miss of the bench; for the drop beside it as
    much of the straight line's miss as three soft signs miss of tanh (rms) where currents pass zero
    evenly.
    """
    told_round = missed(effects, "tanh", {"bench.soft_current": WIDTH, "bench.soft_shape": 1.0})
    told_straight = missed(effects, "tanh", {"bench.soft_current": 1.3 * WIDTH})
    print(f"{told_round * 1e6:.1f} ppm of rated current told, {told_straight * 1e6:.1f} not told")
    assert told_round < 2e-5 + (remaining() * told_straight if effects is DROP else 0.0)
    assert told_straight > 2e-5


def test_a_hard_sign_is_a_very_narrow_one():
    """A width 3 deviations below the usual one (`sandbox.gap.evidence.priors.soft_sign`) is as good
    as none.

    What a width leaves goes with it: exp(-4.5) of what the usual one leaves, beside what the plant
    may miss.
    """
    late = {"dead_time.time": 3e-8}  # more over-corrects within a hard sign (see `test_limits`)
    told_narrow = missed(late, "hard", {"bench.soft_current": 0.015 * RATED * math.exp(-4.5)})
    usual = missed(late, "hard", {})
    print(f"{told_narrow * 1e6:.1f} ppm narrow, {usual * 1e6:.1f} usual")
    assert told_narrow < 2e-5 + math.exp(-4.5) * usual
    assert usual > 2e-4


def test_three_soft_signs_are_tanh():
    """The mean of tanh from x to y is (ln cosh y - ln cosh x)/(y - x); no other three do much
    better (minimax)."""
    x, step = np.meshgrid(np.linspace(-9.0, 9.0, 181), np.geomspace(0.01, 18.0, 60))
    y = x + step
    exact = (np.log(np.cosh(y)) - np.log(np.cosh(x))) / (y - x)
    ours = np.vectorize(mean_of_tanh.py_func if hasattr(mean_of_tanh, "py_func") else mean_of_tanh)(
        x, y
    )
    assert np.abs(ours - exact).max() < CLIPS
    at = np.linspace(0.0, 8.0, 2001)

    def largest(p):
        share = np.exp(p[3:]) / np.exp(p[3:]).sum()
        return np.abs(
            sum(s * np.minimum(at * k, 1.0) for s, k in zip(share, np.exp(p[:3]), strict=True))
            - np.tanh(at)
        ).max()

    begun = np.log([1.609714, 0.797139, 0.418666, 0.277034, 0.441430, 0.281536])
    best = minimize(largest, begun + 0.02, method="Nelder-Mead", options={"maxiter": 4000}).fun
    assert best > 0.98 * largest(begun)


def test_a_rigid_shaft_beside_a_compliant_one_does_not_slip():
    """Two lanes of one batch under the same torque: the rigid one keeps twist and slip zero, to the
    bit."""
    w = blank(2)
    for row, value in {
        "swing_ratio": 0.1,
        "motor_inv": 1e3,
        "load_inv": 2e3,
        "net": 0.3,
        "taken": -0.1,
    }.items():
        w[row][:] = value
    w["swing_rate"][0] = 500.0
    for _ in range(20):
        mechanics.swing(w, 0, 1e-4)
    assert (w["twist"][1], w["slip"][1]) == (0.0, 0.0)
    rest = (0.3 * 1e3 - 0.1 * 2e3) / 500.0**2
    t = 20e-4
    swings = math.sqrt(1.0 - 0.01) * 500.0 * t
    closed = rest * (
        1.0 - math.exp(-50.0 * t) * (math.cos(swings) + 0.1 / math.sqrt(0.99) * math.sin(swings))
    )
    assert w["twist"][0] == pytest.approx(closed, rel=1e-9)
