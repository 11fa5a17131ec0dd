"""A first look at a campaign far from its nominal model: ordinary deviations, fitted to replays
that readings hold.

A replay by voltages alone adds up what ordinary deviations leave, and where resistance is small it
is far from the recording: a fit from there ends at the wrong bounds.  Held by readings
(`sandbox.replay.held`) differences are nearly straight in the parameters, and the fit finds its
way.  Three things are taken from it: counts of a PWM timer, whose rounding is seen beside what it
leaves; where ordinary deviations alone are fitted from, where they leave little; and whether legs
give back more volts than the winding takes.  There small errors grow until the current's sign
decides, so readings hold all that follows, by what the Kalman filter's gain would be in that zone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from model.effects import library
from model.effects.card import Legs
from sandbox.gap.evidence.fit import NEAR, Fit, fit, keeps_more, rms_of
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.settings import USUAL
from sandbox.gap.unstated.pwm_counts import pwm_counts
from sandbox.gap.unstated.unstated import NOTHING, Unstated, confirmed
from sandbox.replay.held import held, remembering

# Samples after which a replay has forgotten what it missed.  Less of them leaves less of what is
# missed, and more of the noise that comes back: half as much again of its variance at one sample.
MEMORY = 8.0


Excerpts = Callable[[], ParameterPoint] | None


@dataclass(frozen=True)
class FirstLook:
    """What it found: the campaign's nominal point and what makes that of its excerpts (None: none
    are made), held where legs give volts back; what is not stated; values that ordinary deviations
    alone begin at."""

    start: ParameterPoint
    excerpts: Excerpts
    known: Unstated
    values: Mapping[str, float]


def first_look(
    start: ParameterPoint, excerpts: Excerpts, left: float, *, workers: int = 1
) -> FirstLook:
    """Return what a first look at excerpts finds, or at the whole of a short campaign; left: times
    the noise that the nominal model leaves: near it there is nothing to look for."""
    if left <= NEAR:
        return FirstLook(start, excerpts, NOTHING, start.values)
    drive = start.prepared.campaign.drive
    seen = start if excerpts is None else excerpts()
    found = _alone(_held(seen, remembering(drive, MEMORY)), workers)
    known = Unstated(pwm_counts(found.point) if keeps_more(found, USUAL.gap) else None)
    if known:
        stated = _alone(known.at(found.point), workers)
        if confirmed(found, stated, known):
            found = stated
        else:
            known = NOTHING
    ohms = _to_hold(found)
    if known or ohms:
        start, seen = (_restated(x, known, ohms) for x in (start, seen))
        excerpts = None if excerpts is None else lambda: seen
    near = rms_of(found) <= NEAR
    return FirstLook(start, excerpts, known, found.point.values if near else start.values)


def _restated(point: ParameterPoint, known: Unstated, ohms: float) -> ParameterPoint:
    """Return a point of the campaign that states what was found, held by readings where ohms say
    so."""
    new = known.at(point) if known else point
    return _held(new, ohms) if ohms else new


def _alone(at: ParameterPoint, workers: int) -> Fit:
    """Return ordinary deviations alone, fitted from a point."""
    return fit(at, (), weights_of(len(at.prepared.recordings)), workers=workers)


def _held(point: ParameterPoint, ohms: float) -> ParameterPoint:
    """Return a point of a campaign whose replays are held."""
    return replace(point, prepared=held(point.prepared, ohms))


def _to_hold(found: Fit) -> float:
    """Return the ohms by which readings are to hold replays: what mirrors the unstable pole of legs
    that give back more than the winding takes (`negative_resistance`), 0 where none do."""
    values, drive = found.point.values, found.point.prepared.campaign.drive
    converter = drive.converter
    period = converter.sampling_period * converter.samples_a_period
    legs = Legs(converter.dc_bus_voltage, period, values["bench.soft_current"])
    excess = -library.leg_slope(values, drive.motor, legs).ohms - drive.motor.resistance
    return 2.0 * excess if excess > 0.0 else 0.0
