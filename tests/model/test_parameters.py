"""Motor files: what is printed, what is assumed, and what a wrong file is told."""

from __future__ import annotations

import dataclasses
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from model.drive_files import load_drive, mapped_names, motor_file, motor_names
from model.effects.library import check_inside, complete
from model.errors import BadInput, unknown
from model.parameters import Converter, Injection, Motor

# Rated values and parameters as the paper's two tables print them: SI units.
PRINTED = {
    "ipm": (6, 1.2, 1.06, 1800, 12.15, 91.9e-3, 45.8e-3, 7.70, 5.35, 19.42, 22.18, 6.62),
    "spm": (2, 3.4, 29.0, 400, 6.69, 155.4e-3, 58.6e-3, 5.01, 4.83, 1.83, 8.76, 1.18),
}
NAMES = [
    *(
        "pole_pairs",
        "rated_current",
        "rated_torque",
        "rated_speed_rpm",
        "resistance",
        "inductance_d",
        "inductance_q",
    ),
    *("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04"),
]
GOOD = """
[motor]
pole_pairs = 4
resistance = 1.0
magnet_flux = 0.1
inductance_d = 0.01
inductance_q = 0.02
inertia = 0.001
rated_current = 5.0
rated_torque = 3.0
rated_speed_rpm = 3000
"""


@pytest.mark.parametrize("name", PRINTED)
def test_values_are_the_printed_ones(name):
    motor = load_drive(name).motor
    assert tuple(getattr(motor, n) for n in NAMES) == PRINTED[name]


@pytest.mark.parametrize("name", PRINTED)
def test_exchanged_differs_in_the_two_inductances_only(name):
    printed, exchanged = load_drive(name).motor, load_drive(f"{name}_exchanged").motor
    swapped = dataclasses.replace(
        printed,
        name=exchanged.name,
        description=exchanged.description,
        inductance_d=printed.inductance_q,
        inductance_q=printed.inductance_d,
    )
    assert swapped == exchanged


def test_magnet_flux_follows_from_rated_torque_and_peak_current():
    for name in PRINTED:
        m = load_drive(name).motor
        assert m.magnet_flux == pytest.approx(
            m.rated_torque / (1.5 * m.pole_pairs * m.rated_current), rel=2e-3
        )


@pytest.mark.parametrize("name", [*motor_names(), *mapped_names()])
def test_every_value_says_where_it_comes_from(name):
    data = tomllib.loads(motor_file(name).read_text())
    notes = data["provenance"]
    assert "source" in notes
    for table in ("motor", "drive", "injection"):
        for key in data[table]:
            if key not in ("name", "description"):
                assert notes[key].split(":")[0].split(";")[0] in (
                    "printed",
                    "derived",
                    "assumed",
                ), key


