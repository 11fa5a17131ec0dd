"""Whether the commanded voltage turns as fast as the angle: pole pairs, a gear between motor and
encoder, or a speed without its sign.

Over a stretch in which the commands keep their strength the load moves the voltage against the
magnet by LOAD_TURNS at most, so many turns tell the ratio of both paces.  Within what is left the
flux balance tells it as well as the whole log is long.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence

import numpy as np

from model.array_types import Array
from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import Complex
from sandbox.recordings.checks.changes import ANGLE, Change
from sandbox.recordings.checks.readings import Products
from sandbox.recordings.findings import Finding, Refused

TURNING = 0.03  # of the link: a voltage whose direction is no noise
# turns by which a load that changes its sign, and back, may move the voltage against the magnet
LOAD_TURNS = 1.2
TURNS = 5.0  # electrical turns that tell how fast voltage and angle turn
SMOOTHED = 4  # rows of a command without injection
SHORTEST = 16  # rows of a stretch that turns: two periods at eight samples each
OFF_PACE = 0.02  # relative, of how fast they turn
BLUR = 0.3  # rad over a log: angles that differ by less are tried as one
MOST_TRIED = 400  # paces
FARTHEST, MOST_STEP = 20.0, 0.5  # of the paces tried where none is told, and between two of them
ARC = 2.0  # rad as read, over which these are tried first
REFINED = 4  # of them that are tried over all
WHOLE = 0.005  # relative, within which pole pairs, or a gear, are whole
MOST_PAIRS = 100  # as of [motor] pole_pairs
USUAL_PAIRS = 24  # tried one by one


def ratio_of(r: CampaignRecording, drive: Drive) -> tuple[float, float] | None:
    """Return how many times as fast as the angle the voltage turns, and how far that may be off;
    None where it cannot be told."""
    if r.rotor == "locked" or r.t.size < SHORTEST or np.max(np.abs(np.diff(r.theta))) > 1.0:
        return None
    smooth, stretches = _strong(r, drive)
    if not stretches:
        return None
    begin, end = max(stretches, key=lambda x: x[1] - x[0])
    phase = np.unwrap(np.angle(smooth[begin:end]))
    read, turned = (float(x[-1] - x[0]) / math.tau for x in (r.theta[begin:end], phase))
    if max(abs(read), abs(turned)) < TURNS or read == 0.0 or np.max(np.abs(np.diff(phase))) > 2.0:
        return None
    ratio = turned / read
    return ratio, OFF_PACE * max(abs(ratio), 1.0) + LOAD_TURNS / abs(read)


def off_pace(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Return a finding where the voltage turns faster or slower than the angle: pole pairs, or a
    gear in between."""
    for r in recordings:
        ratio = ratio_of(r, drive)
        if ratio is None or abs(abs(ratio[0]) - 1.0) <= ratio[1]:
            continue
        text = (
            f"{r.file}: the voltage turns {ratio[0]:.4g} times as fast as column 'theta'; with "
            f"pole_pairs = {drive.motor.pole_pairs:g} that would be "
            f"{drive.motor.pole_pairs * ratio[0]:.3g} pairs: correct pole_pairs, the angle's "
            "scale, or a gear between motor and encoder"
        )
        return [Finding(r.file, "theta", None, text)]
    return []


def paces(parts: Sequence[Products]) -> Iterator[Change]:
    """Yield the angle's factor that the voltage shows where it turns at another pace: the one that
    leaves least of the recording that turns most, and the whole ones beside it."""
    found = [(p, own) for p in parts if (own := ratio_of(p.recording, p.drive)) is not None]
    found = [(p, own) for p, own in found if abs(abs(own[0]) - 1.0) > own[1]]
    if not found:
        yield from _whole(parts)
        yield from _any(parts)
        return
    part, (ratio, off) = min(found, key=lambda x: x[1][1])
    count = math.ceil(2.0 * off * float(np.ptp(part.columns["theta"])) / BLUR)
    tried = ratio + off * np.linspace(-1.0, 1.0, min(max(count, 3), MOST_TRIED))
    left = part.least(tried)
    best = float(tried[int(np.argmin(left))])
    pairs = part.drive.motor.pole_pairs
    yield from of_pace(best, float(pairs))


def _whole(parts: Sequence[Products]) -> Iterator[Change]:
    """Yield the angles of other pole pairs where no recording turns far enough to tell a pace."""
    part = max(parts, key=lambda p: float(np.ptp(p.columns["theta"])))
    pairs = float(part.drive.motor.pole_pairs)
    if part.recording.rotor != "locked":
        for own in range(1, USUAL_PAIRS + 1):
            yield from of_pace(own / pairs, pairs) if own != pairs else ()


