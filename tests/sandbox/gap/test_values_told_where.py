"""Numbers of what a diagnosis says: which shares are spoken of, what counts as alike, which list holds 95 %."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.gap import diagnose
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.discrepancy import Remainder
from sandbox.gap.location import where
from sandbox.gap.location.decompose import CURRENT_NAMES, DIRECTIONS, SPEED_NAMES, Decomposition
from sandbox.gap.location.readings import Readings
from sandbox.gap.report import answers, left, position, position_moved, ranking, shares
from sandbox.gap.search.forward import Search
from sandbox.gap.search.inclusion import summed
from sandbox.gap.words import PREFIXES

HALF = 1.0 / len(SPEED_NAMES)


def part(**more):
    """A residual of currents without a pattern, apart from what is given."""
    own = {
        "excess": 1.0, "recordings": {"a": 0.5, "b": 0.5},
        "channels": {"currents": 1.0, "motion": 0.0, "position": 0.0},
        "directions": dict.fromkeys(DIRECTIONS, 0.1), "speeds": dict.fromkeys(SPEED_NAMES, HALF),
        "currents": dict.fromkeys(CURRENT_NAMES, HALF), "amplitude": np.full((4, 4), np.nan),
        "electrical": {0: 0.0, 6: 0.0, -6: 0.0}, "mechanical": {5: 0.0}, "injection": 0.0, "line": None,
        "readings": Readings(0.0, {}, {}, np.full((4, 4), np.nan)),
    }  # fmt: skip
    return Decomposition(**(own | more))


def said(share=1.0, **more):
    """The sentences on such a residual but for the first, which says what it is."""
    return [f.text for f in where.sentences("machine", share, part(**more))][1:]


@pytest.mark.parametrize(
    ("detail", "expected"),
    [
        ({"channels": {"currents": 0.9, "motion": 0.11, "position": 0.09}}, "motion"),
        ({"electrical": {0: 0.0, 6: 0.06, -6: 0.05}}, "6"),  # both signs of an order together
        ({"mechanical": {5: 0.11, 7: 0.09}}, "mechanical order 5"),
        ({"injection": 0.11}, "injection"),
        ({"line": (173.0, 0.11)}, "173 Hz"),
    ],
)
def test_a_detail_is_spoken_of_from_a_tenth(detail, expected):
    found = said(**detail)
    assert len(found) == 1
    assert expected in found[0]


@pytest.mark.parametrize(
    "detail",
    [
        {"electrical": {0: 0.0, 6: 0.05, -6: 0.04}}, {"mechanical": {5: 0.09}}, {"injection": 0.09},
        {"line": (173.0, 0.09)}, {"electrical": {0: 0.5, 6: 0.0, -6: 0.0}},
    ],
)  # fmt: skip
def test_below_a_tenth_nothing_is_said_nor_of_what_turns_with_the_rotor(detail):
    assert said(**detail) == []


def test_the_first_two_orders_have_words():
    assert "stands still in the stator" in said(electrical={1: 0.0, -1: 0.5})[0]
    assert "turns against the rotor" in said(electrical={2: 0.0, -2: 0.5})[0]


@pytest.mark.parametrize(("of", "count", "told"), [(0.74, 2, 0), (0.76, 2, 1), (0.09, 20, 0), (0.11, 20, 1)])
def test_a_recording_is_told_of_where_it_has_half_more_than_its_share(of, count, told):
    """1.5 over their number, at least a tenth."""
    recordings = {"a": of} | dict.fromkeys(map(str, range(1, count)), 0.0)
    assert len(list(where.sentences("machine", 1.0, part(recordings=recordings)))) == 1 + told


@pytest.mark.parametrize(("share", "own"), [(0.99, False), (0.97, True)])
def test_a_share_of_nearly_all_is_the_gap_s(share, own):
    """Below 98 % a detail is told as one of the subsystem's part."""
    assert said(share=share, injection=0.5)[0].startswith("Of the" if own else "5") is True


@pytest.mark.parametrize(
    ("ratio", "word"),
    [
        (1.45, "does not depend on speed"), (1.55, "grows with speed"),
        (1 / 1.45, "does not depend on speed"), (1 / 1.55, "falls with speed"),
    ],
)  # fmt: skip
def test_amplitudes_within_one_and_a_half_are_alike(ratio, word):
    amplitude = np.full((4, 4), np.nan)
    amplitude[0, 2], amplitude[3, 2] = 1.0, ratio
    assert word in where._dependence(amplitude)


