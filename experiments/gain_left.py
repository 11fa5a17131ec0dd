"""What is left of the saturated belief's gain with a model known to 10 %, and with 2 us of dead
time?

The front page's "saturated belief" has the plant's own parameters. Here magnet flux, L_d, L_q and
the five alphas of the belief are drawn within ±10 % (64 draws), the inverter has 2 us of dead time
that nobody compensates, or both.

Run: python -m experiments.gain_left
    (2 min of processor time; writes results/gain_left.{json,md,svg}; --page: nothing
     is run, page and figure from the kept numbers)
"""

from __future__ import annotations

import argparse
import json
from typing import Any, NamedTuple

from experiments import screens
from experiments.drawing import RESULTS, new_figure, save
from sandbox import tolerances
from sandbox.output.files import version

NAME = "gain_left"
MOTORS = ("ipm_exchanged", "spm_exchanged")
DEAD_TIME, PERCENT, DRAWS = 2e-6, 10.0, 64
TIME = f"{1e6 * DEAD_TIME:g} µs"
LINEAR, SATURATED = "#de6210", "#2e86de"


class Case(NamedTuple):
    """One estimator on one drive: rms over the staircase's loads of the mean error (electrical
    degrees)."""

    motor: str
    estimator: str
    known: str  # "own" (the plant's parameters) or "10 %"
    dead_time: float  # s
    linear: float | None  # of which half of the draws stay below
    saturated: float | None
    saturated_p95: float | None
    lost: int  # of the saturated belief's draws

    @property
    def said(self) -> str:
        """What the case is, in words."""
        return f"{'own parameters' if self.known == 'own' else '±10 %'}{', dead time' if self.dead_time else ''}"  # noqa: E501


def cases(motor: str) -> list[Case]:
    """Return every estimator's four cases on a motor."""
    found = []
    for dead_time in (0.0, DEAD_TIME):
        effects = {"dead_time.time": dead_time} if dead_time else None
        rows = tolerances(
            motor, "staircase", percent=[PERCENT], draws=DRAWS, effects=effects, jobs=1
        ).rows
        by = {(r.estimator, r.tolerance, r.belief): r for r in rows}
        for estimator, level in dict.fromkeys((r.estimator, r.tolerance) for r in rows):
            own, other = by[estimator, level, "saturated"], by[estimator, level, "linear"]
            known = "10 %" if level else "own"
            errors = other.median_deg, own.median_deg, own.p95_deg
            found.append(Case(motor, estimator, known, dead_time, *errors, own.lost))
    return found


def gain(case: Case, best: Case, error: float | None) -> float | None:
    """Return how much of the way from linear to saturated of the best case (own parameters, no dead
    time) is left."""
    if error is None or best.linear is None or best.saturated is None:
        return None
    return (best.linear - error) / (best.linear - best.saturated)


def ordered(found: list[Case]) -> list[tuple[Case, Case]]:
    """Return each case beside the best of its motor and estimator, estimator by estimator."""
    best = {(c.motor, c.estimator): c for c in found if c.known == "own" and not c.dead_time}
    keys = list(best)
    pairs = [(c, best[c.motor, c.estimator]) for c in found]
    return sorted(
        pairs,
        key=lambda p: (
            keys.index((p[0].motor, p[0].estimator)),
            p[0].dead_time,
            p[0].known != "own",
        ),
    )


