"""The tests of the protocol: what each runs, what it measures, and when it counts as passed.

Goals (saturated belief): mean within 1 degree and 95th percentile within 3 up to 180 % of rated
current, wherever the ripple carries information; the linear belief's mean within 0.3 degrees of
theory, where there is one; polarity right in 99.9 % of starts.  Robustness and attraction have no
goal but lock: passed there means that it was kept.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from estimators.registry import AnyEstimator, load_estimator
from model.effects.library import true_motor
from model.energy import flux_newton, hessian, torque
from model.errors import BadInput, PhysicsError
from model.mapped import ALPHAS
from model.parameters import Drive
from sandbox.drive.recording import Recording
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.evaluation.lost import why_lost_in
from sandbox.evaluation.score import rows_of
from sandbox.plant.sets import complete

MEAN_GOAL, P95_GOAL, THEORY_GOAL, POLARITY_GOAL = 1.0, 3.0, 0.3, 0.999  # degrees; share
GOAL_LOAD = 1.8  # of rated current: up to here the goals hold
INFORMATIVE = 0.1  # slope of the null over that at zero current
DIRECTIONS, RADII = 12, (0.5, 1.0, 1.5, 2.0)
FIRST_ANGLES = 24  # first positions told wrong, around the circle
SAME = 15.0  # degrees: final errors nearer than this are one equilibrium
# degrees: the wrong pole, where a saturated belief adds the wrong cross-saturation angle
TURNED = 35.0


@dataclass(frozen=True)
class EvaluatedSegment:
    """One evaluated segment: a row of the tidy table.  Degrees electrical; loads in fractions of
    rated current."""

    case: str
    closed_loop: bool
    load: float
    load_d: float
    speed: float
    mean_deg: float | None
    rms_deg: float | None
    p95_deg: float | None
    max_deg: float | None
    lost_lock: bool
    predicted_deg: float | None
    informative: bool
    torque_deficit: float | None  # 1 - torque / torque of the reference current
    speed_held: bool = True  # whether the speed loop reached what was asked for
    why_lost: str | None = None  # one sentence, where something simple says it


@dataclass(frozen=True, repr=False)
class Outcome:
    """A finished test of one estimator with one belief on one motor; passed: None where no goal
    applies."""

    points: tuple[EvaluatedSegment, ...]
    metrics: Mapping[str, float | None]
    passed: bool | None

    def __repr__(self) -> str:
        return f"<Outcome: {self.said()}, {len(self.points)} points, {len(self.metrics)} metrics>"

    @property
    def why_lost(self) -> str | None:
        """Why lock was lost, at the smallest current at which something simple says it; None where
        nothing does."""
        losses = [
            (math.hypot(p.load, p.load_d), p.why_lost)
            for p in self.points
            if p.lost_lock and p.why_lost
        ]
        return min(losses)[1] if losses else None

    def said(self) -> str:
        """Return the verdict in a word or two."""
        return "no goal" if self.passed is None else "passed" if self.passed else "missed its goal"


@dataclass(frozen=True)
class Case:
    """One run of a test: what its points are called, whether the estimate controls, what the plant
    has more."""

    scenario: Scenario
    name: str
    closed: bool = True
    effects: Mapping[str, float] | None = None


def informative(drive: Drive, i_d: float, i_q: float) -> bool:
    """Tell whether the saliency at a current (A) is at least INFORMATIVE of that at zero
    current."""
    m = drive.motor.energy
    d, q, outside = flux_newton(m, i_d, i_q, 0.0, 0.0)
    if outside:
        return False
    dd, dq, qq = hessian(m, d, q)
    return bool(math.hypot(dd - qq, 2.0 * dq) >= INFORMATIVE * abs(m.gamma_d - m.gamma_q))


def points_of(
    case: Case, drive: Drive, estimator: AnyEstimator, belief: str, seed: int
) -> list[EvaluatedSegment]:
    """Run a case and return its scored segments as points; PhysicsError and BadInput as
    `simulate`."""
    own, scenario, closed, effects = (
        load_estimator(estimator),
        case.scenario,
        case.closed,
        case.effects,
    )
    run = simulate(
        drive,
        scenario,
        own,
        belief,
        closed_loop=closed,
        seed=seed,
        effects=effects,
        stride=max(1, math.ceil(scenario.duration / drive.converter.sampling_period / 4e5)),
    )
    rows = rows_of(drive, scenario, run.recording, run.start_time, own.name, belief, closed)
    rated, found = drive.motor.rated_current, []
    true = true_motor(drive.motor, complete(drive.motor, drive.converter, effects), keep_map=True)
    for row, s in zip(rows, (s for s in scenario.segments if s.score), strict=True):
        e = row.error_deg
        clear = informative(drive, s.current_d * rated, s.load * rated)
        part = run.recording.between(row.t_start, row.t_end)
        predicted = None if effects or belief == "saturated" else row.predicted_mean_deg
        deficit = torque_deficit(drive, part, s) if scenario.reference == "current" else None
        values = (e.mean, e.rms, e.p95, e.max)
        why = why_lost_in(run, row, drive, true, own, (scenario.name, s.current_d))
        found.append(
            EvaluatedSegment(
                case.name,
                closed,
                s.load,
                s.current_d,
                s.speed,
                *values,
                row.lost_lock,
                predicted,
                clear,
                deficit,
                row.reference_held,
                why,
            )
        )
    return found


def torque_deficit(drive: Drive, part: Recording, s: Segment) -> float | None:
    """Return 1 - torque / torque of the reference current, from the mean currents; None below a
    tenth of rated."""
    motor, asked = (
        drive.motor,
        (s.current_d * drive.motor.rated_current, s.load * drive.motor.rated_current),
    )
    if abs(s.load) < 0.1:
        return None
    values = []
    for i in (asked, (float(part.i_d.mean()), float(part.i_q.mean()))):
        d, q, outside = flux_newton(motor.energy, *i, 0.0, 0.0)
        if outside:
            return None
        values.append(torque(motor.energy, d, q, motor.magnet_flux, float(motor.pole_pairs)))
    return 1.0 - values[1] / values[0] if values[0] else None


def summary(points: Iterable[EvaluatedSegment]) -> dict[str, float | None]:
    """Return the worst figures over the informative points within GOAL_LOAD, and counts."""
    every = list(points)
    judged = [
        p for p in every if p.informative and math.hypot(p.load, p.load_d) <= GOAL_LOAD + 1e-9
    ]
    known = [p for p in judged if not p.lost_lock]
    missed = [
        abs(p.mean_deg - p.predicted_deg)
        for p in known
        if p.mean_deg is not None and p.predicted_deg is not None
    ]
    deficits = [p.torque_deficit for p in known if p.torque_deficit is not None and p.closed_loop]

    def worst(name: str) -> float | None:
        """Return the largest size of a figure over the points in lock, None where none has it."""
        return max(
            (abs(getattr(p, name)) for p in known if getattr(p, name) is not None), default=None
        )

    rms = [p.rms_deg for p in known if p.rms_deg is not None]
    return {
        "points": len(every),
        "judged": len(judged),
        "lost": sum(p.lost_lock for p in judged),
        "lost_beyond": sum(p.lost_lock for p in every) - sum(p.lost_lock for p in judged),
        "speed_missed": sum(not p.speed_held for p in judged),
        "mean_deg": worst("mean_deg"),
        "rms_deg": float(np.sqrt(np.mean(np.square(rms)))) if rms else None,
        "p95_deg": worst("p95_deg"),
        "max_deg": worst("max_deg"),
        "theory_miss_deg": max(missed, default=None),
        "torque_deficit": max(deficits, default=None),
    }


def verdict(points: Iterable[EvaluatedSegment], belief: str) -> Outcome:
    """Return points, summary and whether the goals of the module's text are met."""
    points = tuple(points)
    m = summary(points)
    mean, p95, miss = m["mean_deg"], m["p95_deg"], m["theory_miss_deg"]
    passed: bool | None = None
    if belief == "saturated":
        passed = (
            not m["lost"]
            and mean is not None
            and p95 is not None
            and mean <= MEAN_GOAL
            and p95 <= P95_GOAL
        )
    elif miss is not None:
        passed = not m["lost"] and miss <= THEORY_GOAL
    return Outcome(points, m, passed)


