"""Recordings with and without voltages, states or an encoder in one campaign, and what becomes of
each."""

import math
import shutil

import numpy as np
import pytest

from model.errors import BadInput
from sandbox import check
from sandbox.recordings.angle.commutation import APART_120, STEP
from sandbox.recordings.importing import read_recordings, source_of
from sandbox.recordings.motion_log import motion_only, read_motion, with_replayable
from tests.data import recordings_folder
from tests.sandbox.recordings.made_angles import DRIVE, RPM, SWING, N, off, read, turning, written


def test_each_log_of_a_table_has_its_own_angle(tmp_path):
    """A logger that was started again: clock, place and sense of the rotor begin anew, as in a file
    of its own."""
    mapping = '[columns]\nspeed = {column="rpm", unit="rpm"}\nhall = {column="h"}'
    logs, thetas = [], []
    for speed in (SWING, -0.5 * SWING):
        columns, theta = turning(speed)
        hall = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
        logs.append({**columns, "h": hall, "rpm": np.round(speed * RPM)})
        thetas.append(theta)
    alone = [read(tmp_path, log, mapping, rotor="driven")["run"] for log in logs]
    joined = {n: np.concatenate([log[n] for log in logs]) for n in logs[0]}
    found = read(tmp_path, joined, mapping, rotor="driven")
    assert [r.file for r in found.recordings] == ["run-1.csv", "run-2.csv"]
    for r, own, theta in zip(found.recordings, alone, thetas, strict=True):
        np.testing.assert_allclose(r.theta, own.theta, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(r.t, own.t, rtol=0.0, atol=1e-9)
        assert r.made == own.made
        assert np.abs(off(r.theta, theta)).max() < 5.2
    made = [f for f in found.findings if "the angle is made from" in f.text]
    assert [f.file for f in made] == ["run.csv"]


def mixed(folder, first, then):
    """Write a campaign of two logs that differ; return its map's path."""
    mapping = written(folder, first)
    (folder / "run.csv").rename(folder / "first.csv")
    written(folder, then)
    text = mapping.read_text()
    mapping.write_text('[[recording]]\nfile = "first.csv"\nrotor = "free"\n' + text)
    return mapping


@pytest.mark.parametrize("turned", [False, True])
def test_recordings_without_voltages_are_left_out_beside_others(tmp_path, turned):
    """Whichever is the first: it is replayed what can be, and the other one is told."""
    columns, theta = turning(SWING)
    whole = {**columns, "theta": theta}
    without = {n: x for n, x in whole.items() if not n.startswith("u_")}
    mapping = mixed(tmp_path, *((whole, without) if turned else (without, whole)))
    assert motion_only(source_of(tmp_path, mapping)) is None
    found = read_recordings(tmp_path, mapping)
    assert [r.file for r in found.recordings] == ["first.csv" if turned else "run.csv"]
    (said,) = (f.text for f in found.findings if "left out" in f.text)
    assert said.startswith("run.csv" if turned else "first.csv")
    both = source_of(tmp_path, mixed(tmp_path, without, without))
    assert motion_only(both).startswith("no column is a commanded voltage, so electrical effects")
    assert len(read_motion(both, motion_only(both)).recordings) >= 1


def test_a_voltage_that_is_not_whole_is_named(tmp_path):
    columns, theta = turning(SWING)
    part = {n: x for n, x in columns.items() if n != "u_beta"}
    why = motion_only(source_of(tmp_path, written(tmp_path, {**part, "theta": theta})))
    assert why.startswith(
        "u_alpha without u_beta tells no voltage (log or map all of them), so electrical "
        "effects are no"
    )
    two = {
        **{n: x for n, x in part.items() if n != "u_alpha"},
        "theta": theta,
        "d_a": 0 * theta,
        "d_b": 0 * theta,
    }
    assert motion_only(source_of(tmp_path, written(tmp_path, two))).startswith(
        "d_a and d_b without d_c tell no voltage"
    )


def test_states_beside_an_encoder_are_left_out_of_a_diagnosis(tmp_path):
    columns, theta = turning(SWING)
    hall = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
    states, whole = {**columns, "hall": hall}, {**columns, "theta": theta}
    mapping = mixed(tmp_path, states, {**whole, "i_a": columns["i_a"] + 0.001})
    assert motion_only(source_of(tmp_path, mapping)) is None
    found = with_replayable(read_recordings(tmp_path, mapping))
    assert [r.file for r in found.recordings] == ["run.csv"]
    assert any(
        f.text.startswith("first.csv: 'hall': states tell the angle to a sixth")
        for f in found.findings
    )
    alone = read_recordings(tmp_path / "first.csv", mapping)
    assert with_replayable(alone) is alone


def test_a_free_rotor_with_states_alone_is_judged_by_its_motion(tmp_path):
    columns, theta = turning(SWING)
    hall = np.array(APART_120)[np.floor(theta / STEP).astype(int) % 6]
    why = motion_only(source_of(tmp_path, written(tmp_path, {**columns, "hall": hall})))
    assert why.startswith("'hall': states tell the angle to a sixth of an electrical turn")
    assert (
        motion_only(
            source_of(tmp_path, written(tmp_path, {**columns, "theta": theta, "hall": hall}))
        )
        is None
    )


@pytest.mark.parametrize("order", [APART_120, APART_120[::-1]])
def test_phase_currents_beside_states_become_a_torque_by_voltages_or_not_at_all(tmp_path, order):
    """i_q = 1 A on a linear motor, i_d = 0: 1.5 p flux; read 5.2 degrees off, as states are, a
    share 1 - cos is lost, and i_d = sin brings the reluctance torque (L_d - L_q) i_d i_q."""
    columns, theta = turning(SWING)
    columns["h"] = np.array(order)[np.floor(theta / STEP + 0.3).astype(int) % 6]
    m, angle = DRIVE.motor, math.radians(5.2)
    off = (
        1.0
        - math.cos(angle)
        + math.sin(angle) * abs(m.inductance_d - m.inductance_q) / m.magnet_flux
    )
    torque, hall = 1.5 * m.pole_pairs * m.magnet_flux, '[columns]\nhall = {column="h"}'
    source = source_of(tmp_path, written(tmp_path, columns, hall))
    motion = read_motion(source, motion_only(source))
    np.testing.assert_allclose(motion.recordings[0].torque, torque, rtol=off)
    columns = {n: x for n, x in columns.items() if n not in ("u_alpha", "u_beta")}
    source = source_of(tmp_path, written(tmp_path, columns, hall))
    with pytest.raises(
        BadInput,
        match="an angle made from 'h', whose zero is unknown; map i_q, a torque, or the rotor's",
    ):
        read_motion(source, motion_only(source))
    source = source_of(tmp_path, written(tmp_path, {**columns, "i_q": np.ones(N)}, hall))
    np.testing.assert_allclose(
        read_motion(source, motion_only(source)).recordings[0].torque, torque
    )


def test_a_unit_that_makes_currents_too_quick_is_judged_by_the_voltages(tmp_path):
    """L/R of the bench's p01 is 7 ms, 7 us with a wrong unit of L, and its rows are 0.25 ms apart:
    too slow for any current, were it true.  It is not left to its motion; the unit is named."""
    folder = recordings_folder() / "practice" / "p01"
    shutil.copy(folder / "run_slow.parquet", tmp_path)
    text = (folder / "campaign.toml").read_text().split("[[recording]]")[0]
    for name, stated in (("inductance_d", "0.0919"), ("inductance_q", "0.0458")):
        assert f"{name} = {stated}" in text
        text = text.replace(f"{name} = {stated}", f"{name} = {stated}e-3")
    text += '[[recording]]\nfile = "run_slow.parquet"\nrotor = "free"\n'
    (tmp_path / "campaign.toml").write_text(text)
    assert motion_only(source_of(tmp_path)) is None
    told = " ".join(n.finding.text for n in check(tmp_path, effects=False).noticed)
    assert "inductance_d and inductance_q are 1000 times too small" in told
    assert "multiply inductance_d and inductance_q by 1000 in [motor]" in told
