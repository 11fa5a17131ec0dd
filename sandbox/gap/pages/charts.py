"""Charts on the page of where the gap lies: each subsystem's part by direction, region and
order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sandbox.gap.location.curves import CurveFound
from sandbox.gap.location.decompose import Decomposition
from sandbox.gap.location.where import WHOSE, SubsystemPart
from sandbox.output.document import figure, fold, pairs, prose
from sandbox.output.sentences import capital
from sandbox.output.vector import bars_svg, lines_svg

PARTS = (
    "A subsystem's part is what is left where its effects alone are taken out again and all else "
    "is fitted. The sentences above and the charts below are of these parts."
)
SQUARES = (
    "Bars of speed and current are shares of squared residuals, so regions with more samples or "
    "less impedance weigh more: they may rise where the rms falls."
)


def of_parts(
    parts: Sequence[SubsystemPart], before: Decomposition, rest: Decomposition
) -> Iterator[str]:
    """Yield charts of the parts that sentences speak of, the largest open; of the whole where none
    is spoken of."""
    if len(parts) < 2:
        yield from pairs(
            shares(parts[0].left, rest, parts[0].of_readings) if parts else shares(before, rest)
        )
        return
    yield f'<p class="soft">{prose(PARTS)}</p>'
    for k, p in enumerate(parts):
        head = f"The {WHOSE[p.subsystem]} part, {100.0 * p.share:.0f} % of the gap"
        charts = "".join(pairs(shares(p.left, rest, p.of_readings)))
        yield fold(head, charts) if k else f"<h3>{prose(head)}</h3>{charts}"


def of_curves(curves: Sequence[CurveFound]) -> Iterator[str]:
    """Yield each curve with its band."""
    for c in curves:
        lines = {"found": (c.at, c.value), "2.5 %": (c.at, c.low), "97.5 %": (c.at, c.high)}
        yield figure(
            lines_svg([(f"{c.of} ({c.unit})", lines)], f"{c.across} ({c.unit_across})"),
            f"{capital(c.of)} against its {c.across}, odd, with its 95 % band. {c.text}",
        )


def shares(part: Decomposition, rest: Decomposition, of_readings: bool = False) -> Iterator[str]:
    """Yield the shares by direction, region and order that stand out, before and after; of current
    readings by what is constant in each phase instead of by a voltage's direction."""
    scale = rest.excess / part.excess
    labels: list[str] = []
    both: list[list[float]] = []
    for of in (part, rest):
        first = of.directions
        if of_readings:
            first = {f"constant in phase {p}": share for p, share in of.readings.constant.items()}
        groups = {**first, **of.speeds, **of.currents}
        labels = list(groups)
        both.append([100.0 * (scale if of is rest else 1.0) * x for x in groups.values()])
    what = "Constant errors of the readings" if of_readings else "Direction of the missing voltage"
    adds = "" if of_readings else " Directions of one frame add up to at most 100 %."
    yield figure(
        bars_svg(labels, {"before": both[0], "after": both[1]}, "share of the gap before (%)"),
        f"{what}, speed, current.{adds} {SQUARES}",
    )
    orders = sorted({abs(n) for n in part.electrical})
    by_order = [
        [100.0 * sum(x.electrical.get(s, 0.0) for s in {n, -n}) for n in orders]
        for x in (part, rest)
    ]
    if max(by_order[0]) > 1.0:
        yield figure(
            bars_svg(
                [str(n) for n in orders],
                {"before": by_order[0], "after": [scale * x for x in by_order[1]]},
                "share of the gap before (%)",
                ylabel="electrical order",
            ),
            "Electrical orders of the currents in the rotor's frame, turning recordings "
            "(0: turns with the rotor).",
        )
