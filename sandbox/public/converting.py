"""A motor's file from configurations of other tools and from data sheets' values."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from model.ratings import cautions
from model.tools.stated_motor import StatedMotor, stated_motor
from sandbox.output.tables import print_prose, print_table
from sandbox.output.toml import toml_text
from sandbox.public.calls import records_call
from sandbox.public.result import Result

FILE = "motor.toml"


@dataclass(frozen=True, repr=False)
class ConvertedMotor(Result):
    """A drive as other tools and people state it, and each conversion."""

    command: ClassVar[str] = "motor"
    kinds: ClassVar[tuple[str, ...]] = ()
    stated: StatedMotor

    def summary(self) -> str:
        """Return the motor, the tool whose file was read, and how many values it has."""
        program = f" of {self.stated.program}" if self.stated.program else ""
        return f"{self.stated.drive.name}{program}, {len(self.stated.steps)} values of {FILE}"

    def as_json(self) -> dict[str, Any]:
        """Return what `motor.json` holds beyond its header."""
        values = [
            {
                "table": s.table,
                "key": s.key,
                "value": s.value,
                "unit": s.unit or None,
                "from": s.said,
                "stated": s.given and {**s.given._asdict(), "unit": s.given.unit or None},
            }
            for s in self.stated.steps
        ]
        drive = self.stated.drive
        return {
            "motor": drive.name,
            "program": self.stated.program or None,
            "values": values,
            "cautions": list(cautions(drive)),
            "file": FILE,
        }

    def text(self) -> str:
        """Return `motor.toml`."""
        drive = self.stated.drive
        motor = {
            k: v
            for k, v in dataclasses.asdict(drive.motor).items()
            if v not in ("", 0.0) or k == "magnet_flux"
        }
        tables = [
            ("[motor]", motor),
            ("[drive]", dataclasses.asdict(drive.converter)),
            ("[injection]", dataclasses.asdict(drive.injection)),
            ("[provenance]", drive.provenance),
        ]
        return toml_text(tables)

    def report(self) -> None:
        """Print each value with where it comes from, and what cannot be meant."""
        rows = [[s.key, f"{s.value:.5g}", s.said] for s in self.stated.steps]
        title = f"{self.stated.drive.name}: values of {FILE} (SI units, peak, phase)"
        print_table(title, ["value", "is", "from"], rows)
        for text in cautions(self.stated.drive):
            print_prose(f"caution: {text}")

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write `motor.toml`."""
        (out / FILE).write_text(self.text(), encoding="utf-8")
        return {}


@records_call
def convert_motor(stated: Sequence[str | Path], name: str = "motor") -> ConvertedMotor:
    """Return a motor's file from configurations of VESC, ODrive, moteus or SimpleFOC, and from
    values of data sheets.

    Parameters
    ----------
    stated : sequence of str or Path
        Paths of configurations, and `KEY=VALUE` with units, e.g. 'kv=300', 'resistance_ll=0.1ohm',
        'current=20 A rms', 'inductance=30uH'; these come before what a file says.
    name : str
        The motor's name.

    Returns
    -------
    ConvertedMotor
        `.stated.drive`, `.stated.steps` (each value with where it comes from), `.save(folder)`
        writes `motor.toml`.

    Raises
    ------
    BadInput
        For a file of none of these tools, an unknown key or unit, contradictions, or a value that
        is missing.

    Examples
    --------
    >>> from sandbox import convert_motor
    >>> words = ["poles=14", "kv=300", "resistance_ll=0.1ohm", "inductance=30uH", "current=20A", "voltage=24V"]
    >>> found = convert_motor(words)
    >>> round(found.stated.drive.motor.magnet_flux, 5)  # Wb
    0.00263
    """  # noqa: E501
    return ConvertedMotor(stated_motor([str(word) for word in stated], name))
