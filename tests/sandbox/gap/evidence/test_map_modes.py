"""What another machine of a map's kind adds to its energy: against the energy of flux scaled whole.

H(psi) -> H(psi_d/c, psi_q) is exact; its difference of second order in c - 1 is the tolerance.
"""

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import flux_from_current
from model.fluxmap import FluxMap, write_map
from model.mapped import MappedMotor
from model.spline import currents, flux_newton
from model.spline_correction import Basis, refined
from sandbox.gap.evidence import map_modes
from sandbox.gap.evidence.map_modes import (
    Missed,
    between,
    factor,
    missed,
    parts_of,
    smooth,
    spacing,
    spread,
    with_modes,
)
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.response import fluxes
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.map_error import rotor_currents, with_map_error
from sandbox.replay.replay import prepare, replay
from tests.sandbox.replay.benches import record
from tests.sandbox.switched.one_cell import one_cell

IPM = load_drive("ipm")
NUMBERS = {
    n: getattr(IPM.motor, n)
    for n in type(IPM.motor).__dataclass_fields__
    if not n.startswith("alpha_")
}
MAPPED = dataclasses.replace(
    IPM,
    motor=MappedMotor(
        **NUMBERS, map_hash="of the quartic", spline=one_cell(IPM.motor.energy, -0.4, 0.4)
    ),
)
SHEET = ("pole_pairs", "resistance", "inertia", "rated_current", "rated_torque", "rated_speed_rpm")
SHARE = 1e-4  # c - 1: what it squared moves is below the tolerance
EVERYWHERE = Missed(np.zeros(1), np.zeros(1), 1e9, np.array([5e-4**2]))  # Wb, at all currents
FLUX = np.random.default_rng(1).uniform(-0.2, 0.2, size=(40, 2))


@pytest.mark.parametrize("axis", [0, 1])
def test_a_factor_on_all_fluxes_is_inductance_and_what_saturation_adds(axis):
    """-(c - 1) psi_d i_d: psi_d^2/L_d by inductance, whose factor c it is, the rest smooth."""
    name = ("inductance_d", "inductance_q")[axis]
    stated = dict.fromkeys(("inductance_d", "inductance_q"), SHARE)
    campaign = Campaign("own", MAPPED, (), stated, {}, False)
    motor = MAPPED.motor
    basis = Basis(refined(motor.spline, 8, 8))
    added = smooth(campaign, basis)
    assert added.shape == (basis.size, 2)
    gradients = basis.gradients(FLUX, np.arange(basis.size))
    found = -np.einsum("nsx,s->nx", gradients, added[:, axis])
    found[:, axis] -= SHARE * 2.0 * FLUX[:, axis] / getattr(motor, name)
    scale = np.ones(2)
    scale[axis] = 1.0 + SHARE
    of = np.array([currents(motor.spline, *psi) for psi in FLUX])
    exact = np.array([currents(motor.spline, *psi) for psi in FLUX / scale]) / scale - of
    size = np.abs(exact).max()
    np.testing.assert_allclose(found, exact, atol=20.0 * SHARE * size)
    saturated = np.abs(exact[:, axis] + SHARE * 2.0 * FLUX[:, axis] / getattr(motor, name)).max()
    assert saturated > 0.05 * size  # there is something to tell beside the inductance


