"""Flux maps as nominal models of a mixed check: which campaigns have one, what is stated, that the
truth fits it."""

import dataclasses
import json
import tomllib

import numpy as np
import pytest

from model.effects.library import causes
from model.energy import flux_from_current
from model.errors import BadInput
from model.mapped import ALPHAS, MappedMotor
from model.spline import currents
from sandbox.cli import main
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.writing import map_read, write_campaign
from sandbox.replay.replay import prepare, replay, residuals
from sandbox.withheld.making import make as maker
from sandbox.withheld.making import map_motors
from sandbox.withheld.making.case_list import SHARES, Case, Maps, cases
from sandbox.withheld.making.draw import draw
from sandbox.withheld.making.drives import FAMILIES, UNCERTAINTY, family_drive
from sandbox.withheld.making.effect_sizes import EFFECT_SIZES
from sandbox.withheld.making.make import CheckPlan, campaign_of, make
from sandbox.withheld.making.map_motors import (
    FILE,
    MAPS,
    changed,
    map_families,
    no_maps,
    stated_map,
)
from sandbox.withheld.making.mapped_drive import FLUX_MAP
from sandbox.withheld.making.outside_causes import OUTSIDE
from sandbox.withheld.scoring.recommended import drawn_again

here = pytest.mark.skipif(not map_families(), reason=no_maps())
HALF = Maps(0.5, tuple(MAPS))
SHORT = 0.1  # of the usual length: 1400 readings or more, an rms within 5/sqrt(2 * 1400) = 0.1
MAGNETIC = ("saturation", "cross_saturation", "inductance", "magnet_flux")


def truth(drawn, campaign):
    """Return the truth as a replay of the campaign takes it, of effects that leave encoder and
    shaft alone."""
    true, own = drawn.true.motor, drawn.as_json()["bench"]
    values = drawn.plant | {f"saturation.{a}": x for a, x in drawn.added_to_map.items()}
    values |= {
        "stator_resistance.resistance": true.resistance,
        "magnet_flux.magnet_flux": true.magnet_flux,
    }
    values |= {
        "inertia.inertia": true.inertia,
        "viscous_friction.coefficient": true.viscous_friction,
    }
    for x in "dq":
        stated = getattr(campaign.drive.motor, f"inductance_{x}")
        values[f"inductance.scale_{x}"] = getattr(true, f"inductance_{x}") / stated
    values |= {
        f"bench.{k}": own[k] for k in ("common_offset", "load_torque_offset", "soft_current")
    }
    read = float(np.mean(next(r.theta for r in campaign.recordings if r.rotor == "locked")))
    return values | {"bench.lock_angle": drawn.theta + drawn.plant["encoder_offset.offset"] - read}


def written(drawn, folder, share=SHORT):
    """Return a drawn campaign as its folder says it."""
    return read_folder(write_campaign(folder, campaign_of(drawn, share), stated_map(drawn.stated)))


def on_maps(listed):
    """Return the cases whose nominal model is a map."""
    return [c for c in listed if c.family in MAPS and c.outside != FLUX_MAP]


def test_half_of_every_kind_has_a_map_and_nothing_else_changes():
    """Shares within one campaign of each kind (what the map itself is the cause of keeps its
    quartic)."""
    names = [*OUTSIDE, FLUX_MAP]
    without = cases(400, 0, "mixed", "scored", names, "published")
    listed = cases(400, 0, "mixed", "scored", names, "published", HALF)
    assert [dataclasses.replace(c, family="") for c in listed] == [
        dataclasses.replace(c, family="") for c in without
    ]
    for kind in SHARES:
        can = [c for c in listed if c.kind == kind and c.outside != FLUX_MAP]
        assert len(on_maps(can)) == pytest.approx(0.5 * len(can), abs=1.0)
    changed_ones = on_maps(listed)
    assert {c.family for c in listed if c not in changed_ones} == {*FAMILIES, "mapped"}
    singles = {n for c in changed_ones if c.kind == "one" for n in c.names}
    # 120 of 26 x 4: an effect misses all of 4 or 5 with 1 in 20
    assert len(singles) >= 0.9 * len(causes())
    assert [c.family for c in cases(400, 1, "mixed", "scored", names, "published", HALF)] != [
        c.family for c in listed
    ]
    assert not on_maps(without)
    assert len(on_maps(cases(40, 0, "mixed", "scored", maps=Maps(1.0, tuple(MAPS))))) == 40


def test_shares_that_are_none_are_refused():
    with pytest.raises(BadInput, match="belongs to mixed checks; leave it away for 'many'"):
        cases(4, 0, "many", "scored", maps=HALF)
    with pytest.raises(BadInput, match="give 0 to 1"):
        cases(4, 0, "mixed", "scored", maps=Maps(1.5, tuple(MAPS)))


