"""Every check of a motion before it is fitted: the same levels as those of recordings with
voltages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from sandbox.gap.motion.load_side import ROWS, load_contradicted
from sandbox.gap.motion.mistakes import contradictions, inertia_contradicted
from sandbox.gap.motion.shifted import shifted
from sandbox.gap.motion.unexplained import unanswered
from sandbox.gap.motion.unsigned import unsigned
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.checks.motion import loads, standing
from sandbox.recordings.findings import Finding
from sandbox.recordings.motion_log import MotionCampaign, motion_of
from sandbox.recordings.preflight import NOTE, REFUSED, Noticed, on_the_way, refusals_first, tried
from sandbox.recordings.rows.held import HeldReadings, finding_of, held_over


def _old(campaign: MotionCampaign) -> list[Finding]:
    """Return what is held over some rows in a motion."""
    out = []
    for r in campaign.recordings:
        parts = {"theta": r.angle, "i_q": r.torque, **r.further}
        rows = {n: held_over(x) for n, x in parts.items() if not r.sixth and n in r.source}
        turned = float(np.max(np.abs(np.diff(r.angle)), initial=0.0))
        step = float(np.median(np.diff(r.t)))
        out += finding_of(r.file, rows, r.source, step, turned, even=False)
    return out


# a cause before its consequences
CHECKS = (standing, load_contradicted, unsigned, _old, shifted, contradictions, loads)


def _checks(found: Sequence[Finding]) -> Iterator[Callable[[MotionCampaign], Sequence[Finding]]]:
    """Yield the checks one after the other, none of a shift once readings are known to be old;
    found: grows between them."""
    for check in CHECKS:
        if check is not shifted or not any(isinstance(f, HeldReadings) for f in found):
            yield check


def noticed_in_motion(campaign: MotionCampaign) -> list[Noticed]:
    """Return all that is wrong, suspicious or changed in a campaign of motions."""
    out = on_the_way(campaign.findings)
    found = list[Finding]()
    for check in _checks(found):
        now = tried("", lambda check=check: check(campaign))  # type: ignore[misc]
        found += [n.finding for n in now]
        out += now
        if any(n.level == REFUSED for n in out):
            return refusals_first(out)
    return refusals_first([*out, *(Noticed(NOTE, f) for f in unanswered(campaign))])


def checked_motion(campaign: MotionCampaign) -> Sequence[Finding]:
    """Return what is suspicious in a campaign of motions; BadInput for the first thing that cannot
    be right."""
    found = list[Finding]()
    for check in _checks(found):
        found += check(campaign)
    return [*found, *unanswered(campaign)]


def shaft_contradicted(campaign: Campaign) -> list[Finding]:
    """Return what the shaft of free rotors contradicts in a campaign whose currents, voltages and
    angle agree: load, inertia and pole pairs; recordings of fewer than ROWS samples tell nothing of
    it."""
    free = tuple(
        r for r in campaign.recordings if r.rotor == "free" and r.made is None and len(r.t) >= ROWS
    )
    if not free:
        return []
    motion = motion_of(replace(campaign, recordings=free), "")
    return load_contradicted(motion) or inertia_contradicted(motion)
