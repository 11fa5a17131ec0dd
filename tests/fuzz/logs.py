"""Whole logs of other programs for the fuzz: MAT 7.3, TDMS, MCAP, uneven stamps with [log],
presets, motion alone."""

from __future__ import annotations

import json

import numpy as np

from sandbox.public.loading import motion_only
from sandbox.recordings.importing import read_recordings
from tests.fuzz.doors import Door
from tests.fuzz.mutations import damaged_bytes, damaged_toml

H, ROWS, PAIRS, FLUX = 250e-6, 200, 3, 0.1
NAMES = ("t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "u_dc")
HEAD = f"""
[drive]
sampling_period = {H}
dc_bus_voltage = 400.0
current_noise = 0.002
[motor]
pole_pairs = {PAIRS}
resistance = 1.0
magnet_flux = {FLUX}
inductance_d = 0.01
inductance_q = 0.01
inertia = 1e-3
rated_current = 5.0
rated_torque = 2.0
rated_speed_rpm = 1000.0
"""


def columns_of():
    """Return a driven rotor without current: the voltage is that of the magnets."""
    t = H * np.arange(ROWS)
    theta = 30.0 * t
    zero = np.zeros(ROWS)
    half = theta + 15.0 * H
    u = 30.0 * FLUX
    volts = {"u_alpha": -u * np.sin(half), "u_beta": u * np.cos(half), "u_dc": zero + 400.0}
    return {"t": t, **volts, "i_a": zero + 1e-4, "i_b": zero, "i_c": zero - 1e-4, "theta": theta}


def told(folder, file, head=""):
    """Write the column map of a log."""
    text = f'{head}\n{HEAD}\n[[recording]]\nfile = "{file}"\nrotor = "driven"\n'
    (folder / "columns.toml").write_text(text)


def make_mat73(folder):
    """Write MATLAB's HDF5."""
    import h5py

    with h5py.File(folder / "run.mat", "w", userblock_size=512) as file:
        group = file.create_group("log")
        for n, x in columns_of().items():
            group[n] = x[None, :]
    body = (folder / "run.mat").read_bytes()
    (folder / "run.mat").write_bytes(
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b" ") + body[512:]
    )
    told(folder, "run.mat", "[columns]\n" + "".join(f'{n} = "log.{n}"\n' for n in NAMES))


def make_tdms(folder):
    """Write LabVIEW's channels."""
    import nptdms

    channels = [
        nptdms.ChannelObject(
            "drive", n, x, {"wf_increment": H, "wf_start_offset": 0.0, "unit_string": ""}
        )
        for n, x in columns_of().items()
        if n != "t"
    ]
    with nptdms.TdmsWriter(folder / "run.tdms") as writer:
        writer.write_segment(channels)
    told(folder, "run.tdms", "[columns]\n" + "".join(f'{n} = "{n}"\n' for n in NAMES if n != "t"))


def make_mcap(folder):
    """Write JSON messages."""
    from mcap.writer import Writer

    columns = columns_of()
    with (folder / "run.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        topic = writer.register_channel(topic="/m", message_encoding="json", schema_id=0)
        for k, t in enumerate(columns["t"]):
            ns = round(1e9 * t) + 10**9
            message = {n: float(x[k]) for n, x in columns.items() if n != "t"}
            writer.add_message(topic, ns, json.dumps(message).encode(), ns)
        writer.finish()
    told(folder, "run.mcap", "[columns]\n" + "".join(f'{n} = "m.{n}"\n' for n in NAMES if n != "t"))


def make_polled(folder):
    """Write a CSV with units, comments and scattered stamps."""
    rng, columns = np.random.default_rng(1), columns_of()
    columns["t"] = columns["t"] + 2e-6 * rng.standard_normal(ROWS)
    rows = "\n".join(
        ";".join(f"{x:.9g}".replace(".", ",") for x in row)
        for row in zip(*columns.values(), strict=True)
    )
    units = dict(zip(NAMES, ("s", "V", "V", "A", "A", "A", "rad", "V"), strict=True))
    head = ";".join(f"{n} [{units[n]}]" for n in columns)
    (folder / "run.csv").write_text(f"# a log\n{head}\n{rows}\n")
    told(folder, "run.csv", '[columns]\n[log]\nstamps = "polled"\n')


def make_motion(folder):
    """Write an ODrive's table of motion alone: swinging both ways, uneven stamps."""
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(1.5e-3, 3e-3, 600))
    turn = np.sin(3.0 * t)
    rows = "\n".join(
        f"{a:.6f},{b:.6f},{c:.4f}" for a, b, c in zip(t, turn, np.cos(3.0 * t), strict=True)
    )
    (folder / "run.csv").write_text(
        f"time,axis0.encoder.pos_estimate,axis0.motor.current_control.Iq_measured\n{rows}\n"
    )
    text = (
        "[motor]\ntorque_constant = 0.05\ninertia = 1e-3\n[[recording]]\nfile = "
        '"run.csv"\nrotor = "free"\n'
    )
    (folder / "columns.toml").write_text(text)


def read_log(folder):
    """Read a log by its map."""
    read_recordings(folder, folder / "columns.toml")


def read_motion(folder):
    """Read a motion with a preset and a map."""
    if motion_only(folder, folder / "columns.toml", "odrive") is None:
        read_recordings(folder, folder / "columns.toml", preset="odrive")


def damaged_lines(content, chance):
    """Return a text table damaged by its lines, cells or bytes."""
    if chance.random() < 0.3:
        return damaged_bytes(content, chance)
    lines = content.split(b"\n")
    for _ in range(chance.choice((1, 1, 3))):
        k, odd = (
            chance.randrange(len(lines)),
            (b"nan", b"", b"1e400", b"x", b"-5", b"1e300", b";;", b"# x", b"1,5"),
        )
        parts = lines[k].replace(b";", b",").split(b",")
        parts[chance.randrange(len(parts))] = chance.choice(odd)
        lines[k] = chance.choice(
            (b",".join(parts), b";".join(parts), lines[k - 1], b"", chance.choice(odd))
        )
    return b"\n".join(lines)


def of_toml(content, chance):
    """Return a column map damaged."""
    return damaged_toml(content.decode(), chance)


LOG_DOORS = (
    Door("mat73", make_mat73, ("run.mat",), damaged_bytes, read_log),
    Door("tdms", make_tdms, ("run.tdms",), damaged_bytes, read_log),
    Door("mcap", make_mcap, ("run.mcap",), damaged_bytes, read_log),
    Door("polled", make_polled, ("run.csv",), damaged_lines, read_log),
    Door("log_map", make_polled, ("columns.toml",), of_toml, read_log),
    Door("motion", make_motion, ("run.csv",), damaged_lines, read_motion),
    Door("motion_map", make_motion, ("columns.toml",), of_toml, read_motion),
)
