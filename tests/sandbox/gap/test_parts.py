"""Orders beyond the first: found in recordings of the switched bench, none where there are none."""

import dataclasses
import math
from types import SimpleNamespace

import pytest

from model.effects import library
from model.effects.card import Parameter
from model.effects.inductance_harmonics import SIZES
from sandbox.gap import diagnose as diagnosing
from sandbox.gap.evidence.fit import fit, rms_of
from sandbox.gap.evidence.holdout import weights_of
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.priors import of_effect, of_part
from sandbox.gap.evidence.probes import Probe, scanned
from sandbox.gap.search.estimates import estimates
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import judge
from sandbox.gap.search.parts import adding as parts
from sandbox.gap.search.parts.adding import starts, with_parts
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, FLUX, FURTHER, SIXTH, TURNING, small_campaign


def searched(effects):
    """Return a search that has named flux harmonics in recordings of the switched bench, and their weights."""
    prepared = prepare(small_campaign(effects, (CASES[0], *TURNING)))
    start, weights = Point(prepared, complete(DRIVE.motor, DRIVE.converter)), weights_of(len(prepared.recordings))
    chosen, null = (Probe("flux_harmonics", {}),), fit(start, (), weights)
    named = judge(fit(start, ("flux_harmonics",), weights), chosen, 0.01, weights, 1)
    return Search(null, (named,), 0.0, frozenset({("flux_harmonics",)}), chosen, 0.01), weights


def test_a_second_order_is_found_and_no_third():
    """The bench has orders 6 and 18.  Values lie within their 95 % intervals, widened by one half: three intervals are
    looked at, and a deviation of three has a chance of 0.3 %."""
    found, weights = searched({**SIXTH, **FURTHER})
    new = with_parts(found, 5.0, weights)
    (best,) = new.judged
    told = estimates(best)
    assert best.effects == ("flux_harmonics",)
    assert told["flux_harmonics.2.order"].value == 18.0
    assert not any(name.startswith("flux_harmonics.3.") for name in told)
    for name in ("flux_harmonics.2.psi_d", "flux_harmonics.2.psi_q", "flux_harmonics.psi_d6"):
        e = told[name]
        assert abs(e.value - {**SIXTH, **FURTHER}[name]) < 1.5 * (e.high - e.value), name
    assert new.further["flux_harmonics.2.order"] == 18.0
    assert new.further["flux_harmonics.2.psi_d"] == best.fit.point.values["flux_harmonics.2.psi_d"]
    assert with_parts(new, 5.0, weights).further == new.further


SLOTS = {  # of 1 / L_d, and of rated current over the square of its flux
    "back": 0.02, "alpha_30": 0.03, "alpha_12": -0.03, "alpha_21": 0.03, "alpha_03": 0.02,
}  # fmt: skip


def test_an_order_that_grows_with_the_current_is_found_from_nothing():
    """The bench has inductances of order 12 whose amplitudes grow with the current and its square; nothing is named
    yet, so flux, cogging and inductances are tried.  Values within their 95 % intervals, widened by one half as above;
    those that the bench does not have are zero within them."""
    card, drive = library.load_effect("inductance_harmonics").part(2), (DRIVE.motor, DRIVE.converter)
    scale = {p.name: p.typical_for(*drive) / p.typical for p in card.parameters if p.typical}
    planted = {f"inductance_harmonics.2.{n}": x * scale[n] for n, x in SLOTS.items()}
    campaign = small_campaign({**planted, "inductance_harmonics.2.order": 12.0}, (CASES[0], *TURNING))
    prepared = prepare(campaign)
    start, weights = Point(prepared, complete(*drive)), weights_of(len(prepared.recordings))
    null = fit(start, (), weights)
    found = Search(null, (judge(null, (), 0.01, weights, 1),), 0.0, frozenset({()}), (), 0.01)
    new = with_parts(found, rms_of(null), weights)
    best = max(new.judged, key=lambda j: j.log_evidence)
    told = estimates(best)
    assert best.effects == ("inductance_harmonics",)
    assert (told["inductance_harmonics.2.order"].value, told["inductance_harmonics.2.phase"].value) == (12.0, 0.0)
    assert not any(name.startswith("inductance_harmonics.3.") for name in told)
    for name, e in told.items():
        if name.rpartition(".")[2] in ("gamma_6", *SIZES):
            assert abs(e.value - planted.get(name, 0.0)) < 1.5 * (e.high - e.value), name
    assert all(told[name].low * told[name].high > 0.0 for name in planted)
    assert rms_of(null) > 5.0
    assert rms_of(best.fit) < 1.02  # 3600 samples of two currents know it to 1 / sqrt(2 7200) = 0.8 %


