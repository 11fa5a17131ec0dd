"""Sizes from published ranges, deviations other than stated, and a seal that is the same on every
machine."""

import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import truncnorm

from model.effects.library import causes, load_effect
from model.errors import BadInput
from model.kernels.folders import cache_home
from sandbox.output.files import rounded
from sandbox.replay.replay import prepare, replay, residuals
from sandbox.switched.bench_numbers import SOFT_SIGN
from sandbox.withheld.making import draw as draw_module
from sandbox.withheld.making import drives
from sandbox.withheld.making import mapped_drive as mapped
from sandbox.withheld.making.case_list import TABLES, Case, cases
from sandbox.withheld.making.draw import SEALED, draw
from sandbox.withheld.making.drives import (
    FAMILIES,
    MOST_OFF,
    SHAPES,
    draw_bench,
    family_drive,
    sign_of,
)
from sandbox.withheld.making.effect_sizes import EFFECT_SIZES, plant
from sandbox.withheld.making.make import campaign_of, switched
from sandbox.withheld.making.published import core_loss, multiple, planted, resonance, table
from tests.sandbox.withheld.known import true_set

ROOT = Path(__file__).parents[4]


def test_every_effect_has_ranges_with_sources_for_parameters_that_it_has():
    assert set(table()) == set(causes())
    for name, ranges in table().items():
        assert set(ranges) <= {p.name for p in load_effect(name).parameters}, name
        for key, r in ranges.items():
            assert len(r.source) > 4, (name, key)
            assert r.turn or r.choices or 0.0 < min(r.range) < max(r.range), (name, key)
            assert r.form == "resonance" or r.turn or r.choices or r.range[0] < r.range[1], (
                name,
                key,
            )
        assert next(iter(ranges.values())).range, name


@pytest.mark.parametrize("name", causes())
def test_a_size_by_its_range_is_the_ladders_at_the_same_amount(name):
    """What the ladder plants at size s, `multiple` calls s; where it draws around a mean step,
    within that spread."""
    drive, rng = family_drive("ipm"), np.random.default_rng(4)
    for size in EFFECT_SIZES:
        found = multiple(
            name, drive.motor, drive.converter, plant(name, drive.motor, drive.converter, size, rng)
        )
        spread = 0.45 if name in ("inductance", "saturation", "shaft_compliance") else 1e-9
        assert found == pytest.approx(size, rel=spread), size


@pytest.mark.parametrize("name", causes())
def test_places_are_the_ends_of_the_range(name):
    """Leading parameter at 0 and 1: weak and strong end, so sizes differ by the ratio of the range
    (logarithms of 1 + x where the motor's own value is off, squares where a stiffness follows from
    a frequency)."""
    drive, sizes = family_drive("modern"), []
    own = name, drive.motor, drive.converter
    r = next(iter(table()[name].values()))
    for place in (0.0, 1.0):
        sizes.append(multiple(*own, planted(*own, place, np.random.default_rng(1))))
    low, high = r.range
    ratio = (
        math.log1p(high) / math.log1p(low)
        if r.ratio
        else (high / low) ** (-2 if r.form == "resonance" else 1)
    )
    assert sizes[1] / sizes[0] == pytest.approx(ratio)
    assert ratio > 1.0


def test_forms_by_their_definition():
    """A core resistance takes the share of rated power that it says; two inertias on a shaft swing
    at the frequency."""
    motor = family_drive("ipm").motor
    r, speed = core_loss(0.02, motor, {}), motor.rated_omega
    loss = 1.5 * (speed * motor.magnet_flux) ** 2 / r
    assert loss == pytest.approx(0.02 * motor.rated_torque * speed / motor.pole_pairs)
    load = 0.3 * motor.inertia
    k, own = resonance(100.0, motor, {"load_inertia": load}), motor.inertia - load
    # two speeds and the twist
    swing = np.array([[0.0, 0.0, -k / own], [0.0, 0.0, k / load], [1.0, -1.0, 0.0]])
    assert max(abs(np.linalg.eigvals(swing).imag)) == pytest.approx(math.tau * 100.0)


