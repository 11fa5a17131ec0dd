"""Where one method does better than another, counted by hand, the chance of it in closed form."""

import pytest

from experiments.withheld_wins import split, worth
from sandbox.withheld.scoring.judge import judge
from tests.sandbox.withheld.known import diagnosis_of, truth_of

RIGHT, WRONG = diagnosis_of((["dead_time"], 0.9)), diagnosis_of((["iron_loss"], 0.9))
FOUR = ("dead_time", "inertia", "iron_loss", "skin_effect")


def answered(answers):
    """Return judgements of campaigns a, b, ... whose cause is a dead time."""
    return [judge("abcdefgh"[k], truth_of(), d) for k, d in enumerate(answers)]


def test_campaigns_are_counted_where_one_is_right_and_the_other_wrong():
    """Five of six that differ go to one side: by chance 2 (6 + 1) / 2^6."""
    own = answered([RIGHT] * 5 + [WRONG, RIGHT, WRONG])
    other = answered([WRONG] * 5 + [RIGHT, RIGHT, WRONG])
    found = split(own, other)
    assert (found.own, found.other, found.alike) == (tuple("abcde"), ("f",), 2)
    assert found.chance == pytest.approx(2 * 7 / 64, rel=1e-12)
    assert split(own, own) == ((), (), 8, 1.0)
    assert split(own, other[5:]) == ((), ("f",), 2, 1.0)  # those that both have answered


def test_of_many_effects_the_chances_above_a_half_count():
    """Two of four named, one that is not there: F1 = 2 2 / (3 + 4); what is named with less does
    not count."""
    answer = diagnosis_of((["dead_time", "inertia", "device_drop"], 0.6), (["iron_loss"], 0.4))
    j = judge("w", truth_of(FOUR, "many", (1.0,) * 4, {}), answer)
    assert worth(j) == pytest.approx(4 / 7, rel=1e-12)
    assert worth(judge("w", truth_of(FOUR, "many", (1.0,) * 4, {}), {"failed": "no"})) == 0.0
    whole = judge("w", truth_of(FOUR, "many", (1.0,) * 4, {}), diagnosis_of((list(FOUR), 0.9)))
    assert split([j], [whole])[:3] == ((), ("w",), 0)


def test_a_cause_outside_is_right_where_it_is_called_unknown():
    truth = truth_of(("unknown",), "outside", (1.0,), {})
    assert worth(judge("w", truth, diagnosis_of((["unknown"], 0.9)))) == 1.0
    assert worth(judge("w", truth, RIGHT)) == 0.0
