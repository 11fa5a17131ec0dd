"""Results for people and for scripts: terminal tables, markdown, JSON files that appear whole."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from model.errors import BadInput, PhysicsError

if TYPE_CHECKING:
    from model.parameters import Drive
    from model.saliency import Audit
    from sandbox.compare import Comparison
    from sandbox.design import Design
    from sandbox.identify import Identification
    from sandbox.score import ErrorDeg, Row

SCHEMA = 1
BELIEFS = ("saturated", "linear")


def version() -> str:
    """Return the package's version, or `source` where it runs from a plain checkout."""
    try:
        return installed("sensorless-sandbox")
    except PackageNotFoundError:
        return "source"


def plain(value: Any) -> Any:
    """Return a value as JSON knows it: arrays as lists, undefined numbers as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value


KINDS = (".json", ".png", ".svg", ".rrd", ".npz", ".html", ".parquet")


def _aside(place: Path, full: Path) -> Path:
    return place / f".part-{os.getpid()}-{zlib.crc32(os.fsencode(full)):x}"


def _waiting(out: Path) -> Path:
    """Return a new folder for files on their way to `out`, below the nearest place that exists."""
    full = Path(os.path.realpath(out))
    place = next(p for p in (full, *full.parents) if os.path.lexists(p))
    path = _aside(place, full) / full.relative_to(place)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot write to '{out}': {error.strerror}; give another --out") from None
    return path


def check_output(out: Path) -> None:
    """Raise BadInput, before a run, where its results could not be written to a folder; nothing is left there."""
    try:
        _waiting(out)
    finally:
        discard(out)


def output_folder(out: Path) -> Path:
    """Return the folder for results, made if need be; BadInput where it cannot be."""
    check_output(out)
    out.mkdir(parents=True, exist_ok=True)
    return out


@contextmanager
def results(out: Path, command: str) -> Iterator[Path]:
    """Give a folder for a command's files; they appear in `out` together, the JSON last, or not at all.

    A folder that does not exist appears whole.  What an earlier call left there under the same names goes, so that
    the files in a folder belong together.
    """
    try:
        waiting = _waiting(out)
        yield waiting
        _publish(waiting, Path(os.path.realpath(out)), command)
    finally:
        discard(out)


def _publish(waiting: Path, full: Path, command: str) -> None:
    missing = [p for p in (full, *full.parents) if not os.path.lexists(p)]
    if missing:
        top = missing[-1]
        with suppress(OSError):  # made by another process in the meantime: file by file
            os.rename(_aside(top.parent, full) / top.name, top)
            return
    full.mkdir(parents=True, exist_ok=True)
    for old in full.glob(f"{command}.*"):
        if old.suffix in KINDS and not (waiting / old.name).exists():
            old.unlink()
    for new in sorted(waiting.iterdir(), key=lambda path: path.suffix == ".json"):
        new.replace(full / new.name)


def discard(out: Path) -> None:
    """Remove what this process had not finished writing into a folder, and on the way to it."""
    full = Path(os.path.realpath(out))
    for place in (full, *full.parents):
        shutil.rmtree(_aside(place, full), ignore_errors=True)


def write_json(out: Path, name: str, content: dict[str, Any], command: str = "") -> Path:
    """Write `<name>.json` with the common header into a folder, whole or not at all; return its path.

    command: the header's, where the file is not named after it.
    """
    path = out / f"{name}.json"
    document = {"schema": SCHEMA, "command": command or name, "version": version(), **plain(content)}
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        aside.write_text(text, encoding="utf-8")
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)
    return path


@contextmanager
def progress_bar(title: str, quiet: bool) -> Iterator[Callable[[float], None] | None]:
    """Give a function that shows the fraction done; None where nobody watches."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


@contextmanager
def stage_bar(title: str, quiet: bool) -> Iterator[Callable[[str], None]]:
    """Give a function that shows what is being done, where nobody knows how many stages there will be."""
    if quiet or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda stage: bar.update(
            task, description=f"{title}: {stage}", advance=0.1 * (bar.tasks[0].remaining or 0.0)
        )


def print_table(title: str, heads: list[str], rows: list[list[str]]) -> None:
    """Print a table; the first column to the left, numbers to the right."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", title_style="bold")
    for k, head in enumerate(heads):
        table.add_column(head, justify="left" if k == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    wide = sum(max(len(r[k]) for r in [heads, *rows]) + 3 for k in range(len(heads))) + 1
    terminal = shutil.get_terminal_size().columns if sys.stdout.isatty() else 80
    Console(width=max(wide, terminal), markup=False, highlight=False, soft_wrap=True).print(table)  # never cut a number


def comparison_tables(c: Comparison) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return title, heads and cells of one table for the closed and one for the open loop.

    A line is a segment; a cell the mean error in degrees with the 95th percentile of its size.
    """
    tables = []
    for closed in sorted({r.closed_loop for r in c.runs}, reverse=True):
        runs = [r for r in c.runs if r.closed_loop == closed]
        loop = "closed loop (the estimate controls)" if closed else "open loop (the encoder controls)"
        heads = ["load %", "rpm", "theory °", *(f"{r.estimator} {r.belief[:3]}." for r in runs)]
        lines = []
        for k, row in enumerate(runs[0].rows):
            theory = [r.rows[k].predicted_mean_deg for r in runs if r.belief == "linear"]
            known = next((t for t in theory if t is not None), None)
            cells = [_cell(r.rows[k]) for r in runs]
            lines.append([f"{100 * row.load:+.0f}", f"{row.speed_rpm:+.4g}", _number(known), *cells])
        tables.append((f"{c.drive.name}, {c.scenario.name}, {loop}", heads, lines))
    return tables


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value + 0.0 if abs(value) >= 0.005 else 0.0:+.2f}"


