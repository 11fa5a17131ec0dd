"""Motors as other tools and data sheets state them: every conversion by hand, contradictions and
gaps told."""

import json
import math
import re

import pytest

from model.errors import BadInput
from model.tools.configurations import read_configuration
from model.tools.quantities import quantity_of
from model.tools.stated_motor import stated_motor
from sandbox.cli import main
from tests.data import real_data
from tests.model.tool_files import MOTEUS, ODRIVE, SIMPLEFOC, VESC

REST = ["current=20A", "voltage=24V"]
SIMPLE = ["poles=14", "resistance=0.05ohm", "inductance=30uH", *REST]


@pytest.mark.parametrize(
    ("text", "more", "wanted"),
    [
        (
            VESC,
            [],
            {
                "inductance_d": 6e-6,
                "inductance_q": 8e-6,
                "magnet_flux": 0.00245,
                "rated_current": 60.0,
            },
        ),
        (
            json.dumps(ODRIVE),
            ["voltage=24V"],
            {"resistance": 0.04, "magnet_flux": 0.03 / (1.5 * 7)},
        ),
        # v_per_hz: V of a phase, peak, per mechanical Hz
        (
            MOTEUS,
            ["voltage=24V", "inductance=30uH"],
            {"magnet_flux": 0.109 / (math.tau * 7), "rated_current": 100.0},
        ),
        (
            SIMPLEFOC,
            ["voltage=12V"],
            {"magnet_flux": 60 / (math.tau * math.sqrt(3) * 7 * 160), "inductance_q": 3e-5},
        ),
    ],
    ids=["VESC", "ODrive", "moteus", "SimpleFOC"],
)
def test_configurations_of_four_tools(tmp_path, text, more, wanted):
    (tmp_path / "config").write_text(text)
    found = stated_motor([str(tmp_path / "config"), *more])
    assert found.drive.motor.pole_pairs == 7
    for name, value in wanted.items():
        assert getattr(found.drive.motor, name) == pytest.approx(value, rel=1e-6), name
    assert {s.key for s in found.steps} >= {"resistance", "magnet_flux", "inertia"}


@pytest.mark.parametrize("name", ["flipsky6374", "hoverboard", "mad8318", "mj5208"])
def test_the_sweeps_of_moteus(name):
    """The file's own fit: lambda_m (Wb), L_d = B + C i_d (H)."""
    path = real_data() / "moteus_ld" / f"ld_{name}.json"
    own = json.loads(path.read_text())
    motor = stated_motor([str(path), "voltage=24V"]).drive.motor
    assert motor.magnet_flux == pytest.approx(own["fit"]["lambda_m"])
    assert motor.resistance == pytest.approx(own["params"]["R"])
    assert 2 * motor.pole_pairs == own["params"]["poles"]


@pytest.mark.parametrize(
    ("word", "name", "value"),
    [
        ("kv=300", "magnet_flux", 60 / (math.tau * math.sqrt(3) * 7 * 300)),
        # 1000/300
        ("back_emf=3.333333 V/krpm", "magnet_flux", 60 / (math.tau * math.sqrt(3) * 7 * 300)),
        # 8.27/Kv, ODrive
        ("kt=0.0275664 Nm/A", "magnet_flux", 60 / (math.tau * math.sqrt(3) * 7 * 300)),
        ("flux=2,6 mWb", "magnet_flux", 2.6e-3),
        # rms: sqrt(2) V peak a volt, sqrt(2) A peak an ampere, which stands below the line of a
        # torque constant
        ("back_emf=2.357022 Vrms/krpm", "magnet_flux", 60 / (math.tau * math.sqrt(3) * 7 * 300)),
        ("ke=2.357022 V rms/1000rpm", "magnet_flux", 60 / (math.tau * math.sqrt(3) * 7 * 300)),
        ("kt=0.03898477 Nm/A rms", "magnet_flux", 60 / (math.tau * math.sqrt(3) * 7 * 300)),
        (
            "kt=5.520708 ozin/Arms",
            "magnet_flux",
            60 / (math.tau * math.sqrt(3) * 7 * 300),
        ),  # 1 ozf in: 7.0615518e-3 N m
        ("kv=424.2641 rpm/Vrms", "magnet_flux", 60 / (math.tau * math.sqrt(3) * 7 * 300)),
    ],
)
def test_one_flux_by_four_statements(word, name, value):
    assert getattr(stated_motor([*SIMPLE, word]).drive.motor, name) == pytest.approx(
        value, rel=1e-4
    )


@pytest.mark.parametrize(
    "word",
    ["20 A peak", "20 Apk", "20A (pk)", "14.1421356 A rms", "14.1421356 A_rms", "14.1421356Aeff"],
)
def test_a_current_as_data_sheets_write_it(word):
    words = [*SIMPLE[:3], "kv=300", "voltage=24V", f"current={word}"]
    assert stated_motor(words).drive.motor.rated_current == pytest.approx(20.0)


