"""A simulated shaft's inertia, frictions and cogging are found from angle and current on uneven
stamps; what the motion cannot tell is said; nothing electrical is claimed."""

import dataclasses
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from model.effect_files import effects_of
from model.effects.said import quantity
from model.errors import BadInput
from sandbox import diagnose
from sandbox.cli import main
from sandbox.gap.motion.judging import judge
from sandbox.gap.motion.telling import document, parameters, refitted, sentences, todo, verdict
from sandbox.gap.motion.torques import numbers
from sandbox.recordings.angle.changes import at_changes
from sandbox.recordings.angle.commutation import STEP, between
from sandbox.recordings.importing import source_of
from sandbox.recordings.motion_log import MotionRecording, by_changes, read_motion
from tests.sandbox.gap.motion.shafts import (
    CONSTANT,
    COUNT,
    INERTIA,
    ORDERS,
    both_ways,
    campaign,
    shaft,
)

ROOT = Path(__file__).resolve().parents[4]


def one_way(t):
    return 5.0 + 2.0 * np.sin(3.0 * t)


@pytest.fixture(scope="module")
def planted():
    """Three runs of a shaft with friction, three orders of cogging, another inertia than stated and
    late readings."""
    true = {"inertia": 2.6e-4, "dry": 0.008, "viscous": 6e-4, "orders": tuple(ORDERS), "lag": 0.02}
    return judge(campaign(*(shaft(k, both_ways, **true) for k in range(3))))


def test_what_was_planted_is_found(planted):
    assert set(planted.best.effects) == {
        "coulomb_friction",
        "cogging_torque",
        "viscous_friction",
        "inertia",
        "current_filter",
    }
    assert verdict(planted) == "explained"
    s = planted.best.shaft
    assert set(s.terms.orders) == set(ORDERS)
    true = {"inertia": 2.6e-4, "dry": 0.008, "viscous": 6e-4, "lag": 0.02}
    # 4 deviations: one in 10 000 by chance.  5 % besides: noise of the current's slope, 0.02 A /
    # 4.5 ms x sqrt(2 / 24 samples) against 0.4 A x 40 rad/s of cogging, pulls the lag by its
    # square, 1 %; friction's edge lies in windows
    for name, value in true.items():
        low, high = s.ci95(name)
        assert abs(s.value(name) - value) < 2.0 * (high - low) / 2.0 + 0.05 * value, name
    for n, (size, phase) in ORDERS.items():
        found, sd, angle, turn = s.amplitude(n)
        assert abs(found - size) < 4.0 * sd + 0.05 * size, n
        assert abs(math.remainder(angle - phase, math.tau)) < 4.0 * turn + 0.02, n


def test_the_shaft_is_a_file_for_the_simulator(planted, tmp_path):
    """Every order, inertia and friction stand in effects.toml; a late log is no part of the
    drive."""
    refitted(planted).write(tmp_path)
    assert not (tmp_path / "motor.toml").exists()
    found = effects_of(tmp_path / "effects.toml")
    names = [f"cogging_torque.{k}order_mech" for k in ("", "2.", "3.")]
    assert sorted(found[name] for name in names) == sorted(ORDERS)
    s = planted.best.shaft
    assert found["inertia.inertia"] == s.value("inertia")
    assert found["coulomb_friction.torque"] == s.value("dry")
    assert not [name for name in found if name.startswith("current_filter")]


PAIRS = 7  # 42 states a turn


def by_states(r, off=0.0):
    """The same run, its angle drawn through sixths of an electrical turn, the changes at `off`
    beside whole sixths."""
    sectors = np.floor((PAIRS * r.angle - off) / STEP)
    drawn = between(sectors - sectors[0]) + STEP * sectors[0] + off
    return dataclasses.replace(r, angle=drawn / PAIRS, sixth=STEP / PAIRS, zero=off / PAIRS)


