"""How much memory a diagnosis may take, and slopes that do not fit into it: they wait in a file.

Of what grows with a campaign, most are slopes, one number for every reading and coordinate.  Where
they are more than a share of what the limit leaves, they are written to a temporary file that has
no name and goes with the process, and are read block by block.  Answers are the same to the bit
either way.
"""

from __future__ import annotations

import math
import os
import shutil
import tempfile
import weakref
from dataclasses import dataclass, replace
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.compiled import kernel
from model.errors import BadInput

GIGA = 1e9
USUAL = 8.0  # GB: what a diagnosis may take if nothing is said
OWN = 0.6e9  # bytes of the program, its libraries and compiled kernels
# bytes a sample takes that stands as long as a diagnosis: readings, commands, motion, one replay
SAMPLE = 700.0
LEAST = 0.1e9  # bytes that there must be to work in
# of what is left, for the slopes of one point: those of two may be kept, and two more are being
# made
SHARE = 0.25
FULL = "give --memory more, or TMPDIR a folder with more room"


def check_memory(gigabytes: float) -> None:
    """BadInput where a limit is no amount of memory, whatever the campaign."""
    if not gigabytes > 0.0:
        raise BadInput(f"--memory {gigabytes:g} is no amount of memory; give GB above 0")


def spare(gigabytes: float, samples: int) -> float:
    """Return how many bytes a limit leaves to a campaign of so many samples.

    BadInput where it is not enough.
    """
    check_memory(gigabytes)
    needed = OWN + SAMPLE * samples
    left = GIGA * gigabytes - needed
    if left < LEAST:
        least = math.ceil((needed + LEAST) / GIGA * 10.0) / 10.0
        raise BadInput(
            f"--memory {gigabytes:g} GB is too little for a campaign of {samples} samples; give "
            f"{least:g} or more, or shorter recordings"
        )
    return left


def spill_folder() -> str:
    """Return where large temporary files go: TMPDIR, else /var/tmp, since /tmp may itself be
    memory."""
    stated = os.environ.get("TMPDIR")
    return stated or ("/var/tmp" if os.access("/var/tmp", os.W_OK) else tempfile.gettempdir())


class Spill:
    """A temporary file of so many bytes of numbers, without a name; closed when nobody reads it any
    more."""

    def __init__(self, size: float) -> None:
        """Open it where there is room; BadInput where there is none."""
        folder, self.lock = spill_folder(), Lock()
        try:
            free = shutil.disk_usage(folder).free
            if free < size:
                need = f"{size / GIGA:.1f} GB of slopes fit neither into memory nor into '{folder}'"
                raise BadInput(f"{need}, where {free / GIGA:.1f} GB are free; {FULL}")
            self.file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115 (it outlives this call)
        except OSError as problem:
            raise BadInput(
                f"slopes do not fit into memory, nor can a file hold them ({problem}); {FULL}"
            ) from None
        weakref.finalize(self, self.file.close)

    def write(self, at: int, values: Array) -> None:
        """Write numbers from a place (bytes) on; BadInput where there is no room."""
        data = np.ascontiguousarray(values).reshape(-1).view(np.uint8).data
        try:
            with self.lock:
                self.file.seek(at)
                while data:
                    data = data[self.file.write(data) :]
        except OSError as problem:
            raise BadInput(
                f"slopes do not fit into memory, nor can a file hold them ({problem}); {FULL}"
            ) from None

    def read(self, at: int, shape: tuple[int, int]) -> Array:
        """Return numbers from a place (bytes) on."""
        out = np.empty(shape)
        data = out.reshape(-1).view(np.uint8).data
        with self.lock:
            self.file.seek(at)
            while data:
                data = data[self.file.readinto(data) :]
        return out


def compacted(rows: Array, columns: NDArray[np.int64], scale: Array) -> Array:
    """Return some columns (q,), in ascending order, of rows (n, p), each times its scale (q,), in
    the place of these: fresh memory of that size takes ten times as long."""
    out = rows.reshape(-1)[: len(rows) * len(columns)].reshape(len(rows), len(columns))
    compact(rows, columns, scale, out)
    return out


@kernel
def compact(rows, columns, scale, out):
    """Write `compacted`: what is written stands where, or before, what is read next."""
    for k in range(len(out)):
        for j in range(len(columns)):
            out[k, j] = rows[k, columns[j]] * scale[j]


@kernel
def take_off(rows, answer, moved):
    """Take off rows (n, q) in place what answers (n, 2) to two unknowns explain that columns move
    by `moved` (2, q)."""
    for k in range(len(rows)):
        for i in range(rows.shape[1]):
            rows[k, i] -= answer[k, 0] * moved[0, i] + answer[k, 1] * moved[1, i]


class StartTaken(NamedTuple):
    """What an unread start explains of slopes (`sandbox.replay.unread_start`): answers (rows, 2),
    whitened, and by how much of them each column (2, q) goes along with it."""

    answer: Array
    moved: Array

    def off(self, rows: Array, first: int) -> None:
        """Take it off some rows (n, q), from one on, in place."""
        own = self.answer[first : first + len(rows)]
        if own.any():
            take_off(rows, own, self.moved)

    def of(self, columns: NDArray[np.int64]) -> StartTaken:
        """Return that of some of the columns."""
        return StartTaken(self.answer, self.moved[:, columns])


@dataclass(frozen=True)
class Kept:
    """Slopes (rows, columns) in a file, of which some columns count, scaled, less what an unread
    start explains: sliced like an array (rows, q)."""

    spill: Spill
    at: int
    shape: tuple[int, int]
    columns: NDArray[np.int64]
    scale: Array
    start: StartTaken | None = None

    nbytes = 0  # of memory

    def __getitem__(self, rows: slice) -> Array:
        """Return some rows (stop - start, q)."""
        first, last, _ = rows.indices(self.shape[0])
        own = self.spill.read(self.at + 8 * first * self.shape[1], (last - first, self.shape[1]))
        out = compacted(own, self.columns, self.scale)
        if self.start is not None:
            self.start.off(out, first)
        return out

    def of(self, columns: NDArray[np.int64]) -> Kept:
        """Return some of the columns."""
        start = None if self.start is None else self.start.of(columns)
        return replace(self, columns=self.columns[columns], scale=self.scale[columns], start=start)

    def __array__(self, dtype: object = None, copy: bool | None = None) -> Array:
        """Return all of them, in memory."""
        return self[: self.shape[0]]

    def reshape(self, *shape: int) -> Array:
        """Return all of them, in memory, in another shape."""
        return self[: self.shape[0]].reshape(*shape)
