"""Current readings that were disturbed or are missing, one row at a time: found, and what the rows
beside tell put in their place.

What a command does to a current from row to row is known, and the rest of it goes on smoothly.  A
reading that leaves this and is back in the next row was no current: a winding's inductance does not
allow it.  One such reading in a thousand, a hundred times the noise, would be ten times the noise
over the whole recording, and look like an effect that nobody knows.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from model.array_types import Array
from model.parameters import Drive
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.checks.balance import PHASES
from sandbox.recordings.findings import Doubt, Finding, Refused
from sandbox.recordings.rows.held import held_over

# times what a current does in most rows: of Gaussian readings one in 1e14 goes forth and back so
BEYOND = 8.0
LEAST = 0.02  # of the largest usual current: smaller disturbances are left to the noise
USUAL = 0.9  # of the rows: their largest current is a usual one
MOST_DISTURBED = (
    0.06  # of the rows: beyond it some stand among so many others that none shows (measured)
)
BACK = 0.25  # of what a reading leaves by: nearer than this it is back
PULSE = 2.0  # times what a command of one row moves: an inductance a third of the stated one
LATE = 4  # rows by which a log's currents may stand after their commands (as in checks.shifts)
PASSES = 4
LONGEST = 3  # rows that are disturbed one after the other
FEWEST = 32  # rows that show what a current does from row to row
AROUND = 9  # rows over which what a current does beside the command is told
BLOCK = 10_000  # rows that are looked at together: memory
DEVIATION = 1.4826  # times the median of a Gaussian's size


def without_disturbed(campaign: Campaign) -> Campaign:
    """Return a campaign whose disturbed current readings are replaced by what the rows beside them
    tell, with a doubt each; what that misses counts as noise.  Refused where they are too many;
    those of a sensor that is slower than the rows stay, which `held` tells."""
    squares, rows, findings, out = 0.0, 0, list[Finding](), list[CampaignRecording]()
    least = noticed(campaign)
    for r in campaign.recordings:
        slow = any(held_over(r.columns[n]) > 1 for n in PHASES)
        own, notes, missed = (r, [], 0.0) if slow else _mended(r, campaign.drive, least)
        out.append(own)
        findings += notes
        squares, rows = squares + missed, rows + len(r.t)
    if all(new is old for new, old in zip(out, campaign.recordings, strict=True)):
        return campaign
    return dataclasses.replace(
        campaign,
        recordings=tuple(out),
        findings=(*campaign.findings, *findings),
        unseen=math.hypot(campaign.unseen, math.sqrt(squares / len(PHASES) / max(rows, 1))),
    )


def noticed(campaign: Campaign) -> float:
    """Return from which size on (A) a reading is looked at: beyond the sensors' noise, and seen
    beside a campaign's currents."""
    c = campaign.drive.converter
    noise = math.hypot(c.current_noise, c.current_resolution / math.sqrt(12.0))
    usual = [float(np.quantile(np.abs(r[n]), USUAL)) for r in campaign.recordings for n in PHASES]
    return max(BEYOND * math.sqrt(2.0) * noise, LEAST * max(usual, default=0.0))


def _mended(
    r: CampaignRecording, drive: Drive, least: float
) -> tuple[CampaignRecording, list[Finding], float]:
    """Return a recording without disturbed readings, findings, and the squares (A^2) missed in all
    its phases."""
    columns, findings, missed = dict(r.columns), list[Finding](), 0.0
    for name in read_phases(r):
        x, moved = r[name], driven(r, drive, PHASES.index(name))
        empty = r.empty.get(name, np.zeros(len(x), dtype=bool))
        bad, squares = disturbed(x, moved, least, empty)
        if not np.any(bad):
            continue
        missed += squares
        columns[name] = interpolated(x, moved, bad)
        rows = np.flatnonzero(bad & ~empty)  # an empty cell was told where it was read
        findings += [_finding(r, name, rows, columns[name])] if rows.size else []
    if all(columns[name] is r.columns[name] for name in PHASES):
        return r, [], 0.0
    for name in set(PHASES) - set(read_phases(r)):
        columns[name] = -np.sum([columns[n] for n in PHASES if n != name], axis=0)
    return dataclasses.replace(r, columns=columns, empty={}), findings, missed


def read_phases(r: CampaignRecording) -> list[str]:
    """Return the phases whose currents were read and not made of two others."""
    held = [n for n in PHASES if n in r.source]
    return held if len(held) == 2 else list(PHASES)


def _finding(r: CampaignRecording, name: str, rows: NDArray[np.intp], mended: Array) -> Finding:
    """Return what is said of disturbed rows; Refused where they are too many."""
    k, x, own = int(rows[0]), r[name], r.source.get(name, name)
    count = f"{rows.size} of {len(x)} rows"
    text = (
        f"{r.file}: row {k} of column '{own}' is {x[k]:.4g} A, the rows beside it make it "
        f"{mended[k]:.3g} A"
    )
    if rows.size > MOST_DISTURBED * len(x):
        text += (
            f" ({count}, {MOST_DISTURBED:.0%} at most can be mended): readings were disturbed; "
            "repair the sensor or its transfer and record again"
        )
        raise Refused(Finding(r.file, name, k, text))
    text += (
        f" ({count}): no current jumps forth and back, the reading was disturbed; what the rows "
        "beside tell stands in, and what that misses counts as noise: repair the sensor or its "
        "transfer"
    )
    return Doubt(r.file, name, k, text)


