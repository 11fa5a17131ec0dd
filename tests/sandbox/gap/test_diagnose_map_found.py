"""A flux map that is stated at few points: recordings correct it, no effect is named for what it
misses, and the motor that is written leaves what the diagnosis says.

The switched bench runs on the measured map as published, on cells of its own; the campaign states
every second row and column of it.
"""

import json
import re

import numpy as np
import pytest

import sandbox
from model.effects.library import effect_names
from model.spline import currents
from sandbox import Scenario, Segment
from sandbox.recordings.campaign import read_folder
from tests.data import real_data

SCENE = Scenario(
    "bench",
    (
        Segment(0.05),
        Segment(0.25, load=0.7, ramp=0.1),
        Segment(0.25, load=-0.5, speed=0.2, ramp=0.2),
    ),
    rotor="driven",
    start_up=False,
)
LEFT = ("dead_time", "device_drop", "stator_resistance", "inductance", "magnet_flux")


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("map") / "campaign"
    sandbox.simulate(
        "baldor_pmsyrm",
        SCENE,
        "qnull",
        closed_loop=False,
        plant="switched",
        effects={},
        seed=3,
        record=folder,
    )
    own = np.load(real_data() / "baldor_pmsyrm" / "baldor_meas.npz")
    i, psi = (own[name] for name in ("i_s_dq", "psi_s_dq"))
    every = np.zeros(i.shape, dtype=bool)
    every[::2, ::2] = True
    columns = np.column_stack([i.real[every], i.imag[every], psi.real[every], psi.imag[every]])
    np.savetxt(
        folder / "few.csv", columns, delimiter=",", header="i_d,i_q,psi_d,psi_q", comments=""
    )
    text = (folder / "campaign.toml").read_text()
    text = re.sub(r"\[flux_map\]\n(.+\n)+", '[flux_map]\nfile = "few.csv"\n', text)
    (folder / "campaign.toml").write_text(text)
    found = sandbox.diagnose(folder, exclude=[e for e in effect_names() if e not in LEFT], jobs=1)
    return folder, found, found.as_json()


def test_what_the_map_misses_is_no_effect(diagnosed):
    _, _, found = diagnosed
    # what is left may stay without a name
    assert not set(found["hypotheses"][0]["effects"]) & set(LEFT)
    of_map = found["flux_map"]
    assert of_map["residual"] ** 2 - 1.0 < 0.25 * (of_map["as_stated"] ** 2 - 1.0)
    assert 0.0 < of_map["rms"] < of_map["largest"]
    assert json.loads(json.dumps(of_map)) == {**of_map, "reached": [*of_map["reached"]]}


def test_it_is_said_how_far_the_map_is_told(diagnosed, tmp_path):
    """As far as the campaign's currents, within their noise and the replay's misfit."""
    folder, found, got = diagnosed
    most = max(np.max(np.hypot(*r.current)) for r in read_folder(folder).recordings)
    reached = got["flux_map"]["reached"]
    assert reached[4] == pytest.approx(most, rel=0.02)
    assert reached[0] < reached[1]
    assert reached[2] < 0.0 < reached[3]  # 0.7 and -0.5 of rated current
    found.save(tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert f"as far as recordings reach, {reached[4]:.3g} A" in page
    assert f"its flux map is told up to {most:.3g} A" in (tmp_path / "out/motor.toml").read_text()


def test_the_motor_that_is_written_leaves_what_is_said(diagnosed, tmp_path):
    folder, found, got = diagnosed
    out = tmp_path / "out"
    found.save(out)
    assert (out / "flux_map_found.npz").is_file()
    own = sandbox.load_motor(out / "motor.toml").motor
    # no current at the magnet's flux
    assert np.hypot(*currents(own.spline, 0.0, 0.0)) < 1e-9 * own.rated_current
    stated = {r["file"]: r["rms"] for r in got["simulator"]["residual"]}
    left = sandbox.replay(folder, motor=out / "motor.toml", effects=out / "effects.toml").rms
    # within rounding of a free fit's end: its last step
    assert left == pytest.approx(stated, rel=0.01)
