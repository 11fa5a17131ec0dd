"""Numbers of the diagnosis' search and answers by hand: groups, `unknown`, what is whose, what a climb looks at."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.evidence import discrepancy
from sandbox.gap.evidence.inverter_or_machine import _before, _short
from sandbox.gap.evidence.noise import Noise
from sandbox.gap.location import outside
from sandbox.gap.search import judged as judging
from sandbox.gap.search import selection, unfitted
from sandbox.gap.search.estimates import Spread, _of_effect, public
from sandbox.gap.search.forward import Search, _both_best
from sandbox.gap.search.inclusion import summed
from sandbox.gap.search.judged import Judged
from sandbox.gap.search.posterior import with_unknown
from sandbox.gap.search.subsets import Subsets


@pytest.mark.parametrize(
    ("both", "a", "b", "grouped"),
    [
        (0.00, 0.50, 0.42, True), (0.00, 0.50, 0.38, False),  # one of them is there in 92 and in 88 of 100
        (0.06, 0.50, 0.40, True), (0.12, 0.50, 0.34, False),  # together in 13 and in 26 % of the rarer one's cases
        (0.00, 0.94, 0.06, True), (0.00, 0.96, 0.04, False),  # as good as sure: nothing to be parted from
        (0.00, 0.93, 0.04, False),  # the second in 4 of 100: as good as never
        (0.01, 0.945, 0.045, False),  # the first in 95.5 of 100, the second in 5.5, together in 18 % of its cases
    ],
)  # fmt: skip
def test_two_effects_that_stand_for_each_other(both, a, b, grouped):
    sets = {("a",): a, ("b",): b, ("a", "b"): both, (): 1.0 - a - b - both}
    found = summed(sets, ["a", "b"])
    assert found.chances == pytest.approx({"a": a + both, "b": b + both})
    assert found.groups == (((("a", "b"), pytest.approx(a + b + both)),) if grouped else ())


def test_unknown_beside_and_instead():
    """P(unknown) 0.2 where the best set closes 0.75 of the gap: 0.15 beside it, 0.05 alone; named ones keep 0.8."""
    own = SimpleNamespace(effects=("a",))
    found = {
        h.effects: h.probability for h in with_unknown([(0.9, own), (0.1, SimpleNamespace(effects=()))], 0.2, 0.75)
    }
    assert found == pytest.approx({("a",): 0.72, (): 0.08, ("unknown",): 0.05, ("a", "unknown"): 0.15})
    alone = with_unknown([(1.0, SimpleNamespace(effects=()))], 0.2, 0.75)
    assert {h.effects: h.probability for h in alone} == pytest.approx({(): 0.8, ("unknown",): 0.2})


def fitted(squares, effects=()):
    """Return what is read of a fit: mean squares over the floor of one recording of 20000 readings."""
    segment = SimpleNamespace(recording=0, channel="current", rr=np.array([2e4 * squares]), n=np.array([2e4]))
    return SimpleNamespace(normal=SimpleNamespace(segments=(segment,)), effects=effects)


def test_unknown_by_hand(monkeypatch):
    """Excess 9 before: the simulator may miss 0.008 and noise's own square sqrt(2/20000) = 0.01 in quadrature,
    0.012806, and 3e-5 x 9 = 0.00027; three times that after a fit.  Odds exp(-3.3) x 3^4, and 0.002 that one effect
    imitates it, times how much likelier deviations of 0 and 2 get if one was drawn four times as wide: the mean of 1/4
    and exp(2 x 15/16)/4."""
    both = math.hypot(0.008, 0.01) + 0.00027
    monkeypatch.setattr(discrepancy, "stray", lambda fit: {"x": (None, 0.0), "y": (None, 2.0)})
    stretched = (1.0 + math.exp(2.0 * 15.0 / 16.0)) / 8.0
    for effects, imitated in (((), 0.0), (("a",), 0.002), (("a", "b"), 0.005), (tuple("abcd"), 0.1)):
        found = discrepancy.remainder(fitted(10.0), fitted(1.0 + 3.0 * both, effects))
        odds = math.exp(-3.3) * 81.0 + imitated * stretched
        assert found.unknown == pytest.approx(odds / (1.0 + odds))
        assert found.explained == pytest.approx(1.0 - 3.0 * both / 9.0)
    beside = discrepancy.remainder(fitted(10.0), fitted(1.0 + 3.0 * both), 2.0 * both - 0.00027)
    assert beside.unknown == pytest.approx(1.0 / (1.0 + math.exp(3.3) / 1.5**4))


@pytest.mark.parametrize(
    ("shown", "left"),
    [
        ((50.0, 75.0, 800.0), 0.5), ((100.0, 900.0, 800.0), 1.0), ((0.0, 900.0, 0.0), 0.0), ((-50.0, 0.0, 900.0), 0.0),
        ((0.0, 900.0, 900.0), 1.0),
    ],
)  # fmt: skip
def test_rounding_shows_in_most_recordings(shown, left):
    """Rounding would leave 100, 150 and 100 squares in three recordings, nothing in a fourth.  The factor that half of
    the weight leaves (the weighted median of 1/2, 1/2 and 8 is 1/2) is what counts, at most 1."""
    parts = [
        SimpleNamespace(recording=k, channel="current", rr=np.array([1e3 + x]), n=np.array([1e3]))
        for k, x in enumerate((*shown, 700.0))
    ]
    motion = SimpleNamespace(recording=1, channel="motion", rr=np.array([9e3]), n=np.array([1e3]))
    whole = SimpleNamespace(segments=(*parts, motion))
    assert discrepancy.rounded(whole, np.array([100.0, 150.0, 100.0, 0.0])) == pytest.approx(left * 350.0 / 5e3)
    assert discrepancy.rounded(whole, np.zeros(4)) == 0.0


def test_the_floor_is_known_to_what_its_votes_differ_by():
    """20000 readings: 0.008, 0.01 and 2 log(1.01) in quadrature; a stated noise that stands alone, since the readings
    show half of it, is taken at its word; where nothing is seen, the first two."""
    n = fitted(1.0).normal
    both = math.hypot(0.008, 0.01)
    assert discrepancy.allowed(n) == discrepancy.allowed(n, Noise(1.0, None, 1.0)) == pytest.approx(both)
    assert discrepancy.allowed(n, Noise(1.03, 1.0, 1.01)) == pytest.approx(math.hypot(both, 2.0 * math.log(1.01)))
    assert discrepancy.allowed(n, Noise(1.0, 0.5, 1.0)) == pytest.approx(both)


def test_machine_or_inverter_by_hand():
    """Six to four before anything is predicted; then by what either leaves, 0.001 at the least."""
    assert outside.inverters(0.0, 0.0) == pytest.approx(0.4)
    odds = 0.4 / 0.6 * 0.101 / 0.501
    assert outside.inverters(0.5, 0.9) == pytest.approx(odds / (1.0 + odds))
    assert outside.inverters(1.0, 0.0) == pytest.approx((0.4 / 0.6 * 1001.0) / (1.0 + 0.4 / 0.6 * 1001.0))


def test_shares_of_subsystems_by_hand():
    """Currents 100, their sum 4: ten times that is a bent sensor's.  Of the other 60 half is predicted, by the machine
    0.5 and the inverter 0; of what is not, six tenths are the machine's, the rest as effects could take it up."""
    sizes = {"current": 100.0, "sum": 4.0, "motion": 20.0, "angle": 5.0}
    spans = {"machine": 0.1, "inverter": 0.2, "sensor": 0.3, "mechanics": 0.4}
    found = outside.shares(sizes, spans, (0.0, 0.5))
    odds = 0.4 / 0.6 * 0.501 / 1.001
    inverter = odds / (1.0 + odds)
    expected = {
        "machine": 0.5 * 0.4 * 60.0 * 0.1 + (0.5 * 0.6 + 0.5 * (1.0 - inverter)) * 60.0,
        "inverter": 0.5 * 0.4 * 60.0 * 0.2 + 0.5 * inverter * 60.0,
        "sensor": 0.5 * 0.4 * 60.0 * 0.3 + 40.0 + 5.0,
        "mechanics": 0.5 * 0.4 * 60.0 * 0.4 + 20.0,
    }
    assert found == pytest.approx({name: x / 125.0 for name, x in expected.items()})


