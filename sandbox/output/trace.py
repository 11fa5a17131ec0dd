"""A comparison as one rerun recording (`.rrd`): write, read, look at. Only this module imports rerun."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sandbox.output.files import check_parent, write_whole
from sandbox.output.looks import means
from sandbox.output.sheets import GREY, Colour, Plot, Sheet, pale
from sandbox.output.tables import comparison_text

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

    from sandbox.evaluation.compare import Comparison, Row, Run

Array = NDArray[np.float64]
Tabs = Mapping[str, Mapping[str, Plot | Sheet]]  # {tab: {name: plot}}

APPLICATION = "sensorless_sandbox"
TIMELINE = "time"
CHUNK = 32_768
# Error and angle cost 52 bytes a sample: up to this many samples in all runs every one is kept.
FULL_RATE_SAMPLES = 300_000
# Slow channels: one value for sixteen samples, which are two whole periods of 500 Hz at 4 kHz.
SLOW = 16
# Readable on white paper and on the viewer's dark ground, and apart for colour-blind eyes.
COLOURS: dict[str, Colour] = {"saturated": (46, 134, 222), "linear": (222, 98, 16)}
STATES = {"start-up": (110, 110, 110), "tracking": (50, 70, 70), "lost lock": (200, 0, 120)}
# Views below the error and the angle: channel, title; two rows of three with the scenario's load.
SLOW_VIEWS = (
    (("current_d", "Current i_d (A)"), ("current_q", "Current i_q (A)"), ("load", "Load (% of rated)")),
    (
        ("ripple_d", "Ripple d, estimated frame (A)"),
        ("ripple_q", "Ripple q, estimated frame (A)"),
        ("speed", "Speed (rad/s electrical)"),
    ),
)


def write_trace(path: Path, comparison: Comparison, looked: Tabs | None = None) -> None:
    """Write all runs of a comparison to one `.rrd` with its blueprint; looked: tabs of what is seen beside time.

    Entities of a run stand under `run.name`: `error` (deg) and `angle` (true, estimated; rad) are recorded
    samples; `current_d`, `current_q`, `ripple_d`, `ripple_q` (A), `speed` (true, estimated; rad/s) are slow.
    Raises ValueError if there is no run, OSError if the file is not writable.
    """
    if not comparison.runs:
        raise ValueError("a trace needs at least one run, this comparison has none")
    stride = sample_stride(comparison)
    with _written(path) as stream:
        stream.send_blueprint(_blueprint(comparison, _pages(stream, looked or {})))
        _send_properties(stream, comparison, stride)
        _send_scenario(stream, comparison, SLOW * stride)
        for run in comparison.runs:
            _send_run(stream, run, stride)


@contextmanager
def _written(path: Path) -> Iterator[rr.RecordingStream]:
    """Give a stream to a file that appears whole or not at all.

    The stream collects in memory: a writer of rerun's own tells of a full disk in its log only.
    """
    import rerun as rr

    check_parent(path)
    with rr.RecordingStream(APPLICATION) as stream:
        collected = stream.memory_recording()
        yield stream
        content = collected.drain_as_bytes()
    write_whole(path, content)


def write_series(path: Path, title: str, text: str, tabs: Tabs) -> None:
    """Write tabs {tab: {name: Plot}} after a summary in markdown; lines are one entity, bars one each under it."""
    import rerun as rr
    import rerun.blueprint as rrb

    pages: list[Any] = [rrb.TextDocumentView(origin="summary", name="Summary")]
    with _written(path) as stream:
        stream.send_recording_name(title)
        stream.log("summary", rr.TextDocument(text, media_type="text/markdown"), static=True, strict=True)
        stream.send_blueprint(_tabs([*pages, *_pages(stream, tabs)]))


def _pages(stream: rr.RecordingStream, tabs: Tabs) -> list[rrb.Grid]:
    """Send all plots; return a grid of views for each tab."""
    import rerun as rr
    import rerun.blueprint as rrb

    pages = []
    for tab, plots in tabs.items():
        own = rr.escape_entity_path_part(tab)
        views = [_send_plot(stream, f"{own}/{name}", plot) for name, plot in plots.items()]
        pages.append(rrb.Grid(*views, grid_columns=2, name=tab))
    return pages


def _send_plot(stream: rr.RecordingStream, entity: str, plot: Plot | Sheet) -> rrb.View:
    """Send one plot; return its view."""
    import rerun as rr
    import rerun.blueprint as rrb

    if isinstance(plot, Sheet):
        for name, (strips, colour, labels) in plot.strips.items():
            drawn = rr.LineStrips2D(strips, colors=[colour], labels=labels or None, radii=rr.Radius.ui_points(1.0))
            stream.log(f"{entity}/{name}", drawn, static=True, strict=True)
        return rrb.Spatial2DView(name=plot.title, origin=f"/{entity}")
    if not plot.bars:
        named = zip(plot.lines.items(), plot.colours, strict=False)
        _send(stream, entity, plot.x, *(_Line(name, values, colour) for (name, values), colour in named))
        return rrb.TimeSeriesView(name=plot.title, contents=[f"/{entity}"])
    own = None if plot.width is None else plot.width / len(plot.lines)
    for k, ((line, values), colour) in enumerate(zip(plot.lines.items(), plot.colours, strict=False)):
        widths = None if own is None else np.full(len(values), own)
        chart = rr.BarChart(values, color=colour, abscissa=plot.x + k * (own or 0.0), widths=widths)
        stream.log(f"{entity}/{line}", chart, static=True, strict=True)
    return rrb.BarChartView(name=plot.title, contents=[f"/{entity}/**"])


def _tabs(pages: Sequence[Any]) -> rrb.Blueprint:
    """Return tabs with everything around them folded."""
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        rrb.Tabs(*pages, active_tab=0),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def sample_stride(comparison: Comparison) -> int:
    """Return how many recorded samples stand behind one error or angle sample (1: all are kept)."""
    samples = sum(int(run.recording.t.size) for run in comparison.runs)
    return max(1, math.ceil(samples / FULL_RATE_SAMPLES))


def read_trace(path: Path) -> dict[str, tuple[Array, Array]]:
    """Read the scalars of a trace: entity path -> (times (n,) in s, values (n, k))."""
    from rerun.chunk import RrdReader

    parts: dict[str, list[tuple[NDArray[np.int64], Array]]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.is_static or "Scalars:scalars" not in batch.schema.names:
            continue
        times = batch.column(TIMELINE).to_numpy(zero_copy_only=False).astype(np.int64)
        flat = batch.column("Scalars:scalars").flatten().to_numpy(zero_copy_only=False)
        entity = str(chunk.entity_path).lstrip("/")
        parts.setdefault(entity, []).append((times, flat.reshape(times.size, -1)))
    found = {}
    for entity, pieces in parts.items():
        times, values = (np.concatenate(column) for column in zip(*pieces, strict=True))
        order = np.argsort(times, kind="stable")
        found[entity] = (times[order] / 1e9, values[order])
    return found


def read_properties(path: Path) -> dict[str, str]:
    """Read how a trace was made: the comparison's properties as text, with motor, scenario, sample stride."""
    from rerun.chunk import RrdReader

    found: dict[str, str] = {}
    for chunk in RrdReader(path).stream():
        if str(chunk.entity_path).endswith("__properties/made"):
            batch = chunk.to_record_batch()
            names = [name for name in batch.schema.names if not name.startswith("rerun")]
            found |= {name: batch.column(name)[0].as_py()[0] for name in names}
    return found


