"""Recordings from elsewhere: a campaign folder, or tables of other programs with a column map, as
one Campaign.

IMPORTING.md beside this file describes the map; what was changed, lost or looks suspicious is in
`Campaign.findings`.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from model.array_types import Array
from model.errors import BadInput, as_toml, unknown
from model.given import check_toml, read_toml
from model.inverter_table import with_points
from model.number_table import Table
from model.parameters import Converter, finite
from sandbox.recordings.angle.zero import with_zeros
from sandbox.recordings.campaign import (
    ROTORS,
    TABLES,
    Campaign,
    CampaignRecording,
    Made,
    assemble,
    converter_of,
    entries_of,
    table_of,
)
from sandbox.recordings.checks.plausibility import check
from sandbox.recordings.column_map import (
    OURS,
    Column,
    has_voltages,
    lacks_voltages,
    parse_columns,
    source_columns,
    stamps_of,
    standard_columns,
)
from sandbox.recordings.conventions import with_link
from sandbox.recordings.copies import counted_once
from sandbox.recordings.findings import Finding
from sandbox.recordings.foreign import read_table
from sandbox.recordings.formats.parquet import INDEX
from sandbox.recordings.formats.presets import check_preset, preset_notes, with_preset
from sandbox.recordings.rows.disturbed import without_disturbed
from sandbox.recordings.rows.slow import with_slow_rows
from sandbox.recordings.stamps import (
    JITTER,
    Log,
    by_arrival,
    cut_at_gaps,
    cut_where_begun_again,
    parse_log,
    polled,
    stamp_jitter,
)

SILENT = 0.01  # of the sampling period: jitter that the format allows
DAY = 86400.0  # s
DRIFT = 0.01  # relative error of the recorded clock
EMPTY = "empty."  # before a phase: which of its rows had no number, beside the columns of a log
MAPS = re.compile(r"\bmap .* (?:with|= \{)")


@dataclasses.dataclass(frozen=True)
class Source:
    """A campaign's tables as its files state them, the column map, the file that errors name, and
    what to read."""

    folder: Path
    data: Mapping[str, Any]
    mapped: Mapping[str, Column]
    name: str
    entries: Sequence[tuple[str, str, str, float | None]]
    log: Log
    foreign: bool  # columns are mapped: others are passed over
    notes: tuple[str, ...] = ()  # what a preset says of itself
    # folder of the file for --columns, beside which its flux map may lie
    columns_folder: Path | None = None

    @property
    def map_folder(self) -> Path:
        """Folder in which the flux map lies: of the file for --columns, or else the recordings'."""
        file = table_of(self.data, "flux_map").get("file", "")
        here = (
            self.columns_folder is not None
            and isinstance(file, str)
            and file
            and (self.columns_folder / file).is_file()
        )
        return self.columns_folder if here and self.columns_folder is not None else self.folder

    @property
    def wanted(self) -> list[str]:
        """Return the columns asked for, none where names of a preset have to be looked for among
        all."""
        every = self.mapped.values()
        return [] if any(c.others for c in every) else [c.column for c in every]

    @property
    def remarks(self) -> list[Finding]:
        """Return what a preset says of itself as findings."""
        return [Finding(self.name, "", None, text) for text in self.notes]

    def table(self, file: str) -> Table:
        """Return one recording's table as it stands in its file."""
        table = read_table(self.folder / file, self.wanted, self.log.matrix)
        unknown_column = next(
            (n for n in table.columns if n not in OURS and not INDEX.fullmatch(n)), None
        )
        if not self.foreign and unknown_column is not None:
            raise BadInput(
                f"{file}: {unknown('column', unknown_column, OURS)}; map other names "
                "with --columns FILE.toml"
            )
        return table

    @property
    def pole_pairs(self) -> float:
        """Return the motor's pole pairs where a mechanical angle needs them, else 1."""
        return _pole_pairs(self.data, self.mapped, self.name)


def check_asked(columns: str | Path | None, preset: str | None) -> None:
    """Raise BadInput for a preset that is none, and for a column map that does not exist."""
    if preset is not None:
        check_preset(preset)
    if columns is not None:
        check_toml(Path(columns))