def test_single_effects_come_from_every_quarter_of_their_range_in_turn():
    """As the ladder's four rungs do: over four rounds each effect once from each quarter; otherwise
    the same cases."""
    one, other = (
        [c for c in cases(174, 3, "mixed", "scored", table=t) if c.kind == "one"] for t in TABLES
    )
    assert [(c.names, c.family) for c in one] == [(c.names, c.family) for c in other]
    assert [EFFECT_SIZES.index(c.sizes[0]) for c in one] == [int(4.0 * c.sizes[0]) for c in other]
    assert {c.table for c in other} == {"published"}
    several = [
        c for c in cases(200, 3, "mixed", "scored", table="published") if c.kind == "several"
    ]
    assert all(0.25 <= s <= 1.0 for c in several for s in c.sizes)
    with pytest.raises(BadInput, match="table of sizes"):
        cases(4, 3, "mixed", "scored", table="publsihed")


def test_every_published_truth_is_sealed_with_its_size_and_place():
    drawn = draw(Case(0, "one", "ipm", "scored", ("dead_time",), (1.0,), table="published"), 3)
    truth = drawn.sealed()
    top = table()["dead_time"]["time"].range[1]
    assert truth["parameters"]["dead_time.time"] == pytest.approx(
        top + drawn.bench.dead_time, rel=1e-5
    )
    assert truth["places"] == [1.0]
    assert truth["sizes"] == [pytest.approx(top / 1.2e-6)]  # of the ladder's medium one
    assert "places" not in draw(Case(0, "one", "ipm", "scored", ("dead_time",), (1.0,)), 3).sealed()


def test_deviations_are_half_to_twice_the_stated_ones_but_no_gap_of_their_own():
    """Density of 2^u z, u even in -1 to 1, z normal, cut at 3: rms by integrals over u; 4000 values
    scatter by less than 1/sqrt(2 * 4000) = 1.1 % (cut tails scatter less than a normal number's
    times its kurtosis); five of these."""
    rng = np.random.default_rng(0)
    drawn = np.concatenate([drives.deviations(rng, True, 1) for _ in range(4000)])
    # each draw of 2^u is kept and z drawn anew, so every u weighs alike: the mean of the variances
    # of cut normals
    variance = np.mean(
        [4.0**u * truncnorm.var(-3.0 / 2.0**u, 3.0 / 2.0**u) for u in np.linspace(-1.0, 1.0, 2001)]
    )
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(math.sqrt(variance), rel=0.055)
    assert 2.5 < np.max(np.abs(drawn)) < MOST_OFF
    # as stated: Gaussian, not cut
    assert np.max(np.abs(drives.deviations(rng, False, 4000))) > MOST_OFF
    three = drives.deviations(rng, True, 3)
    assert three.shape == (3,)


def test_the_seal_says_how_far_off_ordinary_values_are():
    """In stated deviations, and nothing on the bench or in the statement is further off than
    allowed."""
    for k in range(6):
        drawn = draw(Case(k, "none", "ipm", "scored", table="published"), 5)
        off = drawn.sealed()["deviations"]
        assert set(off) >= {
            "resistance",
            "magnet_flux",
            "gain_a",
            "offset_c",
            "encoder_offset",
            "dead_time",
        }
        assert max(abs(x) for x in off.values()) < MOST_OFF
        assert drawn.stated.resistance == pytest.approx(
            drawn.true.motor.resistance * (1.0 + 0.01 * off["resistance"])
        )
        assert drawn.bench.gains[1] == pytest.approx(1.0 + 0.0015 * off["gain_b"])
    stated = draw_bench(family_drive("ipm"), np.random.default_rng(0), True).background
    # states the usual ones
    assert stated == draw_bench(family_drive("ipm"), np.random.default_rng(1)).background


def test_the_sign_of_a_current_has_other_shapes_and_widths(monkeypatch):
    """On a bench that knows shapes all three; on one that does not, a tenth of the width stands for
    the hard one."""
    motor, rng = family_drive("ipm").motor, np.random.default_rng(0)
    usual = SOFT_SIGN * motor.rated_current
    monkeypatch.setattr(
        drives,
        "SwitchedBench",
        type("SwitchedBench", (), {"_fields": ("soft_current", "sign_shape")}),
    )
    found = [sign_of(motor, rng) for _ in range(60)]
    assert {f["sign_shape"] for f in found} == set(SHAPES.values())
    assert all(0.5 * usual <= f["soft_current"] <= 2.0 * usual for f in found)
    monkeypatch.setattr(
        drives, "SwitchedBench", type("SwitchedBench", (), {"_fields": ("soft_current",)})
    )
    found = [sign_of(motor, rng)["soft_current"] / usual for _ in range(60)]
    assert min(found) < 0.2 < 0.5 < max(found)
    assert not any(0.2 < x < 0.5 for x in found)


