"""Tables of other programs become the same campaign as the bench's own; what a door cannot take is
one sentence."""

import json
import math
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.cli import main
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.column_map import KIND
from sandbox.recordings.importing import how_to_map, read_recordings, regular, source_of
from sandbox.recordings.writing import write_campaign
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign

DRIVE = load_drive("ipm_exchanged")
H = DRIVE.converter.sampling_period
NAMES = ("t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "u_dc")
MAP = """
[columns]
t = {column = "Time", unit = "ms"}
u_alpha = "Ua"
u_beta = "Ub"
i_a = {column = "Ia", unit = "mA"}
i_b = {column = "Ib", unit = "mA"}
i_c = {column = "Ic", unit = "mA"}
theta = {column = "Pos", unit = "deg", mechanical = true}
u_dc = {column = "Link", unit = "kV"}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A campaign of the bench's own format: three staircases at locked rotor."""
    bench = LockedBench(theta=0.7, noise=0.002, resolution=0.0024)
    campaign = paper_campaign(DRIVE, np.linspace(-1.92, 1.92, 7), 60, bench)
    return write_campaign(tmp_path_factory.mktemp("own") / "c", campaign)


def _tables(folder, suffix):
    return (folder / "campaign.toml").read_text().replace(".parquet", suffix)


def _foreign(r):
    """The same recording as another program writes it: other names, units and a mechanical
    angle."""
    turn = np.degrees(r.theta / DRIVE.motor.pole_pairs)
    return {
        "Time": 1e3 * r.t,
        "Ua": r.u_alpha,
        "Ub": r.u_beta,
        "Ia": 1e3 * r.i_a,
        "Ib": 1e3 * r.i_b,
        "Ic": 1e3 * r.i_c,
        "Pos": turn,
        "Link": 1e-3 * r.u_dc,
        "Note": np.zeros(len(r.t)),
    }


def _write_csv(path, columns, separator=",", comma=False, units=None, digits=17):
    lines = [separator.join(columns)] + ([separator.join(units)] if units else [])
    for row in zip(*columns.values(), strict=True):
        cells = [f"{x:.{digits}g}" for x in row]
        lines.append(separator.join(c.replace(".", ",") if comma else c for c in cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write(kind, path, columns):
    if kind == "csv":
        _write_csv(path, columns)
    elif kind == "german csv":
        _write_csv(path, columns, ";", True, ["ms", "V", "V", "mA", "mA", "mA", "deg", "kV", ""])
    elif kind == "parquet":
        import pyarrow
        from pyarrow import parquet

        parquet.write_table(pyarrow.table(columns), path)
    else:
        from scipy.io import savemat

        savemat(path, {"log": columns} if kind == "mat structure" else columns)


@pytest.mark.parametrize(
    ("kind", "suffix"),
    [
        ("csv", ".csv"),
        ("german csv", ".csv"),
        ("parquet", ".parquet"),
        ("mat", ".mat"),
        ("mat structure", ".mat"),
    ],
)
def test_every_format_gives_the_same_campaign(folder, tmp_path, kind, suffix):
    own = read_folder(folder)
    for r in own.recordings:
        _write(kind, tmp_path / r.file.replace(".parquet", suffix), _foreign(r))
    text = (
        MAP
        if kind != "mat structure"
        else MAP.replace('column = "', 'column = "log.').replace('= "U', '= "log.U')
    )
    (tmp_path / "columns.toml").write_text(text + _tables(folder, suffix))
    found = read_recordings(tmp_path, tmp_path / "columns.toml")
    assert found.findings == ()
    assert found.drive == own.drive
    for a, b in zip(found.recordings, own.recordings, strict=True):
        assert (a.rotor, a.injection_axis) == (b.rotor, b.injection_axis)
        for n in NAMES:  # unit factors round twice, 4e-16 of the value; t is near 1 s
            np.testing.assert_allclose(a.columns[n], b.columns[n], rtol=1e-14, atol=1e-15)


def test_a_folder_of_the_format_is_read_as_before(folder):
    assert read_recordings(folder).recordings[0].file == read_folder(folder).recordings[0].file
    assert len(read_recordings(folder / "locked_d.parquet").recordings) == 1


def _one(tmp_path, columns, mapping="", rotor="free", **drive):
    """Read one CSV beside a column map."""
    _write_csv(tmp_path / "run.csv", columns)
    head = f'[[recording]]\nfile = "run.csv"\nrotor = "{rotor}"\n'
    values = {"sampling_period": H, "dc_bus_voltage": 400.0, **drive}
    motor = {
        n: getattr(DRIVE.motor, n) for n in ("pole_pairs", "resistance", "magnet_flux", "inertia")
    }
    motor |= {n: getattr(DRIVE.motor, n) for n in ("inductance_d", "inductance_q")}
    tables = {"drive": values, "motor": motor, "injection": {"frequency": 500.0, "amplitude": 30.0}}
    for name, table in tables.items():
        head += f"[{name}]\n" + "".join(f"{k} = {v}\n" for k, v in table.items())
    (tmp_path / "columns.toml").write_text(head + mapping)
    return read_recordings(tmp_path, tmp_path / "columns.toml")


def _turning(n=800, omega=300.0):
    """Steady turning of the linear motor in closed form: i_d = 0, i_q = 1 A, held voltages averaged
    over the period."""
    m, t = DRIVE.motor, np.arange(n) * H
    turn = np.exp(1j * omega * t)
    i = 1j * turn
    u = (1j * m.resistance + 1j * omega * (1j * m.inductance_q + m.magnet_flux)) * turn
    u = u * (np.exp(1j * omega * H) - 1.0) / (1j * omega * H)  # its mean over [t, t + h)
    abc = [(x * np.exp(-2j * math.pi / 3 * k)).real for x in (i,) for k in range(3)]
    return t, omega * t, u, i, abc


def _columns(**changes):
    t, theta, u, _, (a, b, c) = _turning()
    columns = {
        "t": t,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "i_a": a,
        "i_b": b,
        "i_c": c,
        "theta": theta,
    }
    columns |= {"u_dc": np.full(len(t), 400.0)}
    return {k: v for k, v in {**columns, **changes}.items() if v is not None}


def test_other_kinds_of_signals_give_the_same_recording_and_say_what_is_lost(tmp_path):
    _, theta, u, i, (a, _, c) = _turning()
    turned_i, turned_u = i * np.exp(-1j * theta), u * np.exp(-1j * theta)
    legs = [(u * np.exp(-2j * math.pi / 3 * k)).real for k in range(3)]
    no_i, no_u = dict.fromkeys(("i_a", "i_b", "i_c")), dict.fromkeys(("u_alpha", "u_beta"))
    cases = [
        ({"i_c": None}, ["i_c"]),
        ({**no_i, "i_a": a, "i_c": c}, ["i_b"]),
        ({**no_i, "i_alpha": i.real, "i_beta": i.imag}, ["i_a"]),
        ({**no_i, "i_d": turned_i.real, "i_q": turned_i.imag}, ["i_a"]),
        ({**no_u, "u_d": turned_u.real, "u_q": turned_u.imag}, ["u_alpha"]),
        ({**no_u, **{f"u_{p}": x + 17.0 for p, x in zip("abc", legs, strict=True)}}, []),
        (
            {**no_u, **{f"d_{p}": 0.5 + x / 400.0 for p, x in zip("abc", legs, strict=True)}},
            ["u_alpha"],
        ),
        ({"u_dc": None}, ["u_dc"]),
        ({"t": None}, ["t"]),
    ]
    for changes, lost in cases:
        found = _one(tmp_path, _columns(**changes))
        assert [f.column for f in found.findings] == lost, changes
        for n, wanted in _columns().items():
            np.testing.assert_allclose(
                found.recordings[0].columns[n], wanted, atol=1e-11, err_msg=n
            )


def test_a_wrapped_angle_is_unwrapped_and_said(tmp_path):
    theta = _columns()["theta"]
    p = DRIVE.motor.pole_pairs
    cases = [
        (np.mod(theta, 2 * math.pi), ""),
        (
            np.degrees(np.mod(theta + math.pi, 2 * math.pi) - math.pi),
            'theta = {column = "theta", unit = "deg"}',
        ),
        (np.mod(theta / p, 2 * math.pi), 'theta = {column = "theta", mechanical = true}'),
        (
            np.mod(-theta / p / math.tau * 4096, 4096),
            f'theta = {{column = "theta", scale = {-math.tau / 4096}, mechanical = true}}',
        ),
    ]
    for raw, entry in cases:
        found = _one(tmp_path, _columns(theta=raw), "[columns]\n" + entry)
        assert ["unwrapped" in f.text and f.row is not None for f in found.findings] == [True]
        got = found.recordings[0].theta
        np.testing.assert_allclose(np.diff(got), np.diff(theta), atol=1e-9)
        # counts began at 0 from above: a whole turn of the shaft further on
        turns = (got - theta)[0] / math.tau
        assert turns == pytest.approx(round(turns), abs=1e-9)


def test_clocks():
    rng, n = np.random.default_rng(0), 400
    t = np.arange(n) * H
    same, notes = regular("f", t, n, H)
    assert same is t
    assert notes == []
    # 0.1 ms digits at 0.25 ms: 0.05 ms off, 20 % of a period
    shaken, notes = regular("f", np.round(t, 4), n, H)
    np.testing.assert_allclose(shaken, t)
    assert "values unchanged" in notes[0].text
    cases = [
        (1e3 * t, "is t in ms"),
        (1e6 * t, "is t in us"),
        (t * 2.0, "correct \\[drive\\] sampling_period, or export every"),
        (t * 1.02, "t advances by 0.000255 s a row"),
        (
            np.where(np.arange(n) > 99, t + 3 * H, t),
            "t steps by 0.001 s from row 99 to 100.*3 samples are missing",
        ),
        (np.delete(t, 50), "t steps by 0.0005 s from row 49 to 50.*1 samples are missing"),
        (np.where(np.arange(n) == 70, t - 2 * H, t), "row 70 of column 't' is .* not after row 69"),
        (
            t + 0.05 * H * rng.choice([-1, 1], n) + np.where(np.arange(n) == 33, 0.3 * H, 0),
            "row 33 of column 't' is",
        ),
    ]
    for wrong, message in cases:
        with pytest.raises(BadInput, match=message):
            regular("f", wrong, len(wrong), H)


COLUMNS_WRONG = [
    ('[columns]\nthta = "x"', "unknown name in \\[columns\\] 'thta'; did you mean 'theta'"),
    (
        '[columns]\ni_a = {colum = "x"}',
        "unknown key in \\[columns\\] i_a 'colum'; did you mean 'column'",
    ),
    (
        '[columns]\ni_a = {column = "i_a", unit = "mAA"}',
        "unknown unit of current 'mAA'; did you mean 'mA'",
    ),
    ("[columns]\ni_a = 3", "i_a = 3 is no entry"),
    ('[columns]\ni_a = {column = "i_a", scale = 0}', "scale = 0 would erase"),
    ('[columns]\ni_a = {column = "i_a", scale = nan}', "scale = nan is no finite number"),
    ('[columns]\ni_a = {column = "i_a", mechanical = true}', "mechanical = true is for theta"),
    ('[columns]\nu_dc = {column = "u_dc", value = 400}', "both column and value"),
    ('[columns]\ni_a = "I_a"', "run.csv: no column 'I_a' \\(for 'i_a'\\); is it 'i_a'"),
    ("[colums]", "unknown table 'colums'"),
]


@pytest.mark.parametrize(("text", "message"), COLUMNS_WRONG)
def test_a_wrong_map_names_its_key(tmp_path, text, message):
    with pytest.raises(BadInput, match=message):
        _one(tmp_path, _columns(), text)


def test_a_map_that_is_no_table_is_refused(tmp_path):
    (tmp_path / "m.toml").write_text("columns = 3")
    with pytest.raises(BadInput, match=r"m\.toml: 'columns' is not a table"):
        read_recordings(tmp_path, tmp_path / "m.toml")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"theta": None}, "column 'theta' is missing"),
        ({"i_a": None, "i_b": None, "i_c": None}, "no currents; map i_a and i_b"),
        ({"i_b": None, "i_c": None}, "i_a without i_b tells no current .log or map all of them"),
        ({"u_alpha": None, "u_beta": None}, "no commanded voltages"),
        ({"u_beta": None}, "u_alpha without u_beta tells no voltage"),
        (
            {"u_alpha": None, "u_beta": None, "d_a": np.full(800, 0.5), "d_b": np.full(800, 0.5)},
            "d_a and d_b without d_c tell no voltage",
        ),
        (
            {"theta": None, "hall_a": np.ones(800), "hall_b": np.ones(800)},
            "hall_a and hall_b without hall_c tell no angle",
        ),
        ({"i_b": np.full(800, np.nan)}, "column 'i_b' holds no number in any row; map the column"),
    ],
)
def test_what_is_missing_is_named(tmp_path, changes, message):
    with pytest.raises(BadInput, match=message):
        _one(tmp_path, _columns(**changes))


