"""Which other convention of currents, voltages or stated values explains recordings that are in no
doubt by their size: rms for amplitude, line for phase, peak to peak.

Such a factor is no larger than what a hot winding, saturation or a cold magnet makes of one value;
but it takes several values at once, or one further than it ever is.  So each reading has the
motor's values that suit it best, and pays for how far they are from what is stated:

    cost = WEIGHT mean log(share) + sum (log(value / stated) / USUAL)^2 / 2 + log(FALLS) mistakes

Each leg may lose a voltage beside it.  A reading is told where it is LIKELIER than none and leaves
values that are usual.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from model.array_types import Array
from model.parameters import Drive, Motor
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import Balance, balance, percent, with_saturation
from sandbox.recordings.checks.changes import Change, changes, source_of
from sandbox.recordings.checks.legs import MOST_LOST
from sandbox.recordings.checks.readings import BETTER, FALLS, Products, Reading, terms_of
from sandbox.recordings.checks.search import ALIKE, bases, likeliest, readings_of, single, together
from sandbox.recordings.findings import Finding

UNIT = 10.0  # a factor that no gap is: of a unit, however near to it the best one is
# relative, that the balance is off by on any drive: it leaves its square of the voltage open
OFF = 0.03
WORTH_ASKING = 0.02  # of the voltage: less is not worth asking a saturated model for
# standard deviations of the logarithm where none is stated: 40 K of winding; saturation, an air
# gap; a warm magnet
OF_VALUES = {
    "resistance": 0.15,
    "inductance_d": 0.125,
    "inductance_q": 0.125,
    "magnet_flux": 0.075,
}
USUAL = tuple(OF_VALUES[n] for n in ("resistance", "inductance_d", "magnet_flux"))
WEIGHT = 4.0  # independent pieces of evidence that recordings count as, however many (chosen)
LIKELIER = 1.25  # odds at which a caution is worth its line, mistakes being rare already (FALLS)
ODD = 2.0  # of the cost: values two standard deviations off, which no single mistake leaves
TURNS = 8  # of the iteration towards the best values
CLOSE = 1e-4  # of the values' logarithms, at which it ends


@dataclass(frozen=True)
class Fitted:
    """What some changes cost once the motor's values suit them best, how much of that is how far
    those are off, and the share that they leave with the values as they are."""

    reading: Reading
    cost: float
    off: float
    after: float


def deviations(uncertainty: Mapping[str, float]) -> dict[str, float]:
    """Return by name how far values of [motor] are from what is stated, as stated or usual."""
    return {n: uncertainty.get(n, usual) for n, usual in OF_VALUES.items()}


def conventions_off(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Return a finding where another convention of currents, voltages or stated values, another
    unit, order or zero of the angle explains recordings far better."""
    read = [(r, balance(r.columns, drive)) for r in recordings]
    parts = [
        Products(r, drive, _left_by(r, b, drive), b.noise)
        for r, b in read
        if math.isfinite(b.noise)
    ]
    if not parts or float(np.mean([p.before for p in parts])) < (BETTER - 1.0) * OFF**2:
        return []
    table = changes(drive, source_of(parts[0].recording))
    possible = list(_readings(parts, drive, table))
    if len(possible) < 2 or possible[0].changes:  # commands that no link gives are told elsewhere
        return []
    own, *tried = [_fitted(parts, x) for x in possible]
    tried.sort(key=lambda x: x.cost)
    if not _differs(own, tried[0]) or _vanishes(parts, tried[0]):
        return []
    best = tried[0].reading
    alike = likeliest(
        [
            x.reading
            for x in tried
            if x.reading.count == best.count and x.cost <= tried[0].cost + ALIKE
        ]
    )
    r = parts[0].recording
    said = [x.words(source_of(r)) for x in alike]
    text = (
        f"{r.file}: {percent(own.after)} of the commanded voltage is unexplained, "
        f"{percent(tried[0].after)} if {', or '.join(guess for guess, _ in said)}; then "
        f"{said[0][1]}"
    )
    left, rereads = tried[0].after, alike[0].rereads
    return [Finding(r.file, alike[0].column, None, text, rereads=rereads, left=left)]


def _differs(own: Fitted, other: Fitted) -> bool:
    """Tell whether another reading is worth a caution: it leaves less with the motor's values as
    stated; one of an angle, an order or a base, which no value of the motor could stand for, far
    less."""
    x = other.reading
    more = BETTER * FALLS ** (x.count - 1) * (other.after + OFF**2)
    convention = not x.zero and all(c.convention for c in x.changes)
    far = more <= own.after + OFF**2 or (convention and other.after < own.after)
    return far and other.cost + math.log(LIKELIER) <= own.cost and other.off <= ODD


