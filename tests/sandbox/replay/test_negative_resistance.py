"""Legs that give volts back: the gain against the eigenvalues it mirrors, the decay of what is off
against the closed form of a linear motor, and a recording that latches."""

import dataclasses
import math

import numpy as np
import pytest

from model.effects.dead_time import leg_loss
from model.effects.device_drop import leg_loss as dropped
from model.effects.leg_voltage import CORNERS
from sandbox.plant.sets import complete, soft_current
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.negative_resistance import taken_back
from sandbox.replay.replay import block_of, prepare, replay, residuals
from sandbox.replay.unread_start import with_starts
from sandbox.replay.walking import Running
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from tests.sandbox.replay.benches import DRIVE, NOISE, ROUND, record

LINK = 400.0  # V
PERIOD = DRIVE.converter.sampling_period
ZONE = soft_current(ROUND.motor)
# a leg gives back as many ohms as this many windings take
TIMES = 4.0
TIME = -TIMES * ROUND.motor.resistance * PERIOD * ZONE / LINK
LATE = {"dead_time.time": TIME}
# the same by the free curve, whose first corner is a zone of its own
FIRST = CORNERS[0] * ROUND.motor.rated_current
CURVED = {"leg_voltage.v_1": -TIMES * ROUND.motor.resistance * FIRST}


def campaign_of(recorded):
    """Return a campaign of one recording whose start nobody has read."""
    return with_starts(prepare(Campaign("own", ROUND, (recorded,), {}, {}, False), steps=1))


def by_voltages(p):
    """Return the same campaign, its first fluxes known: nothing is held by readings."""
    recordings = tuple(dataclasses.replace(r, start=None) for r in p.recordings)
    return dataclasses.replace(p, recordings=recordings)


@pytest.mark.parametrize("hold", [0.0, 2.0])
def test_what_legs_give_is_taken_back_along_its_own_axes(hold):
    """numpy's eigenvalues of random symmetric matrices, each with max(s, 2 (s - R), hold) T, g, as
    g/(1 + g/L)."""
    rng, seconds, inverse, winding = np.random.default_rng(3), 1e-4, 200.0, 1.3
    for root in rng.normal(0.0, 1.5, (50, 2, 2)):
        matrix = root @ root.T
        m, v = np.linalg.eigh(matrix)
        own = np.maximum(np.maximum(m, 2.0 * (m - winding)), hold) * seconds
        x = rng.normal(size=2)
        expected = v @ np.diag(own / (1.0 + own * inverse)) @ v.T @ x
        legs = (matrix[0, 0], matrix[0, 1], matrix[1, 1], winding, hold)
        found = taken_back(legs, tuple(x), seconds, inverse)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)


def test_what_is_given_back_is_the_slope_of_what_legs_lose():
    """The cards' own loss curves of a leg, by differences at zero: of a dead time with a zone, with
    a drop beside it that takes one winding's ohms, and with a capacitance, whose line ends where
    the leg just slews over in the dead time.  Nothing where the dead time is positive."""
    drop = {"device_drop.threshold": ROUND.motor.resistance * ZONE}
    sets = [LATE, LATE | drop, LATE | {"dead_time.capacitance": 1e-9}, {"dead_time.time": -TIME}]
    values = [complete(ROUND.motor, ROUND.converter, v) for v in sets]
    p = campaign_of(record({}, "locked", n=20, drive=ROUND))
    given = block_of(p, range(len(sets)), values).given
    i = np.array([1e-3 * ZONE])
    lost = [leg_loss(v, ROUND.converter, i)[0] + dropped(v, i)[0] for v in values[:3]]
    np.testing.assert_allclose(given.ohms[:3], [-u / i[0] for u in lost], rtol=1e-9)
    np.testing.assert_allclose(given.ohms[:2] / ROUND.motor.resistance, [TIMES, TIMES - 1.0])
    np.testing.assert_allclose(given.within[:3], [ZONE, ZONE, 4.0 * 1e-9 * LINK / -TIME])
    assert given.acts
    assert given.ohms[3] == 0.0


def decay(p, size):
    """Return what is left (n,) in A of a current that is off by `size` (A) along phase a at the
    first sample of a recording at rest, in a replay with legs that give back."""
    (r,) = p.recordings
    values = complete(ROUND.motor, ROUND.converter, LATE)
    running = Running.begun(ROUND, p.steps, r, block_of(p, [0], [values]))
    running.batch["psi_alpha"] += ROUND.motor.inductance_d * size
    out = np.empty((r.samples, 3, running.lanes))
    running.on(r.samples, out, np.empty((1, running.lanes)))
    return out[:, 0, 0]


