"""The folder of a sweep: finished blocks as Parquet files, traces as zarr, and a journal that says
which are whole.

runs/block-*.parquet together are one data set; journal.jsonl has the SHA-256 of each.  A block
counts once the journal names it, and its file is written aside and renamed: an interrupted sweep
goes on where it was, and half a file is never taken for a whole one.
"""

from __future__ import annotations

import hashlib
import io
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from model.errors import BadInput
from model.parameters import finite
from sandbox.engine.journal import Journal, state_of_code
from sandbox.evaluation.sweep.blocks import MADE_BY, Block, block_size, samples_of, schema_of
from sandbox.evaluation.sweep.plan import Sweep, digest_of
from sandbox.output.files import check_free, json_bytes, write_whole
from sandbox.output.provenance import digest_of as digest_of_file
from sandbox.output.provenance import version

RUNS, TRACES, JOURNAL, SCHEMA = "runs", "traces.zarr", "journal.jsonl", "schema.json"
SWEEP = "sweep"  # the entry that says what the others are blocks of
BYTES_A_RUN = 150  # in the table, about


@dataclass
class Kept:
    """What a sweep's folder holds: by the first run of each finished block, what the journal says
    of it."""

    folder: Path
    sweep: Sweep
    journal: Journal
    blocks: dict[int, dict[str, Any]] = field(default_factory=dict)

    @property
    def runs(self) -> int:
        """Runs of finished blocks."""
        return sum(block["rows"] for block in self.blocks.values())


def key_of(sweep: Sweep) -> str:
    """Return what a folder's content hangs on: the sweep, the files it names, the code."""
    return hashlib.sha256(f"{digest_of(sweep)} {state_of_code(*MADE_BY)}".encode()).hexdigest()


def open_folder(sweep: Sweep, folder: Path, afresh: bool = False) -> Kept:
    """Return what is finished of a sweep in a folder, each block checked; afresh: forget it.

    BadInput where the folder holds another sweep, or the same made by another state of the code.
    """
    _check_places(folder)
    if afresh:
        forget(folder)
    kept = Kept(folder, sweep, Journal(folder / JOURNAL))
    found = _sound(kept.journal)
    if found is not None:
        if found.said.get("key") != key_of(sweep):
            raise BadInput(
                f"'{folder}' holds another sweep, or this one made by another state of the code; "
                "give a new --out, or begin anew with --again"
            )
        kept.blocks = {b["start"]: b for b in found.blocks if _is_whole(kept, b)}
    elif kept.journal.entries or any((folder / RUNS).glob("block-*")):
        # without one it is where a sweep stopped before its first block
        raise BadInput(
            f"'{folder / RUNS}' has no readable {JOURNAL} beside it; give a new --out, or --again"
        )
    return kept


def _check_places(folder: Path) -> None:
    """Raise BadInput where something else stands in the place of a sweep's files; nothing is
    removed then."""
    for name in (RUNS, TRACES):
        path = folder / name
        if path.is_symlink() or (path.exists() and not path.is_dir()):
            raise BadInput(
                f"'{path}' is a link or a file, where a sweep keeps a folder; move it, "
                "or give another --out"
            )
    check_free(folder, ("sweep.json", "sweep.png", JOURNAL, SCHEMA))


def forget(folder: Path) -> None:
    """Remove a sweep's files from a folder, the result first."""
    for name in ("sweep.json", "sweep.png", JOURNAL, SCHEMA):
        (folder / name).unlink(missing_ok=True)
    for name in (RUNS, TRACES):
        shutil.rmtree(folder / name, ignore_errors=True)


def begin(kept: Kept) -> None:
    """Make the folder, the schema, room for traces."""
    (kept.folder / RUNS).mkdir(parents=True, exist_ok=True)
    write_whole(kept.folder / SCHEMA, json_bytes({"schema": 1, "columns": schema_of(kept.sweep)}))
    if kept.sweep.traces is not None and not kept.blocks:
        _new_traces(kept)
    if SWEEP not in kept.journal.entries:
        said = {
            "schema": 1,
            "version": version(),
            "code": state_of_code(*MADE_BY),
            "key": key_of(kept.sweep),
            "runs": kept.sweep.runs,
            "block": block_size(kept.sweep),
        }
        kept.journal.add(SWEEP, said)


def add(kept: Kept, block: Block) -> None:
    """Keep a finished block: its table, its traces, then its line in the journal."""
    from pyarrow import parquet

    body = io.BytesIO()
    parquet.write_table(block.table, body)
    write_whole(kept.folder / block_file(block.start), body.getvalue())
    digest = hashlib.sha256(body.getvalue()).hexdigest()
    said: dict[str, Any] = {
        "start": block.start,
        "rows": block.table.num_rows,
        "file": block_file(block.start),
        "sha256": digest,
    }
    if block.traces is not None:
        said["traces_sha256"] = _write_traces(kept, block)
    said |= {"cpu_seconds": block.cpu_seconds, "kernel_seconds": block.kernel_seconds}
    kept.blocks[block.start] = said
    kept.journal.add(str(block.start), said)


def counts(folder: Path) -> tuple[int, int]:
    """Return how many runs a folder keeps, and of how many; 0, 0 where it holds no sweep."""
    found = _sound(Journal(folder / JOURNAL))
    if found is None:
        return 0, 0
    return sum(block["rows"] for block in found.blocks), int(found.said["runs"])


