"""The free regression finds back what was put into the residual, and nothing in noise."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from model.energy import Energy
from model.energy import currents as currents_of
from sandbox.gap.evidence import regression
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.regression import (
    DRAWS,
    RIDGE,
    Remains,
    judged,
    regressors,
    remains,
    scalars,
)
from sandbox.gap.evidence.response import added_current
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import Residual, prepare, replay
from tests.sandbox.gap.conftest import DRIVE, record

HELD = (1, 4)
CASES = [(f"run_{k}", "driven", 8.0 * (k + 1), 8.0 + k) for k in range(6)]
STEPS = 1e-6 * np.eye(2)
RATED = DRIVE.motor.rated_current


@pytest.fixture(scope="module")
def quiet():
    """A prepared campaign of six turning recordings, its nominal point, and what that predicts (n,
    3)."""
    rng = np.random.default_rng(3)
    recordings = tuple(record(*case, {}, rng) for case in CASES)
    prepared = prepare(Campaign("six", DRIVE, recordings, {}, {}, False))
    point = ParameterPoint(prepared, complete(DRIVE.motor, DRIVE.converter))
    return point, [c[:, :, 0] for c in replay(prepared, [point.values]).currents]


def recorded(point, currents, added, seed):
    """Return the point of the campaign that reads: what is predicted, what `added` (n,) complex
    gives, white noise."""
    rng = np.random.default_rng(seed)
    prepared, out = point.prepared, []
    for r, i, extra in zip(prepared.campaign.recordings, currents, added, strict=True):
        read = (
            i
            + np.column_stack([extra.real, extra.imag]) @ LEGS.T
            + prepared.noise_std * rng.standard_normal(i.shape)
        )
        out.append(
            dataclasses.replace(
                r, columns={**r.columns, **dict(zip(("i_a", "i_b", "i_c"), read.T, strict=True))}
            )
        )
    campaign = dataclasses.replace(prepared.campaign, recordings=tuple(out))
    return ParameterPoint(prepare(campaign, steps=prepared.steps), point.values)


def rotor_frame(point, currents):
    """Return (i_d + j i_q over rated current, angle, speed) of each recording."""
    for r, i in zip(point.prepared.recordings, currents, strict=True):
        z = (2.0 / 3.0) * i @ LEGS
        yield (
            (z[:, 0] + 1j * z[:, 1]) * np.exp(-1j * r.motion.angle) / RATED,
            r.motion.angle,
            r.motion.speed,
        )


def found_and_put_in(quiet, functions, seed=0):
    """Return Remains of a campaign with a function of the operating point added to its currents;
    its energy (floors^2) on the recordings held out, samples there, columns of the regression."""
    point, currents = quiet
    turned = [
        f * np.exp(1j * r.motion.angle)
        for f, r in zip(functions, point.prepared.recordings, strict=True)
    ]
    put = sum(1.5 * np.sum(np.abs(functions[k]) ** 2) for k in HELD) / point.prepared.noise_std**2
    own = recorded(point, currents, turned, seed)
    return remains(own, HELD, before=math.sqrt(2.0)), put


def tolerance(put, columns, share_fitted):
    """Return what noise may change of the energy taken off: three standard deviations 2 sqrt(put)
    of the cross term, and what estimating so many coefficients loses, their variance times held-out
    over fitted samples."""
    return 6.0 * math.sqrt(put) + columns / share_fitted


def test_what_was_put_in_is_found_back(quiet):
    """A product of currents and a sixth harmonic, three floors rms: both in the span, so only noise
    is lost."""
    point, currents = quiet
    size = 9.0 * point.prepared.noise_std
    f = [
        size * (z.real * z.imag + 1j * z.imag * np.cos(6.0 * th))
        for z, th, _ in rotor_frame(point, currents)
    ]
    r, put = found_and_put_in(quiet, f)
    columns, samples = (
        regressors(point, currents)[0].x.shape[2],
        4 * sum(len(currents[k]) for k in HELD),
    )
    taken = r.of_gap * samples  # before = sqrt 2: of_gap is the drop of J^2
    print(r, put, taken, put / samples)
    assert put > 10.0 * tolerance(put, columns, 2.0)
    assert put - tolerance(put, columns, 2.0) < taken < put + 6.0 * math.sqrt(put)
    assert r.structure


def test_a_voltage_of_another_shape_is_found_for_the_most_part(quiet):
    """A voltage drop tanh(2 i_q) that no column holds; what the columns miss of it (least squares)
    may be lost.

    Its current comes from the motor's own equations by an independent way: small steps of the flux
    itself.
    """
    point, currents = quiet
    drop = [0.4j * np.tanh(2.0 * z.imag) for z, _, _ in rotor_frame(point, currents)]
    held = [k for k, _ in enumerate(currents) if k in HELD]
    states = [list(rotor_frame(point, currents))[k] for k in held]
    x = np.concatenate(
        [
            np.column_stack([f for f, _ in scalars(np.c_[z.real, z.imag], w / 48.0, th)])
            for z, th, w in states
        ]
    )
    y = np.concatenate([drop[k].imag for k in held])
    missed = np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2) / np.sum(y**2)
    f = [
        euler(v, z * RATED, th)
        for v, (z, th, _) in zip(drop, rotor_frame(point, currents), strict=True)
    ]
    r, put = found_and_put_in(quiet, f)
    columns, samples = (
        regressors(point, currents)[0].x.shape[2],
        4 * sum(len(currents[k]) for k in HELD),
    )
    taken = r.of_gap * samples
    print(r, put, taken, missed, max(np.max(np.abs(z)) for z, _, _ in rotor_frame(point, currents)))
    assert missed < 0.02
    assert (1.0 - missed) * put - tolerance(put, columns, 2.0) < taken < put + 6.0 * math.sqrt(put)


def currents_at(m, flux):
    """Return the motor's currents (2, n) at fluxes (2, n)."""
    return np.array(currents_of.py_func(m, *flux))


