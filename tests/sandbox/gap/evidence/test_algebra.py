"""Evidence, normal equations, fits and the split, against integrals, differences and planted
answers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import truncnorm

from sandbox.gap.evidence import algebra as algebra_module
from sandbox.gap.evidence.algebra import Algebra, Prior, between_segments, sandwich
from sandbox.gap.evidence.fit import coordinates_of, fit
from sandbox.gap.evidence.normal import NormalEquations, Segment, normal, possible
from sandbox.gap.evidence.priors import Coordinate, of_effect
from sandbox.gap.posterior.candidates import at_typical
from sandbox.gap.posterior.holdout import choices, held_out, weights_of
from sandbox.gap.posterior.linear_model import Linearisation, linear_model
from sandbox.plant.sets import complete
from tests.sandbox.gap.conftest import DEAD_TIME, start


def test_slopes_next_to_what_no_drive_can_have_are_taken_to_the_other_side(small_folder):
    """A link that loses all but a fifth: the equations there are those a thousandth of the bound
    lower, where slopes are taken forwards, to that thousandth and little more; a load inertia next
    to the total one is no math error."""
    begin = start(small_folder)
    drive = begin.prepared.campaign.drive
    bound = 0.2 * drive.converter.dc_bus_voltage / drive.motor.rated_current
    found = []
    for sag in (bound * (1.0 - 1e-9), 0.999 * bound):
        values = complete(drive.motor, drive.converter, {**begin.values, "dc_link_error.sag": sag})
        own = [
            c
            for c in of_effect("dc_link_error", drive, begin.values, values)
            if c.names[0].endswith("sag")
        ]
        ahead = {**values, **own[0].changes(values, own[0].value(values) + 1e-4 * own[0].deviation)}
        assert possible(drive, ahead) == (sag < 0.9999 * bound)
        found.append(normal(replace(begin, values=values), own).summed()[0][0, 0])
    assert found[0] == pytest.approx(found[1], rel=5e-3)
    inertia = begin.values["inertia.inertia"]
    load = {"load_inertia": inertia * (1.0 - 2e-5), "stiffness": inertia * 2e-5 * 5000.0**2}
    shaft = complete(
        drive.motor, drive.converter, {f"shaft_compliance.{k}": v for k, v in load.items()}
    )
    n = normal(replace(begin, values=shaft), of_effect("shaft_compliance", drive, shaft, shaft))
    assert np.isfinite(n.summed()[0]).all()


@pytest.mark.parametrize("pull", [-6.0, -1.0, 0.0, 1.5, 8.0])
def test_evidence_of_a_size_that_can_only_be_positive_is_its_integral(pull):
    """Half a Gaussian prior times exp(pull x - a x^2/2), integrated numerically: another way than
    the closed form."""
    a, sd = 3.0, 0.7
    own = Algebra(np.array([[a]]), np.array([pull]), 5.0, np.array([0.0]))
    prior = Prior(np.array([0.0]), np.array([sd]), np.array([0.0]), np.array([np.inf]))

    def density(x):
        gauss = 2.0 / (sd * math.sqrt(2.0 * math.pi)) * math.exp(-0.5 * (x / sd) ** 2)
        return gauss * math.exp(-0.5 * (5.0 - 2.0 * pull * x + a * x * x))

    assert own.log_evidence(prior) == pytest.approx(math.log(quad(density, 0.0, 20.0)[0]), abs=1e-6)


@pytest.mark.parametrize("pull", [9.0, 14.0, -11.0])
def test_evidence_of_a_deviation_held_at_four_sigma_is_its_integral(pull):
    """A whole Gaussian prior cut off at four deviations, the likelihood's top beyond: integrated
    numerically."""
    a, sd = 3.0, 0.7
    own = Algebra(np.array([[a]]), np.array([4.0 * pull]), 5.0, np.array([0.0]))
    prior = Prior(np.array([0.0]), np.array([sd]), np.array([-4.0 * sd]), np.array([4.0 * sd]))

    def density(x):
        gauss = 1.0 / (sd * math.sqrt(2.0 * math.pi)) * math.exp(-0.5 * (x / sd) ** 2)
        return gauss * math.exp(-0.5 * (5.0 - 8.0 * pull * x + a * x * x))

    whole = quad(
        density, -4.0 * sd, 4.0 * sd, points=[math.copysign(4.0 * sd - 0.1, pull)], limit=200
    )[0]
    assert own.log_evidence(prior) == pytest.approx(math.log(whole), abs=1e-5)


@pytest.mark.parametrize("pull", [0.0, -0.5, -4.0])
@pytest.mark.parametrize("alike", [0.0, 0.9, -0.998])
def test_evidence_of_a_size_at_its_bound_beside_one_that_follows_is_the_integral(alike, pull):
    """A size that can only be positive, held at 0, beside a free coordinate with almost the same
    trace: the double integral, the free one's by the Gaussian formula, the other's numerically.
    Laplace is exact but for the tail's prior, so both agree to rounding."""
    a, sd = 9.0 * np.array([[1.0, alike], [alike, 1.0]]), np.array([0.7, 1.1])
    inner = np.array([pull, 0.0])
    # the free one pulls, too
    own = Algebra(a, inner + np.array([alike * 2.0, 2.0]), 5.0, np.zeros(2))
    prior = Prior(np.zeros(2), sd, np.array([0.0, -np.inf]), np.full(2, np.inf))
    m = a[1, 1] + sd[1] ** -2

    def density(x):
        """The free coordinate integrated out: with b = g - a x it is exp(b^2/2m)/(sd sqrt m)."""
        b = own.g[1] - a[0, 1] * x
        level = 5.0 - 2.0 * own.g[0] * x + a[0, 0] * x * x + (x / sd[0]) ** 2
        return (
            2.0
            / (sd[0] * math.sqrt(2.0 * math.pi))
            * math.exp(-0.5 * level + 0.5 * b * b / m)
            / (sd[1] * math.sqrt(m))
        )

    expected = math.log(quad(density, 0.0, 20.0, limit=200)[0])
    assert own.log_evidence(prior) == pytest.approx(expected, abs=1e-6)


