"""Lines of the link found in parts of recordings, and which recordings may be held out, where there are many.

Lines are planted: frequency, phase and size are known.
"""

import math

import numpy as np
import pytest

from sandbox.gap.evidence.holdout import CHOICES, choices
from sandbox.gap.evidence.spectrum import lines

PERIOD = 1e-4
LINE = 297.613  # Hz


def planted(firsts, rows, noise, frequency=LINE):
    """Return parts that begin at these samples of a line of size 1 in noise."""
    rng = np.random.default_rng(5)
    return [
        (k, np.sin(math.tau * frequency * PERIOD * (k + np.arange(rows)) + 0.4) + noise * rng.standard_normal(rows))
        for k in firsts
    ]


@pytest.mark.parametrize("carry", [24, 8])
def test_a_line_is_found_in_parts_far_apart_as_fine_as_their_span_resolves_it(carry):
    """24 parts of 4166 samples in 100 s, of which some carry the line, as large as the noise."""
    firsts = [0, *(np.arange(1, 24) * 41_000 + np.random.default_rng(2).integers(0, 30_000, 23)).tolist()]
    with_line, without = planted(firsts, 4166, 1.0), planted(firsts, 4166, 1.0, 0.0)
    parts = [p if k % (24 // carry) == 0 else (q[0], q[1] - math.sin(0.4))
             for k, (p, q) in enumerate(zip(with_line, without, strict=True))]  # fmt: skip
    found = lines(parts, PERIOD, 20.0, 1500.0)
    span = PERIOD * (firsts[-1] + 4166)
    assert abs(found[0] - LINE) < 0.25 / span  # a quarter of a turn over all of it


def test_parts_that_begin_their_recordings_are_one_periodogram():
    """As it always was: the largest bin of the sum's own transform, twice as long as the longest part."""
    parts = planted([0, 0, 0], 3000, 0.5)
    total = np.concatenate([sum(x for _, x in parts), np.zeros(3002)])
    peak = np.fft.rfftfreq(len(total), PERIOD)[np.argmax(np.abs(np.fft.rfft(total))[2:]) + 2]
    assert lines(parts, PERIOD, 20.0, 1500.0)[0] == pytest.approx(peak)


def test_of_many_recordings_some_spread_evenly_may_be_held_out():
    few = choices(["locked"] * 5 + ["free"] * 3)
    assert len(few) == 10 * 3  # two of five, one of three
    many = choices(["free"] * 200)
    used = sorted({k for one in many for k in one})
    assert 300 < len(many) <= CHOICES
    assert {len(one) for one in many} == {2}
    assert (used[0], used[-1]) == (0, 199)
    assert np.ptp(np.diff(used)) <= 1
    assert {len(one) for one in choices(["locked"] * 8 + ["driven"] * 8 + ["free"] * 8)} == {6}
