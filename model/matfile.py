"""Arrays of numbers from MATLAB's .mat files of version 5 to 7, every length checked before it is
followed.

SciPy's reader trusts the lengths a file states: a damaged one ends it with a segmentation fault.
Read here are full arrays of numbers, real or complex, and those in structures, as
'structure.field'; texts, cells, sparse arrays and objects are passed over.  Elements of a structure
array that have a Name and Data are signals of that name (so dSPACE's ControlDesk writes them);
others are 'structure(1).field'.  Format: MathWorks, MAT-File Format (version 5 files). Checked
against SciPy's writer and reader (tests/model).
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HEADER = 128  # bytes: a text, the version, and in which order bytes stand
# stored types
NUMBERS = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
MATRIX, COMPRESSED = 14, 15
STRUCTURE, TEXT = 2, 4  # classes of arrays
CODES = {2: "utf-8", 4: "utf-16", 16: "utf-8", 17: "utf-16"}  # stored types of a text
FULL = range(6, 16)  # classes of full arrays of numbers: double, single, eight of integers
COMPLEX = 0x800  # flag beside the class
DEEPEST = 4  # structures in structures
MOST_FIELDS = 1000
MOST_ELEMENTS = 10_000  # of an array of structures
LONGEST_NAME = 400  # characters of a signal's name

Array = NDArray[Any]


class Damaged(ValueError):
    """Something in the file is not what the format says; the text names it."""


def read_mat(path: Path, most: int) -> dict[str, Array]:
    """Return the arrays of a file by name, float64 or complex128; `most` bytes are unpacked at
    most.

    Raises Damaged for what is no such file, OSError for one that cannot be read.
    """
    content = memoryview(path.read_bytes())
    begin = bytes(content[:HEADER])
    if begin.startswith(b"MATLAB 7.3") or begin.startswith(b"\x89HDF"):
        raise Damaged("MAT version 7.3 (HDF5) is not read; save it with save(..., '-v7')")
    order = {b"IM": "<", b"MI": ">"}.get(begin[126:128])
    if order is None:
        raise Damaged("not a MAT file of version 5 to 7; save it with save(..., '-v7')")
    found: dict[str, Array] = {}
    for kind, data in _elements(content[HEADER:], order):
        if kind == COMPRESSED:
            unpacked = _unpacked(data, most)
            most -= len(unpacked)
            kind, data = next(_elements(unpacked, order), (0, data))
        if kind == MATRIX:
            found.update(_matrix(data, order, "", DEEPEST))
    return found


def _unpacked(data: memoryview, most: int) -> memoryview:
    """Return a compressed element's content, no more than `most` bytes of it."""
    stream = zlib.decompressobj()
    try:
        content = stream.decompress(data, max(most, 1))
    except zlib.error as error:
        raise Damaged(f"a compressed array is damaged ({error})") from None
    if not stream.eof:
        raise Damaged("a compressed array is cut short, or larger than can be read")
    return memoryview(content)


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of each element, in turn."""
    at = 0
    while at + 8 <= len(data):
        kind, size = (int(x) for x in np.frombuffer(data[at : at + 8], order + "u4"))
        if kind >> 16:  # small: up to four bytes in the tag itself
            size = kind >> 16
            if size > 4:
                raise Damaged(f"a small element of {size} bytes")
            yield kind & 0xFFFF, data[at + 4 : at + 4 + size]
            at += 8
            continue
        if size > len(data) - at - 8:
            raise Damaged(f"an element of {size} bytes where {len(data) - at - 8} are left")
        yield kind, data[at + 8 : at + 8 + size]
        at += 8 + size
        if kind != COMPRESSED:
            at += -at % 8


def _matrix(data: memoryview, order: str, prefix: str, deepest: int) -> Iterator[tuple[str, Array]]:
    """Yield the arrays of one matrix element by name: itself, or a structure's."""
    parts = _elements(data, order)
    flags, shape = _integers(parts, order), _integers(parts, order)
    kind, name = next(parts, (0, memoryview(b"")))
    if len(flags) < 1 or not 2 <= len(shape) <= 8 or min(shape) < 0 or kind not in NUMBERS:
        raise Damaged("an array without a shape or name")
    own = prefix + bytes(name).decode("latin-1")
    if flags[0] & 0xFF == STRUCTURE and deepest:
        yield from _structures(parts, order, own, prod(shape), deepest - 1)
    elif flags[0] & 0xFF in FULL:
        real = _values(parts, order, shape)
        yield own, real + 1j * _values(parts, order, shape) if flags[0] & COMPLEX else real


