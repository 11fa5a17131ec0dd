"""How much of a motion's torque its shaft leaves unexplained, whatever inertia and frictions are.

A log of one steady speed, or of cogging alone, leaves most of it, so this is said and no more; much
is told by it beside the same log with columns exchanged.
"""

from __future__ import annotations

import numpy as np

from sandbox.gap.motion.shaft import USUAL_WIDTH, Nominal, Terms, design_of, fitted
from sandbox.gap.motion.windows import averages
from sandbox.recordings.checks.balance import UNDISTURBED, percent
from sandbox.recordings.findings import Finding, Unanswered
from sandbox.recordings.motion_log import MotionCampaign

FREE = Nominal(None, 0.0, 0.0, 0.0)


def unexplained(campaign: MotionCampaign) -> float:
    """Return the share of the torque's variance that an inertia, frictions, a constant and a lag
    leave, all of them free; 1 where nothing can be fitted."""
    with np.errstate(all="ignore"):
        design = design_of([averages(r, campaign) for r in campaign.recordings])
        signals = (design.torque, design.acceleration, design.slope, design.speed)
        if not all(np.all(np.isfinite(x)) for x in signals) or not np.ptp(design.torque) > 0.0:
            return 1.0
        terms = Terms(inertia=True, viscous=True, dry=USUAL_WIDTH * design.fastest, lag=True)
        left = fitted(design, terms, FREE).residual
    return float(np.var(left) / np.var(design.torque))


def unanswered(campaign: MotionCampaign) -> list[Finding]:
    """Return a finding where more of the torque is unexplained than UNDISTURBED."""
    share, r = unexplained(campaign), campaign.recordings[0]
    if share <= UNDISTURBED:
        return []
    name = r.source.get("i_q", r.source.get("torque", "the currents"))
    text = (
        f"{r.file}: column '{name}': {percent(share)} of what the torque changes by is unexplained "
        f"by inertia, frictions and a lag (at most {percent(UNDISTURBED)} is usual where the speed "
        "changes; a steady speed and cogging leave more): let the speed change more, or look at "
        "what is mapped as angle, time and current"
    )
    return [Unanswered(r.file, "i_q", None, text)]
