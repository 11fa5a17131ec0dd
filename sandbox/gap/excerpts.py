"""Stretches chosen from long recordings: a diagnosis needs what differs in them, not minutes of the same.

Each recording is cut into blocks of equal length.  A block is described by what its commands, currents and encoder say:
mean and scatter of currents, speed, voltage, link voltage and load, and where the rotor stands.  Nothing simulated is
looked at, so the choice favours no effect.  Starting from the block in the middle of all, the block that is farthest
from those chosen is taken next, until the samples are used up: no block left is then farther from a chosen one than
twice the best possible (Gonzalez, Theor. Comput. Sci. 38 (1985) 293).

A chosen block starts in mid-recording, where filters and iron are not at rest and the first reading is one noisy
sample.  The rows before it lead in: the replay goes through them and nobody judges them.  A free rotor's shaft may
swing there, so a stretch of it has as many rows before it as it has itself.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from model.parameters import Motor
from sandbox.recordings.campaign import Campaign, CampaignRecording, Excerpt, Excerpts
from sandbox.recordings.stamps import segment_name

Array = NDArray[np.float64]
MOST = 250_000  # samples that are all worked on: the largest campaign of the blind checks holds 169 920
CUT_TO = 100_000  # samples of a longer one: the other campaigns of the blind checks hold 84 960
PARTS = 24  # stretches of so many samples: twice the recordings that those campaigns hold
LEAST = 20_000  # samples, below which a campaign is not cut: PARTS stretches of 80 ms at 10 kHz
LEAD = 5.0  # time constants L/R: of a wrong start 0.7 % is left
APART = 0.1  # of rated values, that the campaign's whole length counts as: blocks that differ by less spread over it
KINDS = 10.0  # ranges that two kinds of rotor lie apart: each is chosen from before blocks of one are compared


def excerpted(campaign: Campaign, most: float | None = None) -> Campaign:
    """Return a campaign of the stretches that differ most, of at most so many samples in all (`Campaign.excerpts`).

    One that is not longer is returned as it is.  most: samples, math.inf for all; by default campaigns longer than MOST
    are cut to CUT_TO.  BadInput below LEAST.
    """
    if most is None:
        most = CUT_TO if sum(len(r.t) for r in campaign.recordings) > MOST else math.inf
    if not most >= LEAST:
        raise BadInput(f"samples = {most:g} is too few to tell effects apart; give {LEAST} or more, or inf for all")
    n = [len(r.t) for r in campaign.recordings]
    if sum(n) <= most:
        return campaign
    length = int(most) // PARTS
    blocks = [(k, a, b) for k, rows in enumerate(n) for a, b in _blocks(rows, length)]
    marks = np.concatenate([_marks(campaign, k, length) for k in range(len(n))])
    chosen = sorted(farthest_first(marks, [b - a for _, a, b in blocks], most))
    lead = min(_lead(campaign.drive.motor, campaign.drive.converter.sampling_period), length)
    recordings: list[CampaignRecording] = []
    told, taken = [], {r.file for r in campaign.recordings}
    for place in chosen:
        k, first, last = blocks[place]
        whole = campaign.recordings[k]
        name = whole.file if last - first == n[k] else _name(whole.file, taken)
        taken.add(name)
        recordings.append(_stretch(whole, name, first, last, min(first, length if whole.rotor == "free" else lead)))
        told.append(Excerpt(name, whole.file, first, last - first, n[k]))
    return replace(campaign, recordings=tuple(recordings), excerpts=Excerpts(tuple(told), sum(n)))


def farthest_first(marks: Array, sizes: Sequence[int], most: float) -> list[int]:
    """Return places of marks (n, features), each the farthest from those before it, while their sizes stay within most.

    The first is the one nearest to the mean of all.
    """
    out = [int(np.argmin(np.sum((marks - marks.mean(axis=0)) ** 2, axis=1)))]
    away = np.sum((marks - marks[out[0]]) ** 2, axis=1)
    left = most - sizes[out[0]]
    while away.max() > 0.0 and (size := sizes[int(np.argmax(away))]) <= left:
        out.append(int(np.argmax(away)))
        left -= size
        away = np.minimum(away, np.sum((marks - marks[out[-1]]) ** 2, axis=1))
    return out


def _name(file: str, taken: set[str]) -> str:
    """Return the next name of a stretch of a file that is not taken."""
    return next(name for k in itertools.count(1) if (name := segment_name(file, k)) not in taken)


def _blocks(rows: int, length: int) -> list[tuple[int, int]]:
    """Return first and last row of a recording's blocks, of about that length where there are as many rows.

    They begin at even rows, so that the halves of a PWM period stay what they are (double update).
    """
    bounds = np.linspace(0, rows, max(1, rows // length) + 1).astype(int)
    bounds[1:-1] -= bounds[1:-1] % 2
    return [(int(a), int(b)) for a, b in itertools.pairwise(bounds)]


def _marks(campaign: Campaign, place: int, length: int) -> Array:
    """Return what a recording's blocks are described by (blocks, features), in shares of rated values."""
    r, motor = campaign.recordings[place], campaign.drive.motor
    period = campaign.drive.converter.sampling_period
    (alpha, beta), (c, s) = r.current, (np.cos(r.theta), np.sin(r.theta))
    stands = 1.0 if r.rotor == "locked" else 0.0
    speed = np.gradient(np.unwrap(r.theta), period)
    base = motor.pole_pairs * motor.rated_speed_rpm * math.pi / 30.0
    link = campaign.drive.converter.dc_bus_voltage
    load = r.columns.get("load_torque", np.zeros(len(r.t)))
    signals = (
        (c * alpha + s * beta) / motor.rated_current, (c * beta - s * alpha) / motor.rated_current, speed / base,
        math.sqrt(3.0) * np.hypot(r.u_alpha, r.u_beta) / link, r.u_dc / link, load / motor.rated_torque, stands * c,
        stands * s,
    )  # fmt: skip
    cuts = _blocks(len(r.t), length)
    first, count = np.array([a for a, _ in cuts]), np.array([b - a for a, b in cuts])
    means = [np.add.reduceat(x, first) / count for x in signals]
    scatter = [np.sqrt(np.maximum(np.add.reduceat(x * x, first) / count - m * m, 0.0))
               for x, m in zip(signals[:-2], means, strict=False)]  # fmt: skip
    kind = KINDS * ("locked", "driven", "free").index(r.rotor) * np.ones(len(cuts))
    when = APART * (place + (first + 0.5 * count) / len(r.t)) / len(campaign.recordings)
    return np.stack([*means, *scatter, kind, when], axis=1)


def _lead(motor: Motor, period: float) -> int:
    """Return how many rows lead in, an even number."""
    return 2 * math.ceil(0.5 * LEAD * max(motor.inductance_d, motor.inductance_q) / motor.resistance / period)


def _stretch(r: CampaignRecording, name: str, first: int, last: int, lead: int) -> CampaignRecording:
    """Return rows first to last - 1 of a recording, after so many that lead in."""
    began = float(r.t[first] - r.t[0])
    own = {key: x[first:last].copy() for key, x in r.columns.items()}  # the long columns can go
    before = {key: x[first - lead : first].copy() for key, x in r.columns.items()} if lead else {}
    return replace(r, file=name, columns={**own, "t": own["t"] - own["t"][0]}, clock=r.clock + began, lead=before)