def source_of(
    path: str | Path,
    columns: str | Path | None = None,
    preset: str | None = None,
    rotors: Sequence[str] = ROTORS,
) -> Source:
    """Return what a folder (or one table in it) and its column map state, no recording read;
    BadInput says what is wrong."""
    path = Path(path)
    check_asked(columns, preset)
    folder = path if path.is_dir() else path.parent
    if not path.exists():
        raise BadInput(f"campaign '{path}' does not exist; give its folder, or one table in it")
    if not (path.is_dir() or path.is_file()):
        raise BadInput(
            f"campaign '{path}' is a pipe or a device; give a folder, or one table in it"
        )
    data, mapped, source = _tables(folder, None if columns is None else Path(columns), preset)
    entries = entries_of(data, rotors, source)
    if path.is_file():
        entries = [e for e in entries if (folder / e[0]).resolve() == path.resolve()]
        if not entries:
            raise BadInput(
                f'{source}: no [[recording]] with file = "{path.name}"; add one with its '
                "rotor and injection_axis"
            )
    log = parse_log(table_of(data, "log"), source)
    notes = () if preset is None else preset_notes(preset)
    return Source(
        folder,
        data,
        mapped,
        source,
        entries,
        log,
        columns is not None or preset is not None,
        notes,
        None if columns is None else Path(columns).parent,
    )


def read_recordings(
    path: str | Path,
    columns: str | Path | None = None,
    rotors: Sequence[str] = ROTORS,
    preset: str | None = None,
) -> Campaign:
    """Return the campaign of a folder (or of one table in it), checked for wrong units, signs,
    order and sensors.

    `columns` is a TOML file that maps names and units and may hold the tables of campaign.toml;
    `preset` names a program whose names and units are known; `rotors` limits the recordings read.
    Raises BadInput naming file, column and row for what cannot be right.
    """
    source = source_of(path, columns, preset, rotors)
    campaign = unchecked(source)
    try:
        found = (
            *campaign.findings,
            *check(campaign.recordings, campaign.drive, campaign.uncertainty),
        )
    except BadInput as error:
        raise BadInput(str(error) if source.foreign else how_to_map(str(error))) from None
    return with_link(dataclasses.replace(campaign, findings=found))


def how_to_map(text: str) -> str:
    """Return a sentence that says to map a column with where a map stands, for a campaign that has
    none."""
    return f"{text} ([columns] in a file for --columns)" if MAPS.search(text) else text


def unchecked(source: Source) -> Campaign:
    """Return the campaign of a source before its recordings are checked against each other and the
    motor."""
    try:
        converter = converter_of(source.data, source.folder)
    except BadInput as error:
        raise BadInput(f"{source.name}: {error}") from None
    recordings: list[CampaignRecording] = []
    findings = source.remarks
    noises, lacking = [0.0], list[Finding]()
    for file, rotor, axis, link in source.entries:
        table = source.table(file)
        if not has_voltages(table, source.mapped) and len(lacking) + 1 < len(source.entries):
            why = lacks_voltages(table, source.mapped)
            lacking.append(
                Finding(
                    file, "u_alpha", None, f"{file}: {why}; left out, as other recordings have them"
                )
            )
            continue
        nominal = link or converter.dc_bus_voltage
        held = source_columns(table, source.mapped)
        pieces = _logs(
            file, table, rotor == "locked", nominal, converter.sampling_period, source, findings
        )
        del table  # what is not used of it takes memory
        for piece, values, made in pieces:
            for name, own, noise, starts_at in _timed(piece, values, converter, source, findings):
                of = "" if name == file else file
                columns = {n: x for n, x in own.items() if not n.startswith(EMPTY)}
                empty = {n.removeprefix(EMPTY): own[n] > 0.0 for n in own.keys() - columns.keys()}
                recordings.append(
                    CampaignRecording(
                        name, rotor, axis, columns, link, of, starts_at, {}, held, made, empty
                    )
                )
                noises.append(noise)
    findings += lacking
    data = dict(source.data)
    if source.map_folder != source.folder and "drive" in data:
        data["drive"] = with_points(table_of(data, "drive"), source.folder)
    if max(noises) > 0.0:
        stated = table_of(data, "drive")
        data["drive"] = {
            **stated,
            "current_noise": math.hypot(converter.current_noise, max(noises)),
        }
    campaign = assemble(
        data, tuple(recordings), source.folder.resolve().name, source.name, source.map_folder
    )
    campaign = dataclasses.replace(campaign, findings=(*findings, *campaign.findings))
    return with_slow_rows(counted_once(with_zeros(without_disturbed(campaign))))


