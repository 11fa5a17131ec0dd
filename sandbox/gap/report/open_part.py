"""What nothing in the library explains: where it lies, and a free regression fitted beside the
effects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any

from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location.decompose import (
    CURRENT_NAMES,
    CURRENTS,
    SPEED_NAMES,
    SPEEDS,
    Decomposition,
    decompose,
    top_speed,
)
from sandbox.gap.location.where import DETAIL
from sandbox.gap.posterior.estimates import Estimate, estimates_with
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.gap.posterior.marginalized import MarginalizedRegression, marginalized
from sandbox.gap.report.inclusion import Inclusion, by_algebra
from sandbox.gap.shortened import shortened
from sandbox.gap.words import tenths

RPM = 60.0 / math.tau
MOSTLY = 0.5  # share of what remains from which on a region is said to hold most of it


@dataclass(frozen=True)
class Region:
    """An operating region: its name, where it begins and ends (None: nowhere) in a unit, and its
    share of what remains."""

    region: str
    low: float
    high: float | None
    unit: str
    share: float

    def as_json(self) -> dict[str, Any]:
        """Return the region as `diagnosis.json` has it."""
        return {
            "region": self.region,
            "from": self.low,
            "to": self.high,
            "unit": self.unit,
            "share": self.share,
        }


@dataclass(frozen=True)
class Order:
    """An order of the electrical (currents) or mechanical angle (motion) with its share of what
    remains."""

    order: int
    of: str
    share: float


@dataclass(frozen=True)
class Line:
    """A fixed frequency at locked rotor with its share of what remains."""

    hz: float
    share: float


@dataclass(frozen=True)
class Remaining:
    """Where the residual after the fit lies: by current and speed, orders of the angle, a line."""

    current: tuple[Region, ...]
    speed: tuple[Region, ...]
    angle: tuple[Order, ...]
    frequency: Line | None

    def as_json(self) -> dict[str, Any]:
        """Return `unknown.regions` of `diagnosis.json`."""
        return {
            "current": [r.as_json() for r in self.current],
            "speed": [r.as_json() for r in self.speed],
            "angle": [asdict(o) for o in self.angle],
            "frequency": None if self.frequency is None else asdict(self.frequency),
        }

    def text(self) -> str:
        """Return where it lies as a sentence, `unknown.where`; '' where no region holds most of
        it."""
        most = [max(regions, key=lambda x: x.share) for regions in (self.speed, self.current)]
        texts = [
            f"{tenths(x.share)} {x.region}{_range(x.low, x.high, x.unit)}"
            for x in most
            if x.share >= MOSTLY
        ]
        texts += [f"{tenths(o.share)} of {o.of} order {o.order}" for o in self.angle]
        if self.frequency is not None:
            texts.append(
                f"{tenths(self.frequency.share)} at a fixed {self.frequency.hz:.0f} Hz "
                "at locked rotor"
            )
        return f"Of what remains after the fit, {', '.join(texts)}." if texts else ""


def _range(low: float, high: float | None, unit: str) -> str:
    """Return the ends of a region in brackets."""
    if high is None:
        return f" (from {low:.3g} {unit} on)"
    return f" (up to {high:.3g} {unit})" if low == 0.0 else f" ({low:.3g} to {high:.3g} {unit})"


def remaining(point: ParameterPoint) -> Remaining:
    """Return where the residual at a point lies."""
    return regions(decompose(point, shown(point)), point)


def regions(part: Decomposition, point: ParameterPoint) -> Remaining:
    """Return where a residual that was taken apart lies; point: where the model stood that left it.

    Orders and lines below DETAIL of what remains are left out; both signs of an order count
    together, and what turns with the rotor (order 0) does not depend on its angle.
    """
    prepared = point.prepared
    rated = prepared.campaign.drive.motor.rated_current
    top = RPM * top_speed(point) / prepared.campaign.drive.motor.pole_pairs
    currents = _regions(part.currents, CURRENT_NAMES, [x * rated for x in CURRENTS], "A")
    speeds = _regions(part.speeds, SPEED_NAMES, [x * top for x in SPEEDS], "rpm")
    merged: dict[tuple[int, str], float] = {}
    for n, share in part.electrical.items():
        merged[abs(n), "electrical"] = merged.get((abs(n), "electrical"), 0.0) + share
    merged |= {(n, "mechanical"): share for n, share in part.mechanical.items()}
    orders = [Order(n, of, min(1.0, x)) for (n, of), x in merged.items() if n and x > DETAIL]
    line = (
        None
        if part.line is None or part.line[1] <= DETAIL
        else Line(part.line[0], min(1.0, part.line[1]))
    )
    return Remaining(currents, speeds, tuple(sorted(orders, key=lambda o: -o.share)), line)


def _regions(
    shares: Mapping[str, float], names: tuple[str, ...], bounds: list[float], unit: str
) -> tuple[Region, ...]:
    """Return regions in order; one's excess may outdo the whole where others fall below the
    noise: 1 at the most."""
    ends = pairwise([0.0, *bounds, None])
    return tuple(
        Region(name, low or 0.0, high, unit, min(1.0, shares[name]))
        for name, (low, high) in zip(names, ends, strict=True)
    )


@dataclass(frozen=True)
class OpenPart:
    """A free regression fitted beside the effects: what it closes and consists of, every effect's
    chance with it, and the parameters of effects, each in a set that holds it."""

    regression: MarginalizedRegression
    inclusion: Inclusion
    parameters: dict[str, dict[str, Estimate]]

    @property
    def chances(self) -> Mapping[str, float]:
        """Every effect's chance beside the regression."""
        return self.inclusion.chances

    def as_json(self) -> dict[str, Any]:
        """Return `unknown.beside` of `diagnosis.json`."""
        return {
            "worth": self.regression.worth,
            "consists_of": [asdict(x) for x in self.regression.described],
        }

    def unbent(self, j: EvaluatedModel) -> EvaluatedModel:
        """Return a set of effects with the equations beside the regression."""
        return replace(j, model=replace(j.model, equations=self.regression.equations))

    def sized(self, name: str, j: EvaluatedModel) -> OpenPart:
        """Return the same with the parameters of one more effect, in a set that holds it."""
        sizes = estimates_with(j, self.regression.equations)
        return replace(self, parameters={**self.parameters, name: own_of(name, sizes)})


def own_of(effect: str, parameters: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Return those parameters of a set that are an effect's."""
    return {k: e for k, e in parameters.items() if k.startswith(f"{effect}.")}


def open_part(d: Diagnosis, workers: int) -> OpenPart | None:
    """Return a free regression beside the best hypothesis' effects; None where it predicts
    nothing."""
    j = d.best.evaluated
    found = marginalized(replace(j.model, point=shortened(j.model.point)), j.prior, workers=workers)
    if found is None:
        return None
    freed = replace(j.model, equations=found.equations.scaled(d.variance))
    sizes = estimates_with(j, found.equations)
    return OpenPart(found, by_algebra(freed, j.effects), {e: own_of(e, sizes) for e in j.effects})
