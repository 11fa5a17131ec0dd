"""Checks of the kind "outside": every subsystem in turn, sizes that show, and old seeds that draw
what they drew."""

import hashlib
import json
import math

import numpy as np
import pytest

from model.effects.card import PORTS, SUBSYSTEMS
from model.effects.library import causes, load_effect, parameters
from model.errors import BadInput
from sandbox.switched.unlisted import UNLISTED, unlisted
from sandbox.withheld.making import draw as drawing
from sandbox.withheld.making.case_list import Case, cases
from sandbox.withheld.making.cycles import scale_of
from sandbox.withheld.making.draw import draw, outside_names
from sandbox.withheld.making.drives import FAMILIES, family_drive
from sandbox.withheld.making.effect_sizes import EFFECT_SIZES
from sandbox.withheld.making.make import switched
from sandbox.withheld.making.mapped_drive import FLUX_MAP
from sandbox.withheld.making.outside_causes import EVERY, MORE, OUTSIDE, SOURCES, TURNS

RNG = np.random.default_rng(0)
NOISE = 0.0018  # of rated current: drives are drawn with 0.001 to 0.0032, evenly in its logarithm
# kind, campaigns, seed, sizes -> what the seal of old seeds holds (SHA-256 of the sorted text),
# before MORE
OLD = {
    ("mixed", 20, 20261251, "published"): "0b539b6cece731a9",
    ("many", 4, 20261271, "published"): "35a5df1467d86ddf",
    ("controls", 3, 20261252, "published"): "492e5e12a7fa6369",
    ("pairs", 5, 20261223, "published"): "f2fc01c3245931f1",
    ("mixed", 20, 20261224, "ladder"): "afdacc9de40c9b60",
}


def planted(name, family, size=1.0):
    """Return a family's drive and what a cause outside the library changes on its bench."""
    drive = family_drive(family)
    return drive, EVERY[name].planted(drive, size, RNG).bench


@pytest.mark.parametrize("check", OLD, ids=lambda c: f"{c[0]}-{c[3]}")
def test_old_seeds_draw_what_they_drew(check):
    kind, count, seed, sizes = check
    truths = [
        draw(c, seed).sealed() for c in cases(count, seed, kind, "scored", list(OUTSIDE), sizes)
    ]
    assert (
        hashlib.sha256(json.dumps(truths, sort_keys=True).encode())
        .hexdigest()
        .startswith(OLD[check])
    )


def test_every_subsystem_has_three_causes_at_least():
    found = [one.subsystem for one in EVERY.values()]
    assert all(found.count(s) >= 3 for s in SUBSYSTEMS)
    assert set(SOURCES) == set(MORE)
    assert not set(EVERY) & {*causes(), *(p.partition(".")[2] for p in parameters())}


@pytest.mark.parametrize("name", MORE)
@pytest.mark.parametrize("family", FAMILIES)
def test_the_bench_takes_every_size(name, family):
    """Also behind a shaft that leaves the load the least inertia that is published."""
    for size in EFFECT_SIZES:
        drawn = draw(
            Case(0, "outside", family, "scored", ("shaft_compliance",), (2.0, size), name), 3
        )
        values = EVERY[name].planted(drawn.true, size, RNG).bench
        assert set(values) == set(drawn.own) <= set(UNLISTED)
        b = unlisted(switched(drawn), drawn.own)
        least = load_share() * drawn.true.motor.inertia
        assert unlisted(b._replace(load_inertia=least), values).load_inertia == least


def load_share():
    """Return the least share of all inertia that a load behind a shaft is drawn with."""
    from sandbox.withheld.making.published import table

    return table()["shaft_compliance"]["load_inertia"].range[0]


def test_campaigns_come_from_every_subsystem_and_cause_alike():
    """48 with a flux map: twelve of each subsystem, within one campaign the same number of each
    cause of it."""
    names = [*EVERY, FLUX_MAP]
    found = cases(48, 7, "outside", "scored", names)
    of = [drawing.outside_subsystem(c.outside) for c in found]
    assert {s: of.count(s) for s in SUBSYSTEMS} == dict.fromkeys(SUBSYSTEMS, 12)
    counts = {n: [c.outside for c in found].count(n) for n in names}
    for s in SUBSYSTEMS:
        own = [counts[n] for n in names if drawing.outside_subsystem(n) == s]
        assert max(own) - min(own) <= 1
    assert {c.kind for c in found} == {"outside"}
    assert {c.family for c in found} == {*FAMILIES, "mapped"}
    assert all((c.family == "mapped") == (c.outside == FLUX_MAP) for c in found)
    assert {c.sizes[-1] for c in found} == set(EFFECT_SIZES)
    beside = [c for c in found if c.names]
    assert 13 <= len(beside) <= 16  # every third, but no drive with a flux map
    assert {len(c.names) for c in beside} == {1}
    assert len({c.names for c in beside}) == len(beside)
    assert FLUX_MAP not in {c.outside for c in beside}
    assert [c.outside for c in cases(48, 8, "outside", "scored", names)] != [
        c.outside for c in found
    ]
    with pytest.raises(BadInput, match="unknown kind of check 'outsid'"):
        cases(4, 7, "outsid", "scored")


