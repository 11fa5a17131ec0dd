"""What every function of the page returns can do: become a table, a figure, a trace, a folder of files."""

from __future__ import annotations

import json
import zlib
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from model.errors import BadInput, shown
from model.names import LONGEST
from sandbox.output.columns import Column, frame_of, table_of, write_table
from sandbox.output.files import KINDS, check_free, results, write_json
from sandbox.output.provenance import Call, made_by

if TYPE_CHECKING:
    import pandas
    import pyarrow

    from sandbox.output.plots import AnyAxes, Figure


@dataclass(frozen=True, repr=False)
class Result(ABC):
    """A finished piece of work; what is in it stands in the fields of its class."""

    command: ClassVar[str]
    call: Call | None = field(default=None, kw_only=True)  # how the function that returned it was called

    def made_by(self, folder: Path) -> dict[str, Any]:
        """Return what made the result, with hashes of its files in a folder that holds no others."""
        return made_by(self.call, (path for path in folder.iterdir() if path.is_file()))

    @abstractmethod
    def as_json(self) -> dict[str, Any]:
        """Return what `<command>.json` holds beyond its header and the names of files."""

    @abstractmethod
    def columns(self) -> dict[str, Column]:
        """Return the columns of the result's table."""

    @abstractmethod
    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the result's figure (its panels: `.axes`); a path (.png, .svg, .pdf) is written as well.

        ax: axes of your own to draw in, one for each panel, such as those of `plt.subplots`; their figure is returned.
        BadInput says how many panels there are.
        """

    @abstractmethod
    def summary(self) -> str:
        """Return the result in a few words, for `repr`."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary()}>"

    def to_table(self) -> pyarrow.Table:
        """Return the result as a pyarrow table, units in the metadata of its columns."""
        return table_of(self.columns())

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the result as a pandas data frame, units in `.attrs["units"]`; BadInput where pandas is missing."""
        return frame_of(self.to_table())

    def to_rerun(self, path: str | Path) -> Path:
        """Write the result as a trace for the rerun viewer (`.rrd`); BadInput where nothing in it runs over time."""
        raise BadInput(f"nothing in a result of '{self.command}' runs over time, so it has no trace; take .plot()")

    def to_html(self, path: str | Path) -> Path:
        """Write the result as one page with its figures inside (`.html`); BadInput where a figure is all there is."""
        raise BadInput(f"a result of '{self.command}' has no page of its own; take .plot()")

    def save(self, folder: str | Path, *, csv: bool = False) -> Path:
        """Write JSON, figure and table (Parquet; csv: as CSV, too) into a folder, together; return it."""
        with results(Path(folder), self.command) as out:
            files = self._write(out, csv)
            write_json(out, self.command, self.as_json() | files, made=self.made_by(out))
        return Path(folder)

    def _write(self, out: Path, csv: bool) -> dict[str, Any]:
        """Write figure and table into a folder; return what the JSON says of them."""
        self.plot(out / f"{self.command}.png")
        table = self.to_table()
        write_table(out / f"{self.command}.parquet", table)
        if csv:
            write_table(out / f"{self.command}.csv", table)
        return {"figure": f"{self.command}.png", "table": f"{self.command}.parquet"}


def keep_other(folder: Path, command: str, motor: str) -> str:
    """Rename what an earlier call left in a folder of another motor's result; return a sentence of it, or nothing.

    `audit.json` is the latest audit's; `audit-spm.json` and its figure are those of the motor asked for before.
    """
    path = folder / f"{command}.json"
    if not path.is_file():
        return ""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        earlier = str(content["motor"])[:LONGEST]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return ""
    stem = f"{command}-{_slug(earlier)}"
    if earlier != motor:
        check_free(folder, [f"{stem}{old.suffix}" for old in _named(folder, command)])
    for old in _named(folder, f"{command}-{_slug(motor)}"):
        old.unlink()  # this motor's own earlier result: the new one takes its place
    if earlier == motor:
        return ""
    for old in _named(folder, stem):
        old.unlink()
    renamed = {old.name: f"{stem}{old.suffix}" for old in _named(folder, command)}
    for name, new in renamed.items():
        if not name.endswith(".json"):
            (folder / name).replace(folder / new)
    files = {key: renamed.get(value, value) if isinstance(value, str) else value for key, value in content.items()}
    header, made = ("schema", "command", "version", "made_by"), content.get("made_by")
    if isinstance(made, dict) and isinstance(made.get("files"), dict):
        made = made | {"files": {renamed.get(name, name): digest for name, digest in made["files"].items()}}
    write_json(folder, stem, {k: v for k, v in files.items() if k not in header}, command, made)
    path.unlink()
    return f"the earlier result of '{shown(earlier)}' is kept as {stem}.json"


def _named(folder: Path, stem: str) -> list[Path]:
    """Return the files of one result: its stem with every suffix that is written."""
    return [path for kind in KINDS if (path := folder / f"{stem}{kind}").is_file()]


def _slug(name: str) -> str:
    """Return a name for a file; names that differ in other signs only get different ones."""
    plain = "".join(c if c.isalnum() or c in "_-" else "_" for c in name)
    return plain if plain == name else f"{plain}-{zlib.crc32(name.encode()):08x}"
