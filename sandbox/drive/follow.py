"""An estimator that watches samples recorded earlier, and controls nothing."""

from __future__ import annotations

from numba import types

from estimators.contract import BELIEF, STATE, STEP, TUNING, Sample
from model.compiled import kernel_as

FOLLOW = types.void(types.FunctionType(STEP), STATE, types.float64[:, ::1], BELIEF, TUNING, types.float64[::1])


@kernel_as(FOLLOW)
def follow(step, state, samples, belief, tuning, out):
    """Hand samples (n, 5), in the order of `Sample`, to a compiled estimator; write its angles (rad) to out (n,)."""
    for k in range(len(samples)):
        s = samples[k]
        out[k] = step(state, Sample(s[0], s[1], s[2], s[3], s[4]), belief, tuning).theta
