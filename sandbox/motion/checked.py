"""Every check of a motion before it is fitted: the same levels as those of recordings with voltages."""

from __future__ import annotations

from collections.abc import Sequence

from sandbox.motion.mistakes import contradictions
from sandbox.recordings.campaign import Finding
from sandbox.recordings.checks.motion import loads, standing
from sandbox.recordings.motion_log import MotionCampaign
from sandbox.recordings.preflight import REFUSED, Noticed, on_the_way, refusals_first, tried

CHECKS = (standing, contradictions, loads)  # a cause before its consequences


def noticed_in_motion(campaign: MotionCampaign) -> list[Noticed]:
    """Return all that is wrong, suspicious or changed in a campaign of motions."""
    out = on_the_way(campaign.findings)
    for check in CHECKS:
        out += tried("", lambda check=check: check(campaign))  # type: ignore[misc]
        if any(n.level == REFUSED for n in out):
            break
    return refusals_first(out)


def checked_motion(campaign: MotionCampaign) -> Sequence[Finding]:
    """Return what is suspicious in a campaign of motions; BadInput for the first thing that cannot be right."""
    return [f for check in CHECKS for f in check(campaign)]
