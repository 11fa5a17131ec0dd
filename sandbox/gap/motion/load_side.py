"""What a log's load says beside the air gap's torque: a wrong sign or unit of it, pole pairs
counted as poles.

    T = J theta'' + g load + frictions + offset,   g = 1 where all is read right

Where the load varies beside the rest, by as much as tells g surely, it is fitted.  Where it does
not, a friction could stand in for any part of it: then a mistake is believed only if its g leaves
little of the torque without any friction, and 1 leaves much more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from model.array_types import Array
from sandbox.gap.motion.shaft import USUAL_WIDTH, design_of
from sandbox.gap.motion.windows import averages
from sandbox.recordings.findings import Doubt, Finding
from sandbox.recordings.motion_log import MotionCampaign, MotionRecording

LEFT = 0.35  # of the torque: most that friction and the nominal model's errors leave
WORSE = 3.0  # times as much is left without the mistake ...
MUCH = 0.6  # ... and so much of the torque at least
NEAR = 0.15  # relative: between the fitted factor and a mistake's, and what it is known to
SURE = 0.975  # of the factor's t distribution, to either side
FITTED = 0.2  # of the torque: most that the fit may leave
ROWS = 64  # of a recording at least
TOGETHER, FEWEST = 32, 8  # windows that are averaged, and averages of a recording at least


@dataclass(frozen=True)
class Mistake:
    """By which factor the torque is read too large beside the load, its words and what to do.

    like_friction: a friction as large as the load does that, too.
    """

    factor: float
    guess: str
    remedy: str
    like_friction: bool = False


def load_contradicted(campaign: MotionCampaign) -> list[Finding]:
    """Return a finding where a load's sign or unit, or pole pairs, contradict the torque that the
    currents make."""
    held = [r for r in campaign.recordings if np.any(r.load) and not r.sixth and len(r.t) >= ROWS]
    if not held:
        return []
    with np.errstate(all="ignore"):
        torque, load, rest = _equations(held, campaign)
    if not (
        np.all(np.isfinite(torque)) and np.all(np.isfinite(load)) and np.all(np.isfinite(rest))
    ):
        return []
    mistakes = _mistakes(campaign, held[0])
    fitted = _fitted(torque, load, rest)
    if fitted is None:
        net = torque - (campaign.inertia or 0.0) * rest[:, 0]
        found = _by_size(net, load, [m for m in mistakes if not m.like_friction])
    else:
        found = next((m for m in mistakes if abs(fitted / m.factor - 1.0) < NEAR), None)
    if found is None:
        return []
    k = int(np.argmax(np.abs(held[0].load)))
    name = held[0].source.get("load_torque", "load_torque")
    text = (
        f"{held[0].file}: row {k} of column '{name}' is {held[0].load[k]:.4g} N m; currents, "
        f"acceleration and it agree if {found.guess} ({found.remedy})"
    )
    return [Doubt(held[0].file, "load_torque", k, text)]


def _equations(
    recordings: Sequence[MotionRecording], campaign: MotionCampaign
) -> tuple[Array, Array, Array]:
    """Return the air gap's torque and the load (N m), (n,), and acceleration, speed, sign of the
    speed and one (n, 4).

    Means over TOGETHER windows: from one to the next the encoder's counts take most of the
    acceleration.
    """
    parts = [averages(r, campaign) for r in recordings]
    width = USUAL_WIDTH * design_of(parts).fastest
    rows = []
    for a, r in zip(parts, recordings, strict=True):
        load, one = a.mean(r.load), np.ones(len(a.torque))
        own = np.stack(
            [
                a.torque + load,
                load,
                a.acceleration,
                a.speed,
                a.along(np.tanh(a.path_speed / width)),
                one,
            ]
        )
        size = max(min(TOGETHER, own.shape[1] // FEWEST), 1)
        whole = own.shape[1] // size * size
        rows.append(own[:, :whole].reshape(len(own), -1, size).mean(axis=2))
    torque, load, *rest = np.concatenate(rows, axis=1)
    return torque, load, np.stack(rest, axis=1)


def _fitted(torque: Array, load: Array, rest: Array) -> float | None:
    """Return g, None where the rest may stand in for the load, or the fit leaves much.

    The rest is told from the load by what it leaves of it: g is known to what the fit leaves, by
    Student's t of the means that are left beside its unknowns.
    """
    if len(torque) < FEWEST:
        return None
    rest = rest / np.maximum(np.linalg.norm(rest, axis=0), 1e-300)
    own = load - rest @ np.linalg.lstsq(rest, load, rcond=None)[0]
    size = float(np.linalg.norm(own))
    if not size > 1e-9 * np.linalg.norm(load):
        return None
    g = float(own @ torque) / size**2
    left = torque - g * load
    left = left - rest @ np.linalg.lstsq(rest, left, rcond=None)[0]
    free = len(torque) - np.linalg.matrix_rank(rest) - 1
    deviation = float(np.linalg.norm(left)) / math.sqrt(free) / size
    if not stdtrit(free, SURE) * deviation < NEAR * abs(g):
        return None
    return g if np.linalg.norm(left) < FITTED * np.linalg.norm(torque) else None


def _by_size(net: Array, load: Array, mistakes: Sequence[Mistake]) -> Mistake | None:
    """Return the mistake without which much of the torque is left, and with which little; no
    friction fitted."""
    size = float(np.linalg.norm(net))
    if not size > 0.0:
        return None
    left = {m: float(np.linalg.norm(net - m.factor * load)) / size for m in mistakes}
    best = min(left, key=lambda m: left[m])
    now = float(np.linalg.norm(net - load)) / size
    return best if left[best] < LEFT and now > max(WORSE * left[best], MUCH) else None


def _mistakes(campaign: MotionCampaign, r: MotionRecording) -> Sequence[Mistake]:
    """Return what a load and the constant of the torque may be mistaken for."""
    name = f"'{r.source.get('load_torque', 'load_torque')}'"
    out = [
        Mistake(
            -1.0,
            f"{name} counts the other way",
            "positive is against positive speed: map it with scale = -1",
        ),
        Mistake(1e-3, f"{name} is in mN m", 'map it with unit = "mNm"'),
        Mistake(
            -1e-3,
            f"{name} is in mN m and counts the other way",
            'map it with unit = "mNm", scale = -1',
        ),
        Mistake(1e3, f"{name} is in kN m", "map it with scale = 1000"),
        Mistake(1e-2, f"{name} is in cN m", "map it with scale = 0.01"),
    ]
    if "torque_constant" not in campaign.stated:
        out += [
            Mistake(2.0, "pole_pairs counts poles", "halve it in [motor]", like_friction=True),
            Mistake(0.5, "pole_pairs is half of what it is", "double it in [motor]"),
        ]
    return out
