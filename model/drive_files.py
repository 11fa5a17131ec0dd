"""Drives by name or file: built-in motors, those with a flux map, a user's TOML; defaults for what
is left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from model.errors import BadInput, unknown
from model.given import read_toml
from model.inverter_table import with_points
from model.mapped import mapped_motor, stand_in
from model.names import fitting
from model.parameters import (
    Converter,
    Drive,
    Injection,
    Limits,
    Motor,
    build,
    finite,
    table_of,
    texts,
)

MOTORS = Path(__file__).parent / "motors"
MAPPED = MOTORS / "mapped"  # those whose magnetic model is a flux map of the data-set registry
MAP_SUFFIXES = (".npz", ".mat", ".csv")
ASSUMED = "not stated, usual values"  # in a drive's provenance: keys of [drive] that sentences name
INJECTED = "injection not stated"  # the same of its amplitude
QUOTED = ("sampling_period", "dc_bus_voltage", "current_noise")
# allowed, not read with the drive
OTHER_TABLES = {
    "provenance",
    "campaign",
    "uncertainty",
    "background",
    "recording",
    "ci95",
    "limits",
}


def motor_names() -> list[str]:
    """Return the names of the motors that come with the package."""
    return sorted(p.stem for p in MOTORS.glob("*.toml"))


def mapped_names() -> list[str]:
    """Return the names of the motors whose flux map is a data set of its own (found on this
    machine, or fetched)."""
    return sorted(p.stem for p in MAPPED.glob("*.toml"))


def motor_file(name: str | Path) -> Path:
    """Return the TOML file of a built-in name, of a path, or beside a flux map; BadInput for an
    unknown one."""
    path = Path(name)
    if path.suffix.lower() in MAP_SUFFIXES:
        if path.with_suffix(".toml").is_file():
            return path.with_suffix(".toml")
        raise BadInput(
            f"flux map '{path}' alone gives no resistance, pole pairs and ratings; write them into "
            f"'{path.with_suffix('.toml').name}' beside it: [motor], and [flux_map] with "
            f'file = "{path.name}"'
        )
    if is_file_name(path):
        return path
    if path.is_dir() and str(name) not in (*motor_names(), *mapped_names()):
        raise BadInput(f"'{path}' is a folder; give a motor's TOML file, such as one in it")
    if str(name) in mapped_names():
        return MAPPED / f"{name}.toml"
    if str(name) not in motor_names():
        raise unknown("motor", name, [*motor_names(), *mapped_names()])
    return MOTORS / f"{name}.toml"


def describe(name: str) -> str:
    """Return the line that a built-in motor's file says of it."""
    return str(read_toml(motor_file(name))["motor"]["description"])


def fetched(name: str | Path) -> bool:
    """Tell whether a motor's flux map is a data set, which may have to be downloaded; BadInput for
    an unknown name."""
    table = read_toml(motor_file(name)).get("flux_map")
    return isinstance(table, dict) and "dataset" in table


def load_drive(name: str | Path) -> Drive:
    """Return the drive of a built-in name, a TOML file or the one beside a flux map; BadInput says
    what is wrong.

    Nothing is downloaded for a file that is wrong: it is read with a stand-in for its flux map
    first.
    """
    path = motor_file(name)
    data = read_toml(path)
    for table in data:
        if table not in {"motor", "flux_map", "drive", "injection"} | OTHER_TABLES:
            raise _in_file(
                path,
                unknown("table", table, ["motor", "flux_map", "drive", "injection", "provenance"]),
            )
    try:
        for motor in _motors(path, data):
            stated = with_points(table_of(data, "drive"), path.parent)
            usual = _converter_defaults(motor, stated)
            converter = build(Converter, {**usual, **stated}, "drive")
            injection = build(
                Injection,
                {**injection_defaults(motor, converter), **table_of(data, "injection")},
                "injection",
            )
    except BadInput as error:
        raise _in_file(path, error) from None
    provenance = all_stated(texts(table_of(data, "provenance")))
    if assumed := [k for k in QUOTED if k not in stated]:
        provenance = {**provenance, ASSUMED: ", ".join(assumed)}
    if "amplitude" not in table_of(data, "injection"):
        provenance = {**provenance, INJECTED: f"a usual amplitude, {injection.amplitude:g} V"}
    return Drive(motor, converter, injection, provenance)


def all_stated(provenance: Mapping[str, str]) -> dict[str, str]:
    """Return provenance without what a file does not state: of one that states every value in use,
    as a recorded campaign and a refitted motor's file do."""
    return {k: v for k, v in provenance.items() if k not in (ASSUMED, INJECTED)}


def load_limits(name: str | Path) -> Limits:
    """Return what [limits] of a drive's file says that its bench may do, nothing for a built-in
    name."""
    path = motor_file(name)
    try:
        return cast(Limits, build(Limits, table_of(read_toml(path), "limits"), "limits"))
    except BadInput as error:
        raise _in_file(path, error) from None


def _motors(path: Path, data: dict[str, Any]) -> Iterator[Motor]:
    """Yield the motor; before one with a flux map, a stand-in with the rest of it."""
    values = {"name": fitting(path.stem, "motor"), **table_of(data, "motor", required=True)}
    if "flux_map" not in data:
        yield build(Motor, values, "motor")
        return
    yield stand_in(values, table_of(data, "flux_map"))
    yield mapped_motor(values, table_of(data, "flux_map"), path.parent)


def is_file_name(path: Path) -> bool:
    """Tell whether a user means a file rather than a built-in name."""
    return path.suffix.lower() == ".toml" or len(path.parts) > 1


def _in_file(path: Path, error: BadInput) -> BadInput:
    return BadInput(f"{path.name}: {error}")


def _converter_defaults(motor: Motor, stated: Mapping[str, Any]) -> dict[str, Any]:
    """The paper's 4 kHz (or one sample a stated PWM period) and 400 V, with sensors of 0.2 % of
    rated current."""
    rated = motor.rated_current
    frequency = finite(stated.get("pwm_frequency"))
    return {
        "sampling_period": 1.0 / frequency if frequency and frequency > 0.0 else 250e-6,
        "dc_bus_voltage": 400.0,
        "current_resolution": 0.002 * rated,
        "current_noise": 0.0017 * rated,
    }


def injection_defaults(motor: Motor, converter: Converter) -> dict[str, Any]:
    """Return eight samples a period; a ripple of 20 % of rated current on d, as far as a quarter of
    the voltage (V) gives it."""
    frequency = 1.0 / (8.0 * converter.sampling_period)
    amplitude = 0.8 * frequency * motor.inductance_d * motor.rated_current
    return {"frequency": frequency, "amplitude": min(amplitude, 0.25 * converter.voltage_limit)}
