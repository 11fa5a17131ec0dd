"""Each preset reads a small log written as the vendor's program writes it."""

import math

import numpy as np
import pytest
from scipy.io import savemat

from model.drive_files import load_drive
from model.errors import BadInput
from sandbox import list_presets
from sandbox.cli import main
from sandbox.recordings.formats.presets import FOLDER, preset_notes
from sandbox.recordings.importing import read_recordings, source_of
from sandbox.recordings.motion_log import motion_only, read_motion

DRIVE = load_drive("ipm_exchanged")
H = DRIVE.converter.sampling_period
PAIRS = DRIVE.motor.pole_pairs
MOTOR = "".join(
    f"{k} = {getattr(DRIVE.motor, k)}\n"
    for k in ("pole_pairs", "resistance", "magnet_flux", "inductance_d", "inductance_q", "inertia")
)
HEAD = f"[motor]\n{MOTOR}[drive]\nsampling_period = {H}\ndc_bus_voltage = 400.0\n"


def turning(n=300, omega=300.0, h=H):
    """Steady turning of the linear motor, i_d = 0, i_q = 1 A: t, theta, i_a, i_b, i_alpha, i_beta,
    u_alpha, u_beta."""
    m, t = DRIVE.motor, np.arange(n) * h
    turn = np.exp(1j * omega * t)
    u = (1j * m.resistance + 1j * omega * (1j * m.inductance_q + m.magnet_flux)) * turn
    u = u * (np.exp(1j * omega * h) - 1.0) / (1j * omega * h)
    i = 1j * turn
    return {
        "t": t,
        "theta": omega * t,
        "i_a": i.real,
        "i_b": (i * np.exp(-2j * math.pi / 3)).real,
        "i_c": (i * np.exp(2j * math.pi / 3)).real,
        "i_alpha": i.real,
        "i_beta": i.imag,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "u_dc": np.full(n, 400.0),
    }


def written(folder, file, names, columns, separator=",", head=HEAD, mapping=""):
    rows = [
        separator.join(names),
        *(separator.join(f"{x:.12g}" for x in row) for row in zip(*columns, strict=True)),
    ]
    (folder / file).write_text("\n".join(rows) + "\n")
    recording = f'[[recording]]\nfile = "{file}"\nrotor = "free"\n'
    (folder / "campaign.toml").write_text(head + recording)
    if mapping:
        (folder / "map.toml").write_text(mapping)


def is_turning(found):
    """Return whether a recording is the steady turning, to the digits of the log."""
    c, r = turning(), found.recordings[0]
    bounds = {"t": 1e-4, "i_a": 1e-4, "i_b": 1e-4, "i_c": 1e-4, "u_alpha": 1e-2, "u_beta": 1e-2}
    same = [np.allclose(r.columns[n], c[n], rtol=1e-7, atol=b) for n, b in bounds.items()]
    return all(same) and np.allclose(np.diff(r.theta), np.diff(c["theta"]), rtol=1e-7, atol=1e-3)


def test_odrive(tmp_path):
    """Paths of odrivetool as names; turns; no voltages: the motion."""
    t = np.cumsum(np.random.default_rng(0).uniform(1.5e-3, 3e-3, 200))
    names = [
        "time",
        "odrv0.axis0.encoder.pos_estimate",
        "odrv0.axis0.motor.current_control.Iq_measured",
        "odrv0.vbus_voltage",
    ]
    written(tmp_path, "run.csv", names, [t, 2.0 * t, 0.3 + 0.0 * t, 24.0 + 0.0 * t])
    source = source_of(tmp_path, preset="odrive")
    found = read_motion(source, motion_only(source))
    r = found.recordings[0]
    np.testing.assert_allclose(r.angle, 2.0 * math.tau * t, rtol=1e-9)
    np.testing.assert_allclose(r.torque, 1.5 * PAIRS * DRIVE.motor.magnet_flux * 0.3, rtol=1e-9)
    assert any("I_measured_report_filter_k" in f.text for f in found.findings)


