"""A measured inverter table that the nominal model lacks: no named effect is of that form, so the
curve of what a leg loses is the answer.

The switched bench plays the table leg by leg; it is the one that `model/inverter_table.py` shows.
"""

import dataclasses

import numpy as np
import pytest

from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.location.curves import curves_found
from sandbox.gap.report.simulator import refitted
from tests.sandbox.gap.conftest import CASES, DRIVE, TURNING, small_campaign

TABLE = ((0.0, 0.0), (0.2, 2.4), (0.5, 4.4), (1.0, 5.3), (4.5, 6.2))  # A, V


@pytest.fixture(scope="module")
def found():
    """The diagnosis of a bench whose legs lose what the table says."""
    legs = dataclasses.replace(
        DRIVE, converter=dataclasses.replace(DRIVE.converter, inverter_table=TABLE)
    )
    recorded = small_campaign({}, CASES + TURNING, drive=legs)
    return diagnosis_of(dataclasses.replace(recorded, drive=DRIVE), workers=1)


def test_the_curve_is_the_answer(found):
    """Alone, or beside the simpler forms of its place, which its picture holds (a drop of 5.9 V is
    most of a table that ends at 6.2 V).  J scatters by 0.8 % (`test_five_at_once`); five deviations
    are allowed."""
    assert "leg_voltage" in found.best.effects
    assert set(found.best.effects) <= {"leg_voltage", "device_drop", "dead_time"}
    assert found.best.probability > 0.9
    assert found.size.before > 20.0
    assert found.size.after == pytest.approx(1.0, abs=0.04)


def test_it_is_the_table_where_currents_were(found):
    """Within 0.15 V (rms up to rated current): what issue 53 asks for, not derived; 95 % bands hold
    the table at nine of ten places and more.  What the resistance is off counts with it, as no
    recording tells both apart.  The picture holds a drop that is named beside the curve."""
    (c,) = [c for c in curves_found(found.best.evaluated) if c.effect == "leg_voltage"]
    amps, volts = np.array(TABLE).T
    ohm = (
        found.best.evaluated.fit.point.values["stator_resistance.resistance"]
        - DRIVE.motor.resistance
    )
    i = np.linspace(0.0, DRIVE.motor.rated_current, 60)
    off = np.interp(i, c.at, c.value) + ohm * i - np.interp(i, amps, volts)
    assert np.sqrt(np.mean(off**2)) < 0.15
    assert np.max(np.abs(off)) < 0.3
    low, high = (np.interp(i, c.at, ends) + ohm * i for ends in (c.low, c.high))
    true = np.interp(i, amps, volts)
    assert np.mean((low <= true) & (true <= high)) > 0.9
    assert "A threshold of" in c.text


def test_the_simulator_that_is_written_loses_as_much(found):
    """The exported effects hold every term, so a replay of them leaves what is stated: nothing but
    noise."""
    own = refitted(found)
    assert sum(name.startswith("leg_voltage.v_") for name in own.effects) >= 8
    assert all(x == pytest.approx(1.0, abs=0.06) for x in own.residual.values())


def test_a_form_that_is_right_is_named_in_its_place(small_answers):
    """Dead time explains its own curve: nobody asks for another one."""
    d = small_answers.diagnosis
    assert "leg_voltage" not in d.excluded
    assert d.best.effects == ("dead_time",)
    assert not curves_found(d.best.evaluated)
    assert all("leg_voltage" not in h.effects or h.probability < 0.01 for h in d.hypotheses)
