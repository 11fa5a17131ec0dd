"""Sets beside a Gaussian process: what slopes promise is fitted before it is named; promises and
fits from a table."""

import math
from types import SimpleNamespace

import pytest

from sandbox.gap.posterior.candidates import Candidate
from sandbox.withheld.baselines import gaussian_process
from sandbox.withheld.baselines.gaussian_process import Move, Search, ranked, searched


@pytest.fixture
def named(monkeypatch):
    """Return what is ranked, and which sets were fitted, when promises by set and fits are looked
    up in tables."""

    def of(promises, fits, tired=lambda fitted: False):
        done = []

        def moves(process, here):
            found = [
                Move(tuple(k), x, Candidate(k[-1:], {})) for k, x in promises[here.effects].items()
            ]
            return sorted(found, key=lambda m: -m.promised)

        def fitted(process, here, move):
            done.append("".join(move.effects))
            value = fits.get(done[-1])
            return None if value is None else SimpleNamespace(effects=move.effects, evidence=value)

        monkeypatch.setattr(gaussian_process, "moves", moves)
        monkeypatch.setattr(gaussian_process, "fitted", fitted)
        monkeypatch.setattr(
            gaussian_process, "parameters", lambda here: dict.fromkeys(here.effects, 1.0)
        )
        search = Search(None, lambda: tired(done))
        best = searched(search, SimpleNamespace(effects=(), evidence=0.0))
        return {"".join(e): (w, own) for e, w, own in ranked(search, best)}, done

    return of


def test_a_set_counts_with_the_evidence_of_its_fit(named):
    """{a, b} promises 10 and reaches 3, {a} has 5: {a} is named with its parameters, {a, b} behind
    it with exp(3 - 5), and no set is fitted twice.  {a, c} promises less than {a} has and stays
    unfitted, without parameters."""
    promises = {(): {"a": 6.0, "b": 1.0}, ("a",): {"ab": 10.0, "ac": 4.0, "": 0.5}}
    found, done = named(promises, {"a": 5.0, "ab": 3.0})
    assert done == ["a", "ab"]
    assert list(found) == ["a", "ac", "ab", ""]
    assert found["a"] == (1.0, {"a": 1.0})
    assert found["ab"] == (pytest.approx(math.exp(-2.0)), {"a": 1.0, "b": 1.0})
    assert found["ac"] == (pytest.approx(math.exp(-1.0)), {})
    assert found[""][0] == pytest.approx(math.exp(-5.0))


def test_all_that_promises_more_is_fitted_until_the_first_is_a_fitted_one(named):
    """Three do not keep what they promise, or cannot be fitted; the fourth does, and from there one
    effect leaves."""
    promises = {
        (): {"a": 6.0},
        ("a",): {"ab": 10.0, "ac": 9.0, "ad": 8.0, "ae": 7.0},
        ("a", "e"): {"e": 9.0, "a": 4.0},
        ("e",): {"": 0.5},
    }
    found, done = named(promises, {"a": 5.0, "ab": 3.0, "ac": 4.0, "ae": 6.0, "e": 8.0})
    assert done == ["a", "ab", "ac", "ad", "ae", "e"]
    assert next(iter(found)) == "e"
    assert found["e"][1] == {"e": 1.0}
    assert "ad" not in found


def test_what_could_not_be_fitted_in_time_is_not_named(named):
    """Tired after two fits: {a, c} promises 9 and was not fitted, so it is not ranked."""
    promises = {(): {"a": 6.0}, ("a",): {"ab": 10.0, "ac": 9.0, "ad": 4.0}}
    found, done = named(promises, {"a": 5.0, "ab": 3.0, "ac": 9.0}, lambda fitted: len(fitted) >= 2)
    assert done == ["a", "ab"]
    assert list(found) == ["a", "ad", "ab", ""]