def test_moteus(tmp_path):
    t = np.arange(200) * 2e-3
    names = ["time", "position", "velocity", "torque", "q_current", "d_current", "voltage"]
    written(
        tmp_path,
        "run.csv",
        names,
        [t, 0.5 * t, 0.5 + 0 * t, 0 * t, 1.5 + 0 * t, 0 * t, 24.0 + 0 * t],
    )
    source = source_of(tmp_path, preset="moteus")
    found = read_motion(source, motion_only(source))
    np.testing.assert_allclose(found.recordings[0].angle, 0.5 * math.tau * t, rtol=1e-9)
    np.testing.assert_allclose(
        found.recordings[0].torque, 1.5 * PAIRS * DRIVE.motor.magnet_flux * 1.5, rtol=1e-9
    )


VESC = (  # the header that VESC Tool's openRtLogFile writes
    "ms_today;input_voltage;temp_mos_max;temp_mos_1;temp_mos_2;temp_mos_3;temp_motor;current_motor;current_in;d_axis_current;q_axis_current;erpm;duty_cycle;amp_hours_used;amp_hours_charged;watt_hours_used;watt_hours_charged;tachometer;tachometer_abs;encoder_position;fault_code;vesc_id;d_axis_voltage;q_axis_voltage;ms_today_setup;amp_hours_setup;amp_hours_charged_setup;watt_hours_setup;watt_hours_charged_setup;battery_level;battery_wh_tot;current_in_setup;current_motor_setup;speed_meters_per_sec;tacho_meters;tacho_abs_meters;num_vescs;ms_today_imu;roll;pitch;yaw;accX;accY;accZ;gyroX;gyroY;gyroZ;gnss_posTime;gnss_lat;gnss_lon;gnss_alt;gnss_gVel;gnss_vVel;gnss_hAcc;gnss_vAcc;"
)


def test_vesc(tmp_path):
    """A semicolon behind every cell, ms of the day, degrees that wrap; voltages are there, but too
    slow."""
    t, names = np.arange(300) * 0.02, VESC.rstrip(";").split(";")
    own = {
        "ms_today": 8e7 + 1e3 * t,
        "input_voltage": 55.3 + 0 * t,
        "temp_motor": 26.9 + 0 * t,
        "q_axis_current": 2 + 0 * t,
        "encoder_position": (100.0 * t) % 360.0,
        "q_axis_voltage": 1 + 0 * t,
    }
    written(
        tmp_path,
        "log.csv",
        names,
        [own.get(n, 0 * t) for n in names],
        ";",
        head=f"[motor]\n{MOTOR}",
    )
    lines = (tmp_path / "log.csv").read_text().splitlines()
    (tmp_path / "log.csv").write_text(";\n".join([*lines, ""]))
    source = source_of(tmp_path, preset="vesc")
    why = motion_only(source)
    assert why.startswith("log.csv: rows 0.02 s apart are beyond L/R = ")
    r = read_motion(source, why).recordings[0]
    np.testing.assert_allclose(r.t - r.t[0], t, atol=1e-6)
    np.testing.assert_allclose(r.angle - r.angle[0], np.radians(100.0 * t), atol=1e-6)
    np.testing.assert_allclose(r.torque, 1.5 * PAIRS * DRIVE.motor.magnet_flux * 2.0, rtol=1e-9)


def test_stm32(tmp_path):
    """Digits of 16 bits: the angle's are known, currents and voltages are scaled by the campaign's
    own map."""
    c = turning()
    digits = np.round(c["theta"] / math.tau * 65536.0 + 32768.0) % 65536.0 - 32768.0
    amps, volts = 8.0 / 32768.0, 400.0 / 32768.0
    names = [
        "Time",
        "hElAngle",
        "Ialphabeta.alpha",
        "Ialphabeta.beta",
        "Valphabeta.alpha",
        "Valphabeta.beta",
    ]
    columns = [
        1e3 * c["t"],
        digits,
        *(np.round(c[n] / amps) for n in ("i_alpha", "i_beta")),
        *(np.round(c[n] / volts) for n in ("u_alpha", "u_beta")),
    ]
    mapping = "[columns]\n" + "".join(
        f'{n} = {{column = "{own}", scale = {scale}}}\n'
        for n, own, scale in (
            ("i_alpha", names[2], amps),
            ("i_beta", names[3], amps),
            ("u_alpha", names[4], volts),
            ("u_beta", names[5], volts),
        )
    )
    written(tmp_path, "log.csv", names, columns, mapping=mapping)
    found = read_recordings(tmp_path, tmp_path / "map.toml", preset="stm32")
    r, c = found.recordings[0], turning()
    np.testing.assert_allclose(r.i_a, c["i_a"], atol=amps)
    np.testing.assert_allclose(r.u_beta, c["u_beta"], atol=volts)
    # two roundings of 2 pi / 65536
    np.testing.assert_allclose(np.diff(r.theta), np.diff(c["theta"]), atol=2e-4)
    assert any("65536" in f.text for f in found.findings)


