"""A measurement campaign on one drive: a folder with `campaign.toml` and one Parquet table a
recording.

Read and checked, or written whole; the format is the one of a bench's engineer (units SI, angles
electrical, transformation amplitude-invariant).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.drive_files import injection_defaults
from model.effects.card import Ordinary, scales
from model.errors import BadInput, as_toml, brief, unknown
from model.given import read_toml
from model.inverter_table import with_points
from model.names import check_file, check_name, fitting
from model.parameters import (
    ROTORS,
    Converter,
    Drive,
    Injection,
    Limits,
    Motor,
    build,
    finite,
    texts,
)
from model.ratings import STANDS_IN
from sandbox.recordings.findings import Finding
from sandbox.recordings.formats.log_table import first_beyond
from sandbox.recordings.formats.parquet import read_parquet
from sandbox.recordings.nominal_motor import RATED, Reached, nominal_motor

if TYPE_CHECKING:
    import pandas

REQUIRED = ("t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "u_dc")
OPTIONAL = ("load_torque", "temperature", "torque", "theta_hat")
UNITS = {
    "t": "s",
    "u_alpha": "V",
    "u_beta": "V",
    "i_a": "A",
    "i_b": "A",
    "i_c": "A",
    "theta": "rad",
    "u_dc": "V",
    "load_torque": "N m",
    "temperature": "degC",
    "torque": "N m",
    "theta_hat": "rad",
}
AXES = ("d", "q", "none")
# deviations in shares: a narrower one is no longer told from none by rounding
RELATIVE = (1e-9, 100.0)
MACHINE = (
    "resistance",
    "magnet_flux",
    "inductance_d",
    "inductance_q",
    "alpha_30",
    "alpha_12",
    "alpha_40",
    "alpha_22",
    "alpha_04",
    "inertia",
    "viscous_friction",
)
STATED = {  # standard deviations that a campaign may state: least and largest but 0, which is none
    "uncertainty": dict.fromkeys(MACHINE, RELATIVE),
    "background": {
        "current_gain": RELATIVE,
        "current_offset": (1e-9, 1e4),
        "encoder_offset": (1e-9, math.pi),
        "dead_time": (1e-15, 1e-3),
        "load_torque_gain": RELATIVE,
        "load_torque_offset": (1e-9, 1e6),
    },
}
OWN_UNITS = {
    "current_offset": " A",
    "encoder_offset": " rad",
    "dead_time": " s",
    "load_torque_offset": " N m",
}
TABLES = (
    "campaign",
    "drive",
    "motor",
    "flux_map",
    "uncertainty",
    "background",
    "injection",
    "provenance",
    "recording",
    "log",
    "limits",
)
EXAMPLE = Path(__file__).parent / "example"  # the sample campaign (experiments/example_campaign.py)
LARGEST = 1e12  # of any recorded number, in its unit
LARGEST_CURRENT = 1e5  # A peak, as of rated_current in [motor]
LINK = (0.1, 1e5)  # V, as in [drive]
OF_RECORDING = ("file", "rotor", "injection_axis", "dc_bus_voltage")
NO_LIMITS = Limits()


@dataclass(frozen=True)
class Made:
    """What an angle was made of that a log does not hold.

    of: the log's column, or what stands in for one; count: rad electrical between which its
    readings lie; zero: rad, standard deviation of its zero once that is looked for; either_way:
    whether its sense is unknown, too, as of states that tell a sixth of a turn; turned: rad by
    which it was turned to that zero.
    """

    of: str
    count: float
    zero: float = 0.0
    either_way: bool = False
    turned: float = 0.0


@dataclass(frozen=True, repr=False)
class CampaignRecording:
    """One table of a campaign; every column is an attribute too, float64, shape (n,).

    dc_bus_voltage: V, the nominal link voltage it was recorded at, where that is not [drive]'s.

    Of a part of a longer recording: of: its file; starts_at: s from its beginning to the first row
    here; settling: the rows before that, which a replay goes through first and which are no part of
    its residual.
    source: the log's own columns by standard name, of what the log holds; empty where the log has
    our names.
    made: of what its angle was made, None where it was read.
    empty: by phase, which rows (n,) of its current had no number.
    """

    file: str
    rotor: str
    injection_axis: str
    columns: Mapping[str, Array]
    dc_bus_voltage: float | None = None
    of: str = ""
    starts_at: float = 0.0
    settling: Mapping[str, Array] = field(default_factory=dict)
    source: Mapping[str, str] = field(default_factory=dict)
    made: Made | None = None
    empty: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_file(self.file, "recording's file")
        if self.rotor not in ROTORS:
            raise BadInput(f"{self.file}: {unknown('rotor', self.rotor, ROTORS)}")
        if self.injection_axis not in AXES:
            raise BadInput(f"{self.file}: {unknown('injection_axis', self.injection_axis, AXES)}")
        link = self.dc_bus_voltage
        if link is not None and not LINK[0] <= link <= LINK[1]:
            raise BadInput(
                f"{self.file}: dc_bus_voltage = {brief(link)} is no link voltage; give one in "
                f"[{LINK[0]:g}, {LINK[1]:g}] V"
            )
        _check_columns(self.file, self.columns)

    def __getattr__(self, name: str) -> Array:
        columns = self.__dict__.get("columns", {})
        if name in columns:
            return np.asarray(columns[name])
        raise AttributeError(name)

    def __getitem__(self, column: str) -> Array:
        if column not in self.columns:
            raise unknown(f"column of {self.file}", column, self.columns)
        return np.asarray(self.columns[column])

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.columns})

    def __repr__(self) -> str:
        return (
            f"<CampaignRecording: {self.file}, rotor {self.rotor}, {self.t.size} samples, "
            f"{np.ptp(self.t):.4g} s>"
        )

    def in_volts(self, converter: Converter) -> CampaignRecording:
        """Return the recording with commands in volts that the drive divides by u_dc, whatever they
        are (`Converter.command`)."""
        if converter.command == "volts":
            return self
        nominal = self.dc_bus_voltage or converter.dc_bus_voltage
        factor = self.u_dc if converter.command == "duties" else self.u_dc / nominal
        volts = {name: factor * self[name] for name in ("u_alpha", "u_beta")}
        return dataclasses.replace(self, columns={**self.columns, **volts})

    def to_pandas(self) -> pandas.DataFrame:
        """Return the columns as a data frame, units in `.attrs["units"]`; BadInput where pandas is
        missing."""
        from sandbox.output.columns import Column, frame_of, table_of

        return frame_of(
            table_of({name: Column(values, UNITS[name]) for name, values in self.columns.items()})
        )

    @property
    def origin(self) -> str:
        """File of the recording that this one is a part of, or its own."""
        return self.of or self.file

    def with_settling(self) -> CampaignRecording:
        """Return it with the rows in which states settle as rows of its own."""
        if not self.settling:
            return self
        columns = {
            name: np.concatenate([self.settling[name], x]) for name, x in self.columns.items()
        }
        step = float(columns["t"][0])
        return dataclasses.replace(
            self, columns=columns, settling={}, starts_at=max(0.0, self.starts_at + step)
        )

    @property
    def current(self) -> tuple[Array, Array]:
        """i_alpha, i_beta (A) as the three sensors give them."""
        a, b, c = self.columns["i_a"], self.columns["i_b"], self.columns["i_c"]
        return (2.0 * a - b - c) / 3.0, (b - c) / math.sqrt(3.0)


@dataclass(frozen=True)
class Excerpt:
    """A part that stands for a longer recording: its name, that recording's, first row, rows, and
    rows there."""

    file: str
    of: str
    first: int
    rows: int
    of_rows: int


@dataclass(frozen=True)
class Excerpts:
    """The parts of a campaign that are used (`sandbox.gap.excerpts`); the whole campaign's samples
    and files, and of how many samples the currents lie within the motor's flux map (all of them
    where it has none)."""

    parts: tuple[Excerpt, ...]
    samples_recorded: int
    files: tuple[str, ...]
    samples_within_map: int

    @property
    def samples_used(self) -> int:
        """Samples of the parts."""
        return sum(e.rows for e in self.parts)

    @property
    def unused(self) -> list[str]:
        """Recordings of which no part is used."""
        return [file for file in self.files if file not in {e.of for e in self.parts}]


def seen(deviation: float) -> float:
    """Return a relative deviation of the stated from the true value, as [uncertainty] has it, as
    seen from the stated one.

    True = stated/(1 + x): three deviations too low a statement, 1 - 3 s of the truth, is 3 s/(1 - 3
    s) of itself off.
    """
    return deviation / (1.0 - min(3.0 * deviation, 0.6))


@dataclass(frozen=True, repr=False)
class Campaign:
    """A drive's nominal model and what was recorded on it.

    `rated_from_data`: the rated values missing in [motor] were taken from the recordings (largest
    current and speed in them, and the torque that current gives on the magnet flux): scales, not
    ratings.  `limits`: what the bench may do when it records more.  `excerpts`: where the
    recordings are parts of longer ones.
    """

    name: str
    drive: Drive
    recordings: tuple[CampaignRecording, ...]
    uncertainty: Mapping[str, float]
    background: Mapping[str, float]
    rated_from_data: bool
    # what `sandbox.recordings.importing` noticed; empty from `read_folder`
    findings: tuple[Finding, ...] = ()
    limits: Limits = NO_LIMITS
    excerpts: Excerpts | None = None
    stand_ins: tuple[str, ...] = ()  # values of [motor] that are not stated
    # A rms that commands between the rows of a slow log leave open, or an angle of states
    unseen: float = 0.0

    def __getitem__(self, file: str) -> CampaignRecording:
        for r in self.recordings:
            if file in (r.file, Path(r.file).stem):
                return r
        raise unknown("recording", file, [r.file for r in self.recordings])

    def __iter__(self) -> Iterator[CampaignRecording]:
        return iter(self.recordings)

    def __len__(self) -> int:
        return len(self.recordings)

    def _ipython_key_completions_(self) -> list[str]:
        return [r.file for r in self.recordings]

    def __repr__(self) -> str:
        files = ", ".join(r.file for r in self.recordings)
        return f"<Campaign: {self.name}, {len(self.recordings)} recordings: {files}>"

    def deviation_of(self, o: Ordinary, stated: float) -> float:
        """Return the standard deviation of an ordinary deviation in the parameter's unit, as stated
        here or usual; of a value of the motor, of the truth about what is stated."""
        if o.of_motor:
            return seen(self.uncertainty.get(o.stated, o.usual)) * abs(stated)
        usual = o.usual * scales(self.drive.motor, self.drive.converter)[o.relative_to]
        return o.share * self.background.get(o.stated, usual)

    def to_pandas(self) -> pandas.DataFrame:
        """Return all recordings below each other, the first column `file`; BadInput where pandas is
        missing."""
        from sandbox.output.columns import together

        return together({r.file: r.to_pandas() for r in self.recordings})


def read_folder(folder: str | Path, rotors: Sequence[str] = ROTORS) -> Campaign:
    """Read a campaign folder; BadInput names the file, column, row or key that is wrong.

    `rotors` limits the tables read (identification needs the locked ones only).
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise BadInput(
            f"campaign '{folder}' is not a folder; give the folder that holds campaign.toml"
        )
    data = read_toml(folder / "campaign.toml")
    recordings = tuple(
        CampaignRecording(file, rotor, axis, read_parquet(folder / file), link)
        for file, rotor, axis, link in entries_of(data, rotors)
    )
    return assemble(data, recordings, folder.name, folder=folder)


