"""Effects that earlier diagnoses named with a small second one beside them: a whole diagnosis names
them alone."""

import pytest

from model.effects import library
from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.evidence.priors import of_effect
from tests.sandbox.gap.conftest import CASES, DRIVE, small_campaign

ALIKE = {
    "current_filter",
    "current_sampling",
    "pwm_delay",
    "skin_effect",
    "dead_time",
    "stator_resistance",
}
OTHERS = sorted(set(library.effect_names()) - ALIKE)
# of the first bound: the skin effect that was once held at it had 10.2 ohm, the bound was 7.1
FAR = 1.4


def first_bound():
    """Return how far the prior lets the skin effect's resistance (ohm) go before a fit widens
    it."""
    coordinates = of_effect("skin_effect", DRIVE, library.neutral(DRIVE.motor))
    return next(c.bounds()[1] for c in coordinates if c.names == ("skin_effect.resistance",))


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("current_filter.time_constant", 60e-6),
        ("pwm_delay.delay", 30e-6),
        ("skin_effect.resistance", FAR * first_bound()),
    ],
)
def test_an_effect_is_named_without_a_false_companion(name, size):
    """On the switched bench, beside its look-alikes: alone, by its size (95 % interval; of three
    that are looked at, widened by 1.22: 0.05 / 3 to both sides), with an interval that a bound does
    not cut to nothing."""
    effect = name.partition(".")[0]
    d = diagnosis_of(small_campaign({name: size}, CASES), exclude=OTHERS, workers=1)
    assert d.best.effects == (effect,)
    assert d.best.probability > 0.9
    found = d.parameters[0][name]
    assert abs(found.value - size) < 1.22 * 0.5 * (found.high - found.low)
    assert 0.0 < found.high - found.low < 0.2 * size
    assert not found.at_bound