def test_evidence_of_several_free_coordinates_is_the_gaussian_integral():
    """log N(y; 0, J P J' + 1) of data y = J x + noise: the marginal likelihood written in the
    data's own space."""
    rng = np.random.default_rng(1)
    j, y, sd = rng.normal(size=(9, 3)), rng.normal(size=9), np.array([0.5, 1.0, 2.0])
    far = np.full(3, np.inf)
    own = Algebra(j.T @ j, j.T @ y, float(y @ y), np.zeros(3))
    cov = j @ np.diag(sd**2) @ j.T + np.eye(9)
    expected = -0.5 * y @ np.linalg.solve(cov, y) - 0.5 * np.linalg.slogdet(cov)[1]
    assert own.log_evidence(Prior(np.zeros(3), sd, -far, far)) == pytest.approx(expected, abs=1e-9)


def test_most_probable_values_respect_bounds():
    """Two coordinates that pull against each other, one held at its bound: the other solves
    alone."""
    a = np.array([[2.0, 1.5], [1.5, 2.0]])
    own = Algebra(a, np.array([1.0, -4.0]), 9.0, np.zeros(2))
    prior = Prior(np.zeros(2), np.full(2, 10.0), np.array([-np.inf, 0.0]), np.full(2, np.inf))
    x, free, objective = own.most_probable(prior)
    assert x[1] == 0.0
    assert not free[1]
    assert x[0] == pytest.approx(1.0 / 2.01, rel=1e-12)
    assert objective == pytest.approx(9.0 - 1.0 / 2.01, rel=1e-12)


def test_blocks_of_white_noise_widen_nothing_and_equal_blocks_widen_by_their_number():
    """White: the sandwich is the plain covariance within sampling error; a residual repeated m
    times: m times it."""
    rng = np.random.default_rng(2)
    blocks, per, repeat = 4000, 20, 5
    j = rng.normal(size=(blocks, per, 1))
    r = rng.normal(size=(blocks, per))
    flat = Coordinate("x", 0.0, 1e6, "linear", ("x",))

    def widened(j, r):
        a = np.einsum("bij,bik->bjk", j, j)
        s = Segment(
            0,
            "current",
            np.array([0]),
            a,
            np.einsum("bij,bi->bj", j, r),
            (r**2).sum(1),
            np.full(len(r), 1.0),
        )
        n = NormalEquations((flat,), np.zeros(1), (s,), 1)
        total, g, _ = n.summed()
        plain = np.linalg.inv(total)
        return float(sandwich(n, plain @ g, plain)[0, 0] / plain[0, 0])

    assert widened(j, r) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / blocks))
    j, r = np.tile(j, (1, repeat, 1)), np.tile(r, (1, repeat))
    assert widened(j, r) == pytest.approx(repeat, abs=repeat * 4.0 * math.sqrt(2.0 / blocks))


