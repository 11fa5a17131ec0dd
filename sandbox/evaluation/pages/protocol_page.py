"""The page of a protocol: which estimator for each motor, what the saturated belief brings, what
breaks them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sandbox.evaluation.choice import ANY, MANY, Limits, either, few
from sandbox.evaluation.pages.protocol_cells import (
    BAD,
    CHECKS,
    GOOD,
    HOLDS,
    reading,
    table,
    tables,
    why_lost,
)
from sandbox.evaluation.protocol import PEER, SHARED, TESTS, Protocol, Row
from sandbox.evaluation.protocol_tests import MEAN_GOAL
from sandbox.output.document import (
    answer,
    bullets,
    figure,
    fold,
    pairs,
    prose,
    verdicts,
    write_page,
)
from sandbox.output.vector import SERIES, bars_svg, dots_svg

DEAREST = 1.25  # times the cheapest's step: dearer is named after it
# tests whose worst mean error is drawn for both beliefs
GAINED = ("static_map", "load_step", "creep")
NOT_IN_IT = (
    "These are simulations in which the saturated belief is the plant's own model; only "
    "`robustness` changes the plant. Goals are the project's (see the table), not your drive's."
)


@dataclass(frozen=True)
class Merit:
    """How an estimator with the saturated belief did on one motor.

    worst_p95: degrees, over the tests of GAINED; step_ns: CPU of a step; loss_w, sound_db: added by
    its injection at rated load, the larger of standstill and speed; None where not measured.
    """

    estimator: str
    judged: int
    missed: tuple[Row, ...]
    slow: tuple[str, ...]  # tests in which a speed was reached too late
    worst_p95: float | None
    step_ns: float | None
    loss_w: float | None = None
    sound_db: float | None = None

    @property
    def rank(self) -> tuple[int, int, int]:
        """What the best is smallest in: missed goals, those not judged, tests with a speed not
        reached in time."""
        return len(self.missed), -self.judged, len(self.slow)

    def order(self) -> tuple[tuple[int, int, int], float]:
        """Return rank; then cost or, where any goal is missed, the error."""
        then = self.worst_p95 if self.missed else self.step_ns
        return self.rank, math.inf if then is None else then


def merits(rows: Sequence[Row], motor: str) -> tuple[Merit, ...]:
    """Return every estimator's merit on a motor, the best first."""
    own = [
        r
        for r in rows
        if r.unit.motor == motor and r.unit.belief == "saturated" and r.unit.test not in SHARED
    ]
    out = []
    for name in dict.fromkeys(r.unit.estimator for r in own):
        mine = [r for r in own if r.unit.estimator == name]
        judged = [r for r in mine if r.outcome.passed is not None]
        costs = next((r.outcome.metrics for r in mine if r.unit.test == "cost"), {})
        errors = [r.outcome.metrics.get("p95_deg") for r in mine if r.unit.test in GAINED]
        worst = max((e for e in errors if e is not None), default=None)
        slow = tuple(r.unit.test for r in mine if r.outcome.metrics.get("speed_missed"))
        missed = tuple(r for r in judged if not r.outcome.passed)
        added = (_larger(costs, "copper_w"), _larger(costs, "sound_db"))
        out.append(Merit(name, len(judged), missed, slow, worst, costs.get("step_ns"), *added))
    return tuple(sorted(out, key=Merit.order))


def _larger(metrics: Mapping[str, float | None], name: str) -> float | None:
    """Return the larger of a cost's two values, at standstill and at speed."""
    return max(
        (v for v in (metrics.get(name), metrics.get(f"{name}_at_speed")) if v is not None),
        default=None,
    )


