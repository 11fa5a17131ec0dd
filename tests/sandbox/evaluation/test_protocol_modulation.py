"""The protocol's test of drives as they modulate: its cases are what they say, and what its verdict
is."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.errors import BadInput
from model.parameters import MODULATIONS, OVERMODULATIONS
from sandbox.drive.simulate import simulate
from sandbox.evaluation.protocol_modulation import (
    BEYOND,
    beyond,
    cases,
    flying,
    highest,
    modulation,
    needed,
)
from sandbox.plant.gates.modulation import SIX_STEP, given, modulated, modulation_of

DRIVE = load_drive("ipm_exchanged")


def test_every_modulation_is_among_the_cases():
    found = cases(DRIVE)
    converters = [drive.converter for _, drive in found]
    assert {c.modulation for c in converters} == set(MODULATIONS)
    assert {c.overmodulation for c in converters} == {None, *OVERMODULATIONS}
    assert sum(any(s.blocked for s in case.scenario.segments) for case, _ in found) == 2
    for case, drive in found[-4:-2]:
        assert drive.converter == DRIVE.converter, case.name
        assert drive.injection.amplitude < 0.2 * DRIVE.injection.amplitude


def test_links_are_as_low_as_the_cases_need():
    """By hand: with the injection along d, beyond the circle; for six steps more than the hexagon's
    mean radius."""
    u = needed(DRIVE, 0.3)
    for name in BEYOND:
        link, injection = beyond(DRIVE, 0.3, name)
        assert injection <= 0.05 * link * (1.0 + 1e-12)
        assert link < DRIVE.converter.dc_bus_voltage
        assert max(abs(u + injection), abs(u - injection)) > link / math.sqrt(3.0)
    assert (
        math.sqrt(3.0) / math.pi * math.log(3.0)
        < abs(u) / beyond(DRIVE, 0.3, "six_step")[0]
        < SIX_STEP
    )


OF_VOLTAGE = ("short pulses", *BEYOND)


@pytest.mark.parametrize("name", OF_VOLTAGE)
def test_every_case_meets_what_it_is_named_for(name):
    """Rows in which the modulator changes the voltage asked for; six steps are asked for, too."""
    case, drive = next(found for found in cases(DRIVE) if found[0].name == name)
    r = simulate(drive, case.scenario, load_estimator("ekf")).recording
    how, u = modulation_of(drive.converter), r.u_alpha + 1j * r.u_beta
    got = [
        complex(*given(modulated(how, *x), x[2]))
        for x in zip(r.u_alpha, r.u_beta, r.u_dc, strict=True)
    ]
    changed = abs(np.array(got) - u) > 1e-6 * drive.converter.dc_bus_voltage
    six = abs(u) >= SIX_STEP * r.u_dc
    print(f"{name}: {changed.sum()} of {len(u)} rows changed, {six.sum()} of six steps")
    assert changed.sum() > 0
    assert (six.sum() > 0) == (name == "six_step")


def test_who_reads_induced_voltage_finds_a_flying_start_who_injects_alone_may_not():
    assert modulation(DRIVE, "active_flux", "saturated", 0).passed is True
    lost = modulation(DRIVE, "inversion", "saturated", 0)
    assert lost.passed is False
    assert lost.metrics["flying start: mean_deg"] is None
    assert lost.metrics["dpwm_60: mean_deg"] < 0.1


def test_a_flying_start_takes_little_current():
    """The first voltage is what the magnets induce: what flows then stays below a quarter of rated
    current."""
    scenario = flying(0.3, 0.3)
    run = simulate(DRIVE, scenario, load_estimator("active_flux"))
    r = run.recording
    begun = scenario.segments[0].duration + scenario.segments[1].duration
    first = (r.t >= begun) & (r.t < begun + 2e-3)
    blocked = (r.t > begun - 0.09) & (r.t < begun)
    rated = DRIVE.motor.rated_current
    assert abs(r.i_d[blocked]).max() < 1e-6 * rated
    injected = (
        DRIVE.injection.amplitude / DRIVE.motor.inductance_d / (4.0 * DRIVE.injection.frequency)
    )
    assert abs(r.i_q[first]).max() < 0.25 * rated + injected


def test_refused_where_the_current_loop_allows_no_speed():
    slow = dataclasses.replace(DRIVE, motor=dataclasses.replace(DRIVE.motor, rated_speed_rpm=1e5))
    with pytest.raises(BadInput, match="inject faster"):
        highest(slow)
