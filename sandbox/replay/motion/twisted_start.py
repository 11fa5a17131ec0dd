"""A compliant shaft that turns at the first sample: how far it is twisted there, and how fast that
changes, nobody has read.

Both add a shape to a recording's innovations, which rings down.  Their sizes are integrated out:
Gaussian, about the twist that the load makes, with the deviation of what the rated torque makes
(and the slip at which that swings).  Innovations y become y - C (C'C + 1)^-1 C'y, C the shapes of
one deviation: what the most probable start leaves.  The determinant that belongs to the evidence
is left out: some nats a recording, for all sets with a compliant shaft alike.

Shapes are told from shafts without torque that start a deviation beside each other.  A gap counts
as closed in them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from model.array_types import Array


def without_start(moved: Array, start: Any, rated: float, turn: Callable[[Any], Array]) -> None:
    """Take off innovations (n, lanes) what the start of compliant shafts adds to them.

    start: states of the lanes at the first sample; rated: the motor's torque, N m; turn: returns
    innovations (n, lanes) of shafts that start with given states, without torque.
    """
    rate = start["swing_rate"]
    compliant = rate > 0.0
    own = np.where(compliant, rate, 1.0)
    size = compliant * rated * (start["motor_inv"] + start["load_inv"]) / own**2
    found = []
    for twist, slip in ((0.0, 0.0), (size, 0.0), (0.0, size * own)):
        w = start.copy()
        w["backlash"] = 0.0
        w["twist"] += twist
        w["slip"] += slip
        found.append(turn(w))
    for j in np.flatnonzero(compliant):
        c = np.stack([x[:, j] - found[0][:, j] for x in found[1:]], axis=1)
        moved[:, j] -= c @ np.linalg.solve(c.T @ c + np.eye(2), c.T @ moved[:, j])