@pytest.mark.parametrize(
    ("changes", "mapping", "message"),
    [
        ({"u_dc": None}, "", "u_dc': not recorded, dc_bus_voltage = 400 V stands in"),
        (
            {"u_dc": None},
            "[columns]\nu_dc = {value = 400.0}\n",
            "u_dc': 400 V given as a constant; link sag and ripple stay unseen",
        ),
    ],
)
def test_a_link_that_the_log_does_not_hold_is_said(tmp_path, changes, mapping, message):
    campaign = _one(tmp_path, _columns(**changes), mapping)
    assert any(message in f.text for f in campaign.findings), campaign.findings


def second(line, cell):
    """Return a line of a CSV with another second cell, a commanded voltage."""
    first, _, *rest = line.split(",")
    return ",".join((first, cell, *rest))


def _edited(tmp_path, old, new):
    _one(tmp_path, _columns())
    path = tmp_path / "run.csv"
    lines = path.read_text().splitlines()
    lines[0 if old is None else old] = new(lines[0 if old is None else old])
    path.write_text("\n".join(lines))
    return read_recordings(tmp_path, tmp_path / "columns.toml")


@pytest.mark.parametrize(
    ("line", "new", "message"),
    [
        (8, lambda x: second(x, ""), "row 7 of column 'u_alpha' is empty, no number"),
        (8, lambda x: second(x, "n/a"), "row 7 of column 'u_alpha' is 'n/a', no number"),
        (8, lambda x: x.rsplit(",", 1)[0] + ",inf", "row 7 of column 'u_dc' is inf, no number"),
        (8, lambda x: x + ",1,2", "row 7 has 10 cells, the header has 8"),
        (0, lambda x: x.replace("i_b", "i_a"), "column 'i_a' stands twice"),
        (0, lambda x: "0,1,2,3,4,5,6,7", "the first line is no header"),
        (0, lambda x: x.replace("i_a", "i_a [furlong]"), "unknown unit of current 'furlong'"),
    ],
)
def test_a_wrong_csv_names_row_and_column(tmp_path, line, new, message):
    with pytest.raises(BadInput, match=message):
        _edited(tmp_path, line, new)