def euler(v, current, theta, fine=20):
    """Return the current (n,) complex, rotor frame, that a small voltage adds: fluxes by Newton's
    rule at all operating points, stepped by Euler's rule, `fine` steps a sample."""
    m, period = DRIVE.motor.energy, DRIVE.converter.sampling_period
    asked, at = np.stack([current.real, current.imag]), np.zeros((2, len(current)))
    for _ in range(20):  # Newton's rule with slopes by differences
        columns = [currents_at(m, at + e[:, None]) - currents_at(m, at - e[:, None]) for e in STEPS]
        inverse = np.stack(columns).transpose(2, 1, 0) / (2.0 * STEPS[0, 0])
        at = at - np.linalg.solve(inverse, (currents_at(m, at) - asked).T[:, :, None])[:, :, 0].T
    assert np.allclose(currents_at(m, at), asked, atol=1e-9)
    psi, out = np.zeros(2), np.zeros(len(current), dtype=complex)
    for k in range(len(current) - 1):
        turn = (theta[k + 1] - theta[k]) / fine
        back = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        for s in range(fine):
            mean = v[k] + (v[k + 1] - v[k]) * (s + 0.5) / fine
            i = inverse[k] @ psi
            psi = back @ (
                psi
                + period / fine * (np.array([mean.real, mean.imag]) - DRIVE.motor.resistance * i)
            )
        out[k + 1] = complex(*(inverse[k + 1] @ psi))
    return out


def test_response_of_a_linear_motor_is_the_textbooks():
    """A step of voltage on a linear axis at standstill: i = u/R (1 - exp(-R t/L)), implicit steps
    of T/10000."""
    L, R, T = 0.05, 10.0, 1e-6
    m = Energy(1 / L, 1 / L, 0.0, 0.0, 0.0, 0.0, 0.0)
    n = 20_000
    v = np.zeros((n, 1, 2))
    v[:, 0, 1] = 2.0
    i = added_current(m, R, T, np.zeros((n, 2)), np.zeros(n), v)[:, 0]
    assert np.allclose(i[:, 0], 0.0)
    expected = 2.0 / R * (1.0 - np.exp(-R / L * T * np.arange(n)))
    # first order: one step's change
    assert np.allclose(i[:, 1], expected, atol=2.0 / R * R / L * T)


def test_white_noise_leaves_nothing(quiet):
    """5 seeds of white noise: at a level of 1 % two or more alarms have a chance of 0.1 %
    (binomial)."""
    point, currents = quiet
    parts = regressors(point, currents)
    samples, columns = 4 * sum(len(currents[k]) for k in HELD), parts[0].x.shape[2]
    alarms, taken, alike = 0, [], []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        noise = [
            Residual(
                r.file,
                r.rotor,
                rng.standard_normal((r.samples, 3, 1)),
                None,
                rng.standard_normal((r.samples, 1)),
            )
            for r in point.prepared.recordings
        ]
        r = judged(parts, noise, HELD, before=math.sqrt(2.0))
        alarms += r.structure
        taken.append(r.of_gap)
        alike.append(r.alike)
    print(alarms, max(taken), np.mean(alike))
    assert alarms <= 1
    assert max(taken) < columns / samples  # less than fitting the noise held out itself would give
    # some 100 block sums a seed: 3 sqrt(2 / 100 / 5) = 0.19
    assert np.mean(alike) == pytest.approx(1.0, abs=0.19)


def test_nothing_held_out_is_no_bound(quiet):
    assert remains(quiet[0], (), before=2.0) is None
    assert isinstance(remains(quiet[0], HELD, before=2.0), Remains)
    assert DRAWS >= 2 / 0.01  # so that the chance can fall below the level
    assert min(RIDGE) < 1e-3


@pytest.mark.parametrize(("chance", "structured"), [(0.009, True), (0.011, False)])
def test_structure_is_what_noise_makes_in_less_than_one_of_a_hundred(chance, structured):
    assert Remains(1.0, 0.5, None, None, chance, 1.0).structure == structured


def test_the_interval_holds_95_percent(monkeypatch):
    """Of 400 blocks whose sum has a deviation of s the interval ends 1.96 s from it, over 40 seeds
    (s.e. 0.02 s)."""
    each = np.random.default_rng(1).standard_normal(400) + 5.0
    monkeypatch.setattr(regression, "_gains", lambda *_: (np.full(DRAWS, each.sum()), each))
    monkeypatch.setattr(regression, "_alike", lambda *_: 1.0)
    part = SimpleNamespace(recording=0, starts=np.zeros(1, int), channel="currents")
    monkeypatch.setattr(regression, "component", lambda p, shown: np.zeros((1, 1)))
    # an excess of 3 over 12000 squares
    shown = [Residual("a", "locked", np.full((4000, 3, 1), 2.0), None, None)]
    found = np.array([judged([part], shown, (0,), 2.0, seed).closable_ci95 for seed in range(40)])
    off = (found * 3.0 * 12_000 - each.sum()) / (each.std() * math.sqrt(len(each)))
    assert off.mean(0) == pytest.approx([-1.96, 1.96], abs=0.08)
