"""Do the current sensors' offsets differ from recording to recording?  Then the differences are
taken off first.

An effect has one value for a campaign, and so has an offset; but sensors warm up, and recordings
are made on two days. A machine or an inverter moves the current with the rotor; over whole turns of
it a constant in a phase's readings is its sensor's, whatever else the model misses.  It is known to
the scatter of its turns, far better than any prior of it, so the readings are corrected by it: one
number a sensor and turning recording, about the
recordings' median, which stays as the campaign's own offset.  A sensor that reads one half of a
wave too small has a constant, too, which grows with the current; its even harmonics tell it.  What
locked rotors read says nothing of an offset and stays.

Three readings of a star sum to zero, while one sensor of three that is off has a sum.  What all
three have in common, a third of the sum, is therefore nobody's current, and no effect has it; it is
taken off every recording, with a locked rotor as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from model.array_types import Array
from model.effects.said import quantity
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import whole_turns
from sandbox.plant.sets import BENCH, ORDINARY
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.replay import Residual

FEWEST = 4  # whole turns of a recording
PER_TURN = 12  # samples a turn needs
SURE = 5.0  # standard errors
# squares of even harmonics over those of the offset: a half wave that a sensor cuts has 0.22
EVEN = 0.1
NAMED = 3  # recordings whose offsets a sentence holds
SENSORS = ("i_a", "i_b", "i_c")
NONE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Drifting:
    """By recording what (A) was taken off each sensor: how far its offset lies beside the median of
    turning recordings, with what all sensors have in common; and its standard error (A); seen: the
    recordings whose turns tell."""

    offsets: Mapping[str, tuple[float, float, float]]
    errors: Mapping[str, float]
    common: float = 0.0
    seen: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Return it as sentences, with what to do."""
        return " ".join(filter(None, (self.text_of_sum, self._text_of_differences())))

    @property
    def text_of_sum(self) -> str:
        """Return as a sentence what all sensors have in common; empty where that is nothing."""
        if not self.common:
            return ""
        return (
            f"The three current readings have a mean sum of {quantity(3.0 * self.common, 'A')}, "
            "which currents of a star cannot have: an offset of their sensors. A third of it, "
            f"{quantity(self.common, 'A')}, was taken off each reading before anything else; add "
            "it to the offsets that are named."
        )

    @property
    def named(self) -> str:
        """Return the sensor whose offset differs most, and what it reads in which recording beside
        the median; empty where none differs."""
        sizes = np.array(list(self.offsets.values())) - self.common
        sensor = int(np.argmax(np.ptp(sizes, axis=0)))
        if not np.ptp(sizes[:, sensor]) > 0.0:
            return ""
        each = [(x[sensor], file) for file, x in zip(self.offsets, sizes, strict=True)]
        ranked = sorted(each, key=lambda x: x[0])
        shown = ranked if len(ranked) <= NAMED else [ranked[0], ranked[-1]]
        said = ", ".join(f"{quantity(x, 'A')} in {file}" for x, file in shown)
        return f"sensor {'abc'[sensor]} reads {said}"

    def _text_of_differences(self) -> str:
        if not self.named:
            return ""
        within = quantity(2.0 * max(self.errors.values()), "A")
        return (
            "The offsets of current sensors differ from recording to recording: "
            f"{self.named} beside their median, within {within}. This was taken "
            "off before anything else; measure offsets at rest before each recording."
        )

    def differs(self, file: str) -> tuple[float, float, float]:
        """Return what was taken off a recording beside what all sensors have in common (A)."""
        if file not in self.offsets:
            return NONE
        a, b, c = self.offsets[file]
        return a - self.common, b - self.common, c - self.common

    def and_then(self, new: Drifting) -> Drifting:
        """Return both together: what is found beside what was taken off already."""
        files = {**self.offsets, **new.offsets}
        both = {
            f: np.add(self.offsets.get(f, NONE), new.offsets.get(f, NONE)).tolist() for f in files
        }
        return Drifting(
            {f: (a, b, c) for f, (a, b, c) in both.items()},
            {**self.errors, **new.errors},
            self.common + new.common,
            tuple(dict.fromkeys([*self.seen, *new.seen])),
        )

    def put_back(self) -> Drifting:
        """Return what puts the differences between recordings into readings again."""
        own = {f: self.differs(f) for f in self.seen}
        return Drifting({f: (-a, -b, -c) for f, (a, b, c) in own.items()}, self.errors)

    def as_json(self) -> list[dict[str, Any]]:
        """Return one row a recording."""
        return [
            {
                "file": file,
                **dict(zip(SENSORS, x, strict=True)),
                "standard_error": self.errors[file],
            }
            for file, x in self.offsets.items()
        ]


