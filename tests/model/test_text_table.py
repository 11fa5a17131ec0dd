"""Texts as programs write them: each stands for one table of numbers, which the reader has to find
in it."""

import io

import numpy as np
import pytest

from model.errors import BadInput
from model.number_table import Table
from model.text_table import read_lines, read_text
from model.workbook import read_workbook

ROWS = np.array([[0.0, -1.5, 120.25], [0.001, 2.0, 121.0], [0.002, 2.5, -3.75], [0.003, 1.25, 4.0]])


def lines(separator=",", head="t,i_a,theta", comma=False, end="\n"):
    """Return the table as a text."""
    rows = [separator.join(f"{x!r}" for x in row.tolist()) for row in ROWS]
    text = end.join([head.replace(",", separator), *rows, ""])
    return text.replace(".", ",") if comma else text


def found(text, encoding="utf-8", most=1000) -> Table:
    raw = text if isinstance(text, bytes) else text.encode(encoding)
    return read_lines("log.csv", io.TextIOWrapper(io.BytesIO(raw), "utf-8"), most)


def content(table):
    """Return the names of a table's columns and its rows."""
    return list(table.columns), np.stack(list(table.columns.values()), axis=1).tolist()


WHOLE = ["t", "i_a", "theta"], ROWS.tolist()


@pytest.mark.parametrize(
    "text",
    [
        lines(),
        lines(";", comma=True),
        lines("\t", comma=True),
        lines("  "),
        lines(" ", comma=True),
        lines("|"),
        lines(", "),
        lines(end="\r\n"),
        lines(end="\r"),
        "sep=;\n" + lines(";", comma=True),
        "# made by a program\n" + lines(),
        lines().replace("0.001", "# a remark\n0.001"),
        "# t,i_a,theta\n" + lines().partition("\n")[2],
        lines() + "\n\n",
        lines() + ",,\n,,\n",
        lines() + "\x00" * 512,
        lines() + "0.004,1.",
        lines() + "0.004,1.0,",
        lines() + "ch> \n",
        lines() + "Thanks for using the terminal\n",
        "Terminal ready\n" + lines() + "logout\n",
        "Motor: ready.\nMOT: Align sensor.\n" + lines("\t"),
        lines().replace("0.002", "t,i_a,theta\n0.002"),
        "\n".join(f"12:03:45.{k:03d} -> {x}" for k, x in enumerate(lines("\t").splitlines())),
        "\n".join(f"[12:03:45.{k:03d}] {x}" for k, x in enumerate(lines().splitlines())),
        "\n".join(f"> {x}" for x in lines().splitlines()),
        "\n".join(f"\x1b[32m{x}\x1b[0m" for x in lines().splitlines()),
        "3,-4.5\n" + lines(),  # a terminal that was opened in the middle of a row
        '"t","i_a","theta"\n'
        + "\n".join(",".join(f'"{x!r}"' for x in row.tolist()) for row in ROWS),
    ],
)
def test_a_table_is_found_in_what_a_program_writes(text):
    assert content(found(text)) == WHOLE


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"]
)
def test_any_usual_encoding_is_read(tmp_path, encoding):
    path = tmp_path / "log.csv"
    path.write_bytes(lines(head="t,i_a [mA],theta [°]").encode(encoding))
    table = read_text(path, 1000)
    assert content(table) == WHOLE
    assert table.units == {"i_a": "mA", "theta": "°"}


