"""Effects of one's own: the example against closed forms, and what is refused.

The plant is compiled once a process, so the example runs in a process of its own: of its kernels
the shaft's alone, as a whole replay takes half a minute to compile.
"""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import sandbox.plant.electrical as electrical  # from here on an effect comes too late
from model.compiled import inlined
from model.drive_files import load_drive
from model.effects import adopt, library, own
from model.effects.card import At, Effect, LegSlope, Limit, Parameter
from model.effects.library import load_effect
from model.effects.own import EQUATIONS
from model.errors import BadInput
from model.kernels.sources import depends_on
from sandbox.drive.closed import longest_step
from sandbox.plant import additions as add
from sandbox.plant import sets
from sandbox.replay.negative_resistance import given_back
from sandbox.switched import inverter

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "experiments" / "my_effects.py"
LAGS = """
from dataclasses import replace
from model.effects.current_filter import low_pass
from model.effects.current_sampling import apart, taken
from model.effects.iron_loss import branch, excess, play
from model.effects.library import load_effect
from model.effects.pwm_delay import later
from model.effects.shaft_compliance import gap, two_masses
from model.effects.skin_effect import dowell, ladder
EFFECTS = tuple(
    replace(load_effect(name), name=f"my_{name}", limits=None, longest=None)
    for name in ("iron_loss", "skin_effect", "current_filter", "pwm_delay", "current_sampling", "shaft_compliance")
)
"""  # noqa: E501
TWICE = """
import json
from model.effects.adopt import adopt
adopt({file!r})
from model.drive_files import load_drive
from model.errors import BadInput
from sandbox.plant.sets import batch_of, complete, features_of
from sandbox.plant.batch import FIXED
drive = load_drive("ipm")
def told(**values):
    v = complete(drive.motor, drive.converter, {{k.replace("__", "."): x for k, x in values.items()}})
    w = batch_of(drive.motor, drive.converter, [v], 1)
    return {{name: float(w[name][0]) for name in FIXED}} | {{"features": features_of(drive.motor, v)}}
sizes = {{"iron_loss__core_resistance": 500.0, "iron_loss__time_constant": 1e-4, "skin_effect__resistance": 2.0,
         "skin_effect__time_constant": 3e-4, "current_filter__time_constant": 2e-5, "pwm_delay__delay": 4e-6,
         "current_sampling__delay": 3e-6, "current_sampling__jitter": 3e-7}}
shaft = {{"shaft_compliance__stiffness": 50.0, "shaft_compliance__load_inertia": 0.4 * drive.motor.inertia,
         "shaft_compliance__damping_ratio": 1.0}}
mine = {{f"my_{{k}}": v for k, v in (sizes | shaft).items()}}
more = {{"iron_loss__core_resistance": 250.0, "iron_loss__time_constant": 4e-4}}
uneven = told(**{{**sizes, **more}}, **mine)
wrong = []
for share in (1.0, 2.0):
    try:
        told(**{{**mine, "my_shaft_compliance__load_inertia": share * drive.motor.inertia}})
    except BadInput as error:
        wrong.append(str(error))
print(json.dumps([told(), told(**sizes, **shaft), told(**mine), told(**sizes, **mine), uneven, *wrong]))
"""  # noqa: E501
RUN = """
import json
import math
import numpy as np
from model.effects.adopt import adopt
print(*[c.name for c in adopt({example!r})])
import sandbox.plant.ports as ports
from model.drive_files import load_drive
from sandbox.plant.mechanics import turned_by
from sandbox.plant.sets import batch_of, complete, features_of
drive = load_drive("ipm")
def turned(values, parts):
    values = complete(drive.motor, drive.converter, {{"viscous_friction.coefficient": 0.0, **values}})
    w, angle = batch_of(drive.motor, drive.converter, [values], 1), np.zeros({n})
    turned_by(w, features_of(drive.motor, values), np.full({n}, {torque}), {period}, parts, angle)
    return angle[-1] / drive.motor.pole_pairs
print(json.dumps([turned({{"fan.coefficient": {fan}}}, 1), turned({{"fan.coefficient": {fan}}}, 4), turned({{}}, 1)]))
values = complete(drive.motor, drive.converter, {{"resolver.amplitude": 0.004, "resolver.phase": 0.7}})
w = batch_of(drive.motor, drive.converter, [values], 1)
print(max(abs(ports.angle(w, 0, x, 6.0) - 6.0 * 0.004 * math.sin(2.0 * x + 0.7)) for x in np.linspace(-3.0, 9.0, 50)))
"""  # noqa: E501