def test_a_motion_that_pauses_has_the_angle_of_each_of_its_parts(tmp_path):
    """States of two runs in one file, the rotor turned on by hand between them: as in files of
    their own."""
    toml = (
        '[columns]\nhall = {column = "h"}\nt = {column = "t"}\ni_q = {column = '
        '"i"}\n[motor]\npole_pairs = 7\n'
    )
    toml += "magnet_flux = 0.005\ninertia = 2e-4\n"
    t = np.arange(900) * 2e-3
    order = np.array([1, 3, 2, 6, 4, 5])
    runs = [0.3 + 50.0 * t, 2.9 - 40.0 * t - 3.0 * t**2]  # rad electrical
    tables = [
        np.stack([t + 9.0 * k, order[np.floor(a / STEP).astype(int) % 6], 0.1 * t], axis=1)
        for k, a in enumerate(runs)
    ]
    for name, rows in (("both", np.concatenate(tables)), ("a", tables[0]), ("b", tables[1])):
        np.savetxt(
            tmp_path / f"{name}.csv", rows, delimiter=",", header="t,h,i", comments="", fmt="%.9g"
        )

    def read(*files):
        text = toml + "".join(f'[[recording]]\nfile = "{f}.csv"\nrotor = "free"\n' for f in files)
        (tmp_path / "c.toml").write_text(text)
        return read_motion(source_of(tmp_path, tmp_path / "c.toml"), "no voltages").recordings

    for together, alone in zip(read("both"), read("a", "b"), strict=True):
        np.testing.assert_allclose(np.diff(together.t), np.diff(alone.t), atol=1e-9)
        np.testing.assert_allclose(together.angle, alone.angle, atol=1e-9)


def test_a_motion_told_by_states_is_judged_at_their_changes():
    """Between changes the angle is a drawing with accelerations of its own: of all rows the inertia
    was a tenth.

    Windows of 24 changes last 0.4 s and more here, in which the speed bends: inertia and friction
    come out 2 to 5 % small on nine runs, and 3 % of the friction as a viscous one. Without effects
    none was named on nine runs.
    """
    true = {"inertia": 2.6e-4, "dry": 0.008}
    runs = [by_states(shaft(k, both_ways, **true), 0.3) for k in range(3)]
    told = by_changes(campaign(*runs))
    assert all(len(r.t) < 400 for r in told.recordings)
    found = judge(told)
    assert set(found.best.effects) >= {"coulomb_friction", "inertia"}
    assert found.best.shaft.value("inertia") == pytest.approx(2.6e-4, rel=0.08)
    assert found.best.shaft.value("dry") == pytest.approx(0.008, rel=0.08)
    assert judge(campaign(*runs)).best.shaft.value("inertia") < 0.5 * 2.6e-4
    assert "log an encoder's angle" in found.cannot["cogging_torque"]
    none = judge(by_changes(campaign(*(by_states(shaft(k, both_ways)) for k in range(3)))))
    assert none.best.effects == ()
    assert verdict(none) == "no_gap"
    short = by_states(shaft(0, lambda t: 0.1 + 0.0 * t, seconds=1.0))
    with pytest.raises(BadInput, match=r"the states change \d+ times, a motion takes"):
        by_changes(campaign(short))


def test_torques_are_averaged_over_the_rows_nearest_to_a_change():
    """Steps of a sixth every 10 rows: means of a ramp are its values half way; nothing changes,
    nothing is left."""
    t, angle = np.arange(100.0), (np.arange(100) + 0.5) / 10.0
    at, place, own = at_changes(t, angle, {"x": t}, 1.0, 0.0)
    np.testing.assert_allclose(at, np.arange(9.5, 95.0, 10.0))
    np.testing.assert_allclose(place, np.arange(1.0, 10.0))
    np.testing.assert_allclose(own["x"][1:-1], at[1:-1])
    assert [len(x) for x in at_changes(t, 0.0 * t, {"x": t}, 1.0, 0.0)[:2]] == [0, 0]


def test_each_named_effect_says_what_to_do(planted):
    """Dry torque over torque constant is a current; the largest share first; JSON and sentences
    agree."""
    said = todo(planted)
    shares = [planted.shares[e] for e in said]
    assert shares == sorted(shares, reverse=True)
    assert set(said) == set(planted.best.effects)
    s = planted.best.shaft
    current = quantity(s.value("dry") / CONSTANT, "A")
    assert (
        f" (about {current} on q) to the torque's reference in the sense of rotation"
        in said["coulomb_friction"]
    )
    assert all(f"sin({n} x" in said["cogging_torque"] for n in ORDERS)
    assert f"set inertia = {quantity(s.value('inertia'), 'kg m^2', 3)}" in said["inertia"]
    assert {e["name"]: e["do"] for e in document(planted)["effects"] if e["do"]} == said
    assert next(t for head, t in sentences(planted) if head == "Do?").endswith(
        f"{next(iter(said.values()))}."
    )
    own = dataclasses.replace(planted.campaign, torque_constant=None, stated={"inertia": 2e-4})
    of_torque = dataclasses.replace(planted, campaign=own)
    assert "on q" not in todo(of_torque)["coulomb_friction"]
    assert all(row["current"] is None for row in document(of_torque)["motion"]["orders"])