def test_units_in_the_header_are_used_and_must_agree(tmp_path):
    columns = {
        ("i_a [mA]" if k == "i_a" else k): (1e3 * v if k == "i_a" else v)
        for k, v in _columns().items()
    }
    found = _one(tmp_path, columns)
    np.testing.assert_allclose(found.recordings[0].i_a, _columns()["i_a"], atol=1e-12)
    with pytest.raises(BadInput, match="column 'i_a' says its unit is mA, \\[columns\\] says A"):
        _one(tmp_path, columns, '[columns]\ni_a = {column = "i_a", unit = "A"}')


def test_files_that_are_something_else_are_refused(tmp_path):
    _one(tmp_path, _columns())
    text = (tmp_path / "columns.toml").read_text()
    for name, content, message in [
        ("run.mat", b"MATLAB 7.3 MAT-file, Platform: GLNXA64", "MAT (version )?7.3"),
        ("run.mat", b"nothing of the kind" * 20, "not a MAT file"),
        ("run.parquet", b"nothing", "not a Parquet table.*; export it again, or as CSV"),
        ("run.xlsx", b"PK", "run.xlsx: cannot be read as a workbook .*; save the sheet as CSV"),
        ("run.ods", b"PK", "format '.ods' is not read; export as one of"),
        ("run.csv", b"\n\n", "no line of data"),
    ]:
        (tmp_path / name).write_bytes(content)
        (tmp_path / "columns.toml").write_text(text.replace("run.csv", name))
        with pytest.raises(BadInput, match=message):
            read_recordings(tmp_path, tmp_path / "columns.toml")
    (tmp_path / "run.mf4").write_bytes(b"MDF")
    (tmp_path / "columns.toml").write_text(text.replace("run.csv", "nothing.csv"))
    with pytest.raises(BadInput, match=r"nothing.csv: the file does not exist"):
        read_recordings(tmp_path, tmp_path / "columns.toml")
    with pytest.raises(BadInput, match=r"\[\[recording\]\] with file = \"run.mat\""):
        read_recordings(tmp_path / "run.mat", tmp_path / "columns.toml")


