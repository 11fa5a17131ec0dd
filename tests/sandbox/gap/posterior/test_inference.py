"""Sets near the most probable one: by whose equations each is weighed, and when ordinary deviations
alone are; numbers by hand."""

from types import SimpleNamespace

import pytest

from sandbox.gap.posterior.inference import BEHIND, _Weighing

# what the equations at a fitted set's point say of sets, log posteriors up to a constant of each
AT_NONE = {(): 0.0, ("a",): 5.0, ("b",): -1.0, ("a", "b"): 6.0}
AT_A = {(): -4.0, ("a",): 0.0, ("a", "b"): -3.0}


class Weighing(_Weighing):
    """One whose fitted sets are known beforehand: by name what their equations say, their own
    level, and by how much another one leads them."""

    def __init__(self, null=None):
        self.search, self.seen = SimpleNamespace(null=null), []

    def sets_of(self, key, e):
        """Return the equations of a fitted set."""
        return SimpleNamespace(by_name=lambda: e)

    def lead(self, one, other, variance):
        """Return the lead over a fit, which is that number here."""
        return other

    def level(self, e):
        """Return the level of the best one."""
        return 7.0

    def evaluated(self, found, variance, known=None):
        """Return the fit weighed at its own point."""
        self.seen.append(found)
        return SimpleNamespace(fit=found)


def test_a_set_that_was_not_fitted_is_weighed_from_the_nearest_one():
    """The equations of none promise a 5 and a with b 6; a was fitted and is 2 worse than none, so
    a with b is what a's own equations make of it, -2 - 3; b is one effect away from none."""
    found = Weighing().from_nearest({(): AT_NONE, ("a",): AT_A}, {(): 10.0, ("a",): 8.0}, {})
    assert found == pytest.approx({("b",): -1.0, ("a", "b"): -5.0})
    assert list(found) == sorted(found)  # no digit hangs on the seed of hashes


def test_of_two_that_are_as_near_the_more_probable_one_counts():
    """a with b is one effect away from a and from b, which is 1 better and says -0.5 of it."""
    at_b = {("b",): 0.0, ("a", "b"): -0.5}
    found = Weighing().from_nearest(
        {("a",): AT_A, ("b",): at_b}, {("a",): 8.0, ("b",): 9.0}, {(): 1.0}
    )
    assert found == pytest.approx({("a", "b"): -0.5})


@pytest.mark.parametrize(("lead", "weighed"), [(BEHIND - 1.0, True), (BEHIND + 1.0, False)])
def test_a_fit_far_behind_is_not_weighed_at_its_own_point(lead, weighed):
    """Its level is then that of the best one less its lead."""
    w, fitted, behind = Weighing(), {}, {}
    w.weigh((), lead, SimpleNamespace(fit=None), {}, fitted, behind)
    assert (() in fitted, w.seen) == (weighed, [lead] if weighed else [])
    assert behind == ({} if weighed else {(): 7.0 - lead})