@pytest.mark.parametrize(
    ("others", "more"),
    [
        ([("machine", 0.199)], ""),
        ([("machine", 0.45)], " A further 45 % of the gap points to the machine."),
        (
            [("machine", 0.25), ("sensor", 0.2)],
            " A further 25 % of the gap points to the machine and 20 % to the sensors.",
        ),
    ],
)
def test_a_further_subsystem_is_named_from_a_fifth(monkeypatch, others, more):
    """A detail of the first one, however large, is no further subsystem."""
    monkeypatch.setattr(where, "verdict", lambda d: "explained")
    found = [
        where.Finding(name, "", "", None, share, name)
        for name, share in [("inverter", 0.55), ("inverter", 0.5), *others]
    ]
    assert where.summary(None, found) == f"inverter{more}"


@pytest.mark.parametrize(("turning", "order"), [(0.09, None), (0.11, 6)])
def test_an_order_is_the_gap_s_where_it_has_most_of_a_tenth(turning, order):
    found = next(where.sentences("machine", 1.0, part(electrical={0: 0.0, 6: turning})))
    assert found.order == order


def diagnosis(*told):
    """A diagnosis of these (effects, probability)."""
    own = [SimpleNamespace(effects=e, probability=p) for e, p in told]
    return SimpleNamespace(hypotheses=own, ambiguity_set=own, fitted=frozenset())


@pytest.mark.parametrize(("chance", "told"), [(0.09, 0), (0.11, 2)])
def test_a_gap_that_may_be_none_is_spoken_of_from_a_tenth(chance, told):
    """Of subsystems those with a fiftieth of it."""
    shares = {"machine": 0.96, "sensor": 0.021, "mechanics": 0.019}
    assert len(where.possible(diagnosis(((), 1.0 - chance), (("inertia",), chance)), shares)) == told


def test_subsystems_below_a_fiftieth_are_not_spoken_of(monkeypatch):
    monkeypatch.setattr(where, "subsystems", lambda d: {"machine": 0.96, "sensor": 0.021, "mechanics": 0.019})
    monkeypatch.setattr(where, "verdict", lambda d: "unknown")
    monkeypatch.setattr(where, "without", lambda d, name, alone: SimpleNamespace(
        prepared=SimpleNamespace(recordings=(1, 2)), name=name, alone=alone))  # fmt: skip
    monkeypatch.setattr(where, "shown", lambda point: point)
    monkeypatch.setattr(where, "decompose", lambda point, shown: part())
    assert [f.subsystem for f in where.where(diagnosis())] == ["machine", "sensor"]


@pytest.mark.parametrize(("closable", "more"), [(4e-4, False), (6e-4, True)])
def test_less_than_a_two_thousandth_is_nothing_more(closable, more):
    remains = SimpleNamespace(structure=True, closable=closable, of_gap=None)
    text = left.regression_text(SimpleNamespace(remains=remains, diagnosis=None))
    assert text == "On the recordings held out, a general fit by currents, speed and angle " + (
        "explains 0.1 % of what remains: structure that no effect took up." if more else "finds nothing more."
    )


@pytest.mark.parametrize(("share", "told"), [(0.14, False), (0.16, True)])
def test_a_kind_of_functions_is_spoken_of_from_a_seventh(share, told):
    described = [SimpleNamespace(acts_as="voltage", hangs_on="speed", share=share)]
    open_part = SimpleNamespace(beside=SimpleNamespace(described=described, worth=0.5), chances={})
    none = SimpleNamespace(best=SimpleNamespace(effects=()))
    a = SimpleNamespace(ranking=SimpleNamespace(open_part=open_part), diagnosis=none)
    assert ("a voltage that depends on the speed" in left.beside_text(a)) == told


@pytest.mark.parametrize(("alike", "told"), [(1.9, False), (2.1, True)])
def test_residuals_are_alike_from_twice_white_noise(alike, told):
    assert bool(left.alike_text(SimpleNamespace(remains=SimpleNamespace(alike=alike)))) == told


@pytest.mark.parametrize(("before", "few"), [(1.19, False), (1.21, True)])
def test_a_fifth_above_the_floor_recordings_foretell_each_other_no_more(before, few):
    size = SimpleNamespace(before=before, after=before, closed=None, closed_ci95=None)
    d = SimpleNamespace(size=size, held_out=(0,), remainder=SimpleNamespace(before=0.0))
    text = answers.far_text(SimpleNamespace(diagnosis=d, verdict="no_gap", position=None))
    assert ("too few recordings" in text) == few


@pytest.mark.parametrize(("first", "count"), [(0.951, 1), (0.949, 2)])
def test_the_list_that_is_told_holds_nineteen_of_twenty(first, count):
    assert len(Diagnosis.ambiguity_set.fget(diagnosis((("a",), first), (("b",), 1.0 - first)))) == count


