"""A part of a recording, replayed from its middle: once states have settled, as in the whole
recording."""

import dataclasses
import math

import numpy as np
import pytest

from model.effects import library
from sandbox.gap.excerpts import SETTLED, excerpted
from sandbox.recordings.campaign import Campaign
from sandbox.replay.replay import ACCURACY, prepare, replay, residuals
from tests.sandbox.replay.benches import CASES, DRIVE, MOTION, record, typical

PERIOD = DRIVE.converter.sampling_period
ROWS = math.ceil(
    SETTLED
    * max(DRIVE.motor.inductance_d, DRIVE.motor.inductance_q)
    / DRIVE.motor.resistance
    / PERIOD
)
# of the stretch: the link's ripple (300 Hz, 13.3 samples) is not where it began
FIRST, LAST = 2003, 2500
LAGS = {
    k: v
    for e in (
        "current_filter",
        "iron_loss",
        "skin_effect",
        "pwm_delay",
        "dead_time",
        "current_gain",
        "dc_link_ripple",
    )
    for k, v in typical(e).items()
}
WRONG = 1.0  # A, of the first reading


def campaign(case, effects, n=LAST + 100):
    """Return a campaign of one recording of n samples."""
    return Campaign("bench", DRIVE, (record(effects, *case, n=n),), {}, {}, False)


def of_stretch(prepared, lead, wrong=0.0, values=LAGS, **changed):
    """Return the residuals of the stretch, with so many rows before it, whose first reading is
    off."""
    whole = prepared.recordings[0]
    begun = whole.cut(FIRST - lead, FIRST) if lead else None
    own = whole.cut(FIRST, LAST)
    first = begun or own
    read = first.read.copy()
    read[0] += wrong * np.array([1.0, -0.5, -0.5])
    first = dataclasses.replace(first, read=read, **changed)
    own = dataclasses.replace(own, settling=first) if lead else first
    (found,) = residuals(*predicted(dataclasses.replace(prepared, recordings=(own,)), values))
    return found


def predicted(prepared, values):
    """Return a prepared campaign and what a set predicts for it."""
    return prepared, replay(prepared, [values])


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_start_is_forgotten_in_the_lead(case):
    """A first reading off by 1 A: it decays with L/R at the longest, so after SETTLED of them
    exp(-SETTLED) is left."""
    prepared = prepare(campaign(case, LAGS), LAGS)
    (whole,) = residuals(*predicted(prepared, LAGS))
    apart = [
        np.abs(
            (of_stretch(prepared, lead, WRONG).current - whole.current[FIRST:LAST])[:, :, 0]
            * prepared.noise_std
        )
        for lead in (0, ROWS)
    ]
    print(case, [float(x.max()) for x in apart])
    assert apart[0][1:].max() > 0.5 * WRONG
    assert apart[1].max() < 2.0 * math.exp(-SETTLED) * WRONG


def test_the_link_s_ripple_goes_on_where_it_was():
    prepared = prepare(campaign(CASES[2], LAGS), LAGS)
    (whole,) = residuals(*predicted(prepared, LAGS))
    there, restarted = (
        np.abs(
            (of_stretch(prepared, ROWS, **more).current - whole.current[FIRST:LAST])[:, :, 0]
            * prepared.noise_std
        )
        for more in ({}, {"first": 0})
    )
    ripple = library.typical("dc_link_ripple", DRIVE.motor, DRIVE.converter)
    print(float(there.max()), float(restarted.max()), ripple)
    assert restarted.max() > 20.0 * there.max()


@pytest.mark.parametrize(
    ("case", "effects"), [(CASES[2], LAGS), (CASES[3], typical("shaft_compliance"))]
)
def test_stretches_of_a_long_recording_have_its_residuals(case, effects):
    """Cut by `excerpted`, smoothed and replayed on their own, they stand where the whole recording
    stands.

    The shaft's swing (90 Hz, damping ratio 0.01) that a stretch does not know of at first falls by
    exp(-3.5) in the 2500 rows of 0.25 ms that lead in; it began with about 2 standard deviations of
    an innovation.
    """
    long = campaign(case, effects, 80_000)
    cut = excerpted(long, 60_000)
    assert len(cut.recordings) > 10
    (whole,) = residuals(*predicted(prepare(long, effects, steps=1), effects))
    parts = residuals(*predicted(prepare(cut, effects, steps=1), effects))
    for e, r in zip(cut.excerpts.parts, parts, strict=True):
        own = slice(e.first, e.first + e.rows)
        miss = np.sqrt(np.mean((r.current - whole.current[own]) ** 2))
        turned = 0.0 if r.motion is None else np.sqrt(np.mean((r.motion - whole.motion[own]) ** 2))
        print(e.first, float(miss), float(turned))
        assert miss < ACCURACY, (e, miss)  # what the plant's step may make of a reading, in floors
        assert turned < 2.0 * math.exp(-3.5) + MOTION