def test_an_excess_is_beyond_three_deviations_of_noise():
    """200 readings of noise: 200 +- 20 in squares; 300 of them are 40 too many, 255 none."""
    assert outside._excess(np.full(200, math.sqrt(1.5))) == pytest.approx(40.0)
    assert outside._excess(np.full(200, math.sqrt(255.0 / 200.0))) == 0.0


def test_pulses_that_are_short_and_periods_before():
    assert _short(np.array([0.5, -0.25, 2.0]), 1.0) == pytest.approx([0.5, -0.25, 0.0])
    assert _before(np.array([1.0, 2.0, 3.0]), 1) == pytest.approx([0.0, 1.0, 2.0])


@pytest.mark.parametrize(("behind", "count"), [(29.0, 2), (31.0, 0)])
def test_slight_effects_are_weighed_up_to_thirty_behind(monkeypatch, behind, count):
    monkeypatch.setattr(unfitted, "by_algebra", lambda none, effect: effect)
    none = SimpleNamespace(effects=(), log_evidence=-behind, table=SimpleNamespace(members={"a": (), "b": (), "c": ()}))
    best = SimpleNamespace(effects=("c",), log_evidence=0.0)
    assert len(unfitted.slight([none, best], {("c",)})) == count


def climbing(levels, glances):
    """Return subsets of one effect each with given log posteriors, ranked beforehand by glances."""
    own = Subsets(SimpleNamespace(members=dict.fromkeys(levels)), 1.0, known={(): 0.0})
    own.known |= {(e,): x for e, x in levels.items()}
    own.known |= {(a, b): -99.0 for a in levels for b in levels if a < b}
    own.glance = lambda sets: np.array([glances.get(s[0] if s else "", -50.0) if len(s) < 2 else -60.0 for s in sets])
    return own