@pytest.mark.parametrize(("unknown", "chance", "asked", "moved"), [(0.04, 0.49, 0, []), (0.06, 0.51, 1, ["a"])])
def test_which_effects_move_the_position_and_when_a_regression_is_made(monkeypatch, unknown, chance, asked, moved):
    """From even odds on; from one in twenty of `unknown` on."""
    calls = []
    monkeypatch.setattr(ranking, "inclusion", lambda *_: summed({("a",): chance, (): 1.0 - chance}, "a"))
    monkeypatch.setattr(ranking, "open_part", lambda d, workers: calls.append(1))
    monkeypatch.setattr(ranking, "shares", lambda d: None)
    monkeypatch.setattr(ranking, "verdict", lambda d: "explained")
    monkeypatch.setattr(ranking, "completed", lambda d, r: r)
    monkeypatch.setattr(ranking, "moved", lambda drive, values: list(values))
    d = diagnosis((("a",), 1.0 - unknown), (("a", "unknown"), unknown))
    d.parameters, d.temperature = [{}, {}], 1.0
    d.remainder, d.campaign = SimpleNamespace(share=None), SimpleNamespace(drive=None)
    assert (ranking.ranking(d).moved, len(calls)) == (moved, asked)


def test_where_unknown_is_alone_no_effect_is_there(monkeypatch):
    """Without a regression that says what stands beside it, `a` has the mass of the sets that hold it: 0.39 + 0.01."""
    monkeypatch.setattr(ranking, "inclusion", lambda *_: summed({("a",): 1.0}, "a"))
    monkeypatch.setattr(ranking, "open_part", lambda d, workers: None)
    monkeypatch.setattr(ranking, "shares", lambda d: None)
    monkeypatch.setattr(ranking, "verdict", lambda d: "unknown")
    monkeypatch.setattr(ranking, "completed", lambda d, r: r)
    d = diagnosis((("unknown",), 0.6), (("a", "unknown"), 0.39), (("a",), 0.01))
    d.parameters, d.temperature = [{}, {}, {}], 1.0
    d.remainder, d.campaign = SimpleNamespace(share=None), SimpleNamespace(drive=None)
    found = ranking.ranking(d, position=False)
    assert found.inclusion.chances == pytest.approx({"a": 0.4})
    assert found.unknown == pytest.approx(0.99)


@pytest.mark.parametrize(("turns", "suits"), [(1.9, False), (2.1, True)])
def test_a_rotor_turns_from_two_electrical_turns_on(turns, suits):
    r = SimpleNamespace(file="a", rotor="driven", motion=SimpleNamespace(angle=np.linspace(0.0, turns * math.tau, 9)))
    start, injected = SimpleNamespace(prepared=SimpleNamespace(recordings=[r])), SimpleNamespace(injection_axis="d")
    d = SimpleNamespace(start=start, campaign={"a": injected})
    assert position._suits(d, 0) == suits


@pytest.mark.parametrize(
    ("rotor", "axis", "turns", "why"),
    [
        ("driven", "none", 9.0, "no turning recording has injection"),
        ("locked", "d", 0.0, "no turning recording has injection"),
        ("free", "d", 1.9, "no recording with injection turns by more than 2 electrical turns"),
        ("free", "d", 9.0, "the estimator 'ekf' cannot run on these recordings: no saliency"),
    ],
)
def test_why_there_is_no_position_error(monkeypatch, rotor, axis, turns, why):
    def refused(*_):
        raise BadInput("no saliency")

    monkeypatch.setattr(position, "errors", refused)
    r = SimpleNamespace(file="a", rotor=rotor, motion=SimpleNamespace(angle=np.linspace(0.0, turns * math.tau, 9)))

    class Injected(dict):
        drive = None

    d = SimpleNamespace(
        start=SimpleNamespace(prepared=SimpleNamespace(recordings=[r])),
        campaign=Injected(a=SimpleNamespace(injection_axis=axis)),
    )
    assert position.compared(d) == why
    assert position.position_error(d) is None


def test_position_is_judged_a_tenth_of_a_second_after_the_start(monkeypatch):
    """At 10 kHz the first 1000 samples are left out."""
    n = 1500
    own = SimpleNamespace(init=lambda *_: None)
    design = SimpleNamespace(tuning=None)
    monkeypatch.setattr(position, "load_estimator", lambda name: own)
    monkeypatch.setattr(position, "design", lambda drive, start_up: design)
    monkeypatch.setattr(position, "belief_of", lambda drive, kind: None)
    monkeypatch.setattr(position, "carrier_at", lambda drive, r: np.zeros(n))
    monkeypatch.setattr(position, "follow", lambda own, state, given, belief, tuning, found: found.fill(0.0))
    zero = np.zeros(n)
    r = SimpleNamespace(theta=0.001 * np.arange(n), u_alpha=zero, u_beta=zero, settling={}, current=(zero, zero))
    r.with_settling = lambda: r
    drive = SimpleNamespace(converter=SimpleNamespace(sampling_period=1e-4))
    found = position.errors(drive, r, np.zeros((n, 2)), "ekf")
    assert (len(found), found[0]) == (500, pytest.approx(1.0))


