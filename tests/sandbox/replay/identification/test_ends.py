"""How far a fit goes: just below what a card forbids."""

import pytest

from model.drive_files import load_drive
from model.effects import library
from sandbox.replay.identification.ends import ends

DRIVE = load_drive("ipm_exchanged")
NEUTRAL = library.neutral(DRIVE.motor)


def test_a_parameter_s_own_limit_is_not_reached():
    """A harmonic of the magnets stays below the magnets' flux, so that it has not the last
    millionth of it."""
    card = library.load_effect("flux_harmonics")
    flux = DRIVE.motor.magnet_flux
    found = ends(card, DRIVE, NEUTRAL)
    assert found["flux_harmonics.psi_d6"] == pytest.approx(flux, rel=1e-5)
    assert found["flux_harmonics.psi_d6"] < flux


def test_a_limit_of_a_sum_is_none_of_a_parameter():
    """Each of two parts has room enough; the sum of both has not, which is no bound of either."""
    card = library.load_effect("flux_harmonics")
    both = {**NEUTRAL, "flux_harmonics.psi_d6": 0.01, "flux_harmonics.2.order": 12.0}
    both |= {"flux_harmonics.2.psi_d": 0.01}
    limits = list(card.limits_at(both, DRIVE.motor, DRIVE.converter))
    sums = {x.name for x in limits if x.size != both.get(x.name)}
    assert sums
    assert not sums & set(ends(card, DRIVE, both))


def test_values_without_limits_have_no_ends():
    """A shaft without a load has no resonance that a limit could speak of."""
    card = library.load_effect("shaft_compliance")
    assert ends(card, DRIVE, {**NEUTRAL, "shaft_compliance.stiffness": 10.0}) == {}
