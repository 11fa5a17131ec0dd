"""What each named effect does to the position error, were it alone in the drive: the closed loop
runs with and without.

One estimator of each family (sandbox/gap/README.md says which stands for which): the null of an
injected ripple (`qnull`), a Kalman filter with a model of the motor (`ekf`), both at low speed
where only injection sees the rotor, and the flux behind the voltages at speed (`active_flux`).  All
use the nominal motor values of the campaign, with rated current, over one mechanical turn.  At low
speed the rotor turns freely under the estimate; at speed it is driven, since near standstill that
estimator sees nothing and could not start it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from estimators.registry import load_estimator
from model.errors import BadInput, Diverged, PhysicsError
from model.parameters import Drive
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import Setup, run_once, set_up
from sandbox.evaluation.score import is_lost

ESTIMATORS = {"qnull": 0.05, "ekf": 0.05, "active_flux": 0.5}  # at which share of rated speed
DRIVEN = ("active_flux",)
RAMP, SETTLE, LONGEST_TURN = 0.3, 0.5, 2.0  # s


class Moved(NamedTuple):
    """By how much an effect moves the mean of the error and its ripple (standard deviation),
    electrical degrees; not finite where the rotor is lost, or where nothing could be run: why."""

    mean_deg: float
    ripple_deg: float
    not_run: str = ""

    def as_json(self) -> dict[str, float | bool | str | None]:
        """Return the numbers, null where the rotor is lost or nothing was run."""
        none = not math.isfinite(self.mean_deg)
        return {
            "mean_deg": None if none else self.mean_deg,
            "ripple_deg": None if none else self.ripple_deg,
            "lost": none and not self.not_run,
            "not_run": self.not_run or None,
        }


def moved(drive: Drive, effects: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, Moved]]:
    """Return by effect and estimator what the effect's values (public names) do, or why that could
    not be run."""
    out: dict[str, dict[str, Moved]] = {e: {} for e in effects}
    for name in ESTIMATORS if effects else ():
        base, why = None, ""
        try:
            setup = ready(drive, name)
            base = error_of(setup, {})
        except Diverged:
            pass  # base stays None, as where the rotor is lost in a run that ends
        except (BadInput, PhysicsError) as error:
            why = f"it cannot run on this drive: {error}"
        for effect, values in effects.items():
            if base is None:
                out[effect][name] = _not_run(why or "it loses the rotor without any effect")
            else:
                out[effect][name] = _moved(setup, values, base)
    return out


def _not_run(why: str) -> Moved:
    return Moved(math.nan, math.nan, why)


def _moved(setup: Setup, values: Mapping[str, float], base: tuple[float, float]) -> Moved:
    """Return what values do to mean and ripple (base: without them); a run that breaks off has lost
    the rotor."""
    try:
        found = error_of(setup, values)
    except BadInput as error:  # none that a drive can have: an estimate at the end of its range
        return _not_run(f"no drive can have the effect at this size: {error}")
    except Diverged:
        found = None
    except PhysicsError as error:  # said before the run: the drive then cannot do what is asked for
        return _not_run(f"the drive cannot run so with the effect: {error}")
    return (
        Moved(math.nan, math.nan)
        if found is None
        else Moved(found[0] - base[0], found[1] - base[1])
    )


def ready(drive: Drive, estimator: str) -> Setup:
    """Return the run of an estimator made ready."""
    speed = ESTIMATORS[estimator]
    turn = min(LONGEST_TURN, math.tau * drive.motor.pole_pairs / (speed * drive.motor.rated_omega))
    driven = estimator in DRIVEN
    start = Segment(RAMP, 0.0, speed, ramp=RAMP)
    rotor, reference = ("driven", "current") if driven else ("free", "speed")
    scenario = Scenario(
        "position",
        (start, Segment(RAMP + SETTLE + turn, 1.0, speed, ramp=RAMP)),
        rotor,
        reference,
        start_up=False,
    )
    return set_up(drive, scenario, load_estimator(estimator), "saturated")


def error_of(setup: Setup, values: Mapping[str, float]) -> tuple[float, float] | None:
    """Return mean and ripple (electrical degrees) over the last turn; None where the rotor is
    lost."""
    recording = run_once(setup, values).recording
    if is_lost(recording):
        return None
    end = setup.start_time + setup.scenario.duration
    first = setup.start_time + 2.0 * RAMP + SETTLE
    error = np.degrees(recording.between(first, end + 1.0).error)
    return float(error.mean()), float(error.std())