def test_twincat(tmp_path):
    """Tabs, decimal commas, a block on the record and one on the channels, a stamp column a
    channel, EOF."""
    c = turning()
    names = ["MAIN.theta", "MAIN.i_a", "MAIN.i_b", "MAIN.u_alpha", "MAIN.u_beta", "MAIN.u_dc"]
    values = [c[n.rpartition(".")[2]] for n in names]

    def pairs(cells):
        return "\t".join(x for pair in cells for x in pair)

    lines = [
        "Name\tScope01",
        "File\tX",
        "StartRecord\t128783093223690000\tThursday",
        "EndRecord\t128783093339880000",
    ]
    for label, own in (
        ("Name", names),
        ("NetId", ["1.1"] * 6),
        ("SampleTime[ms]", ["0,25"] * 6),
        ("SymbolName", names),
    ):
        lines.append(pairs((label, x) for x in own))
    for k, t in enumerate(c["t"]):
        lines.append(pairs((f"{1e3 * t:.6g}", f"{v[k]:.12g}") for v in values).replace(".", ","))
    (tmp_path / "scope.csv").write_text("\n".join([*lines, "EOF"]) + "\n")
    (tmp_path / "campaign.toml").write_text(
        HEAD + '[[recording]]\nfile = "scope.csv"\nrotor = "free"\n'
    )
    assert is_turning(read_recordings(tmp_path, preset="twincat"))


SIGNALS = ("theta", "i_a", "i_b", "i_c", "u_alpha", "u_beta", "u_dc")


def test_dspace(tmp_path):
    """Signals by their model paths, in a CSV; MDF4 goes the same way."""
    c = turning()
    names = ["time", *(f"Model Root/Drive/{n}" for n in SIGNALS)]
    written(tmp_path, "log.csv", names, [c["t"], *(c[n] for n in SIGNALS)])
    assert is_turning(read_recordings(tmp_path, preset="dspace"))


@pytest.mark.parametrize(
    "path", ["{}", '"Model Root"/"Drive"/"{}"/"Out1"', "Model Root/Drive/{}/Out1"]
)
def test_dspace_mat(tmp_path, path):
    """ControlDesk's MAT: one structure called as the measurement, X.Data the stamps, Y(k).Name and
    Y(k).Data."""
    c = turning()
    signals = np.empty(
        (1, len(SIGNALS)), dtype=[("Name", object), ("Raster", object), ("Data", object)]
    )
    for k, n in enumerate(SIGNALS):
        signals[0, k] = (path.format(n), "Periodic Task 1", c[n][None, :])
    log = {
        "X": {"Name": "time", "Data": c["t"][None, :]},
        "Y": signals,
        "Description": {"General": "no numbers"},
    }
    savemat(tmp_path / "log.mat", {"run_001": log})
    (tmp_path / "campaign.toml").write_text(
        HEAD + '[[recording]]\nfile = "log.mat"\nrotor = "free"\n'
    )
    assert is_turning(read_recordings(tmp_path, preset="dspace"))


def test_every_preset_has_a_test_a_source_and_a_line(capsys):
    tested = {"odrive", "moteus", "vesc", "stm32", "twincat", "dspace"}
    assert set(list_presets()) == tested
    for name in tested:
        assert (FOLDER / f"{name}.toml").read_text().startswith("# ")
        assert preset_notes(name)
    assert main(["list", "presets"]) == 0
    assert "odrive" in capsys.readouterr().out


def test_a_preset_alone_is_said_to_name_columns_alone(tmp_path):
    with pytest.raises(
        BadInput, match=r"preset 'vesc' names the columns alone: write \[drive\], \[motor\]"
    ):
        source_of(tmp_path, preset="vesc")
    with pytest.raises(BadInput, match="unknown preset 'vesk'; did you mean 'vesc'"):
        source_of(tmp_path, preset="vesk")


def test_an_unknown_preset_is_named(tmp_path):
    written(tmp_path, "run.csv", ["t"], [np.arange(3.0)])
    with pytest.raises(BadInput, match="unknown preset 'odrvie'; did you mean 'odrive'"):
        source_of(tmp_path, preset="odrvie")