def test_the_examples_fan_and_resolver_enter_the_plant(tmp_path):
    """Under a constant torque T a fan k holds the speed of a rotor at w = sqrt(T/k) tanh(t/c), with
    c = J/sqrt(T k): the angle is sqrt(T/k) c log cosh(t/c), which is a tenth less than without it.

    The step takes friction at its start: of half a step's older speed, T h/(2 J), the fan's torque
    is off by 2 k sqrt(T/k) times that at most.  The resolver's error is its equation to rounding
    (sums of a few 1e-2: 1e-15).
    """
    j, k, torque, h, n = load_drive("ipm").motor.inertia, 2e-5, 0.5, 2.5e-4, 1600
    text = RUN.format(example=str(EXAMPLE), fan=k, torque=torque, period=h, n=n)
    names, angles, error = (
        in_a_process_of_its_own(tmp_path / "run.py", text, tmp_path).strip().splitlines()
    )
    assert names == "fan resolver"
    coarse, fine, without = json.loads(angles)
    t, top, c = (n - 1) * h, (torque / k) ** 0.5, j / (torque * k) ** 0.5
    wanted = top * c * math.log(math.cosh(t / c))
    assert without == pytest.approx(0.5 * torque / j * t * t, rel=1e-9)
    assert without > 1.1 * wanted
    off = 0.5 * t * t * (k * top * torque * h / j) / j
    assert abs(coarse - wanted) < off
    assert coarse - wanted == pytest.approx(4.0 * (fine - wanted), rel=0.01)
    assert float(error) < 1e-14


def in_a_process_of_its_own(script, text, folder):
    """Return what a script prints in a process that has compiled no plant yet."""
    script.write_text(text, encoding="utf-8")
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, env=env, cwd=folder
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_lags_delays_and_a_second_mass_of_ones_own(tmp_path):
    """The library's equations as a user's: alone the same bits; beside the library's own lags add
    up as told in model/effects/README.md: conductances 1/500 + 1/250 with 1e-4 s and 4e-4 s are
    6e-3 and, for fast changes, 20 + 10 1/H, delays and time constants add up, jitters as
    independent ones do.  Half of a shaft's inertia behind it is a load, all of it or more is
    refused."""
    (tmp_path / "lags.py").write_text(LAGS, encoding="utf-8")
    text = TWICE.format(file=str(tmp_path / "lags.py"))
    none, library_alone, alone, both, uneven, *wrong = json.loads(
        in_a_process_of_its_own(tmp_path / "run.py", text, tmp_path)
    )
    assert library_alone == alone
    assert none != alone
    assert (none["features"], none["core_g"], none["skin_r"], none["filter_rate"]) == (
        add.RUB,
        0.0,
        0.0,
        1e12,
    )
    assert (
        none["delay"],
        none["sample"],
        none["jitter"],
        none["load_inv"],
        none["swing_rate"],
    ) == (0, 0, 0, 0, 0)
    assert alone["features"] == add.RUB | add.IRON | add.SKIN | add.FILTER | add.DELAYED | add.TWIST
    assert both["core_g"] == pytest.approx(2.0 * alone["core_g"])
    assert both["core_rate"] == pytest.approx(1e4)
    assert (uneven["core_g"], uneven["core_g"] * uneven["core_rate"]) == pytest.approx(
        (6e-3, 20.0 + 10.0)
    )
    assert (both["skin_r"], both["skin_rate"]) == pytest.approx((4.0, 1.0 / 3e-4))
    assert both["filter_rate"] == pytest.approx(1.0 / 4e-5)
    assert (both["delay"], both["sample"]) == pytest.approx((8e-6, 6e-6 - 8e-6))
    assert both["jitter"] == pytest.approx(3e-7 * 2.0**0.5)
    assert (both["swing_rate"], both["load_share"]) == (alone["swing_rate"], alone["load_share"])
    assert alone["load_share"] == pytest.approx(0.4)
    assert alone["swing_ratio"] < 1.0
    assert len(wrong) == 2
    for said in wrong:
        assert said.startswith(
            "what effects say at 'shaft' is no part of a drive (0 <= the load's inertia < all of it"
        )
        assert "my_shaft_compliance.load_inertia = 0.00" in said


def test_kernels_that_hold_no_effect_are_not_compiled_again():
    """Whose file depends on what holds the equations is: the plant imports the ports, the switched
    bench shares no code with it."""
    plant, bench = (depends_on(Path(module.__file__)) for module in (electrical, inverter))
    assert EQUATIONS in plant
    assert EQUATIONS not in bench


