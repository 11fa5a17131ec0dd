"""Whether the angle turns injected voltage to its axis, and which mistaken angle would."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import Columns, percent
from sandbox.recordings.checks.changes import ANGLE, angles, of_angle, source_of
from sandbox.recordings.findings import Finding, Refused

OFF_AXIS = 0.5  # excess of the injected energy along its axis: 30 degrees off
ON_AXIS = 0.9  # excess that undoing a mistake must reach: 13 degrees
AXES = (0.5 * math.pi, -0.5 * math.pi, math.pi)  # zeros that an injection's axis is tried with


def off_axis(recordings: Sequence[CampaignRecording], drive: Drive) -> None:
    """Raise BadInput where theta does not turn the injected voltage to its axis, but a mistaken
    theta would.

    This sees a wrong theta at locked rotor and low speed too, where the balance hardly depends on
    it.
    """
    for r in recordings:
        share = _share_on_axis(r.columns, drive, r.injection_axis)
        if share is None or share > OFF_AXIS:
            continue
        for zero, m in itertools.product((0.0, *AXES), [None, *angles(drive, source_of(r))]):
            turned = (1.0 if m is None else m.turn) * r.theta + zero
            after = _share_on_axis({**r.columns, "theta": turned}, drive, r.injection_axis)
            if after is not None and after > ON_AXIS:
                guess, remedy = of_angle(m, zero, source_of(r))
                text = (
                    f"{r.file}: row 0 of column 'theta' is {r.theta[0]:.6g}; turned by theta, only "
                    f"{percent(max(share, 0.0))} of the injected voltage lies along axis "
                    f"{r.injection_axis} (at least {percent(ON_AXIS)} expected), it does if "
                    f"{guess}: {remedy}"
                )
                raise Refused(Finding(r.file, "theta", 0, text, rereads=frozenset({ANGLE})))


def _share_on_axis(columns: Columns, drive: Drive, axis: str) -> float | None:
    """Return how much more of the ripple's energy lies along the axis than across it, of all; None
    without ripple."""
    n = max(round(1.0 / (drive.injection.frequency * drive.converter.sampling_period)), 2)
    u = columns["u_alpha"] + 1j * columns["u_beta"]
    whole = len(u) // n * n
    if axis == "none" or not whole:
        return None
    cut = u[:whole].reshape(-1, n)
    turned = (cut - cut.mean(axis=1, keepdims=True)).ravel() * np.exp(
        -1j * columns["theta"][:whole]
    )
    energy = float(np.sum(np.abs(turned) ** 2))
    if energy <= whole * (0.1 * drive.injection.amplitude) ** 2:
        return None
    return float(np.sum(turned**2).real) / energy * (1.0 if axis == "d" else -1.0)
