"""Withheld campaigns: sealed before recorded, the same from the same seed, true where the truth is
known."""

import dataclasses
import hashlib
import json
import math
import tomllib
from functools import cache

import numpy as np
import pytest

from model.effects.card import SUBSYSTEMS
from model.effects.library import causes
from model.errors import BadInput
from sandbox.gap.evidence.fit import coordinates_of
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.gap.evidence.priors import ordinary
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import read_folder
from sandbox.replay.replay import prepare, replay, residuals
from sandbox.withheld.making import make as maker
from sandbox.withheld.making.case_list import PAIR_SIZES, SHARES, Case, cases
from sandbox.withheld.making.cycle_styles import STYLES, cycles
from sandbox.withheld.making.cycles_narrow import PAIRS
from sandbox.withheld.making.draw import draw
from sandbox.withheld.making.drives import DRAWN, FAMILIES, VALID_TO, draw_bench, family_drive
from sandbox.withheld.making.effect_sizes import EFFECT_SIZES
from sandbox.withheld.making.make import CheckPlan, campaign_of, make
from sandbox.withheld.making.outside_causes import EVERY, OUTSIDE
from tests.sandbox.withheld.known import true_set

FILES = {
    "locked_d",
    "locked_q_inject_d",
    "locked_q_inject_q",
    "locked_steps",
    "locked_low_current",
    "run_slow",
}
FILES |= {"run_fast", "reversal", "coast_down", "driven_grid", "driven_grid_slow", "driven_idle"}
SHORT = 0.3  # of the usual length
SHORTER = 0.1  # 1400 readings or more: an rms within 5/sqrt(2 * 1400) = 0.1


def misses(drawn, share=SHORT):
    """Return rms residual over the floor by recording (current, then motion) at the truth."""
    campaign = campaign_of(drawn, share)
    values = true_set(drawn, campaign)
    prepared = prepare(campaign, values)
    found = residuals(prepared, replay(prepared, [values]))
    moved = [np.sqrt(np.mean(r.motion**2)) for r in found if r.motion is not None]
    return np.array([r.rms()[0] for r in found]), np.array(moved)


@pytest.mark.parametrize(("family", "style"), list(zip(FAMILIES, 2 * STYLES, strict=True)))
def test_without_effect_the_replay_meets_the_floor_at_the_truth(family, style):
    """Nothing fitted.  An encoder fine enough that counts do not blur a free rotor's angle: 1
    within sampling error.

    A recording has 4000 or more readings, so its rms scatters by 1/sqrt(2 * 4000) = 0.011; 5 of
    these.
    """
    drawn = draw(Case(0, "none", family, style), 11)
    fine = dataclasses.replace(drawn.true.converter, encoder_counts=2**20)
    current, motion = misses(
        dataclasses.replace(drawn, true=dataclasses.replace(drawn.true, converter=fine))
    )
    assert current == pytest.approx(1.0, abs=0.055)
    assert np.sqrt(np.mean(current**2)) == pytest.approx(1.0, abs=0.015)
    assert motion == pytest.approx(1.0, abs=0.1)


def test_with_the_real_encoder_counts_cost_a_free_rotor_a_little():
    """Counts in step with the samples leave a free rotor's angle a bias: 1.15 seen at the worst, in
    motion alone."""
    drawn = draw(Case(0, "none", "ipm", "scored"), 12)
    current, motion = misses(drawn)
    assert np.sqrt(np.mean(current**2)) < 1.04
    assert current.max() < 1.2
    assert motion.max() < 1.2


@pytest.mark.parametrize("outside", EVERY)
def test_what_no_library_holds_shows(outside):
    """In the currents; what lies in the mechanics in the motion of free rotors alone."""
    drawn = draw(Case(0, "outside", "ipm_exchanged", "scored", sizes=(1.0,), outside=outside), 3)
    current, motion = misses(drawn, SHORTER)
    assert (motion if drawn.as_json()["outside_subsystem"] == "mechanics" else current).max() > 1.5


def test_what_no_library_holds_lies_in_every_subsystem():
    found = {name: effect.subsystem for name, effect in OUTSIDE.items()}
    assert set(found.values()) == set(SUBSYSTEMS)
    assert list(found.values()).count("inverter") == 3
    assert (found["sensor_curvature"], found["fan"]) == ("sensor", "mechanics")
    case = Case(0, "outside", "ipm", "scored", sizes=(1.0,), outside="fan")
    assert draw(case, 3).as_json()["outside_subsystem"] == "mechanics"
    assert draw(Case(0, "none", "ipm", "scored"), 3).as_json()["outside_subsystem"] is None