def test_without_points_a_map_is_off_as_a_whole_alone():
    """A motor whose map no fit could be tried on: modes are the two smooth energies, turned, each
    of the size that is likely; no current at no flux is among them."""
    stated = dict.fromkeys(("inductance_d", "inductance_q"), 0.1)
    campaign = Campaign("own", MAPPED, (record({}, "driven", 20.0),), stated, {}, False)
    assert missed(campaign) is None
    point = ParameterPoint(prepare(campaign, steps=1), complete(MAPPED.motor, MAPPED.converter))
    error = with_modes(point, None).prepared.map_error
    assert 1 <= len(error.x) <= 2
    assert not error.x.any()
    (read,) = replay(point.prepared, [{}]).currents
    angle = point.prepared.recordings[0].motion.angle
    met = fluxes(MAPPED.motor.energy, rotor_currents(read[:, :, 0], angle))[::20]
    basis = Basis(error.stated)
    gradients = basis.gradients(met, np.arange(basis.size))
    both = np.einsum("nsx,sk->nxk", gradients, smooth(campaign, basis)).reshape(-1, 2)
    for mode in np.moveaxis(error.modes, -1, 0):
        alone = error.stated._replace(cells=np.ascontiguousarray(mode))
        added = np.array([currents(alone, *psi) for psi in met]).ravel()
        share, *_ = np.linalg.lstsq(both, added, rcond=None)
        np.testing.assert_allclose(both @ share, added, atol=1e-9 * np.abs(added).max())
        assert np.hypot(*share) == pytest.approx(1.0, rel=1e-6)
        assert np.abs(currents(alone, 0.0, 0.0)).max() < 1e-9 * np.abs(added).max()


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    """IPM's motor, as a map of 15 by 15 points and the fit of it know it."""
    folder = tmp_path_factory.mktemp("mapped")
    i = IPM.motor.rated_current * np.linspace(-2.0, 2.0, 15)
    d, q = flux_from_current(IPM.motor.energy, *np.meshgrid(i, i, indexing="ij"))
    write_map(folder / "map.csv", FluxMap("map", i, i, d + IPM.motor.magnet_flux, q))
    rows = [f"{k} = {v!r}" for k, v in NUMBERS.items() if k in SHEET]
    text = "\n".join(["[motor]", *rows, '[flux_map]\nfile = "map.csv"', "cells = [14, 12]"])
    (folder / "map.toml").write_text(text + "\nsmooth = 1e-4\n")
    return dataclasses.replace(IPM, motor=load_drive(folder / "map.toml").motor)


def test_bumps_move_the_flux_by_one_weber_rms(mapped):
    """Fluxes at currents of the map with random sums of bumps, by Newton's method, less those
    without: 40 draws at 200 currents inside 1.2 times rated.  81 squares of the spacing, of which a
    wide bump's slope covers about five: 650 independent sums, 3 % of scatter in the rms, three of
    it; narrow bumps are finer than the cells, which take up to 6 % off (seen along q): 15 %."""
    motor, rng = mapped.motor, np.random.default_rng(3)
    basis = Basis(refined(motor.spline, 3, 2))
    energies = between(motor, basis, lambda i_d, _: np.ones_like(i_d))
    at = 1.2 * motor.rated_current * rng.uniform(-1.0, 1.0, (200, 2))
    where = [flux_newton(basis.of, *i, 0.0, 0.0)[:2] for i in at]
    size, moved = 1e-7, []
    for _ in range(40):
        cells = basis.cells(size * (energies @ rng.standard_normal(energies.shape[1]))[None])[
            ..., 0
        ]
        other = basis.of._replace(cells=np.ascontiguousarray(basis.of.cells + cells))
        there = [flux_newton(other, *i, *psi)[:2] for i, psi in zip(at, where, strict=True)]
        moved.append((np.array(there) - where) / size)
    each = np.sqrt(np.mean(np.square(moved), axis=(0, 1)))
    assert each == pytest.approx([math.sqrt(0.5), math.sqrt(0.5)], rel=0.15)


def test_points_are_apart_by_the_side_of_their_square(mapped):
    """15 by 15 points over 4 rated currents a side: four of them in 15, as each has its own part of
    the box; cells are cut until there are as many as points."""
    assert spacing(mapped.motor) == pytest.approx(4.0 * IPM.motor.rated_current / 15.0)
    assert parts_of(mapped.motor, mapped.motor.spline) == (2, 1)  # of 14 cells, and of 2 times 12
    coarse = mapped.motor.spline._replace(cells=mapped.motor.spline.cells[:6, :6])
    motor = dataclasses.replace(mapped.motor, spline=coarse)
    assert spacing(motor) == pytest.approx(4.0 * IPM.motor.rated_current / 6.0)