@pytest.mark.parametrize("motor", ["", "[motor]\n", "[motor]\ninertia = 2e-4\n"])
def test_a_recorded_torque_needs_no_motor_and_is_told_as_no_current(tmp_path, motor):
    """Whatever [motor] holds: no sentence and no number tells a current that nobody stated."""
    r = shaft(0, both_ways, dry=0.008, orders=(7,))
    rows = np.stack([r.t, r.angle, r.torque], axis=1)
    np.savetxt(
        tmp_path / "run.csv", rows, delimiter=",", header="t,angle,nm", comments="", fmt="%.9g"
    )
    text = '[columns]\nt = "t"\ntheta = {column = "angle", mechanical = true}\ntorque = "nm"\n'
    (tmp_path / "map.toml").write_text(
        text + motor + '[[recording]]\nfile = "run.csv"\nrotor = "free"\n'
    )
    found = diagnose(tmp_path, columns=tmp_path / "map.toml")
    answer = found.as_json()
    assert answer["motion"]["torque_constant"] is None
    assert {e for h in answer["hypotheses"][:1] for e in h["effects"]} >= {
        "coulomb_friction",
        "cogging_torque",
    }
    assert all(row["current"] is None for row in answer["motion"]["orders"])
    assert "on q)" not in " ".join(e["do"] or "" for e in answer["effects"])


def test_the_gap_is_closed_on_runs_held_out_and_shared(planted):
    answer = document(planted)
    assert [r["held_out"] for r in answer["gap"]["recordings"]] == [False, False, True]
    assert answer["gap"]["closed"] > 0.95
    assert sum(planted.shares.values()) == pytest.approx(1.0)
    assert sum(h["probability"] for h in answer["hypotheses"]) <= 1.0 + 1e-9
    assert all(
        h["name"] in ("inertia", "current_filter")
        or "friction" in h["name"]
        or h["name"] == "cogging_torque"
        for h in answer["effects"]
    )
    json.dumps(answer, allow_nan=False)
    listed = [e["name"] for e in answer["effects"]]  # ties stand alike in every process
    by_chance = sorted(
        numbers(), key=lambda e: (-round(planted.inclusion(e), 3), -planted.shares.get(e, 0.0))
    )
    assert listed == by_chance
    lead = parameters(planted, planted.best)["cogging_torque.order_mech"]
    assert lead["value"] == 7  # the largest of the three


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_claimed_where_nothing_was_planted(seed):
    found = judge(campaign(*(shaft(10 * seed + k, both_ways, seconds=4.0) for k in range(2))))
    assert found.best.effects == ()
    assert verdict(found) == "no_gap"


def test_one_way_motion_cannot_tell_friction_from_an_offset():
    found = judge(campaign(shaft(0, one_way, dry=0.008), shaft(1, one_way, dry=0.008)))
    assert "coulomb_friction" in found.cannot
    assert not any("coulomb_friction" in w.effects for w in found.weighed)
    assert document(found)["next_recording"]["description"] == "record the same backwards"


def test_an_inertia_that_is_not_stated_is_estimated():
    found = judge(campaign(shaft(0, both_ways), shaft(1, both_ways), inertia=None))
    low, high = found.best.shaft.ci95("inertia")
    assert (
        abs(found.best.shaft.value("inertia") - INERTIA) < 2.0 * (high - low) / 2.0 + 0.02 * INERTIA
    )
    assert "no inertia is stated" in found.cannot["inertia"]


def test_a_wrong_unit_is_refused_without_a_warning():
    r = shaft(0, both_ways, seconds=1.0)
    fast = MotionRecording("fast", 1e-12 * r.t, r.angle, r.torque, r.load)  # stamps in Ts
    with pytest.raises(BadInput, match="check the units of t, theta and i_q"):
        judge(campaign(fast))


