"""An estimator that watches samples recorded earlier, and controls nothing."""

from __future__ import annotations

from typing import Any

import numba
from numba import types

from estimators.contract import ESTIMATE, SAMPLE, STATE, TUNING, Belief, Estimator, as_sample
from model.compiled import compiled_as


def _follow(step, state, samples, belief, tuning, out):
    for k in range(len(samples)):
        out[k] = step(state, as_sample(samples[k]), belief, tuning).theta


def follow(
    estimator: Estimator, state: Any, samples: Any, belief: Belief, tuning: Any, out: Any
) -> None:
    """Hand samples (n, 5), in the order of `Sample`, to a compiled estimator; write its angles
    (rad) to out (n,).

    The kernel is compiled when a kind of belief (quartic, flux map) is first asked for.
    """
    kind = numba.typeof(belief)
    step = types.FunctionType(ESTIMATE(STATE, SAMPLE, kind, TUNING))
    signature = types.void(step, STATE, types.float64[:, ::1], kind, TUNING, types.float64[::1])
    compiled_as(signature, _follow)(estimator.step_for(belief), state, samples, belief, tuning, out)