def _logs(
    file: str,
    table: Table,
    locked: bool,
    link: float,
    period: float,
    source: Source,
    findings: list[Finding],
) -> list[tuple[str, dict[str, Array], Made | None]]:
    """Return the logs that one table holds one after another: name, the standard columns, of what
    the angle was made.

    An angle is followed from row to row, so each log is read by itself.  What is said of all is
    said once.
    """
    parts, cut = cut_where_begun_again(file, table, stamps_of(file, table, source.mapped), period)
    findings += cut
    out, said = [], set[str]()
    for name, first, part in parts:
        try:
            values, notes, made, empty = standard_columns(
                name, part, source.mapped, source.pole_pairs, link, locked=locked, period=period
            )
        except BadInput as error:
            if name == file:
                raise
            raise BadInput(
                f"{error} ({name} is {file} from row {first} on; cut the file there)"
            ) from None
        if cut and "t" in values:
            values["t"] = values["t"] - values["t"][0]
        for note in notes:
            text = note.text.replace(name, file) if note.row is None else note.text
            if text not in said:
                findings.append(
                    dataclasses.replace(note, file=file if note.row is None else name, text=text)
                )
            said.add(text)
        # cut and timed with the rest
        out.append((name, values | {EMPTY + phase: x for phase, x in empty.items()}, made))
    return out


def _timed(
    file: str,
    values: dict[str, Array],
    converter: Converter,
    source: Source,
    findings: list[Finding],
) -> list[tuple[str, dict[str, Array], float, float]]:
    """Return the recordings that one table becomes on the drive's grid: name, columns, noise (A)
    that this adds, s from the table's beginning to the first row."""
    period, t = converter.sampling_period, values.get("t")
    if t is not None and len(t) > 1 and source.log.stamps == "arrival":
        grid, finding = by_arrival(file, t, period)
        findings.append(finding)
        return [(file, {**values, "t": grid}, 0.0, 0.0)]
    if t is not None and len(t) > 1 and source.log.stamps == "polled":
        count = (
            math.tau * source.pole_pairs / converter.encoder_counts
            if converter.encoder_counts
            else 0.0
        )
        own, noise, finding = polled(file, values, period, stamp_jitter(t, values["theta"], count))
        findings.append(finding)
        return [(file, own, noise, 0.0)]
    pieces, cut = cut_at_gaps(file, values, period)
    findings += cut
    out = []
    for name, piece in pieces:
        stamps = piece.get("t")
        starts_at = 0.0 if stamps is None or name == file else float(stamps[0])
        stamps = stamps if stamps is None or name == file else stamps - stamps[0]
        even, moved = regular(name, stamps, len(piece["theta"]), period)
        findings += moved
        out.append((name, {**piece, "t": even}, 0.0, starts_at))
    return out


def _tables(
    folder: Path, columns: Path | None, preset: str | None
) -> tuple[dict[str, Any], dict[str, Column], str]:
    """Return the tables of campaign.toml and of the column file together, the map, and the file to
    name in errors."""
    own = folder / "campaign.toml"
    if columns is None and not own.is_file() and preset is not None:
        raise BadInput(
            f"'{folder}' holds no campaign.toml; preset '{preset}' names the columns alone: write "
            "[drive], [motor] and one [[recording]] a table into campaign.toml, or into a file "
            "for --columns (`sensorless check` without the preset drafts one)"
        )
    if columns is None and not own.is_file():
        raise BadInput(
            f"'{folder}' holds no campaign.toml, so its drive, motor and recordings are unknown; "
            "write one, or give --columns FILE.toml for tables of other programs (`sensorless "
            "check` drafts it; sandbox/recordings/IMPORTING.md)"
        )
    data = read_toml(own) if own.is_file() or columns is None else {}
    source, mapped = own.name, {}
    if columns is not None:
        extra = read_toml(columns)
        if not extra:
            raise BadInput(
                f"{columns.name} states nothing; write [columns] with the log's names into it, or "
                "leave --columns out"
            )
        mapped = parse_columns(extra, columns.name)
        extra.pop("columns", None)
        for name in extra:
            if name not in TABLES:
                raise BadInput(f"{columns.name}: {unknown('table', name, ('columns', *TABLES))}")
            if name in data:
                raise BadInput(
                    f"{columns.name}: [{name}] stands in campaign.toml too; keep one of them"
                )
        source = own.name if data else columns.name
        data = {**data, **extra}
    if preset is not None:
        data, mapped = with_preset(preset, data, mapped)
    return data, mapped, source


