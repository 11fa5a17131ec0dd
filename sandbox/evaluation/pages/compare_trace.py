"""A comparison as a trace for the viewer: all runs over time, laid out by estimator and loop."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from model.array_types import Array
from sandbox.evaluation.pages.compare_tables import comparison_text
from sandbox.output.looks import means
from sandbox.output.sheets import COLOURS, GREY, Colour, pale
from sandbox.output.trace import (
    Line,
    Tabs,
    Trace,
    View,
    grid,
    side_by_side,
    stacked,
    state_view,
    tabbed,
    text_view,
    time_view,
    written,
)

if TYPE_CHECKING:
    from sandbox.evaluation.compare import Comparison, Run
    from sandbox.evaluation.score import Row

# Error and angle cost 52 bytes a sample: up to this many samples in all runs every one is kept.
FULL_RATE_SAMPLES = 300_000
# Slow channels: one value for sixteen samples, which are two whole periods of 500 Hz at 4 kHz.
SLOW = 16
STATES: dict[str, Colour] = {
    "start-up": (110, 110, 110),
    "tracking": (50, 70, 70),
    "lost lock": (200, 0, 120),
}
# Views below the error and the angle: channel, title; two rows of three with the scenario's load.
SLOW_VIEWS = (
    (
        ("current_d", "Current i_d (A)"),
        ("current_q", "Current i_q (A)"),
        ("load", "Load (% of rated)"),
    ),
    (
        ("ripple_d", "Ripple d, estimated frame (A)"),
        ("ripple_q", "Ripple q, estimated frame (A)"),
        ("speed", "Speed (rad/s electrical)"),
    ),
)


def write_trace(path: Path, comparison: Comparison, looked: Tabs | None = None) -> None:
    """Write all runs of a comparison to one `.rrd` with its layout; looked: tabs of what is seen
    beside time.

    Entities of a run stand under `run.name`: `error` (deg) and `angle` (true, estimated; rad) are
    recorded samples; `current_d`, `current_q`, `ripple_d`, `ripple_q` (A), `speed` (true,
    estimated; rad/s) are slow.
    Properties: those of the comparison, with motor, scenario, sample stride.
    Raises ValueError if there is no run, OSError if the file is not writable.
    """
    if not comparison.runs:
        raise ValueError("a trace needs at least one run, this comparison has none")
    stride = sample_stride(comparison)
    with written(path) as trace:
        trace.lay_out(_layout(comparison, trace.pages(looked or {})))
        _send_properties(trace, comparison, stride)
        _send_scenario(trace, comparison, SLOW * stride)
        for run in comparison.runs:
            _send_run(trace, run, stride)


def sample_stride(comparison: Comparison) -> int:
    """Return how many recorded samples stand behind one error or angle sample (1: all are kept)."""
    samples = sum(int(run.recording.t.size) for run in comparison.runs)
    return max(1, math.ceil(samples / FULL_RATE_SAMPLES))


def _send_run(trace: Trace, run: Run, stride: int) -> None:
    """Send the channels of one run under its name."""
    rec, name, slow = run.recording, run.name, SLOW * stride
    colour = COLOURS.get(run.belief, GREY)
    thin, thinner = slice(None, None, stride), slice(None, None, slow)

    def own(values: Array) -> Line:
        """Return a line of the run's name and colour."""
        return Line(run.belief, values, colour)

    def both(true: Array, estimated: Array) -> tuple[Line, Line]:
        """Return what is true, pale, and its estimate."""
        said = Line(f"estimated, {run.belief}", estimated, colour)
        return Line(f"true, {run.belief} run", true, pale(colour)), said

    trace.lines(f"{name}/error", rec.t[thin], own(np.rad2deg(rec.error[thin])))
    trace.lines(
        f"{name}/angle", rec.t[thin], *both(rec.theta[thin], rec.theta_hat[thin]), width=2.0
    )
    trace.lines(f"{name}/speed", rec.t[thinner], *both(rec.omega[thinner], rec.omega_hat[thinner]))
    # Single samples would meet the injected ripple at one phase only: currents are averaged
    # instead.
    middle = means(rec.t, slow)
    for axis, current, ripple in (("d", rec.i_d, rec.ripple_d), ("q", rec.i_q, rec.ripple_q)):
        trace.lines(f"{name}/current_{axis}", middle, own(means(current, slow)))
        trace.lines(f"{name}/ripple_{axis}", rec.t[thinner], own(ripple[thinner]))
    _send_prediction(trace, run, pale(colour))
    _send_state(trace, run)


def _send_prediction(trace: Trace, run: Run, colour: Colour) -> None:
    """Send the predicted mean error (deg) of each evaluation window as a line, with gaps between
    them."""
    known = [(row.t_start, row.t_end, row.predicted_mean_deg) for row in run.rows]
    known = [window for window in known if window[2] is not None]
    if known:
        times = np.array([t for start, end, _ in known for t in (start, end, end + 1e-6)])
        values = np.array(
            [v for _, _, value in known for v in (value, value, math.nan)], dtype=np.float64
        )
        trace.lines(
            f"{run.name}/predicted", times, Line(f"theory, {run.belief}", values, colour), width=3.0
        )


def _send_state(trace: Trace, run: Run) -> None:
    """Send the run's state (start-up, tracking, lost lock) as a lane."""
    rec = run.recording
    turns = np.flatnonzero(np.diff(rec.tracking, prepend=math.nan) != 0)
    changes = [(float(rec.t[i]), "tracking" if rec.tracking[i] else "start-up") for i in turns]
    for row in run.rows:
        if row.lost_lock:
            changes += [(row.t_start, "lost lock"), (row.t_end, "tracking")]
    trace.states(f"{run.name}/state", changes, STATES)