def test_mdf_without_its_package_says_how_to_get_it(tmp_path, monkeypatch):
    _one(tmp_path, _columns())
    (tmp_path / "run.mf4").write_bytes(b"MDF")
    text = (tmp_path / "columns.toml").read_text().replace("run.csv", "run.mf4")
    (tmp_path / "columns.toml").write_text(text)
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(
        BadInput, match=r"needs asammdf; install it with pip install 'sensorless-sandbox\[mdf\]'"
    ):
        read_recordings(tmp_path, tmp_path / "columns.toml")


MDF_MAP = "[columns]\n" + "".join(f'{n} = "{n}"\n' for n in NAMES if n != "t")


def test_mdf_channels_of_one_raster(tmp_path):
    asammdf = pytest.importorskip(
        "asammdf", reason="optional: pip install 'sensorless-sandbox[mdf]'"
    )
    _one(tmp_path, _columns())
    signals = [
        asammdf.Signal(samples=v, timestamps=_columns()["t"], name=k, unit={"i": "A"}.get(k[0], ""))
        for k, v in _columns().items()
        if k != "t"
    ]
    with asammdf.MDF() as file:
        file.append(signals)
        file.save(tmp_path / "run.mf4")
    text = (tmp_path / "columns.toml").read_text().replace("run.csv", "run.mf4")
    (tmp_path / "columns.toml").write_text(text + MDF_MAP)
    found = read_recordings(tmp_path, tmp_path / "columns.toml")
    for n in NAMES:
        np.testing.assert_allclose(found.recordings[0].columns[n], _columns()[n], atol=1e-12)