class _Line(NamedTuple):
    """A series of values with its name and colour."""

    name: str
    values: Array
    colour: Colour


def _send(
    stream: rr.RecordingStream, entity: str, t: Array, *lines: _Line, width: float = 1.5, stepped: bool = False
) -> None:
    """Send lines of n values at times t (s), grouped in one entity."""
    import rerun as rr

    style = rr.SeriesLines(
        names=[line.name for line in lines],
        colors=[line.colour for line in lines],
        widths=[width] * len(lines),
        interpolation_mode=rr.components.InterpolationMode.StepAfter if stepped else None,
    )
    stream.log(entity, style, static=True, strict=True)
    values = np.column_stack([line.values for line in lines])
    for start in range(0, t.size, CHUNK):
        part = values[start : start + CHUNK]
        time = rr.TimeColumn(TIMELINE, duration=_nanoseconds(t[start : start + CHUNK]))
        scalars = rr.Scalars.columns(scalars=part.ravel()).partition(np.full(len(part), part.shape[1]))
        stream.send_columns(entity, [time], scalars, strict=True)


def _nanoseconds(t: Array) -> NDArray[np.timedelta64]:
    """Return seconds as integer nanoseconds; rerun truncates floats."""
    return np.rint(t * 1e9).astype("timedelta64[ns]")