def _any(parts: Sequence[Products]) -> Iterator[Change]:
    """Yield the angle's factor, whole or not, that leaves least of the recording that turns most:
    looked for over its fastest ARC, where few paces differ, and from the best of them over all."""
    part = max(parts, key=lambda p: float(np.ptp(p.columns["theta"])))
    theta, pairs = part.columns["theta"], float(part.drive.motor.pole_pairs)
    if part.recording.rotor == "locked" or np.ptp(theta) < BLUR:
        return
    begin, end = _fastest(theta)
    own = {n: x[begin:end] for n, x in part.columns.items()}
    piece = Products(dataclasses.replace(part.recording, columns=own), part.drive, 0.0, 0.0)
    step = BLUR / float(np.ptp(theta[begin:end]))
    tried = np.arange(-FARTHEST, FARTHEST + step, min(step, MOST_STEP))
    left = piece.least(tried)
    near = tried[np.argsort(left)[:REFINED]]
    count = min(math.ceil(2.0 * step * float(np.ptp(theta)) / BLUR), MOST_TRIED)
    fine = np.concatenate([x + step * np.linspace(-1.0, 1.0, max(count, 3)) for x in near])
    left = part.least(fine)
    best = float(fine[int(np.argmin(left))])
    if best != 0.0:
        yield from of_pace(best, pairs)


def _fastest(theta: Array) -> tuple[int, int]:
    """Return [begin, end) of the shortest stretch, to a factor of two, over which an angle moves by
    ARC; the whole where it does not."""
    rows = 2 * SHORTEST
    while rows < len(theta):
        moved = np.abs(theta[rows:] - theta[:-rows])
        k = int(np.argmax(moved))
        if moved[k] >= ARC:
            return k, k + rows + 1
        rows *= 2
    return 0, len(theta)


def of_pace(best: float, pairs: float) -> Iterator[Change]:
    """Yield what an angle may be that turns so many times too slowly."""
    own = round(abs(best) * pairs)
    way = " and counted backwards" if best < 0.0 else ""
    if 1 <= own <= MOST_PAIRS and abs(abs(best) * pairs / own - 1.0) < WHOLE:
        turn = math.copysign(own / pairs, best)
        yield _turned(
            turn,
            f"{_off(turn)} ({own} pole pairs, or a gear of {_gear(turn)}){way}",
            f"correct pole_pairs = {pairs:g} to {own}, or map it with scale = {turn:.6g}",
            mistakes=1 + bool(way),
        )
    else:
        yield _turned(
            best,
            f"{_off(best)} (a gear of {_gear(best)}){way}",
            f"map it with scale = {best:.6g}",
            mistakes=2,
        )


def _off(turn: float) -> str:
    """Return by how much an angle is too slow or too fast."""
    size = abs(turn)
    return f"{size:.4g} times too slow" if size > 1.0 else f"{1.0 / size:.4g} times too fast"


def _gear(turn: float) -> str:
    """Return a ratio in the words of gears."""
    return f"{abs(turn):.4g} : 1" if abs(turn) > 1.0 else f"1 : {1.0 / abs(turn):.4g}"


def _turned(turn: float, guess: str = "", remedy: str = "", mistakes: int = 1) -> Change:
    return Change(ANGLE, "theta", guess, remedy, turn=turn, fitted=mistakes > 1, mistakes=mistakes)


def _strong(r: CampaignRecording, drive: Drive) -> tuple[Complex, list[tuple[int, int]]]:
    """Return the command, smoothed over SMOOTHED rows or a period of injection, and [begin, end) of
    the stretches in which it keeps its strength, of SHORTEST rows at least."""
    period = 1.0 / (drive.injection.frequency * drive.converter.sampling_period)
    rows = SMOOTHED if r.injection_axis == "none" else max(SMOOTHED, round(period))
    smooth = np.convolve(r.u_alpha + 1j * r.u_beta, np.full(rows, 1.0 / rows), "same")
    good = np.abs(smooth) > TURNING * r.u_dc
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8)))
    spans = [(int(a), int(b)) for a, b in edges.reshape(-1, 2) if b - a >= SHORTEST]
    return smooth, spans


def without_sign(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Raise BadInput for a speed that never changes its sign while the voltage turns both ways, of
    which the angle is made."""
    speed = r.source.get("speed")
    others = {"theta", "hall", "hall_a", "steps"} & set(r.source)
    if r.rotor == "locked" or r.made is None or speed is None or others:
        return []
    rate = np.diff(r.theta)
    if np.any(rate < 0.0) and np.any(rate > 0.0):
        return []
    smooth, stretches = _strong(r, drive)
    turned = [float(np.sum(np.diff(np.unwrap(np.angle(smooth[a:b]))))) for a, b in stretches]
    ways = [[k for k, x in enumerate(turned) if way * x > math.tau] for way in (1.0, -1.0)]
    if not all(ways):
        return []
    k = stretches[max(ways[0][0], ways[1][0])][0]
    text = (
        f"{r.file}: row {k} of column 'speed' ('{speed}'): the commanded voltage turns both ways, "
        "the speed never changes its sign; log it with its sign, or cut the recording where the "
        "rotor turns round and map the part that turns backwards with scale = -1"
    )
    raise Refused(Finding(r.file, "theta", k, text))
