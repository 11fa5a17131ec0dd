"""MAT files: what SciPy writes is read as SciPy reads it; damaged lengths are refused."""

from __future__ import annotations

import random
import struct
import zlib

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from model.matfile import Damaged, read_mat
from tests.data import real_data
from tests.fuzz.mutations import damaged_bytes

RNG = np.random.default_rng(1)
ARRAYS = {
    "x": RNG.normal(size=(5, 3)),
    "row": np.arange(4.0),
    "z": RNG.normal(size=(2, 2)) * (1 + 2j),
    "empty": np.zeros((0, 3)),
    "one": 5.0,
    "single": RNG.normal(size=4).astype("f4"),
    "deep": RNG.normal(size=(2, 3, 4)),
    "yes": np.array([True, False]),
    **{
        f"{kind}{n}": np.arange(-3 if kind == "i" else 0, 7).astype(f"{kind}{n}")
        for kind in "iu"
        for n in (1, 2, 4, 8)
    },
}
MAX_BYTES = 10_000_000


@pytest.mark.parametrize("packed", [False, True])
def test_numbers_are_read_as_scipy_reads_them(packed, tmp_path):
    other = {
        "text": "hello",
        "cells": np.array([1, "a"], dtype=object),
        "log": {"i_a": np.arange(3.0), "in": {"u": 2.0}},
    }
    savemat(tmp_path / "m.mat", {**ARRAYS, **other}, do_compression=packed)
    found, known = read_mat(tmp_path / "m.mat", MAX_BYTES), loadmat(tmp_path / "m.mat")
    assert set(found) == {*ARRAYS, "log.i_a", "log.in.u"}
    for name in ARRAYS:
        np.testing.assert_array_equal(found[name], known[name])
        assert found[name].dtype == (np.complex128 if name == "z" else np.float64)
    np.testing.assert_array_equal(found["log.i_a"].ravel(), [0.0, 1.0, 2.0])
    assert found["log.in.u"] == 2.0


def structures(names):
    """Return an array of structures with a Name, Data and a structure of their own."""
    out = np.empty((1, len(names)), dtype=[("Name", object), ("Data", object), ("more", object)])
    for k, name in enumerate(names):
        out[0, k] = (name, np.arange(3.0) + k, {"x": float(k)})
    return out


@pytest.mark.parametrize("packed", [False, True])
def test_structures_in_an_array_are_signals_by_their_name_or_numbered(packed, tmp_path):
    """Texts in SciPy's three ways: bytes, UTF-8, UTF-16; a name used twice, an empty one, and one
    of two lines tell nothing."""
    names = ["i_a", "\u03c8", "twice", "twice", "", "two\nlines"]
    savemat(tmp_path / "m.mat", {"log": {"Y": structures(names)}}, do_compression=packed)
    found = read_mat(tmp_path / "m.mat", MAX_BYTES)
    assert set(found) == {
        "i_a",
        "\u03c8",
        *(f"log.Y({k}).{n}" for k in (3, 4, 5, 6) for n in ("Data", "more.x")),
    }
    np.testing.assert_array_equal(found["i_a"].ravel(), np.arange(3.0))
    np.testing.assert_array_equal(found["\u03c8"].ravel(), np.arange(3.0) + 1)
    np.testing.assert_array_equal(found["log.Y(4).Data"].ravel(), np.arange(3.0) + 3)
    assert found["log.Y(4).more.x"] == 3.0


def test_a_measured_map_is_read_as_scipy_reads_it():
    path = real_data() / "baldor_pmsyrm" / "ABB_400rpm_map.mat"
    found, known = read_mat(path, MAX_BYTES), loadmat(path)
    numbers = {n for n, a in known.items() if not n.startswith("__") and a.dtype.kind in "fiuc"}
    assert numbers <= set(found)
    for name in numbers:
        np.testing.assert_array_equal(found[name], known[name])


@pytest.mark.parametrize("packed", [False, True])
def test_damage_is_refused_or_harmless(packed, tmp_path):
    """Every refusal is `Damaged`; what is read is never larger than its file can hold."""
    path = tmp_path / "m.mat"
    arrays = {
        "x": ARRAYS["x"],
        "z": ARRAYS["z"],
        "log": {"i_a": np.arange(9.0)},
        "Y": structures(["a", "b"]),
    }
    savemat(path, arrays, do_compression=packed)
    whole, kinds = path.read_bytes(), set()
    for k in range(1500):
        path.write_bytes(damaged_bytes(whole, random.Random(k)))
        try:
            found = read_mat(path, MAX_BYTES)
            assert sum(a.nbytes for a in found.values()) <= 16 * 1100 * len(
                path.read_bytes()
            )  # zlib: 1 to 1032 at most
            kinds.add("read")
        except Damaged:
            kinds.add("refused")
    assert kinds == {"read", "refused"}


def test_a_small_file_does_not_unpack_to_a_large_one(tmp_path):
    bomb = zlib.compress(b"\0" * 50_000_000)
    header = b"MATLAB 5.0".ljust(124) + b"\x00\x01IM"
    (tmp_path / "m.mat").write_bytes(header + struct.pack("<II", 15, len(bomb)) + bomb)
    with pytest.raises(Damaged, match="larger than can be read"):
        read_mat(tmp_path / "m.mat", MAX_BYTES)


def test_other_versions_are_named(tmp_path):
    savemat(tmp_path / "m.mat", {"x": np.arange(50.0)}, format="4")
    with pytest.raises(Damaged, match="save it with save"):
        read_mat(tmp_path / "m.mat", MAX_BYTES)
    (tmp_path / "m.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(600))
    with pytest.raises(Damaged, match=r"7\.3"):
        read_mat(tmp_path / "m.mat", MAX_BYTES)
