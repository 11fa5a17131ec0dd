"""How much of the saturated belief's gain is left when the model is known to some percent only.

Belief parameters are drawn, each on its own and evenly, within +- a tolerance of the motor's; the
motor and the design stay.  A draw's figure is the rms, over all scored stretches of the scenario,
of the position error's mean.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from sandbox.engine.processes import ALONE, Workers
from sandbox.evaluation.sweep.keys import MAGNETICS
from sandbox.evaluation.sweep.plan import Sweep, sweep_of
from sandbox.evaluation.sweep.summary import below
from sandbox.evaluation.sweep.sweep import Progress, rows_of

LEVELS = (0.0, 0.05, 0.1, 0.2)
DRAWS = 64
OFF = ("magnet_flux", *MAGNETICS)
BELIEFS = ("linear", "saturated")


@dataclass(frozen=True)
class ToleranceRow:
    """One estimator and belief at one tolerance (a share); degrees: rms of the stretches' mean
    errors, of which half and 95 % of the draws stay below; None where more lost lock than that.
    gain_left, gain_left_p95: how much nearer to zero than the exactly known linear belief, over the
    same with everything known; None without a gain.
    """

    estimator: str
    belief: str
    tolerance: float
    draws: int
    lost: int
    median_deg: float | None
    p95_deg: float | None
    gain_left: float | None = None
    gain_left_p95: float | None = None


class Question(NamedTuple):
    """What is asked for at every tolerance; motor: a name or file; scenario: a name or file, or a
    scenario's tables."""

    motor: str
    scenario: Any
    estimators: Sequence[str]
    effects: Mapping[str, float] = {}
    draws: int = DRAWS
    seed: int = 0


def sweep_at(asked: Question, tolerance: float) -> Sweep:
    """Return the sweep of one tolerance."""
    scenario, seed = asked.scenario, asked.seed
    factors = {name: {"uniform": [1.0 - tolerance, 1.0 + tolerance]} for name in OFF}
    tables: dict[str, Any] = {
        "sweep": {"name": "tolerances"},
        "run": {"motor": asked.motor, "seed": seed, "effects": dict(asked.effects)},
        "grid": {"estimator": list(asked.estimators), "belief": list(BELIEFS)},
        "random": {"points": asked.draws, "seed": seed, "draw": {"believed_factor": factors}}
        if tolerance
        else {},
    }
    if isinstance(scenario, dict):
        tables |= scenario
    else:
        tables["run"]["scenario"] = scenario
    return sweep_of(tables)


def tolerances(
    asked: Question,
    levels: Iterable[float] = LEVELS,
    *,
    workers: Workers = ALONE,
    progress: Progress | None = None,
) -> tuple[ToleranceRow, ...]:
    """Return a row for each tolerance, estimator and belief; the first tolerance is always 0:
    everything known.  Raises BadInput."""
    wanted = sorted({0.0, *levels})
    for level in wanted:
        if not 0.0 <= level <= 0.5:
            raise BadInput(f"a tolerance of {100 * level:g} % is out of range; give 0 to 50 %")
    sweeps = {x: sweep_at(asked, x) for x in wanted}
    check_quartic(asked.motor)
    whole, rows = sum(s.runs for s in sweeps.values()), []
    done = 0

    def advance(runs: int, _: int) -> None:
        """Say how many of all runs are done."""
        if progress is not None:
            progress(done + runs, whole)

    advance(0, whole)
    for level, sweep in sweeps.items():
        rows += _rows(sweep, rows_of(sweep, workers, advance), level)
        done += sweep.runs
    return with_gains(rows)


def check_quartic(motor: str) -> None:
    """Raise BadInput for a motor with a flux map, whose belief has no parameters to be off."""
    from model.drive_files import load_drive
    from model.spline import SplineEnergy

    if isinstance(load_drive(motor).motor.energy, SplineEnergy):
        raise BadInput(
            f"'{motor}' has a flux map, no inductances and alphas to be off; take a "
            "motor that has them"
        )


def _rows(sweep: Sweep, table: Any, level: float) -> list[ToleranceRow]:
    cell, errors = table["run"].to_numpy() % sweep.cells, _errors(table)
    found = []
    for k in range(sweep.cells):
        own, case = errors[cell == k], sweep.case(k)
        lost = int(np.sum(~np.isfinite(own)))
        found.append(
            ToleranceRow(
                str(case["estimator"]),
                str(case["belief"]),
                level,
                own.size,
                lost,
                below(own, 0.5),
                below(own, 0.95),
            )
        )
    return found


def _errors(table: Any) -> NDArray[np.float64]:
    found = table["rms_mean_deg"].to_numpy(zero_copy_only=False)
    return np.where(np.isfinite(found), found, math.inf)


def with_gains(rows: Sequence[ToleranceRow]) -> tuple[ToleranceRow, ...]:
    """Return the rows with how much is left of the gain that the exactly known saturated belief
    brings."""
    exact = {(r.estimator, r.belief): r.median_deg for r in rows if r.tolerance == 0.0}

    def left(row: ToleranceRow, error: float | None) -> float | None:
        """Return the gain at an error over the whole gain."""
        worst, best = exact[row.estimator, "linear"], exact[row.estimator, "saturated"]
        if (
            row.belief != "saturated"
            or error is None
            or worst is None
            or best is None
            or worst <= best
        ):
            return None
        return (worst - error) / (worst - best)

    return tuple(
        replace(r, gain_left=left(r, r.median_deg), gain_left_p95=left(r, r.p95_deg)) for r in rows
    )


def lines(rows: Iterable[ToleranceRow]) -> tuple[list[str], list[list[str]]]:
    """Return heads and cells of the printed table: a line an estimator and tolerance."""
    heads = [
        "estimator, known to",
        "linear °",
        "saturated °",
        "95 % of draws °",
        "gain left %",
        "95 % of draws %",
        "lost",
    ]
    by = {(r.estimator, r.tolerance, r.belief): r for r in rows}
    cells = []
    for estimator, tolerance in dict.fromkeys((e, t) for e, t, _ in by):
        linear, own = by[estimator, tolerance, "linear"], by[estimator, tolerance, "saturated"]
        cells.append(
            [
                f"{estimator} ±{100 * tolerance:g} %",
                _text(linear.median_deg),
                _text(own.median_deg),
                _text(own.p95_deg),
                _percent(own.gain_left),
                _percent(own.gain_left_p95),
                str(own.lost),
            ]
        )
    return heads, cells


def _text(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.0f}"


def as_json(rows: Iterable[ToleranceRow]) -> list[dict[str, Any]]:
    """Return the rows as JSON holds them."""
    return [asdict(r) for r in rows]
