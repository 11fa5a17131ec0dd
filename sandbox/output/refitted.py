"""What recordings made of a drive, as files for the simulator: `motor.toml` and `effects.toml`."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from model.confidence import Z95
from model.mapped import FOUND, OF_MAP, MappedMotor
from model.parameters import Drive, Motor
from sandbox.output.toml import key, toml_text

MOTOR, EFFECTS = "motor.toml", "effects.toml"
DIGITS = ".7g"  # of the line


@dataclass(frozen=True)
class Refitted:
    """A drive as recordings show it.

    drive: with the motor's values refitted (None where recordings say nothing of it); effects: what
    the plant has beside it, by public name, `bench.*` too; angles: rad by which recordings' angles
    are turned; offsets: A that a recording's three currents read too much; ci95: 95 % intervals of
    values in [motor] and of effects; units: of effects; residual: rms of each recording's currents,
    in noise floors, that the two files leave; said: where they come from, one sentence; at_bound:
    of values that stand at a bound, by name (`angles.<file>` of an angle), which bound that is;
    flux_map: what the motor's map file holds, where it is a new one.
    """

    drive: Drive | None
    effects: Mapping[str, float]
    angles: Mapping[str, float]
    ci95: Mapping[str, tuple[float, float]]
    units: Mapping[str, str]
    residual: Mapping[str, float]
    said: str
    at_bound: Mapping[str, str] = field(default_factory=dict)
    flux_map: bytes | None = None
    offsets: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def line(self) -> str:
        """The effects as --effects takes them in one line: of the library, so without `bench.*`."""
        own = {k: v for k, v in self.effects.items() if not k.startswith("bench.")}
        return ",".join(f"{name}={value:{DIGITS}}" for name, value in own.items())

    def as_json(self) -> dict[str, Any]:
        """Return what a result's JSON says of the files, under `simulator`."""
        return {
            "motor": None if self.drive is None else MOTOR,
            "effects": EFFECTS,
            "line": self.line,
            "residual": [{"file": file, "rms": rms} for file, rms in self.residual.items()],
        }

    def write(self, folder: Path) -> None:
        """Write motor.toml (and its flux map beside it) and effects.toml into a folder."""
        if self.drive is not None:
            (folder / MOTOR).write_text(self._motor(self.drive), encoding="utf-8")
            motor = self.drive.motor
            if isinstance(motor, MappedMotor) and motor.origin and self.flux_map is not None:
                (folder / FOUND).write_bytes(self.flux_map)
            elif (
                isinstance(motor, MappedMotor)
                and motor.origin
                and "dataset" not in motor.origin.table
            ):
                shutil.copyfile(motor.origin.path, folder / motor.origin.path.name)
        (folder / EFFECTS).write_text(self._effects(), encoding="utf-8")

    def _motor(self, drive: Drive) -> str:
        motor, of_map = drive.motor, set[str]()
        if isinstance(motor, MappedMotor):
            of_map = {*OF_MAP, "map_hash", "origin", "spline"}
        own = {
            f.name: getattr(motor, f.name)
            for f in dataclasses.fields(motor)
            if f.name not in of_map
        }
        ends = {k: list(v) for k, v in self.ci95.items() if k in own}
        spread = {
            k: (b - a) / (2.0 * Z95 * abs(own[k])) for k, (a, b) in ends.items() if own[k] != 0.0
        }
        head = (
            f"# {self.said}\n# [ci95]: 95 % intervals; [uncertainty]: relative deviations, "
            "for a campaign.toml\n\n"
        )
        values = toml_text([("[motor]", {k: v for k, v in own.items() if v != ""})], self.at_bound)
        rest = toml_text(
            [
                ("[flux_map]", _flux_map(motor) if self.flux_map is None else {"file": FOUND}),
                ("[ci95]", ends),
                ("[uncertainty]", spread),
                ("[drive]", dataclasses.asdict(drive.converter.at_full_rate())),
                ("[injection]", dataclasses.asdict(drive.injection)),
                ("[provenance]", drive.provenance),
            ]
        )
        return f"{head}{values}\n{rest}"

    def _effects(self) -> str:
        notes = {}
        for name in self.effects:
            low, high = self.ci95.get(name, (None, None))
            unit = self.units.get(name, "")
            found = "fitted beside" if low is None else f"95 % interval {low:.5g} to {high:.5g}"
            known = (unit, found, self.at_bound.get(name, ""))
            notes[name.removeprefix("bench.")] = ", ".join(filter(None, known))
        effects = {k: v for k, v in self.effects.items() if not k.startswith("bench.")}
        bench = {
            k.removeprefix("bench."): v for k, v in self.effects.items() if k.startswith("bench.")
        }
        also = f" beside {MOTOR}" if self.drive is not None else ""
        call = f"--motor {MOTOR} --effects {EFFECTS}"
        head = (
            f"# {self.said}\n# What the simulator has{also}: sensorless simulate {call}\n"
            f"# With the recordings' own voltages: sensorless replay CAMPAIGN {call}\n\n"
        )
        angles = {
            key(file): text for file in self.angles if (text := self.at_bound.get(f"angles.{file}"))
        }
        parts = (
            toml_text([("[effects]", _nested(effects)), ("[bench]", bench)], notes),
            toml_text([("[angles]", self.angles)], angles),
            toml_text([("[offsets]", {file: list(x) for file, x in self.offsets.items()})]),
            toml_text([("[residual]", self.residual)]),
        )
        return head + "\n".join(filter(None, parts))


def _flux_map(motor: Motor) -> dict[str, Any]:
    """Return [flux_map] of a motor that has one: the map lies beside the motor's file, unless it is
    a data set's."""
    if not isinstance(motor, MappedMotor) or motor.origin is None:
        return {}
    table = motor.origin.table
    return table if "dataset" in table else {**table, "file": motor.origin.path.name}


def _nested(names: Mapping[str, float]) -> dict[str, Any]:
    """Return dotted names as tables in tables."""
    out: dict[str, Any] = {}
    for name, value in names.items():
        place, *parts = out, *name.split(".")
        for part in parts[:-1]:
            place = place.setdefault(part, {})
        place[parts[-1]] = value
    return out
