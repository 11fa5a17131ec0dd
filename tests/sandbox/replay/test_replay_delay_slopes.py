"""Slopes of the two delays: a reading taken just beside a sample is that sample's, with every
effect of the library.

Differences over 3e-9 s show any jump between what a period ends with and the next begins with: 1e-6
A there is 300 A/s. Expected are differences over long steps, extrapolated (Richardson), which a
jump moves by a seventh as much.
"""

import numpy as np
import pytest

from model.effects import library
from sandbox.replay.replay import replay
from tests.sandbox.plant.stated_duties import DRIVE, duties, from_duties, turning

# s; longer ones meet corners: a current reaches the width of its sign, a reading an edge
SHORT, LONG = 3e-9, 2e-8
# of the slope's rms: a filter's curvature leaves 0.001 over LONG, before extrapolation
CLOSE = 0.01
EFFECTS = [n for n in library.effect_names() if library.load_effect(n).subsystem != "mechanics"]
ALL = [n for n in EFFECTS if n not in ("cross_saturation", "pwm_delay", "current_sampling")]


@pytest.mark.parametrize("delay", ["pwm_delay.delay", "current_sampling.delay"])
@pytest.mark.parametrize("names", [*([n] for n in EFFECTS), ALL], ids=[*EFFECTS, "all"])
def test_slope_of_a_delay_is_the_same_over_short_and_long_steps(names, delay):
    base = {"dead_time.time": 6.5e-7}
    for name in names:
        own = library.typical(name, DRIVE.motor, DRIVE.converter)
        base |= {k: v for k, v in own.items() if not k.endswith("jitter")}
    prepared = from_duties(DRIVE, duties(200), *turning(200))
    steps = (SHORT, LONG, 2.0 * LONG)
    currents = replay(
        prepared, [base, *({**base, delay: base.get(delay, 0.0) + h} for h in steps)]
    ).currents[0]
    short, long, longer = (
        (currents[10:, :, k + 1] - currents[10:, :, 0]) / h for k, h in enumerate(steps)
    )
    expected = 2.0 * long - longer
    assert np.sqrt(np.mean((short - expected) ** 2)) < CLOSE * np.sqrt(np.mean(expected**2))