def test_short_and_standing_stretches_do_not_decide():
    """A rotor that is held and readings that do not change scatter by nothing: they say no more
    than the rest."""
    run = shaft(1, both_ways, dry=0.008, orders=(7,))
    t = 100.0 + 2e-3 * np.arange(64)
    held = [MotionRecording(f"held{k}", t, 0 * t + 0.3, 0 * t + 0.005 * k, 0 * t) for k in range(6)]
    alone, beside = judge(campaign(run)), judge(campaign(run, *held))
    # 0.03 N m of held torque over 0.02 A x 0.05 N m / A
    assert max(beside.nominal_nrmse, beside.before, beside.after) < 1e3
    size, both = alone.best.shaft.value("dry"), beside.best.shaft.value("dry")
    # as far as six of some 250 windows that are outliers move it
    assert both == pytest.approx(size, rel=0.25)


def test_a_friction_that_would_drive_is_not_named():
    """A current of reversed sign: every torque seems to push, and it is said."""
    run = shaft(2, both_ways, dry=0.008, viscous=6e-4)
    found = judge(campaign(dataclasses.replace(run, torque=-run.torque)))
    assert not {"coulomb_friction", "viscous_friction"} & set(found.best.effects)
    assert "sign is reversed" in found.cannot["coulomb_friction"]


def test_exclude_and_a_rotor_that_stands():
    still = MotionRecording(
        "still", np.arange(200) * 2e-3, np.zeros(200), np.zeros(200), np.zeros(200)
    )
    with pytest.raises(BadInput, match="the rotor turns by 0 rad"):
        judge(campaign(still))
    with pytest.raises(BadInput, match="unknown effect 'friction'"):
        judge(campaign(still), ["friction"])


USERS = """
import json, sys
from model.effects.adopt import adopt
adopt(sys.argv[1])
from sandbox.gap.motion.judging import judge
from sandbox.gap.motion.telling import document, refitted
from tests.sandbox.gap.motion.shafts import both_ways, campaign, shaft
found = judge(campaign(*(shaft(k, both_ways, dry=0.008, fan=4e-4, seconds=4.0) for k in range(2))))
told = document(found)
print(json.dumps([told["hypotheses"][0], told["where"], found.cannot, refitted(found).effects]))
"""
BENT = """

@inlined
def square(size, omega):
    return size * size * omega


OWN = (replace(FAN.parameters[0], name="size"),)
EFFECTS = (FAN, RESOLVER, replace(FAN, name="bent", parameters=OWN, at=(At("friction", square, ("size",)),)))
"""  # noqa: E501


def test_a_users_torque_is_a_candidate(tmp_path):
    """The example's fan, 4e-4 N m s^2/rad^2 (0.03 N m at the runs' 9 rad/s, 30 times the current's
    noise), is found beside dry friction; a torque by the square of its number is told to be none; a
    resolver is electrical."""
    mine = tmp_path / "mine.py"
    mine.write_text(
        "from dataclasses import replace\n"
        + (ROOT / "experiments" / "my_effects.py").read_text()
        + BENT
    )
    call = [sys.executable, "-c", USERS, str(mine)]
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    first, where, cannot, effects = json.loads(done.stdout)
    assert set(first["effects"]) == {"coulomb_friction", "fan"}
    fan = first["parameters"]["fan.coefficient"]
    low, high = fan["ci95"]
    # twice the interval: one in 10 000 by chance; 5 % besides, as for what was planted above
    assert abs(fan["value"] - 4e-4) < 2.0 * (high - low) / 2.0 + 0.05 * 4e-4
    assert fan["unit"] == "N m s^2/rad^2"
    assert effects["fan.coefficient"] == fan["value"]
    assert "a fan on the shaft: torque by the square of speed" in {
        w["text"].partition(" (")[0] for w in where
    }
    assert {w["subsystem"] for w in where} == {"mechanics"}
    assert "not proportional to one number" in cannot["bent"]
    assert "resolver" not in cannot


MAP = """
[columns]
t = "t"
theta = {column = "count", scale = 7.66990393942820614e-4, mechanical = true}
i_q = "iq"
[motor]
torque_constant = 0.05
inertia = 2e-4
[drive]
encoder_counts = 8192
[[recording]]
file = "run.csv"
rotor = "free"
"""


