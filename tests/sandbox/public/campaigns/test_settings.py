"""`sensorless settings`: from the folders that identify and diagnose write, to what a drive should
be set to."""

from __future__ import annotations

import json

import pytest

import sandbox
from sandbox.cli import main
from tests.sandbox.public.naming import of

VESC = """<a><foc_motor_r>0.1</foc_motor_r><foc_motor_l>2.5e-05</foc_motor_l><foc_motor_flux_linkage>0.0027
</foc_motor_flux_linkage><foc_current_kp>0.025</foc_current_kp><foc_dt_us>0.1</foc_dt_us></a>"""  # noqa: E501
MOTOR = """[motor]
pole_pairs = 7
resistance = 0.05
magnet_flux = 0.0027
inductance_d = 2e-5
inductance_q = 3e-5
[ci95]
resistance = [0.049, 0.051]
inductance_d = [1.9e-5, 2.1e-5]
inductance_q = [2.9e-5, 3.1e-5]
[drive]
sampling_period = 5e-5
dc_bus_voltage = 24.0
"""


def result(folder, told=None, effects="", motor=MOTOR, name="identify.json"):
    folder.mkdir()
    (folder / name).write_text(json.dumps({"campaign": "mine", **(told or {})}))
    (folder / "motor.toml").write_text(motor)
    (folder / "effects.toml").write_text(f"[effects]\n{effects}\n")
    (folder / "vesc.xml").write_text(VESC)
    return folder


@of("check_settings")
def test_of_an_identification(tmp_path, capsys):
    """1/3 V of drop are 1/3/24 of a period of 50 us: 0.694 us beside 0.5 us of dead time."""
    folder = result(
        tmp_path / "r",
        {"cannot_tell": [{"parameter": "magnet_flux", "why": "no spin"}]},
        "dead_time.time = 5e-7\ndevice_drop.threshold = 0.3333333",
    )
    found = {row.name: row for row in sandbox.check_settings(folder, folder / "vesc.xml").rows}
    assert found["resistance"].verdict == "differs"
    assert found["resistance"].ci95 == (0.049, 0.051)
    assert found["magnet_flux"].said == "no spin"  # stands in motor.toml, but has no interval
    assert found["dead_time"].found == pytest.approx(5e-7 + 0.3333333 / 24.0 * 5e-5)
    assert found["dead_time"].ci95 is None
    assert (
        main(
            [
                "settings",
                str(folder),
                "--config",
                str(folder / "vesc.xml"),
                "--out",
                str(tmp_path / "o"),
            ]
        )
        == 0
    )
    assert "twice: as measured between two terminals" in capsys.readouterr().out
    told = json.loads((tmp_path / "o" / "settings.json").read_text())
    assert [row["verdict"] for row in told["settings"]].count("not told") == 1


def test_of_a_diagnosis(tmp_path):
    """The interval of dead time is the first hypothesis's; what it names of voltages is told."""
    best = {
        "effects": ["dead_time", "pwm_delay"],
        "parameters": {"dead_time.time": {"value": 5e-7, "ci95": [4e-7, 6e-7], "unit": "s"}},
    }
    folder = result(
        tmp_path / "r", {"hypotheses": [best]}, "dead_time.time = 5e-7", name="diagnosis.json"
    )
    found = {
        row.name: row for row in sandbox.check_settings(folder, folder / "vesc.xml", 200.0).rows
    }
    assert found["dead_time"].ci95 == pytest.approx((4e-7, 6e-7))
    assert "the result names dead_time, pwm_delay" in found["resistance"].said
    assert found["current_kp"].found == pytest.approx(2.0 * 3.14159265 * 200.0 * 25e-6)


def test_refusals(tmp_path, capsys):
    folder = result(tmp_path / "r", motor="[motor]\npole_pairs = 7\n")
    config = ["--config", str(folder / "vesc.xml"), "--out", str(tmp_path / "o")]
    for words, said in (
        ([str(folder), *config], "tell nothing of a motor's values"),
        ([str(tmp_path), *config], "neither identify.json nor diagnosis.json"),
        (
            [str(folder), "--config", str(folder / "motor.toml"), *config[2:], "--bandwidth", "0"],
            "out of range",
        ),
    ):
        assert main(["settings", *words]) == 2
        assert said in " ".join(capsys.readouterr().err.split())
    whole = result(tmp_path / "w")
    (whole / "none.xml").write_text("<a><b>1</b></a>")
    with pytest.raises(sandbox.BadInput, match="nothing of a motor is known"):
        sandbox.check_settings(whole, whole / "none.xml")
    (whole / "identify.json").write_text("{")
    with pytest.raises(sandbox.BadInput, match="no whole JSON"):
        sandbox.check_settings(whole, whole / "vesc.xml")


@pytest.mark.parametrize(
    ("told", "motor"),
    [
        ({"cannot_tell": 5}, MOTOR),
        ({"cannot_tell": [{"parameter": "resistance"}]}, MOTOR),
        ({"hypotheses": 5}, MOTOR),
        ({"hypotheses": [{"effects": 5}]}, MOTOR),
        ({"hypotheses": [{"parameters": {"dead_time.time": {"ci95": 4}}}]}, MOTOR),
        ({}, "motor = 3"),
        ({}, MOTOR.replace("[0.049, 0.051]", "0.05")),
    ],
)
def test_a_result_of_another_shape_is_refused(told, motor, tmp_path, capsys):
    folder = result(tmp_path / "r", told, "dead_time.time = 5e-7", motor)
    assert (
        main(
            [
                "settings",
                str(folder),
                "--config",
                str(folder / "vesc.xml"),
                "--out",
                str(tmp_path / "o"),
            ]
        )
        == 2
    )
    assert (
        "not as identify and diagnose write them; make the result again" in capsys.readouterr().err
    )
    assert not (tmp_path / "o").exists()
