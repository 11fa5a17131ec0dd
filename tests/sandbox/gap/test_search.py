"""The search's own parts: sizes tried away from neutral, rivals moved to their top, what remains, what is held."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from model.effects.library import effect_names, load_effect, moved, neutral, same_numbers, typical
from sandbox.gap.evidence.algebra import prior_of
from sandbox.gap.evidence.discrepancy import IMITATED, STRETCH, remainder, stretched
from sandbox.gap.evidence.fit import coordinates_of, fit, objective, stray
from sandbox.gap.evidence.gap_size import rms
from sandbox.gap.evidence.holdout import weights_of
from sandbox.gap.evidence.normal import normal
from sandbox.gap.evidence.probes import Probe, probes_at_typical
from sandbox.gap.evidence.spike_slab import SIZES, ordinary_share, settled, table
from sandbox.gap.location.where import held_at_neutral
from sandbox.gap.search.forward import search
from sandbox.gap.search.judged import judge
from sandbox.gap.search.multistart import with_sizes
from sandbox.gap.search.neighbours import pointed
from sandbox.gap.search.points import own_values
from sandbox.plant.sets import complete
from sandbox.recordings.writing import write_campaign
from tests.sandbox.gap.conftest import DRIVE, small_campaign
from tests.sandbox.gap.test_evidence import start

LATE = 8e-5  # s, a third of a period: beyond the zero vector, where the slope at zero says nothing


@pytest.mark.parametrize("effect", effect_names())
def test_values_of_an_effect_are_a_set_with_all_others_off(effect):
    """Saturation and cross-saturation hold one number under two names: neither comes without the other."""
    motor, converter = DRIVE.motor, DRIVE.converter
    first, given = same_numbers(), {}
    for name, value in typical(effect, motor, converter).items():
        given |= moved(first.get(name, name), value)
    whole = complete(motor, converter, {**neutral(motor), **given})
    own = own_values((effect,), whole)
    assert complete(motor, converter, {**neutral(motor), **own}) == whole


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """A point of a campaign whose pulses come a third of a period late."""
    campaign = small_campaign({"pwm_delay.delay": LATE})
    return start(write_campaign(tmp_path_factory.mktemp("late") / "late", campaign))


@pytest.fixture(scope="module")
def with_dead_time(small_folder):
    return start(small_folder)


def tried(at, probe):
    """Return the null fit of a point and a probe after its sizes were tried there."""
    weights = weights_of(len(at.prepared.recordings))
    null = fit(at, (), weights)
    n = normal(null.point, coordinates_of(null.point, ()))
    (told,), cost = with_sizes(null, [probe], n, prior_of(n.coordinates), weights, 1)
    return null, told, cost


def test_a_size_that_was_tried_gains_what_a_fit_gains(tmp_path):
    """Dead time is an ordinary deviation, too: the size tried has to stay, not to be taken back to within its prior.

    Two typical sizes are put in, one of those tried, so most of what a fit with it free gains is gained: a size of
    three, half way to the next one tried, would lose (1/2)^2 of it, were the objective a parabola through none and two.
    Of the multiples -4, -2, 2, 4 of 2 us a drive can have three: -5 us is the least.
    """
    size = 2.0 * load_effect("dead_time").parameters[0].typical_for(DRIVE.motor, DRIVE.converter)
    at = start(write_campaign(tmp_path / "dead", small_campaign({"dead_time.time": size})))
    null, told, cost = tried(at, Probe("dead_time", {}))
    free = fit(null.point, ("dead_time",), weights_of(len(at.prepared.recordings)))
    assert told.sized["dead_time.time"] == pytest.approx(size, rel=1e-9)
    whole = 0.5 * (null.objective - free.objective)
    assert (1.0 - 0.5**2) * whole < told.gain <= whole
    assert cost == 3.0


def test_a_delay_beyond_the_zero_vector_is_found_from_a_size_that_was_tried(late):
    """A fit from there ends at noise, one from neutral nearer to neutral than to the truth.

    The rms of 14400 readings scatters by (2 * 14400)^(-1/2) = 0.6 %; the simulator may miss as much: four times that.
    """
    weights = weights_of(len(late.prepared.recordings))
    null, told, cost = tried(late, Probe("pwm_delay", {}))
    assert told.sized["pwm_delay.delay"] == pytest.approx(LATE, rel=1e-9)  # four typical sizes
    assert cost == 3.0  # a delay has no sign; four sizes were best, so eight are tried
    at = null.point.__class__(null.point.prepared, {**null.point.values, **told.sized}, null.point.turns)
    found = fit(at, ("pwm_delay",), weights)
    from_neutral = fit(null.point, ("pwm_delay",), weights)
    assert rms(found.normal, range(4)) == pytest.approx(1.0, abs=0.024)
    assert from_neutral.point.values["pwm_delay.delay"] < 0.5 * LATE  # the slope at zero leads elsewhere
    best = max(search(late, weights).judged, key=lambda j: j.log_evidence)
    assert "pwm_delay" in best.effects


def test_a_rival_stands_at_the_top_that_slopes_promise(with_dead_time):
    """Beside ordinary sizes of all effects: most of what slopes promise is reached, and the rest is no evidence."""
    weights = weights_of(len(with_dead_time.prepared.recordings))
    found = fit(with_dead_time, ("dead_time",), weights)
    chosen = probes_at_typical(with_dead_time)
    first = table(found.point, chosen, found.effects, ordinary_share(1.0), weights, 1)
    prior = first.prior(found.effects)
    last, unmet, cost = settled(first, prior, weights, 1)
    reached = objective(first.normal, prior, weights) - objective(last.normal, prior, weights)
    promised = objective(first.normal, prior, weights) - first.equations.most_probable(prior)[2]
    assert promised > 1.0  # there is something to reach
    assert reached > unmet >= 0.0
    assert cost >= 1.0
    told = judge(found, chosen, ordinary_share(1.0), weights, 1)
    assert told.log_evidence == pytest.approx(last.log_evidence(found.effects) - 0.5 * unmet)


def test_angles_of_recordings_stay_in_reach_where_effects_are_held(with_dead_time):
    weights = weights_of(len(with_dead_time.prepared.recordings))
    found = fit(with_dead_time, ("dead_time",), weights)
    j = judge(found, probes_at_typical(with_dead_time), ordinary_share(1.0), weights, 1)
    prior = held_at_neutral(j, ["dead_time"])
    turns = [k for k, c in enumerate(j.normal.coordinates) if c.form == "turn"]
    assert len(turns) == len(with_dead_time.prepared.recordings)
    assert np.all(prior.deviation[turns] > 0.0)


def test_ordinary_sizes_grow_with_the_gap_and_stay_below_what_a_claim_may_be():
    """A claim is averaged over sizes (`table.SIZES`, shares of the same prior): the least of them is still wider."""
    shares = [ordinary_share(rms) for rms in (0.0, 1.0, 3.0, 10.0, 100.0, 1e6)]
    assert all(0.0 < a <= b for a, b in itertools.pairwise(shares))
    assert shares[0] < shares[-1] < min(SIZES)


class Has:
    """What is read of a fit without effects: one block of a given mean square over its floor."""

    effects = ()

    def __init__(self, square):
        segment = SimpleNamespace(recording=0, rr=np.array([1e6 * square]), n=np.array([1e6]))
        self.normal = SimpleNamespace(segments=(segment,))


def log_odds(before, after):
    """Return the log odds that something outside the library is at work, for mean squares before and after."""
    unknown = remainder(Has(before), Has(after)).unknown
    return math.log(unknown / (1.0 - unknown))


def test_what_remains_is_weighed_against_the_gap():
    """More left is more suspicious, by as much for every doubling; the same left of a larger gap is less so."""
    for before in (2.0, 11.0, 1000.0):
        doubled = [log_odds(before, 1.0 + x) for x in (0.01, 0.02, 0.04, 0.08)]
        steps = np.diff(doubled)
        assert steps[0] > 0.0
        assert steps == pytest.approx(steps[0], rel=1e-6)
    assert log_odds(2.0, 1.05) > log_odds(11.0, 1.05) > log_odds(1000.0, 1.05)
    assert log_odds(11.0, 0.9) == log_odds(11.0, 1.0) < math.log(0.05)  # at the noise floor: next to nothing left
    assert log_odds(11.0, 11.0) > math.log(20.0)  # a gap of ten times the noise's square, none of it explained


def test_share_explained_is_that_of_the_excess():
    """J^2 from 11 to 1.5: the excess of 10 falls to 0.5, 95 % are explained; nothing where there was no excess."""
    told = remainder(Has(11.0), Has(1.5))
    assert (told.before, told.after, told.explained) == pytest.approx((10.0, 0.5, 0.95))
    assert remainder(Has(11.0), Has(12.0)).explained == 0.0
    assert remainder(Has(0.98), Has(0.97)).explained == 0.0


def test_a_stretched_deviation_is_weighed_by_the_ratio_of_densities(small_folder):
    """One of the deviations, it is not known which, from a wider Gaussian: SciPy's densities."""
    at = start(small_folder)
    found = fit(at, ("dead_time",), weights_of(len(at.prepared.recordings)))
    z = np.array([
        (x - c.mean) / c.deviation for c, x in zip(found.coordinates, found.normal.x, strict=True)
        if c.form != "turn" and c.effect != "dead_time"
    ])  # fmt: skip
    expected = np.mean(norm.pdf(z, 0.0, STRETCH) / norm.pdf(z))
    assert stretched(found) == pytest.approx(expected)
    alone = fit(at, (), weights_of(len(at.prepared.recordings)))
    quiet, doubted = (remainder(alone, f).unknown for f in (replace(found, effects=()), found))
    odds = [x / (1.0 - x) for x in (quiet, doubted)]
    assert odds[1] - odds[0] == pytest.approx(IMITATED[1] * expected, rel=1e-6)


