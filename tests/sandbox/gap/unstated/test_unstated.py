"""What was found in a fit's residual is stated only where a fit made again confirms it."""

import dataclasses

import pytest

from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.unstated.pwm_counts import Counted
from sandbox.gap.unstated.unstated import NOTHING, Unstated, confirmed
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, small_campaign

LOW = dataclasses.replace(
    DRIVE, motor=dataclasses.replace(DRIVE.motor, resistance=0.1 * DRIVE.motor.resistance)
)
WEAK = tuple((name, rotor, speed, 0.3 * size) for name, rotor, speed, size in CASES[:2])


@pytest.mark.parametrize(("there", "stated"), [(1000, True), (None, False), (700, False)])
def test_counts_are_stated_where_a_fit_with_them_leaves_so_much_less(there, stated):
    """On the switched bench: 1000 counts as they are, none at all, and another number of them."""
    own = small_campaign({}, WEAK, drive=LOW, counts=there)
    at = ParameterPoint(prepare(own), complete(LOW.motor, LOW.converter))
    weights = weights_of(len(own.recordings))
    before = fit(at, (), weights)
    new = Unstated(Counted(1000, 1000, 1000, 8e6, 1.0, 0.0))
    after = fit(new.at(before.point), (), weights)
    assert confirmed(before, after, new) is stated
    assert not confirmed(before, before, NOTHING)
