"""The page of a comparison: which estimator for this motor, what the saturated belief brings, runs
looked at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from model.effects.library import parameters
from model.ratings import cautions
from sandbox.evaluation.choice import Standing, best, far_off, gained, standings, theory_held, which
from sandbox.evaluation.compare import Comparison, Run
from sandbox.evaluation.lost import reasons
from sandbox.evaluation.pages import planes
from sandbox.evaluation.pages.compare_figure import reading
from sandbox.evaluation.pages.compare_sheets import most_current, over_angle, spectra, working
from sandbox.evaluation.pages.compare_tables import comparison_tables
from sandbox.evaluation.pages.cost_figure import READING as COSTS
from sandbox.evaluation.pages.cost_figure import cost_svg, cost_table
from sandbox.evaluation.pages.loci import angle_svg, estimator_svg, hodograph_svg, loci_svg
from sandbox.output import looks
from sandbox.output.document import answer, bullets, figure, fold, pairs, prose, table, write_page
from sandbox.output.plots import colour_of
from sandbox.output.vector import lines_svg
from sandbox.plant.sets import BENCH

DRAWN = 600  # blocks of a line over time
ESTIMATED = (0.16, 0.62, 0.36)  # of the estimated speed on the true one
NOT_IN_IT = (
    "It is a simulation: what the drive has beside this model (see `sensorless list effects`) is "
    "not in it unless it was added by --effects; nothing was.",
    "The saturated belief is the plant's own model, so it is as good as a model can be; ",
)
ASK = (
    "`sensorless compare --tolerances` shows what is left of it when the model is known to "
    "some percent only."
)
STANDINGS = (
    "Worst mean: the largest mean position error of any segment of the scenario. Worst 95 %: in "
    "every segment 95 % of the samples err by less. Lock lost: in how many segments. "
)
MISSED = "Speed missed: in how many segments the rotor did not run at the speed asked for."
NOT_ASKED = "This scenario asks for currents or imposes the speed, so no speed can be missed."
KNOWN = "What is left when the model is known to some percent only"


class Known(NamedTuple):
    """What is left where the belief is known to some percent only: heads and lines of a table, a
    drawing (SVG)."""

    heads: Sequence[str]
    lines: Sequence[Sequence[str]]
    drawing: str


def write_comparison(path: Path, c: Comparison, known: Known | None = None) -> None:
    """Write the page of a comparison; known: what tolerances of the belief's parameters showed,
    where they were run."""
    title = f"{c.drive.name}, {c.scenario.name}: which estimator, which belief"
    write_page(path, title, parts(c, title, known))


def write_run(path: Path, c: Comparison) -> None:
    """Write the page of a single run, a comparison of one."""
    run = c.runs[0]
    title = f"{c.drive.name}, {c.scenario.name}: {run.estimator}, {run.belief} belief"
    write_page(path, title, _run_parts(c, run, title))


def _run_parts(c: Comparison, run: Run, title: str) -> Iterator[str]:
    """Yield the parts of a single run's page."""
    yield f"<h1>{prose(title)}</h1>"
    yield answer("How far is it off?", far_off(standings(run.rows)[0]))
    yield from _lost(c)
    yield from _cautioned(c)
    yield answer("What is not in it?", _effects_said(c))
    yield figure(estimator_svg([run]), reading(c.runs))
    if (cost := standings(run.rows)[0:1]) and cost[0].loss_w is not None:
        yield "<h2>What the injection costs</h2>" + table(
            *cost_table([replace(cost[0], closed_loop=True)])
        )
        yield f"<p class='soft'>{prose(COSTS)}</p>"
    yield from looked(c, [run])
    for heading, heads, rows in comparison_tables(c):
        yield fold(f"Every stretch: {heading}", table(heads, rows))
    yield _made(c)


