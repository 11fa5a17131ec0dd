"""Why lock was lost, in one sentence, where the motor, the load or the speed says it."""

from __future__ import annotations

import math
from collections.abc import Iterable

from estimators.contract import Estimator
from model.parameters import Drive, Motor
from model.saliency import self_consistent_angle, without_saliency
from sandbox.evaluation.score import Row

POINTS = 40  # currents up to the load's at which a place to stand is looked for
SLOW = 0.1  # of rated speed: below it a back-EMF is a few per cent of the link
BY_RIPPLE = ("pulsating", "rotating", "random")


def why_lost(row: Row, drive: Drive, true: Motor, estimator: Estimator) -> str | None:
    """Return why a row has lost lock, None where nothing simple says it.

    true: the plant's motor; currents on q up to the row's load are asked.
    """
    load, rated = row.load * true.rated_current, drive.motor.rated_current
    if estimator.injection in BY_RIPPLE:
        end = without_saliency(true.energy, 0.0, load)
        if end is not None:
            return (
                f"q-null has no saliency beyond {end:.3g} A on q ({100.0 * end / rated:.0f} % of rated current; the "
                f"load takes {abs(load):.3g} A)"
            )
        if row.belief == "linear" and row.closed_loop and (end := _no_null(true, load)) is not None:
            return (
                f"beyond {end:.3g} A on q ({100.0 * end / rated:.0f} % of rated current) cross-saturation leaves a "
                "linear belief no angle at which the ripple across it is zero; believe the saturated model"
            )
    speed = abs(row.speed_rpm / drive.motor.rated_speed_rpm)
    if estimator.injection == "none" and speed < SLOW:
        back = true.magnet_flux * speed * drive.motor.rated_omega
        return (
            f"nothing is injected, and at {row.speed_rpm:+.3g} rpm the back-EMF is {back:.2g} V: too little to find "
            "the rotor; turn faster, or use an estimator with injection"
        )
    return None


def _no_null(motor: Motor, load: float) -> float | None:
    """Return the current (A) on the estimated q axis from which no self-consistent angle exists up to a load's (A)."""
    for k in range(1, POINTS + 1):
        if math.isnan(self_consistent_angle(motor.energy, 0.0, load * k / POINTS)):
            return abs(load) * k / POINTS
    return None


def reasons(rows: Iterable[Row]) -> list[str]:
    """Return a sentence for each reason why rows have lost lock, with the runs it is of."""
    told: dict[str, list[str]] = {}
    for row in rows:
        if row.lost_lock and row.why_lost:
            told.setdefault(row.why_lost, []).append(f"{row.estimator}, {row.belief}, {100.0 * row.load:+.0f} % load")
    return [f"lost lock ({'; '.join(dict.fromkeys(own))}): {why}" for why, own in told.items()]