@pytest.mark.parametrize(("gain", "end"), [(0.29, ()), (0.31, ("dead_time",))])
def test_a_step_up_gains_three_tenths(gain, end):
    assert climbing({"dead_time": gain}, {}).climb()[0] == end


def test_five_of_a_neighbourhood_are_weighed():
    names = ["dead_time", "inertia", "magnet_flux", "saturation", "stator_resistance", "iron_loss"]
    for best, found in ((4, ("stator_resistance",)), (5, ())):
        levels = {e: 9.0 if k == best else -9.0 for k, e in enumerate(names)}
        own = climbing(levels, {e: -float(k) for k, e in enumerate(names)})
        assert own.climb()[0] == found


def test_what_slopes_still_promise_counts_against_a_set(monkeypatch):
    """Half of what the objective could still fall by; where data counts four times less, that counts less, too."""
    t = SimpleNamespace(log_evidence=lambda effects, temperature=1.0: 7.0, prior=lambda effects: None)
    t.normal, t.point = SimpleNamespace(simulations=3.0, segments=()), None
    fit = SimpleNamespace(effects=("a",), point=None)
    assert Judged(fit, t, None, 0.0, 2.0, 0.0).tempered(4.0) == pytest.approx(7.0 - 0.25)
    monkeypatch.setattr(judging, "table", lambda *given: t)
    monkeypatch.setattr(judging, "settled", lambda *given: (t, 2.0, 5.0))
    monkeypatch.setattr(judging, "excess_of", lambda *given: 200.0)
    found = judging.judge(fit, (), 0.0, {}, 1)
    assert (found.log_evidence, found.simulations) == (pytest.approx(6.0), 8.0)
    none = SimpleNamespace(table=t, unmet=2.0)
    t.prior = lambda effects, alone=False: SimpleNamespace(deviation=np.ones(0), mean=np.ones(0))
    t.coordinates, t.equations = (), SimpleNamespace(most_probable=lambda prior: (np.zeros(0), None, 1.0))
    t.point = SimpleNamespace(moved=lambda coordinates, x: None)
    monkeypatch.setattr(unfitted, "equations_of", lambda *given: None)
    assert unfitted.by_algebra(none, ("a",)).log_evidence == pytest.approx(6.0)


def test_what_a_parameter_is_from_its_coordinate():
    assert [public(form, 4.0) for form in ("linear", "log", "reciprocal")] == pytest.approx([4.0, math.exp(4.0), 0.25])
    assert public("reciprocal", 0.0) == math.inf