def test_identify_takes_a_column_map(folder, tmp_path):
    for r in read_folder(folder).recordings:
        _write("csv", tmp_path / r.file.replace(".parquet", ".csv"), _foreign(r))
    (tmp_path / "columns.toml").write_text(MAP + _tables(folder, ".csv"))
    call = [
        "identify",
        str(tmp_path),
        "--columns",
        str(tmp_path / "columns.toml"),
        "--out",
        str(tmp_path / "o"),
    ]
    assert main([*call, "--quiet"]) == 0


words = st.sampled_from(
    [*KIND, "columns", "column", "unit", "scale", "deg", "mA", "recording", "file", "[", "]", "x"]
)
values = st.one_of(
    words, st.integers(-3, 9), st.floats(), st.booleans(), st.lists(st.integers(0, 3), max_size=2)
)
fuzzing = settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))


def _toml_value(x):
    if isinstance(x, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml_value(v)}" for k, v in x.items()) + "}"
    if isinstance(x, float):
        return {"inf": "inf", "-inf": "-inf", "nan": "nan"}.get(str(x), repr(x))
    return json.dumps(x)


@fuzzing
@given(
    st.dictionaries(
        words, st.one_of(values, st.dictionaries(words, values, max_size=3)), max_size=4
    )
)
def test_any_map_is_taken_or_refused_in_one_sentence(tmp_path, content):
    text = "[columns]\n" + "".join(f'"{k}" = {_toml_value(v)}\n' for k, v in content.items())
    try:
        _one(tmp_path, _columns(), text)
    except BadInput as refusal:
        assert "\n" not in str(refusal)