def assemble(
    data: Mapping[str, Any],
    recordings: tuple[CampaignRecording, ...],
    name: str,
    source: str = "campaign.toml",
    folder: Path = Path(),
) -> Campaign:
    """Return the campaign of parsed tables `data` and its recordings.

    source: the file an error names; folder: in which a nominal model's [flux_map] names its file.
    """
    if "rated_current" not in data.get("motor", {}):  # the largest reading stands in
        for r in recordings:
            _refuse_currents(r)
    try:
        own_name = _name(data, name)
        stated = {"name": _name(data, "campaign"), **table_of(data, "motor")}
        flux_map = table_of(data, "flux_map") if "flux_map" in data else None
        converter = converter_of(data, folder)
        reached = _reached(recordings)
        motor, missing = nominal_motor(stated, flux_map, reached, folder, converter.dc_bus_voltage)
        injection = _injection(data, recordings, motor, converter)
        uncertainty, background = _numbers(data, "uncertainty"), _numbers(data, "background")
        limits = cast(Limits, build(Limits, table_of(data, "limits"), "limits"))
    except BadInput as error:
        raise BadInput(f"{source}: {error}") from None
    for r in recordings:
        _check_period(r, converter.sampling_period)
    recordings = tuple(r.in_volts(converter) for r in recordings)
    converter = dataclasses.replace(converter, command="volts")
    provenance = texts(table_of(data, "provenance"))
    return Campaign(
        own_name,
        Drive(motor, converter, injection, {**provenance, **_stand_ins(missing, reached)}),
        recordings,
        uncertainty,
        background,
        any(k in RATED for k in missing),
        limits=limits,
        stand_ins=missing,
    )


