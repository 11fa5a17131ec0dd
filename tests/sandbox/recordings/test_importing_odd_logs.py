"""Logs as they come out of other programs, each wrong in one way: each ends in one sentence that
names it."""

import numpy as np
import pytest

from model.errors import BadInput
from model.text_table import read_text
from sandbox.recordings.importing import read_recordings

MAP = """[drive]
sampling_period = 1e-3
dc_bus_voltage = 24.0
[motor]
pole_pairs = 4
resistance = 1.0
inductance_d = 1e-3
inductance_q = 2e-3
magnet_flux = 0.01
[[recording]]
file = "log.csv"
rotor = "locked"
"""
NAMES = ("t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta")


def columns(n=200):
    """Return a locked rotor's currents, slowly around the circle."""
    t = 1e-3 * np.arange(n)
    around = 2.0 * np.pi * t
    i = {
        x: 2.0 * np.cos(around - 2.0 * np.pi / 3.0 * k) for k, x in enumerate(("i_a", "i_b", "i_c"))
    }
    return {
        "t": t,
        "u_alpha": 2.0 * np.cos(around),
        "u_beta": 2.0 * np.sin(around),
        **i,
        "theta": np.zeros(n),
    }


def lines_of(made, names=NAMES, separator=",", point="."):
    """A header and rows as text; cells that are texts stay as they are."""
    cells = [
        [x if isinstance(x, str) else f"{x:.9g}".replace(".", point) for x in made[n]]
        for n in names
    ]
    return [separator.join(names), *(separator.join(row) for row in zip(*cells, strict=True))]


def read(folder, made, separator=",", point="."):
    """Write columns as text and read them."""
    return read_lines(folder, lines_of(made, NAMES, separator, point))


def read_lines(folder, rows):
    (folder / "log.csv").write_text("\n".join(rows) + "\n")
    (folder / "map.toml").write_text(MAP)
    return read_recordings(folder, folder / "map.toml")


def changed(**other):
    return {**columns(), **other}


def test_as_it_is(tmp_path):
    assert len(read(tmp_path, columns())) == 1


@pytest.mark.parametrize(("separator", "point"), [(";", ","), ("\t", ",")])
def test_decimal_commas_are_read(tmp_path, separator, point):
    assert np.allclose(
        read(tmp_path, columns(), separator, point)["log"].i_a, columns()["i_a"], rtol=0, atol=1e-8
    )


def counts(shift, wrap):
    """Return the currents in counts of 1 mA, about a middle, or without their sign."""
    own = columns()
    return {n: (np.round(1000.0 * own[n]) + shift) % wrap for n in ("i_a", "i_b", "i_c")}


def one_cell(text):
    """Return the columns with one cell of i_a as a text."""
    return changed(i_a=[text if k == 50 else x for k, x in enumerate(columns()["i_a"])])


SHUFFLED = np.random.default_rng(0).permutation(200)
WRONG = {
    "in disorder": (
        {n: x[SHUFFLED] for n, x in columns().items()},
        "out of order; sort them by time",
    ),
    "in reverse": (
        {n: x[::-1] for n, x in columns().items()},
        "in 199 rows: they are out of order",
    ),
    "hexadecimal": (
        changed(i_a=[hex(k) for k in range(200)]),
        "row 0 of column 'i_a' is '0x0'.*it is hexadecimal",
    ),
    "time of day": (
        changed(t=[f"12:00:{k / 1e3:06.3f}" for k in range(200)]),
        "is a time of day: export seconds",
    ),
    "hexadecimal without a sign for it": (
        changed(i_a=[f"{k + 160:04X}" for k in range(200)]),
        "row 0 of column 'i_a' is '00A0'.*it is hexadecimal",
    ),
    "date": (
        changed(t=[f"2026-11-29T12:00:{k / 1e3:06.3f}Z" for k in range(200)]),
        "is a time of day: export seconds",
    ),
    "minutes": (
        changed(t=[f"00:{k / 1e3:06.3f}" for k in range(200)]),
        "is a time of day: export seconds",
    ),
    "days": (
        changed(t=[f"{45990.0 + k / 86400e3:.12f}" for k in range(200)]),
        "is t in days, as spreadsheets keep dates. map it with scale = 86400",
    ),
    "unit in the cell": (one_cell("1.5 A"), "row 50 .* its unit stands in the cell.*header .A."),
    "many empty cells": (
        changed(i_a=["" if k % 9 == 5 else x for k, x in enumerate(columns()["i_a"])]),
        "row 5 of column 'i_a' is empty.*.22 such rows.; record every sample",
    ),
    "a word": (
        one_cell("#DIV/0!"),
        "row 50 of column 'i_a' is '#DIV/0!', no number.*delete the row .the stamps of 't' show",
    ),
    "zero in the middle": (
        changed(**counts(2500.0, 1e9)),
        "their zero in the middle.*offset = -2500 x scale",
    ),
    "no sign": (
        changed(**counts(0.0, 65536.0)),
        "16 bits without a sign. take 65536 off those above 32767",
    ),
    "one spike": (
        changed(i_a=np.where(np.arange(200) == 50, 1e6, columns()["i_a"])),
        "row 50 of column .i_a. is 1e",
    ),
    "not recorded": (changed(i_b=np.zeros(200)), "it was not recorded: leave it out of .columns."),
}