def test_what_an_effect_claims_is_no_ordinary_deviation(with_dead_time):
    """Cross-saturation's coordinates bear saturation's name; dead time has an ordinary deviation of its own."""
    weights = weights_of(len(with_dead_time.prepared.recordings))
    for effect, claimed in (("cross_saturation", "saturation.alpha_12"), ("dead_time", "dead_time.time")):
        told = stray(fit(with_dead_time, (effect,), weights))
        assert claimed not in told
        assert "saturation.alpha_30" in told


def test_a_stretched_deviation_points_to_its_effect(tmp_path):
    """Resistance 60 % off where unequal gains were found in its place: the one set tried is the resistance."""
    ohm = DRIVE.motor.resistance
    folder = write_campaign(tmp_path / "wrong", small_campaign({"stator_resistance.resistance": 1.6 * ohm}))
    at = start(folder)
    weights = weights_of(len(at.prepared.recordings))
    chosen = probes_at_typical(at)
    gain = judge(fit(at, ("current_gain",), weights), chosen, ordinary_share(1.0), weights, 1)
    (found,) = pointed(gain, {}, {("current_gain",)}, chosen, weights, 1)
    assert "stator_resistance" in found.effects
    assert found.objective < 0.1 * gain.fit.objective
    right = judge(fit(at, ("stator_resistance",), weights), chosen, ordinary_share(1.0), weights, 1)
    assert pointed(right, {}, {right.effects}, chosen, weights, 1) == []