def test_sizes_outside_the_library_are_what_they_say():
    """At size 1: sensors 2.5 % low at rated current; the fan takes 10 % of rated torque at rated
    speed."""
    drive, rng = family_drive("ipm"), np.random.default_rng(0)
    curved, fan = (OUTSIDE[n].planted(drive, 1.0, rng).bench for n in ("sensor_curvature", "fan"))
    assert curved == {"curvature": pytest.approx(0.025 / drive.motor.rated_current**2)}
    speed = drive.motor.rated_speed_rpm * math.pi / 30.0
    assert fan["fan"] * speed**2 == pytest.approx(0.1 * drive.motor.rated_torque)


def test_curved_sensors_of_the_largest_size_still_read_what_cycles_ask_for():
    """Three phases of a current X read X (1 - 3/4 c X^2) as a vector: 1.7 at X = 2.0; energies go
    to 2.2."""
    drive, rng = family_drive("ipm"), np.random.default_rng(0)
    c = (
        OUTSIDE["sensor_curvature"].planted(drive, EFFECT_SIZES[-1], rng).bench["curvature"]
        * drive.motor.rated_current**2
    )
    x = np.linspace(0.0, VALID_TO, 2000)
    read = x * (1.0 - 0.75 * c * x**2)
    assert np.all(np.diff(read) > 0.0)
    assert np.interp(1.7, read, x) < 2.05


@pytest.mark.parametrize("name", causes())
def test_every_effect_is_in_the_data_as_the_seal_says(name):
    """At the truth the floor; on a library without it (parameters back at neutral) the smallest at
    double size shows.

    Mechanical effects show in the motion.
    """
    drawn = draw(Case(0, "one", "ipm_exchanged", "scored", (name,), (2.0,)), 21)
    campaign = campaign_of(drawn, SHORTER)
    values = true_set(drawn, campaign)
    truth = drawn.as_json()["parameters"]
    assert truth
    assert {k.partition(".")[0] for k in truth} == {name}
    without = {k: v for k, v in values.items() if k.partition(".")[0] != name}
    if name == "cross_saturation":
        without = {
            k: v
            for k, v in without.items()
            if k not in ("saturation.alpha_12", "saturation.alpha_22")
        }
        assert truth["cross_saturation.alpha_12"] == values["saturation.alpha_12"]
    prepared = prepare(campaign, values)
    found = residuals(prepared, replay(prepared, [values, without]))
    current = np.array([r.rms() for r in found])
    motion = np.array(
        [np.sqrt(np.mean(r.motion**2, axis=0)) for r in found if r.motion is not None]
    )
    # 75 us: the replay takes residual dead time's sign at zero current a little wrong
    late = name == "pwm_delay"
    assert np.sqrt(np.mean(current[:, 0] ** 2)) < (1.1 if late else 1.04)
    assert current[:, 0].max() < (1.4 if late else 1.2)
    assert motion[:, 0].max() < 1.2
    assert max(current[:, 1].max(), motion[:, 1].max()) > 1.25


def test_a_file_is_no_place_for_a_check(tmp_path):
    (tmp_path / "short.toml").write_text("")
    with pytest.raises(
        BadInput, match=r"short\.toml' is a file, no folder for a check; give a new folder"
    ):
        make(tmp_path / "short.toml", CheckPlan(1, 0))


def test_the_check_is_sealed_before_it_is_recorded_and_goes_on(tmp_path, monkeypatch):
    folder, seen = tmp_path / "check", []
    short = lambda drawn, share: campaign_of(drawn, 0.02)  # noqa: E731
    monkeypatch.setattr(maker, "campaign_of", short)

    def announce(digest):
        seen.append(digest)
        assert not (folder / "campaigns").exists()

    made = make(folder, CheckPlan(3, 5), announce=announce)
    text = (folder / "truth.sealed").read_bytes()
    assert (
        made.sha256
        == seen[0]
        == hashlib.sha256(text).hexdigest()
        == (folder / "SHA256").read_text().split()[0]
    )
    assert made.recorded == 3
    first = (folder / "campaigns" / "w001" / "run_fast.parquet").read_bytes()
    for path in (folder / "campaigns" / "w001").iterdir():
        path.unlink()
    (folder / "campaigns" / "w001").rmdir()
    assert make(folder, CheckPlan(3, 5)).recorded == 1
    assert (folder / "campaigns" / "w001" / "run_fast.parquet").read_bytes() == first
    with pytest.raises(BadInput, match="another withheld check"):
        make(folder, CheckPlan(3, 6))


