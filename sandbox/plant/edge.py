"""How late edges can be in a batch."""

from __future__ import annotations

from model.compiled import kernel
from sandbox.plant import ports


@kernel
def latest(w):
    """Return the latest (s) that any edge of any lane can act: the port's value at full current of either sign."""
    most = 0.0
    for j in range(w.psi_a.size):
        for sign in (-1.0, 1.0):
            for side in (-1.0, 1.0):
                most = max(most, ports.edge(w, j, sign, side))
    return most
