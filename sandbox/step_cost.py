"""What an estimator costs: ns of one step, measured alone on a recorded run, and what its injection costs the motor."""

from __future__ import annotations

import time
from functools import cache
from typing import Any

import numba
import numpy as np
from numba import types

from estimators.contract import ESTIMATE, NONE, SAMPLE, STATE, TUNING, Belief, Sample
from estimators.registry import load_estimator
from model.compiled import kernel_as
from model.energy import flux_newton, torque
from model.frames import stationary
from model.parameters import Drive
from sandbox.design import belief_of, design
from sandbox.injection import carrier
from sandbox.scenario import Scenario, Segment
from sandbox.simulate import simulate

ROUNDS = 5  # the fastest counts: the machine's moods only add
LOADED = Scenario("cost", (Segment(0.6, 1.0, ramp=0.1, settle=0.3),), start_up=False)


def _through(step, state, samples, belief, tuning):
    """Step through samples (n, 5); return the last angle."""
    theta = 0.0
    for k in range(samples.shape[0]):
        s = samples[k]
        theta = step(state, Sample(s[0], s[1], s[2], s[3], s[4]), belief, tuning).theta
    return theta


@cache
def _compiled(belief: Any) -> Any:
    step = types.FunctionType(ESTIMATE(STATE, SAMPLE, belief, TUNING))
    table = types.Array(types.float64, 2, "C")
    return kernel_as(types.float64(step, STATE, table, belief, TUNING))(_through)


def step_ns(drive: Drive, name: str, belief: Belief, samples: np.ndarray) -> float:
    """Return the cost of one step in ns on samples (n, 5: i_alpha, i_beta, u_alpha, u_beta, carrier)."""
    estimator, tuning = load_estimator(name), design(drive, start_up=False).tuning
    run: Any = _compiled(numba.typeof(belief)) if estimator.compiled else _through
    step, best = estimator.step_for(belief), np.inf
    part = samples if estimator.compiled else samples[:200]
    for _ in range(ROUNDS if estimator.compiled else 1):
        state = estimator.init(belief, tuning, LOADED.start_angle)
        begun = time.thread_time()
        run(step, state, part, belief, tuning)
        best = min(best, time.thread_time() - begun)
    return best / len(part) * 1e9


def cost(drive: Drive, name: str, belief: str, seed: int) -> dict[str, float | None]:
    """Return what an estimator costs at rated load and standstill, locked.

    step_ns; injected_v: amplitude; ripple_a: rms of the current around its mean, both axes together; loss_w: copper
    loss of that ripple (iron loss not counted); torque_ripple: rms over the mean torque.
    """
    estimator = load_estimator(name)
    run = simulate(drive, LOADED, estimator, belief, closed_loop=False, seed=seed)
    r = run.recording
    read = [stationary(*row) for row in zip(r.i_a, r.i_b, r.i_c, strict=True)]
    commanded = np.column_stack([r.u_alpha, r.u_beta])
    primitive = carrier(drive.injection, drive.converter).primitive
    samples = np.column_stack([read, np.vstack([[0.0, 0.0], commanded[:-1]]), np.resize(primitive, len(commanded))])
    late = r.between(run.start_time + 0.3, LOADED.duration)
    motor = drive.motor
    ripple = np.hypot(late.i_d - late.i_d.mean(), late.i_q - late.i_q.mean())
    torques, d, q = [], 0.0, 0.0
    for i_d, i_q in zip(late.i_d, late.i_q, strict=True):
        d, q, _ = flux_newton(motor.energy, float(i_d), float(i_q), d, q)
        torques.append(torque(motor.energy, d, q, motor.magnet_flux, float(motor.pole_pairs)))
    square = float(np.mean(ripple**2))
    return {
        "step_ns": step_ns(drive, name, belief_of(drive, belief), np.ascontiguousarray(samples)),
        "injected_v": 0.0 if estimator.injection == NONE else drive.injection.amplitude, "ripple_a": square**0.5,
        "loss_w": 1.5 * motor.resistance * square,
        "torque_ripple": float(np.std(torques) / abs(np.mean(torques))),
    }  # fmt: skip