def test_an_equation_that_the_file_does_not_name_is_refused():
    """The plant calls an equation by its name in the user's file."""
    adopt.check_named(SOUND, SimpleNamespace(drag=DRAG), Path("mine.py"))
    with pytest.raises(
        BadInput, match="no 'drag' there is the equation of 'mine'; define or import it"
    ):
        adopt.check_named(SOUND, SimpleNamespace(), Path("mine.py"))


def test_effects_after_the_plant_come_too_late():
    with pytest.raises(BadInput, match="compiled already"):
        adopt.adopt(EXAMPLE)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("EFFECTS = ()", "no effects"),
        ("x = (", "SyntaxError"),
        ("1 / 0", "ZeroDivisionError"),
        ("raise SystemExit(7)", "SystemExit"),
        ("EFFECTS = ('fan',)", "no effects"),
    ],
)
def test_a_file_that_holds_no_effects_is_refused_in_a_sentence(tmp_path, text, said):
    file = tmp_path / "mine.py"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=said) as refusal:
        adopt.read_cards(file, "sensorless_effects_test")
    assert "\n" not in str(refusal.value)


def card(name="mine", at=(), numbers=("size",), repeats=1):
    """Return a card."""
    return Effect(
        name=name,
        repeats=repeats,
        summary="",
        subsystem="mechanics",
        equation="",
        source="",
        at=at,
        axis="",
        order="",
        region="",
        parameters=tuple(Parameter(n, "", 0.0, -1.0, 1.0, 0.1) for n in numbers),
        confused_with=(),
        separated_by="",
    )


DRAG = load_effect("viscous_friction").at[0].equation  # takes (coefficient, omega)
SOUND = card(at=(At("friction", DRAG, ("size",)),))


@inlined
def always(size):
    """Return a time constant (s) that is there without the effect, too."""
    return 1e-5


@inlined
def back(size):
    """Return a lag (ohm, s) that looks ahead."""
    return size, -1.0


LATER = load_effect("pwm_delay").at[0].equation  # takes (delay)
CABLE = replace(
    card(
        "cable",
        (At("delay", LATER, ("delay",)), At("friction", DRAG, ("drag",))),
        ("delay", "drag"),
    ),
    switches=("delay",),
    limits=lambda v, motor, converter: [
        Limit("cable.delay", v["cable.delay"], motor.resistance * 1e-6, "s, R x 1 uF")
    ],
    longest=lambda v, motor, omega: 0.25 * abs(v["cable.delay"]),
)


@pytest.fixture
def own_card(monkeypatch):
    """Have the library know a card of one's own, without its equations in the plant; return how it
    is given."""

    def give(card):
        monkeypatch.setitem(own.FILES, "cable.py", "cable_of_test")
        monkeypatch.setitem(sys.modules, "cable_of_test", SimpleNamespace(EFFECTS=(card,)))
        forget()

    def forget():
        library.forget()
        for kept in (sets.needs, sets.numbers, sets.several, sets.usual_timing):
            kept.cache_clear()

    yield give
    monkeypatch.undo()
    forget()


def test_a_card_states_its_need_its_limit_and_its_step(own_card):
    """The cable's delay: below R x 1 uF = 12.15 us on `ipm` (12.15 ohm), the plant's delayed
    pulses, a quarter as step; the plant's own step is longer at rest."""
    drive = load_drive("ipm")
    neutral = sets.complete(drive.motor, drive.converter)
    features = sets.features_of(drive.motor, neutral)
    alone = longest_step(drive.motor, neutral, features, 0.0)
    adopt.check_card(CABLE, Path("cable.py"))
    own_card(CABLE)
    values = sets.complete(drive.motor, drive.converter, {"cable.delay": 4e-6})
    assert sets.features_of(drive.motor, values) == features | add.DELAYED
    assert longest_step(drive.motor, values, features, 0.0) == 1e-6 < alone
    assert sets.usual_timing() == (
        "pwm_delay.delay",
        "current_sampling.delay",
        "current_sampling.jitter",
        "cable.delay",
    )
    with pytest.raises(
        BadInput, match=r"cable.delay: 2e-05 is out of range; .* below 1.215e-05 s, R x 1 uF"
    ):
        sets.complete(drive.motor, drive.converter, {"cable.delay": 2e-5})
    off = sets.complete(drive.motor, drive.converter, {"cable.drag": 1e-3})
    assert sets.features_of(drive.motor, off) == features
    assert longest_step(drive.motor, off, features, 0.0) == alone


def test_a_limit_of_simulated_drives_does_not_hold_for_recorded_ones(own_card):
    drive = load_drive("ipm")
    limits = [Limit("cable.delay", 2.0, 1.0, "s", simulated=True)]
    own_card(replace(CABLE, limits=lambda v, motor, converter: limits))
    values = sets.complete(drive.motor, drive.converter, {"cable.delay": 4e-6})
    with pytest.raises(BadInput, match=r"cable\.delay: 2 is out of range"):
        library.check_inside(drive.motor, drive.converter, values)


