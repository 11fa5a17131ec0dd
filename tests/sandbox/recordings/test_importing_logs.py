"""Logs as other programs write them: stamps with gaps and scatter, several rasters, matrices, TDMS,
MCAP, MAT 7.3."""

import json
import math
import sys

import numpy as np
import pytest

from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.stamps import SHORTEST, by_arrival, stamp_jitter

DRIVE = load_drive("ipm_exchanged")
H = DRIVE.converter.sampling_period
NAMES = ("t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "u_dc")


def turning(n=400, omega=300.0):
    """Columns of steady turning of the linear motor in closed form: i_d = 0, i_q = 1 A, held
    voltages."""
    m, t = DRIVE.motor, np.arange(n) * H
    turn = np.exp(1j * omega * t)
    u = (1j * m.resistance + 1j * omega * (1j * m.inductance_q + m.magnet_flux)) * turn
    u = u * (np.exp(1j * omega * H) - 1.0) / (1j * omega * H)  # its mean over [t, t + h)
    a, b, c = ((1j * turn * np.exp(-2j * math.pi / 3 * k)).real for k in range(3))
    link = np.full(n, 400.0)
    return dict(zip(NAMES, (t, u.real, u.imag, a, b, c, omega * t, link), strict=True))


def campaign(folder, file, mapping="", **drive):
    """Write the tables of a campaign with one recording and read it with a column map."""
    motor = ("pole_pairs", "resistance", "magnet_flux", "inductance_d", "inductance_q", "inertia")
    head = f'[[recording]]\nfile = "{file}"\nrotor = "free"\n[motor]\n'
    head += "".join(f"{k} = {getattr(DRIVE.motor, k)}\n" for k in motor)
    head += f"[drive]\nsampling_period = {H}\ndc_bus_voltage = 400.0\n"
    head += "".join(f"{k} = {v}\n" for k, v in drive.items())
    (folder / "columns.toml").write_text(head + mapping)
    return read_recordings(folder, folder / "columns.toml")


def holds(found, columns):
    """Return whether the first recording of a campaign holds the columns, to the digits of a
    text."""
    own = found.recordings[0].columns
    return all(np.allclose(own[n], columns[n], rtol=1e-7, atol=1e-11) for n in NAMES)


def csv(path, columns, digits=17):
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{x:.{digits}g}" for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


def test_a_campaign_without_injection_need_not_state_one(tmp_path):
    csv(tmp_path / "run.csv", turning())
    found = campaign(tmp_path, "run.csv")
    # as a motor's file without it
    assert found.drive.injection.frequency == pytest.approx(1.0 / (8 * H))


def test_gaps_cut_a_recording_into_named_pieces(tmp_path):
    columns = turning(400)
    # 3, 10 and 1 lost; the pieces of 30 and 59 rows are too short
    kept = np.r_[0:150, 153:300, 310:340, 341:400]
    csv(tmp_path / "run.csv", {n: x[kept] for n, x in columns.items()})
    found = campaign(tmp_path, "run.csv")
    assert [r.file for r in found] == ["run-1.csv", "run-2.csv"]
    assert [len(r.t) for r in found] == [150, 147]
    np.testing.assert_allclose(found["run-2"].theta, columns["theta"][153:300], atol=1e-12)
    assert found["run-2"].t[0] == 0.0
    text = found.findings[0].text
    assert "3 gaps" in text
    assert "about 14 samples are missing" in text
    assert "run-1.csv to run-2.csv, 89 rows" in text
    csv(
        tmp_path / "run.csv",
        {n: x[np.arange(400) % (SHORTEST // 2) > 2] for n, x in columns.items()},
    )
    with pytest.raises(BadInput, match=f"no stretch without a gap has {SHORTEST} rows"):
        campaign(tmp_path, "run.csv")


@pytest.mark.parametrize("pause", [0.3, 0.5, -0.4])
def test_a_clock_that_goes_on_beside_the_even_one_is_cut_there(tmp_path, pause):
    """The drive stood still for no whole number of periods: rows before and after are recordings of
    their own, as they were; a single row that was stamped late is none."""
    columns = turning(400)
    columns["t"] = columns["t"] + pause * H * (np.arange(400) >= 180)
    csv(tmp_path / "run.csv", columns)
    found = campaign(tmp_path, "run.csv")
    assert [len(r.t) for r in found] == [180, 220]
    assert "a gap in column 't'" in found.findings[0].text
    assert "the clock goes on beside the even one" in found.findings[0].text
    assert found.findings[0].row == 179
    np.testing.assert_allclose(found["run-2"].theta, columns["theta"][180:], atol=1e-12)
    columns["t"] = turning(400)["t"] + 0.24 * H * (np.arange(400) == 180)
    csv(tmp_path / "run.csv", columns)
    assert [len(r.t) for r in campaign(tmp_path, "run.csv")] == [400]


def test_rows_that_arrive_late_are_the_drives_samples(tmp_path):
    columns, rng = turning(), np.random.default_rng(0)
    late = np.maximum.accumulate(columns["t"] + rng.exponential(0.7 * H, 400)) + 1e-9 * np.arange(
        400
    )
    csv(tmp_path / "run.csv", {**columns, "t": late})
    with pytest.raises(BadInput, match=r"correct|off an even clock|gaps"):
        campaign(tmp_path, "run.csv")
    found = campaign(tmp_path, "run.csv", '[log]\nstamps = "arrival"\n')
    assert holds(found, columns)
    assert "stamps of arrival scatter" in found.findings[0].text
    lost = np.delete(np.arange(1200) * H, [500, 501])  # two samples of 1200
    with pytest.raises(BadInput, match="seems lost"):
        by_arrival("f", lost + rng.exponential(0.1 * H, 1198), H)


def test_polled_rows_are_interpolated_and_their_scatter_is_noise(tmp_path):
    rng, omega, n = np.random.default_rng(1), 60.0, 1600
    fine = turning(n, omega)
    t = np.cumsum(rng.uniform(0.7, 1.3, n)) * H
    t = t[t < (n - 2) * H]
    polled = {k: np.interp(t, fine["t"], x) for k, x in fine.items()} | {"t": t}
    csv(tmp_path / "run.csv", polled)
    found = campaign(tmp_path, "run.csv", '[log]\nstamps = "polled"\n', current_noise=0.001)
    r = found.recordings[0]
    shift = t[0]
    # an arc of omega h between samples is off its chord by (omega h)^2 / 8 = 3e-5 at most, twice
    # interpolated
    np.testing.assert_allclose(r.i_a, np.cos(omega * (r.t + shift) + math.pi / 2), atol=1e-4)
    np.testing.assert_allclose(r.theta, omega * (r.t + shift), atol=1e-9)
    assert "polled rows" in found.findings[0].text
    # exact stamps add none
    assert found.drive.converter.current_noise == pytest.approx(0.001, rel=0.01)


@pytest.mark.parametrize("jitter", [0.0, 2e-5, 2e-4])
def test_the_scatter_of_stamps_is_found_from_a_smooth_angle(jitter):
    rng, n = np.random.default_rng(2), 4000
    t = np.cumsum(rng.uniform(1.5e-3, 3e-3, n))
    count = math.tau / 8192
    angle = count * np.round((6.0 * t + 0.2 * np.sin(5.0 * t)) / count)
    told = stamp_jitter(t + jitter * rng.standard_normal(n), angle, count)
    # a median of 2000 scattered values knows a deviation to 1.2 / sqrt(2000) = 2.6 %; counts at 6
    # rad/s are worth 37 us
    assert told == pytest.approx(jitter, rel=0.1, abs=2.5e-5)


def test_comments_units_and_lines_above_the_header(tmp_path):
    columns = turning()
    csv(tmp_path / "run.csv", columns)
    head, body = (tmp_path / "run.csv").read_text().split("\n", 1)
    units = ",".join(["s", "V", "V", "A", "A", "A", "rad", "V"])
    for text in (
        f"Scope export\nDevice,Drive 3\nDate,2026-11-22\n\n{head}\n{units}\n{body}",
        f"% made by a script\n% second line\n{head}\n{body}",
        f"# {head}\n{body}",  # as NumPy's savetxt writes it
        f"{head}\n// a remark\n{body}",
    ):
        (tmp_path / "run.csv").write_text(text)
        assert holds(campaign(tmp_path, "run.csv"), columns)
    comma = "\n".join(
        line.replace(",", ";").replace(".", ",") for line in (head + "\n" + body).splitlines()
    )
    (tmp_path / "run.csv").write_text("Messung;vom Montag\n" + comma)
    assert holds(campaign(tmp_path, "run.csv"), columns)


def test_matrices_have_their_columns_named(tmp_path):
    from scipy.io import savemat

    columns = turning()
    matrix = np.stack(list(columns.values()), axis=1)
    names = f"[log]\nmatrix = {{NAME = {json.dumps(list(NAMES))}}}\n"
    np.save(tmp_path / "run.npy", matrix.T)  # lying: one row a signal
    assert holds(campaign(tmp_path, "run.npy", names.replace("NAME", "data")), columns)
    savemat(tmp_path / "run.mat", {"log": matrix, "note": "text"})
    assert holds(campaign(tmp_path, "run.mat", names.replace("NAME", "log")), columns)
    by_place = "[columns]\n" + "".join(f'{n} = "log(:,{k})"\n' for k, n in enumerate(NAMES, 1))
    assert holds(campaign(tmp_path, "run.mat", by_place), columns)
    with pytest.raises(BadInput, match="matrix 'log' has 8 columns, 2 names are given"):
        campaign(tmp_path, "run.mat", '[log]\nmatrix = {log = ["t", "i_a"]}\n')
    with pytest.raises(BadInput, match=r"unknown matrix 'lug'; did you mean 'log'"):
        campaign(tmp_path, "run.mat", '[log]\nmatrix = {lug = ["t", "i_a"]}\n')
    np.save(tmp_path / "run.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(BadInput, match="pickled objects, which could run code"):
        campaign(tmp_path, "run.npy")


def test_mat_7_3(tmp_path):
    h5py = pytest.importorskip("h5py", reason="optional: pip install 'sensorless-sandbox[hdf5]'")
    columns = turning()
    with h5py.File(tmp_path / "run.mat", "w", userblock_size=512) as file:
        log = file.create_group("log")
        for n, x in columns.items():
            log[n] = x[None, :]  # MATLAB stores a column vector with its axes turned round
        file["data"] = np.stack(list(columns.values()))
    content = (tmp_path / "run.mat").read_bytes()
    (tmp_path / "run.mat").write_bytes(
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b" ") + content[512:]
    )
    fields = "[columns]\n" + "".join(f'{n} = "log.{n}"\n' for n in NAMES)
    assert holds(campaign(tmp_path, "run.mat", fields), columns)
    named = f"[log]\nmatrix = {{data = {json.dumps(list(NAMES))}}}\n"
    assert holds(campaign(tmp_path, "run.mat", named), columns)


def _slow_link(columns):
    """The link at a tenth of the rate, 60 us later: another raster."""
    return columns["t"][::10] + 6e-5, 400.0 + columns["t"][::10]


def holds_rasters(found, columns):
    """Return whether a recording holds all but the link as it was; the link between its own
    samples; rows before its first sample gone."""
    r = found.recordings[0]
    # 400 V + 1 V/s times the time of its own sample, 6e-5 s later than t; held at the end for one
    # step of its own
    inside = r.t < columns["t"][-20]
    link = 400.0 + (r.t - r.t[0] + H - 6e-5)
    return (
        np.allclose(r.theta, columns["theta"][1 : 1 + len(r.t)], rtol=1e-7, atol=1e-9)
        and np.allclose(r.u_dc[inside], link[inside], rtol=1e-7, atol=1e-9)
        and any("raster of its own (40 samples" in f.text for f in found.findings)
    )


MAPPED = "[columns]\n" + "".join(f'{n} = "{{}}{n}"\n' for n in NAMES if n != "t")


def test_several_rasters_in_one_mdf4(tmp_path):
    asammdf = pytest.importorskip(
        "asammdf", reason="optional: pip install 'sensorless-sandbox[mdf]'"
    )
    columns = turning()
    stamps, link = _slow_link(columns)
    fast = [
        asammdf.Signal(x, columns["t"], name=n)
        for n, x in columns.items()
        if n not in ("t", "u_dc")
    ]
    with asammdf.MDF() as file:
        file.append(fast)
        file.append([asammdf.Signal(link, stamps, name="u_dc", unit="V")])
        file.save(tmp_path / "run.mf4")
    assert holds_rasters(campaign(tmp_path, "run.mf4", MAPPED.replace("{}", "")), columns)


def test_tdms(tmp_path):
    nptdms = pytest.importorskip(
        "nptdms", reason="optional: pip install 'sensorless-sandbox[tdms]'"
    )
    columns = turning()
    stamps, link = _slow_link(columns)
    every = {n: (x, 0.0, H) for n, x in columns.items() if n not in ("t", "u_dc")} | {
        "u_dc": (link, 6e-5, 10 * H)
    }
    channels = [
        nptdms.ChannelObject(
            "drive", n, x, {"wf_increment": step, "wf_start_offset": start, "unit_string": ""}
        )
        for n, (x, start, step) in every.items()
    ]
    with nptdms.TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment(channels)
    assert holds_rasters(campaign(tmp_path, "run.tdms", MAPPED.replace("{}", "")), columns)
    assert len(stamps) == 40


def test_mcap_with_json_messages(tmp_path):
    writer_of = pytest.importorskip(
        "mcap.writer", reason="optional: pip install 'sensorless-sandbox[mcap]'"
    ).Writer
    columns = turning()
    stamps, link = _slow_link(columns)
    with (tmp_path / "run.mcap").open("wb") as file:
        writer = writer_of(file)
        writer.start()
        fast, slow = (
            writer.register_channel(topic=t, message_encoding="json", schema_id=0)
            for t in ("/m", "/link")
        )
        for k, t in enumerate(columns["t"]):
            message = {n: float(x[k]) for n, x in columns.items() if n not in ("t", "u_dc")}
            ns = round(1e9 * t) + 10**9
            writer.add_message(fast, ns, json.dumps(message).encode(), ns)
        for t, volts in zip(stamps, link, strict=True):
            ns = round(1e9 * t) + 10**9
            writer.add_message(slow, ns, json.dumps({"volts": float(volts)}).encode(), ns)
        writer.finish()
    mapping = MAPPED.replace("{}", "m.").replace("m.u_dc", "link.volts")
    assert holds_rasters(campaign(tmp_path, "run.mcap", mapping), columns)


EXTRAS = [(".tdms", "nptdms", "tdms"), (".mcap", "mcap.reader", "mcap"), (".mat", "h5py", "hdf5")]


@pytest.mark.parametrize(("suffix", "package", "extra"), EXTRAS)
def test_a_missing_extra_is_one_sentence(tmp_path, monkeypatch, suffix, package, extra):
    (tmp_path / f"run{suffix}").write_bytes(b"MATLAB 7.3 MAT-file")
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(BadInput, match=rf"pip install 'sensorless-sandbox\[{extra}\]'"):
        campaign(tmp_path, f"run{suffix}")


@pytest.mark.parametrize("suffix", [".tdms", ".mcap", ".mat", ".npy", ".npz"])
def test_what_is_no_such_file_is_refused_in_a_sentence(tmp_path, suffix):
    for content in (
        b"",
        b"MATLAB 7.3 MAT-file, nothing else",
        b"TDSm" + bytes(60),
        b"\x89MCAP0\r\n" + bytes(40),
    ):
        (tmp_path / f"run{suffix}").write_bytes(content)
        with pytest.raises(BadInput) as refusal:
            campaign(tmp_path, f"run{suffix}")
        assert "\n" not in str(refusal.value)