def test_what_is_off_grows_alone_and_decays_when_held_by_readings():
    """Rest, equal inductances, every phase in its zone.  Edges at a quarter and three quarters of a
    period: alone, a period multiplies by e^-r (1 + g/2)^2, r = R T/L and g = s T/L.  Held, it takes
    besides y/(1 + y) of what is read at its start, y = 2 (g - r).
    Tolerance: the midpoint step's r^3/24 and what the current changes while an edge is late (some
    ns of a period), below 1e-5 a period."""
    n = 40
    recorded = record({}, "locked", n=n, drive=ROUND)
    still = {k: np.zeros(n) for k in ("u_alpha", "u_beta", "i_a", "i_b", "i_c")}
    p = campaign_of(dataclasses.replace(recorded, columns=recorded.columns | still))
    size, r = 0.01 * ZONE, ROUND.motor.resistance * PERIOD / ROUND.motor.inductance_d
    k, g, x = np.arange(n), TIMES * r, (TIMES - 1.0) * r
    alone = math.exp(-r) * (1.0 + 0.5 * g) ** 2
    np.testing.assert_allclose(decay(by_voltages(p), size), size * alone**k, rtol=1e-5 * n)
    held = alone - 2.0 * x / (1.0 + 2.0 * x)  # s = 4 R: the mirrored pole is the larger
    np.testing.assert_allclose(decay(p, size), size * held**k, rtol=1e-5 * n)


def latching(effects, zone):
    """Return a recording of the switched bench whose current latches within a zone (A), with noise.

    Phase a lies along d.  Legs give back four times what the winding takes: after a pulse the
    current stays at 16/3 of the zone, where (2 + 1 + 1)/3 times 4 R zone is R i.  A voltage of -V
    takes it from there where V exceeds (16/3 - 2) R zone, the most that holds it, at 2 zones, where
    phases b and c come into their zones; here by 1 %, so slowly.
    """
    motor, n = ROUND.motor, 900
    u = np.zeros(n)
    u[:20], u[150:] = 12.0, -1.01 * (16.0 / 3.0 - 2.0) * motor.resistance * zone
    b = quiet(bench(motor, ROUND.converter, effects))
    out = switched(b, "locked", u, np.zeros(n), LINK, theta=np.zeros(n), speed=0.0)
    rng = np.random.default_rng(7)
    columns = {k: out[k] + NOISE * rng.standard_normal(n) for k in ("i_a", "i_b", "i_c")}
    columns |= {"t": PERIOD * np.arange(n), "u_alpha": u, "u_beta": np.zeros(n)}
    columns |= {"u_dc": np.full(n, LINK), "theta": out["theta"]}
    return CampaignRecording("latches.parquet", "locked", "d", columns)


@pytest.mark.parametrize(("effects", "zone"), [(LATE, ZONE), (CURVED, FIRST)])
def test_a_recording_that_latches_is_followed(effects, zone):
    """By its voltages alone a set whose resistance is 2 % small never lets go, and the true one may
    do so at another time, as its start is known to a reading's noise.  Held by the
    readings both keep their noise: a pole e^x predicts the next reading to e^x times the noise of
    one, x = (s - R) T/L at most, in those rows in which a leg is near zero.  J of 2700 readings
    scatters by 1/sqrt(2 * 2700)."""
    p = campaign_of(latching(effects, zone))
    resistance = 0.98 * ROUND.motor.resistance
    sets = [effects | {"stator_resistance.resistance": resistance}, effects]
    alone = by_voltages(p)
    assert residuals(alone, replay(alone, sets))[0].rms()[0] > 1.5
    near = np.any(np.abs(p.recordings[0].read) < zone, axis=1).mean()
    x = (TIMES - 1.0) * ROUND.motor.resistance * PERIOD / ROUND.motor.inductance_d
    most = math.sqrt(1.0 + near * math.expm1(2.0 * x))
    held = residuals(p, replay(p, sets))[0].rms()
    assert np.all(held < most + 3.0 * 0.014)
    assert np.all(held > 1.0 - 3.0 * 0.014)


def test_a_replay_whose_legs_give_nothing_back_is_held_by_nothing():
    """Legs that lose volts, or none: the same bits."""
    p = campaign_of(record({}, "locked", n=200, drive=ROUND))
    sets = [{}, {"dead_time.time": -TIME}]
    (held,), (alone,) = replay(p, sets).currents, replay(by_voltages(p), sets).currents
    assert np.array_equal(held, alone)
