"""The effect library: every card complete, names and bounds checked with advice, neutral values
really neutral."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.card import SUBSYSTEMS
from model.errors import BadInput

DRIVE = load_drive("ipm_exchanged")
MOTOR, CONVERTER = DRIVE.motor, DRIVE.converter
CANONICAL = [
    "stator_resistance",
    "magnet_flux",
    "inductance",
    "saturation",
    "cross_saturation",
    "flux_harmonics",
    "inductance_harmonics",
    "iron_loss",
    "skin_effect",
    "winding_asymmetry",
    "dead_time",
    "device_drop",
    "leg_voltage",
    "dc_link_error",
    "dc_link_ripple",
    "pwm_delay",
    "current_gain",
    "current_linearity",
    "current_offset",
    "current_filter",
    "current_sampling",
    "encoder_offset",
    "encoder_eccentricity",
    "coulomb_friction",
    "friction_torque",
    "viscous_friction",
    "cogging_torque",
    "inertia",
    "shaft_compliance",
]


def test_all_canonical_effects_are_there():
    assert set(library.effect_names()) == set(CANONICAL)


def test_an_effect_with_all_numbers_of_another_can_stand_for_it():
    """By the cards: only `saturation` has every coefficient of its cross part; the cross part lacks
    alpha_30, ..."""
    assert library.holders("cross_saturation") == ("saturation",)
    assert not any(library.holders(e) for e in library.effect_names() if e != "cross_saturation")


def test_a_moved_double_is_asked_for_the_limits_of_both():
    """cross_saturation.alpha_12 is saturation.alpha_12; what stands under two names is told."""
    assert library.shared() == {
        f"{e}.alpha_{n}" for e in ("saturation", "cross_saturation") for n in ("12", "22")
    }
    doubles = library.same_numbers()
    assert doubles["cross_saturation.alpha_22"] == "saturation.alpha_22"
    assert "saturation.alpha_22" not in doubles


def test_values_of_the_motor_are_told_by_the_cards():
    assert library.scaled() == {
        "inductance.scale_d": "inductance_d",
        "inductance.scale_q": "inductance_q",
    }
    alphas = {f"saturation.alpha_{n}": f"alpha_{n}" for n in ("30", "12", "40", "22", "04")}
    assert library.replaced() == alphas | {
        "stator_resistance.resistance": "resistance",
        "magnet_flux.magnet_flux": "magnet_flux",
        "inertia.inertia": "inertia",
        "viscous_friction.coefficient": "viscous_friction",
    }


@pytest.mark.parametrize("name", library.effect_names())
def test_card_is_complete(name):
    card = library.load_effect(name)
    assert card.name == name
    assert card.subsystem in SUBSYSTEMS
    assert library.places(card)
    for text in (
        card.summary,
        card.equation,
        card.source,
        card.axis,
        card.order,
        card.region,
        card.separated_by,
    ):
        assert text
    assert card.confused_with
    assert not set(card.confused_with) - set(library.effect_names()) - {name}
    for p in card.parameters:
        neutral, typical = p.neutral_for(MOTOR), p.typical_for(MOTOR, CONVERTER)
        assert p.low <= neutral <= p.high
        assert p.low <= typical <= p.high
        assert math.isfinite(typical)
    sizes = library.typical(name, MOTOR, CONVERTER)
    assert any(sizes[k] != library.neutral(MOTOR)[k] for k in sizes)
    assert library.complete(MOTOR, CONVERTER, sizes) != library.neutral(MOTOR)
    text = library.card_text(card)
    assert card.equation in " ".join(text.split())
    assert all(f"{name}.{p.name}" in text for p in card.parameters)
    assert max(map(len, text.splitlines())) <= library.CARD_WIDTH == 80


def test_table_in_the_readme_is_current():
    """Regenerate with `python -m model.effects.library`."""
    assert (library.FOLDER / "README.md").read_text(encoding="utf-8") == library.readme()


def test_parse():
    found = library.parse("dead_time.time=2e-6, current_offset.offset_a = 0.01")
    assert found == {"dead_time.time": 2e-6, "current_offset.offset_a": 0.01}
    assert library.parse("") == {}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "dead_tme.time=2e-6",
            "unknown effect parameter 'dead_tme.time'; did you mean 'dead_time.time'",
        ),
        ("dead_time.tim=2e-6", "did you mean 'dead_time.time'"),
        ("dead_time=2e-6", "did you mean 'dead_time.time'"),
        ("dead_time.time", "has no value"),
        ("dead_time.time=2,5e-6", r"decimal comma: write 2\.5e-6, with a point"),
        (
            "device_drop.threshold=0,8,dead_time.time=1e-6",
            r"decimal comma: write 0\.8, with a point",
        ),
        ("dead_time.time=two", "'two' is no number"),
        ("dead_time.time=1,dead_time.time=1", "out of range"),
        ("dead_time.time=1e-6,dead_time.time=2e-6", "given twice"),
        (
            "dead_time.time=nan",
            r"dead_time.time = nan is out of range; give a number in \[-5e-06, 5e-05\] s",
        ),
        ("encoder_eccentricity.phase=inf", "not finite"),
        ("card.x=1", "unknown effect"),
    ],
)
def test_parse_refuses_with_advice(text, words):
    with pytest.raises(BadInput, match=words):
        library.parse(text)


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ({"saturation.alpha_12": 1.0, "cross_saturation.alpha_12": 2.0}, "contradict each other"),
        ({"shaft_compliance.load_inertia": 0.0011}, "below 0.0011 kg m.2, the total inertia"),
        (
            {"shaft_compliance.load_inertia": 0.001, "inertia.inertia": 0.0009},
            "below 0.0009 kg m.2",
        ),
        ({"pwm_delay.delay": 7.6e-4}, "delay: 0.00076 is .* below 0.00075 s, 3 sampling periods"),
        ({"current_sampling.delay": -1.3e-4}, "half the sampling period"),
        ({"dead_time.time": True}, "out of range"),
        (  # 0.3 once a turn and 2 x 0.4: the reading's slope reaches 1 - 1.1
            {
                "encoder_eccentricity.amplitude_mech": 0.3,
                "encoder_eccentricity.2.amplitude_mech": -0.4,
            },
            "amplitude_mech: 1.1 .*the reading must grow with the angle",
        ),
    ],
)
def test_contradictions_are_refused(effects, words):
    with pytest.raises(BadInput, match=words):
        library.complete(MOTOR, CONVERTER, effects)


def test_parts_of_an_effect_have_names_of_their_own():
    card = library.load_effect("cogging_torque")
    assert [card.public(k, "amplitude") for k in (1, 2)] == [
        "cogging_torque.amplitude",
        "cogging_torque.2.amplitude",
    ]
    assert f"cogging_torque.{card.repeats}.amplitude" in library.parameters()
    assert f"cogging_torque.{card.repeats + 1}.amplitude" not in library.parameters()
    values = library.complete(MOTOR, CONVERTER, {"cogging_torque.2.amplitude": 0.1})
    assert [card.switched_off(values, library.neutral(MOTOR), k) for k in (1, 2, 3)] == [
        True,
        False,
        True,
    ]
    assert "cogging_torque.k.phase" in library.card_text(card)


def test_cross_saturation_is_a_part_of_saturation():
    values = library.complete(MOTOR, CONVERTER, {"cross_saturation.alpha_12": 3.0})
    assert values["saturation.alpha_12"] == 3.0
    assert library.true_motor(MOTOR, values).alpha_12 == 3.0


def test_replaced_parameters_make_the_true_motor():
    assert library.true_motor(MOTOR, library.neutral(MOTOR)) == MOTOR
    text = "stator_resistance.resistance=13,inductance.scale_d=0.9,inertia.inertia=0.002,magnet_flux.magnet_flux=0.1"  # noqa: E501
    true = library.true_motor(MOTOR, library.complete(MOTOR, CONVERTER, library.parse(text)))
    assert (true.resistance, true.inertia, true.magnet_flux) == (13.0, 0.002, 0.1)
    assert (true.inductance_d, true.inductance_q) == (0.9 * MOTOR.inductance_d, MOTOR.inductance_q)
    with pytest.raises(BadInput, match="magnet_flux"):
        library.checked("magnet_flux.magnet_flux", -0.1)


def test_every_file_says_what_its_kernels_return():
    for name in library.effect_names():
        text = (library.FOLDER / f"{name}.py").read_text()
        assert text.count("@kernel") == len(re.findall(r'@kernel\ndef .*\n    """Return', text)), (
            name
        )


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        (
            {"shaft_compliance.stiffness": 1e15, "shaft_compliance.load_inertia": 5e-4},
            "resonance.*rigid shaft",
        ),
        ({"shaft_compliance.stiffness": 100.0}, "alone does nothing"),
        ({"shaft_compliance.backlash": 1e-3}, "backlash alone does nothing"),
        ({"inductance_harmonics.gamma_6": 30.0}, "gamma_6: 30 .*not convex"),
        ({"dc_link_ripple.amplitude": 1000.0}, "below 400 V"),
        ({"current_sampling.jitter": 1e-3}, "half the PWM period"),
        ({"winding_asymmetry.delta_a": -100.0}, "leaves a phase"),
        ({"flux_harmonics.psi_d6": 10.0}, "the magnet flux"),
        ({"flux_harmonics.2.order": 6.5}, "no whole order; give 1, 2, ..., 60, or a negative one"),
        ({"encoder_eccentricity.2.order_mech": 2.5}, r"no whole order; give 1, 2, ..., 8$"),
        ({"inductance_harmonics.3.order": 0.0}, "no whole order"),
        (
            {f"inductance_harmonics.{k}.gamma": 4.0 for k in range(2, 7)},
            r"\.gamma: 4 .*in proportion",
        ),
    ],
)
def test_sizes_that_no_drive_can_have_are_refused(effects, words):
    drive = load_drive("ipm_exchanged")
    with pytest.raises(BadInput, match=words):
        library.complete(drive.motor, drive.converter, effects)


