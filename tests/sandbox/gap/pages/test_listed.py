"""Numbers of what a person sees of a diagnosis: what is listed and said, by hand.  The whole
page, of a real diagnosis: test_report."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

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
        with_regression=False,
        unexplained=Unexplained(0.125, (0.0625, 0.25)),
        where=None,
        tellings={},
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


@pytest.mark.parametrize(("fall", "said"), [(2.9, "Flat"), (3.1, "It falls by 3 on")])
def test_a_likelihood_is_flat_up_to_a_fall_of_three(fall, said):
    x = Alike(("inertia",), (), {"inertia": 0.5}, (0.0, 0.5, 1.0), (-1.0, -1.0 - fall, -1.5))
    found = list(page.why_alike(x))
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
    assert page.way_text(x).startswith(said)


def test_an_end_that_cannot_be_simulated_prefers_nothing():
    x = Alike(("inertia",), (), {"inertia": 0.5}, (0.0, 0.5), (-9.0, 0.0))
    assert page.way_text(x) == "It falls by 9 where a drive can be simulated; at one end none can."


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


def test_charts_are_of_the_parts_that_sentences_speak_of():
    """Two subsystems: the sensors' chart has what is constant in a phase, the inverter's the
    voltage's direction; of one alone, its own."""
    parts = [
        SimpleNamespace(subsystem="inverter", share=0.7, left=apart(), of_readings=False),
        SimpleNamespace(subsystem="sensor", share=0.3, left=apart(), of_readings=True),
    ]
    first, second = "".join(charts.of_parts(parts, None, apart())).split("<details>")
    for wanted in (" part, 70&nbsp;% of the gap", "on the d axis", "at standstill"):
        assert wanted in first
    for wanted in (" part, 30&nbsp;% of the gap", *(f"constant in phase {p}" for p in "abc")):
        assert wanted in second
    assert "on the d axis" not in second
    assert "constant in phase" in "".join(charts.of_parts(parts[1:], None, apart()))
    assert "on the d axis" in "".join(charts.of_parts([], apart(), apart()))


def test_the_worst_stretch_by_hand():
    residual = np.array(
        [[1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, -3.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    )
    assert signals.worst_stretch(residual, 2) == (2, 4)  # 9 + 16; 9 + 9 before
    assert signals.worst_stretch(residual, 9) == (0, 5)
    assert signals.worst_stretch(np.sqrt(np.array([[1.9, 0.0, 0.0], [1.5, 0.0, 0.0]])), 1) == (0, 1)


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
    assert (page.share_text(0.99996), page.share_text(1.2), page.share_text(None)) == (
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
    ((name, found, nominal),) = page.parameter_rows(
        a, {"dc_link_error.sag": Estimate(0.0, 0.0, 0.1, "ohm", True)}
    )
    assert (name, nominal) == ("dc_link_error.sag", "0 Ω")
    assert found.endswith("(at the bound of the search)")
