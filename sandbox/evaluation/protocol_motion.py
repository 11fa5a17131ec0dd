"""The protocol's tests in motion: bandwidth by chirp, hand-over under load, and the reversal of a
peer's example."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from estimators.registry import AnyEstimator, load_estimator
from model.errors import BadInput, PhysicsError
from model.parameters import Converter, Drive, Injection, Motor
from model.saliency import current_for_torque
from sandbox.drive.design import design
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.evaluation.protocol_tests import Case, Outcome, points_of, verdict
from sandbox.evaluation.score import error_of, is_lost

SLOWEST, FASTEST, LENGTH = 1.0, 80.0, 4.0  # Hz; s
SWING = math.radians(8.0)  # largest amplitude of the rotor's angle
FASTEST_SWING = 0.25  # of rated speed: at most this at FASTEST
PIECE = 2e-3  # s of one straight piece of the speed
BLOCK = 0.5  # s of one spectrum's segment
HAND_OVER = (0.3, 0.2, 0.15, 0.1)  # of rated speed: the highest that drive and bus allow


def chirp_scenario(drive: Drive, load: float) -> Scenario:
    """Return a driven rotor whose angle swings, by SWING or as speed allows, from SLOWEST to
    FASTEST."""
    rate = math.log(FASTEST / SLOWEST) / LENGTH
    t = np.arange(1, round(LENGTH / PIECE) + 1) * PIECE
    swing = min(SWING, FASTEST_SWING * drive.motor.rated_omega / (2.0 * math.pi * FASTEST))
    phase = 2.0 * math.pi * SLOWEST / rate * np.expm1(rate * t)
    speed = (
        swing * 2.0 * math.pi * SLOWEST * np.exp(rate * t) * np.cos(phase) / drive.motor.rated_omega
    )
    first = Segment(0.3, load, ramp=0.1, score=False)
    pieces = [Segment(PIECE, load, float(v), ramp=PIECE, score=False) for v in speed]
    pieces[-1] = dataclasses.replace(pieces[-1], score=True)
    return Scenario("chirp", (first, *pieces), "driven", start_up=False)


def bandwidth(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """Bandwidth (-3 dB) and peak of the estimate's answer to the rotor's angle, half rated load,
    encoder in control.

    From the cross spectrum of both angles over a chirp; bandwidth_hz is FASTEST where the answer
    never falls.
    """
    from scipy.signal import csd, welch

    run = simulate(
        drive,
        chirp_scenario(drive, 0.5),
        load_estimator(estimator),
        belief,
        closed_loop=False,
        seed=seed,
    )
    r = run.recording.between(run.start_time + 0.3, math.inf)
    if is_lost(r):
        return Outcome((), {"bandwidth_hz": None, "peak_gain": None}, False)
    rate, block = (
        1.0 / drive.converter.sampling_period,
        round(BLOCK / drive.converter.sampling_period),
    )
    f, both = csd(r.theta, r.theta_hat, rate, nperseg=block)
    gain = np.abs(both) / welch(r.theta, rate, nperseg=block)[1]
    inside = (f >= 2.0 * SLOWEST) & (f <= 0.9 * FASTEST)
    f, gain = f[inside], gain[inside]
    below = np.nonzero(gain < math.sqrt(0.5))[0]
    edge = float(f[below[0]]) if below.size else FASTEST
    return Outcome((), {"bandwidth_hz": edge, "peak_gain": float(gain.max())}, None)


def hand_over(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """Free rotor under rated load from standstill to the highest speed allowed, up to 30 %, and
    back."""
    top = design(drive).top_omega / drive.motor.rated_omega
    for speed in HAND_OVER:
        if 1.2 * speed > top:
            continue
        scenario = Scenario(
            "hand-over",
            (
                Segment(1.0, 1.0, ramp=0.3, settle=0.7),
                Segment(1.5, 1.0, speed, ramp=1.0, settle=0.1),
                Segment(0.8, 1.0, speed, settle=0.4),
                Segment(1.8, 1.0, 0.0, ramp=1.0, settle=0.1),
            ),
            "free",
            "speed",
        )
        try:
            case = Case(scenario, f"{100 * speed:g} %")
            return verdict(points_of(case, drive, estimator, belief, seed), belief)
        except (BadInput, PhysicsError):
            continue
    return Outcome((), {"lost": None, "mean_deg": None, "p95_deg": None}, None)


def reversal_case() -> tuple[Drive, Scenario]:
    """Return motor, speed and load of motulator's 2.2 kW example,
    `peer_motulator.py --only lin --t 4.0`."""
    motor = Motor(
        "motulator 2.2 kW",
        3,
        3.6,
        0.545,
        0.036,
        0.051,
        0.015,
        4.3 * math.sqrt(2.0),
        14.0,
        1500.0,
        description="2.2 kW interior-magnet motor of motulator's examples, linear",
    )
    converter = Converter(125e-6, 540.0, 0.0, 0.0, 8000.0)
    drive = Drive(motor, converter, Injection(4000.0, 250.0), {})
    load = current_for_torque(motor, 14.0, closed_loop=False)[0] / motor.rated_current
    segments = (
        Segment(0.5),
        Segment(0.5, load),
        Segment(0.5, load, 0.1),
        Segment(0.5, load, 0.0, 0.5),
        Segment(0.5, load, -0.1, 0.5),
        Segment(0.5, load, -0.1),
        Segment(0.5, load, 0.0),
        Segment(0.5),
    )
    return drive, Scenario("reversal", segments, "free", "speed", start_up=False, start_angle=0.0)


def reversal(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """The four-second reversal of motulator's example, on its own motor; see `with_peer` for the
    comparison."""
    _, scenario = reversal_case()
    run = simulate(drive, scenario, load_estimator(estimator), belief, seed=seed)
    late = run.recording.between(scenario.duration / 8.0, scenario.duration)
    lost = is_lost(late)
    e = error_of(late, lost)
    metrics = {
        "mean_deg": e.mean,
        "rms_deg": e.rms,
        "p95_deg": e.p95,
        "max_deg": e.max,
        "lost": float(lost),
        "cpu_s_per_s": run.cpu_seconds / scenario.duration,
    }
    return Outcome((), metrics, not lost)


def beats_peer(ratios: Mapping[str, float | None]) -> bool:
    """Tell whether `with_peer`'s ratios meet the goals: half the error, a three-hundredth of the
    CPU."""
    error, spent = ratios["rms_to_peer"], ratios["cpu_to_peer"]
    return error is not None and spent is not None and error <= 0.5 and spent <= 1.0 / 300.0


def with_peer(
    metrics: Mapping[str, float | None], cpu: float, rms: float
) -> dict[str, float | None]:
    """Return a reversal's figures over the peer's: rms_to_peer (goal 1/2), cpu_to_peer (goal
    1/300)."""
    ours, spent = metrics.get("rms_deg"), metrics.get("cpu_s_per_s")
    return {
        "rms_to_peer": None if ours is None else ours / rms,
        "cpu_to_peer": None if spent is None else spent / cpu,
    }