def _pole_pairs(data: Mapping[str, Any], mapped: Mapping[str, Column], source: str) -> float:
    """Return the motor's pole pairs where a mechanical angle needs them, else 1."""
    if not any(c.mechanical for c in mapped.values()):
        return 1.0
    stated = table_of(data, "motor").get("pole_pairs")
    pairs = finite(stated)
    if pairs is None or not 1.0 <= pairs <= 100.0:
        raise BadInput(
            f"{source}: [motor] pole_pairs = {as_toml(stated)} cannot turn a mechanical "
            "angle; give it in [1, 100]"
        )
    return pairs


def regular(file: str, t: Array | None, n: int, period: float) -> tuple[Array, list[Finding]]:
    """Return sample instants (s) on the drive's own grid; BadInput where the stamps leave doubt
    which sample is meant.

    Values are kept, not interpolated: the drive samples by its own clock, jitter is the logger's.
    """
    grid = np.arange(n, dtype=np.float64) * period
    if t is None:
        text = (
            f"{file}: column 't' is missing, rows are taken as {period:.6g} s apart; lost "
            "samples stay unseen"
        )
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
            f"{file}: t advances by {period + drift:.6g} s a row, sampling_period is {period:.6g} "
            "s (1 % at most); correct [drive] sampling_period"
        )
    off = t - t[0] - grid - start - drift * place
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) > JITTER * period:
        raise BadInput(
            f"{file}: row {worst} of column 't' is {off[worst]:.3g} s off an even clock, "
            f"{JITTER:.0%} of "
            "sampling_period "
            f"({JITTER * period:.3g} s) is the most that leaves no doubt which sample it "
            "is; record with the drive's "
            'own clock, or say what stamps are: [log] stamps = "arrival" (rows complete) '
            'or "polled" (interpolated)'
        )
    text = (
        f"{file}: row {worst} of column 't' is {off[worst]:.3g} s off an even clock; rows are "
        f"taken as the drive's own samples, {period:.6g} s apart, values unchanged"
    )
    return grid, [Finding(file, "t", worst, text)]


def _check_clock(file: str, t: Array, step: Array, period: float) -> None:
    """Raise BadInput for a clock of another unit or rate, for gaps and for stamps that do not
    rise."""
    usual = float(np.median(step))
    for power, unit in ((1e3, "ms"), (1e6, "us"), (1e9, "ns")):
        if abs(usual / period / power - 1.0) < 0.3:
            raise BadInput(
                f"{file}: row 1 of column 't' is {step[0]:.6g} after row 0, "
                f"sampling_period is {period:.6g} s; is t "
                f"in {unit}? "
                f'convert it to s or map it with unit = "{unit}"'
            )
    if abs(usual / period * DAY - 1.0) < 0.3:
        raise BadInput(
            f"{file}: row 1 of column 't' is {step[0]:.3g} after row 0, sampling_period is "
            f"{period:.6g} s; is t in days, as spreadsheets keep dates? map it with scale = {DAY:g}"
        )
    back = np.flatnonzero(step <= 0.0)
    if back.size:
        k = int(back[0])
        raise BadInput(
            f"{file}: row {k + 1} of column 't' is {t[k + 1]:.9g}, not after row {k} ({t[k]:.9g}); "
            "give enough digits and each sample once, in order"
        )
    if not 0.6 < usual / period < 1.4:
        raise BadInput(
            f"{file}: t steps by {usual:.6g} s in the middle, sampling_period is {period:.6g} s; "
            "correct [drive] sampling_period, or export every sample"
        )
    gap = np.flatnonzero(step > 1.5 * period)
    if gap.size:
        k = int(gap[0])
        raise BadInput(
            f"{file}: t steps by {step[k]:.6g} s from row {k} to {k + 1}, sampling_period is "
            f"{period:.6g} s: {max(math.floor(step[k] / period + 0.5) - 1, 1)} samples are missing "
            f"({gap.size} gaps); samples must follow without gaps, cut the recording there"
        )
