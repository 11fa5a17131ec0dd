"""A motion with one mistake planted is refused or doubted with the mistake's name; the motion as it
is passes.

The motion is a closed form (`closed_form`).
"""

import json
import math

import numpy as np
import pytest

from sandbox import check
from tests.sandbox.gap.motion.closed_form import (
    CONSTANT,
    DRY,
    FLUX,
    INERTIA,
    MOTOR,
    PAIRS,
    VISCOUS,
    motion,
)


def checked(folder, change=lambda c: c, columns=None, motor=MOTOR, also=()):
    """Return levels and texts of `check` on two runs of a motion, changed before they are
    written."""
    mapped = columns or {
        "t": {"column": "t"},
        "theta": {"column": "angle", "unit": "rev", "mechanical": True},
        "i_q": {"column": "iq"},
    }
    lines = ["[columns]"]
    for name, entry in mapped.items():
        body = ", ".join(f"{k} = {json.dumps(v)}" for k, v in entry.items())
        lines.append(f"{name} = {{{body}}}")
    lines.append(motor)
    for k in (1, 2):
        c = change(motion(seed=k))
        own = ["t", "angle", "iq", *also]
        rows = [
            ",".join(own),
            *(",".join(f"{x:.9g}" for x in row) for row in zip(*(c[n] for n in own), strict=True)),
        ]
        (folder / f"r{k}.csv").write_text("\n".join(rows) + "\n")
        lines.append(f'[[recording]]\nfile = "r{k}.csv"\nrotor = "free"\n')
    (folder / "map.toml").write_text("\n".join(lines))
    return [
        (n.level, n.finding.text)
        for n in check(folder, columns=folder / "map.toml", effects=False).noticed
    ]


def times(**factors):
    return lambda c: {n: x * factors.get(n, 1.0) for n, x in c.items()}


def test_a_motion_as_it_is_passes(tmp_path):
    assert checked(tmp_path) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (times(iq=1e3), "'iq' is in mA"),
        (times(t=1e3), "'t' is in ms"),
        (times(t=1e6), "'t' is in us"),
        (times(angle=360.0), "'angle' is in deg"),
        (times(angle=8192.0), "'angle' is in counts"),
        (times(angle=PAIRS), "'angle' is electrical"),
        (times(angle=math.tau), "'angle' is in rad"),
        (times(angle=-1.0), "'angle' is counted backwards (map it with scale = -1)"),
        (times(iq=-1.0), "'iq' is counted out of the motor (map it with scale = -1)"),
        (times(angle=-360.0), "'angle' is in deg and counted backwards"),
        (times(angle=-1.0, iq=1e3), "'iq' is in mA and 'angle' is counted backwards"),
        (times(angle=0.0), "never changes while rotor = 'free'"),
    ],
)
def test_a_mistake_is_named(tmp_path, change, words):
    assert any(level != "note" and words in text for level, text in checked(tmp_path, change))


@pytest.mark.parametrize(
    ("unit", "factor", "words"),
    [
        ("rev/s", 1.0, ""),
        ("rad/s", 60.0, "'speed' is in rpm (map it with unit = \"rpm\")"),
        ("rpm", math.tau, "'speed' is in rad/s (map it with unit = \"rad/s\")"),
        ("rev/s", PAIRS, "'speed' is electrical (map it without mechanical)"),
        ("rev/s", -1.0, "'speed' is counted backwards (map it with scale = -1)"),
    ],
)
def test_a_speed_that_stands_for_the_angle_is_named_by_its_own_units(tmp_path, unit, factor, words):
    mapped = {
        "t": {"column": "t"},
        "speed": {"column": "speed", "unit": unit, "mechanical": True},
        "i_q": {"column": "iq"},
    }
    found = checked(tmp_path, times(speed=factor), mapped, also=("speed",))
    off = [text for level, text in found if level != "note"]
    assert (not off) if not words else any(words in text for text in off), found


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1e4, "inertia is in kg cm^2"),
        (1e3, "inertia is in g m^2"),
        (1e-3, "inertia is 1000 times too small"),
        (1e7, "inertia is in g cm^2"),
    ],
)
def test_a_stated_inertia_in_another_unit_is_named(tmp_path, factor, words):
    motor = MOTOR.replace(f"inertia = {INERTIA}", f"inertia = {INERTIA * factor}")
    assert any(
        words in text for level, text in checked(tmp_path, motor=motor) if level == "refused"
    )