@pytest.mark.parametrize(("few", "wide", "calls"), [((), ("flux_harmonics",), 2), ((), ("dead_time",), 1),
                         (("flux_harmonics",), ("dead_time", "flux_harmonics"), 1)])  # fmt: skip
def test_orders_are_looked_for_again_where_the_wider_search_names_a_harmonic(monkeypatch, few, wide, calls):
    """Whatever the wider search names for the first time can have further orders that nothing has looked for."""

    def named(effects):
        return SimpleNamespace(judged=(SimpleNamespace(effects=effects, log_evidence=0.0),))

    asked = []

    def looked(found, *_, **__):
        asked.append(found.judged[0].effects)
        return found

    monkeypatch.setattr(diagnosing, "search", lambda *_, **__: named(few))
    monkeypatch.setattr(diagnosing, "widened", lambda *_, **__: named(wide))
    monkeypatch.setattr(diagnosing, "with_parts", looked)
    monkeypatch.setattr(diagnosing, "without_idle", lambda found, *_, **__: found)
    monkeypatch.setattr(diagnosing, "with_one_for_several", lambda found, *_, **__: found)
    monkeypatch.setattr(diagnosing, "with_fewer", lambda found, *_, **__: found)
    assert diagnosing._searched(None, 1.0, {}, (), 1, print).judged[0].effects == wide
    assert asked == [few, wide][:calls]


def test_no_further_order_where_there_is_none():
    found, weights = searched(SIXTH)
    new = with_parts(found, 5.0, weights)
    assert new.judged == found.judged


def test_a_part_is_off_until_it_has_an_amplitude():
    """An order and a phase alone move nothing, so no coordinates belong to them."""
    neutral = complete(DRIVE.motor, DRIVE.converter)
    off = {**neutral, "flux_harmonics.2.order": 18.0}
    assert of_effect("flux_harmonics", DRIVE, off) == of_effect("flux_harmonics", DRIVE, neutral)
    on = of_effect("flux_harmonics", DRIVE, {**off, "flux_harmonics.2.psi_q": 1e-9})
    assert {c.label for c in on} - {c.label for c in of_effect("flux_harmonics", DRIVE, off)} == {
        "flux_harmonics.2.psi_d", "flux_harmonics.2.psi_q",
    }  # fmt: skip
    polar = of_part(library.load_effect("cogging_torque"), 3, DRIVE, neutral)
    assert [c.form for c in polar] == ["cosine", "sine"]
    assert polar[0].names == ("cogging_torque.3.amplitude", "cogging_torque.3.phase")


def test_every_order_is_tried_in_either_phase(monkeypatch):
    """Cards scan orders 6 to 60 in steps of six, each with phase 0 and a quarter turn, but for the sixth with phase 0,
    which the first part is; of the cogging torque, whose
    phase is fitted, the best values are taken; the next free place is that after the parts that are on."""
    campaign = small_campaign({}, CASES[:1])
    values = complete(DRIVE.motor, DRIVE.converter, {"flux_harmonics.2.order": 12.0, "flux_harmonics.2.psi_d": 1e-4})
    point = Point(prepare(campaign), values)
    found, looked = starts(point, ["flux_harmonics"])
    assert looked == 19
    tried = {(s.begun["flux_harmonics.3.order"], s.begun["flux_harmonics.3.phase"]) for s in found}
    assert tried == {(6.0 * n, x) for n in range(1, 11) for x in (0.0, 0.5 * math.pi)} - {(6.0, 0.0)}
    assert all(s.begun["flux_harmonics.3.psi_d"] == pytest.approx(parts.BEGUN * 0.005 * FLUX) for s in found)
    assert all(dict(c.along)["flux_harmonics.3.order"] == s.begun["flux_harmonics.3.order"]
               for s in found for c in s.coordinates)  # fmt: skip
    monkeypatch.setattr(parts, "best_values", lambda *x: [9.0])
    (cogging,), looked = starts(point, ["cogging_torque"])
    assert looked == 72 + 15  # orders of a turn on the card, 84 to 252 of 12 poles; the best are handed over
    assert cogging.begun["cogging_torque.2.order_mech"] == 9.0
    assert starts(point, ["dead_time"]) == ([], 0)
    every = {f"flux_harmonics.{k}.psi_d": 1e-4 for k in range(2, 7)}
    assert starts(dataclasses.replace(point, values={**values, **every}), ["flux_harmonics"]) == ([], 0)


