"""A drive, motor and inverter and effects, as C99 and as an FMU: what leaves the house."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from string import Template
from typing import Any, ClassVar

from estimators.contract import MAX_PERIOD
from model.effect_files import effects_of
from model.effects import library
from model.errors import BadInput
from model.parameters import Drive
from model.spline import SplineEnergy
from sandbox.drive.export.fmu import VERSIONS, unit_of
from sandbox.drive.export.source import HEADER, HERE, SOURCE, Number, source_of
from sandbox.output.tables import print_prose
from sandbox.plant import sets
from sandbox.public.calls import records_call
from sandbox.public.loading import load_motor
from sandbox.public.result import Result
from sandbox.public.runs import Effects

LOOP = "closed_loop.c"
LOAD, SPEED = 0.8, 0.05  # of rated current and speed, of the program that closes the loop
FASTEST = 2.0  # of rated speed: up to which steps are short enough, unless told


@dataclass(frozen=True, repr=False)
class DriveExport(Result):
    """Files (name and content) of a drive, and its parameters with their bounds."""

    command: ClassVar[str] = "export-drive"
    kinds: ClassVar[tuple[str, ...]] = ()
    motor: str
    effects: dict[str, float]
    top_speed_rpm: float
    files: dict[str, bytes]
    numbers: tuple[Number, ...]

    def summary(self) -> str:
        """Return whose drive it is, and its files."""
        return f"{self.motor}, {', '.join(self.files)}"

    def as_json(self) -> dict[str, Any]:
        """Return what `export-drive.json` holds beyond its header."""
        parameters = {n.name: _stated(n) for n in self.numbers}
        return {
            "motor": self.motor,
            "effects": dict(self.effects),
            "top_speed_rpm": self.top_speed_rpm,
            "parameters": parameters,
            "files": list(self.files),
        }

    def report(self) -> None:
        """Print the files, and how they are used."""
        print_prose(
            f"{self.motor} with {len(self.numbers)} parameters; steps for up to "
            f"{self.top_speed_rpm:g} rpm"
        )
        print_prose(f"files: {', '.join(self.files)}")
        print_prose(
            f"{HEADER} says how the drive is stepped; it is compiled by cc -std=c99 -O2 -c {SOURCE}"
        )

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write every file."""
        for name, content in self.files.items():
            (out / name).write_bytes(content)
        return {}


def _stated(number: Number) -> dict[str, Any]:
    kept = {k: v for k, v in asdict(number).items() if k not in ("name", "said")}
    return {k: None if v in (float("inf"), float("-inf")) else v for k, v in kept.items()}


@records_call
def export_drive(
    motor: str | Path | Drive = "ipm_exchanged",
    effects: Effects = None,
    *,
    top_speed_rpm: float | None = None,
    fmu: bool = True,
) -> DriveExport:
    """Return a drive with its effects as plain C99 and as FMUs: to run on a test rig, in Simulink,
    PLECS, OpenModelica.

    The C code is translated from the plant's own kernels, and computes the same numbers in double.

    Parameters
    ----------
    motor : str, Path or Drive
        See `load_motor`; a flux map goes along as constants.
    effects : mapping, str or Path, optional
        As in `simulate`: what the drive has from the start; every effect stays a parameter that can
        be changed.
    top_speed_rpm : float, optional
        rpm, mechanical, up to which the plant's steps are short enough; default: twice rated speed.
    fmu : bool, default True
        Whether to make the FMUs, too (FMI 2.0 and 3.0, co-simulation; takes a C compiler).

    Returns
    -------
    DriveExport
        `.files` (name and content), `.numbers` (parameters with unit and bounds), `.save(folder)`.

    Raises
    ------
    BadInput
        For names or values that are not known, or where there is no C compiler for an FMU.

    Examples
    --------
    >>> from sandbox import export_drive
    >>> list(export_drive("ipm_exchanged", {"dead_time.time": 2e-6}, fmu=False).files)
    ['sensorless_drive.h', 'sensorless_drive.c', 'closed_loop.c']
    """
    drive, added = load_motor(motor), effects_of(effects)
    rated = drive.motor.rated_speed_rpm
    top = FASTEST * rated if top_speed_rpm is None else top_speed_rpm
    if not 0.0 < top <= 1e6:
        raise BadInput(
            f"top_speed_rpm = {top:g} is out of range; give a value above 0, such as "
            f"{FASTEST * rated:g}"
        )
    values = sets.complete(drive.motor, drive.converter, added)
    library.check_inside(drive.motor, drive.converter, values)
    source = source_of(drive, values, top / rated * drive.motor.rated_omega)
    texts = {HEADER: source.header, SOURCE: source.source}
    if _closes(drive):
        texts[LOOP] = _loop(drive, source.motor)
    files = {name: text.encode() for name, text in texts.items()}
    for k in VERSIONS if fmu else ():
        files[f"{source.motor}_fmi{k}.fmu"] = unit_of(source, drive.converter.sampling_period, k)
    return DriveExport(drive.name, dict(added), top, files, source.numbers)


def _closes(drive: Drive) -> bool:
    """Return whether the program that closes the loop fits: an estimator in C, and a square
    wave."""
    return not isinstance(drive.motor.energy, SplineEnergy) and drive.injection.waveform == "square"


def _loop(drive: Drive, name: str) -> str:
    text = Template(HERE.joinpath(LOOP).read_text(encoding="utf-8"))
    load, speed = LOAD * drive.motor.rated_current, SPEED * drive.motor.rated_omega
    return text.substitute(
        motor=drive.name, cname=name, load=f"{load:.6g}", speed=f"{speed:.6g}", ring=MAX_PERIOD
    )
