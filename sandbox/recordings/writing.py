"""A campaign as a folder: `campaign.toml` and one Parquet table a recording, written together."""

from __future__ import annotations

import dataclasses
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from model.errors import BadInput
from model.mapped import without_map
from sandbox.output.files import aside_of
from sandbox.output.toml import toml_text
from sandbox.recordings.campaign import NO_LIMITS, OF_RECORDING, RATED, Campaign


def write_campaign(folder: str | Path, campaign: Campaign) -> Path:
    """Write a campaign as a new folder, whole or not at all; returns it.  BadInput where it exists already."""
    import pyarrow
    from pyarrow import parquet

    folder = Path(folder)
    if folder.exists():
        raise BadInput(f"folder '{folder}' exists already; give a new one or remove it first")
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = aside_of(Path(os.path.realpath(folder)))
    try:
        partial.mkdir()
        (partial / "campaign.toml").write_text(_toml(campaign), encoding="utf-8")
        for r in campaign.recordings:
            (partial / r.file).parent.mkdir(parents=True, exist_ok=True)
            parquet.write_table(pyarrow.table(dict(r.columns)), partial / r.file, write_page_checksum=True)
        os.replace(partial, folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return folder


def _toml(c: Campaign) -> str:
    motor = {k: v for k, v in dataclasses.asdict(without_map(c.drive.motor)).items() if k != "name" and v != ""}
    if c.rated_from_data:
        motor = {k: v for k, v in motor.items() if k not in RATED}
    tables: list[tuple[str, Mapping[str, Any]]] = [
        ("[campaign]", {"name": c.name}),
        ("[drive]", dataclasses.asdict(c.drive.converter)),
        ("[motor]", motor),
        ("[uncertainty]", c.uncertainty),
        ("[background]", c.background),
        ("[injection]", dataclasses.asdict(c.drive.injection)),
        ("[provenance]", c.drive.provenance),
        ("[limits]", {} if c.limits == NO_LIMITS else dataclasses.asdict(c.limits)),
    ]
    for r in c.recordings:
        tables.append(("[[recording]]", {key: getattr(r, key) for key in OF_RECORDING}))
    return toml_text(tables)