def drive_file(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return path


def test_user_motor_with_defaults(tmp_path):
    drive = load_drive(drive_file(tmp_path, GOOD))
    assert drive.name == "mine"
    assert drive.converter == Converter(250e-6, 400.0, 0.002 * 5.0, 0.0017 * 5.0)
    assert drive.injection == Injection(500.0, 0.8 * 500.0 * 0.01 * 5.0)
    assert isinstance(drive.motor.rated_speed_rpm, float)


@pytest.mark.parametrize(
    "text", ["nan H", "inf mH", "1e400 mH", "1,000 H", "-1,250 mH", "45.8 H", "-1 mH"]
)
def test_nothing_is_suggested_that_is_no_value_or_not_clear(tmp_path, text):
    """45.8 H is beyond the bound; 1,000 may be one or a thousand."""
    with pytest.raises(BadInput, match="is not a number") as found:
        load_drive(
            drive_file(tmp_path, GOOD.replace("inductance_d = 0.01", f"inductance_d = '{text}'"))
        )
    assert "write" not in str(found.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("resistance = 1.0|resistence = 1.0", ("resistence", "did you mean 'resistance'")),
        ("resistance = 1.0|resistance = -1.0", ("resistance = -1.0", "[1e-05, 1000] ohm")),
        ("resistance = 1.0|resistance = nan", ("resistance = nan", "finite", "ohm")),
        ("resistance = 1.0|resistance = inf", ("resistance = inf", "ohm")),
        ("resistance = 1.0|resistance = '1'", ("not a number", "ohm")),
        ("resistance = 1.0|resistance = true", ("not a number", "ohm")),
        ("resistance = 1.0|resistance = '50 mohm'", ("not a number", "(ohm): write 0.05")),
        ("inductance_d = 0.01|inductance_d = '45,8 mH'", ("not a number", "(H): write 0.0458")),
        ("inductance_d = 0.01|inductance_d = '45.8mH'", ("not a number", "(H): write 0.0458")),
        ("inductance_d = 0.01|inductance_d = '0,060 H'", ("(H): write 0.06",)),
        ("inductance_d = 0.01|inductance_d = 45.8", ("H; is it mH? write 0.0458",)),
        ("resistance = 1.0|", ("lacks 'resistance'", "ohm")),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[drive]\npwm_frequency = '4000'",
            ("pwm_frequency", "number"),
        ),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[drive]\nencoder_counts = -1",
            ("encoder_counts = -1",),
        ),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[injection]\nwaveform = 3",
            ("waveform = 3", "quotes"),
        ),
        ("resistance = 1.0|resistance = 1" + 400 * "0", ("resistance = 1e+300", "ohm")),
        ("[motor]|x = " + 3000 * "[" + "\n[motor]", ("mine.toml",)),
        ("[motor]|[motor]\nname = 3", ("name = 3", "quotes")),
        ("[motor]|[motor]\nname = ['a']", ("name = ['a']", "quotes")),
        ("pole_pairs = 4|pole_pairs = 4.5", ("pole_pairs", "whole")),
        ("[motor]|[moter]", ("moter", "did you mean 'motor'")),
        ("[motor]|[motor", ("not valid TOML",)),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[drive]\nsampling_period = 250",
            ("250", "0.01] s", "us? write 0.00025"),
        ),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[drive]\nsampling_period = 0.25",
            ("ms? write 0.00025",),
        ),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[injection]\nwaveform = 'squar'",
            ("mean 'square'",),
        ),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[injection]\ntracking = 'vesk'",
            ("mean 'vesc'",),
        ),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[drive]\nmodulation = 'SVPWM'",
            ("mean 'centred'",),
        ),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[drive]\nmodulation = 'SPWM'",
            ("'SPWM': sinusoidal PWM",),
        ),
        ("resistance = 1.0|resistance = true", ("resistance = true is not a number",)),
        (
            "rated_speed_rpm = 3000|rated_speed_rpm = 3000\n[drive]\nbetween_rows = 'held'",
            ("between_rows = 'held'", "several PWM periods apart", "leave it out"),
        ),
    ],
)
def test_wrong_file_is_told_value_bound_and_remedy(tmp_path, change, words):
    old, new = change.split("|")
    with pytest.raises(BadInput) as error:
        load_drive(drive_file(tmp_path, GOOD.replace(old, new)))
    assert "mine.toml" in str(error.value)
    for word in words:
        assert word in str(error.value)


def test_unknown_motor_and_missing_file():
    with pytest.raises(BadInput, match="did you mean 'ipm_exchanged'"):
        load_drive("ipm_exchangd")
    with pytest.raises(BadInput, match="does not exist"):
        load_drive("nowhere.toml")


SCALARS = st.one_of(
    st.floats(),
    st.integers(),
    st.booleans(),
    st.text(max_size=5),
    st.lists(st.integers(), max_size=2),
)


@settings(max_examples=150, deadline=None)
@given(
    st.dictionaries(st.sampled_from([f.name for f in dataclasses.fields(Motor)] + ["x"]), SCALARS)
)
def test_any_motor_table_is_taken_or_refused_in_one_sentence(values):
    from model.parameters import build

    base = tomllib.loads(GOOD)["motor"]
    try:
        motor = build(Motor, {"name": "m", **base, **values}, "motor")
    except BadInput as error:
        assert str(error)
    else:
        assert all(abs(v) < 1e13 for v in motor.energy)


