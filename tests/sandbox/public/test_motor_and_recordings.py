"""Results without a closed loop: audit, maps, campaigns, identification, replay."""

from __future__ import annotations

import dataclasses
import json
from importlib import import_module

import numpy as np
import pytest

import sandbox
from model.drive_files import MOTORS
from model.effect_files import effects_of
from sandbox.cli import main
from sandbox.recordings.campaign import EXAMPLE
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign
from tests.data import real_data
from tests.sandbox.public.naming import SHORT, of
from tests.schemas import misfits


@of("audit", "maps")
def test_machine_results(tmp_path):
    audit, maps = sandbox.audit("ipm_exchanged"), sandbox.maps("ipm_exchanged", points=5)
    assert audit.passed
    assert audit.to_table().column("load").to_pylist()[18] == 0.0
    assert "valid up to 2.16 A" in repr(audit)
    assert max(len(repr(audit.audit)), len(repr(maps.maps))) < 200
    table = maps.to_table()
    at_zero = [row for row in table.to_pylist() if row["i_d"] == row["i_q"] == 0.0]
    assert at_zero[0]["l_dd"] == pytest.approx(0.0458)  # inductance_d as printed
    assert table.schema.field("l_dd").metadata == {b"unit": b"H"}
    assert len(maps.plot().axes) == 12  # six maps, six colour bars
    maps.save(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["maps.json", "maps.npz", "maps.png"]


def test_maps_say_how_far_they_can_be_believed(tmp_path, capsys):
    """A motor is symmetric in i_q: no L_dq and no angle at zero current, which the fit leaves as
    1e-14. The table of a flux map has no first order, which is a formula of alphas; planted in its
    column of torque: kN m."""
    assert main(["maps", "ipm_exchanged", "--out", str(tmp_path / "alphas")]) == 0
    assert "first order" in capsys.readouterr().out
    with np.load(real_data() / "baldor_pmsyrm" / "baldor_meas.npz") as found:
        arrays = dict(found)
    i, psi = arrays["i_s_dq"], arrays["psi_s_dq"]
    torque = 1.5 * 2 * np.imag(i * np.conj(psi)) * 1e-3  # in kN m
    columns = i.real, i.imag, psi.real, psi.imag, torque
    names = ("i_d", "i_q", "psi_d", "psi_q", "torque")
    np.savez(tmp_path / "map.npz", **dict(zip(names, columns, strict=True)))
    text = (MOTORS / "mapped" / "baldor_pmsyrm.toml").read_text(encoding="utf-8")
    text = text.replace('dataset = "baldor_pmsyrm"\n', "").replace("baldor_meas.npz", "map.npz")
    (tmp_path / "own.toml").write_text(text)
    out = tmp_path / "out"
    assert main(["maps", str(tmp_path / "own.toml"), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    zero = [line.split("│")[2].strip() for line in said.splitlines() if "L_dq" in line]
    assert zero == ["0"]
    assert "first order" not in said
    assert "e-1" not in said
    assert "the column of torque is 0.001 times 3/2 pole_pairs" in said
    assert "rms on points held out inside it" in said
    content = json.loads((out / "maps.json").read_text())
    assert misfits("maps", content) == []
    assert content["flux_map"]["points"] == psi.size
    assert any("torque" in c for c in content["cautions"])


def test_another_motor_does_not_overwrite(tmp_path, capsys):
    for motor in ("spm", "ipm", "ipm"):
        assert main(["audit", motor, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.count("the earlier result of 'spm' is kept as audit-spm.json") == 1
    latest, earlier = (
        json.loads((tmp_path / f"{name}.json").read_text()) for name in ("audit", "audit-spm")
    )
    assert (latest["motor"], earlier["motor"]) == ("ipm", "spm")
    assert (earlier["command"], earlier["figure"]) == ("audit", "audit-spm.png")
    assert (tmp_path / earlier["figure"]).is_file()
    assert main(["audit", "spm", "--quiet", "--out", str(tmp_path)]) == 0
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == [
        f"audit{of}.{kind}" for of in ("-ipm", "") for kind in ("json", "parquet", "png")
    ]


@pytest.fixture(scope="module")
def campaign():
    return paper_campaign(sandbox.load_motor("ipm_exchanged"))


@of("read_campaign")
def test_a_campaign_is_looked_into_by_name(campaign):
    file = campaign.recordings[0].file
    recording = campaign[file]
    assert sandbox.read_campaign(campaign) is campaign
    assert [r.file for r in campaign] == [r.file for r in campaign.recordings]
    np.testing.assert_array_equal(recording["i_a"], recording.columns["i_a"])
    assert {"i_a", "theta", "u_dc"} <= set(dir(recording))
    assert {"recordings", "drive", "to_pandas"} <= set(dir(campaign))
    with pytest.raises(sandbox.BadInput, match=r"unknown column of .*did you mean 'i_"):
        recording["i_A"]
    frame = campaign.to_pandas()
    assert len(frame) == sum(r.t.size for r in campaign)
    assert frame.columns[0] == "file"
    assert frame.attrs["units"]["u_alpha"] == "V"
    assert recording.to_pandas().shape == (recording.t.size, len(recording.columns))
    assert max(len(repr(campaign)), len(repr(recording))) < 300


@of("identify")
def test_identification_draws_what_was_measured(campaign, tmp_path):
    found = sandbox.identify(campaign)
    assert max(len(repr(found.identification)), len(repr(found.identification.levels))) < 200
    rows = found.to_table().to_pylist()
    resistance = next(r for r in rows if (r["method"], r["parameter"]) == ("exact", "resistance"))
    assert resistance["value"] == pytest.approx(12.15, rel=1e-3)  # planted
    assert resistance["unit"] == "ohm"
    figure = found.plot(tmp_path / "identify.png")
    levels, first = found.identification.levels, figure.axes[0]
    lines = {line.get_label(): line for line in first.get_lines()}
    measured = first.containers[0].lines[0]
    assert {"exact", "first_order"} <= set(lines)
    picked = import_module("sandbox.public.figures").staircase(levels, 0, 0)
    assert sorted(measured.get_xdata()) == pytest.approx(sorted(levels.current[picked, 0]))
    # the plant has no effect the exact model lacks: its line runs through the points, 1 % of the
    # slope at the most
    np.testing.assert_allclose(lines["exact"].get_ydata(), measured.get_ydata(), rtol=0.01)


def test_an_identified_motor_is_a_file_that_meets_the_recordings(tmp_path):
    """The exact fit's motor and inverter, as files, put locked recordings at their noise floor."""
    drive = sandbox.load_motor("ipm_exchanged")
    between = LockedBench(
        theta=0.4, angle_error=0.03, threshold=2.0, width=0.02, noise=0.002, seed=3
    )
    bench = paper_campaign(drive, levels=(-2.0, -1.0, 0.0, 1.0, 2.0), bench=between)
    noisy = dataclasses.replace(drive.converter, current_noise=0.002, current_resolution=0.0)
    bench = dataclasses.replace(bench, drive=dataclasses.replace(drive, converter=noisy))
    sandbox.identify(bench).save(tmp_path)
    found = sandbox.replay(bench, tmp_path / "effects.toml", motor=str(tmp_path / "motor.toml"))
    # 1 is noise; the first samples are not yet the fit's steady levels
    assert max(found.rms.values()) < 1.2
    assert min(sandbox.replay(bench).rms.values()) > 20.0  # 2 V of 400 V and 0.03 rad, over 2 mA
    told = json.loads((tmp_path / "identify.json").read_text())["simulator"]
    assert told["motor"] == "motor.toml"
    # planted 2 V
    assert effects_of(told["line"])["device_drop.threshold"] == pytest.approx(2.0, abs=0.05)


def test_a_run_takes_a_file_of_effects(tmp_path):
    """A line and a file of the same effects give the same run; `bench.*` acts on the exact plant
    only."""
    text = "[effects]\ndead_time.time = 2e-6\n"
    (tmp_path / "e.toml").write_text(text)
    (tmp_path / "b.toml").write_text(text + "[bench]\nsoft_current = 0.2\n")
    line, file, soft = (
        sandbox.simulate("ipm_exchanged", SHORT, effects=e)
        for e in ("dead_time.time=2e-6", tmp_path / "e.toml", str(tmp_path / "b.toml"))
    )
    assert file.effects == line.effects == {"dead_time.time": 2e-6}
    np.testing.assert_array_equal(file.recording.i_a, line.recording.i_a)
    assert soft.effects["bench.soft_current"] == 0.2
    # dead time acts through the sign of the current
    assert np.any(soft.recording.i_a != line.recording.i_a)
    with pytest.raises(sandbox.BadInput, match=r"the switched plant has no 'bench.soft_current'"):
        sandbox.simulate("ipm_exchanged", SHORT, effects=tmp_path / "b.toml", plant="switched")


def test_the_sample_campaign_is_small_and_what_its_script_says(monkeypatch, tmp_path):
    """`diagnose --example` takes it; with what experiments/example_campaign.py planted a replay
    meets its noise."""
    assert sum(p.stat().st_size for p in EXAMPLE.iterdir()) < 250e3
    example = sandbox.read_campaign(EXAMPLE)
    resistance = 1.15 * example.drive.motor.resistance
    truth = {"dead_time.time": 2e-6, "stator_resistance.resistance": resistance}
    assert max(sandbox.replay(example, truth).rms.values()) < 1.1
    assert min(sandbox.replay(example).rms.values()) > 20.0
    asked = []

    def diagnosed(campaign, **_):
        asked.append(campaign)
        raise sandbox.BadInput("enough")

    monkeypatch.setattr(sandbox, "diagnose", diagnosed)
    assert main(["diagnose", "--example", "--out", str(tmp_path)]) == 2
    assert asked == [EXAMPLE]


@of("convert_motor")
def test_a_motor_from_a_data_sheet(tmp_path):
    """Kv 300 rpm/V between terminals, peak: 60 / (2 pi sqrt(3) 7 300) Wb; half of the ohm between
    terminals."""
    words = ["poles=14", "kv=300", "r_ll=0.1ohm", "inductance=30uH", "current=20A", "voltage=24V"]
    found = sandbox.convert_motor(words, "mine")
    assert "mine" in repr(found)
    assert found.stated.drive.motor.magnet_flux == pytest.approx(
        60.0 / (2.0 * np.pi * 3.0**0.5 * 7 * 300.0)
    )
    assert sandbox.load_motor(
        found.save(tmp_path / "out") / "motor.toml"
    ).motor.resistance == pytest.approx(0.05)
    with pytest.raises(sandbox.BadInput, match=r"the number of pole pairs, .* are missing"):
        sandbox.convert_motor(["kv=300"])


@of("replay")
def test_replay_meets_its_own_simulation(tmp_path):
    """A simulated bench replayed by the same effects lies at its noise floor, without them it does
    not."""
    effects = {"current_offset.offset_a": 0.05}
    folder = tmp_path / "bench"
    sandbox.simulate("ipm_exchanged", SHORT, effects=effects, record=folder)
    own = sandbox.replay(folder, effects)
    (tmp_path / "motor.toml").write_text("[motor]\nresistance = 1\n")
    with pytest.raises(sandbox.BadInput, match=r"motor.toml: \[motor\] lacks 'pole_pairs'"):
        sandbox.replay(folder, motor=tmp_path / "motor.toml")
    nominal = sandbox.replay(str(folder))
    assert own.rms["short.parquet"] == pytest.approx(1.0, abs=0.1)
    assert nominal.rms["short.parquet"] > 5.0  # 0.05 A of offset over a floor of some 2 mA
    table = own.to_table()
    assert {"file", "t", "i_a", "i_a_simulated"} <= set(table.column_names)
    assert own.to_rerun(tmp_path / "replay.rrd").is_file()
    assert "noise floors" in repr(own)
    nominal.save(tmp_path / "out")
    assert json.loads((tmp_path / "out" / "replay.json").read_text())["recordings"][0]["rms"] > 5.0


@of("check", "plan", "list_presets")
def test_a_bench_is_planned_and_its_campaign_checked(tmp_path):
    limited = (
        MOTORS / "ipm_exchanged.toml"
    ).read_text() + '\n[limits]\ncurrent = 0.8\ncan = ["locked", "free"]\n'
    (tmp_path / "mine.toml").write_text(limited)
    # what is given comes before what the file says
    found = sandbox.plan(tmp_path / "mine.toml", can=["locked"])
    assert {p.entry.rotor for p in found.plan.experiments} == {"locked"}
    assert (
        max(float(np.max(np.hypot(p.entry.i_d, p.entry.i_q))) for p in found.plan.experiments)
        <= 0.8 + 1e-9
    )
    told = [e for p in found.plan.experiments for e in p.adds]
    assert len(told) == len(set(told))  # each effect is added once
    assert "dead_time" in told
    assert found.plan.together.words("coulomb_friction") == "not"  # nothing moves
    found.save(tmp_path / "plan")
    assert misfits("plan", tmp_path / "plan" / "plan.json") == []
    content = json.loads((tmp_path / "plan" / "plan.json").read_text())
    assert all((tmp_path / "plan" / r["setpoints"]).is_file() for r in content["recordings"])
    with pytest.raises(
        sandbox.BadInput, match="unknown kind of rotor 'lokced'; did you mean 'locked'"
    ):
        sandbox.plan("ipm_exchanged", can=["lokced"])
    clean = sandbox.check(paper_campaign(sandbox.load_motor("ipm_exchanged")), effects=False)
    assert clean.ok
    assert "0 refused" in repr(clean)
    clean.save(tmp_path / "check")
    assert misfits("check", tmp_path / "check" / "check.json") == []
    assert set(sandbox.list_presets()) >= {"odrive", "vesc"}


@of("verify")
def test_verification_is_told_in_a_sentence(tmp_path):
    """What it finds: tests/sandbox/public/test_verifying.py."""
    found = sandbox.verify(sandbox.audit("ipm").save(tmp_path))
    assert repr(found).startswith(f"<Verification: {tmp_path / 'audit.json'}: ")
    assert found.summary().endswith("values of 'audit' are the same to the bit")