def test_estimators_are_judged_where_they_work():
    """Injection at 5 % of rated speed, the back-EMF at half of it, one mechanical turn after 0.3 s up, 0.3 s of load
    coming on and half a second."""
    assert position_moved.ESTIMATORS == {"qnull": 0.05, "ekf": 0.05, "active_flux": 0.5}
    assert (position_moved.RAMP, position_moved.SETTLE, position_moved.LONGEST_TURN) == (0.3, 0.5, 2.0)


def test_prefixes_are_those_of_the_si():
    assert dict(PREFIXES) == {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "µ", 1e-9: "n"}


def test_a_shape_that_is_gone_is_neutral_and_nothing_else(monkeypatch):
    """A shaft has no size: its stiffness is put to its neutral value, what others have stays as algebra left it."""

    @dataclass(frozen=True)
    class At:
        prepared: object
        values: dict

    campaign = SimpleNamespace(drive=SimpleNamespace(motor=None))
    at = At(SimpleNamespace(campaign=campaign), {"shaft.stiffness": 90.0, "shaft_rub.torque": 2.0})
    coordinate = SimpleNamespace(form="log")
    table = SimpleNamespace(
        coordinates=[coordinate], members={"shaft": (0,)}, point=SimpleNamespace(moved=lambda c, x: at)
    )
    j = SimpleNamespace(table=table, normal=SimpleNamespace(coordinates=[coordinate]))
    monkeypatch.setattr(shares, "_values", lambda j, gone: [1.0])
    neutral = {"shaft.stiffness": math.inf, "shaft_rub.torque": 0.0}
    monkeypatch.setattr(shares, "library", SimpleNamespace(neutral=lambda motor: neutral))
    assert shares.without(j, ["shaft"]).values == {"shaft.stiffness": math.inf, "shaft_rub.torque": 2.0}
    coordinate.form = "linear"
    assert shares.without(j, ["shaft"]).values == at.values


def test_a_waterfall_has_a_step_for_every_effect(monkeypatch):
    """Those ranked behind are taken out; the last step is the fit's own, and a point that no drive can have is nan."""
    gone = []

    def without(j, effects):
        gone.append(tuple(effects))
        if effects == ["c"]:
            raise BadInput("the link's voltage is negative")
        return effects

    monkeypatch.setattr(shares, "with_part", lambda d, effects: without(None, effects))
    monkeypatch.setattr(shares, "normal", lambda point, coordinates: point)
    monkeypatch.setattr(shares, "rms", lambda n, chosen: float(len(n)))
    d = SimpleNamespace(held_out=(1,), size=SimpleNamespace(after=1.01))
    found = shares._waterfall(d, ["a", "b", "c"])
    assert [e for e, _ in found] == ["a", "b", "c"]
    assert [x for _, x in found] == pytest.approx([2.0, math.nan, 1.01], nan_ok=True)
    assert gone == [("b", "c"), ("c",)]


def test_all_sets_are_ranked_three_times_at_most(monkeypatch):
    """Every set that is fitted beside `unknown` proves better than all before: the third is not ranked again."""
    ranked = []

    def of_level(level):
        return SimpleNamespace(effects=(f"e{level}",), fit=SimpleNamespace(effects=()), level=level)

    def ranking(found, *_):
        ranked.append(len(found.judged))
        return found.judged, [(1.0, max(found.judged, key=lambda j: j.level))], 1.0

    monkeypatch.setattr(Search, "remainder", lambda found, fit: Remainder(9.0, 0.0, 0.2, 0.9))
    monkeypatch.setattr(diagnose, "level", lambda j, temperature: j.level)
    monkeypatch.setattr(diagnose, "_ranked", ranking)
    monkeypatch.setattr(diagnose, "beside_unknown", lambda found, best, *_: of_level(best.level + 1))
    monkeypatch.setattr(diagnose, "with_unknown", lambda ranked, *_: [SimpleNamespace(judged=ranked[0][1])])
    diagnose._weighed(Search(None, (of_level(0),), 0.0, frozenset(), (), 0.01), 1.0, {}, 1)
    assert ranked == [1, 2, 3]