def test_what_looks_like_milliamperes_is_named_beside_them(tmp_path):
    """A thousand times too much torque: of the currents, of what makes a torque of them, or of the
    inertia it is compared with; a motion alone cannot tell which."""
    own = MOTOR.replace(f"magnet_flux = {FLUX}", f"torque_constant = {1500.0 * PAIRS * FLUX}")
    found = checked(tmp_path, motor=own)
    said = " ".join(text for level, text in found if level == "refused")
    assert "'iq' is in mA" in said
    assert "torque_constant is in mN m/A (divide it by 1000 in [motor])" in said
    assert "inertia is 1000 times too small" in said


@pytest.mark.parametrize("frozen", [False, True])
def test_a_coarse_encoder_that_creeps_to_a_stop_is_not_stuck(tmp_path, frozen):
    """256 counts a turn: near a stop each count lasts for many rows; one that freezes at 40 rad/s
    is stuck.  The speed is 20 (1 - cos 3t), or 0 in every other period."""
    step = math.tau / 256

    def halting(c):
        w, p = 20.0 * (1.0 - np.cos(3.0 * c["t"])), (3.0 * c["t"]) // math.tau % 2
        speed, rise = w * (p == 0), 60.0 * np.sin(3.0 * c["t"]) * (p == 0)
        angle = np.cumsum(speed) * 2e-3
        k = int(np.argmax(speed))
        angle[k : k + 60] = angle[k] if frozen else angle[k : k + 60]
        torque = INERTIA * rise + DRY * np.tanh(speed / 0.2) + VISCOUS * speed
        turns = step * np.floor(angle / step) / math.tau
        return {**c, "angle": turns, "iq": torque / CONSTANT}

    told = " ".join(text for _, text in checked(tmp_path, halting))
    assert ("the encoder is stuck" in told) == frozen


def test_a_load_is_no_mistake_of_units(tmp_path):
    """Eight times the stated inertia may be a load: said, not refused."""
    motor = MOTOR.replace(f"inertia = {INERTIA}", f"inertia = {INERTIA / 8.0}")
    found = checked(tmp_path, motor=motor)
    assert [level for level, _ in found] == ["suspicious"]
    assert "8 times the stated" in found[0][1]
    assert "a load or a gear" in found[0][1]


SPEED = {
    "t": {"column": "t"},
    "theta": {"column": "angle", "unit": "rev", "mechanical": True},
    "i_q": {"column": "iq"},
    "speed": {"column": "speed", "unit": "rev/s", "mechanical": True},
}


def test_a_speed_and_an_angle_that_disagree_are_told(tmp_path):
    """A gear of 5 before the angle's sensor; the speed is the motor's.  No inertia is stated."""
    motor = MOTOR.replace(f"inertia = {INERTIA}\n", "")
    found = checked(tmp_path, times(angle=0.2), SPEED, motor, ("speed",))
    assert any("'angle' turns 0.2 times as fast as 'speed' says" in text for _, text in found)
    assert checked(tmp_path, columns=SPEED, motor=motor, also=("speed",)) == []


def test_the_back_emf_tells_a_gear(tmp_path):
    columns = {n: c for n, c in SPEED.items() if n != "speed"} | {
        "u_q": {"column": "uq"},
        "u_d": {"value": 0.0},
        "i_d": {"value": 0.0},
        "u_dc": {"value": 24.0},
    }
    motor = MOTOR + "inductance_d = 1e-5\ninductance_q = 1e-5\n"
    assert [
        level for level, _ in checked(tmp_path, columns=columns, motor=motor, also=("uq",))
    ] == []
    found = checked(tmp_path, times(angle=1.0 / 3.0), columns, motor, ("uq",))
    assert any("a gear of about 3 stands between motor and 'angle'" in text for _, text in found), (
        found
    )


@pytest.mark.parametrize("gear", [-5.0, 3.7, 1.0 / 3.0])
def test_the_motors_speed_tells_a_gear_of_any_ratio(tmp_path, gear):
    found = checked(tmp_path, times(angle=1.0 / gear), SPEED, also=("speed",))
    words = f"a gear of about {abs(gear):.3g} stands between motor and 'angle'"
    assert any(words in text and f"scale = {gear:.3g}" in text for _, text in found), found


