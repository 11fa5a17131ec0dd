"""What an estimator costs: ns of one step, measured alone on a recorded run, and what its injection
costs the motor."""

from __future__ import annotations

import time
from typing import Any

import numba
import numpy as np
from numba import types

from estimators.contract import (
    ESTIMATE,
    OVERSAMPLED,
    PULSATING,
    RANDOM,
    ROTATING,
    SAMPLE,
    STATE,
    TUNING,
    Belief,
    Estimator,
    Oversampled,
    as_sample,
)
from estimators.registry import AnyEstimator, load_estimator
from model.compiled import compiled_as
from model.energy import flux_newton, hessian, torque
from model.errors import BadInput, PhysicsError
from model.frames import stationary
from model.parameters import Drive
from sandbox.drive.design import belief_of, design
from sandbox.drive.feasible import first_state, step_of
from sandbox.drive.inside import USUAL_READINGS, commanded, shift_of, shift_pulses
from sandbox.drive.recording import Recording
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.evaluation.injection_cost import InjectionCost, injection_cost
from sandbox.plant.gates.modulation import modulated, modulation_of
from sandbox.recordings.injection import carrier, samples_per_period

ROUNDS = 5  # the fastest counts: the machine's moods only add
SPEEDS = (0.3, 0.2, 0.15, 0.1)  # of rated
ADDED = ("copper_w", "loss_share", "torque_nm", "sound_db", "tone_db", "link_a")
LOADED = Scenario("cost", (Segment(0.6, 1.0, ramp=0.1, settle=0.3),), start_up=False)


def _through(step, state, samples, belief, tuning):
    """Step through samples (n, 5); return the last angle."""
    theta = 0.0
    for k in range(samples.shape[0]):
        theta = step(state, as_sample(samples[k]), belief, tuning).theta
    return theta


def _through_inside(step, state, samples, belief, tuning, readings):
    """The same with readings (n, m, 4) inside every period."""
    theta = 0.0
    for k in range(samples.shape[0]):
        s = as_sample(samples[k])
        inside = Oversampled(s.i_alpha, s.i_beta, s.u_alpha, s.u_beta, s.carrier, readings[k])
        theta = step(state, inside, belief, tuning).theta
    return theta


def _compiled(belief: Any, inside: bool) -> Any:
    step = types.FunctionType(ESTIMATE(STATE, OVERSAMPLED if inside else SAMPLE, belief, TUNING))
    table = types.Array(types.float64, 2, "C")
    signature = [step, STATE, table, belief, TUNING] + inside * [types.Array(types.float64, 3, "C")]
    return compiled_as(types.float64(*signature), _through_inside if inside else _through)


def readings_like(drive: Drive, samples: np.ndarray) -> np.ndarray:
    """Return readings (n, m, 4) between samples (n, 5): straight lines and a ripple turning its
    sign."""
    n, m = len(samples), drive.converter.readings or USUAL_READINGS
    x = (np.arange(m) + 0.5) / m
    last = np.vstack([samples[:1], samples[:-1]])
    ripple = (
        1e-3
        * drive.motor.inductance_d
        * drive.motor.rated_current
        * np.abs(x - 0.5)
        * (-1.0) ** np.arange(n)[:, None]
    )
    found = np.empty((n, m, 4))
    for axis in (0, 1):
        line = last[:, axis, None] + x * (samples[:, axis] - last[:, axis])[:, None]
        found[:, :, axis] = line + ripple / drive.motor.inductance_d
        found[:, :, 2 + axis] = (
            drive.converter.sampling_period * x * samples[:, 2 + axis, None] + ripple
        )
    return found


def step_ns(drive: Drive, name: AnyEstimator, belief: Belief, samples: np.ndarray) -> float:
    """Return the cost of one step in ns on samples (n, 5: i_alpha, i_beta, u_alpha, u_beta,
    carrier)."""
    estimator = load_estimator(name)
    tuning = design(drive, start_up=False, published=estimator.takes_published).tuning
    run: Any = _compiled(numba.typeof(belief), estimator.inside) if estimator.compiled else _through
    inside = [readings_like(drive, samples)] if estimator.inside else []
    step, best = step_of(estimator, belief), np.inf
    part = samples if estimator.compiled else samples[:200]
    for _ in range(ROUNDS if estimator.compiled else 1):
        state = first_state(estimator, belief, tuning, LOADED.start_angle)
        begun = time.thread_time()
        run(step, state, part, belief, tuning, *inside)
        best = min(best, time.thread_time() - begun)
    return best / len(part) * 1e9


