"""What a campaign does not state and a fit's residual tells: it is stated from then on, and the fit
made again.

Neither is an effect that a person would look for behind a gap, and neither is free: counts predict
what rounding adds whole, offsets of turning recordings are known to the scatter of their turns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sandbox.gap.evidence.fit import Fit, keeps_more, rms_of
from sandbox.gap.evidence.misfit import misfit
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.settings import Settings
from sandbox.gap.unstated.drifting import Drifting, drifting, steadied
from sandbox.gap.unstated.pwm_counts import Counted, log_prior, pwm_counts, sure, with_counts
from sandbox.recordings.campaign import Campaign
from sandbox.replay.map_error import same_map
from sandbox.replay.replay import prepare
from sandbox.replay.unread_start import with_starts_of


@dataclass(frozen=True)
class Unstated:
    """What was found, None where nothing was: counts that duties are rounded to, and what offsets
    of recordings differ by."""

    counts: Counted | None = None
    drifting: Drifting | None = None

    def __bool__(self) -> bool:
        return self.counts is not None or self.drifting is not None

    def and_then(self, new: Unstated) -> Unstated:
        """Return both, what is new beside what was known."""
        drifts = self.drifting.and_then(new.drifting) if self.drifting and new.drifting else None
        return Unstated(new.counts or self.counts, drifts or new.drifting or self.drifting)

    def in_campaign(self, campaign: Campaign) -> Campaign:
        """Return a campaign that states it: duties rounded to the counts, offsets taken off."""
        if self.counts is not None:
            campaign = replace(campaign, drive=with_counts(campaign.drive, self.counts.value))
        return campaign if self.drifting is None else steadied(campaign, self.drifting)

    def at(self, point: ParameterPoint) -> ParameterPoint:
        """Return a point of the campaign that states it."""
        old = point.prepared
        new = prepare(self.in_campaign(old.campaign), old.base, steps=old.steps)
        new = replace(new, noise_std=old.noise_std, colour=old.colour, spare=old.spare)
        return replace(point, prepared=with_starts_of(same_map(new, old), old))


NOTHING = Unstated()


def unstated(
    found: Fit, known: Unstated, settings: Settings, *, excerpts: bool = False
) -> Unstated:
    """Return what a fit's residual tells that is not known yet.  Counts are looked for where one
    recording has more than noise.  Offsets are looked for again beside
    counts, as rounding shifts the means of turns, but not in excerpts, as the whole recordings have
    more turns."""
    point = found.point
    own = point.prepared.recordings
    # readings that hold a replay take their offsets along
    seen = not excerpts and not any(r.hold for r in own)
    drifts = drifting(point, shown(point), known.drifting) if seen else None
    looked = known.counts is None and drifts is None and keeps_more(found, settings.gap)
    return Unstated(pwm_counts(point) if looked else None, drifts)


def confirmed(before: Fit, after: Fit, new: Unstated) -> bool:
    """Return whether what was found holds for a fit, made again to the campaign that states it:
    less is left, and with counts so much less that they are still sure.

    Far from the noise a number of counts may resemble what something else leaves, of which other
    parameters then take nothing back.
    """
    if rms_of(after) >= rms_of(before):
        return False
    if new.counts is None:
        return True
    variance = misfit(after.point)
    gained = sum(
        (float(old.ssr.sum()) - float(own.ssr.sum())) / variance[own.recording, own.channel]
        for old, own in zip(before.normal.segments, after.normal.segments, strict=True)
    )
    return sure(log_prior(np.array([new.counts.value])) + 0.5 * gained)
