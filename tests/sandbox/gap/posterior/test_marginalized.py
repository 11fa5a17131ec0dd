"""A regression beside the effects: its algebra against dense least squares, and a current nobody
listed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.gap.evidence.normal import NormalEquations, Segment
from sandbox.gap.posterior.marginalized import Joint, integrated_out, marginalized
from sandbox.gap.report.inclusion import by_algebra
from tests.sandbox.gap.conftest import DEAD_TIME


def dense(seed=0, n=60, p=3, q=5):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, p)), rng.normal(size=(n, q)), rng.normal(size=n)


def test_integrating_a_regression_out_leaves_its_ridge_estimate():
    """min over c of |r - J x - X c|^2 + ridge |c|^2, solved as one stacked least-squares problem by
    numpy.lstsq."""
    j, x, r = dense()
    p, q, ridge = j.shape[1], x.shape[1], 0.3
    both = np.hstack([j, x])
    joint = Joint(
        (both.T @ both)[None],
        (both.T @ r)[None],
        np.r_[np.zeros(p), np.full(q, len(r))][None],
        np.zeros(p + q),
        np.zeros(p + q),
        tuple(("current", "current", 0) for _ in range(q)),
    )
    segment = Segment(
        0,
        "current",
        np.arange(p),
        (j.T @ j)[None],
        (j.T @ r)[None],
        np.array([r @ r]),
        np.array([60.0]),
    )
    n = NormalEquations((), np.zeros(p), (segment,), 1.0)
    left = integrated_out(joint, n, joint.of(np.empty(0, dtype=np.int64), 1), ridge)
    stacked = np.vstack([both, np.hstack([np.zeros((q, p)), np.sqrt(ridge * len(r)) * np.eye(q)])])
    target = np.r_[r, np.zeros(q)]
    found = np.linalg.lstsq(stacked, target, rcond=None)[0]
    assert np.linalg.solve(left.a, left.g) == pytest.approx(found[:p], rel=1e-10)
    rest = target - stacked @ found
    assert left.ssr - found[:p] @ left.g == pytest.approx(rest @ rest, rel=1e-10)


def test_slopes_beyond_what_a_drive_can_be_leave_no_regression(monkeypatch):
    """Seen on a campaign of three effects: a step of a slope led to a motor that has no flux for
    the first reading."""

    def refused(*_, **__):
        raise BadInput("no flux of this motor gives the first reading")

    monkeypatch.setattr("sandbox.gap.posterior.marginalized.normal", refused)
    assert marginalized(SimpleNamespace(point=None, coordinates=()), None) is None


def test_a_stranger_is_described_and_does_not_bend_what_is_known(with_a_stranger):
    """Dead time was planted with 2 us; the unmodeled cause is a current that hangs on the angle,
    constant times cos(2 theta) along d: one of the regressors itself, so nearly all of it is
    predicted on recordings that turn."""
    j, table = with_a_stranger
    found = marginalized(table, j.prior)
    first = found.described[0]
    assert (first.acts_as, first.hangs_on) == ("current", "angle")
    assert found.worth > 0.5
    k = next(k for k, c in enumerate(table.coordinates) if c.label == "dead_time.time")
    x = found.equations.most_probable(j.prior)[0][k]
    sd = np.sqrt(found.equations.covariance(j.prior)[k, k])
    assert abs(x - DEAD_TIME) < 4.0 * sd
    assert (
        by_algebra(replace(table, equations=found.equations), j.effects).chances["dead_time"] > 0.99
    )


def test_nothing_is_found_beside_effects_that_explain_all(small_answers):
    """At the floor no excess is worth a regression: what it predicts of recordings left out is next
    to nothing."""
    j = small_answers.diagnosis.best.evaluated
    found = marginalized(j.model, j.prior)
    excess = sum(float(s.ssr.sum() - s.n.sum()) for s in j.normal.segments)
    noise = np.sqrt(2.0 * sum(float(s.n.sum()) for s in j.normal.segments))
    assert found is None or found.worth * excess < 3.0 * noise
