"""Medium sizes of what is planted: every number of an effect, not only the one that ranges name."""

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects.library import typical
from sandbox.withheld.making.effect_sizes import medium

DRIVE = load_drive("ipm_exchanged")
AS_ON_CARDS = {  # effects whose medium size is the card's typical one, and the numbers it has
    "winding_asymmetry": ("delta_a", "delta_b"),
    "dc_link_error": ("gain_error",),
    "dc_link_ripple": ("amplitude", "frequency"),
    "device_drop": ("threshold", "on_resistance"),
    "current_filter": ("time_constant",),
    "current_sampling": ("delay",),
    "encoder_eccentricity": ("amplitude_mech",),
    "cogging_torque": ("amplitude",),
    "skin_effect": ("resistance",),
    "iron_loss": ("core_resistance",),
}


@pytest.mark.parametrize("name", AS_ON_CARDS)
def test_a_medium_size_is_the_cards(name):
    """But for signs, phases and time constants, which are drawn."""
    own = medium(name, DRIVE.motor, DRIVE.converter, 1.0, np.random.default_rng(1))
    card = typical(name, DRIVE.motor, DRIVE.converter)
    for number in AS_ON_CARDS[name]:
        key = f"{name}.{number}"
        assert abs(own[key]) == pytest.approx(abs(card[key]), rel=1e-9), key


def test_a_drop_grows_as_a_whole():
    """Threshold and resistance of the devices, both."""
    rng = np.random.default_rng(1)
    one, two = (medium("device_drop", DRIVE.motor, DRIVE.converter, s, rng) for s in (1.0, 2.0))
    assert two == {k: pytest.approx(2.0 * v) for k, v in one.items()}
