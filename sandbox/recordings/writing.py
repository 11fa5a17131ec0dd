"""A campaign as a folder: `campaign.toml` and one Parquet table a recording, written together."""

from __future__ import annotations

import dataclasses
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from model.errors import BadInput
from model.mapped import OF_MAP, MappedMotor, without_map
from model.parameters import Motor
from sandbox.output.files import aside_of
from sandbox.output.toml import toml_text
from sandbox.recordings.campaign import NO_LIMITS, OF_RECORDING, Campaign
from sandbox.recordings.nominal_motor import RATED


class StatedMap(NamedTuple):
    """A nominal model's flux map as a campaign states it: its [flux_map] table, and its file (None:
    a data set's)."""

    table: Mapping[str, Any]
    content: bytes | None


def map_read(motor: Motor) -> StatedMap | None:
    """Return the flux map of a motor that was read from files; None where it has none."""
    if not isinstance(motor, MappedMotor) or motor.origin is None:
        return None
    path, table = motor.origin.path, motor.origin.table
    if "dataset" in table:
        return StatedMap(table, None)
    return StatedMap({**table, "file": path.name}, path.read_bytes())


def write_campaign(
    folder: str | Path, campaign: Campaign, flux_map: StatedMap | None = None
) -> Path:
    """Write a campaign as a new folder, whole or not at all; returns it.  BadInput where it exists
    already.

    flux_map: of the nominal model; without it a motor with a map is written as its numbers alone
    say, linear.
    """
    import pyarrow
    from pyarrow import parquet

    folder = Path(folder)
    if folder.exists():
        raise BadInput(f"folder '{folder}' exists already; give a new one or remove it first")
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = aside_of(Path(os.path.realpath(folder)))
    try:
        partial.mkdir()
        (partial / "campaign.toml").write_text(_toml(campaign, flux_map), encoding="utf-8")
        if flux_map is not None and flux_map.content is not None:
            (partial / flux_map.table["file"]).write_bytes(flux_map.content)
        for r in campaign.recordings:
            (partial / r.file).parent.mkdir(parents=True, exist_ok=True)
            parquet.write_table(
                pyarrow.table(dict(r.columns)), partial / r.file, write_page_checksum=True
            )
        os.replace(partial, folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return folder


def _toml(c: Campaign, flux_map: StatedMap | None) -> str:
    motor = {
        k: v
        for k, v in dataclasses.asdict(without_map(c.drive.motor)).items()
        if v != "" and (k != "name" or v != c.name)
    }
    stand_ins = c.stand_ins or (RATED if c.rated_from_data else ())
    motor = {k: v for k, v in motor.items() if k not in stand_ins}
    if flux_map is not None:
        motor = {k: v for k, v in motor.items() if k not in OF_MAP}
    tables: list[tuple[str, Mapping[str, Any]]] = [
        ("[campaign]", {"name": c.name}),
        ("[drive]", dataclasses.asdict(c.drive.converter)),
        ("[motor]", motor),
        ("[flux_map]", {} if flux_map is None else flux_map.table),
        ("[uncertainty]", c.uncertainty),
        ("[background]", c.background),
        ("[injection]", dataclasses.asdict(c.drive.injection)),
        ("[provenance]", c.drive.provenance),
        ("[limits]", {} if c.limits == NO_LIMITS else dataclasses.asdict(c.limits)),
    ]
    for r in c.recordings:
        tables.append(("[[recording]]", {key: getattr(r, key) for key in OF_RECORDING}))
    return toml_text(tables)
