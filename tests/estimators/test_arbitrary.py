"""Arbitrary injection: the fitted matrix against windings stepped here, its errors by theory, any
pattern."""

from __future__ import annotations

import cmath
import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm

from estimators import arbitrary, matrix_fit
from estimators.contract import Sample
from estimators.demodulation import blank
from estimators.registry import load_estimator
from model import energy
from model.drive_files import load_drive
from sandbox.drive.design import TRACKING_MARGIN, belief_of, design, frequency_grid, margins
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.evaluation import protocol_tests as t

DRIVE = load_drive("ipm_exchanged")
TUNING = design(DRIVE).tuning
DD, DQ, QQ = (float(g) for g in energy.hessian(DRIVE.motor.energy, 0.02, 0.12))
S, D = 0.5 * (DD + QQ), complex(0.5 * (DD - QQ), DQ)
PATTERNS = [(500.0, "square"), (500.0, "random"), (250.0, "random"), (2000.0, "square")]
H, COUNT = TUNING.sampling_period, 6000


def fitted(samples, turn, resistance, omega, weight=1e-12):
    """Feed (u, i) of the stator frame; return the mean of dS and dD over a belief of zero, seen
    from angles turn(k)."""
    state, found = blank(arbitrary.OWN), []
    for k, (u, i) in enumerate(samples):
        sample = Sample(i.real, i.imag, u.real, u.imag, 0.0)
        f, g = arbitrary.ripples(state, sample, omega, resistance, TUNING)
        back = cmath.exp(-1j * turn(k))
        matrix_fit.add(state, f * back, g * back, 0.98)
        found.append(matrix_fit.solve(state, weight))
    return np.mean(found[500:], axis=0)


def test_matrix_of_a_turning_rotor_without_resistance():
    """Any voltage on both axes: psi is its sum, i = Gamma (psi - magnet) in the rotor frame,
    nothing approximated.

    The leak l a sample delays flux of frequency W - omega h and W + omega h differently, which
    turns the flux by 2 l omega h/W^2 and D by twice that, W about the filter's corner or half of
    it; backwards the other way.
    """
    rng, flux, phases = np.random.default_rng(2), DRIVE.motor.magnet_flux, []
    u = 30.0 * (rng.standard_normal(COUNT) + 1j * rng.standard_normal(COUNT))
    psi, corner = np.cumsum(u) * H + flux, math.pi / TUNING.period
    for omega in (120.0, -120.0):
        axis = 0.4 + omega * H * np.arange(COUNT)
        seen = psi * np.exp(-1j * axis) - flux
        i = (S * seen + D * seen.conj()) * np.exp(1j * axis)
        found_s, found_d = fitted(zip(u, i, strict=True), lambda k, axis=axis: axis[k], 0.0, omega)
        phases.append(cmath.phase(found_d / D))
        assert found_s.real == pytest.approx(S, rel=0.03)
    # by chance: the random walk of psi, some 0.1 of the filtered flux, over the root of 6000/50
    # independent windows
    assert abs(sum(phases)) / 2.0 < 0.01
    assert (
        abs(phases[0] - phases[1]) / 2.0
        < 4.0 * arbitrary.LEAK * corner * 120.0 * H / (0.5 * corner) ** 2
    )


@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2])
def test_error_of_the_frame_is_half_the_turn_of_the_matrix(angle):
    """A winding with resistance by its matrix exponential; the frame is off by `angle`, so D turns
    by twice that."""
    rng, r = np.random.default_rng(3), DRIVE.motor.resistance
    gamma = np.array([[DD, DQ], [DQ, QQ]])
    decay = expm(-r * gamma * H)
    gain = np.linalg.solve(r * gamma, np.eye(2) - decay)
    u, psi, samples = 30.0 * rng.choice([-1.0, 1.0], (COUNT, 2)), np.zeros(2), []
    for v in u:
        psi = decay @ psi + gain @ v
        samples.append((complex(*v), complex(*(gamma @ psi))))
    found_d = fitted(samples, lambda k: -angle, r, 0.0)[1]
    assert 0.5 * cmath.phase(found_d / D) == pytest.approx(angle, abs=0.01)


def test_one_axis_alone_leaves_the_rest_to_the_belief():
    """Only d carries voltage: the cross term is found, along the axis the scale takes what is
    missing."""
    state, rng = blank(arbitrary.OWN), np.random.default_rng(4)
    for _ in range(400):
        f = 0.01 * rng.standard_normal()
        matrix_fit.add(state, complex(f), complex(2.0 * f, 0.7 * f), 0.98)
    d_s, d_d = matrix_fit.solve(state, 1e-5)
    assert d_d.imag == pytest.approx(0.7, rel=0.01)  # rho over the sum of f^2: 1e-5/5e-3
    assert d_s + d_d.real == pytest.approx(2.0, rel=0.01)
    # minimum of c dS^2 + dD^2 at a given sum
    assert d_d.real / d_s == pytest.approx(matrix_fit.SCALE, rel=1e-6)


@pytest.mark.parametrize("motor", ["ipm", "ipm_exchanged", "spm_exchanged"])
def test_gains_of_the_design_keep_their_margin(motor):
    """The loop as the kernel runs it: gains, forgetting, and nothing else between angle and
    error."""
    tuning = design(load_drive(motor)).tuning
    h, keep, w = (
        tuning.sampling_period,
        matrix_fit.forgetting(tuning.period),
        frequency_grid(tuning.sampling_period),
    )
    z = np.exp(1j * w * h)
    loop = (tuning.kp * h + tuning.ki * h * h * z / (z - 1)) / (z - 1) * (1 - keep) / (1 - keep / z)
    assert margins(loop, w)[1] > TRACKING_MARGIN


@pytest.mark.parametrize(("frequency", "waveform"), PATTERNS)
def test_any_pattern_will_do(frequency, waveform):
    """Under 150 % load, carriers of 8, 16 and 2 samples; the goal of the protocol."""
    injection = dataclasses.replace(DRIVE.injection, frequency=frequency, waveform=waveform)
    drive = dataclasses.replace(DRIVE, injection=injection)
    scene = Scenario("s", (Segment(0.8, 1.5, ramp=0.2, settle=0.5),))
    run = simulate(drive, scene, load_estimator("arbitrary"), seed=1)
    error = np.degrees(run.recording.between(run.start_time + 0.5, math.inf).error)
    assert abs(error.mean()) < t.MEAN_GOAL
    assert np.percentile(np.abs(error), 95) < t.P95_GOAL


def test_carrier_is_not_looked_at():
    """Samples whose carrier is spoilt give the same angle to the last bit."""
    belief, rng, ends = belief_of(DRIVE, "saturated"), np.random.default_rng(5), []
    readings = rng.standard_normal((200, 4)) * [0.3, 0.3, 30.0, 30.0]
    for carrier in (0.0, 1e-4):
        estimator = load_estimator("arbitrary")
        state = estimator.init(belief, TUNING, 0.3)
        ends.append(
            [estimator.step(state, Sample(*r, carrier), belief, TUNING).theta for r in readings]
        )
    assert ends[0] == ends[1]


def test_linear_belief_errs_by_the_cross_saturation_angle():
    """Injected along one axis, its null is that of `qnull`: theory by the exact Hessian, within 0.3
    degrees."""
    plane = t.static_map(DRIVE, "arbitrary", "linear", 0)
    assert plane.passed, plane.metrics
