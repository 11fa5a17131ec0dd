"""What a sweep says: for each combination of its grid, which position error most drives stay
below."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sandbox.evaluation.sweep.keys import Value
from sandbox.evaluation.sweep.plan import Sweep, label

if TYPE_CHECKING:
    import pyarrow

MOST_GROUPS = 200  # more combinations than that are summed up together
SHARES = (0.5, 0.95, 0.99)
SURE = 1.96


@dataclass(frozen=True)
class Group:
    """One combination of the grid.  Degrees are those that a share of all its runs stays below with
    the largest mean error of their stretches, see `errors_of`; None where the share falls among
    runs beyond any.
    """

    values: dict[str, Value]
    runs: int
    ok: int
    lost: int
    median_deg: float | None
    p95_deg: float | None
    p95_low_deg: float | None  # 95 % interval of p95_deg, if runs were independent
    p95_high_deg: float | None
    p99_deg: float | None

    @property
    def name(self) -> str:
        """Its values as a text."""
        return (
            ", ".join(
                f"{k.rpartition('.')[2]} {v:g}" if type(v) in (int, float) else f"{v}"
                for k, v in self.values.items()
            )
            or "all runs"
        )


def groups_of(sweep: Sweep, table: pyarrow.Table) -> list[Group]:
    """Return the groups of a finished sweep in the order of its grid; one of all runs where there
    are too many."""
    if sweep.cells > MOST_GROUPS:
        return [_group({}, table, np.arange(table.num_rows))]
    cell = table["run"].to_numpy() % sweep.cells
    found = []
    for k in range(sweep.cells):
        case = sweep.case(k)
        values = {name: label(name, case[name]) for name in sweep.grid}
        found.append(_group(values, table, np.flatnonzero(cell == k)))
    return found


def errors_of(table: pyarrow.Table) -> NDArray[np.float64]:
    """Return the size of each run's mean error in degrees, of the stretch where it is largest;
    infinite where there is none or lock was lost.  Over several loads at once errors of either sign
    would cancel.
    """
    found = table["worst_mean_deg"].to_numpy(zero_copy_only=False)
    return np.where(np.isfinite(found), np.abs(found), math.inf)


def below(errors: NDArray[np.float64], share: float) -> float | None:
    """Return the error that a share of runs stays below or meets; None where it is infinite or
    there is no run; errors: (runs,) degrees."""
    if errors.size == 0:
        return None
    value = float(np.sort(errors)[min(errors.size, max(1, math.ceil(share * errors.size))) - 1])
    return value if math.isfinite(value) else None


def interval(errors: NDArray[np.float64], share: float) -> tuple[float | None, float | None]:
    """Return the 95 % interval of `below`, from the ranks between which a binomial count lies."""
    if errors.size == 0:
        return None, None
    wide = SURE * math.sqrt(share * (1.0 - share) / errors.size)
    return below(errors, max(0.0, share - wide)), below(
        errors, share + wide
    ) if share + wide <= 1.0 else None


def _group(values: dict[str, Value], table: pyarrow.Table, rows: NDArray[np.int64]) -> Group:
    own = table.take(rows)
    errors = errors_of(own)
    ok = sum(s == "ok" for s in own["status"].to_pylist())
    lost = sum(bool(x) for x in own["lost_lock"].to_pylist())
    middle, most, nearly_all = (below(errors, share) for share in SHARES)
    low, high = interval(errors, 0.95)
    return Group(values, own.num_rows, ok, lost, middle, most, low, high, nearly_all)


def as_json(sweep: Sweep, table: pyarrow.Table) -> dict[str, Any]:
    """Return what `sweep.json` holds beyond its header and the names of files."""
    status = table["status"].value_counts().to_pylist()
    return {
        "name": sweep.name,
        "runs": sweep.runs,
        "points": sweep.points,
        "cells": sweep.cells,
        "design": sweep.design,
        "seed": sweep.seed,
        "status": {s["values"]: s["counts"] for s in status},
        "sentences": sentences(table),
        "varied": [*sweep.grid, *sweep.draws],
        "fixed": {name: label(name, v) for name, v in sweep.fixed.items()},
        "grid": {name: [label(name, v) for v in values] for name, values in sweep.grid.items()},
        "draws": {name: {d.kind: [d.a, d.b]} for name, d in sweep.draws.items()},
        "groups": [asdict(g) for g in groups_of(sweep, table)],
    }


def sentences(table: pyarrow.Table, most: int = 10) -> list[dict[str, Any]]:
    """Return why runs have no result: the most frequent sentences with their counts."""
    counts = [c for c in table["sentence"].value_counts().to_pylist() if c["values"] is not None]
    counts.sort(key=lambda c: (-c["counts"], c["values"]))
    return [{"sentence": c["values"], "runs": c["counts"]} for c in counts[:most]]


def lines(groups: Iterable[Group]) -> tuple[list[str], list[list[str]]]:
    """Return heads and cells of the printed table."""
    heads = ["", "runs", "no result", "lost", "50 % below °", "95 % below °", "99 % below °"]
    cells = [
        [
            g.name,
            str(g.runs),
            str(g.runs - g.ok),
            str(g.lost),
            *(_text(x) for x in (g.median_deg, g.p95_deg, g.p99_deg)),
        ]
        for g in groups
    ]
    return heads, cells


def _text(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def curve(
    errors: NDArray[np.float64], most: int = 2000
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return error (degrees) and the share of drives that stay below it, thinned to a figure's
    points."""
    whole = np.sort(errors)
    share = np.arange(1, whole.size + 1) / whole.size
    kept = np.unique(np.linspace(0, whole.size - 1, min(most, whole.size)).round().astype(int))
    finite = kept[np.isfinite(whole[kept])]
    return whole[finite], share[finite]
