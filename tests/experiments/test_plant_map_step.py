"""What a flux map's step leaves out: the equation against what the bench and the plant differ
by."""

import dataclasses

import pytest

from experiments.plant_against_bench import SETTLED, apart, record
from experiments.plant_map_step import bent, inverse_inductance, left_out
from model.drive_files import load_drive
from sandbox.recordings.campaign import Campaign
from sandbox.replay.replay import prepare
from tests.data import real_data


@pytest.fixture(scope="module")
def drive():
    """A motor with a measured map, its encoder fine enough not to show."""
    real_data()
    found = load_drive("brusa_hsm1")
    return dataclasses.replace(
        found, converter=dataclasses.replace(found.converter, encoder_counts=1 << 20)
    )


def test_the_equation_says_what_is_seen(drive):
    """At 600 rad/s: 16.2 ppm by the equation, 15.9 between plant and bench
    (results/plant/against_bench.md)."""
    found = [record(drive, {}, "driven", 600.0, 1.0)]
    prepared = prepare(Campaign("bench", drive, (found[0][0],), {}, {}, False), {}, steps=1)
    (seen,) = apart(drive, found, prepared, {})
    assert left_out(drive, *found[0], {}, SETTLED) == pytest.approx(seen, rel=0.1)


def test_the_third_derivative_is_the_hessian_s_slope(drive):
    """Twice the change, four times as much; along a change, half of it is what the Hessian grows by
    over it, times it.

    A polynomial's cell is cubic, so central differences of its Hessian are exact but for rounding.
    """
    m, z, change = drive.motor.energy, 0.011 + 0.017j, 1e-4 + 2e-4j
    once, twice = (bent(m, z, x * change, 1e-5) for x in (1.0, 2.0))
    assert twice == pytest.approx(4.0 * once, rel=1e-6)
    grown = inverse_inductance(m, z + 0.1 * change) - inverse_inductance(m, z - 0.1 * change)
    assert once == pytest.approx(complex(*(5.0 * grown @ (change.real, change.imag))), rel=1e-3)
    assert bent(m, z, 0j, 1e-5) == 0.0
