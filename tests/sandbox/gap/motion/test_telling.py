"""What a judged motion says: the shaft's own values with intervals, shares in the sentence, a
linear axis in its own units."""

import dataclasses

import pytest

from model.errors import BadInput
from sandbox.gap.motion.judging import judge
from sandbox.gap.motion.telling import document, page, sentences
from sandbox.output.sentences import VERDICTS, capital
from sandbox.public.campaigns.moved import MotionResult
from sandbox.recordings.motion_axis import LINEAR, ROTARY, axis_of, shafts_keys
from tests.sandbox.gap.motion.shafts import INERTIA, both_ways, campaign, shaft

OFFSET = -2e-3  # N m, of the recorded torque


@pytest.fixture(scope="module")
def judged():
    run = shaft(3, both_ways, dry=0.008, viscous=6e-4)
    return judge(campaign(dataclasses.replace(run, torque=run.torque + OFFSET)))


def said(motion):
    return {question: text for question, text in sentences(motion) if question != "Do?"}


def test_the_shaft_s_own_values_are_told_with_intervals(judged):
    """Planted; the recorded torque lacks 2 mN m that act."""
    own = document(judged)["motion"]
    for name, true in (("inertia", INERTIA), ("viscous_friction", 6e-4), ("offset", -OFFSET)):
        low, high = own[name]["ci95"]
        assert low < own[name]["value"] < high
        assert own[name]["value"] == pytest.approx(true, abs=2.0 * (high - low)), name
    text = said(judged)["Motor?"]
    assert "kg m^2 [" in text
    assert text.endswith("values are those of a rotating shaft.")


def test_effects_stand_by_their_share_which_is_told(judged):
    found = document(judged)
    shares = [e["share"]["value"] for e in found["effects"]]
    assert shares == sorted(shares, reverse=True)
    first = found["effects"][0]
    name = first["name"].replace("_", " ")
    whole = round(100.0 * first["share"]["value"])
    assert said(judged)["Which?"].startswith(f"{capital(name)} ({whole} % of the gap)")


def test_an_effect_without_a_share_says_why_it_is_named():
    """An inertia that was fitted 20 % off the stated one: what is called the gap has it refitted,
    so its share is none, and no "0 %" stands beside a probability."""
    run = shaft(3, both_ways, dry=0.008, viscous=6e-4)
    motion = judge(dataclasses.replace(campaign(run), inertia=1.2 * INERTIA))
    assert "inertia" in motion.best.effects
    assert abs(motion.shares["inertia"]) < 0.01
    which = said(motion)["Which?"]
    assert "inertia (−20 % from the stated value; the gap is counted after stated values" in which
    assert "(0 % of the gap)" not in which + said(motion)["Where?"]
    assert all(row["share"] >= 0.01 for row in document(motion)["where"])


def test_a_linear_axis_is_told_in_its_units(judged):
    motion = dataclasses.replace(judged, campaign=dataclasses.replace(judged.campaign, axis=LINEAR))
    assert document(motion)["motion"]["axis"] == "linear"
    assert document(motion)["motion"]["inertia"]["unit"] == "kg"
    texts = " ".join(text for _, text in sentences(motion))
    assert " kg [" in texts
    assert "values are those of a linear axis" in texts
    for word in ("torque", "inertia", "N m", "rad", "rpm"):
        assert word not in texts.replace("cogging torque", ""), word


def test_every_answer_is_a_whole_sentence(judged):
    for question, text in sentences(judged):
        assert text[0] == text[0].upper(), question
        assert text.endswith("."), question


@pytest.mark.parametrize("word", VERDICTS)
def test_one_verdict_word_on_page_terminal_and_json(judged, word, capsys):
    """Planted hypotheses that make each verdict there is."""
    kinds = {
        "no_gap": ((), 0.97, 0.0),
        "explained": (("inertia",), 0.97, 0.0),
        "ambiguous": (("inertia",), 0.6, 0.0),
        "unknown": (("inertia",), 0.97, 0.9),
    }
    effects, chance, unknown = kinds[word]
    best = dataclasses.replace(judged.weighed[0], effects=effects, probability=chance)
    other = dataclasses.replace(best, effects=("viscous_friction",), probability=1.0 - chance)
    motion = dataclasses.replace(judged, weighed=(best, other), unknown=unknown)
    result = MotionResult(motion)
    result.report()
    assert f"motion only: {VERDICTS[word].lower()}\n" in capsys.readouterr().out
    assert result.verdict == result.as_json()["verdict"] == word
    assert f"motion only, {word}:" in result.summary()
    assert f"<span class='badge {word}'>{VERDICTS[word]}</span>" in next(page(motion, "x", ""))


@pytest.mark.parametrize(
    ("stated", "words"),
    [({}, "5 % is usual"), ({"inertia": 0.08}, "(8 % stated)")],
)
def test_an_ambiguous_verdict_says_what_is_open(judged, stated, words):
    """An inertia that half the hypotheses hold: by how much it differs from the stated one, and
    from what it could be otherwise; on page, terminal and in JSON alike, where it is ambiguous."""
    best = dataclasses.replace(judged.weighed[0], effects=("coulomb_friction", "inertia"))
    sets = (
        dataclasses.replace(best, probability=0.7),
        dataclasses.replace(best, effects=("coulomb_friction",), probability=0.3),
    )
    own = dataclasses.replace(
        judged.campaign,
        inertia=best.shaft.value("inertia") / 0.86,  # so it is 14 % below the stated one
        deviations=stated,
    )
    motion = dataclasses.replace(judged, campaign=own, weighed=sets, unknown=0.02)
    told = document(motion)
    assert told["verdict"] == "ambiguous"
    assert list(told["motion"]["undecided"]) == ["inertia"]
    text = told["motion"]["undecided"]["inertia"]
    assert text.startswith("70 % probable as an effect; −14 % from the stated value")
    assert words in text
    assert text in said(motion)["Ambiguous?"]
    assert "<b>Ambiguous?</b>Inertia: 70" in "".join(page(motion, "x", ""))
    sure = dataclasses.replace(motion, weighed=(dataclasses.replace(best, probability=0.99),))
    assert document(sure)["motion"]["undecided"] == {}
    assert "Ambiguous?" not in said(sure)


def test_what_makes_an_axis_linear():
    assert axis_of({"inertia": 1.0}, "x") is ROTARY
    for motor in ({"axis": "linear"}, {"mass": 90.0}, {"force_constant": 30.0}):
        assert axis_of(motor, "x") is LINEAR
    assert shafts_keys({"mass": 90.0}) == {"inertia": 90.0}
    with pytest.raises(BadInput, match="inertia is no value of a linear axis; give mass"):
        axis_of({"axis": "linear", "inertia": 1.0}, "x")
    with pytest.raises(
        BadInput, match="unknown axis of \\[motor\\] 'liner'; did you mean 'linear'"
    ):
        axis_of({"axis": "liner"}, "x")
