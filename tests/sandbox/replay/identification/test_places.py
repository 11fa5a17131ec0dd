"""What a fit of ordinary recordings may move, of a practice drive as stated and otherwise."""

import dataclasses

import pytest

from model.effects.card import saturation_size
from sandbox.recordings.campaign import read_folder
from sandbox.replay.identification.places import HARMONICS, NAMES, places
from sandbox.replay.replay import prepare
from tests.data import recordings_folder


def of(**changed):
    """Return the places beside a motor with other values than p03's, and the motor."""
    campaign = read_folder(recordings_folder() / "practice" / "p03")
    motor = dataclasses.replace(campaign.drive.motor, **changed)
    one = [r for r in campaign.recordings if r.file == "locked_steps.parquet"]
    drive = dataclasses.replace(campaign.drive, motor=motor)
    prepared = prepare(dataclasses.replace(campaign, drive=drive, recordings=tuple(one)))
    begin = {n: max(getattr(motor, n), 1e-9) for n in NAMES}
    return places(prepared, begin, motor), motor


def test_every_place_has_room_and_begins_as_stated():
    own, motor = of()
    assert all(p.low < p.high and p.low <= p.begin <= p.high for p in own.values())
    for name in NAMES:
        assert own[name].value(own[name].begin) == pytest.approx(getattr(motor, name))


def test_a_stated_saturation_has_its_stated_deviation_and_none_has_the_usual_size():
    """[uncertainty] of p03 states 3 % of alpha_30, 0.03/(1 - 0.09) of what is stated."""
    own, motor = of()
    assert own["saturation.alpha_30"].deviation == pytest.approx(0.03 / 0.91 * motor.alpha_30)
    own, motor = of(alpha_30=0.0)
    assert own["saturation.alpha_30"].deviation == saturation_size(motor, "alpha_30")


def test_magnets_that_are_not_there_have_no_harmonic():
    own, _ = of(magnet_flux=0.0)
    assert not set(HARMONICS) & set(own)
