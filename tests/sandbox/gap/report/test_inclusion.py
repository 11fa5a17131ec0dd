"""Chances of effects as sums over sets, and groups of effects that stand for each other."""

import pytest

from sandbox.gap.report.inclusion import summed


def test_a_chance_is_the_sum_over_the_sets_that_hold_it():
    """Weights that sum to 2: chances are shares of them, the likeliest first."""
    found = summed({("a",): 1.0, ("a", "b"): 0.6, (): 0.4}, ["b", "a", "c"])
    assert found.chances == {"a": pytest.approx(0.8), "b": pytest.approx(0.3), "c": 0.0}
    assert list(found.chances) == ["a", "b", "c"]
    assert found.most_probable("b") == ("a", "b")
    assert found.most_probable("c") is None


def test_effects_of_which_one_is_surely_there_are_a_group():
    found = summed({("a",): 0.6, ("b",): 0.36, (): 0.04}, ["a", "b"])
    assert found.groups == ((("a", "b"), pytest.approx(0.96)),)
    assert found.group_of("b") == ("a", "b")


@pytest.mark.parametrize(
    "sets",
    [
        {("a",): 0.45, ("b",): 0.43, (): 0.12},  # perhaps none of them is there
        {("a",): 0.4, ("b",): 0.3, ("a", "b"): 0.3},  # often both: neither stands for the other
        {(e,): 0.2 for e in "abcde"},  # five are no question that one recording answers
        {("a",): 0.96, ("b",): 0.04},  # b is hardly there
    ],
)
def test_what_is_no_group(sets):
    assert summed(sets, list("abcde")).groups == ()


def test_sets_of_another_count_by_their_share():
    found = summed({("a",): 1.0}, ["a"]).mixed(summed({(): 1.0}, ["a"]), 0.25)
    assert found.chances == {"a": pytest.approx(0.75)}
