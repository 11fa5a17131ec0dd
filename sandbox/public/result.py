"""What every function of the page returns can do: become a table, a figure, a trace, a folder of files."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from model.errors import BadInput
from sandbox import report

if TYPE_CHECKING:
    import pandas
    import pyarrow

    from sandbox.plots import Figure


class Column(NamedTuple):
    """One column of a table: its values (numbers, texts, truth values; None where undefined) and their unit."""

    values: Any
    unit: str = ""


def table_of(columns: Mapping[str, Column]) -> pyarrow.Table:
    """Return columns as a pyarrow table; a field's metadata holds its unit where it has one."""
    import pyarrow as pa

    arrays, schema = [], []
    for name, (values, unit) in columns.items():
        array = pa.array(values if isinstance(values, np.ndarray) else report.plain(list(values)))
        if pa.types.is_null(array.type):  # a column that is undefined throughout
            array = array.cast(pa.float64())
        arrays.append(array)
        schema.append(pa.field(name, array.type, metadata={"unit": unit} if unit else None))
    return pa.Table.from_arrays(arrays, schema=pa.schema(schema))


def columns_of(rows: Sequence[Mapping[str, Any]], units: Mapping[str, str]) -> dict[str, Column]:
    """Return rows (all of the same keys) as columns with units."""
    names = list(rows[0]) if rows else list(units)
    return {name: Column([row[name] for row in rows], units.get(name, "")) for name in names}


def frame_of(table: pyarrow.Table) -> pandas.DataFrame:
    """Return a table as a pandas data frame, units in `.attrs["units"]`; BadInput where pandas is missing."""
    try:
        import pandas  # noqa: F401 - pyarrow's own message is longer
    except ImportError:
        raise BadInput("a data frame needs pandas; install it with `pip install pandas`, or take .to_table()") from None
    frame = table.to_pandas()
    frame.attrs["units"] = {f.name: f.metadata[b"unit"].decode() for f in table.schema if f.metadata}
    return frame


def together(frames: Mapping[str, pandas.DataFrame]) -> pandas.DataFrame:
    """Return data frames below each other, a first column `file` telling them apart."""
    import pandas

    whole = pandas.concat([frame.assign(file=name) for name, frame in frames.items()], ignore_index=True)
    whole.insert(0, "file", whole.pop("file"))
    whole.attrs["units"] = {k: v for frame in frames.values() for k, v in frame.attrs["units"].items()}
    return whole


def write_table(path: Path, table: pyarrow.Table) -> None:
    """Write a table as Parquet or, by the suffix, as CSV (its heads with units: `i_d (A)`)."""
    if path.suffix == ".csv":
        from pyarrow import csv

        heads = [f"{f.name} ({f.metadata[b'unit'].decode()})" if f.metadata else f.name for f in table.schema]
        csv.write_csv(table.rename_columns(heads), path)
    else:
        from pyarrow import parquet

        parquet.write_table(table, path)


@dataclass(frozen=True, repr=False)
class Result(ABC):
    """A finished piece of work; what is in it stands in the fields of its class."""

    command: ClassVar[str]

    @abstractmethod
    def as_json(self) -> dict[str, Any]:
        """Return what `<command>.json` holds beyond its header and the names of files."""

    @abstractmethod
    def columns(self) -> dict[str, Column]:
        """Return the columns of the result's table."""

    @abstractmethod
    def plot(self, path: str | Path | None = None) -> Figure:
        """Return the result's figure (its panels: `.axes`); a path (.png, .svg, .pdf) is written as well."""

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

    def save(self, folder: str | Path, *, csv: bool = False) -> Path:
        """Write JSON, figure and table (Parquet; csv: as CSV, too) into a folder, together; return it."""
        with report.results(Path(folder), self.command) as out:
            files = self._write(out, csv)
            report.write_json(out, self.command, self.as_json() | files)
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
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        earlier = str(content["motor"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""
    for old in _named(folder, f"{command}-{_slug(motor)}"):
        old.unlink()  # this motor's own earlier result: the new one takes its place
    if earlier == motor:
        return ""
    stem = f"{command}-{_slug(earlier)}"
    for old in _named(folder, stem):
        old.unlink()
    renamed = {old.name: f"{stem}{old.suffix}" for old in _named(folder, command)}
    for name, new in renamed.items():
        if not name.endswith(".json"):
            (folder / name).replace(folder / new)
    files = {key: renamed.get(value, value) if isinstance(value, str) else value for key, value in content.items()}
    header = ("schema", "command", "version")
    report.write_json(folder, stem, {k: v for k, v in files.items() if k not in header}, command=command)
    path.unlink()
    return f"the earlier result of '{earlier}' is kept as {stem}.json"


def _named(folder: Path, stem: str) -> list[Path]:
    """Return the files of one result: its stem with every suffix that is written."""
    return [path for kind in report.KINDS if (path := folder / f"{stem}{kind}").is_file()]


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() or c in "_-" else "_" for c in name)