def _stand_ins(missing: Sequence[str], reached: Reached | None) -> dict[str, str]:
    """Return what stands in for values that a campaign does not state, as provenance."""
    speed = (
        "largest mean speed of the recordings"
        if reached and reached.speed
        else "what the link gives rated current"
    )
    said = {
        "rated_current": "largest of the recordings",
        "rated_torque": "what rated_current gives",
        "rated_speed_rpm": speed,
        "inertia": f"{STANDS_IN}; no rotor is free, so that nothing here tells it",
    }
    return {k: f"not stated; stands in: {said[k]}" for k in missing}


def _reached(recordings: Sequence[CampaignRecording]) -> Reached | None:
    """Return how far recordings go, None where there are none."""
    if not recordings:
        return None
    current = max(float(np.max(np.hypot(*r.current))) for r in recordings)
    moving = [r for r in recordings if r.rotor != "locked"]
    speed = max((float(np.ptp(r.theta) / (np.ptp(r.t) or math.inf)) for r in moving), default=0.0)
    return Reached(current, speed, any(r.rotor == "free" for r in recordings))


def _refuse_currents(r: CampaignRecording) -> None:
    """Raise BadInput for a reading that is no motor's current."""
    for name in ("i_a", "i_b", "i_c"):
        bad = first_beyond(r[name], LARGEST_CURRENT)
        if bad is not None:
            raise BadInput(
                f"{r.file}: row {bad} of column '{name}' is {r[name][bad]:.6g} A, more "
                "than a motor's current "
                f"({LARGEST_CURRENT:g} A); leave the recording out, or map the unit it is in"
            )


