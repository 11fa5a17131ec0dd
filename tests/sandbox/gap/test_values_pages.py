"""Numbers of what a person sees of a diagnosis: what is listed, said and drawn; drawings are told,
not made."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.evidence.gap_size import OfRecording
from sandbox.gap.pages import charts, listed, page, signals
from sandbox.gap.posterior.estimates import Estimate
from sandbox.gap.posterior.remainder import Unexplained
from sandbox.gap.report.distinguishability import Alike
from sandbox.gap.report.shares import Share
from sandbox.gap.words import interval
from tests.sandbox.gap.conftest import DRIVE


def ranking(chances, unknown=0.0, **more):
    own = {
        "of": {"inertia": Share(0.5, 0.25, 0.75, 0.5)},
        "waterfall": (),
        "parameters": {},
        "groups": (),
        "moved": {},
    } | more
    return SimpleNamespace(
        inclusion=SimpleNamespace(chances=chances, groups=own["groups"]),
        unknown=unknown,
        beside_unknown=False,
        unexplained=Unexplained(0.125, (0.0625, 0.25)),
        where=None,
        told={},
        sizes=lambda e: own["parameters"].get(e, {}),
        shares=SimpleNamespace(of=own["of"], waterfall=own["waterfall"]),
        parameters=own["parameters"],
        moved=own["moved"],
    )


def test_effects_are_listed_from_a_chance_of_one_in_a_hundred():
    found = listed.rows(ranking({"inertia": 0.011, "iron_loss": 0.009}, 0.011))
    outside = ["something outside the library", "1.1 %", "12.5 % [6.2 %, 25.0 %]", "–"]
    assert found == [["inertia", "1.1 %", "50.0 % [25.0 %, 75.0 %]", "–"], outside]
    assert listed.rows(ranking({"iron_loss": 0.5}, 0.009)) == [["iron loss", "50.0 %", "–", "–"]]


@pytest.mark.parametrize(
    ("count", "size"), [(1, "n0 1"), (2, "n0 1, n1 1"), (3, "n0 1, ..., see below")]
)
def test_two_parameters_stand_in_the_list(count, size):
    own = {f"inertia.n{k}": Estimate(1.0, 1.0, 1.0, "") for k in range(count)}
    found = listed.rows(ranking({"inertia": 1.0}, parameters={"inertia": own}))[0][3]
    assert found.replace("1.00", "1") == size


def test_groups_and_the_waterfall():
    r = ranking(
        {},
        groups=((("inertia", "iron_loss"), 0.93),),
        waterfall=(("inertia", 2.0), ("iron_loss", math.inf)),
    )
    assert next(listed.group_sentences(r)).startswith(
        "One of inertia or iron loss is there (93 %)."
    )
    a = SimpleNamespace(ranking=r, diagnosis=SimpleNamespace(size=SimpleNamespace(before=5.0)))
    assert listed.waterfall(a) == (["before", "+ inertia", "noise"], [5.0, 2.0, 1.0])


def hypotheses(*chances):
    return [SimpleNamespace(effects=("inertia",), probability=p) for p in chances]


@pytest.fixture
def drawn(monkeypatch):
    """What is drawn: a list of (labels or panels, series, logarithmic axes)."""
    seen = []
    monkeypatch.setattr(
        charts, "bars_svg", lambda labels, series, xlabel, *, ylabel="": bars(labels, series, "")
    )
    monkeypatch.setattr(page, "dots_svg", lambda labels, series, xlabel: bars(labels, series, "x"))

    def bars(labels, series, log):
        seen.append((labels, series, log))
        return ""

    monkeypatch.setattr(
        page, "lines_svg", lambda panels, xlabel: seen.append((panels, None, None)) or ""
    )
    monkeypatch.setattr(
        signals,
        "lines_svg",
        lambda panels, xlabel, log="", bands=(): seen.append((panels, bands, log)) or "",
    )
    return seen


def test_hypotheses_below_one_in_a_thousand_are_folded(monkeypatch):
    seen = []
    monkeypatch.setattr(page, "_three", lambda a: [])
    monkeypatch.setattr(
        page, "_hypotheses", lambda a, chosen: seen.append([h.probability for h in chosen]) or ""
    )
    own = SimpleNamespace(hypotheses=hypotheses(0.9, 0.0011, 0.0009))
    a = SimpleNamespace(badge="no_gap", ranking=None, diagnosis=own)
    body, detail = page._body(a, "x"), page._detail(a)
    assert "No gap" in next(body)
    assert next(body) == "<h2>Hypotheses</h2>"
    assert "dropped" in next(detail)
    assert seen == [[0.9, 0.0011], [0.0009]]


def test_a_probability_is_a_number_and_a_bar(monkeypatch):
    monkeypatch.setattr(page, "closed_by", lambda d, h: 0.25)
    own = hypotheses(0.9)
    found = page._hypotheses(
        SimpleNamespace(shares={}, diagnosis=SimpleNamespace(best=own[0])), own
    )
    assert "width:90.0%" in found
    assert ">90.0&nbsp;%<" in found
    assert ">25.0&nbsp;%<" in found


def test_six_hypotheses_are_printed(monkeypatch, capsys):
    tables = {}
    for name in ("where_text", "which_text", "far_text", "next_text"):
        monkeypatch.setattr(page.answers, name, lambda a: "told")
    monkeypatch.setattr(page.left, "remains_text", lambda a: "told")
    monkeypatch.setattr(page.answers, "caveats", lambda a: [])
    monkeypatch.setattr(page, "closed_by", lambda d, h: None)
    monkeypatch.setattr(
        page, "print_table", lambda title, heads, rows: tables.update({title: rows})
    )
    d = SimpleNamespace(
        campaign=SimpleNamespace(name="x"),
        hypotheses=(own := hypotheses(*[0.1] * 9)),
        best=own[0],
        parameters=[{"a.b": None}, {}],
        size=SimpleNamespace(recordings=[("r", 2.0, 1.0, True)]),
        simulations=7,
        seconds=1.0,
    )
    monkeypatch.setattr(page, "_parameters", lambda a, own: list(own))
    page.print_answers(
        SimpleNamespace(diagnosis=d, badge="explained", ranking=None, shares={}, curves=())
    )
    assert tables["hypotheses"] == [["inertia", "0.100", "–"]] * 6
    assert tables["parameters"] == ["a.b"]
    assert tables["residual over its noise floor (rms)"] == [["r (held out)", "2.00", "1.00"]]
    assert "7 simulations in 1.0 s" in capsys.readouterr().out


@pytest.mark.parametrize(("fall", "said"), [(2.9, "Flat"), (3.1, "It falls by 3 on")])
def test_a_likelihood_is_flat_up_to_a_fall_of_three(drawn, fall, said):
    x = Alike(("inertia",), (), {"inertia": 0.5}, (0.0, 0.5, 1.0), (-1.0, -1.0 - fall, -1.5))
    found = list(page._why_alike(x))
    assert said in found[-1]
    assert "looks like what ordinary deviations can do: cosine 0.5000" in found[1]


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        (
            (-60.0, 0.0),
            (
                "By 60 the recordings prefer inertia. That no effect is still left is due to "
                "the priors"
            ),
        ),
        (
            (0.0, -60.0),
            (
                "By 60 the recordings prefer no effect. That inertia is still left is due to "
                "the priors"
            ),
        ),
        ((-2.9, -40.0), "By 37 the recordings prefer no effect."),
        ((0.0, -2.9), "Flat: the recordings cannot choose."),
    ],
)
def test_ends_that_differ_are_told(ends, said):
    """0 is the second fit's end, 1 the first's; the best point of the way has 0."""
    between = () if 0.0 in ends else (0.0,)
    share = (0.0, *(0.5 for _ in between), 1.0)
    x = Alike(("inertia",), (), {"inertia": 0.5}, share, (ends[0], *between, ends[1]))
    assert page._way(x).startswith(said)


def test_an_end_that_cannot_be_simulated_prefers_nothing():
    x = Alike(("inertia",), (), {"inertia": 0.5}, (0.0, 0.5), (-9.0, 0.0))
    assert page._way(x) == "It falls by 9 where a drive can be simulated; at one end none can."


def apart(**electrical):
    """A residual taken apart, by order of the rotor's frame."""
    return SimpleNamespace(
        excess=8.0,
        directions={"on the d axis": 0.5},
        speeds={"at standstill": 0.4},
        currents={},
        electrical={int(k[1:]): v for k, v in electrical.items()} or {0: 0.0},
        readings=SimpleNamespace(constant={"a": 0.25, "b": 0.0, "c": 0.0}),
    )


