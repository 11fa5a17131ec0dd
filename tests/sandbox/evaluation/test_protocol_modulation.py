"""The protocol's test of drives as they modulate: its cases are what they say, and what its verdict is."""

from __future__ import annotations

import dataclasses
import math

import pytest

from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.errors import BadInput
from model.parameters import MODULATIONS, OVERMODULATIONS
from sandbox.drive.simulate import simulate
from sandbox.evaluation.protocol_modulation import ENOUGH, cases, flying, highest, low_link, modulation
from sandbox.plant.gates.modulation import attainable

DRIVE = load_drive("ipm_exchanged")


def test_every_modulation_is_among_the_cases():
    """Overmodulation is met: more than the circle is needed, less than the hexagon gives on average."""
    found = cases(DRIVE)
    converters = [drive.converter for _, drive in found]
    assert {c.modulation for c in converters} == set(MODULATIONS)
    assert {c.overmodulation for c in converters} == {None, *OVERMODULATIONS}
    assert 1.0 / math.sqrt(3.0) < ENOUGH
    for c in (c for c in converters if c.overmodulation):
        assert c.dc_bus_voltage * ENOUGH < attainable(c)
    assert low_link(DRIVE, 0.3) < DRIVE.converter.dc_bus_voltage
    assert sum(any(s.blocked for s in case.scenario.segments) for case, _ in found) == 2


def test_who_reads_induced_voltage_finds_a_flying_start_who_injects_alone_may_not():
    assert modulation(DRIVE, "active_flux", "saturated", 0).passed is True
    lost = modulation(DRIVE, "inversion", "saturated", 0)
    assert lost.passed is False
    assert lost.metrics["flying start: mean_deg"] is None
    assert lost.metrics["six_step: mean_deg"] < 0.1


def test_a_flying_start_takes_little_current():
    """The first voltage is what the magnets induce: what flows then stays below a quarter of rated current."""
    scenario = flying(0.3, 0.3)
    run = simulate(DRIVE, scenario, load_estimator("active_flux"))
    r = run.recording
    begun = scenario.segments[0].duration + scenario.segments[1].duration
    first = (r.t >= begun) & (r.t < begun + 2e-3)
    blocked = (r.t > begun - 0.09) & (r.t < begun)
    rated = DRIVE.motor.rated_current
    assert abs(r.i_d[blocked]).max() < 1e-6 * rated
    injected = DRIVE.injection.amplitude / DRIVE.motor.inductance_d / (4.0 * DRIVE.injection.frequency)
    assert abs(r.i_q[first]).max() < 0.25 * rated + injected


def test_refused_where_the_current_loop_allows_no_speed():
    slow = dataclasses.replace(DRIVE, motor=dataclasses.replace(DRIVE.motor, rated_speed_rpm=1e5))
    with pytest.raises(BadInput, match="inject faster"):
        highest(slow)
