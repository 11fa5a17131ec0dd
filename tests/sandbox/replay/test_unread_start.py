"""The unread flux at a recording's first sample: its answers against the closed form of a linear
motor, its whitening against the covariance that it is of, and a recording that begins in a turn
against the noise that was put in."""

import dataclasses
import math

import numpy as np
import pytest

from model.parameters import Motor
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import prepare
from sandbox.replay.unread_start import OF_VECTOR, answers, with_starts
from tests.sandbox.replay.benches import DRIVE, record

PERIOD, NOISE = DRIVE.converter.sampling_period, 0.02  # A rms of one reading
LINEAR = dataclasses.replace(
    DRIVE,
    motor=dataclasses.replace(
        DRIVE.motor,
        **{n: 0.0 for n in Motor.__dataclass_fields__ if n.startswith("alpha_")},
    ),
    converter=dataclasses.replace(DRIVE.converter, current_noise=NOISE, current_resolution=0.0),
)


def from_row(recorded, first):
    """Return a recording from a row on, as one that begins there."""
    return dataclasses.replace(
        recorded,
        columns={
            k: v[first:] - (v[first] if k == "t" else 0.0) for k, v in recorded.columns.items()
        },
    )


def prepared_of(recorded, drive=LINEAR):
    """Return one recording, ready for replay."""
    return prepare(Campaign("own", drive, (recorded,), {}, {}, False), steps=1)


def test_noise_of_a_component_is_that_of_the_transformations_row():
    """Three independent readings of one variance: x_alpha = 2/3 (a - b/2 - c/2)."""
    rows = 2.0 / 3.0 * LEGS
    np.testing.assert_allclose(np.sqrt(np.sum(rows**2, axis=0)), OF_VECTOR, rtol=1e-12)


def test_answers_of_a_linear_motor_decay_with_its_time_constants():
    """Locked at theta: a current that is one deviation off along d (q) decays as e^(-R t/L_d), and
    phases read it by the angle (L_q).  The rotor stands at 0.3 rad."""
    motor, theta = LINEAR.motor, 0.3
    p = prepared_of(from_row(record({}, "locked"), 150))
    (r,) = p.recordings
    assert r.loaded
    found = answers(p, r, complete(motor, LINEAR.converter))
    t = PERIOD * np.arange(len(found))
    for axis, (inductance, turned) in enumerate(
        ((motor.inductance_d, theta), (motor.inductance_q, theta + 0.5 * math.pi))
    ):
        phase = np.cos(turned - np.array([0.0, 2.0, -2.0]) * math.pi / 3.0)
        size = OF_VECTOR * NOISE * np.exp(-motor.resistance / inductance * t)
        # midpoint steps of at most half a period: (R T/2L)^3/24 a step, x = R T/L = 0.07: of the
        # first size at most 2 (x/2)^3/24 / (e x) = 2e-5
        off = 2e-5 * OF_VECTOR * NOISE
        np.testing.assert_allclose(
            found[1:, :, axis], (size[:, None] * phase)[1:], rtol=0.0, atol=off
        )
    assert not found[0].any()  # the first current is the one read


def test_whitening_acts_however_an_array_lies_in_memory():
    """Every other column of a wider array, and sets first in memory, as indexing leaves them."""
    (r,) = with_starts(prepared_of(record({}, "locked", n=40))).recordings
    y = np.random.default_rng(2).standard_normal((40, 3, 4))
    plain, wide, turned = y.copy(), np.zeros((40, 3, 8)), np.asfortranarray(y)
    wide[:, :, ::2] = y
    for x in (plain, wide[:, :, ::2], turned):
        r.start.taken_off(x)
    assert not np.array_equal(plain, y)
    np.testing.assert_allclose(wide[:, :, ::2], plain, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(turned, plain, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("rotor", ["locked", "driven"])
def test_whitening_is_the_root_of_the_covariance(rotor):
    """Squares of whitened residuals are y'(I + C C')^-1 y."""
    p = with_starts(prepared_of(record({}, rotor, 20.0 if rotor == "driven" else 0.0, n=60)))
    (r,) = p.recordings
    c = (answers(p, r, complete(LINEAR.motor, LINEAR.converter)) / p.noise_std).reshape(-1, 2)
    y = np.random.default_rng(1).standard_normal((60, 3, 4))
    flat = y.reshape(180, 4).copy()
    expected = flat.T @ np.linalg.solve(np.eye(180) + c @ c.T, flat)
    r.start.taken_off(y)
    np.testing.assert_allclose(y.reshape(180, 4).T @ y.reshape(180, 4), expected, rtol=1e-10)


def test_a_recording_that_begins_in_a_turn_keeps_noise_alone():
    """Three times the motor's saliency, 100 rad/s: what the first reading is off by comes round to
    the d axis.  Where it counts as known it adds the squares of C's singular values to those of
    noise, sum s^2 (2 a^4 + 2 b^4 the variance); whitened residuals keep noise alone."""
    motor = dataclasses.replace(LINEAR.motor, inductance_q=6.0 * LINEAR.motor.inductance_d)
    drive = dataclasses.replace(LINEAR, motor=motor)
    whole, rng, draws = record({}, "driven", 100.0, drive=drive), np.random.default_rng(5), 200
    first = 150 + int(np.argmax(np.abs(whole.columns["i_a"][150:250])))
    values, known, unread = complete(motor, drive.converter), [], []
    for _ in range(draws):
        noisy = {
            k: whole.columns[k] + NOISE * rng.standard_normal(700) for k in ("i_a", "i_b", "i_c")
        }
        begun = from_row(dataclasses.replace(whole, columns=whole.columns | noisy), first)
        p = prepared_of(begun, drive)
        assert p.recordings[0].loaded
        (r,) = with_starts(p).recordings
        s = 1.0 / (1.0 - r.start.share) ** 2 - 1.0
        for found, to in ((p, known), (dataclasses.replace(p, recordings=(r,)), unread)):
            n = normal(ParameterPoint(found, values), ())
            current = next(x for x in n.segments if x.channel == "current")
            to.append(float(current.ssr.sum() - current.n.sum()))
    count = 3.0 * (700 - first)
    expected, scatter = s.sum(), math.sqrt((2.0 * count + 2.0 * s @ s) / draws)
    assert expected > 0.2 * count  # J of 1.1 where the start counts as known
    assert expected > 2.0 * 3.0 * scatter  # so many draws tell its size
    assert abs(np.mean(known) - expected) < 3.0 * scatter
    assert abs(np.mean(unread)) < 3.0 * math.sqrt(2.0 * count / draws)