def test_charts_are_of_the_parts_that_sentences_speak_of(drawn):
    """Two subsystems: the sensors' chart has what is constant in a phase, the inverter's the
    voltage's direction."""
    parts = [
        SimpleNamespace(subsystem="inverter", share=0.7, left=apart(), of_readings=False),
        SimpleNamespace(subsystem="sensor", share=0.3, left=apart(), of_readings=True),
    ]
    found = "".join(charts.of_parts(parts, None, apart()))
    assert found.index(" part, 70&nbsp;% of the gap") < found.index(" part, 30&nbsp;% of the gap")
    assert [x[0] for x in drawn] == [
        ["on the d axis", "at standstill"],
        ["constant in phase a", "constant in phase b", "constant in phase c", "at standstill"],
    ]
    assert drawn[1][1]["before"] == pytest.approx([25.0, 0.0, 0.0, 40.0])
    assert found.count("Bars of speed and current are shares of squared residuals") == 2
    drawn.clear()
    # one subsystem's: its own, not that of the whole
    list(charts.of_parts(parts[:1], None, apart()))
    assert [x[0] for x in drawn] == [["on the d axis", "at standstill"]]
    drawn.clear()
    list(charts.of_parts([], apart(), apart()))  # none is spoken of: the whole
    assert [x[0] for x in drawn] == [["on the d axis", "at standstill"]]