def test_a_scan_ends_where_its_card_says():
    """Steps of a quarter from 1 to 2, the end among them and nothing beyond; an order of a turn goes on with multiples
    of the poles."""
    order = Parameter("order", "", 1.0, 1.0, 1e4, 1.0, scan=(1.0, 2.0, 0.25))
    card = SimpleNamespace(parameters=(order,), polar=None)
    point = Point(prepare(small_campaign({}, CASES[:1])), {})
    found, looked = parts._scanned(point, card, "mine.{}".format)
    assert [x["mine.order"] for x in found] == [1.0, 1.25, 1.5, 1.75, 2.0]
    assert looked == 5
    poles = scanned(dataclasses.replace(order, scan_poles=21), 7)
    assert poles == [1.0, 1.25, 1.5, 1.75, 2.0, *(14.0 * k for k in range(1, 22))]


def stand_in(effects, told, excess=0.0):
    """Return a judged set with a level and an excess over noise that are given, and leave-one-out levels `told`; its
    fit is its effects."""

    class Effects(tuple):
        """Effects that stand for their fit."""

        objective = 70.0

    table = SimpleNamespace(log_evidence=lambda rest, temperature: told.get(rest, -1e6))
    return SimpleNamespace(effects=effects, level=told[effects], excess=excess, table=table, fit=Effects(effects))


@pytest.fixture
def planned(monkeypatch):
    """Levels and excesses as stand-ins say, no prior on numbers, fits and judgements by the plan's table."""
    plan = {}
    monkeypatch.setattr(parts, "level", lambda j, t: j.level)
    monkeypatch.setattr(parts, "excess", lambda f: plan[f].excess)
    monkeypatch.setattr(parts, "rms_of", lambda f: 1.0)
    monkeypatch.setattr(parts, "log_prior", lambda effects: 0.0)
    monkeypatch.setattr(parts, "towards", lambda fit, rest, chosen: None)

    def attempted(start, rest, weights, *, leader, workers):
        """Return a set for its fit, which knows the best one's objective."""
        assert leader == 70.0
        return rest

    monkeypatch.setattr(parts, "attempted", attempted)
    monkeypatch.setattr(parts, "judge", lambda rest, *x: plan[rest])
    monkeypatch.setattr(parts, "shaped", lambda effect: effect == "shape")
    return plan


def test_a_part_pays_its_price_and_another_effect_closes_half_of_the_gap(planned):
    """By hand: the price is 3; the gap 100, of which CLOSES leaves one half."""
    best, more, other = (stand_in(e, {e: x}) for e, x in ((("a",), 0.0), (("a",), 3.1), (("a", "b"), 10.0)))
    assert parts._worth(more, best, 3.0, 1.0)
    assert not parts._worth(more, best, 3.2, 1.0)
    planned |= {("a",): SimpleNamespace(excess=100.0), ("a", "b"): SimpleNamespace(excess=49.0)}
    assert parts._worth(other, best, 3.0, 1.0)
    planned[("a", "b")].excess = 51.0
    assert not parts._worth(other, best, 3.0, 1.0)


