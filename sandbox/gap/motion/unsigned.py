"""Whether the current of a motion lost its sign on the way into the log.

A current that is never negative is no mistake where the motor only drives.  Where the motion asks
for the other sense as well, the size of the current with the sign that the shaft's equation asks
for explains it far better than the current as it stands.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from model.array_types import Array
from sandbox.gap.motion.shaft import USUAL_WIDTH, Design, Nominal, Shaft, Terms, design_of, fitted
from sandbox.gap.motion.windows import Averages, averages
from sandbox.recordings.checks.shifts import SHIFTED
from sandbox.recordings.findings import Doubt, Finding
from sandbox.recordings.motion_log import MotionCampaign, MotionRecording

NEVER = 0.02  # of the largest torque: how far noise may take it to the other side
ROUNDS = 8  # of signs that the fit before asks for
TERMS = Terms(inertia=True, viscous=True)
FREE = Nominal(None, 0.0, 0.0, 0.0)


def unsigned(campaign: MotionCampaign) -> list[Finding]:
    """Return a finding where currents that are never negative explain the motion with a sign, as
    far as it can be told from row to row."""
    own = [r for r in campaign.recordings if not r.sixth]
    sizes = [(float(np.min(r.torque)), float(np.max(r.torque))) for r in own]
    if not own or any(not -low < NEVER * high for low, high in sizes):
        return []
    with np.errstate(all="ignore"):
        parts = [averages(r, campaign) for r in own]
        design = design_of(parts)
        terms = replace(TERMS, dry=USUAL_WIDTH * design.fastest)
        still = fitted(design, terms, FREE)
        sense = design.acceleration
        for _ in range(ROUNDS):
            signed = _with_sense(design, parts, own, sense)
            with_sign = fitted(signed, terms, FREE)
            sense = signed.torque - with_sign.residual
    if not _left(with_sign, signed) < SHIFTED * _left(still, design):
        return []
    r = own[0]
    name = r.source.get("i_q", r.source.get("torque", "the currents"))
    text = (
        f"{r.file}: column '{name}' is never negative, while the motion asks for either sense: "
        f"{100.0 * _left(still, design):.3g} % of the torque's variance is unexplained, "
        f"{100.0 * _left(with_sign, signed):.3g} % with a sign; log the current with its sign"
    )
    return [Doubt(r.file, "i_q", None, text)]


def _with_sense(
    design: Design, parts: list[Averages], own: list[MotionRecording], sense: Array
) -> Design:
    """Return the equations with each row's torque in the sense of the windows about it (n,)."""
    out, begun = [], 0
    for a, r in zip(parts, own, strict=True):
        count, rows = len(a.torque), np.arange(len(r.t))
        middle = a.place.mean(axis=1)
        sign = np.sign(np.interp(rows, middle, sense[begun : begun + count]))
        out.append(a.mean(sign * r.torque - r.load))
        begun += count
    return replace(design, torque=np.concatenate(out))


def _left(shaft: Shaft, design: Design) -> float:
    return float(np.mean(shaft.residual**2) / np.var(design.torque))
