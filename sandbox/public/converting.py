"""A motor's file from configurations of other tools and from data sheets' values."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from model.ratings import cautions
from model.tools.stated_motor import StatedMotor, stated_motor
from sandbox.output.files import results, write_json
from sandbox.output.provenance import Call, made_by
from sandbox.output.tables import print_prose, print_table
from sandbox.output.toml import toml_text
from sandbox.public.calls import told

FILE = "motor.toml"


@dataclass(frozen=True)
class ConvertedMotor:
    """A drive as other tools and people state it, and each conversion."""

    stated: StatedMotor
    call: Call | None = None

    def __repr__(self) -> str:
        return f"<ConvertedMotor: {self.stated.drive!r}>"

    def as_json(self) -> dict[str, Any]:
        """Return what `motor.json` holds beyond its header."""
        values = [{"table": s.table, "key": s.key, "value": s.value, "from": s.said} for s in self.stated.steps]
        drive = self.stated.drive
        return {
            "motor": drive.name, "program": self.stated.program or None, "values": values,
            "cautions": list(cautions(drive)), "file": FILE,
        }  # fmt: skip

    def text(self) -> str:
        """Return `motor.toml`."""
        drive = self.stated.drive
        motor = {k: v for k, v in dataclasses.asdict(drive.motor).items() if v not in ("", 0.0) or k == "magnet_flux"}
        tables = [
            ("[motor]", motor), ("[drive]", dataclasses.asdict(drive.converter)),
            ("[injection]", dataclasses.asdict(drive.injection)), ("[provenance]", drive.provenance),
        ]  # fmt: skip
        return toml_text(tables)

    def save(self, folder: str | Path) -> Path:
        """Write motor.toml and motor.json into a folder, together; return it."""
        with results(Path(folder), "motor") as out:
            (out / FILE).write_text(self.text(), encoding="utf-8")
            write_json(out, "motor", self.as_json(), made=made_by(self.call, out.iterdir()))
        return Path(folder)

    def show(self) -> None:
        """Print each value with where it comes from, and what cannot be meant."""
        rows = [[s.key, f"{s.value:.5g}", s.said] for s in self.stated.steps]
        print_table(
            f"{self.stated.drive.name}: values of {FILE} (SI units, peak, phase)", ["value", "is", "from"], rows
        )
        for text in cautions(self.stated.drive):
            print_prose(f"caution: {text}")


@told
def convert_motor(stated: Sequence[str | Path], name: str = "motor") -> ConvertedMotor:
    """Return a motor's file from configurations of VESC, ODrive, moteus or SimpleFOC, and from values of data sheets.

    Parameters
    ----------
    stated : sequence of str or Path
        Paths of configurations, and `KEY=VALUE` with units, e.g. 'kv=300', 'resistance_ll=0.1ohm', 'current=20 A rms',
        'inductance=30uH'; these come before what a file says.
    name : str
        The motor's name.

    Returns
    -------
    ConvertedMotor
        `.stated.drive`, `.stated.steps` (each value with where it comes from), `.save(folder)` writes `motor.toml`.

    Raises
    ------
    BadInput
        For a file of none of these tools, an unknown key or unit, contradictions, or a value that is missing.

    Examples
    --------
    >>> from sandbox import convert_motor
    >>> words = ["poles=14", "kv=300", "resistance_ll=0.1ohm", "inductance=30uH", "current=20A", "voltage=24V"]
    >>> found = convert_motor(words)
    >>> round(found.stated.drive.motor.magnet_flux, 5)  # Wb
    0.00263
    """
    return ConvertedMotor(stated_motor([str(word) for word in stated], name))