@here
def test_terms_added_to_a_map_are_what_they_say():
    """Currents at the same flux differ by the gradient of the terms, in closed form (rounding of
    the cells, 1e-9 A)."""
    motor = family_drive("mapped").motor
    new = {
        "inductance_d": 0.9 * motor.inductance_d,
        "inductance_q": 0.8 * motor.inductance_q,
        "alpha_30": 2.0,
        "alpha_12": -3.0,
        "alpha_40": 5.0,
    }
    other = changed(motor, new | {"alpha_22": 7.0, "alpha_04": 0.5, "magnet_flux": 0.4})
    assert (other.magnet_flux, other.inductance_d, other.inductance_q) == (
        0.4,
        pytest.approx(0.9 * motor.inductance_d, rel=1e-12),
        pytest.approx(0.8 * motor.inductance_q, rel=1e-12),
    )
    assert other != motor
    d, q = np.array([-0.3, -0.05, 0.1, 0.42]), np.array([0.9, -0.4, 1.1, 0.0])
    own, found = (currents_at(m, d, q) for m in (motor, other))
    more_d, more_q = (1.0 / 0.9 - 1.0) / motor.inductance_d, (1.0 / 0.8 - 1.0) / motor.inductance_q
    i_d = more_d * d + 3.0 * 2.0 * d**2 - 3.0 * q**2 + 4.0 * 5.0 * d**3 + 2.0 * 7.0 * d * q**2
    i_q = more_q * q - 2.0 * 3.0 * d * q + 2.0 * 7.0 * d**2 * q + 4.0 * 0.5 * q**3
    assert found[0] - own[0] == pytest.approx(i_d, abs=1e-9)
    assert found[1] - own[1] == pytest.approx(i_q, abs=1e-9)


def currents_at(motor, d, q):
    """Return i_d, i_q (A) at current-induced fluxes (Wb)."""
    return np.array(
        [currents(motor.spline, float(a), float(b)) for a, b in zip(d, q, strict=True)]
    ).T


@here
@pytest.mark.parametrize(
    ("effect", "size"),
    [(None, 1.0), *((e, s) for e in MAGNETIC for s in (EFFECT_SIZES[0], EFFECT_SIZES[-1]))],
)
def test_the_stated_file_gives_the_stated_map(effect, size, tmp_path):
    """Within 1e-3 of rated current wherever the true motor goes (2.2 times rated): a noise of the
    least, 0.1 %.

    Magnet flux within a hundredth of its stated uncertainty.
    """
    names = () if effect is None else (effect,)
    drawn = draw(
        Case(0, "one" if names else "none", "mapped", "scored", names, (size,) * len(names)), 11
    )
    read = written(drawn, tmp_path / "c", 0.02).drive.motor
    assert isinstance(read, MappedMotor)
    assert read.magnet_flux == pytest.approx(
        drawn.stated.magnet_flux, rel=0.01 * UNCERTAINTY["magnet_flux"]
    )
    rated = drawn.true.motor.rated_current
    angle, r = (
        x.ravel() for x in np.meshgrid(np.linspace(0.0, 6.0, 13), np.linspace(0.0, 2.2, 8) * rated)
    )
    flux = flux_from_current(drawn.true.motor.energy, r * np.cos(angle), r * np.sin(angle))
    off = currents_at(read, *flux) - currents_at(drawn.stated, *flux)
    assert np.abs(off).max() < 1e-3 * rated


@here
@pytest.mark.parametrize("effect", [None, *MAGNETIC, "dead_time"])
def test_on_a_map_the_replay_meets_the_floor_at_the_truth(effect, tmp_path):
    """As on quartics (test_make): 1 within five times the scatter of so many readings; without the
    truth a gap.

    The map is the one that the folder states, so what a diagnosis reads.
    """
    names = () if effect is None else (effect,)
    drawn = draw(
        Case(0, "one" if names else "none", "mapped", "scored", names, (1.0,) * len(names)), 11
    )
    fine = dataclasses.replace(drawn.true.converter, encoder_counts=2**20)
    drawn = dataclasses.replace(drawn, true=dataclasses.replace(drawn.true, converter=fine))
    campaign = written(drawn, tmp_path / "c")
    values = truth(drawn, campaign)
    got = {k.partition(".")[0] for k in drawn.as_json()["parameters"]}
    assert got == set(names)
    without = {k: v for k, v in values.items() if k.partition(".")[0] not in names}
    if effect == "cross_saturation":
        without = {k: v for k, v in without.items() if not k.startswith("saturation.")}
    prepared = prepare(campaign, values)
    found = residuals(prepared, replay(prepared, [values, without]))
    rms = np.array([r.rms() for r in found])
    motion = [np.sqrt(np.mean(r.motion**2, axis=0)) for r in found if r.motion is not None]
    assert rms[:, 0] == pytest.approx(1.0, abs=0.1)
    assert np.sqrt(np.mean(rms[:, 0] ** 2)) == pytest.approx(1.0, abs=0.03)
    assert [m[0] for m in motion] == pytest.approx([1.0] * len(motion), abs=0.1)
    if names:
        assert rms[:, 1].max() > 1.5