def static_map(
    drive: Drive, estimator: AnyEstimator, belief: str, seed: int, seconds: float = 0.08
) -> Outcome:
    """Locked rotor, currents along rays to twice rated current, estimate and encoder in control;
    each current is looked at for so many seconds."""
    points = []
    for k in range(DIRECTIONS):
        beta = 2.0 * math.pi * k / DIRECTIONS
        for closed in (True, False):
            radii = list(RADII)
            while radii:  # a ray ends where the motor's model does
                segments = tuple(
                    Segment(
                        0.17 + seconds,
                        r * math.sin(beta),
                        ramp=0.1,
                        settle=0.17,
                        current_d=r * math.cos(beta),
                    )
                    for r in radii
                )
                ray = Scenario("ray", segments, start_up=False, start_angle=0.3 + 0.1 * k)
                try:
                    points += points_of(
                        Case(ray, f"{30 * k} degrees", closed), drive, estimator, belief, seed
                    )
                    break
                except PhysicsError:
                    radii.pop()
    return verdict(points, belief)


def _both(
    drive: Drive, scenario: Scenario, estimator: AnyEstimator, belief: str, seed: int
) -> Outcome:
    points = []
    for closed in (True, False):
        points += points_of(Case(scenario, scenario.name, closed), drive, estimator, belief, seed)
    return verdict(points, belief)


