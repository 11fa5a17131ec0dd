"""The search's own parts: sizes tried away from neutral, rivals moved to their top, what remains, what is held."""

import math

import numpy as np
import pytest

from model.effects.library import load_effect
from sandbox.campaign import write_campaign
from sandbox.gap.evidence import prior_of
from sandbox.gap.fit import coordinates_of, fit, objective
from sandbox.gap.normal import normal
from sandbox.gap.probes import Probe, probes_at_typical
from sandbox.gap.remainder import FLOOR, SHARE, remainder
from sandbox.gap.search import judge, search
from sandbox.gap.sized import with_sizes
from sandbox.gap.split import weights_of
from sandbox.gap.table import LARGEST, SMALL, ordinary_share, settled, table
from sandbox.gap.where import _held
from tests.sandbox.gap.conftest import DRIVE, small_campaign
from tests.sandbox.gap.test_evidence import start

LATE = 8e-5  # s, a third of a period: beyond the zero vector, where the slope at zero says nothing


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

    Two typical sizes are put in, so the gain is that of a fit with it free, within a tenth: what ordinary deviations
    still gain by new slopes.
    """
    size = 2.0 * load_effect("dead_time").parameters[0].typical_for(DRIVE.motor, DRIVE.converter)
    at = start(write_campaign(tmp_path / "dead", small_campaign({"dead_time.time": size})))
    null, told, cost = tried(at, Probe("dead_time", {}))
    free = fit(null.point, ("dead_time",), weights_of(len(at.prepared.recordings)))
    assert told.sized["dead_time.time"] == pytest.approx(size, rel=1e-9)
    whole = 0.5 * (null.objective - free.objective)
    assert 0.9 * whole < told.gain <= whole
    assert 2.0 <= cost <= 4.0


def test_a_delay_beyond_the_zero_vector_is_found_from_a_size_that_was_tried(late):
    weights = weights_of(len(late.prepared.recordings))
    null, told, _ = tried(late, Probe("pwm_delay", {}))
    assert told.sized["pwm_delay.delay"] == pytest.approx(LATE, rel=0.01)  # four typical sizes
    at = null.point.__class__(null.point.prepared, {**null.point.values, **told.sized}, null.point.turns)
    found = fit(at, ("pwm_delay",), weights)
    from_neutral = fit(null.point, ("pwm_delay",), weights)
    assert found.objective < 0.2 * from_neutral.objective  # the slope at zero leads elsewhere
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
    value = objective(last.normal, prior, weights)
    assert value <= objective(first.normal, prior, weights)
    promised = objective(first.normal, prior, weights) - first.equations.most_probable(prior)[2]
    assert promised > 1.0
    assert unmet < 0.5 * promised  # slopes err by what they change on the way; what no step reached is told
    assert cost >= 1.0
    told = judge(found, chosen, ordinary_share(1.0), weights, 1)
    assert told.log_evidence == pytest.approx(last.log_evidence(found.effects) - 0.5 * unmet)


def test_angles_of_recordings_stay_in_reach_where_effects_are_held(with_dead_time):
    weights = weights_of(len(with_dead_time.prepared.recordings))
    found = fit(with_dead_time, ("dead_time",), weights)
    j = judge(found, probes_at_typical(with_dead_time), ordinary_share(1.0), weights, 1)
    prior = _held(j, ["dead_time"])
    turns = [k for k, c in enumerate(j.normal.coordinates) if c.form == "turn"]
    assert len(turns) == len(with_dead_time.prepared.recordings)
    assert np.all(prior.deviation[turns] > 0.0)


def test_ordinary_sizes_grow_with_the_gap_up_to_a_bound():
    assert ordinary_share(0.0) == SMALL
    assert ordinary_share(7.0) == pytest.approx(2.0 * SMALL)
    assert ordinary_share(1e6) == LARGEST


def test_what_remains_is_weighed_against_what_the_simulator_misses(with_dead_time):
    """A remainder as large as what is missed: exp(-3.3) to 1; twice that is 2^4 times as likely (the slope's 4)."""

    class Has:  # a fit with one segment of a given mean square
        def __init__(self, square):
            segment = type("S", (), {"recording": 0, "rr": np.array([square]), "n": np.array([1.0])})
            self.normal = type("N", (), {"segments": (segment,)})

    before = 11.0
    missed = FLOOR + SHARE * (before - 1.0)
    once, twice = (remainder(Has(before), Has(1.0 + k * missed)) for k in (1.0, 2.0))

    def odds(r):
        return r.unknown / (1.0 - r.unknown)

    assert odds(once) == pytest.approx(math.exp(-3.3), rel=1e-6)
    assert odds(twice) / odds(once) == pytest.approx(16.0, rel=1e-6)
    assert once.explained == pytest.approx(1.0 - missed / 10.0)