cells = st.one_of(
    st.floats().map(repr), st.sampled_from(["", "1,5", "1e400", "nan", "x", '"', "0", "-", "°"])
)


@fuzzing
@given(
    st.sampled_from([",", ";", "\t"]),
    st.lists(st.sampled_from([*NAMES, "i_a [mA]", "x", ""]), min_size=1, max_size=9),
    st.lists(st.lists(cells, min_size=1, max_size=9), max_size=5),
    st.binary(max_size=6),
)
def test_any_csv_is_taken_or_refused_in_one_sentence(tmp_path, separator, header, rows, tail):
    _one(tmp_path, _columns())
    text = "\n".join(separator.join(row) for row in [header, *rows])
    (tmp_path / "run.csv").write_bytes(text.encode() + tail)
    try:
        read_recordings(tmp_path, tmp_path / "columns.toml")
    except BadInput as refusal:
        assert "\n" not in str(refusal)


def test_example_of_the_document(tmp_path):
    root = Path(__file__).resolve().parents[3]
    text = re.search(
        r"```toml\n(.*?)```", (root / "sandbox" / "recordings" / "IMPORTING.md").read_text(), re.S
    )[1]
    _, theta, u, _, (a, b, _) = _turning()
    duties = [50.0 + (u * np.exp(-2j * math.pi / 3 * k)).real / 4.0 for k in range(3)]  # % of 400 V
    columns = {
        "Time": 1e3 * _columns()["t"],
        "Ia": 1e3 * a,
        "Ib": 1e3 * b,
        "Udc": np.full(len(a), 400.0),
    }
    columns |= dict(zip(("DutyA", "DutyB", "DutyC"), duties, strict=True))
    _write_csv(tmp_path / "run.csv", {**columns, "Pos": -np.degrees((theta - 0.35) / 6)}, ";", True)
    (tmp_path / "columns.toml").write_text(text)
    found = read_recordings(str(tmp_path), str(tmp_path / "columns.toml"))  # texts are paths, too
    assert [f.column for f in found.findings] == ["i_c", "u_alpha"]
    for n in NAMES:
        np.testing.assert_allclose(found.recordings[0].columns[n], _columns()[n], atol=1e-11)


@pytest.mark.parametrize("index", ["number", "text"])
def test_an_index_that_pandas_saved_is_passed_over(tmp_path, index):
    import pyarrow
    from pyarrow import parquet

    from sandbox.recordings.campaign import EXAMPLE

    shutil.copytree(EXAMPLE, tmp_path / "mine")
    file = tmp_path / "mine" / "locked_slow.parquet"
    table = parquet.read_table(file)
    rows = range(table.num_rows) if index == "number" else ["r"] * table.num_rows
    parquet.write_table(table.append_column("__index_level_0__", pyarrow.array(list(rows))), file)
    assert len(read_recordings(tmp_path / "mine").recordings) == 4


def test_a_sentence_that_says_map_says_where_where_nothing_is_mapped():
    assert how_to_map("theta is turned: map it with scale = -1").endswith(
        "([columns] in a file for --columns)"
    )
    assert how_to_map("correct [drive] sampling_period") == "correct [drive] sampling_period"


def test_a_flux_map_lies_beside_the_file_that_names_it_or_beside_the_log(tmp_path):
    log, maps = tmp_path / "log", tmp_path / "maps"
    log.mkdir()
    maps.mkdir()
    (log / "run.csv").write_text("t,i_q\n0,1\n")
    (maps / "mine.toml").write_text(
        '[flux_map]\nfile = "motor.csv"\n[[recording]]\nfile = "run.csv"\nrotor = "free"\n'
    )
    assert source_of(log, maps / "mine.toml").map_folder == log
    (maps / "motor.csv").write_text("")
    assert source_of(log, maps / "mine.toml").map_folder == maps