def test_values_between_terminals_and_rms():
    motor = stated_motor(
        ["p=7", "r_ll=0.1 Ω", "l_ll=0,06 mH", "kv=300", "current=20 A rms", "voltage=24"]
    ).drive.motor
    assert motor.resistance == pytest.approx(0.05)
    assert motor.inductance_q == pytest.approx(3e-5)
    assert motor.rated_current == pytest.approx(20.0 * math.sqrt(2.0))
    assert quantity_of("36 gcm2", "kg m^2", "inertia").value == pytest.approx(3.6e-6)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["kv=300"],
            "the number of pole pairs, resistance, the inductance, rated_current and the link.s "
            "voltage are missing; give them, e.g. pole_pairs=7 resistance=0.05ohm inductance=30uH",
        ),
        ([*SIMPLE], "magnet_flux is missing; give it, e.g. kv=300"),
        (["poles=7", "kv=300"], "makes 3.5 pole pairs"),
        ([*SIMPLE, "kv=300", "flux=9mWb"], "give one"),
        ([*SIMPLE, "kv=300", "kw=3"], "unknown value of a motor 'kw'"),
        ([*SIMPLE, "kv=300 V"], "unknown unit of kv"),
        ([*SIMPLE, "kv=fast"], "is no quantity"),
        ([*SIMPLE[:3], "kv=300", "current=20A"], "the link's voltage is missing"),
        (["nothing.xml"], "does not exist"),
        ([*SIMPLE[:4], "kv=300", "voltage=0"], "dc_bus_voltage = '0' must be above 0"),
        ([*SIMPLE, "kv=1e-320"], "magnet_flux = inf is out of range.*from 'kv = 1e-320"),
        (
            [*SIMPLE[:2], *REST, "kv=300", "l=30"],
            r"inductance_d = 30.0 is out of range.*from 'l = 30'",
        ),
    ],
)
def test_what_is_wrong_is_told(words, said):
    with pytest.raises(BadInput, match=said):
        stated_motor(words)


def test_the_command_writes_a_file_that_is_read_again(tmp_path):
    from model.drive_files import load_drive

    assert main(["motor", *SIMPLE, "kv=300", "--out", str(tmp_path), "--quiet"]) == 0
    found = json.loads((tmp_path / "motor.json").read_text())
    drive = load_drive(tmp_path / "motor.toml")
    for row in found["values"]:
        table = drive.motor if row["table"] == "motor" else drive.converter
        assert getattr(table, row["key"]) == pytest.approx(row["value"])
    assert "1 / (sqrt(3) pole_pairs Kv)" in drive.provenance["magnet_flux"]


@pytest.mark.parametrize("value", ["nan", "inf"])
def test_a_value_that_is_used_and_no_number_is_named(tmp_path, value):
    """Not called missing, and of what nobody asks for nothing is said."""
    path = tmp_path / "vesc.xml"
    own = re.sub(r"(flux_linkage>)[^<]*", rf"\g<1>{value}", VESC)
    assert own != VESC
    path.write_text(own)
    said = rf"vesc.xml: foc_motor_flux_linkage = {value} Wb, which is no finite number; measure"
    with pytest.raises(BadInput, match=said):
        read_configuration(path)
    beside = f"<other>{value}</other></MCConfiguration>"
    path.write_text(VESC.replace("</MCConfiguration>", beside))
    assert read_configuration(path).stated["magnet_flux"]


def test_a_file_of_no_known_tool(tmp_path):
    (tmp_path / "x.xml").write_text("<a><b>1</b></a>")
    with pytest.raises(BadInput, match="nothing of a motor is known in it"):
        read_configuration(tmp_path / "x.xml")


def row(found, key):
    return next(s for s in found.steps if s.key == key)


def test_every_conversion_of_a_configuration_is_shown(tmp_path):
    """In the configuration's own names and numbers, none as if it stood there as it is."""
    (tmp_path / "vesc").write_text(VESC)
    found = stated_motor([str(tmp_path / "vesc"), "current=40 A"])
    said = {
        "inductance_d": "L - diff/2 (foc_motor_l = 7e-06 H, foc_motor_ld_lq_diff = 2e-06 H)",
        "resistance": "foc_motor_r = 0.015 ohm",
        "dc_bus_voltage": "si_battery_cells = 6, 3.7 V a cell",
        "pwm_frequency": "foc_f_zv = 30000, half of it: centre-aligned",
        "sampling_period": "1 / pwm_frequency",
        "pole_pairs": "si_motor_poles = 14: half of the poles",
        "rated_current": "current = 40 A",
    }
    assert {k: row(found, k).said for k in said} == said
    # its name in firmware before 6
    (tmp_path / "old").write_text(VESC.replace("foc_f_zv", "foc_f_sw"))
    assert row(stated_motor([str(tmp_path / "old")]), "pwm_frequency").value == 15_000.0