def _cell(row: Row) -> str:
    if row.lost_lock:
        return "lost lock"
    if row.error_deg.p95 is None:
        return "–"
    return f"{_number(row.error_deg.mean)} ({row.error_deg.p95:.1f}){'' if row.reference_held else ' speed missed'}"


def print_comparison(c: Comparison) -> None:
    """Print both tables and how to read them."""
    for title, heads, rows in comparison_tables(c):
        print_table(title, heads, rows)
    print(
        "Position error in electrical degrees, mean (95th percentile of its size); theory: the cross-saturation "
        "angle that a linear belief cannot see, for small ripple."
    )


def comparison_markdown(c: Comparison) -> str:
    """Return the same tables as markdown."""
    blocks = []
    for title, heads, rows in comparison_tables(c):
        lines = [f"**{title}**", "", f"| {' | '.join(heads)} |", "|" + "--:|" * len(heads)]
        blocks.append("\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]))
    return "\n\n".join(blocks)


def comparison_text(comparison: Comparison, made: dict[str, str], stride: int, slow: int) -> str:
    """Return the markdown shown first: how to read the trace, the table of errors, how it was made."""
    kept = "every recorded sample" if stride == 1 else f"one recorded sample in {stride}"
    reading = (
        "Error = true minus estimated angle, degrees electrical. **Blue**: the estimator believes the "
        "saturated model, **orange**: the linear one, pale lines: theory over the evaluation windows. Error "
        "views are cut to what runs in lock need. Angle views open on a quarter turn of the last window in "
        f"lock. Error and angle hold {kept}, currents means over {slow} samples, ripple and speed "
        f"one sample in {slow}."
    )
    provenance = [f"| {name} | {value} |" for name, value in made.items()]
    title = f"# {comparison.drive.name}, {comparison.scenario.name}"
    table = comparison_markdown(comparison)
    return "\n".join([title, reading, "", table, "", "| made with | |", "|---|---|", *provenance])


def print_run(c: Comparison, gains: Design) -> None:
    """Print the rows of a single run and the loops it was controlled by."""
    run = c.runs[0]
    heads = ["load %", "rpm", "theory °", "mean °", "rms °", "p95 °", "max °"]
    lines = []
    for row in run.rows:
        e = row.error_deg
        values = ["lost lock", "", "", ""] if row.lost_lock else [_number(e.mean), *(f"{v:.2f}" for v in _sizes(e))]
        values[0] += "" if row.reference_held else " (speed missed)"
        lines.append([f"{100 * row.load:+.0f}", f"{row.speed_rpm:+.4g}", _number(row.predicted_mean_deg), *values])
    print_table(f"{c.drive.name}, {c.scenario.name}, {run.name}: position error", heads, lines)
    heads = ["loop", "bandwidth rad/s", "phase margin °", "gain margin", "disk margin"]
    loops = [
        [name, f"{v.bandwidth:.1f}", f"{v.phase_margin_deg:.1f}", f"{v.gain_margin:.2f}", f"{v.disk_margin:.2f}"]
        for name, v in gains.loops.items()
    ]
    print_table("designed loops (tracking loop: at zero load; the filter `ekf` has its own)", heads, loops)


def _sizes(e: ErrorDeg) -> tuple[float, float, float]:
    return (e.rms or 0.0, e.p95 or 0.0, e.max or 0.0)


def audit_content(drive: Drive, a: Audit) -> dict[str, Any]:
    """Return what `audit.json` holds beyond its header; radii in A, up to the audited one."""
    from sandbox.injection import carrier

    primitive = carrier(drive.injection, drive.converter).primitive
    ripple = drive.injection.amplitude * float(np.max(np.abs(primitive)))  # Wb
    saliency = a.slope * abs(drive.motor.energy.gamma_d - drive.motor.energy.gamma_q) * ripple  # A/rad
    return {
        "motor": a.motor, "passed": a.passed, "radius": a.radius, "valid_radius": a.valid_radius,
        "min_eigenvalue": a.min_eigenvalue, "worst_current": a.worst_current, "violations": a.violations,
        "saliency_radius": a.saliency_radius,
        "torque_at_rated_current": _torque(drive), "rated_torque": drive.motor.rated_torque, "load": a.load,
        "angle_local_deg": np.degrees(a.angle_local), "angle_closed_deg": np.degrees(a.angle_closed),
        "relative_slope": a.slope, "error_per_10mA_deg": np.degrees(0.01 / saliency),
        "provenance": drive.provenance,
    }  # fmt: skip


def _torque(drive: Drive) -> float:
    """Return the torque (N m) at rated current on q, NaN outside the valid domain."""
    from sandbox.simulate import torque_at_load

    try:
        return torque_at_load(drive, 1.0)
    except PhysicsError:
        return math.nan


def print_audit(drive: Drive, a: Audit) -> None:
    """Print an audit: validity in sentences, then the cross-saturation angle against load."""
    if a.passed:
        print(
            f"{a.motor}: valid up to {a.radius:.4g} A ({a.radius / a.rated_current:.0%} of rated current); smallest "
            f"eigenvalue of the Hessian {a.min_eigenvalue:.4g} 1/H "
            f"at i = ({a.worst_current[0]:.3f}, {a.worst_current[1]:.3f}) A"
        )
    else:
        from model.energy import Energy

        v = a.violations[0]
        end = "the energy stops being convex" if isinstance(drive.motor.energy, Energy) else "the flux map ends"
        print(
            f"{a.motor}: NOT valid over the audited {a.radius:.4g} A: {end} at i_d = "
            f"{v['i_d']:.4g} A, i_q = {v['i_q']:.3f} A, so it may be used up to {a.valid_radius:.4g} A "
            f"({a.valid_radius / a.rated_current:.0%} of rated current)"
        )
    kept = "in the whole disc" if a.saliency_radius >= a.radius else f"up to {a.saliency_radius:.4g} A"
    print(f"saliency L_qq - L_dd keeps its sign, so that q-null injection is feasible: {kept}")
    rated = drive.motor.rated_torque
    print(f"torque at rated current on q: {_torque(drive):.4g} N m (rated torque {rated:.4g} N m; currents are peak)")
    content = audit_content(drive, a)
    heads = ["load %", "angle °, encoder controls", "angle °, estimate controls", "slope of the null", "° per 10 mA"]
    keys = ("angle_local_deg", "angle_closed_deg", "relative_slope", "error_per_10mA_deg")
    lines = [
        [f"{100 * a.load[k]:+.0f}", *("–" if math.isnan(v) else f"{v:+.2f}" for v in (content[key][k] for key in keys))]
        for k in range(0, a.load.size, 3)
    ]
    print_table("cross-saturation angle, i_d = 0", heads, lines)


def catalogue(kind: str) -> list[tuple[str, str]]:
    """Return name and one line of every motor, effect, estimator or scenario."""
    if kind == "effects":
        from model.effects.library import effect_names, load_effect

        return [(name, f"{load_effect(name).subsystem}: {load_effect(name).summary}") for name in effect_names()]
    if kind == "motors":
        from model.parameters import describe, mapped_names, motor_names

        return [(name, describe(name)) for name in (*motor_names(), *mapped_names())]
    if kind == "estimators":
        from estimators.registry import estimator_names, load_estimator

        return [(name, load_estimator(name).summary) for name in estimator_names()]
    if kind == "datasets":
        from model.datasets import catalogue as datasets

        return datasets()
    from sandbox.scenario import load_scenario, scenario_names

    return [(name, load_scenario(name).description) for name in scenario_names()]


def print_identification(result: Identification) -> None:
    """Print both fits beside the nominal values, and what there is to remark."""
    nominal = result.campaign.drive.motor
    names = list(result.fits["exact"].values)
    lines = []
    for name in names:
        cells = [name, f"{getattr(nominal, name):.5g}"]
        for fit in result.fits.values():
            low, high = fit.ci95(name) if name in fit.values else (math.nan, math.nan)
            cells.append(f"{fit.values[name]:.5g} [{low:.4g}, {high:.4g}]" if name in fit.values else "–")
        lines.append(cells)
    print_table(f"{result.campaign.name}: identified motor (SI)", ["parameter", "nominal", *result.fits], lines)
    for name, fit in result.fits.items():
        share = "" if math.isnan(fit.misfit) else f", {fit.misfit:.3g} x what noise explains"
        print(f"{name}: residual {1e3 * fit.residual_rms:.3g} mA rms{share}")
    for remark in result.remarks:
        print(remark)


def estimator_card(name: str) -> str:
    """Return an estimator's card; the cost of a step is measured here and now."""
    from estimators.registry import load_estimator
    from model.parameters import load_drive
    from sandbox.step_cost import cost

    e, motor = load_estimator(name), "ipm_exchanged"
    prices = [f"{belief} {cost(load_drive(motor), name, belief, 0)['step_ns']:.0f}" for belief in BELIEFS]
    rows = [
        ("injection", e.injection), ("delay", e.delay), ("speeds", e.speeds),
        ("cost", f"{', '.join(prices)} ns a step, measured now on {motor}" + ("" if e.compiled else " (in Python)")),
        ("source", e.source),
    ]  # fmt: skip
    return "\n".join([f"{e.name}: {e.summary}", "", *(f"{head:<11}{text}" for head, text in rows)])
