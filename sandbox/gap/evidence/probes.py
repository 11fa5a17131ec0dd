"""Probes: each effect, and the values its companions (time constants, frequencies, orders) may start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from model.effects import library
from model.effects.card import Parameter
from model.errors import BadInput
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.priors import Coordinate, of_effect
from sandbox.gap.evidence.spectrum import best_values, link_lines
from sandbox.plant.sets import complete
from sandbox.replay.sensitivity import mechanical_only


@dataclass(frozen=True)
class Probe:
    """An effect and the values its companions start from.

    sized: values of the effect away from neutral to start a fit from; gain: half of what the objective falls by there
    (`search.multistart`).
    """

    effect: str
    start: Mapping[str, float]
    sized: Mapping[str, float] | None = None
    gain: float = 0.0


def probes(point: Point, exclude: Sequence[str] = ()) -> tuple[list[Probe], float]:
    """Return all probes of the library at a point, scanned companions where the residual shows them; simulations."""
    drive = point.prepared.campaign.drive
    out: list[Probe] = []
    cost = 0.0
    for effect in library.effect_names():
        if effect in exclude:
            continue
        card = library.load_effect(effect)
        choices: list[list[tuple[str, float]]] = []
        for p in card.parameters:
            name = f"{effect}.{p.name}"
            if p.scan and card.polar:
                low, high, step = p.scan
                pair = (f"{effect}.{card.polar[0]}", f"{effect}.{card.polar[1]}")
                values = scanned(p, drive.motor.pole_pairs) if step else []
                found = best_values(point, pair, name, values) if step else link_lines(point, low, high)
                cost += 2 * len(values) * (free_share(point) if mechanical_only(name) else 1.0)
                choices.append([(name, x) for x in found])
            elif p.fit == "log":
                size = p.typical_for(drive.motor, drive.converter)
                choices.append([(name, s * size) for s in p.starts])
        out += [Probe(effect, dict(c)) for c in product(*choices) if possible(point, dict(c))]
    return out, cost


def scanned(p: Parameter, pole_pairs: int) -> list[float]:
    """Return the values of a parameter with a scan in steps that are tried; beyond the last, multiples of the number of
    poles where its card says so: the torque of slots has the least common multiple of slots and poles (Zhu, Howe)."""
    low, high, step = p.scan or (1.0, 0.0, 1.0)
    values = np.arange(low, high + 0.5 * step, step)
    poles = 2.0 * pole_pairs * np.arange(1.0, p.scan_poles + 1.0)
    return [*values.tolist(), *poles[poles > high].tolist()]


def possible(point: Point, start: Mapping[str, float]) -> bool:
    """Return whether a drive can have these values beside those of a point (masses, delays that bound each other)."""
    drive = point.prepared.campaign.drive
    try:
        complete(drive.motor, drive.converter, {**point.values, **start})
    except BadInput:
        return False
    return True


def free_share(point: Point) -> float:
    """Return the share of the samples in which the rotor is free."""
    own = point.prepared.recordings
    return sum(r.samples for r in own if r.rotor == "free") / point.prepared.samples


def probes_at_typical(point: Point, exclude: Sequence[str] = ()) -> list[Probe]:
    """Return one probe an effect, its companions at typical values: what can be known before looking at residuals."""
    drive = point.prepared.campaign.drive
    out = []
    for effect in library.effect_names():
        own = library.load_effect(effect).parameters
        start = {f"{effect}.{p.name}": p.typical_for(drive.motor, drive.converter) for p in own if p.fit == "log"}
        if effect not in exclude:
            out.append(Probe(effect, start))
    return out


def probe_coordinates(point: Point, probe: Probe, label: str) -> list[Coordinate]:
    """Return what a probe adds to a screening: coordinates that act at neutral, or one straight way to its start."""
    own = of_effect(probe.effect, point.prepared.campaign.drive, {**point.values, **probe.start})
    off = [c for c in own if c.form != "log" and c.names[0] not in probe.start]
    along = tuple(probe.start.items())
    if not off:
        return [Coordinate(f"{probe.effect}{label}", 0.0, 1.0, "share", (next(iter(probe.start)),), along)]
    return [replace(c, label=f"{c.label}{label}", along=along) if along else c for c in off]
