"""What a file claims to hold is bounded before it is read, and a long text is read as a short one
is."""

import io
import os
import struct
import tracemalloc
import zipfile
from decimal import Decimal

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from model import text_lines, text_table
from model.arrays import read_arrays
from model.drive_files import load_drive
from model.errors import BadInput
from model.given import read_toml
from sandbox.recordings import foreign, importing
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.checks import balance
from sandbox.recordings.foreign import read_table
from sandbox.recordings.formats import matrices
from sandbox.recordings.writing import write_campaign
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign

GIGA = 1_000_000_000


def refusal(path, reading=read_table):
    """Return with which sentence a file is refused, where at most 100 MB were taken on the way;
    NumPy's and Python's memory is counted."""
    tracemalloc.start()
    held = pa.total_allocated_bytes()
    try:
        with pytest.raises(BadInput) as refused:
            reading(path)
        taken = max(tracemalloc.get_traced_memory()[1], pa.total_allocated_bytes() - held)
    finally:
        tracemalloc.stop()
    return str(refused.value) if taken < 100e6 else f"{taken:.3g} bytes were taken"


def _claimed(rows):
    """An array's header of NumPy's that claims so many rows of 8 bytes."""
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        out, {"descr": "<f8", "fortran_order": False, "shape": (rows,)}
    )
    return out.getvalue()


def _long_header():
    """The begin of NumPy's version 2 with a header of 1.5 GB."""
    return b"\x93NUMPY\x02\x00" + struct.pack("<I", 1_500_000_000)


