"""Legs beyond the library: sign through zero, measured table, one-sided loss, least pulse; closed
forms."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from model.errors import BadInput
from sandbox.switched.advance import MODES, replay, start
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.bench_state import Slot
from sandbox.switched.inverter import advance
from sandbox.switched.layers import Held
from sandbox.switched.leg import leg_table, soft_sign, table_volts
from sandbox.switched.phase_machine import phase_currents, reservoir
from sandbox.switched.unlisted import unlisted, with_sign
from tests.sandbox.plant.closed_forms import pulsed, settled
from tests.sandbox.plant.effect_motors import CONVERTER, NO_MAGNET, TS, L, R, U, vector

PLAIN = quiet(bench(NO_MAGNET, CONVERTER))
# hardly any ripple
SMOOTH = dataclasses.replace(NO_MAGNET, inductance_d=0.5, inductance_q=0.5, resistance=200.0)


def with_table(current, volts):
    """Return the bench with a measured table of what its legs lose (V at A)."""
    table = tuple(zip(map(float, current), map(float, volts), strict=True))
    return quiet(bench(NO_MAGNET, dataclasses.replace(CONVERTER, inverter_table=table)))


@pytest.mark.parametrize(
    ("shape", "law"),
    [("linear", lambda x: np.clip(x, -1, 1)), ("hard", np.sign), ("tanh", np.tanh)],
)
def test_sign_goes_through_zero_as_told(shape, law):
    b = with_sign(PLAIN, shape, 0.45)
    i = np.array([-3.0, -0.45, -0.2, -1e-9, 0.0, 1e-9, 0.3, 0.5, 4.5])
    assert [soft_sign(b, x) for x in i] == pytest.approx(law(i / 0.45), abs=1e-15)


def test_the_sign_of_old_is_the_default():
    assert PLAIN.sign_shape == 0.0
    assert PLAIN.soft_current == 0.015 * NO_MAGNET.rated_current
    assert with_sign(PLAIN, "linear", PLAIN.soft_current) == PLAIN


@pytest.mark.parametrize(("shape", "law"), [("linear", lambda x: min(x, 1.0)), ("tanh", math.tanh)])
@pytest.mark.parametrize("u", [10.0, 60.0])
def test_dead_time_around_zero_current_follows_the_shape(shape, law, u):
    """u = R i + U t_d/T_s (2 s(i/w) + 2 s(i/2w))/3 along alpha; 2e-3: the sample against the mean,
    R T_s/L squared."""
    t_d, w = 4e-6, 0.25
    b = with_sign(quiet(bench(SMOOTH, CONVERTER, {"dead_time.time": t_d})), shape, w)

    def left(i):
        return u - 200.0 * i - U * t_d / TS * (2.0 * law(i / w) + 2.0 * law(0.5 * i / w)) / 3.0

    expected = brentq(left, 0.0, 1.0)
    assert settled(b, u + 0j).real == pytest.approx(expected, rel=2e-3)
    hard = settled(with_sign(b, "hard", 1.0), u + 0j).real
    assert abs(hard - expected) > (0.05 if u < 30.0 else -1.0) * expected


def test_a_hard_sign_takes_the_whole_dead_time_at_any_current():
    t_d, u = 4e-6, 20.0
    b = with_sign(quiet(bench(SMOOTH, CONVERTER, {"dead_time.time": t_d})), "hard", 1.0)
    assert settled(b, u + 0j).real == pytest.approx(
        (u - 4.0 / 3.0 * U * t_d / TS) / 200.0, rel=2e-3
    )


def test_a_table_of_a_device_drop_is_that_drop():
    """Threshold soft within w and a resistance: straight pieces with their corner at w, so the same
    to rounding."""
    effects = {"device_drop.threshold": 0.9, "device_drop.on_resistance": 0.4}
    drop = quiet(bench(NO_MAGNET, CONVERTER, effects))
    w = drop.soft_current
    table = with_table([0.0, w, 1.0, 50.0], [0.0, 0.9 + 0.4 * w, 1.3, 20.9])
    k = np.arange(600)
    u = 25.0 * np.exp(0.02j * k)
    a, b = (vector(replay(x, "locked", u.real, u.imag, U)) for x in (drop, table))
    assert np.abs(a - b).max() < 1e-11
    assert np.abs(a - vector(replay(PLAIN, "locked", u.real, u.imag, U))).max() > 0.05


def test_devices_with_a_knee_drop_by_an_exponential():
    """At a constant voltage the current is where u = 4/3 V (1 - exp(-i/i_k)) + R i along alpha,
    phases b and c carrying half of it each: 2/3 of phase a's drop and 2/3 of theirs."""
    v, knee, u = 1.5, 0.12, 40.0
    effects = {"device_drop.threshold": v, "device_drop.knee_current": knee}
    b = quiet(bench(SMOOTH, CONVERTER, effects))

    def left(i):
        """Return the volts that a current leaves."""
        drop = sum(1.0 - math.exp(-x / knee) for x in (i, 0.5 * i)) * v * 2.0 / 3.0
        return u - drop - 200.0 * i

    assert settled(b, u + 0j).real == pytest.approx(brentq(left, 0.0, 1.0), rel=2e-3)