@pytest.mark.parametrize(("count", "figures", "held"), [(0, 0, (1,)), (1, 1, ()), (2, 1, (1,))])
def test_a_waterfall_is_drawn_for_one_effect_and_more(monkeypatch, drawn, count, figures, held):
    steps = (("inertia", 2.0), ("iron_loss", 1.5))[:count]
    a = SimpleNamespace(
        ranking=ranking({"inertia": 1.0}, waterfall=steps),
        following=None,
        diagnosis=SimpleNamespace(
            size=SimpleNamespace(before=5.0),
            best=SimpleNamespace(effects=(), probability=1.0),
            held_out=held,
            campaign=SimpleNamespace(drive=DRIVE),
        ),
    )
    found = "".join(page._listed(a))
    assert ("Residual on the recordings held out as" in found) == bool(held and count)
    assert ("Residual on all recordings as" in found) == bool(not held and count)
    assert len(drawn) == figures
    assert [x[2] for x in drawn] == ["x"] * figures


@pytest.mark.parametrize(
    ("effects", "series"), [((), ["before"]), (("inertia",), ["before", "after"])]
)
def test_residuals_of_recordings_are_drawn_as_dots(drawn, effects, series):
    rows = [OfRecording("r.parquet", 4.0, 2.0, False)]
    d = SimpleNamespace(
        size=SimpleNamespace(recordings=rows), after=SimpleNamespace(effects=effects)
    )
    page._by_recording(SimpleNamespace(diagnosis=d))
    assert drawn[0][2] == "x"
    assert list(drawn[0][1]) == series
    assert drawn[0][0] == ["r"]


