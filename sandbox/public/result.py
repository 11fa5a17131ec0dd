"""What every function of the page returns can do: be printed, become a table, a figure, a trace, a
folder of files."""

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
    import xarray

    from sandbox.output.plots import AnyAxes, Figure

SUFFIXES = {"page": "html", "figure": "png", "table": "parquet", "trace": "rrd"}


@dataclass(frozen=True, repr=False)
class Result(ABC):
    """A finished piece of work; what is in it stands in the fields of its class."""

    command: ClassVar[str]  # its JSON is called so
    header: ClassVar[str] = ""  # the command that its JSON names, where that is another
    kinds: ClassVar[tuple[str, ...]] = ("figure", "table")  # what `save` writes beside the JSON
    coordinates: ClassVar[tuple[str, ...]] = ()  # columns that `to_xarray` takes for coordinates
    # how the function that returned it was called
    call: Call | None = field(default=None, kw_only=True)

    @abstractmethod
    def as_json(self) -> dict[str, Any]:
        """Return what `<command>.json` holds beyond its header and the names of files."""

    @abstractmethod
    def summary(self) -> str:
        """Return the result in a few words, for `repr`."""

    def columns(self) -> dict[str, Column]:
        """Return the columns of the result's table; BadInput where it has none."""
        raise BadInput(f"a result of '{self.command}' has no table; take .as_json()")

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the result's figure (its panels: `.axes`); a path (.png, .svg, .pdf) is written as
        well.

        ax: axes of your own to draw in, one for each panel, such as those of `plt.subplots`; their
        figure is returned. BadInput says how many panels there are, or that the result has no
        figure.
        """
        raise BadInput(f"a result of '{self.command}' has no figure; take .as_json()")

    def report(self) -> None:
        """Print the result as its command does."""
        from sandbox.output.tables import print_prose

        print_prose(self.summary())

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary()}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the summary, the figure, the first rows of the table."""
        from sandbox.public.notebook import shown_in_notebook

        return shown_in_notebook(self)

    def to_table(self) -> pyarrow.Table:
        """Return the result as a pyarrow table, units in the metadata of its columns."""
        return table_of(self.columns())

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the result as a pandas data frame, units in `.attrs["units"]`; BadInput where
        pandas is missing."""
        return frame_of(self.to_table())

    def to_xarray(self) -> xarray.Dataset:
        """Return the table as an xarray Dataset, each variable with its unit; BadInput where xarray
        is missing.

        Its dimensions are coordinates where there are any (`t` of a run, the currents of maps),
        else the row.
        """
        from sandbox.output.labelled import dataset_of

        return dataset_of(
            self.to_table(), self.coordinates, {"result": self.command, "summary": self.summary()}
        )

    def to_rerun(self, path: str | Path) -> Path:
        """Write the result as a trace for the rerun viewer (`.rrd`); BadInput where nothing in it
        runs over time."""
        raise BadInput(
            f"nothing in a result of '{self.command}' runs over time, so it has no "
            "trace; take .plot()"
        )

    def to_html(self, path: str | Path) -> Path:
        """Write the result as one page with its figures inside (`.html`); BadInput where a figure
        is all there is."""
        raise BadInput(f"a result of '{self.command}' has no page of its own; take .plot()")

    def show(self) -> str:
        """Save the result into a temporary folder and open what is there, as `sandbox.show`; say
        what was opened."""
        from tempfile import mkdtemp

        from sandbox.public.showing import show

        return show(self.save(Path(mkdtemp(prefix="sensorless-")) / self.command))

    def save(
        self,
        folder: str | Path,
        *,
        csv: bool = False,
        trace: bool = True,
        figure: bool = True,
        table: bool = True,
    ) -> Path:
        """Write JSON and what the result has of page, figure, table and trace into a folder,
        together; return it.

        csv: the table as CSV, too; figure: the figure and the page.
        """
        asked = {"page": figure, "figure": figure, "table": table, "trace": trace}
        with results(Path(folder), self.command) as out:
            files = {
                kind: f"{self.command}.{SUFFIXES[kind]}" if asked[kind] else None
                for kind in self._kinds_in(Path(folder))
            }
            for kind, name in files.items():
                if name is not None:
                    self._write(kind, out / name)
            if csv:
                write_table(out / f"{self.command}.csv", self.to_table())
            content = self.as_json() | files | self._write_more(out)
            made = made_by(self.call, (path for path in out.iterdir() if path.is_file()))
            write_json(out, self.command, content, self.header, made)
        return Path(folder)

    def _kinds_in(self, folder: Path) -> tuple[str, ...]:
        """Return what of `kinds` is written into a folder."""
        return self.kinds

    def _write(self, kind: str, path: Path) -> None:
        """Write one of the files that several results have."""
        if kind == "table":
            write_table(path, self.to_table())
        elif kind == "page":
            self.to_html(path)
        elif kind == "trace":
            self.to_rerun(path)
        else:
            self.plot(path)

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write what this result alone has into a folder; return what its JSON says of it."""
        return {}


def keep_other(folder: Path, command: str, motor: str) -> str:
    """Rename what an earlier call left in a folder of another motor's result; return a sentence of
    it, or nothing.

    `audit.json` is the latest audit's; `audit-spm.json` and its figure are those of the motor asked
    for before.
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
    files = {
        key: renamed.get(value, value) if isinstance(value, str) else value
        for key, value in content.items()
    }
    header, made = ("schema", "command", "version", "made_by"), content.get("made_by")
    if isinstance(made, dict) and isinstance(made.get("files"), dict):
        made = made | {
            "files": {renamed.get(name, name): digest for name, digest in made["files"].items()}
        }
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
