"""Logs of a turning rotor as drives without an encoder write them."""

import math

import numpy as np

from model.drive_files import load_drive
from sandbox.recordings.importing import read_recordings

DRIVE = load_drive("ipm_exchanged")


H = DRIVE.converter.sampling_period


N = 2000


ZERO = 1.1  # rad, of the rotor at the first row


RPM = 60.0 / math.tau


def turning(speed):
    """Return columns of the linear motor in closed form at speeds (n,), rad/s electrical: i_d = 0,
    i_q = 1 A."""
    m, t = DRIVE.motor, np.arange(len(speed)) * H
    theta = ZERO + np.concatenate([[0.0], np.cumsum(0.5 * H * (speed[1:] + speed[:-1]))])
    turn = np.exp(1j * theta)
    flux = (1j * m.inductance_q + m.magnet_flux) * turn
    u = np.append(np.diff(flux), 0.0) / H + m.resistance * 1j * 0.5 * (
        turn + np.append(turn[1:], turn[-1])
    )
    a, b, c = ((1j * turn * np.exp(-2j * math.pi / 3 * k)).real for k in range(3))
    own = {
        "t": t,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "i_a": a,
        "i_b": b,
        "i_c": c,
        "u_dc": np.full(len(t), 400.0),
    }
    return own, theta


def written(folder, columns, mapping="", rotor="free"):
    """Write a log and its map; return the map's path."""
    rows = np.column_stack(list(columns.values()))
    np.savetxt(
        folder / "run.csv", rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g"
    )
    motor = ("pole_pairs", "resistance", "magnet_flux", "inductance_d", "inductance_q", "inertia")
    text = f'[[recording]]\nfile = "run.csv"\nrotor = "{rotor}"\n[motor]\nrated_current = 1.2\n'
    text += "".join(f"{k} = {getattr(DRIVE.motor, k)}\n" for k in motor)
    text += f"[drive]\nsampling_period = {H}\ndc_bus_voltage = 400.0\ncurrent_noise = 0.002\n"
    (folder / "m.toml").write_text(text + mapping)
    return folder / "m.toml"


def read(folder, *args, **more):
    return read_recordings(folder, written(folder, *args, **more))


def off(angle, theta):
    """Return how far angles are from true ones (n,), degrees."""
    return np.degrees(np.angle(np.exp(1j * (angle - theta))))


SWING = 300.0 + 60.0 * np.sin(np.arange(N) / 200.0)
