"""How probable it is that offsets which differ between recordings are an effect, and no ordinary
deviation.

Both say that a recording's offset is drawn about the campaign's: ordinary ones with the deviation
that the campaign states, those of an effect with that of its wide prior, averaged over sizes as for
any effect.  What is common to all recordings is the campaign's own offset and free here.  The odds
before the data are those of one more effect.
"""

from __future__ import annotations

import math

import numpy as np

from model.array_types import Array
from model.effects import library
from sandbox.gap.evidence.priors import WIDE
from sandbox.gap.posterior.sets import log_prior
from sandbox.gap.settings import USUAL, Settings
from sandbox.gap.unstated.drifting import Drifting
from sandbox.recordings.campaign import Campaign


def chance_of_effect(found: Drifting, campaign: Campaign, settings: Settings = USUAL) -> float:
    """Return the probability that what offsets of recordings differ by is more than ordinary."""
    card, drive = library.drifting(), campaign.drive
    offset = card.parameters[0]
    assert offset.ordinary is not None
    usual = campaign.deviation_of(offset.ordinary, 0.0)
    wide = WIDE * offset.reach_for(drive.motor, drive.converter)
    a, b, c = np.array([found.differs(file) for file in found.seen]).T
    vectors = np.stack([(2.0 * a - b - c) / 3.0, (b - c) / math.sqrt(3.0)])
    errors = np.array([found.errors[file] for file in found.seen])
    sized = [
        log_likelihood(vectors, np.hypot(errors, math.hypot(usual, s * wide)))
        for s in settings.sizes
    ]
    odds = float(np.logaddexp.reduce(sized)) - math.log(len(sized))
    odds -= log_likelihood(vectors, np.hypot(errors, usual))
    odds += log_prior((card.name,), settings) - log_prior((), settings)
    return float(0.5 * (1.0 + math.tanh(0.5 * odds)))


def log_likelihood(vectors: Array, deviations: Array) -> float:
    """Return the log likelihood of offsets (2, n) about one that is free and common to all, each
    with a deviation (n,), up to a constant."""
    weight = deviations**-2
    apart = vectors - (vectors @ weight / weight.sum())[:, None]
    one = np.log(weight).sum() - math.log(weight.sum())
    return float(0.5 * len(vectors) * one - 0.5 * np.sum(apart**2 @ weight))
