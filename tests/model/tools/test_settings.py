"""A drive's settings beside those found: every law by hand, what is not told, why a value
differs."""

from __future__ import annotations

import json
import math

import pytest

from model.tools.configurations import read_configuration
from model.tools.settings import UNITS, Found, intended, settings

FOUND = {
    "resistance": Found(0.05, (0.049, 0.051)),
    "inductance_d": Found(20e-6, (19e-6, 21e-6)),
    "inductance_q": Found(30e-6, (29e-6, 31e-6)),
    "magnet_flux": Found(0.0027, (0.0026, 0.0028)),
    "dead_time": Found(5e-7, (4e-7, 6e-7)),
}
RIGHT = {
    "resistance": 0.05,
    "inductance_d": 20e-6,
    "inductance_q": 30e-6,
    "magnet_flux": 0.0027,
    "current_kp": 0.025,
    "current_ki": 50.0,
    "dead_time": 0.0,
}


def rows(stated, found=FOUND, untold=(), **more):
    return {row.name: row for row in settings(stated, found, dict(untold), **more)}


def test_settings_as_they_should_be():
    """omega = kp/L of its own values, 1000 rad/s: kp and ki are omega L and omega R; dead time
    alone is left."""
    found = rows(RIGHT)
    assert list(found) == list(UNITS)
    assert intended(RIGHT) == pytest.approx(1000.0)
    assert {row.verdict for name, row in found.items() if name != "dead_time"} == {"agrees"}
    assert found["current_kp"].found == pytest.approx(1000.0 * 25e-6)
    assert found["current_kp"].ci95 == pytest.approx((0.024, 0.026))
    assert found["current_ki"].ci95 == pytest.approx((49.0, 51.0))
    assert found["dead_time"].verdict == "differs"
    assert found["dead_time"].off == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("name", "factor", "said"),
    [
        ("resistance", 2.0, "two terminals"),
        ("inductance_q", 0.5, "halved twice"),
        ("magnet_flux", 3**0.5, "terminals"),
        ("resistance", 0.85, "warmer"),
        ("resistance", 1.15, "colder"),
        ("resistance", 0.6, "no usual factor"),  # two thirds more: no winding is 170 K warmer
        ("resistance", 1.4, "no usual factor"),
        ("magnet_flux", 2.0 / 3.0, "left out"),
        ("magnet_flux", 1.2, "no usual factor"),
    ],
)
def test_why_a_value_differs(name, factor, said):
    row = rows(RIGHT | {name: factor * RIGHT[name]})[name]
    assert row.verdict == "differs"
    assert row.off == pytest.approx(factor - 1.0)
    assert said in row.said
    assert f"set {FOUND[name].value:.4g}" in row.said


def test_copper_explains_a_resistance_by_its_temperature():
    """IEC 60034-1: in proportion to 235 + temperature (°C), so 10 % from 20 °C are 25.5 K."""
    row = rows(RIGHT | {"resistance": 0.05 / 1.1})["resistance"]
    assert "copper 26 K warmer" in row.said


def test_effects_of_the_voltage_are_named():
    row = rows(RIGHT | {"inductance_d": 27.6e-6}, named=["pwm_delay"])["inductance_d"]
    assert row.off == pytest.approx(0.38)
    assert "the result names pwm_delay" in row.said


def test_dead_time_is_what_legs_lose():
    """VESC's own time did not act on the switching: it is not added, but told for logs of its
    reported voltage.

    A microsecond of foc_dt_us makes up for 4/3 us of a leg: 0.5 us of legs are 0.375, 0.5 + 0.2 us
    0.525.
    """
    row = rows(RIGHT | {"dead_time": 2e-7})["dead_time"]
    assert row.found == pytest.approx(5e-7)
    assert row.ci95 == pytest.approx((4e-7, 6e-7))
    assert row.said.startswith(
        "legs lose 0.5 us; set foc_dt_us = 0.375; if the log holds VESC's reported d/q voltage"
    )
    assert row.said.endswith("set foc_dt_us = 0.525")
    assert rows(RIGHT)["dead_time"].said == "legs lose 0.5 us; set foc_dt_us = 0.375"
    assert rows(RIGHT | {"dead_time": 5e-7})["dead_time"].said.startswith(
        "legs lose 0.5 us; if the log"
    )
    others = {k: v for k, v in RIGHT.items() if k != "dead_time"}
    assert rows(others)["dead_time"].said == "legs lose 0.5 us; make up for 0.5 us"


def test_time_that_vesc_takes_off_is_what_legs_would_lose(tmp_path):
    """Its equations at 24 V, 40 kHz of zero vectors, 0.6 us: modulation times 2/3 of the link, and
    a leg's own loss."""
    link, zero, dt, i = 24.0, 40e3, 0.6e-6, (1.0, -1.0, -1.0)  # signs of the phase currents
    modulation = (2.0 * i[0] - i[1] - i[2]) / 3.0 * dt * zero
    (tmp_path / "vesc").write_text(
        "<a><foc_motor_r>0.1</foc_motor_r><foc_dt_us>0.6</foc_dt_us></a>"
    )
    time = read_configuration(tmp_path / "vesc").control["dead_time"]
    # each leg, over its PWM period of 2 / zero
    lost = [link * time * 0.5 * zero * sign for sign in i]
    assert (2.0 * lost[0] - lost[1] - lost[2]) / 3.0 == pytest.approx(2.0 / 3.0 * link * modulation)