def driven(r: CampaignRecording, drive: Drive, phase: int) -> Array:
    """Return by how much (A) the command moves a phase's current from each row to the next (n - 1,)
    at mean inductance."""
    m, period = drive.motor, drive.converter.sampling_period
    inductance = 0.5 * (m.inductance_d + m.inductance_q)
    u = ((r.u_alpha + 1j * r.u_beta) * np.exp(-2j * math.pi / 3.0 * phase)).real
    return np.asarray(u[:-1] * -math.expm1(-m.resistance * period / inductance) / m.resistance)


def disturbed(
    x: Array, moved: Array, least: float, empty: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.bool_], float]:
    """Return which readings (n,) leave what the command moves (n - 1,) and are back within LONGEST
    rows, and the squares that are missed once the rows beside stand in for them.

    least: A, what counts as leaving at least; empty: readings that are none.  One beside others
    shows once these are gone.
    """
    bad = np.zeros(len(x), dtype=bool) if empty is None else empty.copy()
    if len(x) < FEWEST:
        return bad, 0.0
    for _ in range(PASSES):
        own = interpolated(x, moved, bad)
        raw = np.diff(own) - moved
        step = raw - _usual(raw)
        bound = max(BEYOND * DEVIATION * float(np.median(np.abs(step))), least)
        more = bad | _forth_and_back(step, moved, bound)
        more |= _at_the_ends(raw, moved, bound, more)
        more &= bad | (np.abs(x - interpolated(x, moved, more)) > bound)
        if not np.any(more & ~bad):
            break
        bad = more
    good = ~(bad[1:-1] | bad[:-2] | bad[2:])
    off = np.abs(0.5 * (step[:-1] - step[1:])[good])
    if not np.any(bad) or not off.size:
        return bad, 0.0
    # one that was not found leaves its square, and two quarters of it in the rows beside
    unfound = float(np.sum(off[off > bound] ** 2)) / 1.5
    return bad, unfound + int(bad.sum()) * float(np.mean(off[off <= bound] ** 2))


def _forth_and_back(step: Array, moved: Array, bound: float) -> NDArray[np.bool_]:
    """Return the rows (n,) before which a step (n - 1,) goes beyond a bound and after which, within
    LONGEST rows, as far back."""
    bad = np.zeros(len(step) + 1, dtype=bool)
    pulse = PULSE * np.abs(np.diff(moved, prepend=moved[0], append=moved[-1]))
    done = 0
    for k in np.flatnonzero(np.abs(step) > bound).tolist():
        near = pulse[max(k - LATE, 0) : k + LONGEST + 2]
        most = max(bound, float(np.max(near)))
        if k < done or abs(step[k]) < most:
            continue
        gone = np.abs(np.cumsum(step[k : k + LONGEST + 1])[1:])  # after 1, 2, ... rows
        for within in (bound, BACK * abs(step[k])):
            back = np.flatnonzero(gone <= within)
            if back.size:
                done = k + 2 + int(back[0])
                bad[k + 1 : done] = True
                break
    return bad


def _at_the_ends(
    raw: Array, moved: Array, bound: float, bad: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which of the first and the last row (n,) leave what the steps beside it (n - 1,), on a
    straight line, tell of its own: there nothing comes back."""
    ends = np.zeros(len(bad), dtype=bool)
    if not np.any(bad):  # whoever disturbs no row between disturbs no end
        return ends
    for end, toward in ((0, 1), (-1, -1)):
        own = raw[::toward]
        line = np.polyfit(np.arange(AROUND), own[1 : AROUND + 1], 1)
        scatter = float(np.std(own[1 : AROUND + 1] - np.polyval(line, np.arange(AROUND))))
        pulse = PULSE * abs(float(np.diff(moved[::toward][:2])[0]))
        off = abs(float(own[0] - np.polyval(line, -1.0)))
        ends[end] = off > max(bound, BEYOND * scatter, pulse) and not bad[::toward][1]
    return ends


def _usual(step: Array) -> Array:
    """Return the median of steps around each."""
    half = AROUND // 2
    windows = sliding_window_view(np.pad(step, half, mode="reflect"), AROUND)
    out = np.empty(len(step))
    for first in range(0, len(step), BLOCK):  # a median copies all its windows
        out[first : first + BLOCK] = np.median(windows[first : first + BLOCK], axis=1)
    return out


def interpolated(x: Array, moved: Array, bad: NDArray[np.bool_]) -> Array:
    """Return readings (n,) with bad ones as the good rows beside and the command between them
    tell."""
    if not np.any(bad):
        return x
    path = np.concatenate([[0.0], np.cumsum(moved)])
    rows, good = np.arange(len(x)), ~bad
    rest = np.interp(rows, rows[good], (x - path)[good])
    first, last = rows[good][[0, -1]]
    for own, near in (
        (slice(0, first), rows[good][:AROUND]),
        (slice(last + 1, None), rows[good][-AROUND:]),
    ):
        if rows[own].size:  # beyond the last good row what the rows before did goes on
            rest[own] = np.polyval(np.polyfit(near, (x - path)[near], 2), rows[own])
    return np.where(bad, rest + path, x)