def _written(folder, r, more=""):
    rows = np.stack([r.t, r.angle / COUNT, r.torque / CONSTANT], axis=1)
    np.savetxt(
        folder / "run.csv", rows, delimiter=",", header="t,count,iq", comments="", fmt="%.9g"
    )
    (folder / "map.toml").write_text(MAP + more)
    return folder / "map.toml"


def test_a_folder_without_voltages_goes_through_the_command(tmp_path, capsys):
    columns = _written(tmp_path, shaft(0, both_ways, dry=0.008, orders=(7,)))
    assert (
        main(["diagnose", str(tmp_path), "--columns", str(columns), "--out", str(tmp_path / "o")])
        == 0
    )
    said = capsys.readouterr().out
    assert "motion only" in said
    assert "Not judged: no column is a commanded voltage, so electrical effects are no" in said
    answer = json.loads((tmp_path / "o" / "diagnosis.json").read_text())
    assert answer["command"] == "diagnose"
    assert set(answer["hypotheses"][0]["effects"]) == {"coulomb_friction", "cogging_torque"}
    assert "no column is a commanded voltage" in (tmp_path / "o" / "report.html").read_text()
    found = diagnose(tmp_path, columns=columns, exclude="coulomb_friction")
    assert "coulomb_friction" not in found.motion.best.effects
    assert "motion only" in repr(found)


def test_what_a_motion_lacks_is_named(tmp_path):
    columns = _written(tmp_path, shaft(0, both_ways, seconds=1.0))
    whole = columns.read_text()
    for old, new, message in [
        ("torque_constant = 0.05\n", "", "says no torque of a current; add torque_constant"),
        ('i_q = "iq"\n', "", "neither voltages nor i_q nor torque"),
        ('t = "t"\n', 't = {column = "t", scale = 0.0}\n', "scale = 0.0 would erase"),
        (
            "torque_constant = 0.05",
            "torque_constant = true",
            "torque_constant = true is out of range",
        ),
        ('rotor = "free"', 'rotor = "locked"', "no recording has rotor = 'free'"),
        (", mechanical = true", "", r"\[motor\] lacks 'pole_pairs'"),
    ]:
        columns.write_text(whole.replace(old, new))
        with pytest.raises(BadInput, match=message):
            diagnose(tmp_path, columns=columns)


def test_a_slow_log_keeps_its_motion(tmp_path):
    """Rows 2 ms apart, L/R = 0.5 ms, voltages recorded: the electrical part is refused in a
    sentence, nothing warns."""
    r = shaft(0, both_ways, dry=0.008, orders=(7,))
    t = np.arange(r.t[0], r.t[-1], 2e-3)
    theta, current = (np.interp(t, r.t, x) for x in (7 * r.angle, r.torque / CONSTANT))
    rows = np.stack([t, theta, current, 0 * t, 0.1 * current, 0 * t], axis=1)
    np.savetxt(
        tmp_path / "run.csv",
        rows,
        delimiter=",",
        header="t,theta,i_q,i_d,u_q,u_d",
        comments="",
        fmt="%.12g",
    )
    motor = {
        "pole_pairs": 7,
        "resistance": 0.1,
        "inductance_d": 5e-5,
        "inductance_q": 5e-5,
        "inertia": INERTIA,
    }
    text = "[columns]\n[drive]\nsampling_period = 0.002\ndc_bus_voltage = 24.0\n[motor]\n"
    text += "".join(f"{k} = {v}\n" for k, v in {**motor, "magnet_flux": CONSTANT / 1.5 / 7}.items())
    (tmp_path / "map.toml").write_text(text + '[[recording]]\nfile = "run.csv"\nrotor = "free"\n')
    found = diagnose(tmp_path, columns=tmp_path / "map.toml")
    assert set(found.motion.best.effects) >= {"coulomb_friction", "cogging_torque"}
    said = found.as_json()["motion"]["electrical"]
    assert said.startswith("sampling_period = 0.002 s is beyond L/R = 0.0005 s: between")
    small = (tmp_path / "map.toml").read_text().replace("5e-05", "5e-08")
    (tmp_path / "map.toml").write_text(small)
    why = diagnose(tmp_path, columns=tmp_path / "map.toml").as_json()["motion"]["electrical"]
    asked = "hardly a motor has so short a one: are the inductances in H, the resistance in ohm?"
    assert f"L/R = 5e-07 s ({asked}): between" in why
