"""Sets of effects by algebra: prior, climb, inclusion, against closed forms and full enumeration."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from model.effects import library
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.spike_slab import Table
from sandbox.gap.search.inclusion import summed
from sandbox.gap.search.subsets import Subsets, log_prior, possible

NAMES = ("a", "b", "c", "d", "e", "f")
TRUE = (3.0, 0.0, -2.0, 0.0, 0.0, 1.5)  # sizes in deviations of the wide prior; noise is 1


def linear_table(seed: int) -> Table:
    """Return the equations of 400 readings of six effects, one coordinate each, two of them alike to 0.8."""
    rng = np.random.default_rng(seed)
    j = rng.standard_normal((400, 6))
    j[:, 1] = 0.8 * j[:, 0] + 0.6 * j[:, 1]
    r = j @ np.array(TRUE) + rng.standard_normal(400)
    none, wide = np.zeros(6), np.full(6, np.inf)
    narrow = Prior(none, np.full(6, 0.01), -wide, wide)
    equations = Algebra(j.T @ j, j.T @ r, float(r @ r), none)
    members = {name: (k,) for k, name in enumerate(NAMES)}
    of_effects = np.ones(6, dtype=bool)
    return Table(None, None, equations, narrow, narrow.with_deviation(np.ones(6)), members, of_effects)  # type: ignore[arg-type]


def test_the_prior_over_sets_sums_to_one():
    """C(n, k) sets have k effects; NUMBER and MORE of `subsets` sum to 1 by construction."""
    names = library.effect_names()
    total = sum(math.comb(len(names), k) * math.exp(log_prior(names[:k])) for k in range(len(names) + 1))
    assert total == pytest.approx(1.0, abs=1e-12)
    assert log_prior(()) == pytest.approx(math.log(0.57))
    assert log_prior(names[:1]) == pytest.approx(math.log(0.2565 / len(names)))


@pytest.mark.parametrize("seed", range(3))
def test_the_climb_ends_where_enumeration_does(seed):
    sets = Subsets(linear_table(seed), 1.0)
    every = [s for n in range(7) for s in itertools.combinations(NAMES, n)]
    best = max(every, key=Subsets(linear_table(seed), 1.0).weigh)
    assert sets.climb()[0] == best == ("a", "c", "f")  # sizes of 1.5 and more at 20 readings a unit: 30 deviations
    assert sets.climb(NAMES)[0] == best  # from all of them, too
    assert len(sets.known) < len(every)


def test_a_glance_ranks_as_hypotheses_are_weighed_but_for_sizes():
    """Without bounds both are the same Gaussian where the true effects are claimed (else traces run into their bounds);
    the mean over four sizes adds at most nothing to the best of them and takes at most log 4 an effect, where narrower
    priors add up to log 8 (the narrowest's factor)."""
    sets = Subsets(linear_table(0), 1.0)
    every = [(*s, "a", "c", "f") for n in range(4) for s in itertools.combinations(("b", "d", "e"), n)]
    for s, told in zip(every, sets.glance(every), strict=True):
        assert -math.log(4.0) * len(s) - 0.1 < sets.weigh(s) - told < math.log(8.0) * len(s) + 0.1


def test_a_size_that_bounds_forbid_hides_no_other_effect():
    """Orthogonal effects of 400 readings; `b` would gain 0.5 x 400 x 30^2 = 180 000 if it might be negative, and every
    set with it comes before `d`, which gains 0.5 x 400 x 0.36 = 72."""
    rng = np.random.default_rng(0)
    j = 20.0 * np.linalg.qr(rng.standard_normal((400, 6)))[0]
    r = j @ np.array([3.0, -30.0, -2.0, 0.6, 0.0, 1.5])
    t = linear_table(0)
    low = np.where(np.arange(6) == 1, 0.0, -np.inf)
    t = replace(t, equations=Algebra(j.T @ j, j.T @ r, float(r @ r), np.zeros(6)), wide=replace(t.wide, low=low))
    sets = Subsets(t, 1.0)
    assert sets.climb(("a", "c", "f"))[0] == ("a", "c", "d", "f")
    with_, without = sets.glance([("a", "b", "c", "f"), ("a", "c", "f")])
    assert with_ < without
    assert sets.weigh("abcf") < sets.weigh("acf")


def test_a_glance_frees_what_need_not_stay_at_its_bound():
    """Two effects alike to 0.99, least squares at (6, -5), both between 0 and 4: held at (4, 0) the second would hide
    what both reach, (1.05, 0).  Traces aside the glance is the log evidence of `algebra`."""
    t, two = linear_table(0), np.arange(6) < 2
    a = 1e4 * (np.eye(6) + 0.99 * (~np.eye(6, dtype=bool) & two & two[:, None]))
    at = np.array([6.0, -5.0, 0.0, 0.0, 0.0, 0.0])
    low, high = np.where(two, 0.0, -np.inf), np.where(two, 4.0, np.inf)
    equations = Algebra(a, a @ at, float(at @ a @ at), np.zeros(6))
    t = replace(t, equations=equations, wide=replace(t.wide, low=low, high=high))
    (told,) = Subsets(t, 1.0).glance([("a", "b")])
    prior = t.prior(("a", "b"))
    assert equations.most_probable(prior).x[:2] == pytest.approx([1.05, 0.0], abs=2e-4)
    assert told == pytest.approx(equations.log_evidence(prior) + log_prior(("a", "b")))
    assert told > -3000.0  # at (4, 0): -46 000


def test_what_is_part_of_another_is_not_claimed_with_it():
    assert not possible(("saturation", "cross_saturation"))
    assert possible(("saturation", "dead_time"))


def test_effects_that_stand_for_each_other_are_a_group():
    sets = {("a", "c"): 0.55, ("b", "c"): 0.44, ("c",): 0.01}
    found = summed(sets, ("a", "b", "c", "d"))
    assert found.chances["c"] == pytest.approx(1.0)
    assert found.chances["d"] == 0.0
    ((group, chance),) = found.groups
    assert set(group) == {"a", "b"}
    assert chance == pytest.approx(0.99)
    assert found.group_of("c") is None