def _send_scenario(trace: Trace, comparison: Comparison, slow: int) -> None:
    """Send what the scenario asks of every run, as its longest recording shows it."""
    rec = max((run.recording for run in comparison.runs), key=lambda recording: recording.t.size)
    t, load, speed = rec.t[::slow], 100.0 * rec.load[::slow], rec.omega_ref[::slow]
    trace.lines("scenario/load", t, Line("load", load, GREY), width=2.0, stepped=True)
    trace.lines("scenario/speed_ref", t, Line("reference", speed, GREY), width=2.0)


def _send_properties(trace: Trace, comparison: Comparison, stride: int) -> None:
    """Send the summary and how the comparison was made."""
    motor, scenario = comparison.drive.name, comparison.scenario.name
    trace.name(f"compare {motor} {scenario}")
    facts = {"motor": motor, "scenario": scenario, "sample_stride": stride, **comparison.properties}
    made = trace.properties(facts)
    trace.text("summary", comparison_text(comparison, made, stride, SLOW * stride))


def _layout(comparison: Comparison, looked: list[View]) -> list[View]:
    """Return the pages: a summary with all errors, one per estimator and loop, then what is beside
    time."""
    groups: dict[str, list[Run]] = {}
    for run in comparison.runs:
        groups.setdefault(
            f"{run.estimator}, {'closed' if run.closed_loop else 'open'} loop", []
        ).append(run)
    bounds = [_reach(row) for run in comparison.runs for row in run.rows]
    reach = min(180.0, 1.25 * max([3.0, *bounds]))
    errors = [
        _error_view(runs, f"{title}: error (° electrical)", reach) for title, runs in groups.items()
    ]
    overview = grid(errors, len({run.closed_loop for run in comparison.runs}))
    text = text_view("summary", "How to read, errors, provenance")
    front = side_by_side([text, overview], [2, 3], "Summary")
    more = [tabbed(looked, "Planes and spectra")] if looked else []
    return [front, *(_tab(title, runs, reach) for title, runs in groups.items()), *more]


def _reach(row: Row) -> float:
    """Return the magnitude (deg) of error a row needs to see; a lost lock would hide all the
    others."""
    seen = [0.0] if row.lost_lock or row.error_deg.p95 is None else [row.error_deg.p95]
    return max(seen + ([] if row.predicted_mean_deg is None else [abs(row.predicted_mean_deg)]))


def _tab(title: str, runs: list[Run], reach: float) -> View:
    """Return the views of one estimator and loop."""
    states = state_view("State", [f"/{run.name}/state" for run in runs])
    error = stacked([_error_view(runs, "Position error (° electrical)", reach), states], [5, 2])
    top = side_by_side([error, _angle_view(runs)], [2, 1])
    rows = [
        side_by_side([_slow_view(runs, channel, name) for channel, name in row])
        for row in SLOW_VIEWS
    ]
    return stacked([top, *rows], [5, 3, 3], title)


def _error_view(runs: list[Run], name: str, reach: float) -> View:
    """Return the error of all beliefs with theory, in the range (deg) that is common to all
    views."""
    contents = [f"/{run.name}/{channel}" for channel in ("error", "predicted") for run in runs]
    return time_view(name, contents, -reach, reach)


def _slow_view(runs: list[Run], channel: str, name: str) -> View:
    """Return one slow channel of all beliefs; the range drops rare peaks and leaves room for the
    legend."""
    own = [f"/{run.name}/{channel}" for run in runs]
    if channel == "load":
        high = 100.0 * max(float(run.recording.load.max()) for run in runs)
        low = 100.0 * min(float(run.recording.load.min()) for run in runs)
        return time_view(name, ["/scenario/load"], 1.1 * low - 10.0, 1.3 * max(high, 10.0))
    fields = {"current_d": ["i_d"], "current_q": ["i_q"], "speed": ["omega", "omega_hat"]}.get(
        channel, [channel]
    )
    samples = np.concatenate([getattr(run.recording, field) for run in runs for field in fields])
    low, high = (float(bound) for bound in np.nanpercentile(samples, (0.5, 99.5)))
    room = max(high - low, 0.001 * abs(high), 1e-6)
    if channel == "speed":
        return time_view(name, [*own, "/scenario/speed_ref"], low - 0.15 * room, high + 1.1 * room)
    return time_view(name, own, low - 0.15 * room, high + 0.5 * room)


def _angle_view(runs: list[Run]) -> View:
    """Return true and estimated angle over a quarter turn: over a whole run they lie on each
    other."""
    rec = runs[0].recording
    lost = {row.t_end for run in runs for row in run.rows if row.lost_lock}
    locked = [row.t_end for row in runs[0].rows if row.t_end not in lost]
    end = locked[-1] if locked else float(rec.t[-1])
    last = int(np.searchsorted(rec.t, end, side="right")) - 1
    away = np.flatnonzero(np.abs(rec.theta[:last] - rec.theta[last]) > math.pi / 2)
    first = int(away[-1]) if away.size else 0
    low, high = sorted((float(rec.theta[first]), float(rec.theta[last])))
    name = f"Angle (rad electrical), quarter turn before {end:.1f} s"
    contents = [f"/{run.name}/angle" for run in runs]
    return time_view(
        name, contents, low - 0.2, high + 0.6, (float(rec.t[first]), float(rec.t[last]))
    )
