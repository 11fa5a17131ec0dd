"""What to do about an effect: every card says it, at a value of its own, by numbers worked out by
hand."""

import dataclasses
import math
import re

import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.advice import KEEP, NONE, advice, completed, what_to_do
from model.effects.card import Effect
from model.effects.said import number, percent, quantity
from model.mapped import OF_MAP
from model.parameters import Motor

DRIVE = load_drive("ipm_exchanged")
MOTOR, CONVERTER = DRIVE.motor, DRIVE.converter  # 12.15 ohm, 0.0981 Wb, 6 pole pairs, 250 us, 400 V
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
    assert re.search(r"\d", text), text  # how much
    assert not re.search(r"nan|inf\b|\{|\}|e[-+]\d\d", text), text
    assert not text.endswith(".")  # a part of a sentence, which a report ends
    assert advice(name, completed({}, MOTOR), MOTOR, CONVERTER) == NONE  # where it is off


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
        # copper: R proportional to 235 + T (IEC 60034-1), so 15 % are 0.15 x 255 = 38 K; 0.15 x
        # 12.15 = 1.8 ohm
        (
            {"stator_resistance__resistance": 1.15 * R},
            "R +15 %: winding 38 K warmer, or 1.8 Ω of cable",
        ),
        ({"stator_resistance__resistance": 0.95 * R}, "R −5.0 %: winding 13 K colder;"),
        ({"stator_resistance__resistance": 0.5 * R}, "is the stated value between two terminals?"),
        (
            {"pwm_delay__delay": 0.6 * PERIOD},
            "delay of 0.60 periods: log the command 1 row later, or set a delay of 150 µs",
        ),
        ({"pwm_delay__delay": 2.0 * PERIOD}, "log the command 2 rows later"),
        ({"pwm_delay__delay": 0.1 * PERIOD}, "delay of 0.10 periods: count 25 µs more"),
        # no winding is 510 K warmer: what is left is cable, 2 x 12.15 ohm
        (
            {"stator_resistance__resistance": 3.0 * R},
            "R +200 %: 24 Ω of cable and contacts; set resistance = 36.5 Ω",
        ),
        # NdFeB -0.12 %/K: 6 % are 50 K; ferrite -0.2 %/K: 30 K
        (
            {"magnet_flux__magnet_flux": 0.94 * MOTOR.magnet_flux},
            "(−6.0 %: NdFeB 50 K warmer, or ferrite 30 K warmer, or partly demagnetised)",
        ),
        # 30 % are 250 K of NdFeB, which no magnet stands, and 150 K of ferrite
        (
            {"magnet_flux__magnet_flux": 0.7 * MOTOR.magnet_flux},
            "(−30 %: ferrite 150 K warmer, or partly demagnetised)",
        ),
        # friction brakes: the drive has to push the way that it turns; 1.5 x 6 x 0.0981 Wb = 0.883
        # N m/A
        (
            {"coulomb_friction__torque": 0.0353},
            "add 35 mN·m (about 40 mA on q) to the torque's reference in the sense of",
        ),
        # the slots push by A sin(36 x + phase): so much less is asked for; 0.5 rad are 29 degrees
        (
            {
                "cogging_torque__amplitude": 0.02,
                "cogging_torque__order_mech": 36.0,
                "cogging_torque__phase": 0.5,
            },
            "subtract 20 mN·m sin(36 x + 29°), x the shaft's angle",
        ),
        # the drop R1 (i - x) of a first-order lag: R1 w²tau²/(1 + w²tau²), half of it at 1/(2 pi
        # tau)
        (
            {
                "skin_effect__resistance": 2.0,
                "skin_effect__time_constant": 1.0 / (2.0 * math.pi * 800.0),
            },
            "f/(800 Hz)",
        ),
        # Dowell below x = 1: R (5 m^2 - 1)/45 xi^4 = 2 x 19/45; xi = 1 where omega pi^2 tau = 2
        (
            {
                "skin_effect__resistance": 2.0,
                "skin_effect__layers": 2.0,
                "skin_effect__time_constant": 1.0 / (math.pi**3 * 800.0),
            },
            "count 840 mΩ times x² more into the estimator's resistance at the injection's "
            "frequency f, x = f/(800 Hz)",
        ),
        # play of 3 mrad = 0.17 degrees; closed: sqrt(300 N m/rad (1/6e-4 + 1/5e-4 kg m^2))/(2 pi)
        (
            {
                "shaft_compliance__stiffness": 300.0,
                "shaft_compliance__load_inertia": 5e-4,
                "shaft_compliance__backlash": 3e-3,
                "inertia__inertia": 1.1e-3,
            },
            "take out the play of 3.0 mrad (0.17°) between motor and load",
        ),
        ({"saturation__alpha_30": 10.0}, "alpha_30 = 10 A/Wb²"),
        ({"saturation__alpha_04": 10.0}, "alpha_04 = 10 A/Wb³"),
        # half of the dead time's volts are lost where a leg just slews over in it, i t/(2 C) = u;
        # twice that wide
        (
            {"dead_time__time": 2e-6, "dead_time__capacitance": 1e-9},
            "less of it below 800 mA of a phase's current",
        ),
        ({"current_gain__gain_b": 1.04}, "phase b by 0.9615"),
        (
            {"current_offset__offset_a": 0.01},
            "10 mA from phase a, 0 A from phase b, −10 mA from phase c",
        ),
        ({"dc_link_error__gain_error": 0.03}, "divides by to 412 V (+3.0 %)"),
        (
            {"encoder_offset__offset": math.radians(6.0)},
            "subtract 6.0° (electrical; 1.0° mechanical) from the encoder's reading",
        ),
        (
            {"encoder_offset__offset": math.radians(-6.0)},
            "add 6.0° (electrical; 1.0° mechanical) to",
        ),
        (
            {
                "encoder_eccentricity__amplitude_mech": math.radians(0.3),
                "encoder_eccentricity__phase": -0.5,
            },
            "centre the code disc or magnet ring, or subtract 0.30° sin(x − 29°), x the",
        ),
        (
            {
                "encoder_eccentricity__amplitude_mech": math.radians(0.1),
                "encoder_eccentricity__3.amplitude_mech": math.radians(0.2),
                "encoder_eccentricity__3.order_mech": 4.0,
            },
            "subtract 0.10° sin(x) and 0.20° sin(4 x), x the",
        ),
        ({"current_filter__time_constant": 1.0 / (2.0 * math.pi * 5e3)}, "32 µs (5.0 kHz)"),
        ({"inductance__scale_d": 0.9}, "inductance_d = 0.0412 H (−10 %)"),
        (
            {"winding_asymmetry__delta_a": 0.3, "winding_asymmetry__delta_b": -0.2},
            "500 mΩ in phase a, 200 mΩ in phase c",
        ),
        ({"current_sampling__delay": -3e-6}, "3.0 µs later"),
    ],
)
def test_what_is_said_by_hand(values, said):
    assert said in told(**values)


@pytest.mark.parametrize("name", library.effect_names())
def test_of_a_motor_with_a_flux_map_nothing_is_set_that_its_file_may_not_state(name):
    """Inductances, magnet flux and alphas come from the map: [motor] refuses them
    (`model.mapped.stand_in`)."""

    class OfMap(Motor):
        has_map = True

    motor = OfMap(**dataclasses.asdict(MOTOR))
    text = advice(name, completed(library.typical(name, MOTOR, CONVERTER), motor), motor, CONVERTER)
    assert not re.search(rf"set ({'|'.join(OF_MAP)})|motor.toml", text)
    own = {"inductance", "magnet_flux", "saturation", "cross_saturation"}
    assert text.startswith("not as the flux map has it") == (name in own)


def test_an_own_effect_without_a_sentence_is_kept_in_the_simulator(monkeypatch):
    card = library.load_effect("dead_time")
    monkeypatch.setattr(
        "model.effects.advice.load_effect", lambda name: dataclasses.replace(card, do=None)
    )
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