def test_kinds_draw_from_their_own_causes(monkeypatch):
    monkeypatch.setattr(drawing, "missing", lambda: "not here")
    assert outside_names() == outside_names("mixed") == list(OUTSIDE)
    assert outside_names("outside") == list(EVERY)
    assert {c.outside for c in cases(60, 1, "outside", "scored")} == set(EVERY)


def test_many_are_four_to_ten_in_turn_and_none_contains_another():
    """Issue 19: `--kind many` draws 4 to 10 effects.  70 campaigns hold each number ten times."""
    found = [c.names for c in cases(70, 3, "many", "scored", table="published")]
    assert sorted(len(names) for names in found) == sorted(10 * list(range(4, 11)))
    assert all(len(set(names)) == len(names) for names in found)
    assert not any({"saturation", "cross_saturation"} <= set(names) for names in found)
    assert {e for names in found for e in names} == set(causes())


def test_an_effect_beside_a_cause_is_sealed_with_it():
    """Sizes in the order of `effects`; the effect has a place in its published range, the cause
    none."""
    case = Case(
        0, "outside", "ipm", "scored", ("dead_time",), (0.5, 2.0), "load_lag", table="published"
    )
    drawn = draw(case, 3)
    truth = drawn.sealed()
    assert truth["effects"] == ["dead_time", "unknown"]
    assert (truth["outside"], truth["outside_subsystem"]) == ("load_lag", "mechanics")
    assert truth["places"] == [0.5]
    assert truth["sizes"][1] == 2.0
    assert set(truth["parameters"]) == {"dead_time.time"}
    assert truth["outside_parameters"] == {"load_lag": 0.04}
    b = switched(drawn)
    assert (b.load_lag, b.dead_time) == (0.04, drawn.plant["dead_time.time"])
    out = draw(case, 3, ("dead_time",))  # the effect taken out, the cause stays
    assert (out.case.names, out.sizes, out.own) == ((), (2.0,), {"load_lag": 0.04})
    assert out.plant["dead_time.time"] == pytest.approx(drawn.bench.dead_time)
    listed = [c for c in cases(48, 7, "outside", "scored", table="published") if c.names]
    assert all(0.25 <= c.sizes[0] <= 1.0 and c.sizes[1] in EFFECT_SIZES for c in listed)


@pytest.mark.parametrize("family", FAMILIES)
def test_medium_sizes_show_in_single_samples(family):
    """Amplitudes in closed form beside noise (of the middle of its range) and counts of a single
    reading.

    one_by_one: phase c is read 2 lags late at a current's slope of omega phi_m / L_q (no voltage,
    no current), omega four fifths of the speed that cycles use;
    sensor_memory: remanence x radius;
    crank: omega swings by half of what J does, so the angle by crank / (4 J) at any speed;
    lobe: angle by n^2 lobe / (J omega^2), n the least, at half the usable speed;
    load_lag: after a step of half rated torque and one lag, the speed is off by lag T (1 - 1/e) /
    J, for one lag more.
    """
    drive, motor = family_drive(family), family_drive(family).motor
    speed = scale_of(drive).speed / motor.pole_pairs
    current = math.hypot(NOISE, 0.002 / math.sqrt(12.0)) * motor.rated_current
    angle = 2.0 * math.pi / 4096 / math.sqrt(12.0)
    value = {name: planted(name, family)[1] for name in MORE}
    slope = motor.pole_pairs * 0.8 * speed * motor.magnet_flux / motor.inductance_q
    memory, lobe, lag = value["sensor_memory"], value["lobe"], value["load_lag"]["load_lag"]
    assert 2.0 * value["one_by_one"]["channel_lag"] * slope > 2.5 * current
    assert memory["remanence"] * memory["remanence_radius"] > 3.0 * current
    assert value["crank"]["crank"] / (4.0 * motor.inertia) > 20.0 * angle
    assert TURNS[0] ** 2 * lobe["lobe"] / (motor.inertia * (0.5 * speed) ** 2) > 20.0 * angle
    off = lag * 0.5 * motor.rated_torque * (1.0 - math.exp(-1.0)) / motor.inertia
    assert off * lag > 20.0 * angle


def test_no_effect_of_the_library_describes_them():
    """It would take a torque less than once a turn, a memory of the load or of a sensor; phases
    read one after another are described since 2026-12-01 (`channel_lag`), and stay where seeds
    draw them."""
    assert load_effect("cogging_torque").parameters[1].low == 1.0  # lobe: 1/6 to 1/2.3 of it
    turns = [planted("lobe", "ipm")[1]["lobe_turns"] for _ in range(50)]
    assert min(turns) > 2.0
    sensors = {
        p.name for e in ("current_sampling", "current_filter") for p in load_effect(e).parameters
    }
    assert sensors == {"delay", "channel_lag", "jitter", "time_constant"}
    # no torque or inertia to change
    found = {"load": ("omega",), "torque": ("turn", "omega"), "friction": ("omega",)}
    assert {k: PORTS[k].quantities for k in found} == found


@pytest.mark.parametrize("name", MORE)
def test_neutral_is_the_bench_without(name):
    b = switched(draw(Case(0, "none", "ipm", "scored"), 3))
    _, values = planted(name, "ipm")
    assert unlisted(b, dict.fromkeys(values, 0.0)) == b