def _readings(
    parts: Sequence[Products], drive: Drive, table: Sequence[Change]
) -> Iterator[Reading]:
    """Yield the log as it reads, then all readings of one mistake, and of two conventions."""
    yield from readings_of(parts, [()])
    yield from single(parts, table)
    yield from readings_of(parts, ((c,) for c in bases(parts, drive)))
    pairs = itertools.combinations((c for c in table if c.convention), 2)
    yield from readings_of(parts, ((a, b) for a, b in pairs if together(a, b)))


def _fitted(parts: Sequence[Products], x: Reading) -> Fitted:
    """Return a reading with the motor's values that cost least."""
    forms = np.array([_form(p, x) for p in parts])
    noise = np.array([p.noise_of(x.changes) for p in parts])
    most = np.array([MOST_LOST * p.link for p in parts])
    usual = _usual(parts[0].drive.motor)
    values, best, far = np.zeros(4), math.inf, 0.0
    as_it_is = float(np.mean(_left(forms, values, most, noise)))
    for _ in range(TURNS):
        left, off = _left(forms, values, most, noise), 0.5 * float(np.sum((values / usual) ** 2))
        cost = WEIGHT * float(np.mean(np.log(left + OFF**2))) + off
        if cost > best - CLOSE:
            break
        best, far, values = cost, off, _nearer(forms, values, left, usual)
    return Fitted(x, best + math.log(FALLS) * x.count, far, as_it_is)


def _form(p: Products, x: Reading) -> Array:
    """Return the real form (6, 6) of which values of the motor, 1 as stated, and a voltage that
    legs lose make the unexplained share."""
    read = terms_of(x.changes, p.drive.motor)
    own = np.concatenate([p.factors(read, x.zero), [-1.0]])
    products = p.products(read)
    form = np.conj(own)[:, None] * products * own[None, :]
    return np.asarray(form.real / max(read.scale**2 * float(products[0, 0].real), 1e-300))


def _left(forms: Array, off: Array, most: Array, noise: Array) -> Array:
    """Return the unexplained shares beyond noise, with values so far off (logarithms)."""
    values = np.concatenate([[1.0], np.exp(off)])
    known = np.einsum("i,rij,j->r", values, forms[:, :5, :5], values)
    slope, bend = forms[:, 5, :5] @ values, np.maximum(forms[:, 5, 5], 1e-300)
    lost = np.clip(-slope / bend, 0.0, most)
    return np.maximum(known + 2.0 * lost * slope + lost**2 * bend - noise, 0.0)


def _nearer(forms: Array, off: Array, left: Array, usual: Array) -> Array:
    """Return logarithms of values nearer to the best: a step of Gauss and Newton, each recording
    counting by what it leaves."""
    slope, bend = forms[:, 5, :5], np.maximum(forms[:, 5, 5], 1e-300)
    known = forms[:, :5, :5] - slope[:, :, None] * slope[:, None, :] / bend[:, None, None]
    weight = WEIGHT / len(forms) / (left + OFF**2)
    total = np.einsum("r,rij->ij", weight, known)
    values = np.exp(off)
    matrix = total[1:, 1:] * np.outer(values, values)
    gradient = values * (total[1:, 0] + total[1:, 1:] @ values)
    step = np.linalg.solve(matrix + 0.5 * np.diag(usual**-2.0), -gradient - 0.5 * off / usual**2)
    return np.asarray(off + step)


def _usual(m: Motor) -> Array:
    """Return standard deviations of the logarithms of resistance, mean and half gap of the
    inductances, and flux."""
    r, inductance, flux = USUAL
    gap = abs(m.inductance_d - m.inductance_q) or 1e-9
    return np.array([r, inductance, inductance * (m.inductance_d + m.inductance_q) / gap, flux])


def _vanishes(parts: Sequence[Products], x: Fitted) -> bool:
    """Tell whether as little stays open without the terms that a reading makes some times smaller:
    then nothing tells their factor."""
    small = [c for c in x.reading.changes if min(map(abs, (c.scale, *c.values))) <= 1.0 / UNIT]
    if not small:
        return False
    own = tuple(_none(c) if c in small else c for c in x.reading.changes)
    without = [_fitted(parts, y) for y in readings_of(parts, [own], x.reading.zero)]
    return bool(without) and without[0].after + OFF**2 <= BETTER * (x.after + OFF**2)


def _none(c: Change) -> Change:
    """Return a change whose small factors are none at all."""
    scale, *values = (x if abs(x) > 1.0 / UNIT else 1e-9 for x in (c.scale, *c.values))
    return replace(c, scale=scale if c.part != "voltage" else c.scale, values=tuple(values))  # type: ignore[arg-type]


def _left_by(r: CampaignRecording, b: Balance, drive: Drive) -> float:
    """Return the share that the nominal model leaves beyond noise: the saturated one where the
    linear leaves more."""
    left = max(b.share - b.noise, 0.0)
    if left < WORTH_ASKING:
        return left
    balanced: Any = with_saturation(r, drive)
    return left if balanced is None else min(left, max(balanced.share - balanced.noise, 0.0))