def test_a_table_is_odd_straight_between_its_points_and_constant_beyond():
    i, v = np.array([0.0, 0.1, 0.45, 2.0]), np.array([0.0, 1.5, 4.0, 4.4])
    table = with_table(i, v).leg_table
    at = np.array([-9.0, -2.0, -0.3, -0.05, 0.0, 0.05, 0.1, 0.44, 0.45, 1.0, 1.999, 2.0, 7.0])
    assert [table_volts(table, x) for x in at] == pytest.approx(
        np.sign(at) * np.interp(np.abs(at), i, v), abs=1e-15
    )


def test_a_table_s_loss_is_the_devices_and_the_balance_closes():
    """Sum of legs' volts times current over the run; 1e-2: mean of both samples instead of the
    course between.

    The balance: in = lost + stored, the table's corners inside a step leave 1e-5 of what is lost.
    """
    i, v = np.array([0.0, 0.1, 0.45, 2.0]), np.array([0.0, 1.5, 4.0, 4.4])
    b = with_table(i, v)._replace(audit=1.0)
    state, lost, old = start(b), 0.0, np.zeros(3)
    for k in range(600):
        u = 25.0 * np.exp(0.02j * k)
        advance(state, b, MODES["locked"], u.real, u.imag, U, 0.0, 0.0)
        new = np.array(phase_currents(complex(state[Slot.I_ALPHA], state[Slot.I_BETA])))
        mean = 0.5 * (old + new)
        lost += TS * np.sum(np.abs(mean) * np.interp(np.abs(mean), i, v))
        old = new
    assert state[Slot.DEVICES] == pytest.approx(lost, rel=1e-2)
    stored = reservoir(
        b, complex(state[Slot.PSI_ALPHA], state[Slot.PSI_BETA]), 0j, 0j, Held(), 0.0, 0.0, 0.0, 0.0
    )
    assert state[Slot.INPUT] == pytest.approx(
        state[Slot.LOSS] + stored, abs=1e-5 * state[Slot.LOSS]
    )


@pytest.mark.parametrize(("u", "share"), [(24.0, 2.0 / 3.0), (-24.0, 1.0 / 3.0)])
def test_a_one_sided_leg_is_a_resistance_for_currents_out_of_it(u, share):
    """Along alpha: 2/3 k on phase a where it alone is positive, k/3 where b and c are: the
    circuit's exact sample."""
    k = 2.0
    b = unlisted(PLAIN, {"one_sided": k})
    assert settled(b, u + 0j) == pytest.approx(pulsed(u, R + share * k), rel=1e-8)


def leg_means(u, least):
    """Return the mean of the three legs' levels under a commanded vector, pulses and gaps below
    `least` (s) dropped."""
    legs = np.array(
        [u.real, -u.real / 2 + math.sqrt(0.75) * u.imag, -u.real / 2 - math.sqrt(0.75) * u.imag]
    )
    duty = np.clip(0.5 + (legs - 0.5 * (legs.max() + legs.min())) / U, 0.0, 1.0)
    duty = np.where(duty * TS < least, 0.0, duty)
    return np.where((1.0 - duty) * TS < least, 1.0, duty)