@pytest.mark.parametrize(
    ("head", "names", "units", "spelled"),
    [
        ("t,I(A),I(B)", ["t", "I(A)", "I(B)"], {}, {}),
        ("t,I(A),I(C)", ["t", "I(A)", "I(C)"], {}, {}),
        ("t,I[0],I[1]", ["t", "I[0]", "I[1]"], {}, {}),
        ("t,theta,theta(raw)", ["t", "theta", "theta(raw)"], {}, {}),
        ("t,I [A],I [mA]", ["t", "I [A]", "I [mA]"], {"I [A]": "A", "I [mA]": "mA"}, {}),
        (
            "Time (s),I [mA],x",
            ["Time", "I", "x"],
            {"Time": "s", "I": "mA"},
            {"Time (s)": "Time", "I [mA]": "I"},
        ),
        (
            "t,State(num),x",
            ["t", "State(num)", "x"],
            {"State(num)": "num"},
            {"State": "State(num)"},
        ),
        (
            "t/s,I/mA,n/(1/min)",
            ["t", "I", "n"],
            {"t": "s", "I": "mA", "n": "1/min"},
            {"t/s": "t", "I/mA": "I", "n/(1/min)": "n"},
        ),
        ("t,phase/A,phase/B", ["t", "phase/A", "phase/B"], {}, {}),
        ("t,motor/current,x", ["t", "motor/current", "x"], {}, {}),
        ("t,x,x", ["t", "x", "x #2"], {}, {}),
        (",x,y", ["column 1", "x", "y"], {}, {"": "column 1"}),
    ],
)
def test_a_bracket_is_a_unit_where_it_is_a_known_one_and_names_stay_apart(
    head, names, units, spelled
):
    table = found(lines(head=head))
    assert content(table) == (names, ROWS.tolist())
    assert table.units == units
    assert table.also == spelled
    for whole in head.split(","):
        if head.count(",x") < 2:
            assert table.key(whole) is not None


def test_a_name_that_stands_twice_is_refused_only_where_it_is_asked_for():
    table = found(lines(head="t,x,x"))
    assert table.key("t") == "t"
    with pytest.raises(BadInput, match="'x' stands twice"):
        table.key("x")
    assert found("t,x,x\n1,2,2\n3,4,4\n").key("x") == "x"  # one and the same


def test_a_row_of_units_is_told_from_a_line_above():
    table = found("Time,Channel A,Channel B\n(ms),(V),(mV)\n\n" + lines().partition("\n")[2])
    assert content(table) == (["Time", "Channel A", "Channel B"], ROWS.tolist())
    assert table.units == {"Time": "ms", "Channel A": "V", "Channel B": "mV"}
    assert content(found("Scope,of,today\n" + lines())) == WHOLE


def test_a_table_on_its_side_is_told():
    """Each line a signal: a name and then its samples, as a spreadsheet's export of rows is."""
    own = "\n".join(f"{n}," + ",".join(f"{k * x:g}" for k in range(9)) for n, x in LYING.items())
    with pytest.raises(BadInput, match=r"lies on its side.*'t', 'i_a'.*transpose it"):
        found(own)
    assert content(found(lines())) == WHOLE


LYING = {"t": 0.001, "i_a": 0.5, "theta": 0.1}


def test_grouped_thousands_are_numbers():
    table = found("t;x\n0;1.234,5\n1;-12.345.678,25\n2;7,5\n")
    assert table.columns["x"].tolist() == [1234.5, -12345678.25, 7.5]
    assert found('t,x\n0,"1,234.5"\n1,"2,5"\n').columns["x"].tolist() == [1234.5, 2.5]


def test_what_was_left_out_is_told():
    assert "the last row is cut" in found(lines() + "0.004,1.0,").notes[0][1]
    assert "'Stopped by user'" in found(lines() + "Stopped by user\n").notes[0][1]
    with pytest.raises(BadInput, match="row 2 has 2 cells, the header has 3"):
        found(lines().replace("0.002,2.5", "0.002"))
    with pytest.raises(BadInput, match="row 0 has 6 cells, the header has 3"):
        found(lines(comma=True))
    with pytest.raises(BadInput, match="the first line is no header"):
        found(lines().partition("\n")[2])
    assert found(lines().replace("2.5", "fault")).odd == {("i_a", 2): "fault"}


def test_a_workbook_is_read_as_the_text_it_would_be_saved_as(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["What was measured"])
    sheet = book.create_sheet("log")
    for row in (["made by hand"], ["t", "i_a [mA]", "theta"], *ROWS.tolist()):
        sheet.append(row)
    book.save(tmp_path / "log.xlsx")
    table = read_workbook(tmp_path / "log.xlsx", 1000)
    assert content(table) == WHOLE
    assert table.units == {"i_a": "mA"}
    with pytest.raises(BadInput, match="more than 1e-05 million values"):
        read_workbook(tmp_path / "log.xlsx", 10)
    (tmp_path / "log.xlsx").write_bytes(b"PK")
    with pytest.raises(BadInput, match="cannot be read as a workbook"):
        read_workbook(tmp_path / "log.xlsx", 10)