def _structures(
    parts: Iterator[tuple[int, memoryview]], order: str, own: str, count: int, deepest: int
) -> Iterator[tuple[str, Array]]:
    """Yield the arrays of one structure, or of `count` with the same fields: signals by name, or
    numbered."""
    length = _integers(parts, order)
    _, text = next(parts, (0, memoryview(b"")))
    if len(length) != 1 or not 1 <= length[0] <= 256 or len(text) > length[0] * MOST_FIELDS:
        raise Damaged(f"structure '{own[:40]}' has no names of fields")
    places = range(0, len(text), length[0])
    fields = [bytes(text[k : k + length[0]]).partition(b"\0")[0].decode("latin-1") for k in places]
    if count == 1:
        yield from _fields(parts, order, own, fields, deepest)[1].items()
        return
    if count > MOST_ELEMENTS:
        raise Damaged(f"an array of {count} structures, '{own[:40]}'")
    found = [
        (k, *_fields(parts, order, f"{own}({k})", fields, deepest)) for k in range(1, count + 1)
    ]
    uses = Counter(name for _, name, _ in found)
    for k, name, arrays in found:
        data = arrays.get(f"{own}({k}).Data")
        yield from arrays.items() if data is None or not name or uses[name] > 1 else ((name, data),)


def _fields(
    parts: Iterator[tuple[int, memoryview]],
    order: str,
    own: str,
    fields: Sequence[str],
    deepest: int,
) -> tuple[str, dict[str, Array]]:
    """Return a structure's Name, empty where it has none, and the arrays in it."""
    name, arrays = "", dict[str, Array]()
    for field in fields:
        kind, data = next(parts, (0, memoryview(b"")))
        if kind != MATRIX:
            raise Damaged(f"field '{field[:40]}' of structure '{own[:40]}' is missing")
        if len(data):  # an empty field has no content at all
            arrays.update(_matrix(data, order, f"{own}.{field}", deepest))
            name = _text(data, order) if field == "Name" else name
    return name, arrays


def _text(data: memoryview, order: str) -> str:
    """Return what a matrix element holds as a text, empty where it is none, or none in one line."""
    parts = _elements(data, order)
    flags, shape = _integers(parts, order), _integers(parts, order)
    next(parts, None)
    kind, content = next(parts, (0, memoryview(b"")))
    if (
        len(flags) < 1
        or flags[0] & 0xFF != TEXT
        or kind not in CODES
        or prod(shape) > LONGEST_NAME
        or shape[0] != 1
    ):
        return ""
    code = CODES[kind] + ({"<": "-le", ">": "-be"}[order] if kind in (4, 17) else "")
    text = bytes(content[: 4 * LONGEST_NAME]).decode(code, "replace").strip("\0 ")
    return text if text.isprintable() else ""


def _integers(parts: Iterator[tuple[int, memoryview]], order: str) -> list[int]:
    kind, data = next(parts, (0, memoryview(b"")))
    if kind not in (5, 6) or len(data) % 4 or len(data) > 64:
        raise Damaged("an array without flags or a shape")
    return [int(x) for x in np.frombuffer(data, order + NUMBERS[kind])]


def _values(parts: Iterator[tuple[int, memoryview]], order: str, shape: list[int]) -> Array:
    kind, data = next(parts, (0, memoryview(b"")))
    if kind not in NUMBERS:
        raise Damaged(f"an array of values of type {kind}")
    stored = np.dtype(order + NUMBERS[kind])
    if len(data) != prod(shape) * stored.itemsize:
        raise Damaged(f"an array of shape {tuple(shape)} with {len(data)} bytes")
    return np.frombuffer(data, stored).astype(np.float64).reshape(shape, order="F")