def _zip(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return path


def test_arrays_of_numpy_are_not_believed_about_their_size(tmp_path):
    assert "million values" in refusal(_zip(tmp_path / "a.npz", i_a=_claimed(GIGA)))
    long = _zip(tmp_path / "b.npz", i_a=_long_header() + bytes(200_000_000))
    assert "a header of 1500000000 bytes" in refusal(long)
    single = tmp_path / "c.npy"
    single.write_bytes(_claimed(GIGA))
    assert "million values" in refusal(single)
    single.write_bytes(_claimed(1000) + bytes(80))
    assert "cannot be read as NumPy's format" in refusal(single)
    kept = np.arange(12.0).reshape(3, 4)
    np.save(single, np.asfortranarray(kept))
    assert np.array_equal(matrices.numpy_arrays(single)["data"], kept)


def test_flux_maps_are_not_believed_about_their_size(tmp_path):
    def reading(path):
        read_arrays(path, {"i_d"}, 1000)

    long = _zip(tmp_path / "a.npz", i_d=_long_header() + bytes(200_000_000))
    assert "a header of 1500000000 bytes" in refusal(long, reading)
    wide = tmp_path / "wide.csv"
    wide.write_text(",".join(f"x{k}" for k in range(200)) + "\n" + ",".join("1" * 200) + "\n")
    assert "200 columns; at most 100" in refusal(wide, reading)


def test_a_parquet_table_says_how_long_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr("sandbox.recordings.formats.parquet.MOST_VALUES", 1000)
    path = tmp_path / "zeros.parquet"
    parquet.write_table(pa.table({"i_a": np.zeros(501), "i_b": np.zeros(501)}), path)
    assert "million values" in refusal(path)
    parquet.write_table(pa.table({"i_a": ["1"] * 10}), path)
    assert "column 'i_a' holds string, no numbers" in refusal(path)


def _long_campaign(folder, rows):
    """The paper's test with one of its recordings gone over until it has so many rows."""
    drive = load_drive("ipm_exchanged")
    campaign = paper_campaign(
        drive,
        np.linspace(-1.92, 1.92, 3),
        40,
        LockedBench(theta=0.7, noise=0.002, resolution=0.0024),
    )
    write_campaign(folder, campaign)
    path = folder / "locked_d.parquet"
    table = parquet.read_table(path)
    period = drive.converter.sampling_period
    columns = {n: np.resize(table[n].to_numpy(), rows) for n in table.column_names}
    parquet.write_table(
        pa.table({**columns, "t": np.arange(rows) * period}), path, row_group_size=rows // 3
    )
    return folder


@pytest.mark.parametrize(
    ("reading", "columns"), [(read_folder, 11.5), (importing.read_recordings, 19.0)]
)
def test_a_long_recording_is_read_once_and_checked_in_its_place(
    tmp_path, monkeypatch, reading, columns
):
    """Eight columns are kept.  Beside them steps of t may take 3, and what is compared between
    currents or balanced 9 more (8 + 9 = 17 measured, 1.7 GB at the most rows that are read, of 2
    GB; before: 27)."""
    monkeypatch.setattr(balance, "BLOCK", 10_000)
    rows = 300_000
    folder = _long_campaign(tmp_path / "long", rows)
    reading(folder)  # whatever is imported at first use
    before = pa.default_memory_pool().max_memory()
    tracemalloc.start()
    found = reading(folder)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(found["locked_d.parquet"].t) == rows
    assert 8 * 8 * rows < peak < columns * 8 * rows
    assert pa.default_memory_pool().max_memory() - before < 8 * 8 * rows / 4


def test_a_parquet_table_is_read_by_pieces_as_in_one(tmp_path, monkeypatch):
    """Numbers, decimals, truth values, instants, absent cells: each as pyarrow makes floats of the
    whole column."""
    n = 1000
    columns = {
        "whole": pa.array(range(n)),
        "absent": pa.array([None, 1.5] * (n // 2)),
        "nothing": pa.nulls(n),
        "decimal": pa.array([Decimal(f"{k}.25") for k in range(n)]),
        "true": pa.array([True, False] * (n // 2)),
        "some": pa.array([None, *range(n - 1)]),
        "at": pa.array(range(n), pa.timestamp("us")),
    }
    path = tmp_path / "kinds.parquet"
    parquet.write_table(pa.table(columns), path, row_group_size=300)
    monkeypatch.setattr("sandbox.recordings.formats.parquet.ROWS", 128)
    found = read_table(path).columns
    assert list(found) == list(columns)
    for name in set(columns) - {"nothing"}:
        assert np.array_equal(
            found[name], columns[name].to_numpy(zero_copy_only=False).astype(float), equal_nan=True
        )
    assert np.isnan(found["nothing"]).all()


def test_a_log_of_few_columns_is_not_longer_than_what_becomes_of_it(tmp_path, monkeypatch):
    folder = _long_campaign(tmp_path / "long", 3000)
    monkeypatch.setattr("sandbox.recordings.column_map.MOST_ROWS", 2999)
    with pytest.raises(
        BadInput,
        match=r"locked_d.parquet: 0.003 million rows, at most 0.002999 are read; cut the log",
    ):
        importing.read_recordings(folder)


def test_a_text_names_no_million_columns(tmp_path):
    path = tmp_path / "wide.csv"
    path.write_text(",".join(f"x{k}" for k in range(20_000)) + "\n")
    assert "20000 columns; at most 10000 are read" in refusal(path)


ROWS = [[0.1 * k, -1.5e-3 * k, 7.0] for k in range(40)]
TEXTS = {
    "plain": "t,i_a,u_dc\n" + "\n".join(",".join(map(repr, r)) for r in ROWS) + "\n",
    "decimal commas": "t;i_a;u_dc\r\n"
    + "\r\n".join(";".join(map(repr, r)).replace(".", ",") for r in ROWS)
    + "\r\n",
    "preamble, units": "Log of a drive\n\n# made today\nt\ti_a [mA]\tu_dc\ns\t\tV\n"
    + "\n".join("\t".join(map(repr, r)) for r in ROWS),
    "separators at the end": "t,i_a,u_dc,\n"
    + "\n".join(",".join(map(repr, r)) + "," for r in ROWS)
    + "\n",
    "empty cells": "t,i_a,u_dc\n" + "\n".join(f"{r[0]!r},,{r[2]!r}" for r in ROWS) + "\n",
    "quoted": '"t","i_a","u_dc"\n'
    + "\n".join(",".join(f'"{x!r}"' for x in r) for r in ROWS)
    + "\n",
    "a form feed above": "first\x0csecond\nt,i_a,u_dc\n"
    + "\n".join(",".join(map(repr, r)) for r in ROWS)
    + "\n",
    "form feeds above equal rows": "a\x0cb\x0cc\x85d\nt,i_a,u_dc\n" + "1.5,2.0,3.0\n" * 40,
    "decimal commas after whole numbers": "t;i_a;u_dc\n0;0;0\n" + "0,5;1,5;2\n" * 39,
    "blank cells": "t,i_a,u_dc\n" + "1.5, ,3.0\n" * 40,
}


@pytest.mark.parametrize("kind", TEXTS)
def test_a_text_is_read_in_pieces_as_at_once(tmp_path, monkeypatch, kind):
    path = tmp_path / "log.csv"
    path.write_bytes(TEXTS[kind].encode())
    at_once = read_table(path)
    monkeypatch.setattr(text_lines, "CHUNK", 37)
    monkeypatch.setattr(text_table, "BLOCK", 200)
    found = read_table(path)
    assert dict(found.units) == dict(at_once.units)
    assert list(found.columns) == list(at_once.columns) == ["t", "i_a", "u_dc"]
    for name in found.columns:
        assert len(found.columns[name]) == 40
        assert np.array_equal(found.columns[name], at_once.columns[name], equal_nan=True)


def test_a_word_in_a_text_is_told_by_column_and_row(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    path.write_text(TEXTS["plain"] + "4.0,lost,7.0\n")
    assert read_table(path).odd == {("i_a", 40): "lost"}
    monkeypatch.setattr(foreign, "MOST_VALUES", 60)
    path.write_text(TEXTS["plain"])
    assert "million values" in refusal(path)


def test_a_column_without_a_name_is_not_dropped(tmp_path):
    """A separator at the end of each line makes an empty cell; a number in it is a row that is too
    long."""
    path = tmp_path / "log.csv"
    path.write_text(TEXTS["separators at the end"] + "1.0,2.0,3.0,7.0\n")
    with pytest.raises(BadInput, match="row 40 has 4 cells, the header has 3"):
        read_table(path)


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_is_refused_at_once(tmp_path, make):
    for name in ("pipe.toml", "pipe.npz", "pipe.csv"):
        make(tmp_path / name)
    with pytest.raises(BadInput, match=r"is a pipe or a device|is a folder"):
        read_toml(tmp_path / "pipe.toml")
    with pytest.raises(BadInput, match=r"is a pipe or a device|is a folder"):
        read_arrays(tmp_path / "pipe.npz", {"i_d"}, 1000)
    with pytest.raises(BadInput, match=r"pipe.csv: it is a folder or a pipe, no file"):
        read_table(tmp_path / "pipe.csv")
    if make is os.mkfifo:
        with pytest.raises(BadInput, match="a folder, or one table"):
            importing.source_of(tmp_path / "pipe.csv")


def test_columns_of_parquet_that_hold_no_floats(tmp_path):
    """An empty column is NaN, decimals and instants are numbers; a name that stands twice is
    refused."""
    from decimal import Decimal

    path = tmp_path / "a.parquet"
    at = np.array([1, 2], dtype="datetime64[us]")
    table = pa.table(
        {"t": at, "i_a": pa.nulls(2), "u_dc": pa.array([Decimal("1.5"), Decimal("2.5")])}
    )
    parquet.write_table(table, path)
    found = read_table(path).columns
    assert found["t"].tolist() == [1.0, 2.0]
    assert np.isnan(found["i_a"]).all()
    assert found["u_dc"].tolist() == [1.5, 2.5]
    parquet.write_table(pa.Table.from_arrays([pa.array([1.0])] * 2, names=["i_a", "i_a"]), path)
    with pytest.raises(BadInput, match="column 'i_a' stands twice"):
        read_table(path)


@pytest.mark.parametrize(
    "text", ["{} = 1", "[{}]", "x = {{{} = 1}}", '"a b".{} = 1', "x = 1\n [[ {} ]]"]
)
def test_a_key_of_many_parts_is_refused_before_it_is_parsed(tmp_path, text):
    """The parser's time and memory grow with the square of the parts: 20 GB for 60 000."""
    path = tmp_path / "deep.toml"
    for part in ("a", '"\\""', "'#'"):
        path.write_text(text.format(".".join([part] * 60_000)))
        assert "a key of more than 50 parts joined by dots" in refusal(path, read_toml)


def test_numbers_words_and_short_keys_are_no_long_keys(tmp_path):
    path = tmp_path / "whole.toml"
    dotted = ".".join("1" * 80)
    text = (
        f'# {dotted}\nx = {[0.25] * 100}\n{".".join("a" * 40)} = \'v{dotted}\'\ny = "\\"{dotted}"\n'
    )
    path.write_text(f'{text}z = """\n"{dotted}"\n"""\n')
    found = read_toml(path)
    assert (found["x"], found["y"], found["z"]) == ([0.25] * 100, f'"{dotted}', f'"{dotted}"\n')
