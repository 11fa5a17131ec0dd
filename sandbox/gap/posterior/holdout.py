"""Which recordings are held out.

Slopes decide, residuals do not: of all choices of one recording a kind of rotor
(two where there are five), the one after which no effect has lost much of what the campaign can say
about it, while the recordings held out still feel every effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np

from model.array_types import Array
from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.posterior.linear_model import LinearModel

CHANNELS = ("current", "motion", "angle")
# at most, each costs some milliseconds: of many recordings of a kind some, spread evenly, are tried
CHOICES = 500
# a held-out recording needs to feel an effect only so many times less than the fitted ones
FELT = 4.0
SAME = 9  # digits to which two shares are the same: sums of other order round the last ones


def weights_of(recordings: int, left_out: Sequence[int] = ()) -> dict[tuple[int, str], float]:
    """Return weight 1 for every channel of every recording but those left out."""
    return {(k, c): 1.0 for k in range(recordings) if k not in left_out for c in CHANNELS}


def choices(rotors: Sequence[str]) -> list[tuple[int, ...]]:
    """Return the choices of recordings to hold out, at most CHOICES; () where every kind is there
    only once."""
    kinds = [
        [k for k, r in enumerate(rotors) if r == kind] for kind in ("locked", "driven", "free")
    ]
    options = [_of_kind(own) for own in kinds]
    sizes = [len(own) for own in kinds]
    while math.prod(len(o) for o in options) > CHOICES:
        k = max(range(len(kinds)), key=lambda k: len(options[k]))
        sizes[k] -= 1
        some = [kinds[k][round(i)] for i in np.linspace(0, len(kinds[k]) - 1, sizes[k])]
        options[k] = _of_kind(some, len(options[k][0]))
    return [tuple(sorted(k for part in parts for k in part)) for parts in product(*options)]


def _of_kind(own: Sequence[int], left_out: int | None = None) -> list[tuple[int, ...]]:
    """Return the choices among recordings of one kind; left_out: how many of them, two of five and
    more by default."""
    if left_out is None:
        left_out = (2 if len(own) >= 5 else 1) if len(own) >= 2 else 0
    return list(combinations(own, left_out))


def held_out(model: LinearModel) -> tuple[int, ...]:
    """Return the recordings (places in the campaign) to hold out; () where there are too few to
    spare any.

    model: the equations of all effects beside ordinary deviations alone.
    """
    options = choices([r.rotor for r in model.point.prepared.recordings])
    if options == [()]:
        return ()
    own = [k for k, c in enumerate(model.coordinates) if not model.of_effects[k] and not c.of_point]
    own += [k for members in model.members.values() for k in members]
    known = Information.of(model.normal)
    places = known.felt([model.coordinates[k].label for k in own])
    return max(options, key=lambda left: known.kept(left, places))


@dataclass(frozen=True)
class Information:
    """What each recording says about coordinates, A (r, p, p), their prior deviations (p,) and
    labels (p,); whole (p, p): of all recordings."""

    by_recording: Array
    deviation: Array
    labels: Sequence[str]
    whole: Array

    @classmethod
    def of(cls, n: NormalEquations) -> Information:
        """Return that of normal equations."""
        p = len(n.coordinates)
        out = np.zeros((1 + max(s.recording for s in n.segments), p, p))
        for s in n.segments:
            out[s.recording][np.ix_(s.places, s.places)] += s.a.sum(0)
        deviation = np.array([c.deviation for c in n.coordinates])
        return cls(out, deviation, [c.label for c in n.coordinates], out.sum(axis=0))

    def felt(self, labels: Sequence[str]) -> list[int]:
        """Return the places of coordinates that all recordings together tell better than their
        priors do."""
        place = {label: k for k, label in enumerate(self.labels)}
        tells = np.diag(self.whole) * self.deviation**2 > 1.0
        return sorted({place[label] for label in labels if tells[place[label]]})

    def kept(self, left: Sequence[int], places: Sequence[int]) -> tuple[float, ...]:
        """Return the shares of information about coordinates at `places` that fit and check keep
        where recordings `left` are held out, the smallest first: of two choices with the same
        smallest share the next one decides, not the order of recordings.

        Fit: variance with all recordings over variance without those left out; check: A of those
        left out over all A.
        """
        if not places:
            return ()
        kept = np.delete(self.by_recording, left, axis=0).sum(axis=0)
        prior = np.diag(self.deviation**-2.0)
        narrow = np.diag(self._covariance)[places]
        wide = np.diag(np.linalg.inv(kept + prior))[places]
        felt = FELT * (1.0 - np.diag(kept)[places] / np.diag(self.whole)[places])
        return tuple(np.sort(np.round(np.minimum(narrow / wide, felt), SAME)).tolist())

    @cached_property
    def _covariance(self) -> Array:
        """Covariance with all recordings."""
        return np.asarray(np.linalg.inv(self.whole + np.diag(self.deviation**-2.0)))