def which(rows: Sequence[Row], motor: str, limits: Limits = ANY) -> str:
    """Return which estimator to take on a motor within limits, in one to three sentences."""
    every = [m for m in merits(rows, motor) if m.judged]
    found = [m for m in every if not limits.broken_by(m)]
    dear = "; ".join(f"{m.estimator} {limits.broken_by(m)}" for m in every if limits.broken_by(m))
    if every and not found:
        return f"None within the limits: {dear}."
    return _which(found, rows, motor) + (f" Beyond the limits: {dear}." if dear else "")


def _which(found: Sequence[Merit], rows: Sequence[Row], motor: str) -> str:
    """Return the same of estimators within the limits."""
    if not found:
        return "None of these tests has a goal; run `static_map`, `load_step` or `robustness`."
    first = [m for m in found if m.rank == found[0].rank]
    names, some = either(few([m.estimator for m in first])), _some(rows)
    if not first[0].missed:
        verb = "meets" if len(first) == 1 else "each meets"
        text = (
            f"{names} with the saturated belief: {verb} "
            f"{_all(first[0].judged)}.{some}{_cheapest(first)}"
        )
        own = [r for r in rows if r.unit.motor == motor]
        return text + speed_missed(first) + held(own, [m.estimator for m in first])
    text = f"None meets every goal. Nearest: {names} with the saturated belief"
    text += f", {first[0].judged - len(first[0].missed)} of {first[0].judged}.{some}"
    missed = (f" {m.estimator} misses {'; '.join(map(why, m.missed))}." for m in first[:3])
    return f"{text}{''.join(missed)}{speed_missed(first)}"


def speed_missed(first: Sequence[Merit]) -> str:
    """Return in which tests these estimators did not let the drive reach its speed in time, nothing
    where in none."""
    tests: dict[tuple[str, ...], list[str]] = {}
    for m in first:
        if m.slow:
            tests.setdefault(m.slow, []).append(m.estimator)
    return "".join(
        f" But with {', '.join(few(names))} the speed asked for was not reached in time "
        f"in {', '.join(slow)} ({HOLDS})."
        for slow, names in tests.items()
    )


