"""What a motion's columns show by themselves: an angle that stands, a stuck encoder, another unit
of load or link."""

from __future__ import annotations

import numpy as np

from model.errors import BadInput
from sandbox.recordings.checks.plausibility import BEFORE, angle_step, runs
from sandbox.recordings.findings import Doubt, Finding, Refused
from sandbox.recordings.motion_log import OR_SPEED, MotionCampaign, MotionRecording

STANDS = 1e-9  # rad
MISSED = 0.5  # rad that the speed goes on while the angle stands
STOPPED = 20.0  # times the largest air-gap torque of the log: no brake does that between two rows
LOAD_OFF = 50.0  # times the largest air-gap torque: a unit


def standing(campaign: MotionCampaign) -> list[Finding]:
    """Return a finding for each angle that never changes; BadInput where none does."""
    still = [r for r in campaign.recordings if np.ptp(r.angle) < STANDS]
    if len(still) == len(campaign.recordings):
        raise BadInput(
            f"{_stands(still[0])}; check the encoder and the column that is "
            f"mapped{OR_SPEED}, or a counter of "
            'commutation steps (theta = {column = ..., unit = "rev", scale = 0.16667}: '
            "six steps an electrical turn)"
        )
    return [Doubt(r.file, "theta", 0, f"{_stands(r)}; correct 'rotor' if it stood") for r in still]


def loads(campaign: MotionCampaign) -> list[Finding]:
    """Return a finding for each load in another unit; BadInput for a stuck encoder."""
    for r in campaign.recordings:
        _stuck(r, campaign)
    return [f for r in campaign.recordings for f in _load(r)]


def _stands(r: MotionRecording) -> str:
    name = r.source.get("theta", "theta")
    return f"{r.file}: column '{name}' ('theta') never changes while rotor = 'free'"


def _stuck(r: MotionRecording, campaign: MotionCampaign) -> None:
    """Raise BadInput for an angle that stands while the log's speed goes on, or that stops as no
    torque could."""
    if np.ptp(r.angle) < STANDS:
        return
    h, able = np.diff(r.t), float(np.max(np.abs(r.torque)))
    count = max(campaign.count, angle_step(r.angle))
    for begin, end in runs(r.angle):
        went = (
            abs(float(np.sum(r.further["speed"][begin : end - 1] * h[begin : end - 1])))
            if "speed" in r.further
            else 0.0
        )
        needed = _speed_before(r, begin, count) / h[begin - 1] * (campaign.inertia or 0.0)
        if went > MISSED + 2.0 * count or needed > STOPPED * able > 0.0:
            why = (
                f"the log's speed makes {went:.3g} rad of it"
                if went > MISSED
                else f"to stop so would take {needed:.3g} N m"
            )
            name = r.source.get("theta", r.source.get("speed", "theta"))
            at = f"{r.file}: row {begin} of column '{name}' and {end - begin - 1} rows after it are"
            text = (
                f"{at} the same though {why}; the encoder is stuck, or the log repeats it: repair "
                "it or leave the recording out"
            )
            if "theta" not in r.source and "speed" in r.source:
                text = (
                    f"{at} zero though {why}; no speed was measured there: cut the log there, or "
                    "record the speed throughout"
                )
            raise Refused(Finding(r.file, "theta", begin, text))


def _speed_before(r: MotionRecording, row: int, count: float) -> float:
    """Return how fast (rad/s) an angle moves at least in the BEFORE rows before one, whose readings
    step by count."""
    first = max(row - BEFORE, 0)
    moved = abs(float(r.angle[row] - r.angle[first])) - count
    return max(moved, 0.0) / float(r.t[row] - r.t[first]) if row else 0.0


def _load(r: MotionRecording) -> list[Finding]:
    """Return a finding where the load is far beyond what the currents give."""
    able, load = float(np.max(np.abs(r.torque))), np.abs(r.load)
    k = int(np.argmax(load))
    if not 0.0 < LOAD_OFF * able < load[k]:
        return []
    text = (
        f"{r.file}: row {k} of column '{r.source.get('load_torque', 'load_torque')}' is "
        f"{r.load[k]:.6g} N m, the "
        f'currents give {able:.3g} N m at most; is it in mN m? map it with unit = "mNm"'
    )
    return [Doubt(r.file, "load_torque", k, text)]
