"""Linearity error of current sensors as a free curve: its kernel against the curve, in words."""

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.current_linearity import CARD, TERMS, bent, curve, said

DRIVE = load_drive("ipm_exchanged")
RATED = DRIVE.motor.rated_current


def completed(**terms):
    """Return completed values of an effect with some terms."""
    return library.complete(
        DRIVE.motor, DRIVE.converter, {f"current_linearity.{k}": x for k, x in terms.items()}
    )


@pytest.mark.parametrize("reference", [0.0, 2.0])
def test_the_kernel_is_the_curve(reference):
    """Powers written out against Horner's form, both senses."""
    sizes = (0.01, -0.02, 0.004)
    v = completed(**dict(zip(TERMS, sizes, strict=True)), reference=reference)
    i = np.array([-2.5, 0.3, 1.7]) * RATED
    got = np.array(bent(*sizes, reference or RATED, *i)) - i
    np.testing.assert_allclose(
        got, curve(v, DRIVE.motor, DRIVE.converter, i), rtol=1e-9, atol=1e-15
    )


def test_a_cubic_of_three_percent_is_told_in_percent():
    """-3 % of i (i/i_0)^2: three percent at rated current, twelve at twice that."""
    v = completed(third=-0.03)
    text = said(v, DRIVE.motor, DRIVE.converter)
    assert "(-3 %) off at rated current" in text
    assert "(-12 %) at twice rated current" in text
    assert "compare the sensors" in CARD.do(v, DRIVE.motor, DRIVE.converter)