def held(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Return how large the errors were where lock alone is asked for, saturated belief of these
    estimators."""
    text, own = (
        "",
        [
            r
            for r in rows
            if r.unit.estimator in names and r.unit.belief == "saturated" and not r.failure
        ],
    )
    for test, key, unit, what in (
        ("robustness", "mean_deg", "°", "the worst mean error there is"),
        ("attraction", "reversed", " %", "the share that ends at the wrong pole is"),
    ):
        found = [r.outcome.metrics.get(key) for r in own if r.unit.test == test]
        sizes = [(100.0 if unit == " %" else 1.0) * abs(v) for v in found if v is not None]
        if sizes and max(sizes) > 0.0:
            ends = list(dict.fromkeys(f"{v:.3g}" for v in (min(sizes), max(sizes))))
            text += (
                f" `{test}` asks for no more than '{CHECKS[test]}'; {what} "
                f"{' to '.join(ends)}{unit}."
            )
    return text


def left_out(rows: Sequence[Row]) -> list[str]:
    """Return the protocol's tests that were run on no motor."""
    return [test for test in TESTS if test not in {r.unit.test for r in rows}]


def _some(rows: Sequence[Row]) -> str:
    """Return how many of the protocol's tests were run, nothing where all were."""
    ran, every = len(TESTS) - len(left_out(rows)), len(TESTS)
    return (
        f" Only {ran} of the protocol's {every} tests {'was' if ran == 1 else 'were'} run."
        if ran < every
        else ""
    )


def _all(judged: int) -> str:
    return "the one goal there is" if judged == 1 else f"all {judged} goals"


def _cheapest(first: Sequence[Merit]) -> str:
    """Return which of estimators alike in merit costs least, nothing where that is unknown or one
    is left."""
    costs = sorted((m.step_ns, m.estimator) for m in first if m.step_ns is not None)
    if len(costs) < 2:
        return ""
    like = [name for ns, name in costs if ns <= DEAREST * costs[0][0]]
    return f" {either(like)} costs least, {costs[0][0]:.0f} ns a step on this machine."


def why(row: Row) -> str:
    """Return which goal a row missed, and how, in a few words."""
    m = row.outcome.metrics
    if row.failure:
        return f"{row.unit.test} ({row.failure[:120]})"
    lost = [
        name.partition(":")[0]
        for name, value in m.items()
        if name.endswith(": mean_deg") and value is None
    ]
    if lost:
        return f"{row.unit.test} (lock lost with {', '.join(lost)})"
    if m.get("lost"):
        return f"{row.unit.test} (lock lost in {m['lost']:.0f} of {m['judged']:.0f} segments)"
    if m.get("mean_deg") is not None and m.get("p95_deg") is not None:
        return f"{row.unit.test} (mean {m['mean_deg']:.2g}°, 95 % within {m['p95_deg']:.2g}°)"
    if m.get("elsewhere") is not None:
        return (
            f"{row.unit.test} ({100.0 * (m['elsewhere'] or 0.0):.0f} % of wrong starts end "
            "at a third place)"
        )
    return row.unit.test


def gained(rows: Sequence[Row], motor: str) -> str:
    """Return what the saturated belief brings on a motor: worst mean errors of the tests in
    GAINED."""
    pairs_ = _both(rows, motor)
    if not pairs_:
        return "No test was run with both beliefs."
    said = "; ".join(f"{name} {a:.2g}° → {b:.2g}°" for name, (a, b) in pairs_.items())
    if len(pairs_) > MANY:
        ends = [sorted((pair[k], name) for name, pair in pairs_.items()) for k in (0, 1)]
        said = " → ".join(
            f"{e[0][0]:.2g}° ({e[0][1]}) to {e[-1][0]:.2g}° ({e[-1][1]})" for e in ends
        )
    return f"Worst mean error, linear → saturated belief: {said}."


def _both(rows: Sequence[Row], motor: str) -> dict[str, tuple[float, float]]:
    """Return worst mean errors (degrees) by estimator: linear, saturated, over the tests both were
    in lock in."""
    return {
        name: (max(a for a, _ in means.values()), max(b for _, b in means.values()))
        for name, means in _means(rows, motor).items()
    }


def _seen(rows: Sequence[Row], motor: str) -> list[str]:
    """Return the tests of GAINED that some estimator was in lock in with both beliefs."""
    return [test for test in GAINED if any(test in means for means in _means(rows, motor).values())]


def _means(rows: Sequence[Row], motor: str) -> dict[str, dict[str, tuple[float, float]]]:
    """Return mean errors (degrees), linear and saturated, by estimator and test of GAINED, where
    both are known."""
    own = {
        (r.unit.estimator, r.unit.belief, r.unit.test): r.outcome.metrics
        for r in rows
        if r.unit.motor == motor
    }
    out: dict[str, dict[str, tuple[float, float]]] = {}
    for name in dict.fromkeys(e for e, _, _ in own):
        for test in GAINED:
            linear, saturated = (
                own.get((name, b, test), {}).get("mean_deg") for b in ("linear", "saturated")
            )
            if linear is not None and saturated is not None:
                out.setdefault(name, {})[test] = linear, saturated
    return out


def broken(rows: Sequence[Row], motor: str) -> list[str]:
    """Return one sentence for each change of the plant that costs an estimator its lock, saturated
    belief."""
    lost: dict[str, list[str]] = {}
    for r in rows:
        if r.unit.motor == motor and r.unit.test == "robustness" and r.unit.belief == "saturated":
            for name, value in r.outcome.metrics.items():
                if name.endswith(": mean_deg") and value is None:
                    lost.setdefault(name.partition(":")[0], []).append(r.unit.estimator)
    return [f"{case}: {', '.join(names)} lost lock." for case, names in lost.items()]


def write_protocol(path: Path, result: Protocol) -> None:
    """Write the page of a protocol."""
    title = "Protocol: which estimator for which motor"
    write_page(path, title, parts(result, title))


def parts(result: Protocol, title: str) -> Iterator[str]:
    """Yield the page's parts, the answers first."""
    every = tables(result)
    motors = [motor for motor in every if motor != PEER]
    yield f"<h1>{prose(title)}</h1>"
    for motor in motors:
        yield answer(f"Which estimator for {motor}?", which(result.rows, motor, result.limits))
    for motor in motors:
        yield answer(
            f"What does believing the saturated model bring on {motor}?", gained(result.rows, motor)
        )
    missing = left_out(result.rows)
    tests = f" Tests that were not run: {', '.join(missing)}." if missing else ""
    yield answer("What is not in it?", NOT_IN_IT + tests)
    for motor in every:
        yield f"<h2>{prose(motor)}</h2>" + verdicts(*table(result, motor))
        yield from pairs(_figures(result.rows, motor))
        listed = broken(result.rows, motor)
        if listed:
            yield "<h3>What breaks them</h3>" + bullets(listed)
        if lost := why_lost(result, motor):
            yield "<h3>Why lock was lost</h3>" + bullets(lost)
        cases = _cases(result.rows, motor)
        if cases:
            yield fold(f"{motor}: one thing at a time other than believed", cases)
    yield f"<p class='soft'>{prose(reading(result))}</p>"
    failed = [
        f"{r.unit.motor}, {r.unit.test}, {r.unit.estimator} {r.unit.belief}: {r.failure}"
        for r in result.rows
        if r.failure
    ]
    if failed:
        yield fold("Runs that ended early, and why", bullets(failed))
    yield (
        f"<p class='soft'>Seed {result.seed}; {sum(r.cpu_seconds for r in result.rows):.0f} "
        "s of CPU.</p>"
    )


def _figures(rows: Sequence[Row], motor: str) -> Iterator[str]:
    """Yield the worst mean error with both beliefs, and the cost of a step."""
    both = _both(rows, motor)
    if both:
        series = {
            "linear": [max(a, 1e-3) for a, _ in both.values()],
            "saturated": [max(b, 1e-3) for _, b in both.values()],
        }
        over = ", ".join(_seen(rows, motor))
        yield figure(
            dots_svg(list(both), series, "worst mean error (°)", mark=MEAN_GOAL),
            f"Worst mean position error over {over}; dashed: the goal of the saturated "
            f"belief, {MEAN_GOAL:g}°.",
        )
    costs = {m.estimator: m.step_ns for m in merits(rows, motor) if m.step_ns is not None}
    if costs:
        names = [name for name in both if name in costs] or list(costs)
        blue = [SERIES[1]]
        yield figure(
            bars_svg(
                names,
                {"saturated": [costs[name] or 0.0 for name in names]},
                "CPU of a step (ns)",
                colours=blue,
            ),
            "What a step of the estimator costs on this machine.",
        )


def _cases(rows: Sequence[Row], motor: str) -> str:
    """Return the table of worst mean errors (degrees) by change of the plant, saturated belief;
    lost lock is marked."""
    own: dict[str, Mapping[str, float | None]] = {
        r.unit.estimator: r.outcome.metrics
        for r in rows
        if (r.unit.motor, r.unit.test, r.unit.belief) == (motor, "robustness", "saturated")
    }
    cases = list(
        dict.fromkeys(k for metrics in own.values() for k in metrics if k.endswith(": mean_deg"))
    )
    if not cases:
        return ""
    lines = [
        [case.partition(":")[0], *("" if case not in m else _mean(m[case]) for m in own.values())]
        for case in cases
    ]
    return verdicts(["worst mean (°)", *own], lines)


def _mean(value: float | None) -> str:
    if value is None:
        return f"lost {BAD} {CHECKS['robustness']}"
    return f"{value:.2f}" + (f" {GOOD} ≤ {MEAN_GOAL:g}°" if value <= MEAN_GOAL else "")
