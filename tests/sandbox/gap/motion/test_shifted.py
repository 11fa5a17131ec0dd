"""A motion whose current stands some rows off is told, one that is filtered is not."""

import pytest

from sandbox.gap.motion.shifted import moved, shifted
from sandbox.recordings.findings import Doubt
from tests.sandbox.gap.motion.shafts import COUNT, both_ways, campaign, shaft, thrown

KINDS = {
    "controlled": lambda seed: shaft(seed, both_ways, dry=0.02, viscous=1e-4),
    "thrown, 20 ms": lambda seed: thrown(seed, 20e-3, COUNT),
    "thrown, 2 ms": lambda seed: thrown(seed, 2e-3, COUNT),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rows", [-3, 4, 20])
def test_the_rows_are_found(kind, rows):
    """Torque moved down by so many rows: it stands too low."""
    own = campaign(*(moved(KINDS[kind](seed), -rows) for seed in (1, 2)))
    (found,) = shifted(own)
    assert isinstance(found, Doubt)
    assert f"move the currents {'up' if rows > 0 else 'down'} by {abs(rows)} rows" in found.text


@pytest.mark.parametrize("kind", KINDS)
def test_what_stands_right_is_not_told(kind):
    assert shifted(campaign(*map(KINDS[kind], (1, 2)))) == []


@pytest.mark.parametrize("lag", [2e-3, 20e-3, 60e-3])
def test_a_filter_is_none(lag):
    """One, nine and 27 rows late in the mean, but not all of it."""
    own = [shaft(seed, both_ways, dry=0.02, viscous=1e-4, lag=lag) for seed in (1, 2)]
    assert shifted(campaign(*own)) == []


def test_noise_alone_and_few_rows_say_nothing():
    short = shaft(1, both_ways, seconds=0.2)
    assert shifted(campaign(short)) == []
    still = shaft(2, lambda t: 0.0 * t)
    assert shifted(campaign(still)) == []