LOAD_STEP = Scenario(
    "load_step",
    (Segment(0.4, score=False), Segment(2.2, 1.8, settle=1.6), Segment(2.2, 0.0, settle=1.6)),
    "free",
    "speed",
)
CREEP = Scenario(
    "creep",
    (
        Segment(1.5, 1.8, ramp=0.5, score=False),
        Segment(1.5, 1.8, 0.002, ramp=0.2, settle=0.5),
        Segment(1.0, 1.8, -0.002, ramp=1.0, settle=0.0),
        Segment(1.5, 1.8, -0.002, settle=0.1),
    ),
    "free",
    "speed",
)


def load_step(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """Free rotor held at standstill by the speed loop; load 0 to 180 % in one step, and back."""
    return _both(drive, LOAD_STEP, estimator, belief, seed)


def creep(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """Free rotor creeping through a reversal, 0.2 % of rated speed, under 180 % load."""
    return _both(drive, CREEP, estimator, belief, seed)


def mission_scenario() -> Scenario:
    """Return the low-speed mission: six parts of 35 s."""
    parts: list[tuple[float, float, float, float]] = [  # duration, load, speed, ramp
        (5.0, 0.0, 0.0, 0.0),
        (30.0, 0.0, 0.02, 10.0),
        (11.0, 0.0, 0.0, 1.0),
        (12.0, 1.0, 0.0, 1.0),
        (12.0, 1.8, 0.0, 1.0),
        (15.0, 1.0, 0.02, 2.0),
        (20.0, 1.0, -0.02, 5.0),
        (8.0, 0.0, 0.0, 1.0),
        (9.0, 1.0, 0.0, 0.0),
        (9.0, 1.8, 0.0, 0.0),
        (9.0, -1.0, 0.0, 0.0),
        (12.0, 1.0, 0.05, 4.0),
        (23.0, 1.0, -0.05, 8.0),
        (10.0, 1.5, 0.0, 1.0),
        (12.5, 1.5, 0.002, 1.0),
        (12.5, 1.5, -0.002, 2.0),
    ]
    segments = (
        Segment(d, load, speed, ramp, settle=min(ramp + 1.0, 0.6 * d))
        for d, load, speed, ramp in parts
    )
    return Scenario("mission", tuple(segments), "free", "speed")


def mission(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """210 s at low speed, estimate in control: loads to 180 %, reversals, ramps, creeping."""
    return verdict(
        points_of(Case(mission_scenario(), "mission"), drive, estimator, belief, seed), belief
    )


ROBUST = Scenario(
    "robust",
    (
        Segment(0.3, 0.0, settle=0.1),
        Segment(0.4, 1.0, ramp=0.1, settle=0.2),
        Segment(0.4, 1.8, ramp=0.1, settle=0.2),
        Segment(0.6, 1.0, 0.05, ramp=0.2, settle=0.3),
        Segment(0.6, -1.0, -0.05, ramp=0.2, settle=0.3),
    ),
    "driven",
    start_up=False,
    start_angle=0.5,
)


def perturbations(drive: Drive) -> dict[str, dict[str, float]]:
    """Return by name what the plant has and the model lacks; alphas by the uncertainty their motor
    file prints."""
    motor = drive.motor
    cases: dict[str, dict[str, float]] = {
        "nominal": {},
        "R +50 %": {"stator_resistance.resistance": 1.5 * motor.resistance},
        "L +20 %": {"inductance.scale_d": 1.2, "inductance.scale_q": 1.2},
        "L -20 %": {"inductance.scale_d": 0.8, "inductance.scale_q": 0.8},
        "magnet -15 %": {"magnet_flux.magnet_flux": 0.85 * motor.magnet_flux},
        **{f"dead time {us} us": {"dead_time.time": 1e-6 * us} for us in (1, 2, 4)},
        "gain 1 %": {
            "current_gain.gain_a": 1.01,
            "current_gain.gain_b": 0.99,
            "current_gain.gain_c": 1.0,
        },
        "delay 5 us": {"pwm_delay.delay": 5e-6},
    }
    for sign, name in ((1.0, "alphas +"), (-1.0, "alphas -")):
        printed = {a: re.search(r"\+- ([\d.]+)", drive.provenance.get(a, "")) for a in ALPHAS}
        moved = {
            f"saturation.{a}": getattr(motor, a) + sign * float(m[1])
            for a, m in printed.items()
            if m
        }
        if moved:
            cases[name] = moved
    return cases


def robustness(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """Standstill and 5 % speed under load with one thing at a time other than believed; passed:
    lock kept."""
    points = []
    noisy = dataclasses.replace(
        drive, converter=dataclasses.replace(drive.converter, current_noise=0.01)
    )
    cases = [(name, drive, effects) for name, effects in perturbations(drive).items()]
    metrics: dict[str, float | None] = {}
    for name, plant, effects in [*cases, ("noise 10 mA", noisy, {})]:
        try:
            found = points_of(Case(ROBUST, name, effects=effects), plant, estimator, belief, seed)
        except BadInput:  # a motor with a flux map has no alphas to move, nor inductances
            continue
        except PhysicsError:
            found = [
                EvaluatedSegment(
                    name, True, s.load, 0.0, s.speed, None, None, None, None, True, None, True, None
                )
                for s in ROBUST.segments
            ]
        points += found
        worst = summary(found)
        metrics[f"{name}: mean_deg"] = None if worst["lost"] else worst["mean_deg"]
    whole = summary(points)
    return Outcome(tuple(points), whole | metrics, not whole["lost"])


def attraction(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """The first position told wrong, around the circle, at 0, 100 and 180 % load, encoder in
    control.

    Metrics: share that comes back to the right equilibrium, share that stays reversed, and the
    other angles (degrees) at which an estimate came to rest: second stable equilibria; `elsewhere`
    counts what never rests, too.
    """
    points: list[EvaluatedSegment] = []
    strange: list[int] = []
    back = turned = restless = total = 0
    for load in (0.0, 1.0, 1.8):
        ends = []
        for k in range(FIRST_ANGLES):
            wrong = 2.0 * math.pi * k / FIRST_ANGLES
            wrong = wrong - 2.0 * math.pi if wrong > math.pi else wrong
            scene = Scenario(
                "told", (Segment(0.3, load, settle=0.25),), start_up=False, start_error=wrong
            )
            run = simulate(
                drive, scene, load_estimator(estimator), belief, closed_loop=False, seed=seed
            )
            last = run.recording.between(run.start_time + 0.25, math.inf)
            e = np.degrees(np.unwrap(last.error))
            still = float(np.ptp(e)) < SAME
            ends.append(float(np.mean(e)) if still else math.nan)
        own = ends[0]
        for end in ends:
            total += 1
            off = (end - own + 180.0) % 360.0 - 180.0
            back += abs(off) < SAME
            turned += abs(off) > 180.0 - TURNED
            if not math.isfinite(off):
                restless += 1
            elif SAME <= abs(off) <= 180.0 - TURNED:
                strange.append(round(off))
        points.append(
            EvaluatedSegment(
                f"load {load:g}",
                False,
                load,
                0.0,
                0.0,
                *(None,) * 4,
                math.isnan(own),
                None,
                True,
                None,
            )
        )
    shares = {
        "back": back / total,
        "reversed": turned / total,
        "elsewhere": (len(strange) + restless) / total,
    }
    others = {f"equilibrium_{n}_deg": float(v) for n, v in enumerate(sorted(set(strange))[:8])}
    metrics: dict[str, float | None] = {"starts": total, **shares, **others}
    return Outcome(tuple(points), metrics, not strange and not restless)


def starting(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """3024 starts over 36 angles, each with its own noise; the same start-up serves every
    estimator."""
    from sandbox.evaluation.starts import starts

    found = starts(drive, load_estimator(estimator), belief, seed=seed)
    e = found.axis_errors
    size = np.abs(e)
    metrics = {
        "starts": e.size,
        "polarity_right": found.right,
        "mean_deg": float(e.mean()),
        "rms_deg": float(np.sqrt(np.mean(e**2))),
        "p95_deg": float(np.percentile(size, 95)),
        "max_deg": float(size.max()),
    }
    return Outcome((), metrics, found.right >= POLARITY_GOAL)


def costs(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """CPU of a step, and what the injection costs the motor, see
    `sandbox.evaluation.step_cost.cost`."""
    from sandbox.evaluation.step_cost import cost

    return Outcome((), cost(drive, estimator, belief, seed), None)