def page(found: list[Case], date: str, made: str) -> str:
    """Return the result page."""
    lines = [
        "# What is left of the gain?",
        "",
        "The saturated belief of the front page has the plant's own parameters, and the plant has "
        "no dead time. This page takes that away: magnet flux, L_d, L_q and the five alphas of "
        f"the belief are drawn, each evenly and on its own, within ±{PERCENT:g} % ({DRAWS} draws), "
        f"and the inverter has {1e6 * DEAD_TIME:g} µs of dead time that neither control nor "
        "estimator knows. The scenario is the staircase at standstill up to ±180 % load; the "
        "estimate controls the drive.",
        "",
        "- **linear, saturated**: rms over all loads of the mean position error (electrical "
        "degrees), of which half of the draws stay below; *95 %* is for the saturated belief.",
        "- **gain left**: how much of the way from the linear to the saturated belief is left, "
        "where both have the plant's own parameters and there is no dead time: 100 % where "
        "nothing is lost, 0 % where the error is that of a linear belief. *95 % of draws* have at "
        "least so much left.",
        "",
        f"Made by `python -m experiments.{NAME}`, {date}, {made}.",
        "",
        (
            "| motor | estimator | belief known to, inverter | linear | saturated | 95 % | "
            "gain left | 95 % of draws |"
        ),
        "|---|---|---|--:|--:|--:|--:|--:|",
    ]
    for c, best in ordered(found):
        errors = " | ".join(
            "–" if x is None else f"{x:.2f}°" for x in (c.linear, c.saturated, c.saturated_p95)
        )
        left = (gain(c, best, c.saturated), gain(c, best, c.saturated_p95))
        shares = " | ".join("–" if x is None else f"{100 * x:.0f} %" for x in left)
        lines.append(f"| `{c.motor}` | `{c.estimator}` | {c.said} | {errors} | {shares} |")
    lines += ["", f"![Position error of both beliefs, estimator by estimator]({NAME}.svg)"]
    return "\n".join(lines) + "\n"


def draw(found: list[Case]) -> Any:
    """Return the figure: a panel for each motor and estimator, a line for each case."""
    estimators = list(dict.fromkeys(c.estimator for c in found))
    figure, axes = new_figure(len(MOTORS), len(estimators), 3.4, 2.3)
    for panel, (motor, estimator) in zip(
        axes.flat, ((m, e) for m in MOTORS for e in estimators), strict=True
    ):
        own = [c for c, _ in ordered(found) if (c.motor, c.estimator) == (motor, estimator)]
        for y, c in enumerate(own):
            if c.linear is not None:
                panel.plot(c.linear, y, "s", color=LINEAR, markersize=6)
            if c.saturated is not None and c.saturated_p95 is not None:
                bar = [[0.0], [max(0.0, c.saturated_p95 - c.saturated)]]
                panel.errorbar(c.saturated, y, xerr=bar, fmt="o", color=SATURATED, capsize=4)
        short = [c.said.replace("own parameters", "own").replace("dead time", TIME) for c in own]
        panel.set_yticks(range(len(own)), short)
        panel.set_ylim(len(own) - 0.5, -0.5)
        panel.set_xlim(left=-0.04 * panel.get_xlim()[1])
        panel.locator_params(axis="x", nbins=5)
        panel.set_title(f"{motor}, {estimator}", fontsize=10)
        panel.set_xlabel("rms position error (°)")
    figure.supxlabel(
        "orange: linear belief; blue: saturated belief, its bar to 95 % of draws; own, "
        f"±{PERCENT:g} %: how its parameters are known; {TIME}: of dead time"
    )
    return figure


def write(found: list[Case], date: str, made: str) -> None:
    """Write page and figure; made: by which version."""
    (RESULTS / f"{NAME}.md").write_text(page(found, date, made), encoding="utf-8")
    screens.write(draw(found), RESULTS / NAME)


def main() -> None:
    """Run every case and keep the numbers; write page and figure from them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--page", action="store_true", help="run nothing: page and figure from the numbers kept"
    )
    if not parser.parse_args().page:
        found = [c for motor in MOTORS for c in cases(motor)]
        save(
            NAME,
            {
                "version": version(),
                "percent": PERCENT,
                "draws": DRAWS,
                "cases": [c._asdict() for c in found],
            },
        )
    kept = json.loads((RESULTS / f"{NAME}.json").read_text(encoding="utf-8"))
    write([Case(**c) for c in kept["cases"]], kept["date"], kept["version"])


if __name__ == "__main__":
    main()
