"""Tables of other programs as columns of floats: texts, workbooks, Parquet, MAT, NumPy, MDF4, TDMS,
MCAP.

Cells that are empty or no number become NaN here; a column that is asked for and holds one is
refused where it is mapped (`sandbox.recordings.column_map`), with its row.  Rows are counted from
0, after header and unit row.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from model.errors import BadInput
from model.matfile import read_mat
from model.number_table import Table
from model.text_table import read_text
from model.workbook import read_workbook
from sandbox.recordings.formats import hdf5, mcap_log, mdf4, tdms
from sandbox.recordings.formats.log_table import MOST_VALUES
from sandbox.recordings.formats.matrices import matrices, numpy_arrays
from sandbox.recordings.formats.parquet import check_table, read_parquet

TEXTS = (".csv", ".txt", ".tsv", ".dat", ".log", ".asc")
SUFFIXES = (".parquet", *TEXTS, ".xlsx", ".mat", ".npy", ".npz", ".mf4", ".tdms", ".mcap")
LARGEST_MAT = 1_000_000_000  # bytes unpacked of one file


def read_table(
    path: Path, wanted: Iterable[str] = (), matrix: Mapping[str, Sequence[str]] | None = None
) -> Table:
    """Return a table by its file's suffix.

    wanted: the columns that files of many channels are asked for; matrix: names of the columns of
    matrices in it. Raises BadInput for a file that is absent, of another format, or needs a package
    that is not installed.
    """
    suffix, names = path.suffix.lower(), matrix or {}
    if suffix not in SUFFIXES:
        raise BadInput(
            f"{path.name}: format '{suffix}' is not read; export as one of {', '.join(SUFFIXES)}"
        )
    check_table(path)
    if suffix == ".parquet":
        return Table(read_parquet(path), {}, {})
    if suffix == ".mat":
        return _mat(path, names)
    if suffix in (".npy", ".npz"):
        return matrices(path.name, numpy_arrays(path), names)
    many = {".mf4": mdf4.read_mdf4, ".tdms": tdms.read_tdms, ".mcap": mcap_log.read_mcap}
    if suffix in many:
        return many[suffix](path, tuple(wanted))
    return (read_workbook if suffix == ".xlsx" else read_text)(path, MOST_VALUES)


def _mat(path: Path, names: Mapping[str, Sequence[str]]) -> Table:
    """Return the vectors and matrices of a MAT file; those in a structure are named
    'structure.field'."""
    if hdf5.is_hdf5(path):
        found = hdf5.read_hdf5(path, LARGEST_MAT)
    else:
        try:
            found = read_mat(path, LARGEST_MAT)
        except (OSError, ValueError) as error:
            raise BadInput(
                f"{path.name}: not a MAT file that can be read ({error!s:.100}); save it again"
            ) from None
    return matrices(path.name, {n: v for n, v in found.items() if v.dtype.kind in "fiu"}, names)
