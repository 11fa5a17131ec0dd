"""The badge and the answer to "which": what `unknown` is called, and that both and the next step
agree."""

from types import SimpleNamespace

import pytest

from model.effects.library import effect_names, neutral
from sandbox.gap.diagnose import Diagnosis, verdict
from sandbox.gap.location.outside import OddPhase
from sandbox.gap.pages import listed
from sandbox.gap.planning.todo import todo
from sandbox.gap.posterior.estimates import Estimate
from sandbox.gap.report import answers
from sandbox.gap.report.position_moved import Moved
from sandbox.gap.report.which import badge, doubtful, which_text
from sandbox.gap.unstated.drifting import Drifting
from sandbox.gap.words import tenths
from sandbox.output.sentences import VERDICTS
from sandbox.recordings.campaign import Made
from tests.sandbox.gap.conftest import DRIVE


def diagnosis(*found, closed=0.5):
    """A diagnosis of these (effects, probability)."""
    hypotheses = [
        SimpleNamespace(effects=e, probability=p, evaluated=SimpleNamespace(effects=A))
        for e, p in found
    ]
    own = SimpleNamespace(
        hypotheses=hypotheses,
        best=hypotheses[0],
        size=SimpleNamespace(closed=closed),
        out_of_sight=(),
        drifting=None,
        parameters=[{}],
        evaluated=(),
        campaign=SimpleNamespace(limits=None, recordings=()),
    )
    own.ambiguity_set = Diagnosis.ambiguity_set.fget(own)
    return own


U, A, AU = ("unknown",), ("dead_time",), ("dead_time", "unknown")


@pytest.mark.parametrize(
    ("told", "closed", "expected"),
    [
        ([(U, 0.97)], None, "unknown"),
        # more likely than not; the sentence says that it may be A
        ([(U, 0.51), (A, 0.49)], 0.5, "unknown"),
        # less than half: not "not in the library"
        ([(U, 0.45), (A, 0.30), ((), 0.25)], 0.5, "ambiguous"),
        ([(U, 0.40), (AU, 0.15), (A, 0.45)], 0.5, "ambiguous"),  # the most probable is A alone
        ([(U, 0.46), (AU, 0.10), (A, 0.44)], 0.98, "unknown"),  # 0.56 in all
        ([(U, 0.90), ((), 0.10)], 0.5, "unknown"),  # no likely hypothesis names an effect
        ([(U, 0.97)], 0.991, "unknown"),
        ([(U, 0.97)], 0.989, "unknown"),
        ([(AU, 0.9), (A, 0.1)], 0.999, "unknown"),
        ([(AU, 0.45), (A, 0.40), ((), 0.15)], 0.9, "ambiguous"),
        ([(A, 0.97)], 0.999, "explained"),
        ([((), 0.97)], None, "no_gap"),
    ],
)
def test_not_in_the_library_is_said_only_where_it_is(told, closed, expected):
    told.sort(key=lambda x: -x[1])
    d = diagnosis(*told, closed=closed)
    assert badge(d) == expected
    assert expected in VERDICTS
    assert badge(d) == verdict(d)  # one word for one thing
    if expected != "unknown":
        assert "None in the library" not in which_text(d)


def test_the_answer_agrees_with_what_is_recommended():
    """Kept row of a blind check: `unknown` alone, or beside a ripple of the link and dead time."""
    d = diagnosis((U, 0.88), (("dc_link_ripple", "dead_time", "unknown"), 0.10), closed=0.4)
    said = which_text(d)
    assert badge(d) == "unknown"
    assert said.startswith(
        "None for sure: that something outside the library is at work is 98 % probable."
    )
    assert said.endswith(
        "Perhaps DC link ripple + dead time with something outside the library (10 %)."
    )
    a = SimpleNamespace(diagnosis=d, following=None, verdict="unknown", odd_phase=None)
    assert answers.next_text(a).startswith("Recordings that show more, for DC link ripple:")
    alone = diagnosis((U, 0.98))
    assert badge(alone) == "unknown"
    assert which_text(alone).startswith("None in the library")
    assert answers.next_text(
        SimpleNamespace(diagnosis=alone, following=None, verdict="unknown", odd_phase=None)
    ) == ("No effect is known that a recording could confirm.")


def test_what_closes_nearly_all_is_told():
    assert which_text(diagnosis((U, 0.97), closed=0.991)) == (
        "None for sure: that something outside the library is at work is 97 % probable, although "
        "with dead time 99.1 % of the gap closes."
    )


def test_less_than_half_is_told_as_an_ambiguity():
    said = which_text(diagnosis((U, 0.40), (A, 0.35), ((), 0.25)))
    assert said == (
        "These recordings cannot tell apart: something outside the library (40 %); or dead time "
        "(35 %); or no effect (25 %)."
    )