def test_too_much_made_up_for():
    found = FOUND | {"dead_time": Found(-3e-7, (-4e-7, -2e-7))}
    row = rows(RIGHT | {"dead_time": 5e-7}, found)["dead_time"]
    assert (row.found, row.ci95, row.verdict, row.off) == (0.0, (0.0, 0.0), "differs", None)
    assert row.said.startswith(
        "what legs lose is made up for by 0.3 us too much; set foc_dt_us = 0; "
    )
    assert row.said.endswith("set foc_dt_us = 0.15")
    assert "lose -" not in row.said


@pytest.mark.parametrize(
    ("kp", "ki", "said"),
    [
        (2.0, 2.0, "both gains are off alike"),
        (2.0, 2.06, "off alike"),
        (2.0, 1.5, "below"),
        (0.5, 0.6, "above"),
    ],
)
def test_where_the_zero_lies(kp, ki, said):
    """ki/kp beside R/L = 2000/s, whatever ki is beside omega R."""
    row = rows(RIGHT | {"current_kp": kp * 0.025, "current_ki": ki * 50.0}, bandwidth=1000.0)[
        "current_ki"
    ]
    assert row.off == pytest.approx(ki - 1.0)
    assert said in row.said
    no_l = {k: v for k, v in FOUND.items() if not k.startswith("inductance")}
    assert (
        "zero"
        not in rows({"current_kp": 0.05, "current_ki": 99.0}, no_l, bandwidth=1000.0)[
            "current_ki"
        ].said
    )
    assert "zero" not in rows({"current_ki": 99.0}, bandwidth=1000.0)["current_ki"].said


@pytest.mark.parametrize("value", [0.0, -0.01])
def test_gains_of_zero_are_not_stated(value):
    assert intended(RIGHT | {"current_kp": value}) is None
    assert intended(RIGHT | {"bandwidth": value}) == pytest.approx(1000.0)
    found = rows(RIGHT | {"current_kp": value})
    assert found["current_kp"].stated is None
    assert "no bandwidth is stated" in found["current_kp"].said
    assert (
        rows(RIGHT | {"current_kp": value}, bandwidth=1000.0)["current_kp"].verdict == "not stated"
    )


def test_what_is_not_told_or_not_stated():
    few = {k: FOUND[k] for k in ("inductance_d",)}
    found = rows({"current_kp": 0.02}, few, {"magnet_flux": "no rotor turns"})
    assert found["magnet_flux"].said == "no rotor turns"
    assert found["resistance"].verdict == "not told"
    assert found["inductance_d"].verdict == "not stated"
    assert "no bandwidth" in found["current_kp"].said
    given = rows({"current_kp": 0.02}, few, bandwidth=1000.0)
    assert given["current_kp"].found == pytest.approx(0.02)
    assert "does not tell" in given["current_ki"].said


def test_gains_of_four_tools(tmp_path):
    """ODrive's follow from its bandwidth: kp = omega L, ki = omega R."""
    vesc = (
        "<foc_motor_r>0.1</foc_motor_r>",
        "<foc_current_kp>0.03</foc_current_kp>",
        "<foc_current_ki>50</foc_current_ki>",
        "<foc_dt_us>0.12</foc_dt_us>",
    )
    odrive = {
        "phase_resistance": 0.05,
        "phase_inductance": 3e-5,
        "current_control_bandwidth": 1000.0,
    }
    texts = {
        "VESC": f"<a>{''.join(vesc)}</a>",
        "ODrive": json.dumps({f"axis0.config.motor.{k}": v for k, v in odrive.items()}),
        "moteus": "motor.resistance_ohm 0.05\nservo.pid_dq.kp 0.03\nservo.pid_dq.ki 50\n",
        "SimpleFOC": (
            "BLDCMotor m = BLDCMotor(7, 0.05);\nm.PID_current_q.P = 0.03;\nm.PID_current_q.I = "
            "50;\n"
        ),
    }
    for program, text in texts.items():
        (tmp_path / program).write_text(text)
        read = read_configuration(tmp_path / program)
        assert read.program == program
        if program == "ODrive":
            assert read.control == {"bandwidth": 1000.0}
        else:
            assert {k: read.control[k] for k in ("current_kp", "current_ki")} == {
                "current_kp": 0.03,
                "current_ki": 50.0,
            }
    (tmp_path / "new").write_text("motor.resistance_ohm 0.05\nservo.pid_dq_hz 200\n")
    assert read_configuration(tmp_path / "new").control == {
        "bandwidth": pytest.approx(400.0 * math.pi)
    }
    odrive = {"bandwidth": 1000.0, "inductance_d": 3e-5, "inductance_q": 3e-5, "resistance": 0.05}
    row = rows(odrive)["current_kp"]
    assert row.stated == pytest.approx(0.03)
    assert row.off == pytest.approx(30.0 / 25.0 - 1.0)
    assert "faster" in row.said
    assert math.isclose(rows(odrive)["current_ki"].stated, 50.0)
