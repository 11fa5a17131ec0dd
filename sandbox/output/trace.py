"""Traces for the viewer, one rerun recording (`.rrd`) each: write and lay out. Only this module
imports rerun."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from sandbox.output.files import check_parent, write_whole
from sandbox.output.sheets import Colour, Plot, Sheet

if TYPE_CHECKING:
    import rerun as rr

Tabs = Mapping[str, Mapping[str, Plot | Sheet]]  # {tab: {name: plot}}
View = Any  # a view of rerun's blueprint, or views side by side, above each other or in a grid

APPLICATION = "sensorless_sandbox"
TIMELINE = "time"
CHUNK = 32_768


class Line(NamedTuple):
    """A series of values with its name and colour."""

    name: str
    values: Array
    colour: Colour


class Trace:
    """A trace that is being written: every call sends one thing under its entity's path."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream

    def name(self, name: str) -> None:
        """Name the whole trace."""
        self._stream.send_recording_name(name)

    def text(self, entity: str, markdown: str) -> None:
        """Send a text."""
        import rerun as rr

        self._stream.log(
            entity, rr.TextDocument(markdown, media_type="text/markdown"), static=True, strict=True
        )

    def properties(self, facts: Mapping[str, Any]) -> dict[str, str]:
        """Send how the content was made; return it as it is kept, all as text.

        rerun binds a property's name to its first type and drops other types with a warning only.
        """
        import rerun as rr

        made = {name: str(fact) for name, fact in facts.items()}
        self._stream.send_property("made", rr.AnyValues(True, **made))
        return made

    def lines(
        self, entity: str, t: Array, *lines: Line, width: float = 1.5, stepped: bool = False
    ) -> None:
        """Send lines of n values at times t (s), grouped in one entity."""
        import rerun as rr

        style = rr.SeriesLines(
            names=[line.name for line in lines],
            colors=[line.colour for line in lines],
            widths=[width] * len(lines),
            interpolation_mode=rr.components.InterpolationMode.StepAfter if stepped else None,
        )
        self._stream.log(entity, style, static=True, strict=True)
        values = np.column_stack([line.values for line in lines])
        for start in range(0, t.size, CHUNK):
            part = values[start : start + CHUNK]
            time = rr.TimeColumn(TIMELINE, duration=_nanoseconds(t[start : start + CHUNK]))
            scalars = rr.Scalars.columns(scalars=part.ravel()).partition(
                np.full(len(part), part.shape[1])
            )
            self._stream.send_columns(entity, [time], scalars, strict=True)

    def states(
        self, entity: str, changes: Sequence[tuple[float, str]], colours: Mapping[str, Colour]
    ) -> None:
        """Send changes of a state (time in s, its name from then on) as a lane."""
        import rerun as rr

        times, states = zip(*sorted(changes, key=lambda change: change[0]), strict=True)
        time = rr.TimeColumn(TIMELINE, duration=_nanoseconds(np.array(times)))
        looks = rr.StateConfiguration(values=list(colours), colors=list(colours.values()))
        self._stream.log(entity, looks, static=True, strict=True)
        self._stream.send_columns(entity, [time], rr.StateChange.columns(state=states), strict=True)

    def pages(self, tabs: Tabs) -> list[View]:
        """Send all plots; return a grid of views for each tab."""
        import rerun as rr

        pages = []
        for tab, plots in tabs.items():
            own = rr.escape_entity_path_part(tab)
            views = [self._plot(f"{own}/{name}", plot) for name, plot in plots.items()]
            pages.append(grid(views, 2, tab))
        return pages

    def _plot(self, entity: str, plot: Plot | Sheet) -> View:
        """Send one plot; return its view."""
        import rerun as rr
        import rerun.blueprint as rrb

        if isinstance(plot, Sheet):
            for name, (strips, colour, labels) in plot.strips.items():
                drawn = rr.LineStrips2D(
                    strips, colors=[colour], labels=labels or None, radii=rr.Radius.ui_points(1.0)
                )
                self._stream.log(f"{entity}/{name}", drawn, static=True, strict=True)
            return rrb.Spatial2DView(name=plot.title, origin=f"/{entity}")
        if not plot.bars:
            named = zip(plot.lines.items(), plot.colours, strict=False)
            self.lines(
                entity, plot.x, *(Line(name, values, colour) for (name, values), colour in named)
            )
            return rrb.TimeSeriesView(name=plot.title, contents=[f"/{entity}"])
        own = None if plot.width is None else plot.width / len(plot.lines)
        for k, ((line, values), colour) in enumerate(
            zip(plot.lines.items(), plot.colours, strict=False)
        ):
            widths = None if own is None else np.full(len(values), own)
            chart = rr.BarChart(
                values, color=colour, abscissa=plot.x + k * (own or 0.0), widths=widths
            )
            self._stream.log(f"{entity}/{line}", chart, static=True, strict=True)
        return rrb.BarChartView(name=plot.title, contents=[f"/{entity}/**"])

    def lay_out(self, pages: Sequence[View]) -> None:
        """Show pages as tabs, with everything around them folded."""
        import rerun.blueprint as rrb

        blueprint = rrb.Blueprint(
            rrb.Tabs(*pages, active_tab=0),
            rrb.TimePanel(state="collapsed", timeline=TIMELINE),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            auto_views=False,
        )
        self._stream.send_blueprint(blueprint)