def test_an_amplitude_and_its_phase_by_hand():
    """Parts (3, 4) known to (0.1, 0.2): amplitude 5, along it hypot(0.3, 0.8)/5, across it hypot(0.4, 0.6)/5, of 5."""
    name = "cogging_torque.amplitude"
    both, x, sd = (
        [SimpleNamespace(label=f"{name} {part}") for part in ("cosine", "sine")],
        np.array([3.0, 4.0]),
        (0.1, 0.2),
    )
    found = _of_effect("cogging_torque", Spread(both, {}, x, np.array(sd), (x, x), np.array([True, True])))
    size, phase = found[name], found["cogging_torque.phase"]
    assert size.value == pytest.approx(5.0)
    assert size.high - size.value == pytest.approx(1.959964 * math.hypot(0.3, 0.8) / 5.0)
    assert phase.value == pytest.approx(math.atan2(4.0, 3.0))
    assert phase.high - phase.value == pytest.approx(1.959964 * math.hypot(0.4, 0.6) / 25.0)


def fitted_to(effects, objective, values):
    """A fit of which only effects, objective and values count; 800 readings."""
    normal = SimpleNamespace(segments=[SimpleNamespace(n=np.array([800.0]))])
    return SimpleNamespace(effects=effects, objective=objective, normal=normal, point=SimpleNamespace(values=values))


def test_the_two_effects_that_explain_most_alone_are_tried_together():
    """Squares above 800 readings' noise: 9200 without effects; dead time leaves 4200 and PWM delay 5200, so both are
    tried, from dead time's fit with the delay's own value.  A rest of 40 (one standard deviation of noise's squares) is
    below a hundredth of 9200: settled, nothing is tried."""
    null = fitted_to((), 10000.0, {})
    delay = fitted_to(("pwm_delay",), 6000.0, {"pwm_delay.delay": 3e-5, "dead_time.time": 1e-9})
    dead = fitted_to(("dead_time",), 5000.0, {"dead_time.time": 2e-6})
    sampling = fitted_to(("current_sampling",), 7000.0, {})
    fits = {f.effects: f for f in (null, delay, dead, sampling)}
    assert _both_best(fits, null) == [(("dead_time", "pwm_delay"), dead, {"pwm_delay.delay": 3e-5}, 2000.0)]
    settled = fitted_to(("dead_time",), 840.0, {})
    assert _both_best({(): null, ("dead_time",): settled, ("pwm_delay",): delay}, null) == []
    assert _both_best({(): null, ("dead_time",): dead}, null) == []


@pytest.mark.parametrize(("unknown", "looked_for"), [(0.89, True), (0.91, False)])
def test_rivals_are_fitted_below_nine_tenths_of_unknown(monkeypatch, unknown, looked_for):
    """A search of one effect goes on from its point (`unknown` 0.5 there) to a set of two, at which `unknown` has the
    chance that is given."""
    one, two = (
        SimpleNamespace(effects=e, objective=0.0, normal=None) for e in (("inertia",), ("dead_time", "inertia"))
    )
    judged = {
        f.effects: SimpleNamespace(
            effects=f.effects, fit=f, table=None, log_evidence=99.0 * k, tempered=lambda t, k=k: 99.0 * k
        )
        for k, f in enumerate((one, two))
    }
    asked = []
    monkeypatch.setattr(selection, "rms_of", lambda fit: 1.0)
    monkeypatch.setattr(selection, "allowed", lambda normal: 1.0)
    monkeypatch.setattr(selection, "select", lambda s, *rest: setattr(s, "best", two))
    monkeypatch.setattr(selection, "judged_of", lambda s, fit: judged[fit.effects])
    monkeypatch.setattr(selection, "rivals", lambda s, best: asked.append(best.effects) or [])
    monkeypatch.setattr(Search, "remainder", lambda found, fit: SimpleNamespace(unknown=0.5 if fit is one else unknown))
    found = selection.widened(Search(None, (judged[one.effects],), 0.0, frozenset(), (), 0.01, looked=1.0), 40.0, {})
    assert asked == ([two.effects] if looked_for else [])
    assert [j.effects for j in found.judged] == [one.effects, two.effects]
