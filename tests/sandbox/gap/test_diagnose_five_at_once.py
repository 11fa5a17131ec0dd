"""Five effects at once on the switched bench, whose equations are its own: named, sized, shared
out."""

import pytest

from experiments.shares_truth import gap_of
from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.report.ranking import ranking
from tests.sandbox.gap.conftest import CASES, DEAD_TIME, DRIVE, SIXTH, TURNING, small_campaign

R = DRIVE.motor.resistance
PUT_IN = {
    "dead_time": {"dead_time.time": DEAD_TIME},
    "flux_harmonics": SIXTH,
    "inductance": {"inductance.scale_d": 0.88, "inductance.scale_q": 1.09},
    "current_offset": {"current_offset.offset_b": 0.1},
    "stator_resistance": {"stator_resistance.resistance": 1.12 * R},
}
TRUE = {k: x for own in PUT_IN.values() for k, x in own.items()}


def recorded(without=""):
    """Return the campaign, the same noise in each, with one effect taken out."""
    values = {k: x for effect, own in PUT_IN.items() if effect != without for k, x in own.items()}
    return small_campaign(values, CASES + TURNING)


@pytest.fixture(scope="module")
def found():
    """The diagnosis with every effect of the library a candidate, and its list."""
    d = diagnosis_of(recorded(), workers=1)
    return d, ranking(d, position=False)


def test_all_five_are_named_and_no_other(found):
    """The list's chances above one half are those of the bench, and the residual stands at the
    noise: of 7200 samples of two independent currents (three phases, whose sum holds noise alone) J
    scatters by 1/sqrt(2 x 21600) = 0.5 %; the recordings held out are a third of them (0.8 %), and
    five deviations are allowed."""
    d, r = found
    assert set(d.best.effects) == set(PUT_IN)
    assert {e["name"] for e in r.as_json()["effects"] if e["probability"] > 0.5} == set(PUT_IN)
    assert d.size.before > 30.0
    assert d.size.after == pytest.approx(1.0, abs=0.04)


def test_their_sizes_are_those_of_the_bench(found):
    """Within the 95 % intervals; of eight that are looked at together, widened by 1.4 (0.05 / 16 to
    either side). The offset of the other phase, which the effect has too, is zero."""
    got = found[0].parameters[0]
    assert set(got) == {*TRUE, "current_offset.offset_a"}
    for name, x in got.items():
        assert abs(x.value - TRUE.get(name, 0.0)) < 1.4 * 0.5 * (x.high - x.low), name


def test_what_goes_with_an_effect_alone_is_what_goes_on_the_bench(found):
    """`share.alone` beside a bench recorded without the effect (`experiments.shares_truth`); issue
    19 asks for 0.05.

    The resistance counts as what goes beyond its ordinary deviation, which imitates a part of the
    dead time with it and without it.  It does not hold for every set: with a resistance 25 % off
    the two are 0.053 apart, and with a gain of 1.04 in one phase in the offset's place 0.24 (0.055
    stated, -0.183 on the bench), as these recordings do not tell a common scale of the gains from
    inductances and resistance.
    """
    got = {
        e["name"]: e["share"]["alone"]
        for e in found[1].as_json()["effects"]
        if e["share"] is not None
    }
    whole = gap_of(recorded())
    for effect in PUT_IN:
        assert got[effect] == pytest.approx(1.0 - gap_of(recorded(effect)) / whole, abs=0.05), (
            effect
        )