def test_a_map_is_off_by_what_is_missed_nearby():
    """Points 1 A apart, of which one at (3, 1) A misses 3 mWb and 24 others 1 mWb.  Far from it: 1
    mWb, but for the one point of the whole's mean square, (24 + 9)/25 mWb^2.  The mirrored point is
    the same."""
    d, q = (x.ravel() for x in np.meshgrid(np.arange(-3.0, 2.0), np.arange(-2.0, 3.0)))
    d, q = np.append(d[:-1], 3.0), np.append(q[:-1], 1.0)
    square = 1e-6 * np.append(np.ones(24), 9.0)
    off = Missed(d, q, 1.0, square)
    at = np.array([3.0, 3.0, -3.0])
    found = 1e6 * off.near(at, np.array([1.0, -1.0, 0.0])) ** 2
    mean = 33.0 / 25.0

    def by_hand(x, y):
        w = [
            math.exp(-0.5 * ((x - a) ** 2 + (abs(y) - abs(b)) ** 2))
            for a, b in zip(d, q, strict=True)
        ]
        return (sum(w) + 8.0 * w[-1] + mean) / (sum(w) + 1.0)

    expected = [by_hand(3.0, 1.0), by_hand(3.0, 1.0), by_hand(-3.0, 0.0)]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert found[0] > 3.0 > 1.1 > found[2] > 1.0


def test_few_columns_have_the_covariance_of_many():
    spread = np.random.default_rng(2).standard_normal((5, 12))
    few = factor(spread)
    assert few.shape == (5, 5)
    np.testing.assert_allclose(few @ few.T, spread @ spread.T, rtol=1e-12)
    assert factor(spread[:, :3]).shape == (5, 3)


def test_what_directions_left_away_leave_in_the_readings(mapped, monkeypatch):
    """With one direction fewer `beyond` is larger by what a replay with that one's energy added
    differs by: mean square over the noise's.  A tenth of the size, times 100: to second order the
    rest is a share of it; the algebra takes the path as it was, and its own first row as settled,
    which the tolerance of 5 % covers (`test_map_error` has the slopes themselves within 1 %)."""
    stated = dict.fromkeys(("inductance_d", "inductance_q"), 0.1)
    campaign = Campaign("own", mapped, (record({}, "driven", 20.0),), stated, {}, False)
    point = ParameterPoint(prepare(campaign, steps=1), complete(mapped.motor, mapped.converter))
    found = []
    for most in (1, 2):
        monkeypatch.setattr(map_modes, "MAX_DIRECTIONS", most)
        found.append(with_modes(point, EVERYWHERE).prepared.map_error)
    fewer, whole = found
    assert len(whole.x) == 2
    moved = with_map_error(point.prepared, whole.moved({1: 0.1}))
    reads = [replay(p, [{}]).currents[0] for p in (point.prepared, moved)]
    size = 100.0 * np.mean((reads[1] - reads[0]) ** 2) / point.prepared.noise_std**2
    assert fewer.beyond - whole.beyond == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize(("share", "count"), [(0.03, 1), (0.4, 8), (1.0, 20)])
def test_parts_of_a_recording_hold_a_share_of_it_evenly(share, count):
    """10000 samples, at least 500 in a row (or what the share has): middles lie as far apart as the
    whole divided."""
    parts = spread(10_000, share, 500.0)
    assert len(parts) == count
    assert sum(p.stop - p.start for p in parts) == pytest.approx(share * 10_000, abs=count)
    middles = [0.5 * (p.start + p.stop) for p in parts]
    assert middles == pytest.approx([(k + 0.5) * 10_000 / count for k in range(count)], abs=1.0)
    assert parts[0].start >= 0
    assert parts[-1].stop <= 10_000
