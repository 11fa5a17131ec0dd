"""Yield: how many drives of a production run err less than x degrees, with a linear and with a
saturated belief.

python -m experiments.yield_curve [--jobs N | --dask ADDRESS] [--points N] [--runs DIR]
python -m experiments.yield_curve --scaling
    measures 1 and 2 processes on a small piece, for the same page

100 000 runs (`yield_curve.toml`); an interrupted call goes on where it was.  Runs are kept in DIR
(150 bytes each), what the page shows in experiments/results/yield/.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import resource
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from experiments import screens
from experiments.drawing import new_figure
from experiments.on_cluster import on_dask
from sandbox import sweep
from sandbox.output.files import plain, version
from sandbox.output.provenance import digest_of

HERE = Path(__file__).parent
PLAN, RESULTS, RUNS = (
    HERE / "yield_curve.toml",
    HERE / "results" / "yield",
    Path("sensorless-out") / "yield_curve",
)
PIECE = 2000  # points of the scaling measurement: half a minute
PROGRESS_STEP = 5.0  # % of the runs between two lines of progress


def tables(points: int | None) -> dict[str, Any]:
    """Return the sweep's tables, with fewer points where asked for."""
    found = tomllib.loads(PLAN.read_text(encoding="utf-8"))
    if points is not None:
        found["random"]["points"] = points
    return found


def reporter() -> Any:
    """Return a function that prints a line of progress now and then: runs, rate, time left."""
    begun: list[tuple[float, int]] = []
    last = [-PROGRESS_STEP]

    def tell(done: int, total: int) -> None:
        """Print it."""
        if not begun:
            begun.append((time.monotonic(), done))
        share, (start, first) = 100.0 * done / total, begun[0]
        rate = (done - first) / max(time.monotonic() - start, 1e-9)
        if share - last[0] >= PROGRESS_STEP or done == total:
            last[0] = share
            left = f"{(total - done) / rate:.0f} s left" if rate > 0.0 else ""
            print(f"{done} of {total} runs, {rate:.0f}/s, {left}", flush=True)

    return tell


def causes(table: Any, draws: list[str], rows: np.ndarray) -> tuple[dict[str, float], float]:
    """Return each parameter's share of the error's variance in a linear regression, and the share
    of all together."""
    names = [name.removeprefix("true_factor.") for name in draws]
    x = np.array([table[name].to_numpy()[rows] for name in draws]).T
    y = table["mean_deg"].to_numpy(zero_copy_only=False)[rows]
    fine = np.isfinite(y)
    x, y = x[fine], y[fine]
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    slope = np.linalg.lstsq(x, y - y.mean(), rcond=None)[0]
    left = float(np.var(y - y.mean() - x @ slope) / np.var(y))
    return {name: float(s**2 / np.var(y)) for name, s in zip(names, slope, strict=True)}, 1.0 - left


def peak_rss() -> dict[str, float]:
    """Return the largest memory (MB) of this process and of the largest it started, so far."""
    unit = 1e6 if sys.platform == "darwin" else 1e3
    kinds = {"parent_MB": resource.RUSAGE_SELF, "worker_MB": resource.RUSAGE_CHILDREN}
    return {name: resource.getrusage(kind).ru_maxrss / unit for name, kind in kinds.items()}


def scaling() -> dict[str, Any]:
    """Return runs a second with 1 and 2 processes on a piece, wall and CPU; kernels are compiled
    before."""
    found: dict[str, Any] = {"points": PIECE, "cores": os.cpu_count(), "load": os.getloadavg()[0]}
    with tempfile.TemporaryDirectory() as place:
        sweep(tables(8), Path(place) / "warm", jobs=1)
        for jobs in (1, 2):
            begun = time.monotonic()
            done = sweep(tables(PIECE), Path(place) / f"{jobs}", jobs=jobs)
            wall = time.monotonic() - begun
            found[f"{jobs}"] = {
                "runs_a_wall_second": done.plan.runs / wall,
                "cpu_ms": 1e3 * done.cpu_seconds / done.plan.runs,
            }
        one, two = (
            [digest_of(p) for p in sorted((Path(place) / f"{jobs}" / "runs").glob("*.parquet"))]
            for jobs in (1, 2)
        )
        found["same_to_the_bit"] = one == two
    return found


