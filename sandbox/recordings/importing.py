"""Recordings from elsewhere: a campaign folder, or tables of other programs with a column map, as one Campaign.

IMPORTING.md beside this file describes the map; what was changed, lost or looks suspicious is in `Campaign.findings`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput, brief, unknown
from model.parameters import finite, read_toml
from sandbox.recordings.campaign import (
    ROTORS,
    Campaign,
    CampaignRecording,
    Finding,
    assemble,
    converter_of,
    entries_of,
    table_of,
)
from sandbox.recordings.column_map import KIND, Column, contract, parse_columns
from sandbox.recordings.conventions import with_link
from sandbox.recordings.foreign import read_table
from sandbox.recordings.plausibility import check

Array = NDArray[np.float64]
SILENT = 0.01  # of the sampling period: jitter that the format allows
JITTER = 0.25  # of it: jitter that leaves no doubt which sample is meant
DRIFT = 0.01  # relative error of the recorded clock


def read_recordings(path: str | Path, columns: Path | None = None, rotors: Sequence[str] = ROTORS) -> Campaign:
    """Return the campaign of a folder (or of one table in it), checked for wrong units, signs, order and sensors.

    `columns` is a TOML file that maps names and units and may hold the tables of campaign.toml; `rotors` limits the
    recordings read.  Raises BadInput naming file, column and row for what cannot be right.
    """
    path = Path(path)
    folder = path if path.is_dir() else path.parent
    if not path.exists():
        raise BadInput(f"campaign '{path}' does not exist; give its folder, or one table in it")
    data, mapped, source = _tables(folder, columns)
    entries = entries_of(data, rotors, source)
    if path.is_file():
        entries = [e for e in entries if (folder / e[0]).resolve() == path.resolve()]
        if not entries:
            raise BadInput(
                f'{source}: no [[recording]] with file = "{path.name}"; add one with its rotor and injection_axis'
            )
    try:
        converter = converter_of(data, folder)
    except BadInput as error:
        raise BadInput(f"{source}: {error}") from None
    pairs = _pole_pairs(data, mapped, source)
    recordings, findings = [], []
    for file, rotor, axis, link in entries:
        table = read_table(folder / file, [c.column for c in mapped.values()])
        stranger = next((n for n in table.columns if n not in KIND), None)
        if columns is None and stranger is not None:
            raise BadInput(f"{file}: {unknown('column', stranger, KIND)}; map other names with --columns FILE.toml")
        values, notes = contract(file, table, mapped, pairs, link or converter.dc_bus_voltage)
        values["t"], moved = regular(file, values.get("t"), len(values["theta"]), converter.sampling_period)
        recordings.append(CampaignRecording(file, rotor, axis, values, link))
        findings += notes + moved
    campaign = assemble(data, tuple(recordings), folder.resolve().name, source, folder)
    found = dataclasses.replace(campaign, findings=(*findings, *check(campaign.recordings, campaign.drive)))
    return with_link(found)


def _tables(folder: Path, columns: Path | None) -> tuple[dict[str, Any], dict[str, Column], str]:
    """Return the tables of campaign.toml and of the column file together, the map, and the file to name in errors."""
    own = folder / "campaign.toml"
    if columns is None and not own.is_file():
        raise BadInput(
            f"'{folder}' holds no campaign.toml, so its drive, motor and recordings are unknown; write one, or give "
            "--columns FILE.toml for tables of other programs (sandbox/recordings/IMPORTING.md)"
        )
    data = read_toml(own) if own.is_file() or columns is None else {}
    if columns is None:
        return data, {}, own.name
    extra = read_toml(columns)
    mapped = parse_columns(extra, columns.name)
    extra.pop("columns", None)
    for name in extra:
        if name in data:
            raise BadInput(f"{columns.name}: [{name}] stands in campaign.toml too; keep one of them")
    return {**data, **extra}, mapped, own.name if data else columns.name


def _pole_pairs(data: Mapping[str, Any], mapped: Mapping[str, Column], source: str) -> float:
    """Return the motor's pole pairs where a mechanical angle needs them, else 1."""
    if not any(c.mechanical for c in mapped.values()):
        return 1.0
    stated = table_of(data, "motor").get("pole_pairs")
    pairs = finite(stated)
    if pairs is None or not 1.0 <= pairs <= 100.0:
        raise BadInput(
            f"{source}: [motor] pole_pairs = {brief(stated)} cannot turn a mechanical angle; give it in [1, 100]"
        )
    return pairs


