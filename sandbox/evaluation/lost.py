"""Why lock was lost, or a speed missed, in one sentence, where motor, load or speed says it."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from estimators.contract import Estimator
from estimators.startup import polarity_rise
from model.energy import flux_newton, hessian
from model.parameters import Drive, Motor
from model.saliency import known_null_ends, local_angle, null_turned, self_consistent_angle
from sandbox.drive.design import KNOWN_START, design, sampled, swings
from sandbox.drive.feasible import OWN_START
from sandbox.drive.recording import Recording
from sandbox.drive.scenario import scenario_names
from sandbox.drive.simulate import Simulation
from sandbox.evaluation.score import LOST_ANGLE, LOST_TIME, WITH_THEORY, Row

DIFFERENCE = 0.01  # of rated current: over which the null's turn is taken
POINTS = 40  # currents up to the load's at which a place to stand is looked for
SLOW = 0.1  # of rated speed: below it a back-EMF is a few per cent of the link
# what they track is the null of the q ripple, whatever they believe
BY_NULL = ("qnull", "table", "random_frequency")
# of starting up: its last quarter holds one bias, and half of that has settled
DECIDED = 0.125
LITTLE = 0.1  # of the saliency at zero current: below it the protocol asks for no angle either


def why_lost_in(
    run: Simulation,
    row: Row,
    drive: Drive,
    true: Motor,
    estimator: Estimator,
    asked: tuple[str, float],
) -> str | None:
    """Return why a row of a run has lost lock: starting up took the other end, or as `why_lost`.

    asked: the scenario's name, and the row's current along d, of rated current.
    """
    scenario, load_d = asked
    if not row.lost_lock:
        return None
    if run.start_time > 0.0 and estimator.injection != "none":
        begin = run.recording.between(run.start_time, run.start_time + LOST_TIME)
        own = run.recording.between(row.t_start, row.t_end)
        if _half_a_turn_off(begin) and _half_a_turn_off(own):
            return _of_start(run, true, scenario)
    return why_lost(row, drive, true, estimator, load_d)


def _half_a_turn_off(part: Recording) -> bool:
    """Tell whether a position is off by half a turn throughout, within LOST_ANGLE."""
    return part.t.size > 0 and bool(np.all(np.abs(part.error) > math.pi - LOST_ANGLE))


def _of_start(run: Simulation, true: Motor, scenario: str) -> str:
    """Return that starting up took one end of the magnet for the other: how far their ripples
    differ at the current that was asked for, and at the one that flowed when it was decided."""
    asked, start = run.design.tuning.bias, run.start_time
    flowed = float(np.mean(run.recording.between((1.0 - DECIDED) * start, start).i_d))
    alone = abs(float(hessian(true.energy, 0.0, 0.0)[0]))
    there, got = (
        f"{100.0 * float(polarity_rise(true.energy, abs(i))) / alone:+.2g} %"
        for i in (asked, flowed)
    )
    known = KNOWN_START.format(scenario) if scenario in scenario_names() else OWN_START
    return (
        f"starting up took the magnet's other end, half a turn off: it asked for +-{asked:.3g} A "
        f"on d, where the ripples of the two ends differ by {there} of that at no current, and got "
        f"{abs(flowed):.3g} A, where they differ by {got}; begin with the angle known: {known}"
    )


def why_lost(
    row: Row, drive: Drive, true: Motor, estimator: Estimator, load_d: float = 0.0
) -> str | None:
    """Return why a row has lost lock, None where nothing simple says it.

    true: the plant's motor; load_d: the row's current along d, of rated current.  Currents from
    zero up to the row's are asked.
    """
    rated = true.rated_current
    by_ripple = _of_null(row, true, load_d * rated, row.load * rated, drive.motor.rated_current)
    if by_ripple is not None:
        return by_ripple
    speed = abs(row.speed_rpm / drive.motor.rated_speed_rpm)
    if estimator.injection == "none" and speed < SLOW:
        back = true.magnet_flux * speed * drive.motor.rated_omega
        return (
            f"nothing is injected, and at {row.speed_rpm:+.3g} rpm the back-EMF is {back:.2g} V: "
            "too little to find the rotor; turn faster, or use an estimator with injection"
        )
    return None


def why_missed(row: Row, drive: Drive, true: Motor, estimator: Estimator) -> str | None:
    """Return why a speed that was asked for was not reached in lock, None where nothing simple says
    it."""
    if row.lost_lock or not row.closed_loop or estimator.name not in BY_NULL:
        return None
    i_q, h = row.load * true.rated_current, DIFFERENCE * true.rated_current
    gains = design(drive, start_up=False, published=estimator.takes_published)
    d, q, status = flux_newton(true.energy, 0.0, i_q, 0.0, 0.0)
    if status:
        return None
    dd, dq, qq = hessian(true.energy, d, q)
    before, after = (float(local_angle(true.energy, 0.0, i_q + s * h)) for s in (-1.0, 1.0))
    turn = (after - before) / (2.0 * h)  # the axis stands at the rotor's angle less this one
    if not swings(sampled(drive), gains.loops, float(dd / (dd * qq - dq * dq)), -turn):
        return None
    return (
        f"at i_q = {i_q:.3g} A the null of the q ripple turns by {math.degrees(abs(turn)):.2g} "
        "degrees for each ampere more, and the speed loop takes that for speed and swings; use "
        "inversion, which does not follow the null, a larger inertia or less load"
    )


def _of_null(row: Row, true: Motor, i_d: float, i_q: float, rated: float) -> str | None:
    """Return what of the q ripple's null ends on the way to a row's current (A), None where nothing
    does."""

    def beyond(end: float) -> str:
        """Return where it ends, beside what is asked for."""
        return (
            f"beyond {end:.3g} A ({100.0 * end / rated:.0f} % of rated current; asked for are i_d "
            f"= {i_d:.3g} A and i_q = {i_q:.3g} A)"
        )

    turned = null_turned(true.energy, i_d, i_q) if row.estimator in BY_NULL else None
    if turned is not None and turned[1] < LITTLE:
        return f"{beyond(turned[0])} no saliency is left that turns the q ripple"
    if turned is not None and row.belief == "linear":
        return (
            f"{beyond(turned[0])} the null of the q ripple stands 45 degrees or more beside d, "
            f"where a linear belief takes it for d; {100.0 * turned[1]:.0f} % of the saliency is "
            "left: believe the saturated model"
        )
    if not row.closed_loop or row.estimator not in WITH_THEORY:
        return None
    if row.belief == "saturated" and (end := known_null_ends(true.energy, i_d, i_q)) is not None:
        return (
            f"{beyond(end)} an error of the estimate turns the currents, and by them the "
            "saliency's axis further than itself, so that the ripple leads away even with a "
            "saturated belief; keep the load below, or ask for another i_d"
        )
    if row.belief == "linear" and (end := _no_null(true, i_d, i_q)) is not None:
        return (
            f"{beyond(end)} cross-saturation leaves a linear belief no angle at which the ripple "
            "across it is zero; believe the saturated model"
        )
    return None


def _no_null(motor: Motor, i_d: float, i_q: float) -> float | None:
    """Return the current (A) on the way to an estimated (i_d, i_q) from which no self-consistent
    angle exists."""
    for k in range(1, POINTS + 1):
        if math.isnan(self_consistent_angle(motor.energy, i_d * k / POINTS, i_q * k / POINTS)):
            return math.hypot(i_d, i_q) * k / POINTS
    return None


def reasons(rows: Iterable[Row]) -> list[str]:
    """Return a sentence for each reason why rows have lost lock or missed their speed, with the
    runs it is of."""
    runs = [(r, f"{r.estimator}, {r.belief}, {100.0 * r.load:+.0f} % load") for r in rows]
    lost = grouped((r.why_lost, run) for r, run in runs if r.lost_lock)
    return [*lost, *grouped(((r.why_missed, run) for r, run in runs), "speed missed")]


def grouped(reasons: Iterable[tuple[str | None, str]], what: str = "lost lock") -> list[str]:
    """Return a sentence for each reason, with the runs it is of; reasons: reason (None:
    nothing simple) and run."""
    runs: dict[str, list[str]] = {}
    for why, run in reasons:
        if why:
            runs.setdefault(why, []).append(run)
    return [f"{what} ({'; '.join(dict.fromkeys(own))}): {why}" for why, own in runs.items()]