MANY = ("current_filter", "dead_time", "device_drop", "stator_resistance")


def test_many_effects_are_listed_by_their_share_and_not_by_sixteen_numbers():
    shares = {
        "stator_resistance": 0.495,
        "dead_time": 0.281,
        "device_drop": 0.265,
        "current_filter": -0.041,
    }
    assert which_text(diagnosis((MANY, 0.964)), shares) == (
        "4 effects at once, 96 % probable. By their share of the gap: stator resistance "
        "(49.5 %), dead time (28.1 %), "
        "device drop (26.5 %), current filter (-4.1 %). Their sizes stand below."
    )
    assert "device drop (26.5 %); with hardly any: current filter. Their" in which_text(
        diagnosis((MANY, 0.964)), {**shares, "current_filter": -0.0049}
    )


def test_three_effects_are_told_with_their_numbers():
    assert which_text(diagnosis((MANY[:3], 0.97))) == (
        "Current filter + dead time + device drop, 97 % probable: no parameter."
    )
    two = which_text(diagnosis((MANY[:3], 0.6), (MANY[:2], 0.4)))
    assert two.startswith(
        "These recordings cannot tell apart: current filter + dead time + device drop (60 %); or"
    )


def test_a_few_effects_stand_in_the_order_of_their_share():
    shares = {"current_filter": 0.1, "dead_time": 0.3, "device_drop": 0.6}
    assert which_text(diagnosis((MANY[:3], 0.97)), shares).startswith(
        "Device drop (60.0 % of the gap) + dead time (30.0 % of the gap) + current "
        "filter (10.0 % of the gap), 97 %"
    )


def test_shares_stand_beside_something_outside_too():
    """In the order of their share, with it; one effect's, too, as the rest of the gap is
    nobody's."""
    both, shares = (
        ("current_gain", "iron_loss", "unknown"),
        {"current_gain": 0.021, "iron_loss": 0.197},
    )
    assert which_text(diagnosis((both, 0.99)), shares).endswith(
        "of it: iron loss (19.7 % of the gap) + current gain (2.1 % of the gap)."
    )
    assert which_text(diagnosis((AU, 0.99)), {"dead_time": 0.4}).endswith(
        "of it: dead time (40.0 % of the gap)."
    )
    found = which_text(
        diagnosis((MANY[:3], 0.5), (MANY[1:], 0.5)), {"device_drop": 0.6, "dead_time": 0.3}
    )
    assert found == (
        "These recordings cannot tell apart: device drop + dead time + current filter (50 %; of "
        "the gap 60.0 % and 30.0 %); or dead time + device drop + stator resistance (50 %)."
    )
    rivals = {MANY[1:]: {"stator_resistance": 0.7, "device_drop": 0.2, "dead_time": 0.1}}
    found = which_text(
        diagnosis((MANY[:3], 0.5), (MANY[1:], 0.4), (U, 0.1)), {"device_drop": 0.6}, {}, rivals
    )
    assert (
        "or stator resistance + device drop + dead time (40 %; of the gap 70.0 %, 20.0 %" in found
    )
    assert found.endswith("and 10.0 %); or something outside the library (10 %).")
    assert which_text(diagnosis((A, 0.97)), {"dead_time": 0.7}).startswith(
        "Dead time (70.0 % of the gap), 97 % probable:"
    )


def test_effects_of_every_likely_set_are_told_as_sure():
    two = ("dead_time", "magnet_flux")
    d = diagnosis((two, 0.945), ((*two, "unknown"), 0.055))
    assert which_text(d, {"dead_time": 0.172, "magnet_flux": 0.828}) == (
        "Magnet flux (82.8 % of the gap) + dead time (17.2 % of the gap) are in every likely set. "
        "Not sure beside them: something outside the library (6 %)."
    )
    a = SimpleNamespace(
        diagnosis=d,
        following=None,
        verdict="ambiguous",
        odd_phase=None,
        shares={"magnet_flux": 0.8},
    )
    assert answers.next_text(a).startswith("Nothing is needed to name magnet flux and dead time.")
    alone = which_text(diagnosis((A, 0.9), (AU, 0.1)), {"dead_time": 0.9})
    assert alone.startswith("Dead time (90.0 % of the gap) is in every likely set. Not sure")


