"""Seeded damage to the arrays in a file: other numbers, kinds and shapes, written as a whole file
again."""

from __future__ import annotations

import io
import random

import numpy as np

from tests.fuzz.mutations import damaged_bytes


def damaged_arrays(suffix):
    """Return what damages a flux map by its arrays as often as by its bytes."""

    def damage(content: bytes, chance: random.Random) -> bytes:
        """Return another file's content."""
        if chance.random() < 0.5:
            return damaged_bytes(content, chance)
        return odd_arrays(content, suffix, chance)

    return damage


def forged_arrays(content: bytes, chance: random.Random) -> bytes:
    """Return an .npz with odd arrays in it, its checksums right; seldom one whose bytes are
    damaged."""
    return (
        damaged_bytes(content, chance)
        if chance.random() < 0.05
        else odd_arrays(content, "npz", chance)
    )


def odd_arrays(content: bytes, suffix: str, chance: random.Random) -> bytes:
    """Return a file with one or two of its arrays replaced by odd ones."""
    from scipy.io import loadmat, savemat

    if suffix == "npz":
        with np.load(io.BytesIO(content)) as whole:
            arrays = dict(whole)
    else:
        arrays = {k: v for k, v in loadmat(io.BytesIO(content)).items() if not k.startswith("__")}
    for _ in range(chance.choice((1, 1, 2))):
        name = chance.choice(list(arrays))
        arrays[name] = _odd_array(arrays[name], chance)
    body = io.BytesIO()
    if suffix == "npz":
        np.savez(body, **arrays)
    else:
        savemat(body, arrays)
    return body.getvalue()


@np.errstate(all="ignore")  # that a number fits no smaller type is the damage
def _odd_array(a, chance):
    value = chance.choice((np.nan, np.inf, 0.0, 1e308, -1e3, 1e-300, 50.0))
    if not a.size or a.dtype.kind not in "fc":  # odd already
        return np.zeros((7, 7))
    changed = a.copy()
    changed.flat[chance.randrange(a.size)] = value
    whole = np.full(a.shape, value)
    if a.ndim == 0:
        return chance.choice(
            (whole, -a, 1e12 * a, 1e-12 * a, a[None], a.astype(str), np.zeros(0), a.astype(complex))
        )
    return chance.choice(
        (
            changed,
            changed,
            changed,
            whole,
            a[:2],
            a[..., :1],
            a.ravel(),
            a[None],
            -a,
            a.T.copy(),
            np.zeros(0),
            np.zeros((0, *a.shape[1:])),
            a.astype(str),
            a.astype(object),
            a.astype(bool),
            a.real.astype(np.float16),
            a.real.astype(np.int8),
            np.array(3.0),
            a.real.astype(complex),
            np.concatenate([a, a]),
            a[::-1],
            1e-12 * a,
            1e12 * a,
            a.real.astype(">f4"),
        )
    )
