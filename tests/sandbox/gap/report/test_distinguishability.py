"""How alike two hypotheses are: the cosine against plain regression on dense slopes, the way
against both fits."""

from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.normal import normal
from sandbox.gap.posterior.candidates import at_typical
from sandbox.gap.posterior.evaluated import evaluate
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.hypotheses import Hypothesis
from sandbox.gap.posterior.linear_model import Linearisation
from sandbox.gap.report.distinguishability import alike
from sandbox.gap.settings import USUAL
from tests.sandbox.gap.conftest import start

SETS = (("dead_time",), ("device_drop",))


@pytest.fixture(scope="module")
def pair(small_folder):
    at = start(small_folder)
    weights = weights_of(len(at.prepared.recordings))
    chosen = [
        p for p in at_typical(at) if p.effect in ("dead_time", "device_drop", "encoder_offset")
    ]
    return [
        evaluate(fit(at, effects, weights), chosen, Linearisation(USUAL.trace_at(1.0)), weights)
        for effects in SETS
    ]


def diagnosis(judged, temperature=1.0):
    members = tuple(Hypothesis(j.effects, 0.5, j) for j in judged)
    return SimpleNamespace(ambiguity_set=members, variance=temperature, evaluated=tuple(judged))


def left(columns, target, deviation):
    """Squares that regression with Gaussian priors leaves of a target: extra rows 1/deviation
    (ridge), by lstsq."""
    rows = np.vstack([columns, np.diag(1.0 / deviation)])
    aim = np.concatenate([target, np.zeros(len(deviation))])
    rest = aim - rows @ np.linalg.lstsq(rows, aim, rcond=None)[0]
    return rest @ rest


def test_the_cosine_is_that_of_plain_regression_on_dense_slopes(pair):
    drop = pair[1]
    t, effect, rival = drop.model, "device_drop", "dead_time"
    own = [c for c in t.coordinates if c.form != "turn"]
    n = normal(drop.fit.point, own)  # a table keeps the slopes of where it began
    dense = np.zeros((sum(len(r) for r in n.rows), len(n.x)))
    at = 0
    for s, rows in zip(n.segments, n.rows, strict=True):
        dense[at : at + len(rows), s.places] = rows
        at += len(rows)
    wide = t.prior(drop.effects)
    move = t.equations.most_probable(wide)[0] - wide.mean
    places = [k for k in t.members[effect] if t.of_effects[k]]
    target = dense[:, places] @ move[places]
    squares = []
    for claimed in ((), (rival,)):
        prior = t.prior(claimed)
        others = [k for k in np.flatnonzero(prior.deviation > 0.0) if k not in places]
        squares.append(left(dense[:, others], target, prior.deviation[others]))
    found = alike(diagnosis(pair))
    assert found is not None
    assert found.cosines[effect] == pytest.approx(np.sqrt(1.0 - squares[1] / squares[0]), rel=1e-6)


def test_the_way_ends_at_both_fits(pair):
    """Same smoothing for both, so the ends are what the fits reached; temperature divides."""
    found, halved = alike(diagnosis(pair)), alike(diagnosis(pair, 2.0))
    assert found is not None
    assert halved is not None
    assert (found.first, found.second) == SETS
    reached = [-0.5 * sum(float(s.ssr.sum()) for s in j.fit.normal.segments) for j in pair]
    told = found.log_likelihood
    assert told[-1] - told[0] == pytest.approx(reached[0] - reached[1], abs=0.5)
    assert max(told) == 0.0
    assert np.array(halved.log_likelihood) == pytest.approx(0.5 * np.array(told), rel=1e-12)


def test_one_hypothesis_has_no_rival(pair):
    assert alike(diagnosis(pair[:1])) is None


def test_what_was_not_fitted_has_no_fit_to_go_to(pair):
    """A shaft's compliance by algebra, say, whose load's inertia is still 0."""
    one = diagnosis(pair)
    one.evaluated = (pair[0],)
    assert alike(one) is None