def test_normal_equations_are_the_change_of_the_residual(small_folder):
    """r'r at a displaced point against r'r - 2 d'g + d'A d: a difference of two replays, not of
    slopes."""
    at = start(small_folder)
    coordinates = coordinates_of(at, ("iron_loss",))
    n = normal(at, coordinates)
    a, g, ssr = n.summed()
    place = {c.label: k for k, c in enumerate(n.coordinates)}
    for label in (
        "stator_resistance.resistance",
        "iron_loss.core_resistance",
        "turn:locked_slow.parquet",
        "turn:driven_fast.parquet",
        "current_gain.gain_b",
    ):
        k = place[label]
        d = np.zeros(len(n.x))
        d[k] = 0.01 * n.coordinates[k].deviation
        moved = normal(at.moved(n.coordinates, n.x + d), coordinates).summed()[2]
        linear = ssr - 2.0 * d @ g + d @ a @ d
        assert moved - ssr == pytest.approx(linear - ssr, rel=0.02, abs=1e-3), label


def test_fit_finds_a_planted_dead_time(small_folder):
    at = start(small_folder)
    f = fit(at, ("dead_time",), weights_of(len(at.prepared.recordings)))
    assert f.point.values["dead_time.time"] == pytest.approx(DEAD_TIME, rel=0.02)
    ssr = sum(float(s.ssr.sum()) for s in f.normal.segments)
    count = sum(float(s.n.sum()) for s in f.normal.segments)
    assert math.sqrt(ssr / count) < 1.05  # 4 x 3 x 1200 readings: white noise gives 1 +- 0.006


def test_split_does_not_look_at_readings(small_folder):
    """The same recordings with other currents are split alike; every kind of rotor keeps a
    recording to fit."""
    at = start(small_folder)

    def split(point):
        """Return the split by the slopes of all effects at a point."""
        return held_out(
            linear_model(
                point,
                at_typical(point),
                (),
                Linearisation(1.0),
                weights_of(len(at.prepared.recordings)),
            )
        )

    left = split(at)
    noisy = tuple(replace(r, read=r.read + 3.0) for r in at.prepared.recordings)
    assert split(replace(at, prepared=replace(at.prepared, recordings=noisy))) == left
    rotors = [r.rotor for r in at.prepared.recordings]
    assert {rotors[k] for k in range(len(rotors)) if k not in left} == set(rotors)


def test_a_kind_that_is_there_once_is_never_held_out():
    assert choices(["locked", "free", "free"]) == [(1,), (2,)]
    assert choices(["locked"]) == [()]
    assert len(choices(["locked"] * 5)) == 10


def test_segments_that_disagree_widen_estimates_by_as_much_as_they_scatter():
    """k segments of equal size, each with a bias of its own: the mean's variance is (bias^2 +
    noise^2 / m) / k.

    Over 400 draws its average is known to sqrt(2 / (k - 1) / 400), a chi-square with k - 1 degrees
    of freedom.
    """
    rng = np.random.default_rng(3)
    k, m, bias, draws = 8, 50, 0.4, 400
    flat = Coordinate("x", 0.0, 1e6, "linear", ("x",))
    found = []
    for _ in range(draws):
        r = rng.normal(size=(k, m)) + bias * rng.normal(size=(k, 1))
        one = np.ones((m, 1, 1))
        segments = tuple(
            Segment(s, "current", np.array([0]), one, r[s][:, None], r[s] ** 2, np.ones(m))
            for s in range(k)
        )
        n = NormalEquations((flat,), np.zeros(1), segments, 1)
        a, g, _ = n.summed()
        plain = np.linalg.inv(a)
        found.append(float(between_segments(n, plain @ g, plain)[0, 0]))
    true = (bias**2 + 1.0 / m) / k
    assert np.mean(found) == pytest.approx(true, rel=4.0 * math.sqrt(2.0 / (k - 1) / draws))


def test_bounded_most_probable_point_is_that_of_an_independent_minimiser():
    """L-BFGS-B on the same objective, in scipy; 20 draws of ten coordinates of which some are held
    at a bound."""
    from scipy.optimize import minimize

    rng = np.random.default_rng(4)
    held = 0
    for _ in range(20):
        j, y = rng.normal(size=(30, 10)), 3.0 * rng.normal(size=30)
        deviation = 10.0 ** rng.uniform(-1.0, 1.0, 10)
        low, high = np.zeros(10), np.full(10, 0.3)
        prior = Prior(np.zeros(10), deviation, low, high)
        start = rng.uniform(0.0, 0.3, 10)
        r = y - j @ start
        x, free, value = Algebra(j.T @ j, j.T @ r, float(r @ r), start).most_probable(prior)

        def cost(z, j=j, y=y, deviation=deviation):
            return float(np.sum((y - j @ z) ** 2) + np.sum((z / deviation) ** 2))

        found = minimize(
            cost,
            start,
            bounds=list(zip(low, high, strict=True)),
            options={"ftol": 1e-15, "gtol": 1e-10},
        )
        assert value == pytest.approx(cost(x), rel=1e-10)
        assert value <= found.fun * (1.0 + 1e-9)
        held += int((~free).sum())
    assert held > 50  # bounds did act