def page(content: dict[str, Any]) -> str:
    """Return the result page as markdown."""
    lines = [
        f"# Yield: {content['points']} motors within their tolerances, {content['runs']} runs",
        "",
        "A factory builds many motors of one type, and no two of them are quite alike. One drive, "
        "designed for the nominal motor, has to serve them all. How many of these drives err by "
        "less than x degrees?",
        "",
        "![Share of drives that err less than x degrees](yield_curve.svg)",
        "",
        "Each motor runs four times: two estimators, each with a linear and with a saturated "
        "belief. The belief is that of the nominal motor. The error is the size of a run's mean "
        "position error, in electrical degrees. A drive that loses lock, or has no result, counts "
        "as worse than any error.",
        "",
        "| estimator, belief | half err less than | **95 % err less than** (95 % interval) | 99 % "
        "err less than | lost | no result |",
        "|---|--:|--:|--:|--:|--:|",
        *map(group_line, content["groups"]),
        "",
        "The motors: `ipm_exchanged` with R within ±10 %, magnet flux within ±5 %, L_d and L_q "
        "within ±10 %, the five alphas within ±20 % of the nominal values. All are drawn evenly "
        "and independently; these tolerances are an assumption "
        "([yield_curve.toml](../../yield_curve.toml)). A run lasts 0.5 s at standstill with 120 % "
        "load, and the estimate controls the drive.",
        "",
        "## Which parameter matters?",
        "",
        (
            "The share of the error's variance that each parameter explains in a linear "
            "regression, in percent:"
        ),
        "",
    ]
    heads = list(content["causes"][0]["shares"])
    lines += [
        f"| estimator, belief | {' | '.join(heads)} | all together |",
        "|---|" + "--:|" * (len(heads) + 1),
    ]
    for c in content["causes"]:
        cells = [f"{100 * v:.1f}" for v in c["shares"].values()]
        lines.append(f"| {c['name']} | {' | '.join(cells)} | {100 * c['explained']:.1f} |")
    lines += ["", "## What it costs", "", *costs(content), ""]
    lines.append(
        f"Made by `python -m experiments.yield_curve`, {content['date']}, {content['version']}."
    )
    return "\n".join(lines) + "\n"


def draw(content: dict[str, Any]) -> Any:
    """Return the figure: for each estimator and belief the errors that 50, 95 and 99 % of the
    motors stay below."""
    figure, ((axes,),) = new_figure(1, 1, 6.4, 2.6)
    groups = content["groups"]
    for y, g in enumerate(groups):
        colour = {"linear": "#de6210", "saturated": "#2e86de"}[g["values"]["belief"]]
        errors = [g[key] for key in ("median_deg", "p95_deg", "p99_deg")]
        axes.plot(errors, [y] * 3, "-", color=colour, linewidth=1.5)
        for error, marker, size in zip(errors, "osD", (7, 6, 5), strict=True):
            axes.plot(error, y, marker, color=colour, markersize=size)
    axes.set_yticks(range(len(groups)), [", ".join(g["values"].values()) for g in groups])
    axes.set_ylim(len(groups) - 0.5, -0.5)
    axes.set_xlim(left=0.0)
    axes.set_xlabel(
        "position error (°); circle: half of the motors err less, square: 95 %, diamond: 99 %"
    )
    return figure


def group_line(g: dict[str, Any]) -> str:
    """Return one estimator and belief as a line of the table."""
    wide = f"{_deg(g['p95_low_deg'])} – {_deg(g['p95_high_deg'])}"
    cells = [
        ", ".join(g["values"].values()),
        _deg(g["median_deg"]),
        f"**{_deg(g['p95_deg'])}** ({wide})",
    ]
    return (
        f"| {' | '.join([*cells, _deg(g['p99_deg']), str(g['lost']), str(g['runs'] - g['ok'])])} |"
    )


