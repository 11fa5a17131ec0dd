"""What a trace holds, read back by rerun's own reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from sandbox.output.trace import TIMELINE, Array


def read_trace(path: Path) -> dict[str, tuple[Array, Array]]:
    """Read the scalars of a trace: entity path -> (times (n,) in s, values (n, k))."""
    parts: dict[str, list[tuple[NDArray[np.int64], Array]]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.is_static or "Scalars:scalars" not in batch.schema.names:
            continue
        times = batch.column(TIMELINE).to_numpy(zero_copy_only=False).astype(np.int64)
        flat = batch.column("Scalars:scalars").flatten().to_numpy(zero_copy_only=False)
        entity = str(chunk.entity_path).lstrip("/")
        parts.setdefault(entity, []).append((times, flat.reshape(times.size, -1)))
    found = {}
    for entity, pieces in parts.items():
        times, values = (np.concatenate(column) for column in zip(*pieces, strict=True))
        order = np.argsort(times, kind="stable")
        found[entity] = (times[order] / 1e9, values[order])
    return found


def read_bars(path: Path) -> dict[str, Array]:
    """Read the bars of a trace: entity path -> heights (n,)."""
    found = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if "BarChart:values" in batch.schema.names:
            entity = str(chunk.entity_path).lstrip("/")
            (own,) = batch.column("BarChart:values").to_pylist()
            found[entity] = np.array(own[0]["buffer"] if "buffer" in own[0] else own[0])
    return found


def read_properties(path: Path) -> dict[str, str]:
    """Read how a trace was made, as text."""
    found: dict[str, str] = {}
    for chunk in RrdReader(path).stream():
        if str(chunk.entity_path).endswith("__properties/made"):
            batch = chunk.to_record_batch()
            names = [name for name in batch.schema.names if not name.startswith("rerun")]
            found |= {name: batch.column(name)[0].as_py()[0] for name in names}
    return found
