"""Prior over sets, temperature, and what counts as located, by value."""

import math
from itertools import combinations, pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from model.effects.card import SUBSYSTEMS
from model.effects.library import effect_names, load_effect
from model.errors import BadInput
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.search import posterior
from sandbox.gap.search.posterior import log_prior, misfit, tempered
from sandbox.withheld.scoring.judge import located


def test_the_prior_over_sets_by_value():
    """0.95 for up to three: of it 0.6 for none, 0.27, 0.1 and 0.03 for one, two, three, each shared evenly by 26, 325
    and 2600 sets."""
    assert len(effect_names()) == 26
    for effects, p in ((0, 0.6), (1, 0.27 / 26), (2, 0.1 / 325), (3, 0.03 / 2600)):
        assert math.exp(log_prior(effect_names()[:effects])) == pytest.approx(0.95 * p)
    every = sum(math.exp(log_prior(s)) for n in range(4) for s in combinations(effect_names(), n))
    assert every == pytest.approx(0.95)


def test_more_than_three_effects_share_a_twentieth():
    """Each number of them has 0.8 of what the one before has."""
    names = effect_names()
    chances = [math.comb(26, n) * math.exp(log_prior(names[:n])) for n in range(4, 27)]
    assert sum(chances) == pytest.approx(0.05)
    assert [b / a for a, b in pairwise(chances)] == pytest.approx([0.8] * 22)


def judged(effects, log_evidence):
    """Return a stand-in of a judged fit whose data is worth log_evidence, its priors 3."""
    own = SimpleNamespace(effects=effects, log_evidence=log_evidence, normal=None, equations=None, prior=None)
    own.tempered = lambda temperature: log_evidence / temperature + 3.0
    return own


def test_the_temperature_is_misfit_times_one_plus_a_tenth_of_the_raw_gap(monkeypatch):
    """Misfit 2 at the best hypothesis, raw gap 15 floors: 2 (1 + 15/10) = 5; probabilities by hand from that."""
    asked = []
    monkeypatch.setattr(posterior, "misfit", lambda *parts: asked.append(parts) or 2.0)
    none, one = judged((), 0.0), judged(("dead_time",), 40.0)
    one.normal = "of the best"
    ranked, temperature = tempered([none, one, judged(("inertia",), -math.inf)], 15.0)
    assert temperature == pytest.approx(5.0)
    assert asked == [("of the best", None, None)]
    odds = math.exp(40.0 / 5.0) * (0.27 / 26) / 0.6
    assert [j.effects for _, j in ranked] == [("dead_time",), ()]
    assert ranked[0][0] == pytest.approx(odds / (1.0 + odds))
    assert tempered([none], 0.0)[1] == pytest.approx(2.0)
    with pytest.raises(BadInput, match="no hypothesis predicts finite readings"):
        tempered([judged((), -math.inf)], 1.0)


def test_the_misfit_is_the_mean_widening_of_what_the_data_tell(monkeypatch):
    """Three free coordinates of prior deviation 1: told (information above 1) are the first two, widened 3 and 7 times;
    the third, widened 100 times, is the prior's.  Never below 1."""
    own = Algebra(np.diag([9.0, 4.0, 0.5]), np.zeros(3), 0.0, np.zeros(3))
    far = np.full(3, np.inf)
    prior = Prior(np.zeros(3), np.ones(3), -far, far)
    for times, expected in (((3.0, 7.0, 100.0), 5.0), ((0.5, 0.5, 100.0), 1.0)):
        monkeypatch.setattr(posterior, "sandwich", lambda n, x, plain, t=times: plain * np.diag(t))
        assert misfit(None, own, prior) == pytest.approx(expected)


@pytest.mark.parametrize("name", effect_names())
def test_an_effect_is_located_by_the_first_place_alone(name):
    """In its card's subsystem and in no other; a second place does not count; of two effects either will do."""
    own, true = load_effect(name).subsystem, frozenset({name})
    for other in SUBSYSTEMS:
        assert located(true, [{"subsystem": other}]) is (other == own)
        assert located(true, [{"subsystem": other}, {"subsystem": own}]) is (other == own)
        two = true | {next(e for e in effect_names() if load_effect(e).subsystem == other)}
        assert located(two, [{"subsystem": other}]) is True
    assert located(true, []) is False
    assert located(frozenset(), [{"subsystem": own}]) is None
