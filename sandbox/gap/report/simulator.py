"""A diagnosis as the simulator takes it: the refitted motor, and the effects with which it meets
the recordings.

All recordings count: values are those of the most probable hypothesis' fit to the whole campaign
(as in `hypotheses`), and the residual stated with them is the one that they leave.  `gap.after` is
of a fit without the recordings held out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from model.effects import library
from model.effects.library import true_motor
from model.mapped import MappedMotor
from model.parameters import Converter, Motor
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.algebra import prior_of
from sandbox.gap.evidence.fit import Fit
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location.map_found import with_map_found
from sandbox.gap.posterior.estimates import SPREAD, estimates, of_motor, spread
from sandbox.gap.posterior.evaluated import EvaluatedModel
from sandbox.gap.posterior.hypotheses import UNKNOWN
from sandbox.gap.report.bounds import at_bound
from sandbox.output.refitted import Refitted
from sandbox.plant.sets import BENCH, complete
from sandbox.replay.held import released

# of the standard deviation that a value had before: recordings that leave so much say nothing of it
UNTOLD = 0.9


def refitted(d: Diagnosis) -> Refitted:
    """Return the drive and the effects of a diagnosis' best hypothesis."""
    judged, own = d.best.evaluated, d.campaign.drive
    stated, flux_map = with_map_found(own.motor, d.best.evaluated.fit)
    values, turns = judged.fit.point.values, judged.fit.point.turns
    values = rescaled(values, own.motor, stated)
    motor = baked(stated, values)
    of_values = {k: e for k, e in of_motor(judged).items() if k not in d.campaign.stand_ins}
    found = {**of_values, **estimates(judged)}
    ci95 = {k: (e.low, e.high) for k, e in found.items()}
    effects = not_in_motor(motor, own.converter, values)
    shown = [e for e in d.best.effects if e != UNKNOWN]
    said = (
        f"Refitted to the recordings of '{d.campaign.name}' by sensorless diagnose: "
        f"{', '.join(shown) or 'no effect'}"
    )
    if UNKNOWN in d.best.effects:
        said += ", beside something outside the library (believe residuals, not names)"
    if flux_map is not None:
        most = max(float(np.max(np.hypot(*r.current))) for r in d.campaign.recordings)
        said += f"; its flux map is told up to {most:.3g} A, which is what these reach"
    origins = dict(own.provenance)
    untold = _untold(judged)
    for key in of_values:
        origins[key] = f"refitted to the recordings; nominal {getattr(own.motor, key):.6g}"
        if key in untold:
            origins[key] = "as stated: these recordings say nothing of it"
    drive = dataclasses.replace(own, motor=motor, provenance=origins)
    units = {name: p.unit for name, p in library.parameters().items()} | {
        name: p.unit for name, p in BENCH.items()
    }
    parts = (
        {}
        if d.campaign.excerpts is None
        else {e.file: e.of for e in d.campaign.excerpts.parts if e.file != e.of}
    )
    # a replay has no parts
    angles = {name: turn for name, turn in turns.items() if turn and name not in parts}
    bounds = at_bound(found, d.at_bound)
    return Refitted(
        drive,
        effects,
        angles,
        ci95,
        units,
        residual_of(judged.fit, parts),
        said,
        bounds,
        flux_map,
        {} if d.drifting is None else d.drifting.offsets,
    )


def _untold(judged: EvaluatedModel) -> set[str]:
    """Return the motor's values that are as uncertain as before."""
    s, before = spread(judged), prior_of(judged.fit.coordinates).deviation
    places = {
        key: s.place[name]
        for name, key in {**library.replaced(), **library.scaled()}.items()
        if name in s.place
    }
    return {key for key, k in places.items() if 0.0 < UNTOLD * before[k] <= s.sd[k] / SPREAD}


def rescaled(values: Mapping[str, float], before: Motor, after: Motor) -> dict[str, float]:
    """Return a set whose factors of inductances say of one motor what they said of another: 1/(s
    L) - 1/L stays."""
    out = dict(values)
    for name, field in library.scaled().items():
        ratio = getattr(after, field) / getattr(before, field) if getattr(before, field) else 1.0
        if ratio != 1.0 and values[name] == values[name]:
            out[name] = 1.0 / (1.0 + (1.0 / values[name] - 1.0) * ratio)
    return out


def baked(motor: Motor, values: Mapping[str, float]) -> Motor:
    """Return the motor with the values that a set replaces; a flux map stays, and so does its
    magnet flux."""
    true = true_motor(motor, values, keep_map=True)
    return (
        dataclasses.replace(true, magnet_flux=motor.magnet_flux)
        if isinstance(motor, MappedMotor)
        else true
    )


def not_in_motor(
    motor: Motor, converter: Converter, values: Mapping[str, float]
) -> dict[str, float]:
    """Return what of a completed set is not neutral beside a motor that already holds its
    values."""
    neutral = complete(motor, converter)
    done = () if isinstance(motor, MappedMotor) else library.scaled()
    moved = {k: v for k, v in values.items() if v == v and v != neutral[k] and k not in done}
    return {k: v for k, v in moved.items() if library.same_numbers().get(k) not in moved}


def residual_of(found: Fit, parts: Mapping[str, str]) -> dict[str, float]:
    """Return the rms of each recording's currents over the noise at a fit, as a replay has
    it: the flux at a first sample counts as known; parts: of which they are parts."""
    prepared = released(found.point.prepared)
    files = [parts.get(r.file, r.file) for r in prepared.recordings]
    at = dataclasses.replace(found.point, prepared=prepared)
    sums: dict[str, tuple[float, int]] = {}
    for file, left in zip(files, shown(at), strict=True):
        square, n = sums.get(file, (0.0, 0))
        sums[file] = square + float(np.sum(left.current**2)), n + left.current.size
    return {file: math.sqrt(square / n) for file, (square, n) in sums.items()}
