"""Parts chosen from recordings: those in which currents stay within the motor's flux map, and of
long ones what differs, not minutes of the same.

Beyond a map nothing is known of the motor (`map_range`): a recording is cut where it goes there,
and a part begins with what a current between the map's points tells of the flux.

Each recording of a long campaign is cut into blocks of equal length.  A block is described by what
its commands, currents and encoder say: mean and scatter of currents, speed, voltage, link voltage
and load, and where a locked rotor stands.  Nothing simulated is looked at, so the choice favours no
effect.
Taken are, in this order:

1. of every recording (where there are many, of every kind of them: rotor, injection, link voltage)
one block,
2. as long as half of the samples are left, the block farthest from all that are taken
   (Gonzalez, Theor. Comput. Sci. 38 (1985) 293): what is rare,
3. blocks spread evenly over the rest: what is usual.

A block begins in mid-recording, where filters and iron are not at rest and the first reading is one
noisy sample.  The replay goes through the rows before it, so that states settle; these rows are no
part of the residual.  A free rotor's shaft may swing there, so a block of it has a block's length
of such rows.  A whole recording that begins under current gives its own first rows to that
(`begun`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from model.array_types import Array
from model.errors import BadInput
from model.frames import stationary
from model.parameters import Motor
from sandbox.recordings.campaign import Campaign, CampaignRecording, Excerpt, Excerpts
from sandbox.recordings.checks.map_range import stretches_within
from sandbox.replay.inputs import AT_REST, stated_noise_std

# samples that are all used: the largest campaign of the blind checks holds 169 920
MAX_SAMPLES = 250_000
CUT_TO = 100_000  # samples of a longer one: the other campaigns of the blind checks hold 84 960
PARTS = 24  # blocks of so many samples: twice the recordings that those campaigns hold
FEWEST = 6  # blocks, where states take long to settle and blocks are longer for it
LEAST = 20_000  # samples, below which a campaign is not cut: PARTS blocks of 80 ms at 10 kHz
SETTLED = 5.0  # time constants L/R: of a wrong start 0.7 % is left
# standard deviations of a reading, within which one is what sensors read at rest: where noise is
# twice as large as stated, one of 120 recordings at rest has a reading beyond, and loses rows
STARTED = 6.0
MOST_OF = 3  # recordings of which the median is what most of them read
# of rated values, that the campaign's whole length counts as: blocks that differ by less spread
# over it
APART = 0.1
FARTHEST = 3.0  # of rated values: what is beyond is a fault, not further away
# of rated values that two kinds of rotor lie apart: each is chosen from before blocks of one are
# compared
KINDS = 10.0


def excerpted(campaign: Campaign, most: float | None = None) -> Campaign:
    """Return a campaign of parts of its recordings, within the motor's flux map and of at most so
    many samples in all (`Campaign.excerpts`).

    One that stays within the map and is not longer is returned as it is.  most: samples, math.inf
    for all; by default campaigns longer than MAX_SAMPLES are cut to CUT_TO.  BadInput below LEAST,
    and where nothing lies within the map.
    """
    check_samples(most)
    n = [len(r.t) for r in campaign.recordings]
    stretches = _stretches(campaign)
    within = sum(s.end - s.first for s in stretches)
    if most is None:
        most = CUT_TO if within > MAX_SAMPLES else math.inf
    if sum(n) == within <= most:
        return campaign
    blocks = stretches if within <= most else _chosen(campaign, stretches, most)
    recordings, taken = [], []
    for b in blocks:
        whole = campaign.recordings[b.recording]
        own = _part(campaign, b)
        recordings.append(own)
        taken.append(Excerpt(own.file, whole.file, b.first, b.end - b.first, len(whole.t)))
    files = tuple(r.file for r in campaign.recordings)
    found = Excerpts(tuple(taken), sum(n), files, within)
    return replace(campaign, recordings=tuple(recordings), excerpts=found)


class Stretch(NamedTuple):
    """Rows of a recording, first and end, and the row before which its states are not to settle."""

    recording: int
    first: int
    end: int
    since: int


def _stretches(campaign: Campaign) -> list[Stretch]:
    """Return the stretches of all recordings within the motor's flux map, of at least L/R each: of
    a shorter one the flux at its start, which one reading tells, takes most; BadInput for none."""
    motor, period = campaign.drive.motor, campaign.drive.converter.sampling_period
    least = even(rows_to_settle(motor, period) / SETTLED)
    found = [
        Stretch(k, first, end, first)
        for k, r in enumerate(campaign.recordings)
        for first, end in stretches_within(motor, r, least)
    ]
    if not found:
        raise BadInput(
            f"[flux_map]: currents of every recording leave the map within {least} rows (L/R); "
            "give a map as far as the currents go, or alphas in [motor] in its place"
        )
    return found


def _part(campaign: Campaign, s: Stretch) -> CampaignRecording:
    """Return a stretch of a recording as a recording of its own, or all of it as it is."""
    whole, period = campaign.recordings[s.recording], campaign.drive.converter.sampling_period
    if s.end - s.first == len(whole.t):
        return whole
    settling = rows_to_settle(campaign.drive.motor, period)
    return excerpt(whole, slice(s.first, s.end), settling, period, since=s.since)


def _chosen(campaign: Campaign, stretches: Sequence[Stretch], most: float) -> list[Stretch]:
    """Return blocks of stretches, of at most so many samples in all."""
    settling = rows_to_settle(campaign.drive.motor, campaign.drive.converter.sampling_period)
    length = even(min(max(most / PARTS, settling), most / FEWEST))
    blocks = [
        Stretch(s.recording, s.first + first, s.first + end, s.first)
        for s in stretches
        for first, end in _blocks(s.end - s.first, length)
    ]
    marks = np.array([mark_of(campaign, b) for b in blocks])
    groups = _groups(campaign, [b.recording for b in blocks])
    return [blocks[k] for k in _places(marks, [b.end - b.first for b in blocks], groups, most)]


def check_samples(most: float | None) -> None:
    """Raise BadInput where so many samples are too few."""
    if most is not None and not most >= LEAST:
        raise BadInput(
            f"samples = {most:g} is too few to tell effects apart; give {LEAST} or more, "
            "or inf for all"
        )


def even(rows: float) -> int:
    """Return the largest even number of rows that is not larger: halves of a PWM period (double
    update) stay whole."""
    return 2 * int(rows // 2.0)


def _places(
    marks: Array, sizes: Sequence[int], groups: Sequence[Sequence[int]], most: float
) -> list[int]:
    """Return the places of the blocks that are taken, in their order; groups: places of which one
    each comes first."""
    middle = marks.mean(axis=0)
    out: list[int] = []
    for group in groups:  # of each the most unusual one
        k = max(group, key=lambda k: float(np.sum((marks[k] - middle) ** 2)))
        if sum(sizes[i] for i in out) + sizes[k] <= most:
            out.append(k)
    out = farthest_first(marks, sizes, out, max(0.5 * most, sum(sizes[k] for k in out)))
    left = [k for k in range(len(sizes)) if k not in out]
    room = int((most - sum(sizes[k] for k in out)) // max(sizes[k] for k in left)) if left else 0
    spread = np.linspace(0, len(left) - 1, min(room, len(left)) + 2)[1:-1]
    return sorted({*out, *(left[round(x)] for x in spread)})


def farthest_first(
    marks: Array, sizes: Sequence[int], taken: Sequence[int], most: float
) -> list[int]:
    """Return the places taken of marks (n, features), and each time the farthest from them, as long
    as the next size stays within most."""
    out = list(taken)
    away = np.min([np.sum((marks - marks[k]) ** 2, axis=1) for k in out], axis=0)
    left = most - sum(sizes[k] for k in out)
    while away.max() > 0.0 and (size := sizes[int(np.argmax(away))]) <= left:
        out.append(int(np.argmax(away)))
        left -= size
        away = np.minimum(away, np.sum((marks - marks[out[-1]]) ** 2, axis=1))
    return out


def _groups(campaign: Campaign, of: Sequence[int]) -> list[list[int]]:
    """Return the places of blocks that belong together: of a recording, or of a kind where there
    are many recordings;
    of: the recording of each block."""
    r = campaign.recordings
    many = len(r) > PARTS // 2
    keys = [(r[k].rotor, r[k].injection_axis, r[k].dc_bus_voltage) if many else (k,) for k in of]
    return [[place for place, own in enumerate(keys) if own == key] for key in dict.fromkeys(keys)]


def _blocks(rows: int, length: int) -> list[tuple[int, int]]:
    """Return first and last row of a recording's blocks, of about that length where there are as
    many rows.

    They begin at even rows.
    """
    bounds = np.linspace(0, rows, max(1, rows // length) + 1).astype(int)
    bounds[1:-1] -= bounds[1:-1] % 2
    return [(int(a), int(b)) for a, b in itertools.pairwise(bounds)]


def mark_of(campaign: Campaign, b: Stretch) -> Array:
    """Return what a block is described by (features,), in shares of rated values."""
    r, count = campaign.recordings[b.recording], len(campaign.recordings)
    signals = _signals(campaign, r, slice(b.first, b.end))
    own = np.concatenate([signals.mean(axis=1), signals.std(axis=1)])
    kind = KINDS * ("locked", "driven", "free").index(r.rotor)
    when = APART * (b.recording + 0.5 * (b.first + b.end) / len(r.t)) / count
    return np.array([*np.clip(own, -FARTHEST, FARTHEST), kind, when])


def _signals(campaign: Campaign, r: CampaignRecording, own: slice) -> Array:
    """Return the signals (8, rows) of some rows of a recording, in shares of rated values."""
    motor, converter = campaign.drive.motor, campaign.drive.converter
    theta = r.theta[own]
    a, b, c = (r.columns[name][own] for name in ("i_a", "i_b", "i_c"))
    alpha, beta, cos, sin = (
        (2.0 * a - b - c) / 3.0,
        (b - c) / math.sqrt(3.0),
        np.cos(theta),
        np.sin(theta),
    )
    base = motor.pole_pairs * motor.rated_speed_rpm * math.pi / 30.0
    speed = (
        np.gradient(np.unwrap(theta), converter.sampling_period) / base
        if len(theta) > 1
        else 0.0 * theta
    )
    load = (
        r.columns["load_torque"][own] / motor.rated_torque
        if "load_torque" in r.columns
        else 0.0 * theta
    )
    stands = 1.0 if r.rotor == "locked" else 0.0
    link = converter.dc_bus_voltage
    return np.stack(
        [
            (cos * alpha + sin * beta) / motor.rated_current,
            (cos * beta - sin * alpha) / motor.rated_current,
            speed,
            math.sqrt(3.0) * np.hypot(r.u_alpha[own], r.u_beta[own]) / link,
            r.u_dc[own] / link,
            load,
            stands * cos,
            stands * sin,
        ]
    )


def begun(campaign: Campaign) -> Campaign:
    """Return a campaign whose recordings that begin under current give their first rows to
    settling.

    The first reading is one noisy sample; a start from it is wrong by that noise for L/R, alike to
    the last digit in all effects that shift readings in time.  A recording keeps at least half of
    its rows.
    """
    motor, period = campaign.drive.motor, campaign.drive.converter.sampling_period
    settling = rows_to_settle(motor, period)
    return replace(
        campaign, recordings=tuple(_begun(campaign, r, settling) for r in campaign.recordings)
    )


def _begun(campaign: Campaign, r: CampaignRecording, settling: int) -> CampaignRecording:
    """Return one of them."""
    period = campaign.drive.converter.sampling_period
    before = even(min(settling, 0.5 * len(r.t)))
    if r.settling or not before or begins_at_rest(campaign, r):
        return r
    columns = {key: x[before:] for key, x in r.columns.items()} | {"t": r.t[before:] - r.t[before]}
    first = {key: x[:before] for key, x in r.columns.items()} | {"t": r.t[:before] - r.t[before]}
    return replace(r, columns=columns, settling=first, starts_at=r.starts_at + before * period)


def begins_at_rest(campaign: Campaign, r: CampaignRecording) -> bool:
    """Return whether a recording begins without current for sure: its first readings are small, and
    nothing but noise beside what most recordings with small ones begin with (their sensors'
    offsets).  One that is sampled late may look as if it did not."""
    small = AT_REST * campaign.drive.motor.rated_current
    if _size(_first_readings(r)) > small:
        return False
    period = campaign.drive.converter.sampling_period
    near = STARTED * stated_noise_std(campaign.drive.converter)
    begun = [x for x in campaign.recordings if x.starts_at < (len(_settling(x)) + 0.5) * period]
    alike = [x for x in map(_first_readings, begun) if _size(x) <= small]
    own, usual = _first_readings(r), np.zeros(3)
    if len(alike) >= MOST_OF:
        usual = np.median(alike, axis=0)
    return bool(min(np.abs(own).max(), np.abs(own - usual).max()) <= near)


def _settling(r: CampaignRecording) -> Array:
    """Return the times of the rows in which states settle."""
    return np.asarray(r.settling.get("t", np.empty(0)))


def _first_readings(r: CampaignRecording) -> Array:
    """Return the first readings (3,) of a recording, those in which states settle included, A."""
    rows = r.settling or r.columns
    return np.array([rows[name][0] for name in ("i_a", "i_b", "i_c")], dtype=float)


def _size(readings: Array) -> float:
    """Return the amplitude of the current that three readings (3,) are, A."""
    return math.hypot(*stationary(*(float(x) for x in readings)))


def rows_to_settle(motor: Motor, period: float) -> int:
    """Return in how many rows states settle, an even number."""
    return 2 * math.ceil(
        0.5 * SETTLED * max(motor.inductance_d, motor.inductance_q) / motor.resistance / period
    )


def excerpt(
    r: CampaignRecording, rows: slice, settling: int, period: float, *, since: int = 0
) -> CampaignRecording:
    """Return some rows of a recording, after those in which states settle; its name tells its time.

    These are `settling` rows, of a free rotor as many as the excerpt has, never more than that,
    none before the row `since`, and an even number where both rows are even.
    """
    first, length = rows.start, even(rows.stop - rows.start)
    before = min(first - since, length if r.rotor == "free" else min(settling, length))
    stem, dot, suffix = r.file.rpartition(".")
    name = f"{stem or suffix}-{first * period:.3f}s{dot if stem else ''}{suffix if stem else ''}"
    # the long ones can go
    columns = {key: x[first - before : rows.stop].copy() for key, x in r.columns.items()}
    columns["t"] -= columns["t"][before]
    return replace(
        r,
        file=name,
        of=r.origin,
        columns={key: x[before:] for key, x in columns.items()},
        settling={key: x[:before] for key, x in columns.items()} if before else {},
        starts_at=r.starts_at + first * period,
    )
