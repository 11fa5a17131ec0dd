"""A two-mass shaft on the switched bench: named alone, by its size, nothing unknown beside it."""

from dataclasses import replace

from sandbox.gap.diagnose import diagnosis_of
from sandbox.withheld.making.case_list import Case
from sandbox.withheld.making.draw import draw
from sandbox.withheld.making.make import campaign_of


def test_a_shaft_is_named_without_something_unknown():
    """Four free runs and two locked ones of a practice cycle, half as long as usual; every effect
    of the library is a candidate.  The bench's own stiffness and load inertia lie within the 95 %
    intervals (of two, widened by 1.15: 0.05 / 4 to either side)."""
    drawn = draw(Case(0, "one", "ipm_exchanged", "practice", ("shaft_compliance",), (2.0,)), 6)
    whole = campaign_of(drawn, 0.5)
    chosen = [r for r in whole.recordings if r.rotor == "free"] + [
        r for r in whole.recordings if r.rotor == "locked"
    ][:2]
    d = diagnosis_of(replace(whole, recordings=tuple(chosen)), workers=1)
    assert d.best.effects == ("shaft_compliance",)
    assert d.best.probability > 0.9  # the prior gives 0.15 to one effect more
    assert sum(h.probability for h in d.hypotheses if "unknown" in h.effects) < 0.05
    for name, true in drawn.sealed()["parameters"].items():
        found = d.parameters[0][name]
        assert abs(found.value - true) < 1.15 * 0.5 * (found.high - found.low), name
