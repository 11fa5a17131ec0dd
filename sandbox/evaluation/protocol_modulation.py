"""The protocol's test of drives as they modulate: discontinuous PWM, short pulses, overmodulation,
blocked gates.

Estimators are told what the modulator made of the voltage asked for.  Short pulses are met with
discontinuous PWM: the two legs that switch make them whenever the voltage lies near a third of a
turn's border.  Overmodulation is met with a low link, of which rated load at the highest speed
allowed needs a share without the injection (BEYOND), and with less injection: it takes its
amplitude off what control may ask for.  `nearest`, `shortened`: the
injection, along d, takes the voltage beyond the circle inside the hexagon (0.577 of the link);
without injection it stays inside.  `six_step`: more is needed than the hexagon gives on average
(0.606), so control asks for six steps (from 0.637 on) again and again. The same injections on the
usual link (`less injection`, `little injection`) tell what they cost alone.  At a flying start
gates have been blocked for PAUSE while the rotor turned, at its speed or down to a fifth less; of
what follows only the last part is judged.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from estimators.registry import AnyEstimator
from model.energy import flux_from_current
from model.errors import BadInput, PhysicsError
from model.parameters import Drive
from sandbox.drive.design import design
from sandbox.drive.scenario import Scenario, Segment
from sandbox.evaluation.protocol_tests import Case, EvaluatedSegment, Outcome, points_of, summary

SPEEDS = (0.3, 0.2, 0.15, 0.1, 0.05)  # of rated: the highest that the current loop allows
# of the link: need, injection
BEYOND = {"nearest": (0.55, 0.05), "shortened": (0.55, 0.05), "six_step": (0.615, 0.02)}
PAUSE = 0.1  # s
SHORT = 0.01  # of the period: 2.5 us at 4 kHz
PATTERNS: dict[str, dict[str, Any]] = {
    "centred": {},
    "dpwm_min": {"modulation": "dpwm_min"},
    "dpwm_max": {"modulation": "dpwm_max"},
    "dpwm_60": {"modulation": "dpwm_60"},
}


def highest(drive: Drive) -> float:
    """Return the highest of SPEEDS (of rated) that the current loop allows; BadInput where it is
    none."""
    top = design(drive).top_omega / drive.motor.rated_omega
    for speed in SPEEDS:
        if 1.05 * speed < top:
            return speed
    raise BadInput(
        f"the current loop of '{drive.name}' allows {100 * top:.3g} % of rated speed; inject faster"
    )


def loaded(speed: float) -> Scenario:
    """Return a driven rotor, at rest and at a speed (of rated), under rated load."""
    segments = (
        Segment(0.4, 1.0, ramp=0.1, settle=0.2),
        Segment(0.6, 1.0, speed, ramp=0.2, settle=0.4),
    )
    return Scenario("loaded", segments, "driven", start_up=False, start_angle=0.5)


def flying(speed: float, then: float) -> Scenario:
    """Return a flying start: half load at a speed (of rated), gates blocked until it is another,
    half load again."""
    segments = (
        Segment(0.4, 0.5, speed, ramp=0.2, score=False),
        Segment(PAUSE, 0.0, then, ramp=PAUSE, blocked=True, score=False),
        Segment(0.5, 0.5, then, ramp=0.05, settle=0.3),
    )
    return Scenario("flying", segments, "driven", start_up=False, start_angle=0.5)


def needed(drive: Drive, speed: float) -> complex:
    """Return the voltage (V, d + j q) that rated load at a speed (of rated) needs, without
    injection."""
    motor = drive.motor
    i_q, omega = motor.rated_current, speed * motor.rated_omega
    d, q = flux_from_current(motor.energy, 0.0, i_q)
    return complex(
        -omega * float(q), motor.resistance * i_q + omega * (float(d) + motor.magnet_flux)
    )


def beyond(drive: Drive, speed: float, name: str) -> tuple[float, float]:
    """Return the link's voltage and the injection's amplitude (V) of a case of overmodulation, see
    BEYOND."""
    share, injected = BEYOND[name]
    link = abs(needed(drive, speed)) / share
    return link, min(injected * link, drive.injection.amplitude)


def cases(drive: Drive) -> list[tuple[Case, Drive]]:
    """Return what is run: a case, and the drive it is run on."""
    c, speed = drive.converter, highest(drive)

    def made(injection: float = drive.injection.amplitude, **keys: Any) -> Drive:
        """Return the drive with another amplitude (V) of its injection and other keys of its
        converter."""
        return dataclasses.replace(
            drive,
            converter=dataclasses.replace(c, **keys),
            injection=dataclasses.replace(drive.injection, amplitude=injection),
        )

    short = {"modulation": "dpwm_min", "least_pulse": SHORT * c.update_period}
    found = [
        (Case(loaded(speed), name), made(**keys))
        for name, keys in (PATTERNS | {"short pulses": short}).items()
    ]
    for name in BEYOND:
        link, injection = beyond(drive, speed, name)
        found.append(
            (Case(loaded(speed), name), made(injection, overmodulation=name, dc_bus_voltage=link))
        )
    for name, of in (("less injection", "nearest"), ("little injection", "six_step")):
        found.append((Case(loaded(speed), name), made(beyond(drive, speed, of)[1])))
    found.append((Case(flying(speed, speed), "flying start"), drive))
    found.append((Case(flying(speed, 0.8 * speed), "flying start, slower"), drive))
    return found


def modulation(drive: Drive, estimator: AnyEstimator, belief: str, seed: int) -> Outcome:
    """Every case of a drive that modulates; passed: lock kept in all, or found again after a flying
    start."""
    points: list[EvaluatedSegment] = []
    metrics: dict[str, float | None] = {}
    for case, plant in cases(drive):
        try:
            found = points_of(case, plant, estimator, belief, seed)
        except PhysicsError:
            found = [
                EvaluatedSegment(
                    case.name, True, s.load, 0.0, s.speed, *4 * (None,), True, None, True, None
                )
                for s in case.scenario.segments
                if s.score
            ]
        points += found
        worst = summary(found)
        metrics[f"{case.name}: mean_deg"] = None if worst["lost"] else worst["mean_deg"]
    whole = summary(points)
    return Outcome(tuple(points), whole | metrics, not whole["lost"])