def drifting(
    point: ParameterPoint, shown: Sequence[Residual], known: Drifting | None = None
) -> Drifting | None:
    """Return what the offsets of a campaign's recordings differ by and what all sensors have in
    common; None where nothing differs surely and nothing in common is more than ordinary.

    shown: the residuals at a point; known: what was taken off already: the answer is what to take
    off beside it, however small."""
    turns: dict[str, list[Array]] = {}
    for r, x in zip(point.prepared.recordings, shown, strict=True):
        if r.rotor != "locked":
            turns.setdefault(r.of or r.file, []).extend(
                _by_turn(r.motion.angle, x.current[:, :, 0])
            )
    own = {file: np.array(x) for file, x in turns.items() if len(x) >= FEWEST}
    if not own:
        return None
    noise_std = point.prepared.noise_std
    means = np.array([noise_std * x[:, 0].mean(axis=0) for x in own.values()])
    errors = np.array(
        [noise_std * x[:, 0].std(axis=0, ddof=1).max() / math.sqrt(len(x)) for x in own.values()]
    )
    even = np.array([noise_std**2 * np.sum(x[:, 1:].mean(axis=0) ** 2) / 2.0 for x in own.values()])
    gone = np.array([known.differs(file) if known else NONE for file in own])
    middle = np.median(means + gone, axis=0)
    apart = means + gone - middle - gone
    usual = _usual(point.prepared.campaign)
    least = 0.0 if known else ORDINARY * usual  # of what is common to all recordings
    if not np.any(np.max(np.abs(apart), axis=1) > SURE * errors):
        apart = np.zeros_like(apart)
    common = float(np.median(means.mean(axis=1)))
    if not abs(common) > max(least / math.sqrt(3.0), SURE * float(np.max(errors))):
        common = 0.0
    size = float(np.sum((apart + common) ** 2))
    if size == 0.0 or float(even.sum()) > EVEN * size:
        return None
    offsets = {
        file: (float(a), float(b), float(c))
        for file, (a, b, c) in zip(own, apart + common, strict=True)
    }
    scatter = dict(zip(own, errors.tolist(), strict=True))
    if common:  # what stands still has it, too
        for whole in point.prepared.campaign.recordings:
            offsets.setdefault(whole.origin, (common, common, common))
            scatter.setdefault(whole.origin, float(np.max(errors)))
    return Drifting(offsets, scatter, common, tuple(own))


def _usual(campaign: Campaign) -> float:
    """Return the ordinary standard deviation (A) of one sensor's offset."""
    ordinary = BENCH["bench.common_offset"].ordinary
    return 0.0 if ordinary is None else campaign.deviation_of(ordinary, 0.0) / ordinary.share


def steadied(campaign: Campaign, found: Drifting) -> Campaign:
    """Return a campaign without what its recordings' offsets differ by."""
    return without_offsets(campaign, found.offsets)


def without_offsets(
    campaign: Campaign, offsets: Mapping[str, tuple[float, float, float]]
) -> Campaign:
    """Return a campaign without what its recordings' currents read too much (A, by file)."""
    recordings = tuple(_without(r, offsets.get(r.origin)) for r in campaign.recordings)
    return replace(campaign, recordings=recordings)


def _without(r: CampaignRecording, offsets: Sequence[float] | None) -> CampaignRecording:
    """Return a recording whose readings of currents are less by offsets (A)."""
    if offsets is None:
        return r
    own = {name: r.columns[name] - x for name, x in zip(SENSORS, offsets, strict=True)}
    before = {
        name: r.settling[name] - x
        for name, x in zip(SENSORS, offsets, strict=True)
        if name in r.settling
    }
    return replace(r, columns={**r.columns, **own}, settling={**r.settling, **before})


def _by_turn(angle: Array, residual: Array) -> list[Array]:
    """Return of each whole turn the mean over the angle of residuals (n, 3), and their second and
    fourth harmonics' cosines and sines: (5, 3) each."""
    found = []
    for a, b in whole_turns(angle, PER_TURN, 1.0):
        weight = np.abs(np.gradient(angle[a:b]))
        waves = [np.ones(b - a)]
        for order in (2.0, 4.0):
            waves += [2.0 * np.cos(order * angle[a:b]), 2.0 * np.sin(order * angle[a:b])]
        found.append((np.array(waves) * weight) @ residual[a:b] / weight.sum())
    return found