def test_a_configuration_of_two_motors(tmp_path):
    """Two that differ are refused; an axis without a motor (resistance 0) and one that is the same
    are not."""
    second = {k.replace("axis0", "axis1"): v for k, v in ODRIVE.items()}
    other = {**second, "axis1.config.motor.phase_resistance": 0.09}
    path, more = tmp_path / "odrive.json", ["voltage=24V"]
    path.write_text(json.dumps({**other, **ODRIVE}))
    with pytest.raises(BadInput, match=r"holds 2 motors that differ \(axis1, axis0\)"):
        stated_motor([str(path), *more])
    for beside in (second, {**other, "axis1.config.motor.phase_resistance": 0.0}):
        path.write_text(json.dumps({**beside, **ODRIVE}))
        assert stated_motor([str(path), *more]).drive.motor.resistance == 0.04


def test_two_configurations_that_differ(tmp_path):
    for name, text in (("one", VESC), ("two", VESC.replace("0.015", "0.03"))):
        (tmp_path / name).write_text(text)
    with pytest.raises(
        BadInput,
        match=r"foc_motor_r = 0.03 ohm, and another configuration says foc_motor_r = 0.015",
    ):
        stated_motor([str(tmp_path / "one"), str(tmp_path / "two")])


def test_a_sketch_as_people_write_it(tmp_path):
    """Comments are none of its values; constants stand for numbers."""
    (tmp_path / "sketch.ino").write_text(
        "#define POLE_PAIRS 7\nconst float KV = 160.0f;\n// BLDCMotor motor = BLDCMotor(11, 5.0);\n"
        "BLDCMotor motor = BLDCMotor(POLE_PAIRS, 0.1664 /* ohm */, KV);\nvoid setup() {\n"
        "  // motor.current_limit = 50;\n  motor.current_limit = 5;\n  "
        "motor.phase_inductance = 30e-6;\n}\n"
    )
    motor = stated_motor([str(tmp_path / "sketch.ino"), "voltage=12V"]).drive.motor
    assert (motor.pole_pairs, motor.resistance, motor.inductance_d, motor.rated_current) == (
        7,
        0.1664,
        3e-5,
        5.0,
    )
    assert motor.magnet_flux == pytest.approx(60 / (math.tau * math.sqrt(3) * 7 * 160))


def test_all_missing_values_are_named_at_once(tmp_path):
    """Of words, of a configuration, and without magnets; what is wrong comes before."""
    (tmp_path / "moteus").write_text("motor.poles 14\nmotor.resistance_ohm 0.05\n")
    cases = {
        ("kv=300",): "pole_pairs=7 resistance=0.05ohm inductance=30uH current=20A voltage=24V",
        ("p=7", "r=1", "ld=1mH"): "kv=300 inductance_q=30uH current=20A voltage=24V",
        ("p=7", "flux=0", "r=1", "l=1mH", *REST): "torque=2Nm speed=3000",
        (str(tmp_path / "moteus"), "l=9uH"): "kv=300 current=20A voltage=24V",
    }
    for words, example in cases.items():
        with pytest.raises(BadInput, match=rf"are missing.*; give them, e\.g\. {example}$"):
            stated_motor(words)
        keys = {w.partition("=")[0] for w in words if "=" in w}
        more = [w for w in example.split() if w.partition("=")[0] not in keys]
        assert stated_motor([*words, *more]).drive.motor.rated_current > 0.0  # as the sentence says
    with pytest.raises(BadInput, match="kv = 'fast' is no quantity"):
        stated_motor(["kv=fast"])


def test_numbers_and_units_stand_apart_in_the_result(tmp_path):
    words = ["poles=14", "kv=300", "r_ll=0.1 Ω", "l=30uH", "current=20 A rms", "voltage=24V"]
    assert main(["motor", *words, "--out", str(tmp_path), "--quiet"]) == 0
    rows = {r["key"]: r for r in json.loads((tmp_path / "motor.json").read_text())["values"]}
    stated = {k: tuple(r["stated"].values()) for k, r in rows.items() if r["stated"]}
    assert stated == {
        "pole_pairs": ("poles", 14.0, None, False),
        "magnet_flux": ("kv", 300.0, "rpm/V", False),
        "resistance": ("resistance_ll", 0.1, "Ω", False),
        "inductance_d": ("inductance", 30.0, "uH", False),
        "inductance_q": ("inductance", 30.0, "uH", False),
        "rated_current": ("rated_current", 20.0, "A", True),
        "dc_bus_voltage": ("dc_bus_voltage", 24.0, "V", False),
    }
    units = {k: r["unit"] for k, r in rows.items()}
    assert (units["magnet_flux"], units["resistance"], units["pole_pairs"]) == ("Wb", "ohm", None)
    assert all(units[k] for k in units if k != "pole_pairs")
