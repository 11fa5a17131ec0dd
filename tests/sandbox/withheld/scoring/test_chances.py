"""Chances of effects one by one, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from model.effects.library import causes
from sandbox.withheld.scoring.chances import (
    calibration,
    calibration_error,
    coverage_by_effect,
    coverage_worst,
    f1,
    of_many,
)
from sandbox.withheld.scoring.judge import judge
from tests.sandbox.withheld.known import diagnosis_of, truth_of

FOUR = ("dead_time", "device_drop", "inertia", "iron_loss")


def judged(effects, chances, failed=False):
    """Return what of_many reads of a campaign."""
    return SimpleNamespace(effects=tuple(effects), chances=chances, failed=failed)


def test_f1_counts_what_is_named_above_a_half():
    """Named: three, of which two are there, of four: 2 x 2 / (3 + 4)."""
    assert f1([0.9, 0.51, 0.5, 0.8, 0.2], [1, 1, 1, 0, 1]) == pytest.approx(4.0 / 7.0)
    assert f1([0.1], [0]) == 0.0


def test_calibration_error_by_hand():
    """0.9, 0.9, 0.95 in one bin, two of three there: 2.75 - 2; 0.1 and 0.15 in another, none there:
    0.25; over five."""
    assert calibration_error([0.9, 0.9, 0.95, 0.1, 0.15], [1, 1, 0, 0, 0]) == pytest.approx(
        (0.75 + 0.25) / 5.0
    )
    assert calibration_error([1.0, 0.0], [1, 0]) == 0.0


def test_chances_that_are_right_have_no_error():
    """The binomial scatter of n cases in ten bins: sum over bins of sqrt(n/10 p (1 - p))
    sqrt(2/pi), over n."""
    rng, n = np.random.default_rng(1), 100_000
    p = rng.random(n)
    middle = (np.arange(10) + 0.5) / 10
    usual = float(np.sum(np.sqrt(n / 10 * middle * (1 - middle) * 2.0 / np.pi)) / n)
    assert calibration_error(p, rng.random(n) < p) < 2.0 * usual


def test_campaigns_of_many_effects():
    """Two campaigns: all four named and nothing else; three of four, one name too many.  Of the
    pairs of an effect that is there and one that is not, the second has the larger chance in one
    (0.3 against 0.6)."""
    all_four = judged(FOUR, dict.fromkeys(FOUR, 0.9))
    some = judged(FOUR, {**dict.fromkeys(FOUR[:3], 0.9), "iron_loss": 0.3, "inductance": 0.6})
    found = of_many([all_four, some, judged(("dead_time",), {})])
    assert found["included_f1"].value == pytest.approx((1.0 + 0.75) / 2.0)
    absent = 2 * (len(causes()) - 4)
    assert found["included_auroc"].value == pytest.approx(1.0 - 1.0 / (8 * absent))
    # 0.9 seven times, all there: 0.7; 0.3 there: 0.7; 0.6 not there: 0.6
    assert found["included_error"].value == pytest.approx((0.7 + 0.7 + 0.6) / (2 * len(causes())))
    assert of_many([judged(("dead_time",), {})])["included_f1"].n == 0


def test_chances_are_stated_or_follow_from_hypotheses():
    found = diagnosis_of((["dead_time", "inertia"], 0.7), (["dead_time"], 0.2), (["unknown"], 0.1))
    assert judge("w", truth_of(), found).chances == pytest.approx(
        {"dead_time": 0.9, "inertia": 0.7}
    )
    found["effects"] = [{"name": "dead_time", "probability": 0.85}]
    assert judge("w", truth_of(), found).chances == {"dead_time": 0.85}
    assert judge("w", truth_of(), {"failed": "no"}).chances == {}


def test_coverage_effect_by_effect():
    inside, outside = ({"dead_time.time": x} for x in (2e-6, 3e-6))
    answer = diagnosis_of((["dead_time"], 0.9))
    own = [judge(f"w{k}", truth_of(parameters=inside if k else outside), answer) for k in range(10)]
    assert own[0].parts_of == {"dead_time": (0, 1)}
    found = coverage_by_effect(own)
    assert (found["dead_time"].value, found["dead_time"].n) == (0.9, 10)
    assert coverage_worst(own).value == 0.9
    assert coverage_worst(own[1:]).value is None  # too few to be compared


def test_a_failure_covers_none_of_its_parameters():
    """Nine values inside and one of a failed diagnosis: 9 of 10."""
    inside = truth_of(parameters={"dead_time.time": 2e-6})
    own = [judge(f"w{k}", inside, diagnosis_of((["dead_time"], 0.9))) for k in range(9)]
    assert coverage_worst(own).n == 0  # too few
    own.append(judge("w9", inside, {"failed": "no"}))
    assert own[-1].parts_of == {"dead_time": (0, 1)}
    assert (coverage_worst(own).value, coverage_worst(own).n) == (0.9, 10)


def test_first_hypotheses_are_right_as_often_as_they_say():
    """Three times 0.9 and right, once 0.9 and wrong: (3.6 - 3) / 4."""
    answer = diagnosis_of((["dead_time"], 0.9), (["inertia"], 0.1))
    own = [
        judge("w", truth_of((e,)), answer)
        for e in ("dead_time", "dead_time", "dead_time", "inertia")
    ]
    assert calibration(own).value == pytest.approx(0.15)
    assert calibration([]).n == 0


def test_a_failure_is_a_name_given_for_sure_and_wrong():
    """Four right at chance 1 and four failed: (8 - 4) / 8; four failed alone: 1."""
    right = [judge("w", truth_of(), diagnosis_of((["dead_time"], 1.0)))] * 4
    failed = [judge("w", truth_of(), {"failed": "no"})] * 4
    assert calibration(right + failed).value == 0.5
    assert (calibration(failed).value, calibration(failed).n) == (1.0, 4)


def test_limits_leave_room_for_what_so_few_cases_did_not_show():
    """Four right at chance 1: 0, and up to the share 1 - 0.05^(1/4) of others, which may be wrong
    altogether."""
    right = [judge("w", truth_of(), diagnosis_of((["dead_time"], 1.0)))] * 4
    found = calibration(right)
    assert (found.value, found.low, found.n) == (0.0, 0.0, 4)
    assert found.high == pytest.approx(1.0 - 0.05**0.25)
    sure = [judged(FOUR, dict.fromkeys(FOUR, 1.0))] * 4
    listed = of_many(sure)["included_error"]
    assert (listed.value, listed.low, listed.n) == (0.0, 0.0, 4)
    assert listed.high == pytest.approx(1.0 - 0.05**0.25)


def test_a_failure_has_the_whole_list_wrong():
    """Beside a campaign of which all is right: half of the error, of F1 and of the area.  Of the
    pairs of one that is there and one that is not, a quarter is in order, and two quarters (both
    with 1, both with 0) tie."""
    found = of_many([judged(FOUR, dict.fromkeys(FOUR, 1.0)), judged(FOUR, {}, failed=True)])
    n = len(causes())
    # chance 1: four there, n - 4 not; chance 0: n - 4 not there, four there
    assert found["included_error"].value == pytest.approx(((n - 4) + 4) / (2 * n))
    assert found["included_f1"].value == 0.5
    assert found["included_auroc"].value == 0.5