@pytest.mark.parametrize("exchanges", [20, 0])
def test_both_ways_to_bounds_meet_the_conditions_of_a_minimum(exchanges, monkeypatch):
    """Karush, Kuhn, Tucker: no slope where free, a slope outwards at a bound; the slow way, too,
    which takes over."""
    monkeypatch.setattr(algebra_module, "EXCHANGES", exchanges)
    slow, asked = algebra_module.lsq_linear, []
    monkeypatch.setattr(
        algebra_module, "lsq_linear", lambda *given, **more: asked.append(1) or slow(*given, **more)
    )
    rng = np.random.default_rng(7)
    for _ in range(20):
        j = rng.normal(size=(60, 30)) * np.exp(2.0 * rng.normal(size=30))
        hessian, pull = j.T @ j + np.eye(30), 50.0 * rng.normal(size=30)
        low = np.where(rng.random(30) < 0.5, 0.0, -rng.random(30))
        high = low + 3.0 * rng.random(30)
        x, free = algebra_module.within_bounds(hessian, pull, low, high)
        outwards = pull - hessian @ x
        assert np.abs(outwards[free]).max(initial=0.0) < 1e-9 * np.abs(pull).max()
        # rounding of values below 10
        at_low, at_high = (np.abs(x - bound) < 1e-12 for bound in (low, high))
        assert (outwards[at_low] <= 0.0).all()
        assert (outwards[at_high] >= 0.0).all()
        assert np.array_equal(free, (x > low) & (x < high) & ~at_low & ~at_high)
        assert 0 < free.sum() < 30
    assert len(asked) == (20 if exchanges == 0 else 0)  # exchanges alone end in each of these


def test_equations_kept_from_one_point_to_another_have_the_other_point_s_residuals(small_folder):
    """The same slopes, residuals of a replay at the other point: r'r as taken anew, g = J' r with
    the old J."""
    at = start(small_folder)
    coordinates = coordinates_of(at, ())
    n = normal(at, coordinates)
    d = np.array([0.5 * c.deviation for c in n.coordinates])
    other = at.moved(n.coordinates, n.x + d)
    kept, anew = n.at(other), normal(other, coordinates)
    assert kept.summed()[2] == pytest.approx(anew.summed()[2], rel=1e-9)
    assert np.array_equal(kept.summed()[0], n.summed()[0])
    assert kept.x == pytest.approx(anew.x, rel=1e-12)
    # halfway by old slopes: the true change of r'r over a small step along d is -2 e d'g of the
    # point itself
    slope = anew.summed()[1] @ d
    # slopes change little over half a deviation
    assert kept.summed()[1] @ d == pytest.approx(slope, rel=0.1)


@pytest.mark.parametrize("slope", [0.5, 3.0, 400.0])
def test_a_value_held_at_its_bound_may_lie_as_far_as_its_tail(slope):
    """One size that can only be positive beside a free one: the quantile of a truncated normal
    (scipy.stats), the other integrated out."""
    a = np.array([[4.0, 1.0], [1.0, 9.0]])
    x = np.array([0.0, 0.5])
    prior = Prior(
        np.array([0.0, 0.5]),
        np.array([2.0, 1.0]),
        np.array([0.0, -np.inf]),
        np.array([np.inf, np.inf]),
    )
    own = Algebra(a, np.array([-slope, 0.0]), 10.0, x)
    precision = a + np.diag([0.25, 1.0])
    spread = np.sqrt(np.linalg.inv(precision)[0, 0])
    middle = -slope * spread**2
    expected = truncnorm(-middle / spread, np.inf, middle, spread).isf(0.05)
    tail = own.tails(prior)
    assert tail[0] == pytest.approx(expected, rel=1e-6)
    assert tail[1] == 0.0


def test_the_sign_of_currents_is_freed_near_the_floor_only(small_answers):
    """Dead time of 2 us, nobody's in the nominal model, leaves tens of floors: there the sign keeps
    its usual width."""
    d = small_answers.diagnosis
    sign = {"bench.soft_current", "bench.soft_shape"}
    assert d.size.before > 3.0 > d.size.after
    assert not sign & {c.label for c in d.before.coordinates}
    # by its logarithm, there and back
    kept = pytest.approx(d.start.values["bench.soft_current"], rel=1e-12)
    assert d.before.point.values["bench.soft_current"] == kept
    assert sign <= {c.label for c in d.after.coordinates}
