"""The page of a plan: what to record in which order, its setpoints drawn over time, and what it
will tell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from model.parameters import Drive
from model.ratings import assumed, cautions
from sandbox.gap.planning.bench_plan import Plan, Planned
from sandbox.gap.planning.visible import CLEAR
from sandbox.output.document import answer, bullets, figure, prose, table, write_page
from sandbox.output.sentences import capital, stopped
from sandbox.output.tables import many
from sandbox.output.vector import dots_svg, lines_svg

DRAWN = 800  # points of a line
NEXT = (
    "Setpoints are in one .csv an experiment; what to log and how to lay it down: "
    "sandbox/recordings/RECORDING.md; then: sensorless check CAMPAIGN"
)
LEAST = 0.01  # standard deviations: smaller ones are drawn there


def write_plan(path: Path, plan: Plan, repeats: int) -> None:
    """Write the page of a plan; repeats: how often each experiment is recorded."""
    title = f"{plan.drive.name}: what to record"
    write_page(path, title, parts(plan, title, repeats))


def parts(plan: Plan, title: str, repeats: int) -> Iterator[str]:
    """Yield what stands on the page."""
    yield f"<h1>{prose(title)}</h1>"
    names = ", ".join(p.entry.name for p in plan.experiments)
    each = (
        f"Record each of these {repeats} times, one to be fitted and one to be held out: {names}."
    )
    yield answer("What to record?", each)
    yield f"<p>{prose(NEXT)}</p>"
    yield f"<p>{prose(stopped(capital(plan.link)))}</p>"
    heads = ["experiment", "rotor", "seconds", "settings", "adds"]
    rows = [
        [
            p.entry.name,
            p.entry.rotor,
            f"{p.entry.seconds:.3g}",
            p.settings,
            many(len(p.adds), "effect"),
        ]
        for p in plan.experiments
    ]
    yield table(heads, rows)
    for k, p in enumerate(plan.experiments, 1):
        yield from _experiment(k, p, plan.drive)
    yield from _together(plan)


def _experiment(k: int, p: Planned, drive: Drive) -> Iterator[str]:
    """Yield one experiment: what to do, what it tells, its setpoints over time."""
    yield (
        f"<h2>{k}. {prose(p.entry.name)}</h2><p>{prose(capital(p.entry.description))}; "
        f"{prose(p.settings)}.</p>"
    )
    first = "tells" if k == 1 else "tells beyond those before it"
    yield f"<p>It {first}: {prose(', '.join(p.adds))}.</p>"
    injected = [
        f"{u:.3g} V on {axis}" for axis, u in zip("dq", p.entry.injection, strict=True) if u
    ]
    also = f" Injected beside: a square wave of {' and '.join(injected)}." if injected else ""
    link = f"DC link {p.entry.link * drive.converter.dc_bus_voltage:.4g} V."
    caption = f"Setpoints of {p.entry.name}, every millisecond in {p.entry.name}.csv. {link}{also}"
    yield figure(lines_svg(setpoint_lines(p, drive), "time (s)", alike=True), caption)


def setpoint_lines(
    p: Planned, drive: Drive
) -> list[tuple[str, dict[str, tuple[list[float], list[float]]]]]:
    """Return panels of an experiment's setpoints: currents (A), and speed (rpm) where it is
    imposed."""
    e, period = p.entry, drive.converter.sampling_period
    some = np.unique(np.linspace(0, len(e.i_d) - 1, min(DRAWN, len(e.i_d)), dtype=int))
    t = (some * period).tolist()
    panels = [("current (A)", {"i_d": (t, e.i_d[some].tolist()), "i_q": (t, e.i_q[some].tolist())})]
    if e.rotor == "driven":
        rpm = 60.0 / math.tau / drive.motor.pole_pairs
        panels.append(("speed (rpm)", {"speed": (t, (rpm * e.speed[some]).tolist())}))
    return panels


def _together(plan: Plan) -> Iterator[str]:
    """Yield what all recordings together tell, and what stays alike."""
    v = plan.together
    yield "<h2>What they tell together</h2>"
    by_size = sorted(v.sizes, key=lambda e: -v.sizes[e])
    sizes = {"all recordings": [max(v.sizes[e], LEAST) for e in by_size]}
    caption = (
        f"Typical size of each effect in standard deviations; dashed: {CLEAR:g} of them, "
        "from where it is told."
    )
    yield figure(dots_svg(by_size, sizes, "standard deviations", mark=CLEAR), caption)
    said = []
    for word, text in (("faint", "only faintly told"), ("not", "not told")):
        names = ", ".join(e for e in v.sizes if v.words(e) == word)
        said += [f"{text}: {names}"] if names else []
    said += [f"{a} and {b} still look alike (cosine {cosine:.3f})" for a, b, cosine in v.alike[:6]]
    said += [*cautions(plan.drive), *assumed(plan.drive)]
    yield bullets([capital(stopped(s)) for s in said])