@pytest.mark.parametrize("name", WRONG)
def test_one_sentence_says_what_is_wrong(tmp_path, name):
    made, said = WRONG[name]
    with pytest.raises(BadInput, match=said):
        read(tmp_path, made)


@pytest.mark.parametrize("cell", ["", "#N/A", "null", "-"])
def test_an_empty_cell_is_told_by_the_rows_beside(cell, tmp_path):
    """Commands of 1 ohm times 2 A at 1 Hz change by 2 A times 2 pi 1 ms a row, of which a line
    between two rows misses half at most."""
    campaign = read(tmp_path, one_cell(cell))
    assert np.allclose(campaign["log"].i_a, columns()["i_a"], rtol=0, atol=6.3e-3)
    assert any("row 50 of column 'i_a' is empty (1 of 200" in f.text for f in campaign.findings)


def test_decimal_commas_between_commas_are_named(tmp_path):
    with pytest.raises(BadInput, match="with decimal commas the separator must be"):
        read(tmp_path, {n: 1.5 + x for n, x in columns().items()}, ",", ",")


ALL, NO_T = NAMES, NAMES[1:]


@pytest.mark.parametrize(
    ("names", "between", "again", "lengths"),
    [
        (ALL, [ALL], 0, [100, 100]),  # the logger was started again: its clock, too
        (ALL, [], 0, [100, 100]),  # without a header
        (ALL, ["0.1,2.0,0", ALL], 0, [100, 100]),  # the row before it was cut
        (NO_T, [NO_T], 0, [100, 100]),  # no clock tells where
        (ALL, [ALL], 100, [200]),  # a header every hundred rows: the log goes on
    ],
)
def test_a_log_that_begins_again(tmp_path, names, between, again, lengths):
    """Rows before and after are recordings of their own; a header alone is left out."""
    own = columns()
    own["t"] = np.concatenate([own["t"][:100], own["t"][:100] + 1e-3 * again])
    rows = lines_of(own, names)
    middle = [x if isinstance(x, str) else ",".join(x) for x in between]
    campaign = read_lines(tmp_path, [*rows[:101], *middle, *rows[101:]])
    assert [len(r.t) for r in campaign.recordings] == lengths
    said = " ".join(f.text for f in campaign.findings)
    assert ("the log begins again in row 100; it becomes 2 recordings" in said) == (
        len(lengths) == 2
    )
    assert ("the header stands again in row 100; left out" in said) == bool(between)


def test_what_is_wrong_in_a_later_log_is_found_in_its_file(tmp_path):
    t = 1e-3 * (np.arange(200) % 100)
    rows = lines_of(changed(t=t, i_a=["x" if k == 150 else 1.0 * (k % 7) for k in range(200)]))
    with pytest.raises(
        BadInput, match=r"log-2.csv: row 50 of column 'i_a' is 'x'.*log.csv from row 100 on; cut"
    ):
        read_lines(tmp_path, rows)


@pytest.mark.parametrize("names", [ALL, NO_T])
@pytest.mark.parametrize("often", [12, 13, 20])
def test_the_longest_of_many_logs_are_kept(tmp_path, names, often):
    """Logs of 70, 71, ... rows, each behind a header."""
    lengths = [70 + k for k in range(often + 1)]
    whole, ends = columns(sum(lengths)), np.cumsum(lengths)
    logs = [
        {k: x[b - n : b] for k, x in whole.items()} | {"t": whole["t"][:n]}
        for n, b in zip(lengths, ends, strict=True)
    ]
    rows = [x for log in logs for x in lines_of(log, names)]
    campaign = read_lines(tmp_path, rows)
    assert [len(r.t) for r in campaign.recordings] == lengths[-12:]
    assert [r.file for r in campaign.recordings] == [f"log-{k}.csv" for k in range(1, 13)]
    (said,) = (f.text for f in campaign.findings if "begins again" in f.text)
    kept = (
        f"it becomes 12 recordings, the longest of {often + 1}; {sum(lengths[:-12])} rows "
        "are left out"
    )
    assert said.endswith(f"in row 70 ({often} times); {kept}")