@pytest.mark.parametrize(
    ("other", "asked", "cost"), [(26.0, ["b", "a"], 17.0), (24.0, ["a"], 12.0), (-1.0, ["a"], 12.0)]
)
def test_an_effect_that_is_not_in_the_set_has_to_promise_half_of_the_gap(planned, monkeypatch, other, asked, cost):
    """By hand: the excess is 100, so 25 of log evidence close its half; a part of an effect of the set promises 20,
    more than the price of two that are looked at (2 + log 2).  One that is refused does not end the search for the
    others.  Equations cost 7, a fit and its judgement 2 + 3."""
    best = stand_in(("a",), {("a",): 0.0}, 100.0)
    best.log_evidence, best.fit = 0.0, SimpleNamespace(point=None, effects=("a",))
    monkeypatch.setattr(parts, "excess", lambda f: 100.0)
    monkeypatch.setattr(parts, "candidates", lambda *x: ["a", "b"])
    tried = [SimpleNamespace(effect=e, coordinates=(), parts=1) for e in ("a", "b")]
    monkeypatch.setattr(parts, "starts", lambda *x: (tried, 2))
    monkeypatch.setattr(parts, "together", lambda *x: [])
    monkeypatch.setattr(parts, "gains_of", lambda *x: ([20.0, other], SimpleNamespace(simulations=7.0), None))
    seen = []

    def refused(best, start, *x):
        """Fit a set that is not worth it."""
        seen.append(start.effect)
        return SimpleNamespace(simulations=2.0, fit=SimpleNamespace(simulations=3.0), effects=("a",), level=0.0)

    monkeypatch.setattr(parts, "_with", refused)
    grown = parts._grown(SimpleNamespace(judged=(best,)), 1.0, (), {}, 1, lambda words: None)
    assert (grown, seen) == (([], cost), asked)


def test_effects_that_an_order_has_made_needless_go_one_by_one(planned):
    """Levels by hand: b and c are each worth less than nothing, a is needed; a leave-out that is clearly worse (40, and
    30 are DOUBTED) is not fitted."""
    levels = {("a", "b", "c"): 0.0, ("b", "c"): -40.0, ("a", "b"): 1.0, ("a", "c"): 2.0, ("a",): 4.0, ("c",): -50.0}
    levels |= {("b",): -50.0, (): -99.0}
    planned |= {k: stand_in(k, {**levels, k: levels[k]}) for k in levels}
    found = SimpleNamespace(chosen=(), share=0.0)
    out = parts._without(planned[("a", "b", "c")], found, 1.0, {}, 1)
    assert [j.effects for j in out] == [("a", "c"), ("a", "b"), ("a",)]


def test_a_needless_effect_with_a_shape_goes_though_the_equations_of_one_point_need_it(planned):
    """On a bench with orders 12 and 18 of the inductance a ripple of the link of 0.05 V stayed: the equations said that
    2.6e6 of log evidence hang on it, with the frequency held where the search began."""
    told = {("a", "shape"): 0.0, ("a",): -2.6e6, ("shape",): -40.0, (): -99.0}
    fitted = {("a", "shape"): 0.0, ("a",): 3.0}
    for k, x in fitted.items():
        planned[k] = stand_in(k, {**told, k: x})
    planned[()] = stand_in((), {(): -99.0})
    found = SimpleNamespace(chosen=(), share=0.0)
    out = parts._without(planned[("a", "shape")], found, 1.0, {}, 1)
    assert [j.effects for j in out] == [("a",)]


def test_which_effects_have_a_shape():
    """Orders of further parts do not count: the effect is there without them."""
    assert {e for e in library.effect_names() if parts.shaped(e)} == {"dc_link_ripple", "cogging_torque"}


@pytest.mark.parametrize(("unknown", "rotor"), [(0.0, "driven"), (1.0, "driven"), (1.0, "free"), (1.0, "locked")])
def test_another_part_is_looked_for_of_named_effects_and_beside_a_rest_of_others_that_can_have_one(unknown, rotor):
    further = {e for e in library.effect_names() if library.load_effect(e).further}
    assert "flux_harmonics" in further
    recordings = (SimpleNamespace(rotor="locked"), SimpleNamespace(rotor=rotor))
    fit = SimpleNamespace(point=SimpleNamespace(prepared=SimpleNamespace(recordings=recordings)))
    best = SimpleNamespace(effects=("dead_time", "flux_harmonics"), fit=fit)
    barred = sorted(further - {"flux_harmonics"})[0]
    found = parts.candidates(best, SimpleNamespace(remainder=lambda fit: SimpleNamespace(unknown=unknown)), (barred,))
    others = further - {"flux_harmonics", barred}
    assert set(found) == {"dead_time", "flux_harmonics"} | (others if unknown and rotor != "locked" else set())
