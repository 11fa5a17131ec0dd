"""Angles as logs hold them: wrapped at a turn, at something that is no turn, or turning too far
from row to row.

A step of more than half a turn between two rows reads as one the other way.  Beyond a third of a
turn a little scatter of the stamps does that, so such an angle is followed by the log's own speed,
or refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.errors import BadInput
from sandbox.recordings.angle.commutation import state_names, states_angle
from sandbox.recordings.campaign import Made
from sandbox.recordings.findings import Doubt, Finding

WRAP = 1.01  # turns within which a wrapped angle stays
FOLLOWED = 1.0 / 3.0  # of a turn: the longest step between two rows whose sense is told
NEAR = 0.25  # of a turn: a step that speed and angle can be compared on
# turns rms between an angle and its speed; what they share by chance is 1 / sqrt(12) = 0.29
STRAY = 0.2
BACK = 0.9  # of the range: a jump back that wraps
LEVELS = 16  # different readings of an angle that turns
QUARTER = 1e-4  # turns: how near to a quarter the step from alpha to beta is
OTHERS = {400.0: ", or gon", 6400.0: ", or mil"}  # units of an angle, by how many a turn has
ALIKE = 0.03  # relative, of a range and a turn


def unwrapped(
    file: str,
    column: str,
    raw: Array,
    turn: float,
    notes: list[Finding],
    steps: Array | None = None,
    estimate: bool = False,
) -> Array:
    """Return an angle (in its own unit, `turn` of it a turn) without its jumps of one turn, noting
    that it was wrapped.

    steps: turns from row to row by the log's own speed, where it holds one; estimate: whether it is
    an estimator's, which starts up by steps of a quarter and of half a turn (polarity).

    BadInput for an angle that wraps at something else than a turn, that turns too far between two
    rows, or that goes another way than the speed.
    """
    step = np.diff(raw)
    if not step.size or np.ptp(raw) == 0.0:
        return raw
    if many := _turns_of_wrap(raw, step, turn):
        jumps = np.flatnonzero(np.abs(step) > 0.5 * many * turn)
        notes.append(_said(file, column, jumps, "is unwrapped here", many))
        laps = np.zeros(len(raw))
        laps[jumps + 1] = -np.sign(step[jumps])
        return raw + many * turn * np.cumsum(laps)
    if not (estimate and np.any(np.abs(np.abs(step) / turn - 0.25) < QUARTER)):
        _refuse_other_turn(file, column, raw, step, turn)
    if np.ptp(raw) > WRAP * turn:
        return raw
    if steps is not None:
        return _by_speed(file, column, raw, step, turn, notes, steps)
    moved = np.mod(step + 0.5 * turn, turn) - 0.5 * turn
    whole, beyond = np.abs(step) > 0.5 * turn, np.abs(moved) > FOLLOWED * turn
    jumps = np.flatnonzero(whole & ~beyond if estimate else whole)
    if not jumps.size:
        return raw
    far = np.flatnonzero(beyond)
    if far.size and not estimate:
        k = int(far[0])
        raise BadInput(
            f"{file}: row {k + 1} of column '{column}' is {abs(moved[k]) / turn:.2g} of "
            "a turn from the row before "
            f"({far.size} such rows); an angle that is known within a turn can be "
            "followed up to a third of one: log "
            'faster, or map the log\'s speed (speed = {column = ..., unit = "rpm"})'
        )
    notes.append(_said(file, column, jumps, "is unwrapped here"))
    turns = np.cumsum(moved[jumps] - step[jumps])  # as np.unwrap, but at the jumps alone
    return raw + np.repeat(np.append(0.0, turns), np.diff([0, *(jumps + 1), len(raw)]))


def _turns_of_wrap(raw: Array, step: Array, turn: float) -> int:
    """Return of how many turns, two at least, a counter wraps that is followed well within one from
    row to row; 0 where it does not."""
    span = float(np.ptp(raw))
    if not span > WRAP * turn:
        return 0
    many = round(span / turn)
    back = np.abs(step) > 0.5 * span
    moved = np.abs(np.where(back, np.abs(step) - many * turn, step))
    if many < 2 or not np.any(back) or np.all(back):
        return 0
    usual = float(np.max(moved[~back]))  # a jump goes on as rows without one do
    return many if np.max(moved[back]) <= usual < FOLLOWED * turn else 0


def _said(file: str, column: str, jumps: NDArray[np.int64], what: str, many: int = 1) -> Finding:
    k = int(jumps[0]) + 1
    by = "a turn" if many == 1 else f"{many} turns"
    text = (
        f"{file}: row {k} of column '{column}' jumps by {by} ({jumps.size} jumps); the "
        f"angle was wrapped and {what}"
    )
    return Finding(file, column, k, text)


def _by_speed(
    file: str, column: str, raw: Array, step: Array, turn: float, notes: list[Finding], steps: Array
) -> Array:
    """Return an angle whose turns between two rows are those that its speed says."""
    whole = np.round(steps - step / turn)
    if not np.any(whole):
        return raw
    stray = step / turn + whole - steps
    if float(np.sqrt(np.mean(stray**2))) > STRAY:
        raise BadInput(
            f"{file}: column '{column}' and the log's speed do not go together "
            f"({other_pace(raw, turn, steps)}); "
            "correct unit, sign or mechanical = true of one of them in [columns]"
        )
    jumps = np.flatnonzero(whole)
    far = float(np.max(np.abs(steps)))
    notes.append(
        _said(
            file, column, jumps, f"follows the log's speed, up to {far:.2g} turns from row to row"
        )
    )
    return raw + turn * np.concatenate([[0.0], np.cumsum(whole)])


def other_pace(raw: Array, turn: float, steps: Array) -> str:
    """Return in words how fast an angle turns beside its speed, from rows in which both move
    little."""
    moved = np.mod(np.diff(raw) / turn + 0.5, 1.0) - 0.5
    slow = (np.abs(moved) < NEAR) & (np.abs(steps) < NEAR)
    energy = float(np.sum(steps[slow] ** 2))
    if energy == 0.0:
        return "it turns when the speed is zero"
    pace = float(np.sum(moved[slow] * steps[slow])) / energy
    return f"where both are slow it turns {pace:.3g} times as fast as the speed says"


def _refuse_other_turn(file: str, column: str, raw: Array, step: Array, turn: float) -> None:
    """Raise BadInput for an angle that jumps back by its whole range, which is no turn of its
    unit."""
    span = float(np.ptp(raw))
    if abs(span / turn - 1.0) < ALIKE or span < 1e-3 * turn:
        return
    back = np.flatnonzero(np.abs(step) > BACK * span)
    if back.size < 2 or back.size > 0.25 * step.size or len(np.unique(raw[: 64 * LEVELS])) < LEVELS:
        return
    k = int(back[0])
    wrap = _round(span)
    units = {360.0: '"deg"', math.tau: '"rad"', 1.0: '"rev"'}
    unit = next((said for size, said in units.items() if abs(span / size - 1.0) < ALIKE), None)
    guess = (
        f"map it with unit = {unit}"
        if unit
        else f"are these counts{OTHERS.get(wrap, '')}? map it with unit = "
        f'"rev" and scale = 1/{wrap:g}'
    )
    if unit is None and wrap < 10.0:
        guess = "unwrap it before, or map the unit in which it wraps at a turn"
    raise BadInput(
        f"{file}: row {k + 1} of column '{column}' jumps back by {abs(step[k]):.5g} "
        f"({back.size} such rows), as an "
        f"angle does that wraps there, but a turn is {turn:.5g} of its unit; {guess}; with "
        "mechanical = true where it wraps once a turn of the shaft (an encoder), without it where "
        "once an electrical turn (a drive's own angle)"
    )


def _round(span: float) -> float:
    """Return the counts a turn of which a range is all but the last: a power of two, or else a
    round number."""
    for counts in (2.0 ** round(math.log2(span)), 100.0 * round(span / 100.0)):
        if abs(counts - span) < 0.01 * span:
            return counts
    return float(math.ceil(span))


def turns_between(found: Mapping[str, Array]) -> Array | None:
    """Return the turns (electrical) from row to row that stamps and speed of a log tell; None where
    it lacks one."""
    if "speed" not in found or "t" not in found:
        return None
    return np.asarray(np.diff(_angle(found["t"], found["speed"])) / math.tau)


def _angle(t: Array, speed: Array) -> Array:
    """Return the integral (rad) of a speed (rad/s) over uneven stamps (s)."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])


