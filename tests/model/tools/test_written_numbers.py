"""Configurations in the other forms that drives' tools write: each gives the same numbers, what is
no motor of three phases is refused."""

import pytest

from model.errors import BadInput
from model.tools.configurations import read_configuration
from model.tools.stated_motor import stated_motor
from model.tools.written_numbers import numbers_of

OLD_ODRIVE = """{"axis0": {"motor": {"config": {"pole_pairs": 7, "phase_resistance": 0.04,
"phase_inductance": 2e-5, "current_lim": 40.0}}, "controller": {"config": {"vel_limit": 160000.0}},
"encoder": {"config": {"cpr": 8192}}}}"""
SHELL = """In [3]: odrv0.axis0.motor.config
phase_inductance: 2e-05 (float)
phase_resistance: 0.04 (float)
pole_pairs: 7 (int32)
torque_constant: 0.03 (float)
current_lim: 40.0 (float)
"""
LINES = """odrv0.axis0.config.motor.phase_resistance = 0.04
odrv0.axis0.config.motor.phase_inductance = 2e-5
odrv0.axis0.config.motor.torque_constant = 8.27 / 275.6667
odrv0.axis0.config.motor.pole_pairs = 7
odrv0.axis0.config.motor.current_soft_max = 40
"""
TERMINAL = """Detection finished and applied. Results:
Motor Current       : 40.0 A
Motor R             : 40.00 mOhm
Motor L             : 20.00 microH
Motor Flux Linkage  : 2.857 mWb
"""
DESCRIBED = "".join(
    f"<{name}><longName>n</longName><{kind}>{value}</{kind}></{name}>"
    for name, kind, value in (
        ("foc_motor_r", "valDouble", 0.04),
        ("foc_motor_l", "valDouble", 2e-5),
        ("foc_motor_flux_linkage", "valDouble", 2.857e-3),
        ("si_motor_poles", "valInt", 14),
        ("l_current_max", "valDouble", 40),
    )
)
SKETCH = """BLDCMotor *m1 = new BLDCMotor(7, 0.04);
void setup() { driver1.voltage_power_supply = 24; m1->current_limit = 40; m1->KV_rating = 275.667;
m1->axis_inductance.d = 2e-5; m1->axis_inductance.q = 2e-5; }
"""


@pytest.mark.parametrize(
    ("text", "more"),
    [
        (OLD_ODRIVE, ["kv=275.667"]),
        (SHELL, []),
        (LINES, []),
        (TERMINAL, ["poles=14"]),
        (f"<ConfigParams><Params>{DESCRIBED}</Params></ConfigParams>", []),
        (SKETCH, []),
    ],
    ids=["odrive 0.4", "odrive's shell", "a fraction", "vesc's terminal", "vesc's tool", "sketch"],
)
def test_one_motor_in_every_form(tmp_path, text, more):
    """Kt = 0.03 N m/A, 8.27 / Kv, is a flux of 0.03 / (3/2 7) Wb."""
    (tmp_path / "c").write_text(text)
    words = more if text == SKETCH else [*more, "voltage=24V"]
    motor = stated_motor([str(tmp_path / "c"), *words]).drive.motor
    assert (motor.pole_pairs, motor.resistance, motor.rated_current) == (7, 0.04, 40.0)
    assert motor.inductance_q == pytest.approx(2e-5)
    assert motor.magnet_flux == pytest.approx(0.03 / 10.5, rel=1e-3)


def test_a_speed_in_counts_of_the_encoder(tmp_path):
    """Firmware before 0.5: 160000 counts/s of 8192 a turn."""
    (tmp_path / "c").write_text(OLD_ODRIVE)
    found = read_configuration(tmp_path / "c")
    assert found.stated["rated_speed_rpm"] == f"{60 * 160000 / 8192:.10g} rpm"
    assert "counts/s of an encoder of 8192" in found.origin["rated_speed_rpm"]


@pytest.mark.parametrize(
    ("sketch", "said"),
    [
        ("StepperMotor motor = StepperMotor(50, 1.5, 20);", "a stepper has two phases"),
        (
            "BLDCMotor a = BLDCMotor(7);\nBLDCMotor b(11, 5.6);",
            r"holds 2 motors \(a, b\); leave the lines of one",
        ),
    ],
)
def test_a_sketch_of_no_one_motor_is_refused(sketch, said):
    with pytest.raises(BadInput, match=said):
        numbers_of(sketch, "x.ino")
