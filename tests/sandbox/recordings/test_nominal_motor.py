"""Rated values that a campaign does not state: told from its recordings, the torque by what the
motor gives."""

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import flux_from_current
from model.fluxmap import FluxMap, write_map
from model.ratings import largest_torque
from model.tools.stated_motor import stated_motor
from sandbox.recordings import importing
from sandbox.recordings.campaign import REQUIRED, Campaign, CampaignRecording, read_folder
from sandbox.recordings.writing import StatedMap, write_campaign


def test_a_map_without_rated_values_gets_the_torque_of_its_own_magnet(tmp_path, monkeypatch):
    """The map alone knows the flux: 3/2 p psi i of the quartic that it was computed from, and what
    reluctance adds (`largest_torque`, see test_ratings); 2e-3 is what a spline of these cells
    leaves (test_mapped)."""
    monkeypatch.setenv("SENSORLESS_CACHE", str(tmp_path / "cache"))
    motor, i = load_drive("ipm_exchanged").motor, np.linspace(-3.2, 3.2, 17)
    d, q = flux_from_current(motor.energy, *np.meshgrid(i, i, indexing="ij"))
    write_map(tmp_path / "mine.csv", FluxMap("mine", i, i, d + motor.magnet_flux, q))
    stated = StatedMap(
        {"file": "mine.csv", "cells": [8, 6], "smooth": 1e-6}, (tmp_path / "mine.csv").read_bytes()
    )
    columns = {
        "t": np.arange(2) * 250e-6,
        **dict.fromkeys(REQUIRED[1:], np.zeros(2)),
        "i_a": np.array([2.0, 0.0]),
    }
    run = CampaignRecording("run.parquet", "locked", "d", columns)
    own = Campaign("bench", load_drive("ipm_exchanged"), (run,), {}, {}, True)
    folder = write_campaign(tmp_path / "c", own, stated)
    found = read_folder(folder)
    i_rated = 2.0 * 2.0 / 3.0  # of phase a alone, amplitude-invariant
    assert found.drive.motor.rated_current == pytest.approx(i_rated)
    wanted = largest_torque(dataclasses.replace(motor, rated_current=i_rated))
    assert found.rated_from_data
    assert found.drive.motor.rated_torque == pytest.approx(wanted, rel=2e-3)
    assert wanted > 1.5 * motor.pole_pairs * motor.magnet_flux * i_rated


def stated_alone(tmp_path, text):
    """Return the campaign of a locked rotor at 1 A whose [motor] holds `text` beside what has to be
    stated."""
    (tmp_path / "run.csv").write_text(
        "t,i_a,i_b,i_c,u_alpha,u_beta,theta,u_dc\n0,1,-0.5,-0.5,0,0,0,24\n1e-4,1,-0.5,-0.5,0,0,0,24\n"
    )
    (tmp_path / "campaign.toml").write_text(
        "[drive]\nsampling_period = 1e-4\ndc_bus_voltage = 24.0\ncurrent_noise = 0.01\n"
        "[motor]\npole_pairs = 4\nresistance = 0.1\nmagnet_flux = 0.02\ninductance_d = "
        "1e-4\ninductance_q = 1e-4\n"
        f'{text}[[recording]]\nfile = "run.csv"\nrotor = "locked"\n'
    )
    return importing.read_recordings(tmp_path)


def test_an_inertia_that_nobody_stated_is_said_to_stand_in(tmp_path):
    """No rotor is free: the value is that which `sensorless motor` gives the same motor, and is not
    told as stated; a copy of the campaign states it as little."""
    own = stated_alone(tmp_path, "rated_current = 5.0\n")
    assert own.stand_ins == ("rated_torque", "rated_speed_rpm", "inertia")
    assert own.drive.provenance["inertia"] == (
        "not stated; stands in: rated torque brings it to rated speed in 0.1 s; no rotor is free, "
        "so that nothing here tells it"
    )
    m = own.drive.motor
    words = f"kv={30.0 / math.pi / m.magnet_flux / m.pole_pairs / math.sqrt(3.0)} resistance=0.1"
    words += f" pole_pairs=4 inductance=1e-4 current=5 voltage=24 speed={m.rated_speed_rpm}"
    words += f" torque={m.rated_torque}"
    assert m.inertia == pytest.approx(stated_motor(words.split()).drive.motor.inertia)
    again = read_folder(write_campaign(tmp_path / "copy", own))
    assert again.stand_ins == own.stand_ins
    assert dataclasses.replace(again.drive.motor, name=own.drive.motor.name) == own.drive.motor
    assert again.drive.motor.rated_current == 5.0  # stated, and still so