def test_an_odd_phase_outside_leads_to_exchanging_sensors():
    """Not to recordings for effects of a few per cent; where nothing is outside, the effect's own
    recording."""
    both = ("current_gain", "iron_loss", "unknown")
    a = SimpleNamespace(
        diagnosis=diagnosis((both, 0.99)),
        following=None,
        verdict="unknown",
        odd_phase=OddPhase("a", 5.0),
        shares={},
    )
    found = answers.next_text(a)
    assert found.startswith("Exchange the current sensors of phases a and b, ")
    assert "record again" in found
    assert "iron loss" not in found
    assert OddPhase("b", None).exchange.startswith(
        "Exchange the current sensors of phases b and a,"
    )
    a.diagnosis = diagnosis((A, 0.9), (("iron_loss",), 0.1))
    a.verdict = "ambiguous"
    assert "Exchange" not in answers.next_text(a)


def test_an_angle_that_was_made_may_be_what_is_outside():
    d = diagnosis((U, 0.99))
    d.campaign.recordings = [SimpleNamespace(made=Made("'hall'", 0.1)), SimpleNamespace(made=None)]
    a = SimpleNamespace(
        diagnosis=d, following=None, verdict="unknown", odd_phase=OddPhase("a", 5.0), shares={}
    )
    assert answers.next_text(a).startswith(
        "Log the rotor's angle: what one made from 'hall' misses counts as"
    )
    a.diagnosis.hypotheses = diagnosis((A, 0.9), (U, 0.1)).hypotheses
    assert "Log the rotor" not in answers.next_text(a)


def ranked(parameters, shares=None):
    """A list of effects that are all there, with these values."""
    own = {e: {k: Estimate(v, v, v, "") for k, v in of.items()} for e, of in parameters.items()}
    of = {e: SimpleNamespace(value=x) for e, x in (shares or {}).items()}
    chances = dict.fromkeys(parameters, 0.9)
    return SimpleNamespace(
        parameters=own,
        inclusion=SimpleNamespace(chances=chances),
        shares=SimpleNamespace(of=of),
        by_recording={},
    )


def test_each_named_effect_says_what_to_do():
    """The largest share first; an effect that only some likely sets hold behind an "if"; sizes in a
    user's units."""
    both = ("dead_time", "stator_resistance")
    d = diagnosis((both, 0.97))
    d.campaign.drive = DRIVE
    values = {
        "dead_time": {"dead_time.time": 2e-6},
        "stator_resistance": {"stator_resistance.resistance": 1.15 * DRIVE.motor.resistance},
    }
    r = ranked(values, {"dead_time": 0.2, "stator_resistance": 0.8})
    first, second = todo(d, r)
    assert first.startswith("Stator resistance: R +15 %: winding 38 K warmer")
    assert second.startswith("Dead time: set the dead-time compensation to 2.0 µs")
    assert second.endswith(".")
    assert todo(diagnosis(((), 0.97)), r) == []
    one = diagnosis((both, 0.6), (("dead_time",), 0.4))
    one.campaign.drive = DRIVE
    assert [t.partition(":")[0] for t in todo(one, r)] == [
        "If it is stator resistance",
        "Dead time",
    ]
    # where something outside most probably is at work, what may only imitate it has no "if"
    loose = diagnosis((("dead_time", "unknown"), 0.6), ((*both, "unknown"), 0.4))
    loose.campaign.drive = DRIVE
    (only,) = todo(loose, r)
    assert "dead time: set" in only
    out = diagnosis((AU, 0.97))
    out.campaign.drive = DRIVE
    (found,) = todo(out, r)
    assert found.startswith(
        "Find first what is outside the library: it may bend these sizes. Then, dead time: set"
    )


def test_dozens_of_sets_are_no_sentence():
    """A sensor's memory left 24 sets likely: each was told, with what to do about 26 effects."""
    others = [e for e in effect_names() if e != "dead_time"][:24]
    d = diagnosis(*((("dead_time", e), 0.95 / 24) for e in others))
    d.campaign.drive = DRIVE
    chances = dict.fromkeys(others, 0.95 / 24)
    said = which_text(d, {"dead_time": 1.0}, chances)
    assert said.count("(4 %") == 5
    assert "; or 19 more sets (75 % together)." in said
    own = {k: p for k, p in neutral(DRIVE.motor).items() if not k.startswith("dead_time.")}
    values = {e: {k: v for k, v in own.items() if k.startswith(f"{e}.")} for e in others}
    r = ranked({"dead_time": {"dead_time.time": 2e-6}, **values})
    assert sum(t.startswith("If it is") for t in todo(d, r)) <= 3
    assert doubtful(d) == sorted(others)


@pytest.mark.parametrize(
    ("uncertainty", "background", "said"),
    [
        ({}, {}, "what usually deviates (the campaign states no [uncertainty] or [background])"),
        ({"resistance": 0.1}, {}, "what [uncertainty] allows"),
        ({"resistance": 0.1}, {"dead_time": 1e-7}, "what [uncertainty] and [background] allow"),
    ],
)
def test_what_nobody_allowed_is_not_quoted(uncertainty, background, said):
    campaign = SimpleNamespace(uncertainty=uncertainty, background=background)
    assert answers.allowed_text(campaign) == said