@pytest.mark.parametrize("name", [e for e in CANONICAL if library.load_effect(e).limits])
def test_limits_can_be_asked_at_any_values(name):
    """A fit asks on its way, where an inertia may lie below the load's share of it: told, never a
    failing root."""
    card, rng = library.load_effect(name), np.random.default_rng(1)
    known, neutral = library.parameters(), library.neutral(MOTOR)
    own = [
        *(n for n in known if n.partition(".")[0] == name and not library.is_further(n)),
        "inertia.inertia",
    ]
    for _ in range(300):
        values = dict(neutral)
        for n in own:
            p = known[n]
            size = p.typical_for(MOTOR, CONVERTER) or neutral[n] or 1.0
            drawn = float(
                rng.choice(
                    [p.low, p.high, neutral[n], size * 10.0 ** rng.uniform(-4.0, 4.0), -size]
                )
            )
            values[n] = min(max(drawn, p.low), p.high)
        try:
            found = list(card.limits_at(values, MOTOR, CONVERTER))
        except BadInput:
            continue
        assert not any(x.broken for x in found[:-1])
        assert all(not math.isnan(x.size) for x in found)


def test_an_inertia_below_that_of_the_load_is_told_before_the_resonance():
    values = library.neutral(MOTOR) | {
        "shaft_compliance.stiffness": 10.0,
        "shaft_compliance.load_inertia": 1e-3,
    }
    card, light = library.load_effect("shaft_compliance"), values | {"inertia.inertia": 9e-4}
    found = list(card.limits_at(light, MOTOR, CONVERTER))
    assert [x.name for x in found] == ["shaft_compliance.load_inertia"]
    assert found[0].broken


def test_a_neutral_value_may_be_a_share_of_the_motors_own():
    """Dry friction changes its sign over 0.005 of rated speed, whatever the drive; one that is
    given in rad/s is kept."""
    own = MOTOR.rated_omega / MOTOR.pole_pairs
    slow = dataclasses.replace(MOTOR, rated_speed_rpm=0.01 * MOTOR.rated_speed_rpm)
    width = "coulomb_friction.width"
    assert library.neutral(MOTOR)[width] == pytest.approx(0.005 * own, rel=1e-12)
    assert library.neutral(slow)[width] == pytest.approx(5e-5 * own, rel=1e-12)
    assert library.complete(slow, CONVERTER, {width: 2.0})[width] == 2.0
    assert "0.005 x rated speed" in library.card_text(library.load_effect("coulomb_friction"))
