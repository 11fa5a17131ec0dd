"""Arrays of numbers from .npz, .mat and .csv files of others: nothing in them is run, nothing too large is read.

Pickled objects, texts and structures are passed over.  Sizes are read from the headers before any data are.
"""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from model.matfile import read_mat

MOST_BYTES = {".npz": 256_000_000, ".mat": 64_000_000, ".csv": 32_000_000}  # of a file; of an .npz only part is read
NUMBERS = "fiuc"  # kinds of NumPy arrays that are read

Arrays = dict[str, NDArray[Any]]


def read_arrays(path: Path, wanted: Collection[str], most: int) -> tuple[Arrays, list[str]]:
    """Return the wanted arrays of numbers, of at most two axes and `most` values, and the names of all that there is.

    Raises BadInput for a file that is absent, too large, damaged or of another kind.
    """
    readers = {".npz": _npz, ".mat": _mat, ".csv": _csv}
    if path.suffix.lower() not in readers:
        raise BadInput(f"map '{path.name}': suffix '{path.suffix}' is not known; use .npz, .mat or .csv")
    try:
        size, bound = path.stat().st_size, MOST_BYTES[path.suffix.lower()]
        if size > bound:
            raise BadInput(
                f"{path.name}: {size / 1e6:.0f} MB; at most {bound / 1e6:.0f} MB are read, keep only the map"
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a table's odd lines: what is missing is named below
            return readers[path.suffix.lower()](path, wanted, most)
    except FileNotFoundError:
        raise BadInput(f"file '{path}' does not exist; give a flux map (.npz, .mat or .csv)") from None
    except BadInput:
        raise
    except Exception as error:  # the libraries raise whatever a damaged file leads them to
        why = str(error)[:120] or type(error).__name__
        raise BadInput(f"{path.name}: cannot be read as a flux map ({why}); export it again") from None


def _check(path: Path, name: str, shape: tuple[int, ...], most: int) -> None:
    values = 1
    for n in shape:
        values *= int(n)
    if not 0 <= values <= most or min(shape, default=0) < 0:
        raise BadInput(
            f"{path.name}: '{name}' has shape {shape}; at most {most} values are read, keep every second line"
        )


def _npz(path: Path, wanted: Collection[str], most: int) -> tuple[Arrays, list[str]]:
    found: Arrays = {}
    with zipfile.ZipFile(path) as archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        for name in set(members) & set(wanted):
            with archive.open(members[name]) as file:
                major, _ = np.lib.format.read_magic(file)
                read_header = np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0
                shape, column_major, dtype = read_header(file, max_header_size=10_000)
                if dtype.hasobject or dtype.kind not in NUMBERS or len(shape) > 2:
                    continue
                _check(path, name, shape, most)
                count = int(np.prod(shape, dtype=np.int64))
                data = file.read(count * dtype.itemsize)
            array = np.frombuffer(data, dtype=dtype, count=count)
            found[name] = array.reshape(shape, order="F" if column_major else "C")
    return found, sorted(members)


def _mat(path: Path, wanted: Collection[str], most: int) -> tuple[Arrays, list[str]]:
    found = read_mat(path, MOST_BYTES[".mat"])
    chosen = {name: np.squeeze(a) for name, a in found.items() if name in wanted}
    for name, a in chosen.items():
        _check(path, name, a.shape, most)
    return {name: a for name, a in chosen.items() if a.ndim <= 2}, sorted(found)


def _csv(path: Path, wanted: Collection[str], most: int) -> tuple[Arrays, list[str]]:
    rows = path.read_bytes().count(b"\n")
    if rows > most:
        raise BadInput(f"{path.name}: {rows} rows; at most {most} are read, keep every second line")
    table = np.genfromtxt(path, delimiter=",", names=True, encoding="utf-8-sig")
    names = table.dtype.names or ()
    return {n: np.asarray(table[n]) for n in names if n in wanted}, sorted(names)
