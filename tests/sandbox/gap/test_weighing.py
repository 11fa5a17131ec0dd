"""Evidence over sizes, data that counts for less, effects too small to fit: against integrals and fits."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from model.errors import BadInput
from sandbox.gap.evidence import spike_slab
from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.holdout import weights_of
from sandbox.gap.evidence.normal import equations_of
from sandbox.gap.evidence.priors import ordinary, seen
from sandbox.gap.evidence.probes import probes_at_typical
from sandbox.gap.evidence.spike_slab import Table, ordinary_share
from sandbox.gap.search import judged
from sandbox.gap.search.estimates import estimates
from sandbox.gap.search.judged import Judged, judge
from sandbox.gap.search.posterior import tempered
from sandbox.gap.search.unfitted import slight
from sandbox.recordings.writing import write_campaign
from tests.sandbox.gap.conftest import small_campaign
from tests.sandbox.gap.test_evidence import start

NARROW, WIDE = 0.02, 1.5


def one_effect(pull, curve, *, low=-np.inf):
    """Return a table of one coordinate of one effect: log likelihood pull x - curve x^2/2."""
    own = Algebra(np.array([[curve]]), np.array([pull]), 0.0, np.zeros(1))
    zero, high = np.zeros(1), np.array([np.inf])
    narrow, wide = (Prior(zero, np.array([sd]), np.array([low]), high) for sd in (NARROW, WIDE))
    return Table(None, None, own, narrow, wide, {"x": (0,)}, np.array([True]))


def gauss(x, sd):
    return math.exp(-0.5 * (x / sd) ** 2) / (sd * math.sqrt(2.0 * math.pi))


@pytest.mark.parametrize("pull", [0.0, 3.0, 40.0])
@pytest.mark.parametrize("temperature", [1.0, 7.0])
def test_evidence_is_the_mean_over_sizes_and_only_data_is_tempered(pull, temperature):
    curve = 30.0
    told = one_effect(pull, curve).log_evidence(["x"], temperature=temperature)
    sizes = [WIDE, *(math.hypot(NARROW, s * WIDE) for s in (0.5, 0.25, 0.125))]

    def density(x):
        likelihood = math.exp((pull * x - 0.5 * curve * x * x) / temperature)
        return likelihood * sum(gauss(x, sd) for sd in sizes) / len(sizes)

    top = pull / curve
    whole = quad(density, -12.0, 12.0, points=[0.0, top], limit=400)[0]
    assert told == pytest.approx(math.log(whole), abs=1e-6)


@pytest.mark.parametrize(("promised", "steps", "left"), [(0.49, 0, 0.0), (0.51, 8, 0.26), (10.0, 8, 9.75)])
def test_a_table_takes_eight_steps_towards_what_promises_half(monkeypatch, promised, steps, left):
    """Each step gains a quarter, and slopes promise as much as before."""
    value = [100.0]
    n = SimpleNamespace(x=np.zeros(1), coordinates=(SimpleNamespace(form="size"),))
    n.bare = lambda: n
    e = SimpleNamespace(most_probable=lambda prior: n, objective=lambda x, prior: value[0] - promised)

    def tried(*_):
        value[0] -= 0.25
        return value[0], n

    monkeypatch.setattr(spike_slab, "objective", lambda *_: value[0])
    monkeypatch.setattr(spike_slab, "tried", tried)
    monkeypatch.setattr(spike_slab, "algebra", lambda *_: e)
    point = SimpleNamespace()
    point.moved = lambda coordinates, x: point
    found = spike_slab.settled(Table(point, n, e, None, None, {}, np.array([True])), None, None, 1)
    assert found[1:] == pytest.approx((left, steps))


@pytest.mark.parametrize(("left", "taken"), [((21.0, 21.0, 21.0, 0.0), 3), ((21.0, 0.0), 2), ((19.0,), 1)])
def test_slopes_are_taken_anew_where_they_promise_a_fiftieth_of_what_is_left(monkeypatch, left, taken):
    """Where the last ones led, three times at the most; what they still promise counts against the set, and all
    simulations count.  left: of the objective, by round, of 1000 beyond noise."""
    told, at = iter(left), []

    def made(point, *_):
        at.append(point)
        n = SimpleNamespace(simulations=20.0, segments=())
        return SimpleNamespace(point=point, normal=n, prior=lambda effects: None, log_evidence=lambda effects: 7.0)

    monkeypatch.setattr(judged, "table", made)

    def settle(first, *_):
        """Move on by one point."""
        return SimpleNamespace(**{**vars(first), "point": first.point + 1}), next(told), 4.0

    monkeypatch.setattr(judged, "settled", settle)
    monkeypatch.setattr(judged, "excess_of", lambda n, weights: 1000.0)
    found = judge(SimpleNamespace(point=0, effects=("a",)), (), 0.01, {}, 1)
    assert at == list(range(taken))
    assert found.unmet == left[taken - 1]
    assert found.log_evidence == 7.0 - 0.5 * left[taken - 1]
    assert found.simulations == taken * 24.0


@pytest.mark.parametrize("refused", [True, False])
def test_slopes_are_not_taken_anew_where_no_step_was_made_or_no_drive_can_be(monkeypatch, refused):
    """Then the first ones count; refused: the settled point has no equations of all effects."""
    calls = []

    def made(point, *_):
        calls.append(point)
        if point:
            raise BadInput("no flux of this motor gives the first reading")
        n = SimpleNamespace(simulations=20.0, segments=())
        return SimpleNamespace(point=point, normal=n, prior=lambda effects: None, log_evidence=lambda effects: 7.0)

    def settle(first, *_):
        """Move on by one point where it will be refused, not at all else."""
        return (SimpleNamespace(**{**vars(first), "point": 1}) if refused else first), 500.0, 4.0

    monkeypatch.setattr(judged, "table", made)
    monkeypatch.setattr(judged, "settled", settle)
    monkeypatch.setattr(judged, "excess_of", lambda n, weights: 1000.0)
    found = judge(SimpleNamespace(point=0, effects=("a",)), (), 0.01, {}, 1)
    assert (found.unmet, found.simulations, calls) == (500.0, 24.0, [0, 1] if refused else [0])


def test_what_priors_tell_apart_no_temperature_takes_away():
    """A value known far better than either prior, four narrow deviations off: the odds are those of the priors."""
    at, curve = 4.0 * NARROW, 1e8
    for temperature in (1.0, 50.0):
        t = one_effect(at * curve, curve)
        odds = t.log_evidence(["x"], temperature=temperature) - t.log_evidence([], temperature=temperature)
        sizes = [WIDE, *(math.hypot(NARROW, s * WIDE) for s in (0.5, 0.25, 0.125))]
        wide = sum(gauss(at, sd) for sd in sizes) / len(sizes)
        assert odds == pytest.approx(math.log(wide / gauss(at, NARROW)), abs=1e-2)  # width of the likelihood


def test_a_trace_may_have_either_sign_a_claim_may_not():
    """An error of the simulator that looks like a negative size: taken up by the trace, no evidence for the effect."""
    t = one_effect(-60.0, 2000.0, low=0.0)
    symmetric = one_effect(-60.0, 2000.0)
    assert t.log_evidence([]) == pytest.approx(symmetric.log_evidence([]), abs=1e-12)
    assert t.log_evidence(["x"]) < symmetric.log_evidence(["x"]) - 1.0


def test_a_stated_deviation_is_seen_from_the_stated_value():
    """True = stated/(1 + x), x normal: three deviations too low a statement lie three of the seen ones off."""
    for s in (0.01, 0.05, 0.15):
        true = 1.0 / (1.0 - 3.0 * s)
        assert (true - 1.0) / seen(s) == pytest.approx(3.0, rel=1e-12)


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    """The point without effects of a campaign without a gap, judged with all effects beside it."""
    at = start(write_campaign(tmp_path_factory.mktemp("weighing") / "quiet", small_campaign({})))
    weights = weights_of(len(at.prepared.recordings))
    found = fit(at, (), weights)
    return judge(found, probes_at_typical(at), ordinary_share(1.0), weights, 1), weights


def test_a_slight_effect_is_what_a_fit_says_of_it(quiet):
    """By algebra from the point without effects; near the floor a fit from there moves by less than it is unsure."""
    none, weights = quiet
    by_name = {j.effects[0]: j for j in slight([none], {()})}
    assert set(by_name) == set(none.table.members)
    for name in ("stator_resistance", "flux_harmonics", "winding_asymmetry"):
        own = by_name[name]
        found = fit(none.fit.point, (name,), weights)
        assert own.fit.objective == pytest.approx(found.objective, abs=0.2)  # TOLERANCE of a fit
        here, there = (estimates(dataclasses.replace(own, fit=f)) for f in (own.fit, found))
        for parameter, e in there.items():
            assert here[parameter].value == pytest.approx(e.value, abs=0.1 * (e.high - e.low))
            assert here[parameter].high - here[parameter].low == pytest.approx(e.high - e.low, rel=0.1)
    assert sum(p for p, _ in tempered([none, *by_name.values()], 2.0)[0]) == pytest.approx(1.0)


def test_part_of_the_equations_is_the_rest_held(quiet):
    """Squares at any values of the kept coordinates: those of the whole equations, the others at what they are held."""
    none, _ = quiet
    n, kept, rng = none.normal, [0, 3, len(none.normal.x) - 1], np.random.default_rng(2)
    held = n.x + 0.1 * none.prior.deviation * rng.standard_normal(len(n.x))
    own = equations_of(n, kept, [n.coordinates[k] for k in kept], held)
    x = n.x[kept] + none.prior.deviation[kept] * rng.standard_normal(len(kept))
    whole = held.copy()
    whole[kept] = x
    (a, g, rr), (b, h, ss) = n.summed(), own.summed()
    far, near = whole - n.x, x - n.x[kept]
    assert ss - 2.0 * near @ h + near @ b @ near == pytest.approx(rr - 2.0 * far @ g + far @ a @ far, rel=1e-10)


def test_nothing_slight_beside_a_large_effect(quiet):
    none, _ = quiet
    large = dataclasses.replace(none, log_evidence=none.log_evidence + 100.0)
    assert isinstance(large, Judged)
    assert (
        slight([none, dataclasses.replace(large, fit=dataclasses.replace(none.fit, effects=("dead_time",)))], set())
        == []
    )


def test_ordinary_coordinates_use_the_seen_deviation(quiet):
    """Stated to 10 %: a statement three deviations too low, 0.7 of the truth, is 3/7 of itself off; a third is 1/7."""
    campaign = quiet[0].fit.point.prepared.campaign
    stated = dataclasses.replace(campaign, uncertainty={"viscous_friction": 0.1})
    viscous = next(c for c in ordinary(stated) if c.label == "viscous_friction.coefficient")
    assert viscous.deviation == pytest.approx(campaign.drive.motor.viscous_friction / 7.0)