def read_table(folder: Path) -> Any:
    """Return the runs of all finished blocks as one pyarrow table, by number; BadInput where a
    folder holds no sweep, or not all of one."""
    import pyarrow as pa
    from pyarrow import parquet

    found = _sound(Journal(folder / JOURNAL))
    if found is None:
        raise BadInput(f"'{folder}' holds no sweep ({JOURNAL}); run one with --out '{folder}'")
    blocks = sorted(found.blocks, key=lambda b: b["start"])
    check_files(folder, [b["file"] for b in blocks])
    return pa.concat_tables([parquet.read_table(folder / b["file"]) for b in blocks])


def check_files(folder: Path, names: Iterable[str]) -> None:
    """Raise BadInput unless each is a file: a pipe in its place would be waited for."""
    for path in (folder / name for name in names):
        if not path.is_file():
            raise BadInput(
                f"'{path}' is missing or no file; run the sweep again with the same --out"
            )


def open_traces(folder: Path) -> Any:
    """Return the traces as an xarray Dataset (run, sample), read when asked for; NaN after a run's
    end; BadInput where there are none."""
    xarray, _ = _trace_libraries()
    if not (folder / TRACES).exists():
        raise BadInput(
            f"'{folder}' holds no traces; ask for them with [traces] in the sweep's file"
        )
    return xarray.open_zarr(folder / TRACES, consolidated=False, chunks=None)


def block_file(start: int) -> str:
    """Return the name of a block's table in the folder."""
    return f"{RUNS}/block-{start:09d}.parquet"


class Found(NamedTuple):
    """What a journal says of a sweep, and of its blocks."""

    said: dict[str, Any]
    blocks: list[dict[str, Any]]


def _sound(journal: Journal) -> Found | None:
    """Return what a journal says; None where it is no sweep's, or names other files than blocks."""
    blocks = [content for name, content in journal.entries.items() if name != SWEEP]
    try:
        found = Found(journal.entries[SWEEP], blocks)
        return found if all(map(_is_sound, blocks)) and type(found.said["runs"]) is int else None
    except (LookupError, TypeError):
        return None


def _is_sound(b: Any) -> bool:
    """Tell whether an entry is of a block, and names its own file."""
    whole = type(b["start"]) is int and type(b["rows"]) is int
    spent = all(finite(b[name]) is not None for name in ("cpu_seconds", "kernel_seconds"))
    return whole and spent and bool(b["file"] == block_file(b["start"]))


def _is_whole(kept: Kept, block: dict[str, Any]) -> bool:
    """Tell whether a block's files are what was written."""
    try:
        path = kept.folder / block["file"]
        if not path.is_file() or digest_of_file(path) != block["sha256"]:
            return False
        if kept.sweep.traces is None:
            return True
        return bool(
            _digest_of_traces(kept, block["start"], block["rows"]) == block["traces_sha256"]
        )
    except (OSError, KeyError, ValueError):
        return False


def _trace_libraries() -> tuple[Any, Any]:
    try:
        import xarray
        import zarr
    except ImportError:
        raise BadInput(
            "traces need xarray and zarr; `pip install 'sensorless-sandbox[sweep]'`, or "
            "leave [traces] away"
        ) from None
    return xarray, zarr


def check_traces(sweep: Sweep) -> None:
    """Raise BadInput, before anything runs, where traces are asked for and cannot be written."""
    if sweep.traces is not None:
        _trace_libraries()


def _new_traces(kept: Kept) -> None:
    """Make room for the traces of all runs: an array a channel, a chunk a block."""
    from sandbox.drive.recording import UNITS

    _, zarr = _trace_libraries()
    traces = kept.sweep.traces
    assert traces is not None
    shutil.rmtree(kept.folder / TRACES, ignore_errors=True)
    group = zarr.open_group(kept.folder / TRACES, mode="w")
    group.attrs["stride"] = traces.stride
    samples = max(1, samples_of(kept.sweep))
    for channel in traces.channels:
        group.create_array(
            channel,
            shape=(kept.sweep.runs, samples),
            chunks=(block_size(kept.sweep), samples),
            dtype="float64",
            fill_value=float("nan"),
            dimension_names=("run", "sample"),
            attributes={"units": UNITS.get(channel, "rad")},
        )


def _write_traces(kept: Kept, block: Block) -> str:
    """Write a block's traces in their place; return the SHA-256 of what stands there then."""
    xarray, _ = _trace_libraries()
    assert kept.sweep.traces is not None
    assert block.traces is not None
    rows = len(block.traces)
    data = {
        c: (("run", "sample"), block.traces[:, k]) for k, c in enumerate(kept.sweep.traces.channels)
    }
    region = {"run": slice(block.start, block.start + rows)}
    xarray.Dataset(data).to_zarr(kept.folder / TRACES, region=region, mode="r+", consolidated=False)
    return _digest_of_traces(kept, block.start, rows)


def _digest_of_traces(kept: Kept, start: int, rows: int) -> str:
    _, zarr = _trace_libraries()
    group, found = zarr.open_group(kept.folder / TRACES, mode="r"), hashlib.sha256()
    assert kept.sweep.traces is not None
    for channel in kept.sweep.traces.channels:
        found.update(group[channel][start : start + rows].tobytes())
    return found.hexdigest()
