"""TDMS files (LabVIEW): channels with their own start and step; nptdms reads them (extra
`tdms`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import BadInput, unknown
from model.number_table import Table
from sandbox.recordings.formats.log_table import (
    MOST_VALUES,
    missing,
    on_one_raster,
    silent,
    too_many,
)


def read_tdms(path: Path, wanted: Sequence[str]) -> Table:
    """Return the wanted channels (all of numbers where none is named) on the densest raster among
    them.

    A channel is named as in the file, or 'group/channel' where two groups have one of that name.
    Stamps come from the waveform's own step (`wf_increment`); without it columns have none, and the
    campaign's own sampling period counts.
    """
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise missing(path.name, "nptdms", "tdms", "TDMS") from None
    try:
        with silent(), path.open("rb") as raw, TdmsFile.open(raw) as file:
            channels = [c for group in file.groups() for c in group.channels()]
            names = Counter(c.name for c in channels)
            known = {
                c.name if names[c.name] == 1 else f"{c.group_name}/{c.name}": c for c in channels
            }
            numbers = {n: c for n, c in known.items() if c.dtype.kind in "fiu" and len(c) > 0}
            asked = {n: numbers[n] for n in dict.fromkeys(wanted) if n in numbers} or (
                numbers if not wanted else {}
            )
            if sum(len(c) for c in asked.values()) > MOST_VALUES:
                raise too_many(path.name)
            values = {n: np.asarray(c[:], dtype=np.float64) for n, c in asked.items()}
            stamps = {n: _stamps(c, len(values[n])) for n, c in asked.items()}
            units = {
                n: str(c.properties["unit_string"])
                for n, c in asked.items()
                if c.properties.get("unit_string")
            }
    except BadInput:
        raise
    except Exception as error:  # nptdms raises whatever a damaged file leads it to
        raise BadInput(
            f"{path.name}: cannot be read as TDMS ({error!s:.80}); export it again"
        ) from None
    if not values:
        raise BadInput(f"{path.name}: {unknown('channels', ', '.join(wanted), known)}")
    if all(s is None for s in stamps.values()):
        return Table(values, units, {})
    timed = {n: (s, values[n]) for n, s in stamps.items() if s is not None}
    columns, notes = on_one_raster(path.name, timed)
    return Table(columns, units, {}, tuple(notes))


def _stamps(channel: Any, count: int) -> np.ndarray | None:
    step = channel.properties.get("wf_increment")
    if not isinstance(step, float) or not step > 0.0:
        return None
    return np.asarray(
        float(channel.properties.get("wf_start_offset", 0.0)) + step * np.arange(count)
    )