def with_angle(
    file: str,
    found: dict[str, Array],
    own: Mapping[str, str],
    notes: list[Finding],
    locked: int = 0,
    period: float = 0.0,
) -> tuple[dict[str, Array], Made | None]:
    """Return a log's columns with an angle (rad electrical) made of what stands in for it, and of
    what: where the log holds none, or one that never moves while that does.

    own: the log's column names by ours; locked: rows of a rotor that stands, whose angle is zero
    then; period: s from row to row where the log has no stamps.  Hall states and counted steps come
    before the speed, but not where signals of the drive's own frame have to be turned.
    """
    theta, turned = found.get("theta"), ("i_d" in found or "u_d" in found) and "speed" in found
    if theta is not None and (locked or not theta.size or np.ptp(theta) > 0.0):
        return found, None
    name = None if turned or locked else state_names(found)
    speed = found.get("speed", np.zeros(0))
    t: Array = (
        found["t"] if "t" in found else np.asarray(np.arange(len(speed)) * period, dtype=np.float64)
    )
    if name:
        (angle, count), states = (
            states_angle(file, found, own, _angle(t, speed) if len(speed) else None),
            True,
        )
        if (theta is None or np.ptp(angle) > 0.0) and ("i_d" in found or "u_d" in found):
            raise BadInput(
                f"{file}: i_d, i_q, u_d, u_q are turned by the drive's own angle, which "
                f"{of_log(own, name)} shows to "
                "60 degrees only; log phase currents, or map the log's speed, too"
            )
    elif not locked and np.any(t) and np.any(speed):
        name, angle, count, states = ("speed",), _angle(t, speed), 0.0, False
    elif locked and theta is None:
        return {**found, "theta": np.zeros(locked)}, Made("", 0.0)
    elif theta is None and speed.size and not np.any(speed):
        raise BadInput(
            f"{file}: column {of_log(own, ('speed',))} is zero throughout, so the rotor "
            "stands still; give it rotor = "
            '"locked", or map the angle'
        )
    if not name or (theta is not None and np.ptp(angle) == 0.0):
        return found, None
    said = (
        "no angle is mapped"
        if theta is None
        else f"column '{own.get('theta', 'theta')}' never changes while "
    )
    said += "" if theta is None else f"{of_log(own, name)} moves"
    text = (
        f"{file}: {said}; the angle is made from {of_log(own, name)}: its zero is unknown, and "
        + (
            f"it follows {of_log(own, ('speed',))} between two changes"
            if states and len(speed)
            else "it is known to a sixth of an electrical turn, smooth between two changes"
            if states
            else "what is bound to a place drifts"
        )
    )
    notes.append((Finding if theta is None else Doubt)(file, "theta", None, text))
    return {**found, "theta": angle}, Made(of_log(own, name), count, either_way=states)


def of_log(own: Mapping[str, str], names: Sequence[str]) -> str:
    """Return columns in the log's words."""
    return ", ".join(f"'{own.get(n, n)}'" for n in names)