def test_columns_that_change_places_in_the_middle_are_refused(tmp_path):
    rows, other = lines_of(columns()), lines_of(columns(), NAMES[::-1])
    with pytest.raises(
        BadInput, match="row 100 is a header of the same columns in another order; make two files"
    ):
        read_lines(tmp_path, [*rows[:101], *other])


@pytest.mark.parametrize("mark", [".", " ", "\xa0", "\u202f", "'", "’"])
def test_thousands_are_grouped_as_people_do(tmp_path, mark):
    own = changed(
        u_alpha=[
            f"{1e3 * x:,.6f}".replace(",", "_").replace(".", ",").replace("_", mark)
            for x in columns()["u_alpha"]
        ]
    )
    rows = lines_of(own, separator=";", point=",")
    (tmp_path / "log.csv").write_text("\n".join(rows), encoding="utf-8")
    (tmp_path / "map.toml").write_text(MAP + '[columns]\nu_alpha = {unit = "mV"}\n')
    found = read_recordings(tmp_path, tmp_path / "map.toml")["log"].u_alpha
    assert np.allclose(found, columns()["u_alpha"], rtol=0.0, atol=1e-8)


def test_a_comma_beside_points_groups_thousands(tmp_path):
    """1,500 among numbers with points is no 1.5."""
    rows = lines_of(columns())
    rows[1] = '0,"1,500",0.5,2.25,-1.25,-1,0'
    (tmp_path / "log.csv").write_text("\n".join(rows))
    own = read_text(tmp_path / "log.csv", 10**6).columns
    assert own["u_alpha"][0] == 1500.0
    assert own["i_a"][0] == 2.25


WRITTEN = {
    "quotes": lambda x: f"'{x}'",
    "texts of a spreadsheet": lambda x: f'="{x}"',
    "a true minus": lambda x: x.replace("-", "\u2212") if x[0] == "-" else x,
}


@pytest.mark.parametrize("name", WRITTEN)
def test_cells_as_programs_dress_them(tmp_path, name):
    rows = [",".join(WRITTEN[name](x) for x in row.split(",")) for row in lines_of(columns())]
    assert np.allclose(read_lines(tmp_path, rows)["log"].i_b, columns()["i_b"], rtol=0, atol=1e-8)


def test_a_mark_of_bytes_twice_is_no_name(tmp_path):
    rows = lines_of(columns())
    campaign = read_lines(tmp_path, ["\ufeff\ufeff" + rows[0], *rows[1:]])
    assert not any("'t' is missing" in f.text for f in campaign.findings)


OTHER_KINDS = {
    b"PK\x03\x04": "it is a workbook or an archive",
    b"\x1f\x8b\x08": "it is compressed; unpack it",
    b'{"t": 0.0, "i_a": 1.0}\n': "it is JSON",
    b"<html><table>": "it is a web page",
}


@pytest.mark.parametrize("begin", OTHER_KINDS)
def test_what_is_no_text_is_said(tmp_path, begin):
    (tmp_path / "log.csv").write_bytes(begin + b"\x00\x01" * 99)
    (tmp_path / "map.toml").write_text(MAP)
    with pytest.raises(BadInput, match=OTHER_KINDS[begin]):
        read_recordings(tmp_path, tmp_path / "map.toml")


ROWS = lines_of(columns())
DAMAGED = {
    "a cell too few": (
        [*ROWS[:50], ROWS[50].rpartition(",")[0], *ROWS[51:]],
        "row 49 has 6 cells, the header has 7; the row is damaged: mend it",
    ),
    "two lines in one": (
        [*ROWS[:50], ROWS[50] + ROWS[51], *ROWS[52:]],
        "row 49 has 13 cells, the header has 7; the row is damaged",
    ),
    "rows that are counted": (
        [ROWS[0], *(f"{k},{row}" for k, row in enumerate(ROWS[1:]))],
        "has 8 cells, the header has 7; if the first cell counts the rows, give that column a name",
    ),
    "a log of other columns below": (
        [*ROWS[:101], "t,i_a,i_b", *(",".join(row.split(",")[3:6]) for row in ROWS[1:101])],
        r"a header of other columns stands above row 100 \('t,i_a,i_b'\); make two files of it",
    ),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_is_told_with_its_row(tmp_path, name):
    rows, said = DAMAGED[name]
    with pytest.raises(BadInput, match=said):
        read_lines(tmp_path, rows)
