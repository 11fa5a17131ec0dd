"""Tabs of a comparison's trace beside time: currents over the saliency map, hodograph, spectra,
error against angle."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from model.array_types import Array
from sandbox.drive.recording import Recording
from sandbox.evaluation.compare import Comparison, Run
from sandbox.evaluation.pages import planes
from sandbox.evaluation.pages.loci import contours
from sandbox.output import looks
from sandbox.output.sheets import COLOURS, GREY, Plot, Sheet, upright

GREEN = (42, 157, 92)
LOW = 1e-6  # A or degrees: 0 dB of a spectrum's bars


def working(run: Run) -> Recording:
    """Return the samples from the first evaluated segment to the end of the last, without starting
    up."""
    return (
        run.recording.between(run.rows[0].t_start, run.rows[-1].t_end)
        if run.rows
        else run.recording
    )


def in_lock(run: Run) -> list[Recording]:
    """Return the evaluated segmentes that kept lock, the longest first."""
    parts = [run.recording.between(row.t_start, row.t_end) for row in run.rows if not row.lost_lock]
    return sorted((p for p in parts if len(p) > 1), key=len, reverse=True)


def over_angle(run: Run) -> tuple[Array, Array] | None:
    """Return the error less each segment's mean (degrees) and the angle (rad) of all stretches in
    lock."""
    parts = in_lock(run)
    if not parts:
        return None
    off = [np.degrees(p.error - p.error.mean()) for p in parts]
    return np.concatenate(off), np.concatenate([p.theta for p in parts])


def spectra(c: Comparison, run: Run) -> dict[str, tuple[Array, Array]]:
    """Return spectra of the longest segment in lock: 'current' (i_d, i_q in A) and 'error'
    (degrees).

    Empty without lock, and for a thinned recording, which would fold lines back.
    """
    period, parts = c.drive.converter.sampling_period, in_lock(run)
    if not parts or not math.isclose(parts[0].t[1] - parts[0].t[0], period, rel_tol=1e-3):
        return {}
    own = parts[0]
    return {
        "current": looks.spectrum(np.stack([own.i_d, own.i_q], axis=1), period),
        "error": looks.spectrum(np.degrees(own.error), period),
    }


def most_current(c: Comparison, ways: Iterable[tuple[Array, Array]]) -> float:
    """Return the reach (A) of a plane that holds all ways and rated current."""
    return 1.1 * max(
        [c.drive.motor.rated_current, *(float(np.max(np.hypot(*way), initial=0.0)) for way in ways)]
    )


def sheets(c: Comparison) -> dict[str, dict[str, Plot | Sheet]]:
    """Return a tab for each estimator, with its estimate in control where there is such a run."""
    groups: dict[str, list[Run]] = {}
    closed = any(run.closed_loop for run in c.runs)
    for run in c.runs:
        if run.closed_loop == closed:
            groups.setdefault(run.estimator, []).append(run)
    ways = {
        run.name: planes.currents(c.drive, working(run)) for runs in groups.values() for run in runs
    }
    plane = planes.plane(c.drive, most_current(c, ways.values()))
    lines = [] if plane is None else contours(plane)
    return {name: _tab(c, runs, ways, lines) for name, runs in groups.items()}


def _tab(
    c: Comparison,
    runs: Sequence[Run],
    ways: Mapping[str, tuple[Array, Array]],
    lines: Sequence[tuple[float, Array]],
) -> dict[str, Plot | Sheet]:
    """Return one estimator's plots."""
    out: dict[str, Plot | Sheet] = {
        "currents": Sheet(
            "Currents: i_d right, i_q up (A); green: error of a linear belief; circle: rated",
            {
                "map": (
                    [line * (1.0, -1.0) for _, line in lines],
                    GREEN,
                    [f"{level:g}°" for level, _ in lines],
                ),
                "rated": ([_circle(c.drive.motor.rated_current)], GREY, []),
                **{
                    run.belief: (upright(*ways[run.name]), COLOURS.get(run.belief, GREY), [])
                    for run in runs
                },
            },
        ),
        "fluxes": Sheet(
            "Flux in the stator's frame: α right, β up (Wb); circle: the magnet's",
            {
                "magnet": ([_circle(c.drive.motor.magnet_flux)], GREY, []),
                **{
                    run.belief: (upright(*_fluxes(c, run)), COLOURS.get(run.belief, GREY), [])
                    for run in runs
                },
            },
        ),
    }
    seen = {run.belief: spectra(c, run) for run in runs}
    for key, what in (
        ("current", "i_dq (Hz; dB over 1 µA)"),
        ("error", "the error (Hz; dB over 1 µ°)"),
    ):
        bars = {belief: looks.bars(*own[key], LOW) for belief, own in seen.items() if own}
        if bars:
            x = next(iter(bars.values()))[0]
            values = {belief: y for belief, (_, y) in bars.items() if y.size == x.size}
            out[f"spectrum_{key}"] = _bars(f"Spectrum of {what}", x, values)
    sectors = {
        run.belief: looks.over_angle(*found)
        for run in runs
        if (found := over_angle(run)) is not None
    }
    means = {belief: 1e3 * found[1] for belief, found in sectors.items() if found is not None}
    if means:
        at = (np.arange(looks.SECTORS) + 0.5) * 360.0 / looks.SECTORS
        title = "Error minus its segment's mean (0.001°) against the electrical angle (°)"
        out["angle"] = _bars(title, at, means)
    return out


def _bars(title: str, x: Array, values: Mapping[str, Array]) -> Plot:
    """Return bars around x (n,), those of all beliefs side by side."""
    step = float(x[1] - x[0]) if x.size > 1 else 1.0
    return Plot(
        title,
        x - 0.5 * step,
        values,
        [COLOURS.get(belief, GREY) for belief in values],
        bars=True,
        width=step,
    )


def _fluxes(c: Comparison, run: Run) -> tuple[Array, Array]:
    return planes.hodograph(c.drive, working(run), [row.t_end for row in run.rows])


def _circle(radius: float) -> Array:
    turn = np.linspace(0.0, 2.0 * math.pi, 121)
    return radius * np.column_stack([np.cos(turn), np.sin(turn)])
