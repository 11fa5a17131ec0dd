"""What the commands print and write, in one process."""

from __future__ import annotations

import numpy as np
import pytest

from sandbox.cli import main
from tests.sandbox.public.short_run import content, motor_file


def test_compare(short, tmp_path, capsys):
    out = tmp_path / "out"
    assert (
        main(
            [
                "compare",
                "--scenario",
                str(short),
                "--estimators",
                "qnull,inversion",
                "--out",
                str(out),
            ]
        )
        == 0
    )
    found = content(out, "compare")
    assert (found["motor"], found["scenario"], found["trace"]) == (
        "ipm_exchanged",
        "short",
        "compare.rrd",
    )
    assert sorted(p.name for p in out.iterdir()) == [
        f"compare.{kind}" for kind in ("html", "json", "parquet", "png", "rrd")
    ]
    assert len(found["rows"]) == 2 * 2 * 2 * 2
    for row in found["rows"]:
        assert {
            "estimator",
            "belief",
            "closed_loop",
            "load",
            "speed_rpm",
            "error_deg",
            "predicted_mean_deg",
        } <= set(row)
        assert set(row["error_deg"]) == {"mean", "rms", "p95", "max"}
        assert row["lost_lock"] is False
    said = capsys.readouterr().out
    assert "theory" in said
    assert "-5.89" in said  # the self-consistent angle at rated load


def test_quiet_says_nothing_and_seed_repeats(short, tmp_path, capsys):
    for k in (1, 2):
        call = [
            "compare",
            "--scenario",
            str(short),
            "--estimators",
            "ekf",
            "--seed",
            "9",
            "--jobs",
            str(k),
            "--no-trace",
        ]
        assert main([*call, "--quiet", "--out", str(tmp_path / str(k))]) == 0
    assert capsys.readouterr().out == ""
    one, two = (content(tmp_path / k, "compare") for k in "12")
    assert one["rows"] == two["rows"]
    assert one["trace"] is None


def test_simulate(short, tmp_path, capsys):
    call = [
        "simulate",
        "--scenario",
        str(short),
        "--estimator",
        "inversion",
        "--belief",
        "linear",
        "--out",
        str(tmp_path),
    ]
    assert main(call) == 0
    found = content(tmp_path, "simulate")
    assert found["rows"][1]["error_deg"]["mean"] == pytest.approx(-5.89, abs=0.2)
    assert found["loops"]["current"]["phase_margin_deg"] > 59
    assert (tmp_path / found["trace"]).is_file()
    assert "phase margin" in capsys.readouterr().out


def test_audit(tmp_path, capsys):
    assert main(["audit", "spm", "--out", str(tmp_path)]) == 0
    found = content(tmp_path, "audit")
    assert found["passed"] is False
    assert found["valid_radius"] == pytest.approx(0.786, abs=1e-3)
    assert found["violations"][0]["i_d"] == pytest.approx(-0.786, abs=1e-3)
    # the notes' value for the SPM at 40 V
    assert found["error_per_10mA_deg"][18] == pytest.approx(2.7, abs=0.05)
    said = capsys.readouterr().out
    assert "NOT valid" in said
    assert "q-null injection is feasible: up to 0.786 A, as far as the model is valid" in " ".join(
        said.split()
    )
    assert "whole disc" not in said
    assert main(["audit", "ipm_exchanged", "--out", str(tmp_path)]) == 0
    assert content(tmp_path, "audit")["valid_radius"] == pytest.approx(1.8 * 1.2)
    # 10 mA of ripple error, IPM at 30 V: the notes' 3.5 degrees
    assert content(tmp_path, "audit")["error_per_10mA_deg"][18] == pytest.approx(3.5, abs=0.05)


def test_list_and_version(capsys):
    for kind, name in (
        ("motors", "spm_exchanged"),
        ("estimators", "ekf_filterpy"),
        ("scenarios", "creep_reversal"),
    ):
        assert main(["list", kind]) == 0
        assert name in capsys.readouterr().out


def test_names_with_markup_are_names(short, tmp_path, capsys):
    motor = motor_file(tmp_path, 'name = "ipm_exchanged"', 'name = "[bold] $_{$ <b>"')
    call = [
        "compare",
        "--motor",
        motor,
        "--scenario",
        str(short),
        "--estimators",
        "qnull",
        "--out",
        str(tmp_path / "o"),
    ]
    assert main(call) == 0
    assert "[bold] $_{$ <b>" in capsys.readouterr().out


@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_simulate_with_effects_on_both_plants_records_a_campaign(short, tmp_path, plant):
    from sandbox.recordings.campaign import read_folder

    out, folder = tmp_path / "out", tmp_path / "recorded"
    call = ["simulate", "--scenario", str(short), "--no-trace", "--plant", plant, "--out", str(out)]
    effects = "encoder_offset.offset=0.05,current_offset.offset_a=0.2"
    assert main([*call, "--effects", effects, "--record", str(folder)]) == 0
    found = content(out, "simulate")
    assert found["plant"] == plant
    assert found["effects"] == {"encoder_offset.offset": 0.05, "current_offset.offset_a": 0.2}
    campaign = read_folder(folder)
    recording = campaign.recordings[0]
    assert recording.rotor == "locked"
    half = 0.5 * 2 * np.pi * campaign.drive.motor.pole_pairs / 4096
    assert campaign.drive.converter.encoder_counts == 4096
    # the encoder's reading, not the true 1.0 rad
    assert recording.theta[0] == pytest.approx(1.05, abs=half)
    # nothing acts in the first period
    assert recording.i_a[:2] == pytest.approx([0.2] * 2, abs=0.02)
    assert recording.u_dc.mean() == pytest.approx(400.0, abs=0.1)
    assert recording.u_dc.std() == pytest.approx(0.3, rel=0.2)
    assert (campaign.uncertainty["resistance"], campaign.background["current_gain"]) == (
        0.01,
        0.0015,
    )
    assert recording.injection_axis == "d"
    assert main([*call, "--record", str(folder)]) == 2


def test_list_effects_prints_all_and_one_card(capsys):
    assert main(["list", "effects"]) == 0
    assert len(capsys.readouterr().out.splitlines()) >= 26
    assert main(["list", "effects", "dead_time"]) == 0
    said = capsys.readouterr().out
    assert all(
        word in said
        for word in ("equation", "source", "confused with", "separated by", "dead_time.time")
    )
    assert main(["list", "effects", "dead_tme"]) == 2
    assert "did you mean 'dead_time'" in capsys.readouterr().err
    assert main(["list", "motors", "ipm"]) == 0
    assert "magnet_flux           0.0981 Wb" in capsys.readouterr().out