def test_half_a_percent_of_the_gap_is_told():
    shares = {
        "stator_resistance": 0.5,
        "dead_time": 0.3,
        "device_drop": 0.194,
        "current_filter": 0.006,
    }
    assert "device drop (19.4 %), current filter (0.6 %). Their" in which_text(
        diagnosis((MANY, 0.97)), shares
    )


def test_what_many_effects_have_in_common_is_sure():
    """Three of four are in both sets; the fourth is there or not."""
    shares = {"stator_resistance": 0.5, "dead_time": 0.3, "device_drop": 0.2}
    rest = tuple(e for e in MANY if e != "current_filter")
    found = ((MANY, 0.55), (rest, 0.41), ((*rest, "unknown"), 0.04))
    assert which_text(diagnosis(*found), shares) == (
        "3 effects are in every likely set. By their share of the gap: stator resistance (50.0 "
        "%), dead time (30.0 %), device drop (20.0 %). Their sizes stand below. Not sure beside "
        "them: current filter (55 %)."
    )


def test_chances_in_the_sentence_are_those_of_the_list():
    """Beside a free regression an effect may be less sure than the hypotheses that hold it."""
    rest = tuple(e for e in MANY if e != "current_filter")
    said = which_text(
        diagnosis((MANY, 0.55), (rest, 0.41), ((*rest, "unknown"), 0.04)),
        {},
        {"current_filter": 0.3},
    )
    assert "Not sure beside them: current filter (30 %)." in said


def test_rows_of_many_effects_are_told_by_their_difference_from_the_first():
    first, rest, few = (
        SimpleNamespace(effects=e) for e in (MANY, (*MANY[1:], "inertia", "unknown"), MANY[:3])
    )
    assert (
        listed.against_first(rest, first)
        == "as row 1, with inertia and unknown, without current filter"
    )
    assert (
        listed.against_first(first, first)
        == "current filter + dead time + device drop + stator resistance"
    )
    assert listed.against_first(few, first) == "current filter + dead time + device drop"


def test_many_effects_without_shares_are_all_named():
    assert which_text(diagnosis((MANY, 0.97))) == (
        "4 effects at once, 97 % probable. They are: current filter, dead time, device drop, "
        "stator resistance. Their sizes stand below."
    )


@pytest.mark.parametrize(
    ("chance", "said"), [(0.62, "skin effect (62 %)"), (0.84, "skin effect (84 %)"), (0.87, "")]
)
def test_an_effect_less_sure_than_its_set_is_explained(chance, said):
    d = diagnosis((("dead_time", "skin_effect"), 0.96), (("dead_time",), 0.04))
    inclusion = SimpleNamespace(chances={"dead_time": 1.0, "skin_effect": chance, "inertia": 0.02})
    found = listed.less_sure_sentence(
        SimpleNamespace(diagnosis=d, ranking=SimpleNamespace(inclusion=inclusion, open_part=None))
    )
    assert found.rpartition(": ")[2].rstrip(".") == said
    assert listed.less_sure_sentence(SimpleNamespace(diagnosis=d, ranking=None)) == ""


def test_nothing_has_no_sign():
    """A share of -0.0002 is none to a tenth of a percent, and so is a move of -0.001 degrees to a
    hundredth."""
    assert (tenths(-0.0002), tenths(-0.0007), tenths(0.0)) == ("0.0 %", "-0.1 %", "0.0 %")
    assert listed.moved_text(Moved(-0.001, 0.004)) == "+0.00\u00b0 (+0.00\u00b0)"


@pytest.mark.parametrize(("unknown", "told"), [(0.48, True), (0.06, True), (0.04, False)])
def test_no_gap_says_how_probable_something_else_is(unknown, told):
    said = which_text(diagnosis(((), 1.0 - unknown), (U, unknown)))
    assert said.startswith("None: ordinary deviations alone are")
    assert (f"Something outside the library is {100 * unknown:.0f} % probable." in said) == told


def test_offsets_that_differ_by_recording_are_named_first():
    """What was taken off is told beside "None" where it is no more than ordinary, which an effect's
    own sentence tells: sensor a, -12 and 12 mA."""
    drifts = Drifting(
        {"rs1": (-0.012, 0.0, 0.0), "rs2": (0.012, 0.0, 0.0)}, {"rs1": 5e-5, "rs2": 5e-5}
    )
    none = diagnosis(((), 0.96), (A, 0.04))
    alone = which_text(none)
    none.drifting, none.offsets_named = drifts, False
    said = which_text(none)
    assert said.startswith("Current offset, another in each recording (sensor a reads −12")
    assert said.endswith(f"was taken off first. What else? {alone}")