def test_a_campaign_says_nothing_of_its_truth(tmp_path, monkeypatch):
    monkeypatch.setattr(maker, "campaign_of", lambda drawn, share: campaign_of(drawn, 0.02))
    make(tmp_path, CheckPlan(2, 5, style="practice"))
    truth = json.loads((tmp_path / "truth.sealed").read_text())["campaigns"]
    for name, entry in truth.items():
        text = (tmp_path / "campaigns" / name / "campaign.toml").read_text()
        for word in (
            *EVERY,
            entry["family"],
            entry["kind"],
            entry["style"],
            "description",
            "provenance",
            "rated",
        ):
            assert word not in text.replace('injection_axis = "none"', ""), word
        toml = tomllib.loads(text)
        assert toml["campaign"] == {"name": name}
        assert set(toml["uncertainty"]) == set(DRAWN)
        assert set(toml["motor"]) == {*DRAWN, "pole_pairs"}
        campaign = read_folder(tmp_path / "campaigns" / name)
        assert {r.file.removesuffix(".parquet") for r in campaign.recordings} == FILES
        assert campaign.rated_from_data
        for r in campaign.recordings:
            assert set(r.columns) == {
                "t",
                "u_alpha",
                "u_beta",
                "i_a",
                "i_b",
                "i_c",
                "theta",
                "u_dc",
                "load_torque",
            }


def outsiders(seed):
    """Return what is outside the library in a check, in turn."""
    return [
        (c.outside, c.sizes[0]) for c in cases(400, seed, "mixed", "scored") if c.kind == "outside"
    ]


def test_shares_sizes_and_effects_of_a_mixed_check():
    listed = cases(400, 0, "mixed", "scored")
    kinds = [c.kind for c in listed]
    assert {k: kinds.count(k) / 400 for k in SHARES} == pytest.approx(SHARES)
    pairs = [(c.names[0], c.sizes[0]) for c in listed if c.kind == "one"]
    assert len(pairs) == 240
    assert {pairs.count((n, s)) for n in causes() for s in EFFECT_SIZES} == {2, 3}
    first = [s for _, s in pairs[:26]]
    assert {first.count(s) for s in EFFECT_SIZES} == {6, 7}
    assert all(not {"saturation", "cross_saturation"} <= set(c.names) for c in listed)
    assert {len(c.names) for c in listed if c.kind == "several"} == {2, 3}
    assert {c.family for c in listed} == set(FAMILIES)
    unlisted = outsiders(0)
    assert {unlisted.count((n, s)) for n in OUTSIDE for s in EFFECT_SIZES} == {1}
    assert [n for n, _ in unlisted[: len(OUTSIDE)]] != [n for n, _ in outsiders(1)[: len(OUTSIDE)]]
    assert sorted({s for _, s in unlisted[: len(OUTSIDE)]}) == list(EFFECT_SIZES)
    assert {c.kind for c in cases(20, 0, "controls", "scored")} == {"none"}
    with pytest.raises(BadInput, match="style of cycles"):
        cases(2, 0, "mixed", "score")
    with pytest.raises(BadInput, match="give 1 to 10000"):
        cases(0, 0, "mixed", "scored")


def test_ordinary_deviations_have_the_stated_size():
    """Means over 400 benches: standard deviations within 5/sqrt(800) = 18 % of what the campaign
    states."""
    drive, rng = family_drive("ipm"), np.random.default_rng(0)
    drawn = [draw_bench(drive, rng) for _ in range(400)]
    stated = drawn[0].background
    assert np.std([b.gains for b in drawn]) == pytest.approx(stated["current_gain"], rel=0.1)
    assert np.std([b.offsets for b in drawn]) == pytest.approx(stated["current_offset"], rel=0.1)
    assert np.std([b.encoder_offset for b in drawn]) == pytest.approx(
        stated["encoder_offset"], rel=0.18
    )
    assert np.sqrt(np.mean([b.dead_time**2 for b in drawn])) == pytest.approx(
        stated["dead_time"], rel=0.18
    )
    assert np.std([b.load_torque_offset for b in drawn]) == pytest.approx(
        stated["load_torque_offset"], rel=0.18
    )