def _send_run(stream: rr.RecordingStream, run: Run, stride: int) -> None:
    """Send the channels of one run under its name."""
    rec, name, slow = run.recording, run.name, SLOW * stride
    colour = COLOURS.get(run.belief, GREY)
    thin, thinner = slice(None, None, stride), slice(None, None, slow)

    def own(values: Array) -> _Line:
        """Return a line of the run's name and colour."""
        return _Line(run.belief, values, colour)

    def both(true: Array, estimated: Array) -> tuple[_Line, _Line]:
        """Return what is true, pale, and its estimate."""
        said = _Line(f"estimated, {run.belief}", estimated, colour)
        return _Line(f"true, {run.belief} run", true, pale(colour)), said

    _send(stream, f"{name}/error", rec.t[thin], own(np.rad2deg(rec.error[thin])))
    _send(stream, f"{name}/angle", rec.t[thin], *both(rec.theta[thin], rec.theta_hat[thin]), width=2.0)
    _send(stream, f"{name}/speed", rec.t[thinner], *both(rec.omega[thinner], rec.omega_hat[thinner]))
    # Single samples would meet the injected ripple at one phase only: currents are averaged instead.
    middle = means(rec.t, slow)
    for axis, current, ripple in (("d", rec.i_d, rec.ripple_d), ("q", rec.i_q, rec.ripple_q)):
        _send(stream, f"{name}/current_{axis}", middle, own(means(current, slow)))
        _send(stream, f"{name}/ripple_{axis}", rec.t[thinner], own(ripple[thinner]))
    _send_prediction(stream, run, pale(colour))
    _send_state(stream, run)


def _send_prediction(stream: rr.RecordingStream, run: Run, colour: Colour) -> None:
    """Send the predicted mean error (deg) of each evaluation window as a line, with gaps between them."""
    known = [(row.t_start, row.t_end, row.predicted_mean_deg) for row in run.rows]
    known = [window for window in known if window[2] is not None]
    if known:
        times = np.array([t for start, end, _ in known for t in (start, end, end + 1e-6)])
        values = np.array([v for _, _, value in known for v in (value, value, math.nan)], dtype=np.float64)
        theory = _Line(f"theory, {run.belief}", values, colour)
        _send(stream, f"{run.name}/predicted", times, theory, width=3.0)


def _send_state(stream: rr.RecordingStream, run: Run) -> None:
    """Send the run's state (start-up, tracking, lost lock) as a lane of the state view."""
    import rerun as rr

    rec = run.recording
    turns = np.flatnonzero(np.diff(rec.tracking, prepend=math.nan) != 0)
    changes = [(float(rec.t[i]), "tracking" if rec.tracking[i] else "start-up") for i in turns]
    for row in run.rows:
        if row.lost_lock:
            changes += [(row.t_start, "lost lock"), (row.t_end, "tracking")]
    times, states = zip(*sorted(changes, key=lambda change: change[0]), strict=True)
    time = rr.TimeColumn(TIMELINE, duration=_nanoseconds(np.array(times)))
    looks = rr.StateConfiguration(values=list(STATES), colors=list(STATES.values()))
    stream.log(f"{run.name}/state", looks, static=True, strict=True)
    stream.send_columns(f"{run.name}/state", [time], rr.StateChange.columns(state=states), strict=True)


def _send_scenario(stream: rr.RecordingStream, comparison: Comparison, slow: int) -> None:
    """Send what the scenario asks of every run, as its longest recording shows it."""
    rec = max((run.recording for run in comparison.runs), key=lambda recording: recording.t.size)
    t, load, speed = rec.t[::slow], 100.0 * rec.load[::slow], rec.omega_ref[::slow]
    _send(stream, "scenario/load", t, _Line("load", load, GREY), width=2.0, stepped=True)
    _send(stream, "scenario/speed_ref", t, _Line("reference", speed, GREY), width=2.0)


def _send_properties(stream: rr.RecordingStream, comparison: Comparison, stride: int) -> None:
    """Send the summary and how the comparison was made."""
    import rerun as rr

    motor, scenario = comparison.drive.name, comparison.scenario.name
    facts = {"motor": motor, "scenario": scenario, "sample_stride": stride, **comparison.properties}
    # All as text: rerun binds a property's name to its first type and drops other types with a warning only.
    made = {name: str(fact) for name, fact in facts.items()}
    stream.send_recording_name(f"compare {motor} {scenario}")
    stream.send_property("made", rr.AnyValues(True, **made))
    text = comparison_text(comparison, made, stride, SLOW * stride)
    stream.log("summary", rr.TextDocument(text, media_type="text/markdown"), static=True, strict=True)