def pwm_ripple(
    drive: Drive, u: complex, theta: float, gamma: tuple[float, float, float], shift: float
) -> float:
    """Return the rms (A, both axes) of the current's ripple inside the PWM period.

    u: mean voltage (V, stator frame); gamma: Hessian (1/H) in the rotor frame at theta (rad);
    shift: s, of the pulses.
    """
    h, u_dc = drive.converter.sampling_period, drive.converter.dc_bus_voltage
    how = modulation_of(drive.converter)
    duty, x, legs, square = (
        modulated(how, u.real, u.imag, u_dc),
        (np.arange(400) + 0.5) / 400,
        np.zeros(3),
        0.0,
    )
    for k in range(6):
        shift_pulses(legs, k, shift)
        psi = np.array([complex(*commanded(h * t, h, duty, legs, u_dc)) for t in x])
        rest = (psi - np.mean(psi) - h * u * (x - 0.5)) * np.exp(-1j * theta)
        i_d, i_q = (
            gamma[0] * rest.real + gamma[1] * rest.imag,
            gamma[1] * rest.real + gamma[2] * rest.imag,
        )
        square += float(np.mean(i_d**2 + i_q**2)) / 6.0
    return square**0.5


def cost(drive: Drive, name: AnyEstimator, belief: str, seed: int) -> dict[str, float | None]:
    """Return what an estimator costs at rated load, locked and (torque ripple alone) turning as
    fast as it may.

    step_ns; injected_v: amplitude; ripple_a: rms of the sampled current around its mean, both axes
    together;
    pwm_ripple_a: rms of the ripple between samples (pulses shifted where the estimator asks for
    it); loss_w: copper loss of both (iron loss not counted); torque_ripple, torque_ripple_at_speed:
    rms of the sampled torque over its mean; at_speed: of rated; copper_w and on, the same at speed:
    see `injection_cost`, of both together.
    """
    estimator, motor = load_estimator(name), drive.motor
    run = simulate(drive, LOADED, estimator, belief, closed_loop=False, seed=seed)
    r = run.recording
    read = [stationary(*row) for row in zip(r.i_a, r.i_b, r.i_c, strict=True)]
    commanded = np.column_stack([r.u_alpha, r.u_beta])
    primitive = carrier(drive.injection, drive.converter).primitive
    samples = np.column_stack(
        [read, np.vstack([[0.0, 0.0], commanded[:-1]]), np.resize(primitive, len(commanded))]
    )
    late = r.between(run.start_time + 0.3, LOADED.duration)
    square = float(np.mean((late.i_d - late.i_d.mean()) ** 2 + (late.i_q - late.i_q.mean()) ** 2))
    d, q, _ = flux_newton(motor.energy, float(late.i_d.mean()), float(late.i_q.mean()), 0.0, 0.0)
    u, gamma = complex(late.u_alpha.mean(), late.u_beta.mean()), hessian(motor.energy, d, q)
    inside = pwm_ripple(
        drive,
        u,
        float(late.theta[0]),
        gamma,
        shift_of(drive.converter) if estimator.inside else 0.0,
    )
    speed, turning, fast = at_speed(drive, estimator, belief, seed)
    still = injection_cost(drive, late, motor, None, estimator.inside)
    added = {name: None if still is None else getattr(still, name) for name in ADDED}
    added |= {f"{name}_at_speed": None if fast is None else getattr(fast, name) for name in ADDED}
    return {
        "step_ns": step_ns(drive, name, belief_of(drive, belief), np.ascontiguousarray(samples)),
        "injected_v": drive.injection.amplitude
        if estimator.injection in (PULSATING, ROTATING, RANDOM)
        else 0.0,
        "ripple_a": square**0.5,
        "pwm_ripple_a": inside,
        "loss_w": 1.5 * motor.resistance * (square + inside**2),
        "torque_ripple": torque_ripple(drive, late),
        "torque_ripple_at_speed": turning,
        "at_speed": speed,
        **added,
    }


def torque_ripple(drive: Drive, r: Recording) -> float:
    """Return the rms of the sampled torque around its mean of each injection period, over the whole
    mean."""
    motor, torques, d, q = drive.motor, [], 0.0, 0.0
    n = samples_per_period(drive.injection, drive.converter)
    for i_d, i_q in zip(r.i_d, r.i_q, strict=True):
        d, q, _ = flux_newton(motor.energy, float(i_d), float(i_q), d, q)
        torques.append(torque(motor.energy, d, q, motor.magnet_flux, float(motor.pole_pairs)))
    periods = np.reshape(torques[: len(torques) // n * n], (-1, n))
    return float(np.sqrt(np.mean(np.var(periods, axis=1))) / abs(np.mean(periods)))


def at_speed(
    drive: Drive, estimator: Estimator, belief: str, seed: int
) -> tuple[float | None, float | None, InjectionCost | None]:
    """Return the highest speed of SPEEDS that drive and bus allow (of rated), torque's ripple and
    costs there."""
    for speed in SPEEDS:
        turning = Segment(0.6, 1.0, speed, ramp=0.2, settle=0.3)
        scenario = Scenario("cost at speed", (turning,), "driven", start_up=False)
        try:
            run = simulate(drive, scenario, estimator, belief, closed_loop=False, seed=seed)
        except (BadInput, PhysicsError):
            continue
        late = run.recording.between(run.start_time + 0.35, turning.duration)
        return (
            speed,
            torque_ripple(drive, late),
            injection_cost(drive, late, drive.motor, None, estimator.inside),
        )
    return None, None, None
