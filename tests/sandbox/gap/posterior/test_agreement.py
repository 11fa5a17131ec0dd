"""Recordings that agree on an effect, and recordings that do not.

Numbers come from the mean of a sample and its standard error, which sizes by recording are told by
where all of them have the same information, and from Student's distribution.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.evidence.algebra import prior_of
from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.posterior.agreement import CHANCE, Agreement, chance
from sandbox.gap.posterior.inference import _Weighing
from sandbox.gap.posterior.sets import log_prior
from sandbox.gap.settings import USUAL, Settings
from sandbox.replay.segments import Segment

INFORMATION = 1e4  # of a recording: its size is told to 0.01
ONE_SIZE = Settings(sizes=(1.0,))


def agreement(sizes, usual=0.0, wide=1.0, blocks=4):
    """Return the agreement of recordings, each of which asks for a size by itself, in blocks of
    time that are all alike."""
    label = "current_gain.gain_a"
    own = Coordinate(label, 0.0, wide, "linear", (label,))
    share = np.full((blocks, 1), 1.0 / blocks)
    segments = tuple(
        Segment(
            k,
            "current",
            np.array([0]),
            INFORMATION * share[:, :, None],
            INFORMATION * x * share,
            1e3 * share[:, 0],
            1e3 * share[:, 0],
        )
        for k, x in enumerate(sizes)
    )
    n = NormalEquations((own,), np.zeros(1), segments, 0.0)
    return Agreement(n, prior_of([own]), {label: usual} if usual else {})


def student(x, variance, freedom):
    """Return the log density of x, up to a constant of the degrees of freedom."""
    tail = 0.5 * (freedom + 1) * math.log1p(x * x / variance / freedom)
    return -0.5 * math.log(variance) - tail


def test_recordings_that_contradict_each_other_say_as_much_as_their_scatter():
    """Sizes 0.9 +- 1 of six recordings, each told to 0.01: the mean's standard error is theirs over
    the root of six, less what is chance in six scores; the fit's own says 0.01 / root of six."""
    sizes = 0.9 + np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    told = agreement(sizes)
    wider = np.var(sizes, ddof=1) * INFORMATION / chance(1, 5)
    scatter, freedom = wider / INFORMATION / 6.0, 5.0 / (1.0 - 1.0 / wider) ** 2
    assert told.x[0] == pytest.approx(0.9, rel=1e-3)
    assert told.on("current_gain", ONE_SIZE) == pytest.approx(
        student(0.9, scatter + 1.0, freedom) - student(0.9, scatter, freedom), abs=0.01
    )
    assert told.on("current_gain", ONE_SIZE) < 3.0


def test_recordings_that_agree_say_nothing_against_an_effect():
    """Sizes of 1 +- 0.01, as each is told: the evidence is that of the whole fit."""
    sizes = 1.0 + 0.01 * np.array([1.0, -1.0, 0.5, -0.5, 1.0, -1.0])
    assert agreement(sizes).on("current_gain", ONE_SIZE) == math.inf


def test_an_ordinary_size_is_evidence_against_an_effect():
    """Sizes of 1 +- 10 by twelve recordings, of which 10 is an ordinary deviation and 1000 an
    effect's: Student's densities at 1."""
    sizes = 1.0 + 10.0 * np.array([1.0, -1.0] * 6)
    wider = np.var(sizes, ddof=1) * INFORMATION / chance(1, 11)
    scatter, freedom = wider / INFORMATION / 12.0, 11.0 / (1.0 - 1.0 / wider) ** 2
    found = agreement(sizes, usual=10.0, wide=1e3).on("current_gain", ONE_SIZE)
    ordinary, effect = (scatter + 10.0**2, scatter + 10.0**2 + 1e3**2)
    assert found == pytest.approx(
        student(1.0, effect, freedom) - student(1.0, ordinary, freedom), abs=0.01
    )


def test_what_scores_scatter_by_chance():
    """Covariances of three numbers from 17 drawn scores: of 400 one in fifty at most is wider along
    some direction than chance says, and a tenth and more than two standard deviations below."""
    rng = np.random.default_rng(7)
    drawn = rng.standard_normal((400, 17, 3))
    widest = np.linalg.eigvalsh(np.einsum("mki,mkj->mij", drawn, drawn) / 17.0)[:, -1]
    assert np.mean(widest > chance(3, 17)) < 0.02
    assert np.mean(widest > chance(3, 17) - 2.0 * CHANCE * math.sqrt(2.0 / 17.0)) > 0.1


def test_nothing_is_said_of_effects_that_have_no_size():
    assert agreement([1.0, 1.0]).on("shaft_compliance", ONE_SIZE) == math.inf


@pytest.mark.parametrize(("agreed", "most"), [(3.0, 3.0), (math.inf, 50.0)])
def test_a_set_is_no_more_probable_than_recordings_agree_on_its_effects(agreed, most, monkeypatch):
    """Fits say that an effect more is 50 nats better; recordings, that it is 3 nats, or nothing
    against it.  The prior odds of one more effect come on top of what they say."""
    one, two = ("dead_time",), ("cogging_torque", "dead_time")
    odds = log_prior(two) - log_prior(one)
    own = _Weighing.__new__(_Weighing)
    own.search = SimpleNamespace(problem=SimpleNamespace(settings=USUAL))
    plain = {one: 7.0, two: 57.0 + odds}
    monkeypatch.setattr(own, "level", lambda e: plain[e.effects], raising=False)
    monkeypatch.setattr(
        own,
        "agreement",
        lambda e, key, effect: agreed if effect == "cogging_torque" else math.inf,
        raising=False,
    )
    own.sure = {}
    monkeypatch.setattr(own, "far_less", lambda new, old: False, raising=False)
    fitted = {k: SimpleNamespace(effects=k, fit=k) for k in (one, two)}
    assert own.levels(fitted) == pytest.approx({one: 7.0, two: 7.0 + most + odds})
    doubted = own.without_unsure(fitted[two])
    # one that takes more than half of what is left is needed, whatever they say
    monkeypatch.setattr(own, "far_less", lambda new, old: (new, old) == (two, one), raising=False)
    assert own.levels(fitted) == pytest.approx(plain)
    assert doubted == ([one] if agreed + odds < 0.0 else [])  # 3 - 5 nats