@pytest.mark.parametrize(
    "name", ["coulomb_friction", "device_drop", "iron_loss", "shaft_compliance", "cogging_torque"]
)
def test_what_is_drawn_from_a_range_is_in_the_data_as_the_seal_says(name, monkeypatch):
    """At the sealed truth, nothing fitted, the floor: limits as with the ladder's sizes
    (test_make); without the effect, at the strong end of its range, a gap.  The sign of a
    current is the usual one, which replays know."""
    monkeypatch.setattr(draw_module, "sign_of", lambda motor, rng: {})
    drawn = draw(Case(0, "one", "ipm_exchanged", "scored", (name,), (1.0,), table="published"), 21)
    campaign = campaign_of(drawn, 0.3)
    values = true_set(drawn, campaign)
    without = {k: v for k, v in values.items() if k.partition(".")[0] != name}
    prepared = prepare(campaign, values)
    found = residuals(prepared, replay(prepared, [values, without]))
    current = np.array([r.rms() for r in found])
    motion = np.array(
        [np.sqrt(np.mean(r.motion**2, axis=0)) for r in found if r.motion is not None]
    )
    assert np.sqrt(np.mean(current[:, 0] ** 2)) < 1.04
    # the shaft's first free recording: 1.202
    assert max(current[:, 0].max(), motion[:, 0].max()) < 1.22
    assert max(current[:, 1].max(), motion[:, 1].max()) > 1.25


@pytest.mark.parametrize("family", FAMILIES)
def test_the_bench_gets_the_sign_that_is_sealed(family):
    drawn = draw(Case(0, "none", family, "scored", table="published"), 5)
    b = switched(drawn)
    found = drawn.as_json()["bench"]
    assert all(getattr(b, k) == v == found[k] for k, v in drawn.sign.items())
    assert "soft_current" in drawn.sign
    assert switched(draw(Case(0, "none", family, "scored"), 5)).soft_current == pytest.approx(
        SOFT_SIGN * draw(Case(0, "none", family, "scored"), 5).true.motor.rated_current
    )


def test_the_seal_does_not_see_what_machines_differ_by():
    """Every number moved by 1e-13 of itself, as another kernel of the spline fit does (3e-13 seen):
    the same text."""
    rng = np.random.default_rng(0)

    def shaken(x):
        """Return a value of JSON with all its numbers moved by a rounding error."""
        if isinstance(x, dict):
            return {k: shaken(v) for k, v in x.items()}
        if isinstance(x, list):
            return [shaken(v) for v in x]
        return x * (1.0 + 1e-13 * rng.standard_normal()) if isinstance(x, float) else x

    truths = [draw(c, 7).as_json() for c in cases(20, 7, "mixed", "scored", table="published")]
    plain = json.loads(json.dumps(truths))
    assert shaken(plain) != plain
    assert rounded(shaken(plain), SEALED) == rounded(plain, SEALED)


DRAWN = """
import hashlib, json
from sandbox.withheld.making.case_list import Case
from sandbox.withheld.making.draw import draw
cases = [Case(0, "outside", "mapped", "scored", (), (1.0,), "flux_map", table="published")]
cases.append(Case(1, "one", "modern", "scored", ("saturation",), (0.5,), table="published"))
drawn = [draw(c, 7) for c in cases]
raw, sealed = (json.dumps(x).encode() for x in ([d.as_json() for d in drawn], [d.sealed() for d in drawn]))
print(hashlib.sha256(raw).hexdigest(), hashlib.sha256(sealed).hexdigest())
"""  # noqa: E501


@pytest.mark.skipif(mapped.missing() is not None, reason=str(mapped.missing()))
def test_the_seal_is_the_same_with_other_blas_kernels_and_threads(tmp_path):
    """The spline fit of a flux map, made anew each time, differs in its last digits; the seal does
    not."""
    found = []
    for kernels in cache_home().glob("kernels-*"):  # what is compiled, but no fit
        (tmp_path / kernels.name).symlink_to(kernels)
    for core, threads in (("Haswell", 2), ("Prescott", 1)):
        env = os.environ | {"OPENBLAS_CORETYPE": core, "OPENBLAS_NUM_THREADS": str(threads)}
        env |= {"SENSORLESS_CACHE": str(tmp_path), "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, "-c", DRAWN],
            env=env,
            capture_output=True,
            text=True,
            check=True,
            cwd=ROOT,
        )
        found.append(done.stdout.split())
        shutil.rmtree(tmp_path / "maps")  # the fit; compiled kernels stay
    assert len({sealed for _, sealed in found}) == 1
    assert len(found[0][1]) == hashlib.sha256().digest_size * 2