def parts(c: Comparison, title: str, known: Known | None = None) -> Iterator[str]:
    """Yield the page's parts, the answers first."""
    found = standings(c.rows)
    yield f"<h1>{prose(title)}</h1>"
    yield answer("Which estimator for this motor?", which(found, c.limits))
    yield answer(
        "What does believing the saturated model bring?", f"{gained(found)} {theory_held(c.rows)}"
    )
    yield from _lost(c)
    yield from _cautioned(c)
    then = f"see '{KNOWN}' below." if known else ASK
    yield answer("What is not in it?", f"{_effects_said(c)} {NOT_IN_IT[1]}{then}")
    asked = c.scenario.reference == "speed"
    yield "<h2>All estimators, the estimate in control</h2>" + _standings(
        [s for s in found if s.closed_loop], asked
    )
    yield f"<p class='soft'>{prose(STANDINGS + (MISSED if asked else NOT_ASKED))}</p>"
    yield fold(
        "The same, the encoder in control",
        _standings([s for s in found if not s.closed_loop], asked),
    )
    if any(s.loss_w is not None for s in found):
        yield "<h2>What the injection costs</h2>" + table(*cost_table(found))
        yield figure(
            cost_svg(found, c.limits),
            "Error, added loss and sound, the smallest error first; dashed: limits asked for.",
        )
        yield f"<p class='soft'>{prose(COSTS)}</p>"
    if known:
        yield f"<h2>{KNOWN}</h2>" + table(known.heads, known.lines)
        yield figure(
            known.drawing,
            "Each parameter of the belief is drawn evenly within ± so much; the plant stays.",
        )
    yield "<h2>Position error by estimator, the estimate in control</h2>"
    groups: dict[str, list[Run]] = {}
    for run in c.runs:
        if run.closed_loop:
            groups.setdefault(run.estimator, []).append(run)
    drawn = (
        f"<div><h3>{prose(name)}</h3>{figure(estimator_svg(own), '')}</div>"
        for name, own in groups.items()
    )
    yield from pairs(drawn)
    yield f"<p class='soft'>{prose(reading(c.runs))}</p>"
    chosen = next((s.estimator for s in best(found, c.limits)), next(iter(groups), None))
    if chosen is not None:
        yield f"<h2>{prose(chosen)} in detail</h2>"
        yield from looked(c, groups[chosen])
    for heading, heads, rows in comparison_tables(c):
        yield fold(f"Every segment: {heading}", table(heads, rows))
    yield _made(c)


def _effects_said(c: Comparison) -> str:
    """Return what the plant lacks, and what it has beside the model."""
    if not c.effects:
        return NOT_IN_IT[0]
    known = {name: p.unit for name, p in (parameters() | BENCH).items()}
    effects = ", ".join(
        f"{k} = {float(v):g} {known.get(k, '')}".rstrip() for k, v in c.effects.items()
    )
    return (
        "It is a simulation: nothing that the drive has beside this model (see `sensorless list "
        f"effects`) is in it but what was added, {effects}."
    )


def _lost(c: Comparison) -> Iterator[str]:
    """Yield why lock was lost, where motor, load or speed says it."""
    if listed := reasons(c.rows):
        yield "<h2>Why lock was lost</h2>" + bullets(listed)


def _cautioned(c: Comparison) -> Iterator[str]:
    """Yield what about the drive's ratings cannot be meant."""
    if texts := cautions(c.drive):
        yield answer("Is the motor as it is meant?", " ".join(f"Caution: {text}" for text in texts))


def _made(c: Comparison) -> str:
    """Return how the runs were made, folded."""
    return fold(
        "How it was made",
        table(["", ""], [[name, str(value)] for name, value in c.properties.items()]),
    )


def _standings(found: Sequence[Standing], asked: bool) -> str:
    """Return the table of worst figures; asked: whether a speed was asked for, which can be
    missed."""
    rows = []
    for s in found:
        lock = f"{s.lost} of {s.stretches}" if s.lost else "never"
        worst = "–" if s.worst_mean is None else f"{s.worst_mean:.2f}°"
        p95 = "–" if s.worst_p95 is None else f"{s.worst_p95:.2f}°"
        missed = [f"{s.missed} of {s.stretches}" if s.missed else "never"] if asked else []
        rows.append([f"{s.estimator}, {s.belief}", worst, p95, lock, *missed])
    heads = [
        "estimator, belief",
        "worst mean",
        "worst 95 %",
        "lock lost",
        *["speed missed"][:asked],
    ]
    return table(heads, rows)