def regular(file: str, t: Array | None, n: int, period: float) -> tuple[Array, list[Finding]]:
    """Return sample instants (s) on the drive's own grid; BadInput where the stamps leave doubt which sample is meant.

    Values are kept, not interpolated: the drive samples by its own clock, jitter is the logger's.
    """
    grid = np.arange(n, dtype=np.float64) * period
    if t is None:
        text = f"{file}: column 't' is missing, rows are taken as {period:.6g} s apart; lost samples stay unseen"
        return grid, [Finding(file, "t", None, text)]
    if n < 2:
        return t, []  # refused where the recording is made
    step = np.diff(t)
    _check_clock(file, t, step, period)
    if np.max(np.abs(step - period)) <= SILENT * period:
        return t, []
    place = np.arange(n)
    drift, start = np.polyfit(place, t - t[0] - grid, 1)
    if abs(drift) > DRIFT * period:
        raise BadInput(
            f"{file}: t advances by {period + drift:.6g} s a row, sampling_period is {period:.6g} s (1 % at most); "
            "correct [drive] sampling_period"
        )
    off = t - t[0] - grid - start - drift * place
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) > JITTER * period:
        raise BadInput(
            f"{file}: row {worst} of column 't' is {off[worst]:.3g} s off an even clock, {JITTER:.0%} of "
            "sampling_period "
            f"({JITTER * period:.3g} s) is the most that leaves no doubt which sample it is; record with the drive's "
            "own clock"
        )
    text = (
        f"{file}: row {worst} of column 't' is {off[worst]:.3g} s off an even clock; rows are taken as the drive's own "
        f"samples, {period:.6g} s apart, values unchanged"
    )
    return grid, [Finding(file, "t", worst, text)]


def _check_clock(file: str, t: Array, step: Array, period: float) -> None:
    """Raise BadInput for a clock of another unit or rate, for gaps and for stamps that do not rise."""
    usual = float(np.median(step))
    for power, unit in ((1e3, "ms"), (1e6, "us"), (1e9, "ns")):
        if abs(usual / period / power - 1.0) < 0.3:
            raise BadInput(
                f"{file}: row 1 of column 't' is {step[0]:.6g} after row 0, sampling_period is {period:.6g} s; is t "
                f"in {unit}? "
                f'convert it to s or map it with unit = "{unit}"'
            )
    back = np.flatnonzero(step <= 0.0)
    if back.size:
        k = int(back[0])
        raise BadInput(
            f"{file}: row {k + 1} of column 't' is {t[k + 1]:.9g}, not after row {k} ({t[k]:.9g}); give enough "
            "digits and "
            "each sample once, in order"
        )
    if not 0.6 < usual / period < 1.4:
        raise BadInput(
            f"{file}: t steps by {usual:.6g} s in the middle, sampling_period is {period:.6g} s; correct [drive] "
            "sampling_period, or export every sample"
        )
    gap = np.flatnonzero(step > 1.5 * period)
    if gap.size:
        k = int(gap[0])
        raise BadInput(
            f"{file}: t steps by {step[k]:.6g} s from row {k} to {k + 1}, sampling_period is {period:.6g} s: "
            f"{max(math.floor(step[k] / period + 0.5) - 1, 1)} samples are missing ({gap.size} gaps); samples must "
            "follow without gaps, cut the recording there"
        )