def costs(content: dict[str, Any]) -> list[str]:
    """Return what the runs cost, in sentences."""
    cost = content["cost"]
    lines = [
        f"A run costs {cost['cpu_ms']:.2f} ms of processor time, {cost['kernel_ms']:.2f} ms of it "
        f"in the compiled loop; the ratio is {cost['cpu_ms'] / cost['kernel_ms']:.2f}. The largest "
        f"memory of the process was {cost['rss']['parent_MB']:.0f} MB"
        + (
            f", of a worker {cost['rss']['worker_MB']:.0f} MB." if cost["rss"]["worker_MB"] else "."
        ),
    ]
    if "scaling" in content:
        s = content["scaling"]
        one, two = s["1"]["runs_a_wall_second"], s["2"]["runs_a_wall_second"]
        same = "the same to the bit" if s["same_to_the_bit"] else "NOT the same"
        lines += [
            "",
            (
                f"Two processes make {two:.0f} runs in a second, one process {one:.0f}: "
                f"{two / one:.2f} times as many, the start of the processes included. This was "
                f"measured on {4 * s['points']} of the runs, on {s['cores']} cores with a load "
                f"average of {s['load']:.1f}; a run cost {s['2']['cpu_ms']:.1f} and "
                f"{s['1']['cpu_ms']:.1f} ms of processor time. The results are {same}."
                + (
                    " Other programs used the cores at that time, so this says nothing of the "
                    "engine: measure it again on a quiet machine."
                    if s["load"] > s["cores"]
                    else ""
                )
            ),
        ]
    return lines


def _deg(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}°"


def write(done: Any) -> None:
    """Write page, figure and numbers, each whole or not at all."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    table, draws = done.to_table(), [n for n in done.plan.draws if n != "seed"]
    found = []
    for k, group in enumerate(done.groups):
        shares, explained = causes(
            table, draws, np.flatnonzero(table["run"].to_numpy() % done.plan.cells == k)
        )
        found.append({"name": group.name, "shares": shares, "explained": explained})
    runs = done.plan.runs
    cost = {
        "cpu_ms": 1e3 * done.cpu_seconds / runs,
        "kernel_ms": 1e3 * done.kernel_seconds / runs,
        "rss": peak_rss(),
    }
    content = done.as_json() | {
        "date": datetime.date.today().isoformat(),
        "version": version(),
        "causes": found,
        "cost": cost,
    }
    measured = RESULTS / "scaling.json"
    if measured.is_file():
        content["scaling"] = json.loads(measured.read_text(encoding="utf-8"))
    screens.write(draw(content), RESULTS / "yield_curve")
    keep(RESULTS / "yield_curve.json", json.dumps(plain(content), indent=1) + "\n")
    keep(RESULTS / "README.md", page(content))
    print(page(content))


def keep(path: Path, text: str) -> None:
    """Write a file aside, then rename it."""
    aside = path.with_name(f".{path.name}.part")
    aside.write_text(text, encoding="utf-8")
    aside.replace(path)


def main() -> None:
    """Run what is left, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    on_dask(parser)
    parser.add_argument("--points", type=int, help="motors (25000)")
    parser.add_argument("--runs", type=Path, default=RUNS, help=f"folder ({RUNS})")
    parser.add_argument("--scaling", action="store_true", help="measure 1 and 2 processes")
    options = parser.parse_args()
    if options.scaling:
        RESULTS.mkdir(parents=True, exist_ok=True)
        measured, kept = scaling(), RESULTS / "yield_curve.json"
        keep(RESULTS / "scaling.json", json.dumps(measured, indent=1) + "\n")
        if kept.is_file():
            content = json.loads(kept.read_text(encoding="utf-8")) | {"scaling": measured}
            keep(kept, json.dumps(plain(content), indent=1) + "\n")
            keep(RESULTS / "README.md", page(content))
        return
    write(
        sweep(
            tables(options.points),
            options.runs,
            jobs=options.jobs,
            cluster=options.dask,
            progress=reporter(),
        )
    )


if __name__ == "__main__":
    main()
