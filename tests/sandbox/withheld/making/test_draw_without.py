"""An effect taken out of a withheld drive: all else that is drawn, and all that its engineer
states, stays the same."""

import dataclasses

import pytest

from sandbox.withheld.making.case_list import Case, cases
from sandbox.withheld.making.draw import draw
from sandbox.withheld.making.drives import UNCERTAINTY

SEED = 11
SAME = ("stated", "bench", "sign", "drift", "theta", "seed", "off")


@pytest.mark.parametrize("table", ["ladder", "published"])
def test_what_is_left_is_as_it_was(table):
    for case in cases(6, SEED, "many", "scored", table=table):
        whole = draw(case, SEED)
        for k, name in enumerate(case.names):
            out = draw(case, SEED, (name,))
            assert [getattr(out, x) for x in SAME] == [getattr(whole, x) for x in SAME]
            assert out.true.converter == whole.true.converter
            assert out.case.names == (*case.names[:k], *case.names[k + 1 :])
            assert out.sizes == (*whole.sizes[:k], *whole.sizes[k + 1 :])
            moved = {key for key in whole.plant if out.plant.get(key) != whole.plant[key]}
            assert all(key.startswith(f"{name}.") for key in moved)
            a, b = (dataclasses.asdict(x.true.motor) for x in (whole, out))
            changed = {key for key in a if a[key] != b[key]}
            assert bool(moved) != bool(changed)  # an effect is the plant's or the motor's


def test_with_all_effects_out_the_engineer_is_off_by_ordinary_deviations_alone():
    """What is stated is the truth times 1 + (stated standard deviation) x (how many of them it is
    off)."""
    case = Case(
        0,
        "many",
        "ipm",
        "scored",
        ("stator_resistance", "saturation", "dead_time"),
        (2.0, 2.0, 2.0),
    )
    whole, out = draw(case, SEED), draw(case, SEED, case.names)
    assert out.case.names == ()
    for name, deviation in UNCERTAINTY.items():
        stated = getattr(out.true.motor, name) * (1.0 + deviation * out.off[name])
        assert getattr(out.stated, name) == pytest.approx(stated, rel=1e-12)
    for name in ("resistance", "alpha_04"):
        assert getattr(whole.true.motor, name) != pytest.approx(
            getattr(out.true.motor, name), rel=0.01
        )
    assert out.plant["dead_time.time"] == pytest.approx(out.bench.dead_time, rel=1e-12)