def _blueprint(comparison: Comparison, looked: Sequence[rrb.Grid]) -> rrb.Blueprint:
    """Lay the trace out: a summary tab with all errors, one tab per estimator and loop, then what is beside time."""
    import rerun.blueprint as rrb

    groups: dict[str, list[Run]] = {}
    for run in comparison.runs:
        groups.setdefault(f"{run.estimator}, {'closed' if run.closed_loop else 'open'} loop", []).append(run)
    bounds = [_reach(row) for run in comparison.runs for row in run.rows]
    reach = min(180.0, 1.25 * max([3.0, *bounds]))
    errors = [_error_view(runs, f"{title}: error (° electrical)", reach) for title, runs in groups.items()]
    overview = rrb.Grid(*errors, grid_columns=len({run.closed_loop for run in comparison.runs}))
    text = rrb.TextDocumentView(origin="summary", name="How to read, errors, provenance")
    front = rrb.Horizontal(text, overview, column_shares=[2, 3], name="Summary")
    beside = [rrb.Tabs(*looked, name="Planes and spectra")] if looked else []
    return _tabs([front, *(_tab(title, runs, reach) for title, runs in groups.items()), *beside])


def _reach(row: Row) -> float:
    """Return the magnitude (deg) of error a row needs to see; a lost lock would hide all the others."""
    seen = [0.0] if row.lost_lock or row.error_deg.p95 is None else [row.error_deg.p95]
    return max(seen + ([] if row.predicted_mean_deg is None else [abs(row.predicted_mean_deg)]))


def _tab(title: str, runs: list[Run], reach: float) -> rrb.Vertical:
    """Return the views of one estimator and loop."""
    import rerun.blueprint as rrb

    states = rrb.StateTimelineView(name="State", contents=[f"/{run.name}/state" for run in runs])
    error = rrb.Vertical(_error_view(runs, "Position error (° electrical)", reach), states, row_shares=[5, 2])
    top = rrb.Horizontal(error, _angle_view(runs), column_shares=[2, 1])
    rows = [rrb.Horizontal(*(_slow_view(runs, channel, name) for channel, name in row)) for row in SLOW_VIEWS]
    return rrb.Vertical(top, *rows, row_shares=[5, 3, 3], name=title)


def _view(
    name: str, contents: list[str], low: float, high: float, window: tuple[float, float] | None = None
) -> rrb.TimeSeriesView:
    """Return a time series view with its range of values, and of times (s) if it stands alone."""
    import rerun as rr
    import rerun.blueprint as rrb

    axis = None
    if window:
        start, end = (rrb.TimeRangeBoundary.absolute(time=t) for t in _nanoseconds(np.array(window)))
        span = rr.TimeRange(start=start, end=end)
        axis = rrb.TimeAxis(link=rrb.components.LinkAxis.Independent, view_range=span)
    return rrb.TimeSeriesView(
        name=name,
        contents=contents,
        axis_x=axis,
        axis_y=rrb.ScalarAxis(range=(low, high)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )


def _error_view(runs: list[Run], name: str, reach: float) -> rrb.TimeSeriesView:
    """Return the error of all beliefs with theory, in the range (deg) that is common to all views."""
    contents = [f"/{run.name}/{channel}" for channel in ("error", "predicted") for run in runs]
    return _view(name, contents, -reach, reach)


def _slow_view(runs: list[Run], channel: str, name: str) -> rrb.TimeSeriesView:
    """Return one slow channel of all beliefs; the range drops rare peaks and leaves room for the legend."""
    own = [f"/{run.name}/{channel}" for run in runs]
    if channel == "load":
        high = 100.0 * max(float(run.recording.load.max()) for run in runs)
        low = 100.0 * min(float(run.recording.load.min()) for run in runs)
        return _view(name, ["/scenario/load"], 1.1 * low - 10.0, 1.3 * max(high, 10.0))
    fields = {"current_d": ["i_d"], "current_q": ["i_q"], "speed": ["omega", "omega_hat"]}.get(channel, [channel])
    samples = np.concatenate([getattr(run.recording, field) for run in runs for field in fields])
    low, high = (float(bound) for bound in np.nanpercentile(samples, (0.5, 99.5)))
    room = max(high - low, 0.001 * abs(high), 1e-6)
    if channel == "speed":
        return _view(name, [*own, "/scenario/speed_ref"], low - 0.15 * room, high + 1.1 * room)
    return _view(name, own, low - 0.15 * room, high + 0.5 * room)


def _angle_view(runs: list[Run]) -> rrb.TimeSeriesView:
    """Return true and estimated angle over a quarter turn: over a whole run they lie on each other."""
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
    return _view(name, contents, low - 0.2, high + 0.6, (float(rec.t[first]), float(rec.t[last])))