@pytest.mark.parametrize("name", [n for n in library.effect_names() if load_effect(n).at])
def test_cards_of_the_library_are_taken_from_users_too(name):
    """One rule for all cards; a user's has another name, and its functions ask for its own numbers
    by it."""
    own = load_effect(name)
    mine = replace(own, name="mine", limits=None, inside=None, longest=None)
    adopt.check_card(mine, Path("mine.py"))  # raises where it refuses, as it does without equations
    with pytest.raises(BadInput, match="no equation"):
        adopt.check_card(replace(mine, at=()), Path("mine.py"))


def test_legs_that_give_volts_back_by_an_effect_of_ones_own(own_card):
    """Its ohms add up with the library's, each over a zone of 0.2 A: a drop of 0.1 V takes 0.5 of
    the 0.8 ohm given back.  Held is the widest zone of those that give: the own one is twice 0.2 A,
    that of a negative dead time 0.8 A."""
    drive = load_drive("ipm")
    motor, converter = drive.motor, drive.converter
    card = replace(SOUND, leg_slope=lambda v, _, legs: LegSlope(-v["mine.size"], 2.0 * legs.zone))
    adopt.check_card(card, Path("mine.py"))
    own_card(card)
    early = {"dead_time.time": -0.2 * converter.sampling_period / converter.dc_bus_voltage}
    given = [
        {"mine.size": 0.8},
        {"mine.size": 0.8, "device_drop.threshold": 0.1},
        {"mine.size": 0.8, **early},
        {"mine.size": 0.8, **early, "dead_time.zone_width": 0.8},
        {"mine.size": -0.8},
    ]
    values = [sets.complete(motor, converter, v | {"bench.soft_current": 0.2}) for v in given]
    found = given_back(motor, converter, values, np.full(5, converter.dc_bus_voltage))
    assert found.ohms == pytest.approx([0.8, 0.3, 1.8, 1.05, 0.0])
    assert found.within == pytest.approx([0.4, 0.4, 0.4, 0.8, 0.0])


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (card("dead_time", (At("friction", DRAG, ("size",)),)), "already"),
        (card("../x", (At("friction", DRAG, ("size",)),)), "no name"),
        (card(), "no equation"),
        (card(numbers=("a\x1b[2J",)), "no name"),
        (replace(card(), summary="a\nb\x1b[2J"), r"'a\\nb\\x1b\[2J' in 'mine' is no line"),
        (card(at=(At("wind", DRAG, ("size",)),)), "ports are"),
        (card(at=(At("friction", DRAG, ("length",)),)), "none of its parameters"),
        (card(at=(At("winding", DRAG, ("size",)),)), "must be @inlined"),
        (card(at=(At("friction", abs, ("size",)),)), "must be @inlined"),
        (card(at=(At("friction", DRAG, ("size",)),), repeats=3), "repeats at the port 'friction'"),
        (card(at=(At("friction", DRAG, ("size",)),), repeats=0), "give 1 ..."),
        (replace(load_effect("iron_loss"), name="mine", at=()), "no equation"),
        (
            card(at=(At("filter", always, ("size",)),)),
            "fails with mine.size = 0: .* 'filter' returns 1e-05 while it is",
        ),
        (
            card(at=(At("skin", back, ("size",)),)),
            r"'skin' returns \(-1.0, -1.0\); give finite ones",
        ),
        (
            replace(SOUND, limits=lambda v, motor, converter: [1.0 / 0.0]),
            "fails with mine.size = -1: ZeroDivision",
        ),
        (
            replace(SOUND, longest=lambda v, motor, omega: v["mine.sizes"]),
            "fails with mine.size = -1: KeyError",
        ),
        (
            replace(SOUND, longest=lambda v, motor, omega: 0.0),
            "longest gives 0.0; give s, more than 0",
        ),
        (
            replace(SOUND, leg_slope=lambda v, motor, legs: LegSlope(v["mine.size"], 0.0)),
            "fails with mine.size = -1: .*leg_slope gives -1.0 ohm within 0.0 A; give finite",
        ),
        (
            replace(SOUND, leg_slope=lambda v, motor, legs: LegSlope(math.inf, legs.zone)),
            "leg_slope gives inf ohm",
        ),
    ],
)
def test_a_card_that_the_plant_cannot_take_is_refused(wrong, said):
    with pytest.raises(BadInput, match=said):
        adopt.check_card(wrong, Path("mine.py"))
