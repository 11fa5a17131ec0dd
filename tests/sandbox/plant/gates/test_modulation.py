"""How a drive makes pulses of a voltage: what legs do, by definition; the exact plant beside the
switched bench."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest

from estimators.contract import Sample
from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.errors import BadInput
from model.frames import stationary
from model.parameters import MODULATIONS, OVERMODULATIONS, Converter
from sandbox.drive.feasible import first_state
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import set_up, simulate
from sandbox.plant.edges import duties
from sandbox.plant.gates.modulation import SIX_STEP, attainable, given, modulated, modulation_of
from sandbox.switched.advance import replay as on_bench
from sandbox.switched.bench_numbers import bench, quiet
from sandbox.switched.inverter import leg_duties
from tests.sandbox.plant.effect_motors import vector
from tests.sandbox.plant.exact import Exact

LINK, H = 400.0, 250e-6
DRIVE = load_drive("ipm_exchanged")
WAVE = np.exp(1j * (0.01 + np.linspace(0.0, 2.0 * math.pi, 97)))  # no angle of a corner
SAME = math.degrees(1e-5 / (0.2 * 0.5))  # see test_both_plants
BOUND = 50e-6  # of rated current: what is asked of plants that modulate


def converter(**keys) -> Converter:
    return dataclasses.replace(DRIVE.converter, current_noise=0.0, current_resolution=0.0, **keys)


def legs(size, e, **keys):
    """Return the legs' duties for a voltage (share of the link) in a direction, and the voltage
    they give."""
    duty = modulated(
        modulation_of(converter(**keys)), LINK * size * e.real, LINK * size * e.imag, LINK
    )
    return np.array(duty), complex(*given(duty, LINK)) / LINK


@pytest.mark.parametrize("size", [0.02, 0.3, 0.577])
@pytest.mark.parametrize("pattern", MODULATIONS)
def test_every_pattern_gives_the_voltage_asked_for(pattern, size):
    for e in WAVE:
        duty, got = legs(size, e, modulation=pattern)
        assert got == pytest.approx(size * e, abs=1e-14)
        phase = (size * e * np.exp(-2j * math.pi / 3.0 * np.arange(3))).real
        if pattern == "dpwm_min":
            assert duty[np.argmin(phase)] == pytest.approx(0.0, abs=1e-15)
        if pattern == "dpwm_max":
            assert duty[np.argmax(phase)] == pytest.approx(1.0, abs=1e-15)
        if pattern == "dpwm_60":  # the leg of the largest voltage rests where its voltage points
            most = int(np.argmax(np.abs(phase)))
            assert duty[most] == pytest.approx(1.0 if phase[most] > 0.0 else 0.0, abs=1e-15)


def test_beyond_the_hexagon():
    """`nearest`: no point of the hexagon is nearer; `shortened`: same angle, on the hexagon;
    `six_step`: a corner."""
    corners = 2.0 / 3.0 * np.exp(1j * math.pi / 3.0 * np.arange(7))
    edge = np.concatenate([a + (b - a) * np.linspace(0.0, 1.0, 2001) for a, b in pairwise(corners)])
    for e in WAVE:
        _, got = legs(0.8, e, overmodulation="nearest")
        assert abs(got - 0.8 * e) <= np.abs(edge - 0.8 * e).min() + 1e-12
        _, got = legs(0.8, e, overmodulation="shortened")
        assert np.angle(got / e) == pytest.approx(0.0, abs=1e-12)
        assert np.abs(edge - got).min() < 2e-4  # half of the edge's spacing
        duty, got = legs(0.64, e, overmodulation="six_step")
        assert np.abs(corners - got).min() < 1e-15
        assert set(duty) == {0.0, 1.0}
        assert legs(0.5, e, overmodulation="six_step")[1] == pytest.approx(0.5 * e, abs=1e-14)


def test_six_steps_have_their_textbook_fundamental():
    """2/pi of the link; at the same angle a turn of the hexagon gives its mean radius, sqrt(3)/pi
    ln 3."""
    assert attainable(converter(overmodulation="six_step")) == pytest.approx(
        SIX_STEP * LINK, rel=1e-4
    )
    mean = math.sqrt(3.0) / math.pi * math.log(3.0) * LINK
    assert attainable(converter(overmodulation="shortened")) == pytest.approx(mean, rel=1e-4)
    assert mean < attainable(converter(overmodulation="nearest")) < SIX_STEP * LINK
    assert attainable(converter()) == pytest.approx(LINK / math.sqrt(3.0))


def test_short_pulses_and_gaps_are_dropped():
    least = 5e-6
    for size in (0.01, 0.55, 0.57):
        for e in WAVE:
            on = legs(size, e, least_pulse=least)[0] * H
            plain = np.array(duties(LINK * size * e.real, LINK * size * e.imag, LINK)) * H
            assert all(x in (0.0, H) or (least <= x <= H - least) for x in on)
            stays = (plain >= least) & (plain <= H - least)
            np.testing.assert_array_equal(on[stays], plain[stays])


KEYS = [
    *({"modulation": m} for m in MODULATIONS[1:]),
    *({"overmodulation": o} for o in OVERMODULATIONS),
    {"least_pulse": 5e-6},
    {"modulation": "dpwm_60", "overmodulation": "six_step", "least_pulse": 5e-6},
]
ID = [", ".join(str(v) for v in keys.values()) for keys in KEYS]


@pytest.mark.parametrize("keys", KEYS, ids=ID)
def test_both_plants_form_the_same_duties(keys):
    """Two derivations: common part of three legs, dwell times of space vectors; apart by
    rounding."""
    c = converter(**keys)
    b = bench(DRIVE.motor, c)
    for size in (0.005, 0.2, 0.56, 0.6, 0.65, 0.9):
        for e in WAVE:
            u = LINK * size * e
            ours = modulated(modulation_of(c), u.real, u.imag, LINK)
            theirs = leg_duties(b, u.real, u.imag, LINK)
            np.testing.assert_allclose(ours, theirs, atol=1e-13)


@pytest.mark.parametrize("effects", [{}, {"dead_time.time": 2e-6}], ids=["", "dead time"])
@pytest.mark.parametrize("keys", KEYS, ids=ID)
def test_currents_are_those_of_the_switched_bench(keys, effects):
    """A rotor driven so fast that its magnets' voltage is so much of the link; the voltage turns
    with it."""
    c, k, motor = converter(**keys), np.arange(80), DRIVE.motor
    for size in (0.05, 0.5, 0.62, 0.65):
        omega = size * LINK / motor.magnet_flux
        theta = 0.3 + omega * H * np.arange(len(k) + 1)
        size_q = 1j * size * LINK + 0.5 * motor.resistance * motor.rated_current
        u = size_q * np.exp(1j * (theta[:-1] + 0.5 * omega * H))
        given_at = {"theta": theta[:-1], "speed": np.full(len(k), omega / motor.pole_pairs)}
        r = on_bench(
            quiet(bench(motor, c, effects)),
            "driven",
            u.real.copy(),
            u.imag.copy(),
            LINK,
            **given_at,
        )
        plant = Exact(effects, motor, "driven", 0.3, omega / motor.pole_pairs, c)
        ours = np.array([plant.advance(v) for v in u])
        theirs = vector(r)
        off = np.abs(ours - theirs).max() / motor.rated_current
        print(
            f"{size:g} of the link: {off * 1e6:.2f} ppm of rated current, up to "
            f"{np.abs(theirs).max():.2f} A"
        )
        assert off < BOUND


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"modulation": "dpwm"}, "modulation"),
        ({"modulation": 3}, "text"),
        ({"overmodulation": "six"}, "overmodulation"),
        ({"least_pulse": 1e-4}, "quarter"),
        ({"least_pulse": -1e-6}, "out of range"),
        ({"pwm_frequency": 2000.0, "modulation": "dpwm_60"}, "two updates"),
    ],
)
def test_refusals(keys, said):
    with pytest.raises(BadInput, match=said):
        converter(**keys)


def test_what_is_told_is_what_the_legs_give():
    """Beyond the hexagon the estimator is told the voltage that acts: fed with it, it says the same
    angles again.

    Rated load at 30 % of rated speed needs 0.62 of 96 V, more than the hexagon gives on average.
    """
    segments = (Segment(0.05, 1.0, 0.3, ramp=0.02), Segment(0.05, 1.0, 0.3))
    scenario = Scenario("fast", segments, "driven", start_up=False)
    c = converter(modulation="dpwm_60", overmodulation="six_step", dc_bus_voltage=96.0)
    drive = dataclasses.replace(
        DRIVE, converter=c, injection=dataclasses.replace(DRIVE.injection, amplitude=1.0)
    )
    own, errors = load_estimator("active_flux"), []
    setup = set_up(drive, scenario, own, "saturated")
    for plant in ("exact", "switched"):
        r = simulate(drive, scenario, own, plant=plant).recording
        errors.append(math.degrees(r.between(0.05, 0.1).error.mean()))
        asked = r.u_alpha + 1j * r.u_beta
        legs = [
            modulated(modulation_of(c), u.real, u.imag, link)
            for u, link in zip(asked, r.u_dc, strict=True)
        ]
        acted = np.array([complex(*given(x, link)) for x, link in zip(legs, r.u_dc, strict=True)])
        assert (abs(acted - asked) > 1e-3 * c.dc_bus_voltage).sum() > 10
        assert abs(angles(setup, own, r, acted) - r.theta_hat).max() < 1e-9
        assert abs(angles(setup, own, r, asked) - r.theta_hat).max() > 1e-4
    assert errors[0] == pytest.approx(errors[1], abs=SAME)


def angles(setup, estimator, r, u):
    """Return the angles (rad) that an estimator says of a recording's currents and these voltages
    (V)."""
    tuning, primitive, said = setup.design.tuning, setup.carrier.primitive, []
    state = first_state(
        estimator, setup.believed, tuning, setup.scenario.start_angle + setup.scenario.start_error
    )
    last = np.concatenate([[0.0], u[:-1]])
    for k in range(len(r)):
        i = stationary(r.i_a[k], r.i_b[k], r.i_c[k])
        sample = Sample(*i, last[k].real, last[k].imag, primitive[k % primitive.size])
        said.append(estimator.step(state, sample, setup.believed, tuning).theta)
    return np.array(said)