def looked(c: Comparison, runs: Sequence[Run]) -> Iterator[str]:
    """Yield drawings of one estimator's runs, a belief each: time, currents, flux, spectra,
    angle."""
    names, colours = [run.belief for run in runs], [colour_of(run.belief) for run in runs]
    kept = dict(zip(names, runs, strict=True))
    panels = [("error (°)", {n: _error(run) for n, run in kept.items()})]
    panels.append(("i_q (A)", {n: _line(run, "i_q") for n, run in kept.items()}))
    turns = any(np.any(run.recording.omega) for run in runs)
    if turns:
        panels += speeds(kept)
        colours += [ESTIMATED] if len(kept) == 1 else []
    said = (
        ", true and estimated speed."
        if turns
        else ". The rotor is locked, so there is no speed to draw."
    )
    asked = c.scenario.reference == "speed" and any(s.load for s in c.scenario.segments)
    pushed = (
        " A load that comes on pushes a free rotor away, until the integral of the speed "
        "loop has followed."
    )
    yield figure(
        lines_svg(panels, "time (s)", colours=colours, alike=True),
        "Over time: true minus estimated position (lost lock left out) and true current"
        + said
        + pushed * asked,
    )
    yield from pairs(_planes(c, kept))
    yield from pairs(_spectra(c, kept))


def speeds(kept: dict[str, Run]) -> list[tuple[str, dict[str, tuple[list[float], list[float]]]]]:
    """Return panels of true and estimated speed: one of a single run, one each where there are
    several."""
    if len(kept) == 1:
        (run,) = kept.values()
        return [
            (
                "speed\n(rad/s el.)",
                {"true": _line(run, "omega"), "estimated": _line(run, "omega_hat")},
            )
        ]
    names = {"true speed\n(rad/s el.)": "omega", "estimated\n(rad/s el.)": "omega_hat"}
    return [
        (head, {n: _line(run, name) for n, run in kept.items()}) for head, name in names.items()
    ]


def _error(run: Run) -> tuple[list[float], list[float]]:
    """Return the error (degrees) over time from the first evaluated segment on; NaN where it would
    hide all else."""
    r = working(run)
    seen = [row.transient_max_deg for row in run.rows if row.transient_max_deg is not None]
    t, e = looks.thinned(r.t, np.degrees(r.error), DRAWN)
    return t.tolist(), np.where(np.abs(e) <= 1.1 * max(seen, default=45.0), e, np.nan).tolist()


def _line(run: Run, name: str) -> tuple[list[float], list[float]]:
    t, values = looks.thinned(run.recording.t, run.recording[name], DRAWN)
    return t.tolist(), values.tolist()


def _planes(c: Comparison, kept: dict[str, Run]) -> Iterator[str]:
    """Yield the paths of currents and fluxes."""
    paths = {name: planes.currents(c.drive, working(run)) for name, run in kept.items()}
    plane = planes.plane(c.drive, most_current(c, paths.values()))
    if plane is not None:
        yield figure(
            loci_svg(plane, paths, c.drive.motor.rated_current),
            "Where the currents go (true ones, ripple averaged out) over what injection sees. "
            "Grey: saliency, green: error of a linear belief in degrees, dotted: rated current.",
        )
    yield figure(
        hodograph_svg(
            {
                n: planes.hodograph(c.drive, working(run), [row.t_end for row in run.rows])
                for n, run in kept.items()
            },
            c.drive.motor.magnet_flux,
        ),
        "Hodograph: the flux linkage in the stator's frame, by the nominal model at these "
        "currents; dotted: the magnet alone. Of a turning rotor the last turn of each segment.",
    )


def _spectra(c: Comparison, kept: dict[str, Run]) -> Iterator[str]:
    """Yield spectra of ripple and error, and the error against the angle."""
    found = {name: own for name, run in kept.items() if (own := spectra(c, run))}
    if found:
        panels = [
            (
                title,
                {name: (own[key][0].tolist(), own[key][1].tolist()) for name, own in found.items()},
            )
            for key, title in (("current", "i_dq (A)"), ("error", "error (°)"))
        ]
        yield figure(
            lines_svg(
                panels,
                "frequency (Hz)",
                log="y",
                colours=[colour_of(name) for name in found],
                alike=True,
            ),
            "Spectrum of the true current in the rotor's frame and of the position error, longest "
            f"evaluated segment in lock; injection at {c.drive.injection.frequency:g} Hz. Height: "
            "amplitude of a line there.",
        )
    drawing = angle_svg(
        {name: over for name, run in kept.items() if (over := over_angle(run)) is not None}
    )
    if drawing:
        caption = (
            "Position error minus its segment's mean, against the rotor's angle: mean, and "
            "nine samples in ten."
        )
        yield figure(drawing, caption)
