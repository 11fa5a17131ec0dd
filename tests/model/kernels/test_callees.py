"""Vectors of 512 bits: for our own functions only, and the same numbers."""

import numba
import numpy as np

from model.compiled import kernel
from model.kernels.callees import WIDE


def orbit(x, v, n):
    """Go on with a pendulum in each lane."""
    for _ in range(n):
        for k in range(x.size):
            v[k] = 0.999 * v[k] - 0.01 * x[k] / (1.0 + x[k] * x[k])
            x[k] = x[k] + 0.01 * v[k]


def stepped(function):
    x, v = np.linspace(-1.0, 1.0, 24), np.linspace(2.0, 0.5, 24)
    function(x, v, 1000)
    return x, v


def test_wide_vectors_change_no_bit_and_are_ours_alone(monkeypatch, tmp_path):
    """Compiled here: code that is read back from a cache has no text that tells."""
    monkeypatch.setenv("SENSORLESS_CACHE", str(tmp_path))
    ours, plain = kernel(orbit), numba.njit(error_model="numpy")(orbit)
    for a, b in zip(stepped(ours), stepped(plain), strict=True):
        assert a.tobytes() == b.tobytes()
    said = [WIDE in text for f in (ours, plain) for text in f.inspect_llvm().values()]
    assert said == [True, False]
