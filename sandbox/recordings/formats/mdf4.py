"""MDF4 files: channels of one or several rasters; asammdf reads them (extra `mdf`)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

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


def read_mdf4(path: Path, wanted: Sequence[str]) -> Table:
    """Return the wanted channels on the densest raster among them, its stamps as 't' (s).

    A name that stands in several groups is taken from the group with most samples.  BadInput names
    what is missing.
    """
    try:
        from asammdf import MDF
    except ImportError:
        raise missing(path.name, "asammdf", "mdf", "MDF4") from None
    signals, units = {}, {}
    try:
        with silent(), MDF(path) as file:
            known = list(file.channels_db)
            places = {p for n in (wanted or known) for p in file.channels_db.get(n, ())}
            if (
                sum(file.groups[group].channel_group.cycles_nr for group, _ in places)
                > MOST_VALUES // 2
            ):
                raise too_many(path.name)  # each with a stamp of its own
            for name in dict.fromkeys(n for n in (wanted or known) if n in file.channels_db):
                every = [file.get(name, group=g, index=k) for g, k in file.channels_db[name]]
                signal = max(every, key=lambda s: len(s.timestamps))
                if np.asarray(signal.samples).dtype.kind not in "fiub":
                    continue
                stamps = np.asarray(signal.timestamps, dtype=np.float64)
                signals[name] = (stamps, np.asarray(signal.samples, dtype=np.float64))
                if signal.unit:
                    units[name] = str(signal.unit)
    except BadInput:
        raise
    except Exception as error:
        # asammdf raises whatever a damaged file or an ambiguous channel leads it to
        raise BadInput(
            f"{path.name}: cannot be read as MDF4 ({error!s:.80}); export it again"
        ) from None
    if not signals:
        raise BadInput(f"{path.name}: {unknown('channels', ', '.join(wanted), known)}")
    columns, notes = on_one_raster(path.name, signals)
    return Table(columns, units, {}, tuple(notes))