def test_pulses_and_gaps_below_the_least_are_dropped():
    """Flux gained in a period without resistance, L di = T_s U times the vector of the legs' mean
    levels."""
    free = quiet(
        bench(
            dataclasses.replace(NO_MAGNET, resistance=1e-5),
            CONVERTER,
            {"stator_resistance.resistance": 0.0},
        )
    )
    u = np.array(
        [0.0, 200.0, -190.0, 215 * np.exp(0.4j), 225 * np.exp(2j), 100.0, 228 * np.exp(1j), 0.0]
    )
    least = 2e-5
    i = vector(replay(unlisted(free, {"least_pulse": least}), "locked", u.real, u.imag, U))
    means = np.array([leg_means(x, least) for x in u])
    expected = (
        TS
        * U
        * (
            (2 * means[:, 0] - means[:, 1] - means[:, 2]) / 3
            + 1j * (means[:, 1] - means[:, 2]) / 3**0.5
        )
    )
    assert np.diff(i) * L == pytest.approx(expected[:-1], abs=1e-9)
    whole = np.array([leg_means(x, 0.0) for x in u])
    assert 3 <= np.sum(np.abs(means - whole).max(axis=1) > 0.01) <= 5  # some dropped, some not
    # shorter than any pulse there is: nothing changes by a bit
    same = unlisted(free, {"least_pulse": 1e-6})
    a, b = (replay(x, "locked", u.real, u.imag, U)["i_a"] for x in (same, free))
    assert np.array_equal(a, b)


def test_active_vectors_below_the_least_are_dropped():
    """Legs nearer than 2 t / T_s in duty switch together at their mean: flux gained without
    resistance, as above.

    Written pair by pair, highest leg first: (0.7, 0.66, 0.3) at 0.1 becomes (0.68, 0.68, 0.3).
    """
    free = quiet(bench(NO_MAGNET, CONVERTER, {"stator_resistance.resistance": 0.0}))
    u = np.array(
        [
            0.0,
            5.0,
            -60.0,
            60j,
            62 * np.exp(0.1j),
            70 * np.exp(-1.0j),
            90 * np.exp(0.5j),
            12 * np.exp(2j),
            0.0,
        ]
    )
    least = 6e-6
    i = vector(replay(unlisted(free, {"least_vector": least}), "locked", u.real, u.imag, U))
    made, kinds = [], []
    for x in u[:-1]:
        whole = leg_means(x, 0.0)
        order, near = np.argsort(-whole), 2.0 * least / TS
        duty, gaps = whole.copy(), -np.diff(whole[order]) < near
        if gaps.all():
            duty[:] = whole.mean()
        elif gaps.any():
            pair = order[:2] if gaps[0] else order[1:]
            duty[pair] = whole[pair].mean()
        made.append((2 * duty[0] - duty[1] - duty[2]) / 3 + 1j * (duty[1] - duty[2]) / math.sqrt(3))
        kinds.append(tuple(gaps))
    assert np.diff(i) * L == pytest.approx(TS * U * np.array(made), abs=1e-9)
    assert set(kinds) == {(True, True), (True, False), (False, True), (False, False)}


@pytest.mark.parametrize(
    ("current", "volts", "told"),
    [
        ([0.0, 1.0], [0.0], "as many of each"),
        ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0], "do not rise"),
        ([0.0, 1.0], [0.0, math.nan], "not finite"),
        ([0.1, 1.0], [0.2, 1.0], "begin it with 0 V at 0 A"),
    ],
)
def test_a_table_that_is_none_is_refused(current, volts, told):
    with pytest.raises(BadInput, match=told):
        leg_table(current, volts)


def test_other_signs_are_refused():
    with pytest.raises(BadInput, match="unknown shape of the sign 'tan'; did you mean 'tanh'"):
        with_sign(PLAIN, "tan", 1.0)
    with pytest.raises(BadInput, match=r"half_width = 0\.0 A is out of range"):
        with_sign(PLAIN, "linear", 0.0)
