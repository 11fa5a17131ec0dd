"""A comparison as tables of texts: mean errors by segment, for a terminal, a page, markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sandbox.evaluation.compare import Comparison, Run
    from sandbox.evaluation.score import Row


THEORY = "theory °"  # head of a column


def comparison_tables(c: Comparison) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return title, heads and cells of one table for the closed and one for the open loop.

    A line is a segment; a cell the mean error in degrees with the 95th percentile of its size, and
    the true speed where it is not the one asked for. Without theory there is no column of it.
    """
    tables = []
    for closed in sorted({r.closed_loop for r in c.runs}, reverse=True):
        runs = [r for r in c.runs if r.closed_loop == closed]
        loop = (
            "closed loop (the estimate controls)" if closed else "open loop (the encoder controls)"
        )
        rpm = "asked rpm" if c.scenario.rotor == "free" else "rpm"
        heads, lines = (
            ["load %", rpm],
            [[f"{100 * r.load:+.0f}", f"{r.speed_rpm:+.4g}"] for r in runs[0].rows],
        )
        theory = theory_of([r for r in runs if r.belief == "linear"] or runs)
        columns = [(THEORY, theory)] if theory else []
        columns += [
            (f"{r.estimator} {r.belief[:3]}.", [_cell(row) for row in r.rows]) for r in runs
        ]
        for head, cells in columns:
            heads.append(head)
            lines = [[*line, cell] for line, cell in zip(lines, cells, strict=True)]
        tables.append((f"{c.drive.name}, {c.scenario.name}, {loop}", heads, lines))
    return tables


def theory_of(runs: Sequence[Run]) -> list[str]:
    """Return what theory predicts for each segment (degrees), nothing where it predicts none of
    these runs."""
    known = [
        [v for v in values if v is not None]
        for values in zip(
            *([row.predicted_mean_deg for row in run.rows] for run in runs), strict=True
        )
    ]
    return [number_text(values[0] if values else None) for values in known] if any(known) else []


def number_text(value: float | None) -> str:
    """Return degrees with two decimals and a sign, or a dash for none."""
    return "–" if value is None else f"{value + 0.0 if abs(value) >= 0.005 else 0.0:+.2f}"


def _cell(row: Row) -> str:
    if row.lost_lock:
        return "lost lock"
    if row.error_deg.p95 is None:
        return "–"
    known = "" if row.true_speed_rpm is None else f" ({rpm_text(row.true_speed_rpm)} rpm)"
    missed = "" if row.reference_held else f" speed missed{known}"
    return f"{number_text(row.error_deg.mean)} ({row.error_deg.p95:.1f}){missed}"


def rpm_text(speed: float | None) -> str:
    """Return a speed in rpm with a sign and no more than a tenth, or a dash for none."""
    return "–" if speed is None else f"{round(speed, 1) + 0.0:+.5g}"


def comparison_markdown(c: Comparison) -> str:
    """Return the same tables as markdown."""
    blocks = []
    for title, heads, rows in comparison_tables(c):
        lines = [f"**{title}**", "", f"| {' | '.join(heads)} |", "|" + "--:|" * len(heads)]
        blocks.append("\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]))
    return "\n\n".join(blocks)


def comparison_text(comparison: Comparison, made: dict[str, str], stride: int, slow: int) -> str:
    """Return the markdown shown first: how to read the trace, the table of errors, how it was
    made."""
    kept = "every recorded sample" if stride == 1 else f"one recorded sample in {stride}"
    known = any(row.predicted_mean_deg is not None for run in comparison.runs for row in run.rows)
    theory = ", pale lines: theory over the evaluation windows" if known else ""
    reading = (
        "Error = true minus estimated angle, degrees electrical. **Blue**: the estimator believes "
        f"the saturated model, **orange**: the linear one{theory}. Error views are cut to what "
        "runs in lock need. Angle views open on a quarter turn of the last window in lock. Error "
        f"and angle hold {kept}, currents means over {slow} samples, ripple and speed one sample "
        f"in {slow}."
    )
    provenance = [f"| {name} | {value} |" for name, value in made.items()]
    title = f"# {comparison.drive.name}, {comparison.scenario.name}"
    table = comparison_markdown(comparison)
    return "\n".join([title, reading, "", table, "", "| made with | |", "|---|---|", *provenance])