def test_cycles_fill_85000_samples_and_the_styles_differ():
    drive = family_drive("ipm")
    found = {style: cycles(style, drive, np.random.default_rng(1)) for style in STYLES}
    for planned in found.values():
        assert {c.file for c in planned} == FILES
        assert sum(len(c.plan) for c in planned) == pytest.approx(85000, rel=0.08)
    one, other = ({c.file: c for c in found[s]} for s in STYLES)
    stairs = one["locked_d"].plan[:, 1]
    assert np.all(np.diff(stairs) >= 0.0)
    assert np.any(np.diff(other["locked_d"].plan[:, 1]) < 0.0)
    assert math.isclose(one["locked_d"].plan[0, 1], -one["locked_d"].plan[-1, 1])


def test_pairs_come_in_turn_and_so_do_their_effects():
    """Two rounds: every pair twice, once with either effect."""
    found = cases(2 * len(PAIRS), 3, "pairs", "scored")
    assert {c.pair: {n for d in found if d.pair == c.pair for n in d.names} for c in found} == {
        pair: set(members) for pair, (members, _) in PAIRS.items()
    }
    assert {c.kind for c in found} == {"one"}
    assert {c.sizes[0] for c in found} <= set(PAIR_SIZES)
    assert draw(found[0], 3).as_json()["pair"] == found[0].pair


@cache
def narrow_campaign(effect, pair):
    """Return a narrow campaign with an effect at its usual size, and the truth as a replay takes
    it."""
    drawn = draw(Case(0, "one", "ipm_exchanged", "scored", (effect,), (1.0,), None, pair), 11)
    campaign = campaign_of(drawn)
    return campaign, true_set(drawn, campaign)


@pytest.mark.parametrize("pair", PAIRS)
def test_a_narrow_campaign_is_one_operating_point_and_replays_at_the_truth(pair):
    """Two recordings with one kind of rotor at one link voltage; floor 1 as in the tests above
    (free rotors: 1.2)."""
    campaign, values = narrow_campaign(PAIRS[pair][0][0], pair)
    assert len(campaign.recordings) == 2
    assert len({r.rotor for r in campaign.recordings}) == 1
    assert {r.dc_bus_voltage for r in campaign.recordings} == {None}
    prepared = prepare(campaign, values)
    for found in residuals(prepared, replay(prepared, [values])):
        assert found.rms()[0] < 1.2


def cosine(campaign, values, effect, rival):
    """Return the cosine of an effect at its true size with its rival, ordinary deviations beside
    both."""
    at = complete(campaign.drive.motor, campaign.drive.converter, values)
    point = ParameterPoint(prepare(campaign, at), at)
    n = normal(point, coordinates_of(point, (effect, rival)))
    a, usual = n.summed()[0], {c.label: c.deviation for c in n.coordinates if c.form == "turn"}
    usual |= {c.label: c.deviation for c in ordinary(campaign)}
    own = [k for k, c in enumerate(n.coordinates) if c.effect == effect]
    move = np.array([n.coordinates[k].value(at) - n.coordinates[k].mean for k in own])

    def left(deviations):
        """Return the squares of the effect's readings that the others, within their deviations,
        cannot take up."""
        others = [k for k, c in enumerate(n.coordinates) if k not in own and c.label in deviations]
        slopes = a[np.ix_(others, own)] @ move
        held = np.diag([deviations[n.coordinates[k].label] ** -2 for k in others])
        return move @ a[np.ix_(own, own)] @ move - slopes @ np.linalg.solve(
            a[np.ix_(others, others)] + held, slopes
        )

    wide = {c.label: c.deviation for c in coordinates_of(point, (rival,))}
    return math.sqrt(max(0.0, 1.0 - left(usual | wide) / left(usual)))


@pytest.mark.parametrize("pair", PAIRS)
def test_the_effects_of_a_pair_look_alike(pair):
    """One in terms of the other, whichever way is closer: as the module says.  Not so what is no
    pair: an encoder's offset and a magnet's flux, at one speed."""
    members, found = PAIRS[pair][0], []
    for effect, rival in (members, members[::-1]):
        campaign, values = narrow_campaign(effect, pair)
        found.append(cosine(campaign, values, effect, rival))
    assert max(found) > (0.5 if pair == "one_speed" else 0.86)
    if pair == "one_voltage":
        assert cosine(campaign, values, "encoder_offset", "magnet_flux") < 0.1