@settings(max_examples=60, deadline=None)
@given(text=st.text(max_size=60))
def test_any_text_is_taken_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("fuzz") / "m.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput):
        load_drive(path)


def test_a_name_in_other_case_is_recognized():
    with pytest.raises(BadInput, match="did you mean 'vesc_hfi'"):
        raise unknown("estimator", "VESC_HFI", ["ekf", "vesc_hfi"])


def test_a_slow_log_is_not_simulated():
    drive = load_drive("ipm_exchanged")
    slow = dataclasses.replace(drive.converter, pwm_frequency=16000.0)
    with pytest.raises(BadInput, match=r"that of a slow log; .* give sampling_period = 6\.25e-05"):
        check_inside(drive.motor, slow, complete(drive.motor, slow, {}))
    check_inside(drive.motor, slow.at_full_rate(), complete(drive.motor, slow, {}))


def test_readings_inside_a_period_are_a_whole_number():
    own = load_drive("ipm_exchanged").converter
    assert dataclasses.replace(own, readings=8.0).readings == 8.0
    with pytest.raises(BadInput, match=r"readings = 8.5 is not whole"):
        dataclasses.replace(own, readings=8.5)


def test_what_reads_a_link_scatters_by_a_tenth_of_it_at_most():
    converter = load_drive("ipm_exchanged").converter
    link = converter.dc_bus_voltage
    assert dataclasses.replace(converter, link_noise=0.099 * link).link_noise == 0.099 * link
    with pytest.raises(BadInput, match="link_noise"):
        dataclasses.replace(converter, link_noise=0.101 * link)


RIGHT = {
    "name": "m",
    "pole_pairs": 4,
    "resistance": 0.5,
    "magnet_flux": 0.05,
    "inductance_d": 1e-3,
    "inductance_q": 2e-3,
    "inertia": 1e-4,
    "rated_current": 5.0,
    "rated_torque": 1.0,
    "rated_speed_rpm": 3000.0,
}
STATED = [
    (kind, table, f.name)
    for kind, table in ((Motor, "motor"), (Converter, "drive"), (Injection, "injection"))
    for f in dataclasses.fields(kind)
    if "low" in f.metadata
]


@pytest.mark.parametrize(("kind", "table", "key"), STATED, ids=[k for _, _, k in STATED])
def test_a_value_that_is_none_is_told_where_to_find_one(kind, table, key):
    """Value, bound and remedy, whatever the value is: where such a value comes from, or that it may
    be left out."""
    others = {
        Motor: RIGHT,
        Converter: {"sampling_period": 1e-4, "dc_bus_voltage": 24.0},
        Injection: {"frequency": 500.0, "amplitude": 5.0},
    }[kind]
    noise = {"current_resolution": 0.0, "current_noise": 0.0} if kind is Converter else {}
    for value in (float("nan"), 1e290):
        with pytest.raises(BadInput) as told:
            kind(**{**others, **noise, key: value})
        assert f"[{table}] {key} = " in str(told.value)
        rest = str(told.value).partition("give a finite value in [")[2].partition("]")[2]
        assert ": " in rest or "or leave it out" in rest, str(told.value)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("resistance", -0.5, "is its sign wrong? write 0.5"),
        ("inductance_d", -2e-3, "is its sign wrong? write 0.002"),
        ("inductance_d", 45.8, "is it mH? write 0.0458"),
        ("resistance", "0,5", "give one (ohm): write 0.5"),
        ("resistance", 0.0, "]: half of what is measured between two terminals"),
    ],
)
def test_a_wrong_value_is_told_what_to_write(key, value, words):
    with pytest.raises(BadInput) as told:
        Motor(**{**RIGHT, key: value})
    assert words in str(told.value).replace(" ohm: half", ": half")
