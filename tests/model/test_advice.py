"""What to do about an effect: every card says it, at a value of its own, by numbers worked out by hand."""

import dataclasses
import math
import re

import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.advice import KEEP, advice, completed, what_to_do
from model.effects.card import Effect
from model.effects.said import number, percent, quantity

DRIVE = load_drive("ipm_exchanged")
MOTOR, CONVERTER = DRIVE.motor, DRIVE.converter  # 12.15 ohm, 0.1961 Wb, 6 pole pairs, 250 us, 400 V
R, PERIOD = MOTOR.resistance, CONVERTER.sampling_period


def told(**values):
    """Return what is said of one effect; values: parameters by public name, '__' for the dot."""
    found = {name.replace("__", "."): x for name, x in values.items()}
    effect = next(iter(found)).partition(".")[0]
    return what_to_do([effect], found, MOTOR, CONVERTER)[effect]


@pytest.mark.parametrize("name", library.effect_names())
def test_every_card_says_what_to_do_at_its_typical_size(name):
    card = library.load_effect(name)
    assert card.do is not None, f"card '{name}' lacks `do`: what should a person do about it?"
    text = advice(name, completed(library.typical(name, MOTOR, CONVERTER), MOTOR), MOTOR, CONVERTER)
    assert text != KEEP
    assert len(text) > 20
    assert not re.search(r"nan|inf\b|\{|\}|e[-+]\d\d", text), text
    assert not text.endswith(".")  # a part of a sentence, which a report ends
    assert advice(name, completed({}, MOTOR), MOTOR, CONVERTER) == KEEP  # where it is off


@pytest.mark.parametrize("name", library.effect_names())
def test_no_card_fails_at_a_bound_or_on_a_motor_without_magnets(name):
    bare = dataclasses.replace(MOTOR, magnet_flux=0.0)
    for motor in (MOTOR, bare):
        for p in library.load_effect(name).parameters:
            for value in (p.low, p.high, -p.typical_for(motor, CONVERTER)):
                found = {f"{name}.{p.name}": value}
                assert advice(name, completed(found, motor), motor, CONVERTER)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"dead_time__time": 2e-6}, "set the dead-time compensation to 2.0 µs"),
        ({"dead_time__time": -0.4e-6}, "lower the drive's dead-time compensation by 400 ns"),
        # copper: R proportional to 235 + T (IEC 60034-1), so 15 % are 0.15 x 255 = 38 K; 0.15 x 12.15 = 1.8 ohm
        ({"stator_resistance__resistance": 1.15 * R}, "R +15 %: winding 38 K warmer, or 1.8 Ω of cable"),
        ({"stator_resistance__resistance": 0.95 * R}, "R −5.0 %: winding 13 K colder;"),
        ({"stator_resistance__resistance": 0.5 * R}, "is the stated value between two terminals?"),
        (
            {"pwm_delay__delay": 0.6 * PERIOD},
            "delay of 0.60 periods: log the command 1 row later, or set a delay of 150 µs",
        ),
        ({"pwm_delay__delay": 2.0 * PERIOD}, "log the command 2 rows later"),
        ({"pwm_delay__delay": 0.1 * PERIOD}, "delay of 0.10 periods: count 25 µs more"),
        # NdFeB -0.12 %/K: 6 % are 50 K
        ({"magnet_flux__magnet_flux": 0.94 * MOTOR.magnet_flux}, "magnets 50 K warmer, or partly demagnetised"),
        ({"current_gain__gain_b": 1.04}, "phase b by 0.9615"),
        ({"current_offset__offset_a": 0.01}, "10 mA from phase a, 0 A from phase b, −10 mA from phase c"),
        ({"dc_link_error__gain_error": 0.03}, "divides by to 412 V (+3.0 %)"),
        ({"encoder_offset__offset": math.radians(6.0)}, "by −6.0° (−1.0° mechanical)"),
        ({"current_filter__time_constant": 1.0 / (2.0 * math.pi * 5e3)}, "32 µs (5.0 kHz)"),
        ({"inductance__scale_d": 0.9}, f"inductance_d = {quantity(0.9 * MOTOR.inductance_d, 'H', 3)} (−10 %)"),
        (
            {"winding_asymmetry__delta_a": 0.3, "winding_asymmetry__delta_b": -0.2},
            "500 mΩ in phase a, 200 mΩ in phase c",
        ),
        ({"current_sampling__delay": -3e-6}, "3.0 µs later"),
    ],
)
def test_what_is_said_by_hand(values, said):
    assert said in told(**values)


def test_an_own_effect_without_a_sentence_is_kept_in_the_simulator(monkeypatch):
    card = library.load_effect("dead_time")
    monkeypatch.setattr("model.effects.advice.load_effect", lambda name: dataclasses.replace(card, do=None))
    assert told(dead_time__time=1e-6) == KEEP
    assert "do" in {f.name for f in dataclasses.fields(Effect)}


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (2e-6, "s", "2.0 µs"),
        (9.96e-4, "A", "1.0 mA"),
        (1.8225, "ohm", "1.8 Ω"),
        (0.0, "V", "0 V"),
        (0.0011, "kg m^2", "0.0011 kg·m²"),
        (-0.012, "A", "−12 mA"),
    ],
)
def test_sizes_have_two_digits_and_a_prefix(value, unit, said):
    assert quantity(value, unit) == said
    assert number(123.4) == "120"
    assert percent(-0.004) == "−0.40 %"