@pytest.mark.parametrize(("counts", "also"), [(8192.0, ()), (-4096.0, ()), (10000.0, ("speed",))])
def test_a_position_in_counts_is_told_with_those_that_encoders_have(tmp_path, counts, also):
    """By the stated inertia, which is some per cent off; by the speed where there is one."""
    columns = {n: c for n, c in SPEED.items() if n != "speed" or also}
    found = checked(tmp_path, times(angle=counts), columns, also=also)
    words = f'unit = "rev" and scale = {"-" if counts < 0 else ""}1/{abs(counts):.0f}'
    assert any("in counts of an encoder" in x and words in x for _, x in found), found


def wrapped(size):
    return lambda c: c | {"angle": (c["angle"] * size) % size}


@pytest.mark.parametrize(("size", "words"), [(360.0, 'unit = "deg"'), (4096.0, "scale = 1/4096")])
def test_an_angle_that_wraps_at_no_turn_is_refused(tmp_path, size, words):
    found = checked(tmp_path, wrapped(size))
    assert any(words in text for level, text in found if level == "refused"), found


def every(k):
    """Rows so far apart that the shaft turns by up to 0.7 of a turn between two."""
    return lambda c: {n: (x % 1.0 if n == "angle" else x)[::k] for n, x in c.items()}


def test_an_angle_that_turns_too_far_between_rows_is_refused_or_follows_the_speed(tmp_path):
    far = every(30)
    found = checked(tmp_path, far)
    assert any(
        "can be followed up to a third" in text for level, text in found if level == "refused"
    ), found
    found = checked(tmp_path, far, SPEED, also=("speed",))
    assert [level for level, _ in found] == ["note", "note"]
    assert "follows the log's speed" in found[0][1]


def test_a_speed_stands_in_for_an_angle_that_is_not_there(tmp_path):
    columns = {n: c for n, c in SPEED.items() if n != "theta"}
    found = checked(tmp_path, columns=columns, also=("speed",))
    assert all(level == "note" for level, _ in found), found
    assert "the angle is made from 'speed'" in found[0][1]


def with_stamps(change):
    return lambda c: c | {"t": change(c["t"])}


@pytest.mark.parametrize(
    ("change", "words", "level"),
    [
        (
            lambda t: np.where(np.arange(len(t)) == 600, 1e6, t),
            "stamps that belong nowhere are left out",
            "suspicious",
        ),
        (
            lambda t: np.where(np.arange(len(t)) >= 1200, t - t[1200], t),
            "the clock begins again",
            "suspicious",
        ),
        (
            lambda t: np.where(np.arange(len(t)) >= 1200, t + 3.0, t),
            "a pause in column 't'",
            "note",
        ),
        (lambda t: np.floor(t / 0.01) * 0.01, "give it enough digits", "refused"),
    ],
)
def test_a_clock_that_jumps_loses_no_more_rows_than_it_must(tmp_path, change, words, level):
    found = checked(tmp_path, with_stamps(change))
    assert any(words in text and at == level for at, text in found), found
    assert not any(
        "rows in shorter" in text and ", 0 of 2500 rows" not in text for _, text in found
    )


def test_the_same_motion_twice_is_counted_once(tmp_path):
    checked(tmp_path)
    (tmp_path / "r2.csv").write_text((tmp_path / "r1.csv").read_text())
    found = check(tmp_path, columns=tmp_path / "map.toml", effects=False)
    assert any("all rows are those of r1.csv" in text for text in found.mistakes)


def test_poles_for_pole_pairs_where_the_angle_is_electrical(tmp_path):
    """Torque by magnet_flux doubles, the shaft's angle halves: four times the inertia, and the
    back-EMF agrees."""
    columns = {
        "t": {"column": "t"},
        "theta": {"column": "angle", "unit": "rev"},
        "i_q": {"column": "iq"},
    }
    motor = MOTOR.replace(f"pole_pairs = {PAIRS}", f"pole_pairs = {2 * PAIRS}")
    motor = motor.replace(f"inertia = {INERTIA}", f"inertia = {0.9 * INERTIA}")
    found = checked(tmp_path, times(angle=PAIRS), columns, motor)
    assert any("pole_pairs counts poles (halve it in [motor])" in text for _, text in found), found


def test_currents_per_unit_of_the_rated_one(tmp_path):
    found = checked(tmp_path, times(iq=1.0 / 40.0), motor=MOTOR + "rated_current = 40.0\n")
    assert any(
        "'iq' is per unit of rated_current (map it with scale = 40)" in text for _, text in found
    ), found
