"""Slight effects beside those fitted: one that comes out first is fitted, too."""

from sandbox.gap.diagnose import _ranked
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.holdout import weights_of
from sandbox.gap.evidence.probes import probes_at_typical
from sandbox.gap.evidence.spike_slab import ordinary_share
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import judge
from tests.sandbox.gap.test_evidence import start


def test_a_slight_effect_that_comes_out_first_is_fitted_before_it_is_believed(small_folder):
    """Of a search that fitted nothing but ordinary deviations: dead time is there, or a drop that looks like it."""
    at = start(small_folder)
    weights = weights_of(len(at.prepared.recordings))
    chosen = probes_at_typical(at)
    null = fit(at, (), weights)
    none = judge(null, chosen, ordinary_share(1.0), weights, 1)
    found = Search(null, (none,), 0.0, frozenset({()}), tuple(chosen), ordinary_share(1.0))
    judged, ranked, temperature = _ranked(found, 2.0, weights, 1)
    best = ranked[0][1]
    assert best.effects in (("dead_time",), ("device_drop",))
    assert any(best is j for j in judged)
    assert temperature >= 1.0
    assert best.fit.objective < 0.1 * null.objective
