"""Pulses and gaps shorter than dead time, legs always on or off, edges that wait: the kernel beside
the reference.

Bounds come from the kernel alone.  Its error with 64 steps a period is a third of what 16 steps
differ from them if it falls in proportion to the step, a fifteenth if with the square.  An edge
that is lost or acts where it should not is in both, so that it stands above the third: a pulse of 2
us on one leg is 3500 ppm.  LEFT is the
reference's own: an integrator's 1e-10 at some ten events a period.
"""

import numpy as np
import pytest

from sandbox.replay.replay import replay
from tests.sandbox.plant.stated_duties import (
    DRIVE,
    apart,
    duties,
    finer,
    from_duties,
    reference,
    turning,
)

N, LEFT = 16, 3e-9  # periods; of rated current
PERIOD = DRIVE.converter.sampling_period
# edges of three legs within a tenth of a microsecond
SMALL = 0.5 + 0.002 * (duties(N, 20.0, 0.02) - 0.5)
BLANK = {"dead_time.time": 4e-6, "bench.soft_current": 0.6}
LONG = {**BLANK, "dead_time.time": 2e-5}
IRON, FILTER = {"iron_loss.core_resistance": 1e3}, {"current_filter.time_constant": 3e-5}
SKIN = {"skin_effect.resistance": 2.0}
LAGS = {
    "none": {},
    "iron": IRON,
    "filter": FILTER,
    "skin": SKIN,
    "all": IRON | FILTER | SKIN,
    "iron, filter, sampled between": IRON | FILTER | {"current_sampling.delay": 6e-5},
}


def leg(*pulses):
    """Return duties (n, 3) with the first leg's pulses (s) repeated, less than 0 gaps, the others
    at a half."""
    out = SMALL.copy()
    out[:, 0] = [np.resize(pulses, N)[k] / PERIOD for k in range(N)]
    out[:, 0] += out[:, 0] < 0.0
    return out


PATTERNS = {
    "pulses": leg(1e-6, 2.5e-6),
    "gaps": leg(-1e-6),
    "off and on": leg(0.0, PERIOD),
    "all of it": leg(0.0, 1e-6, PERIOD, -1e-6),
    "on, then half": leg(PERIOD, 0.5 * PERIOD),
    "three short": np.tile(np.array([2e-6, 2.5e-6, 3e-6]) / PERIOD, (N, 1)),
}
CASES = [
    *((p, name, BLANK) for p in ("all of it", "three short") for name in LAGS),
    *(
        (p, name, BLANK)
        for p in ("pulses", "gaps", "off and on", "on, then half")
        for name in ("none", "all")
    ),
    *((p, "none", LONG) for p in PATTERNS),
    ("all of it", "all", LONG),
]


@pytest.mark.parametrize(
    ("pattern", "lags", "blank"),
    CASES,
    ids=[f"{p}, {n}, {b['dead_time.time']:g}" for p, n, b in CASES],
)
def test_short_pulses_are_those_of_the_reference(pattern, lags, blank):
    values, duty = LAGS[lags] | blank, PATTERNS[pattern]
    told_by_reference, _ = reference(DRIVE, values, duty, 0.0)
    prepared = from_duties(DRIVE, duty, *turning(N, 0.0))
    some, many = (replay(finer(prepared, k), [values]).currents[0][:, :, 0] for k in (16, 64))
    left, step = apart(DRIVE, many, told_by_reference), apart(DRIVE, some, many)
    print(
        f"{left * 1e6:.4f} ppm of rated current with 64 steps, {step * 1e6:.4f} between 16 and 64"
    )
    assert left < step / 3.0 + LEFT
    without = apart(
        DRIVE, replay(finer(prepared, 64), [LAGS[lags]]).currents[0][:, :, 0], told_by_reference
    )
    assert without > 100.0 * (step / 3.0 + LEFT)  # dead time is seen


def test_legs_that_do_not_switch_take_no_current():
    """All off, or all at a half: no voltage between the legs, so no current, with dead time and
    every lag."""
    for duty in (np.zeros((N, 3)), np.ones((N, 3)), np.full((N, 3), 0.5)):
        found = replay(from_duties(DRIVE, duty, *turning(N, 0.0)), [LAGS["all"] | BLANK]).currents[
            0
        ]
        assert np.abs(found).max() < 1e-12