@pytest.mark.parametrize(("share", "figures"), [(0.0049, 1), (0.0051, 2)])
def test_orders_are_drawn_where_one_holds_a_hundredth_of_the_gap(drawn, share, figures):
    """Order 2 forwards and backwards together; what is left, 2 of 8, is told in shares of the gap
    before."""
    part = SimpleNamespace(
        excess=8.0,
        directions={"d": 0.5},
        speeds={},
        currents={},
        electrical={0: 0.001, 2: share, -2: share},
    )
    rest = SimpleNamespace(
        excess=2.0, directions={"d": 0.4}, speeds={}, currents={}, electrical={2: 0.5}
    )
    list(charts.shares(part, rest))
    assert len(drawn) == figures
    assert drawn[0][1] == {"before": [50.0], "after": pytest.approx([10.0])}
    if figures > 1:
        before, after = drawn[1][1].values()
        assert drawn[1][0] == ["0", "2"]
        assert before == pytest.approx([0.1, 200.0 * share])
        assert after == pytest.approx([0.0, 12.5])


def test_a_recordings_share_of_the_gap():
    d = SimpleNamespace(size=SimpleNamespace(recordings=[("r", 2.0, 1.0, True)]))
    part = SimpleNamespace(recordings={"r": 0.25})
    assert page._recordings(SimpleNamespace(diagnosis=d), part) == [
        ["r (held out)", "2.00", "1.00", "25 %"]
    ]


class Recorded(dict):
    """Recordings by file, with a drive."""