def _injection(
    data: Mapping[str, Any],
    recordings: Sequence[CampaignRecording],
    motor: Motor,
    converter: Converter,
) -> Injection:
    """Return [injection]; where nothing was injected and nothing is stated, what the motor would
    usually be given."""
    stated = table_of(data, "injection")
    if not stated and all(r.injection_axis == "none" for r in recordings):
        stated = injection_defaults(motor, converter)
    return cast(Injection, build(Injection, stated, "injection"))


def table_of(data: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a TOML table, empty where absent; BadInput where it is something else."""
    table = data.get(name, {})
    if not isinstance(table, dict):
        raise BadInput(f"'{name}' is not a table; write [{name}]")
    return dict(table)


def _name(data: Mapping[str, Any], usual: str) -> str:
    stated = table_of(data, "campaign")
    return (
        check_name(stated["name"], "[campaign] name")
        if "name" in stated
        else fitting(usual, "campaign")
    )


def converter_of(data: Mapping[str, Any], folder: Path = Path()) -> Converter:
    """Return [drive] of a campaign's tables, sensors ideal where it does not state them; folder: of
    files it names."""
    values = {
        "current_resolution": 0.0,
        "current_noise": 0.0,
        **with_points(table_of(data, "drive"), folder),
    }
    return cast(Converter, build(Converter, values, "drive"))


def entries_of(
    data: Mapping[str, Any], rotors: Sequence[str] = ROTORS, source: str = "campaign.toml"
) -> list[tuple[str, str, str, float | None]]:
    """Return (file, rotor, injection_axis, dc_bus_voltage) of the [[recording]] entries whose rotor
    is wanted."""
    for table in data:
        if table == "columns":
            raise BadInput(
                f"{source}: [columns] stands in a file of its own; move it, say into columns.toml, "
                "and give --columns columns.toml (the other tables may stay)"
            )
        if table not in TABLES:
            raise BadInput(f"{source}: {unknown('table', table, TABLES)}")
    entries = data.get("recording", [])
    if not isinstance(entries, list) or not entries:
        raise BadInput(f"{source}: no [[recording]] entry; list at least one table of the campaign")
    found = [_entry(e, source) for e in entries]
    for k, (file, *_) in enumerate(found):
        if file in [f for f, *_ in found[:k]]:
            raise BadInput(
                f"{source}: two [[recording]] entries name '{file}'; list each table once"
            )
    return [e for e in found if e[1] in rotors or e[1] not in ROTORS]


def _entry(entry: Any, source: str) -> tuple[str, str, str, float | None]:
    if not isinstance(entry, dict) or "file" not in entry:
        raise BadInput(
            f"{source}: a [[recording]] lacks 'file'; name its table, e.g. file = "
            '"locked_d.parquet"'
        )
    for key in entry:
        if key not in (*OF_RECORDING, "note"):
            raise BadInput(f"{source}: {unknown('key in [[recording]]', key, OF_RECORDING)}")
    for key in OF_RECORDING[:3]:
        if not isinstance(entry.get(key, ""), str):
            raise BadInput(
                f"{source}: {key} = {as_toml(entry[key])} in [[recording]] is not a "
                "text; put it in quotes"
            )
    try:
        file = check_file(entry["file"], "file in [[recording]]")
    except BadInput as error:
        raise BadInput(f"{source}: {error}") from None
    link = finite(entry.get("dc_bus_voltage"))
    if link is None and "dc_bus_voltage" in entry:
        stated = brief(entry["dc_bus_voltage"])
        raise BadInput(
            f"{source}: dc_bus_voltage = {stated} in [[recording]] is no number; give volts > 0"
        )
    return file, entry.get("rotor", ""), entry.get("injection_axis", "none"), link


def _check_columns(file: str, columns: Mapping[str, Array]) -> None:
    for name in REQUIRED:
        if name not in columns:
            raise BadInput(f"{file}: column '{name}' is missing; needed are {', '.join(REQUIRED)}")
    for name in columns:
        if name not in REQUIRED + OPTIONAL:
            raise BadInput(f"{file}: {unknown('column', name, REQUIRED + OPTIONAL)}")
    n = len(columns["t"])
    for name, values in columns.items():
        if values.ndim != 1 or len(values) != n:
            raise BadInput(
                f"{file}: column '{name}' has {values.size} rows, 't' has {n}; they must be equal"
            )
        if n < 2:
            raise BadInput(f"{file}: {n} rows; a recording needs at least 2")
        bad = first_beyond(values, LARGEST)
        if bad is not None:
            raise BadInput(
                f"{file}: row {bad} of column '{name}' is {values[bad]}; give finite numbers only, "
                f"of at most {LARGEST:.0e} in size"
            )


def _check_period(r: CampaignRecording, period: float) -> None:
    step = np.diff(r.columns["t"])
    bad = np.flatnonzero(np.abs(step - period) > 0.01 * period)
    if bad.size:
        k = int(bad[0])
        raise BadInput(
            f"{r.file}: t steps by {step[k]:.6g} s from row {k} to {k + 1}, sampling_period is "
            f"{period:.6g} s; samples must follow without gaps"
        )


def _numbers(data: Mapping[str, Any], table: str) -> dict[str, float]:
    values = table_of(data, table)
    for key, value in values.items():
        if key not in STATED[table]:
            raise unknown(f"key in [{table}]", key, STATED[table])
        number, (least, largest) = finite(value), STATED[table][key]
        if number is None or not (number == 0.0 or least <= number <= largest):
            raise BadInput(
                f"[{table}] {key} = {as_toml(value)} is no standard deviation; give one from "
                f"{least:g} to {largest:.4g}{OWN_UNITS.get(key, '')}, or 0"
            )
    return {k: float(v) for k, v in values.items()}