@contextmanager
def written(path: Path) -> Iterator[Trace]:
    """Give a trace to a file that appears whole or not at all.

    The stream collects in memory: a writer of rerun's own tells of a full disk in its log only.
    """
    import rerun as rr

    check_parent(path)
    with rr.RecordingStream(APPLICATION) as stream:
        collected = stream.memory_recording()
        yield Trace(stream)
        content = collected.drain_as_bytes()
    write_whole(path, content)


def write_series(path: Path, title: str, text: str, tabs: Tabs) -> None:
    """Write tabs {tab: {name: Plot}} after a summary in markdown; lines are one entity, bars one
    each under it."""
    with written(path) as trace:
        trace.name(title)
        trace.text("summary", text)
        trace.lay_out([text_view("summary", "Summary"), *trace.pages(tabs)])


def text_view(entity: str, name: str) -> View:
    """Return the view of a text."""
    import rerun.blueprint as rrb

    return rrb.TextDocumentView(origin=entity, name=name)


def state_view(name: str, contents: Sequence[str]) -> View:
    """Return the view of states, a lane each."""
    import rerun.blueprint as rrb

    return rrb.StateTimelineView(name=name, contents=list(contents))


def time_view(
    name: str,
    contents: list[str],
    low: float,
    high: float,
    window: tuple[float, float] | None = None,
) -> View:
    """Return a view of lines over time with its range of values, and of times (s) if it stands
    alone."""
    import rerun as rr
    import rerun.blueprint as rrb

    axis = None
    if window:
        start, end = (
            rrb.TimeRangeBoundary.absolute(time=t) for t in _nanoseconds(np.array(window))
        )
        span = rr.TimeRange(start=start, end=end)
        axis = rrb.TimeAxis(link=rrb.components.LinkAxis.Independent, view_range=span)
    return rrb.TimeSeriesView(
        name=name,
        contents=contents,
        axis_x=axis,
        axis_y=rrb.ScalarAxis(range=(low, high)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )


def side_by_side(
    views: Sequence[View], shares: Sequence[float] | None = None, name: str | None = None
) -> View:
    """Return views from left to right."""
    import rerun.blueprint as rrb

    return rrb.Horizontal(*views, column_shares=shares, name=name)


def stacked(
    views: Sequence[View], shares: Sequence[float] | None = None, name: str | None = None
) -> View:
    """Return views from top to bottom."""
    import rerun.blueprint as rrb

    return rrb.Vertical(*views, row_shares=shares, name=name)


def grid(views: Sequence[View], columns: int, name: str | None = None) -> View:
    """Return views row by row."""
    import rerun.blueprint as rrb

    return rrb.Grid(*views, grid_columns=columns, name=name)


def tabbed(views: Sequence[View], name: str) -> View:
    """Return views of which one is seen."""
    import rerun.blueprint as rrb

    return rrb.Tabs(*views, name=name)


def _nanoseconds(t: Array) -> NDArray[np.timedelta64]:
    """Return seconds as integer nanoseconds; rerun truncates floats."""
    return np.rint(t * 1e9).astype("timedelta64[ns]")
