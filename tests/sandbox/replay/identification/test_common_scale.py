"""One factor on all that was identified names the DC link; values that differ do not."""

import types

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.recordings.checks.factors import OF_VALUES
from sandbox.replay.identification.common_scale import common_scale

DRIVE = load_drive("ipm_exchanged")


def said(factors, *, uncertainty=None, ripple=1.0, names=tuple(OF_VALUES)):
    """What is said of values so many times the stated ones, each known to 0.5 %."""
    values = {n: k * getattr(DRIVE.motor, n) for n, k in zip(OF_VALUES, factors, strict=True)}
    values = {n: values[n] for n in names}
    fit = types.SimpleNamespace(values=values, deviations={n: 0.005 * v for n, v in values.items()})
    recording = types.SimpleNamespace(u_dc=400.0 + ripple * np.arange(3.0))
    return common_scale(
        fit,
        types.SimpleNamespace(drive=DRIVE, uncertainty=uncertainty or {}, recordings=(recording,)),
    )


@pytest.mark.parametrize("k", [0.85, 1.125, 1.2])
def test_a_common_factor_names_the_link(k):
    """Odds of 3 for 12 % by the usual deviations: 0.5 x 350 x 4/5 x 0.118^2 - 0.5 log(1 + 4)."""
    text = said([k] * 4)
    assert "as a wrong DC link makes them" in text
    assert f"about {400.0 / k:.3g} V would bring them back" in text
    assert "cannot tell that from another motor" in text


def test_well_known_values_tell_a_link_of_five_percent():
    assert said([1.05] * 4) == ""
    known = dict.fromkeys(OF_VALUES, 0.015)
    assert "DC link" in said([1.05] * 4, uncertainty=known)


@pytest.mark.parametrize(
    "factors",
    [
        (1.0, 1.0, 1.0, 1.0),
        (1.3, 0.9, 0.9, 0.95),  # warm, saturated
        (1.5, 1.0, 1.0, 1.0),  # a cable
        (1.02, 1.03, 0.98, 1.01),
        (1.6, 0.7, 1.3, 0.8),  # another motor
    ],
)
def test_values_that_differ_on_their_own_do_not(factors):
    assert said(factors) == ""


def test_two_values_are_alike_by_chance():
    assert said([1.125] * 4, names=("resistance", "inductance_d")) == ""


def test_a_link_that_was_not_measured_could_hide_one():
    text = said([1.0] * 4, ripple=0.0)
    assert "was not measured (400 V is stated)" in text
    assert "off by the same factor" in text