@here
def test_every_effect_and_cause_can_be_drawn_on_a_map():
    """Smallest and largest sizes of both tables in turn, of saturation all; what is stated is not
    the truth, and the seal says by how much."""
    sizes = [
        ("ladder", EFFECT_SIZES[0]),
        ("published", 0.95),
        ("ladder", EFFECT_SIZES[-1]),
        ("published", 0.05),
    ]
    for k, name in enumerate(causes()):
        for table, size in sizes if name in map_motors.OF_ALPHAS else [sizes[k % 4]]:
            drawn = draw(Case(0, "one", "mapped", "scored", (name,), (size,), table=table), 5)
            maker.switched(drawn)
            assert drawn.true.motor != drawn.stated
            assert {k.partition(".")[0] for k in drawn.sealed()["parameters"]} == {name}
            assert bool(drawn.added_to_map) == (name in map_motors.OF_ALPHAS)
            if table == "ladder":
                assert drawn.sizes == (size,)
    for name in OUTSIDE:
        maker.switched(draw(Case(0, "outside", "mapped", "scored", (), (2.0,), name), 5))


@here
def test_saturation_on_a_map_is_that_of_the_quartic_like_it():
    """By the ladder cross terms are exp(-1.4 size) of the quartic's: the truth has the rest beside
    the stated map."""
    drawn = draw(Case(0, "one", "mapped", "scored", ("cross_saturation",), (0.5,)), 5)
    like = map_motors.identified(family_drive("mapped").motor)
    for name in ("alpha_12", "alpha_22"):
        wanted = getattr(like, name) * (1.0 - np.exp(-0.7))
        assert drawn.added_to_map[name] == pytest.approx(wanted, rel=1e-9)
        assert drawn.as_json()["parameters"][f"cross_saturation.{name}"] == drawn.added_to_map[name]
    out = draw(
        Case(0, "one", "mapped", "scored", ("cross_saturation",), (0.5,)), 5, ("cross_saturation",)
    )
    assert out.added_to_map == {}
    assert currents_at(out.true.motor, [0.3], [0.8]) != pytest.approx(
        currents_at(drawn.true.motor, [0.3], [0.8])
    )


@here
def test_a_mixed_check_from_the_command_line_states_maps_and_seals_the_share(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(maker, "campaign_of", lambda drawn, share: campaign_of(drawn, 0.02))
    folder = tmp_path / "check"
    call = ["withheld", "make", str(folder), "--count", "4", "--seed", "3", "--jobs", "1"]
    assert main(call) == 0
    content = json.loads((folder / "truth.sealed").read_text())
    assert content["maps"] == [0.5, list(map_families())]
    families = {name: one["family"] for name, one in content["campaigns"].items()}
    assert 1 <= sum(f in MAPS for f in families.values()) <= 3
    for name, family in families.items():
        stated = tomllib.loads((folder / "campaigns" / name / "campaign.toml").read_text())
        assert (
            ("flux_map" in stated)
            == (family in MAPS)
            == (folder / "campaigns" / name / FILE).is_file()
        )
        if family in MAPS:
            assert set(stated["uncertainty"]) == set(UNCERTAINTY) - set(ALPHAS)
            assert not {"magnet_flux", "inductance_d", *ALPHAS} & set(stated["motor"])
            own = drawn_again(content, name)
            assert own.as_json()["family"] == family
            campaign = read_folder(folder / "campaigns" / name)
            again = write_campaign(tmp_path / "again", campaign, map_read(campaign.drive.motor))
            assert (again / FILE).read_bytes() == (folder / "campaigns" / name / FILE).read_bytes()
            assert read_folder(again).drive.motor == campaign.drive.motor
            (tmp_path / "again").rename(tmp_path / name)
    capsys.readouterr()
    assert main([*call, "--maps", "0"]) == 2
    assert "holds another withheld check" in capsys.readouterr().err
    assert (
        main(
            [
                "withheld",
                "make",
                str(tmp_path / "new"),
                "--count",
                "2",
                "--kind",
                "many",
                "--maps",
                "0.5",
            ]
        )
        == 2
    )
    assert "belongs to mixed checks" in capsys.readouterr().err
    assert main(["withheld", "make", str(tmp_path / "new"), "--count", "2", "--maps", "1.5"]) == 2
    assert "is no share" in capsys.readouterr().err


def test_without_the_data_a_check_is_made_without_maps_and_says_so(tmp_path, monkeypatch, capsys):
    """Where a share is asked for, nothing is made; a seal without maps is that of earlier
    versions."""
    monkeypatch.setattr(map_motors, "locate", lambda name: None)
    monkeypatch.setattr(maker, "campaign_of", lambda drawn, share: campaign_of(drawn, 0.02))
    call = [
        "withheld",
        "make",
        str(tmp_path / "check"),
        "--count",
        "2",
        "--seed",
        "3",
        "--jobs",
        "1",
    ]
    assert main(call) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "data set 'baldor_pmsyrm' is not here" in said
    assert "as with --maps 0" in said
    content = json.loads((tmp_path / "check" / "truth.sealed").read_text())
    assert "maps" not in content
    assert make(tmp_path / "check", CheckPlan(2, 3)).recorded == 0
    assert main([*call, "--maps", "0.5"]) == 2
    assert "give maps = 0 for a check without" in " ".join(capsys.readouterr().err.split())