@pytest.mark.parametrize(
    ("n", "period", "points", "milliseconds"), [(2401, 1e-3, 1200, 40), (900, 0.1, 900, 200)]
)
def test_residuals_over_time_by_hand(monkeypatch, drawn, n, period, points, milliseconds):
    """1200 points of a line, each the largest of its interval with its sign; currents of 40 ms (two
    samples at the least) around the largest residuals, at the end."""
    residual = np.zeros((n, 3, 1))
    residual[n // 2 - 1, 0], residual[-5:, 1] = -3.0, 9.0
    shown = [SimpleNamespace(current=residual, motion=np.full((n, 1), -4.0))]
    prepared = SimpleNamespace(
        recordings=[SimpleNamespace(file="r", samples=n, first=0)], noise_std=0.5
    )
    columns = {f"i_{p}": np.full(n, 2.0) for p in "abc"}
    campaign = Recorded(r=SimpleNamespace(columns=columns))
    campaign.drive = SimpleNamespace(converter=SimpleNamespace(sampling_period=period))
    a = SimpleNamespace(
        diagnosis=SimpleNamespace(start=SimpleNamespace(prepared=prepared), campaign=campaign)
    )
    monkeypatch.setattr(signals.looks, "spectrum", lambda x, period: (np.ones(1), np.ones(1)))
    found = "".join(signals.waves(a, SimpleNamespace(recordings={"r": 1.0}), shown, shown))
    assert f"sample by sample, {milliseconds} ms" in found
    t, peaks = drawn[0][0][0][1]["before"]
    assert len(t) == points
    assert t[1] == pytest.approx(n // points * period)
    assert min(peaks) == -3.0 * 0.5  # in A: the floor is 0.5 A
    assert drawn[0][1] == [0.5, 0.5, 0.5, 1.0]  # one floor of each panel as a band
    assert "Grey: one noise floor either way (500 mA, rms of the noise)" in found
    assert max(peaks) == 0.0
    assert drawn[0][0][3][0] == "motion\n(noise floors)"
    assert drawn[0][0][3][1]["after"][1] == [-4.0] * points
    name, lines = drawn[1][0][1]
    assert name == "i_b (A)"
    assert lines["measured"][1][-1] == 2.0
    assert lines["before"][1][-1] == pytest.approx(2.0 - 0.5 * 9.0)
    assert lines["before"][0][0] < (n - 5) * period <= lines["before"][0][-1] or n == 900
    assert drawn[2][2] == "y"


def test_the_worst_stretch_by_hand():
    residual = np.array(
        [[1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, -3.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    )
    assert signals._worst(residual, 2) == (2, 4)  # 9 + 16; 9 + 9 before
    assert signals._worst(residual, 9) == (0, 5)
    assert signals._worst(np.sqrt(np.array([[1.9, 0.0, 0.0], [1.5, 0.0, 0.0]])), 1) == (0, 1)


def test_facts_of_effects_and_nominal_model_are_told():
    """The card of what is named, the drive by its own numbers."""
    d = SimpleNamespace(
        hypotheses=hypotheses(0.9),
        ambiguity_set=[SimpleNamespace(effects=("inertia", "unknown"))],
        campaign=SimpleNamespace(drive=DRIVE),
        held_out=[],
        size=SimpleNamespace(raw=9.0, before=4.0, after=1.0),
        simulations=7,
        seconds=1.0,
        start=None,
    )
    card, model, made = page._detail(SimpleNamespace(diagnosis=d))
    assert re.search(r">rated_current</td><td[^>]*>1\.2</td><td[^>]*>A peak</td>", model)
    assert "The effect inertia" in card
    assert "\\n" not in card  # its lines are lines
    assert "9 noise floors" in made


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            (1.2, -0.2),
            (
                "Iron loss partly cancels other effects: without it the gap would be larger, "
                "so its share is negative."
            ),
        ),
        (
            (1.4, -0.2, -0.2),
            "Iron loss and PWM delay partly cancel other effects: without them the gap would be "
            "larger, so their shares are negative.",
        ),
        ((1.025, -0.025), "Iron loss partly cancels other effects"),  # two per cent are the bound
        ((1.015, -0.015), ""),
    ],
)
def test_effects_that_cancel_others_are_told(values, said):
    own = dict(
        zip(
            ("inertia", "iron_loss", "pwm_delay"), (Share(x, x, x, x) for x in values), strict=False
        )
    )
    found = listed.hidden_sentence(SimpleNamespace(shares=SimpleNamespace(of=own)))
    assert found.startswith(said)
    assert bool(found) == bool(said)


def test_a_share_too_small_to_see_is_not_nought():
    assert interval(0.0004, 0.0002, 0.00049) == "< 0.1 %"
    assert interval(0.0, 0.0, 0.0) == "0.0 % [0.0 %, 0.0 %]"
    assert interval(0.0004, -0.001, 0.002) == "0.0 % [-0.1 %, 0.2 %]"


def test_a_table_says_more_than_all_but_a_thousandth_as_text_does():
    assert (page._share(0.99996), page._share(1.2), page._share(None)) == (
        "more than 99.9 %",
        "more than 99.9 %",
        "–",
    )


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        (("a", "b", "c"), "a + b + c"),
        (tuple("abcd"), "the 4 effects above"),
        ((*"abcd", "unknown"), "the 4 effects above + unknown"),
    ],
)
def test_more_than_three_effects_are_not_repeated(effects, said):
    h, other = (SimpleNamespace(effects=e) for e in (effects, ("a",)))
    assert listed.short(h, [h, other]) == said


def test_two_sets_of_many_effects_are_told_apart_by_their_rows():
    own = [SimpleNamespace(effects=e) for e in (tuple("abcd"), ("a",), tuple("abcde"))]
    assert [listed.short(h, own) for h in own] == [
        "the 4 effects of row 1 above",
        "a",
        "the 5 effects of row 3 above",
    ]


def test_a_value_at_its_bound_has_a_nominal_one_that_is_at_none():
    a = SimpleNamespace(diagnosis=SimpleNamespace(campaign=SimpleNamespace(drive=DRIVE)))
    ((name, found, nominal),) = page._parameters(
        a, {"dc_link_error.sag": Estimate(0.0, 0.0, 0.1, "ohm", True)}
    )
    assert (name, nominal) == ("dc_link_error.sag", "0 Ω")
    assert found.endswith("(at the bound of the search)")
