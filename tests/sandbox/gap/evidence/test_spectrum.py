"""Lines of the link found in parts of recordings, and which recordings may be held out, where there
are many.

Lines are planted: frequency, phase and size are known.
"""

import math

import numpy as np
import pytest

from sandbox.gap.evidence.spectrum import in_phase, lines
from sandbox.gap.posterior.holdout import CHOICES, choices

PERIOD = 1e-4
LINE = 297.613  # Hz


def planted(firsts, rows, noise, frequency=LINE):
    """Return parts that begin at these samples of a line of size 1 in noise."""
    rng = np.random.default_rng(5)
    return [
        (
            k,
            np.sin(math.tau * frequency * PERIOD * (k + np.arange(rows)) + 0.4)
            + noise * rng.standard_normal(rows),
        )
        for k in firsts
    ]


@pytest.mark.parametrize("carry", [24, 8])
def test_a_line_is_found_in_parts_far_apart_as_fine_as_their_span_resolves_it(carry):
    """24 parts of 4166 samples in 100 s, of which some carry the line, as large as the noise."""
    firsts = [
        0,
        *(np.arange(1, 24) * 41_000 + np.random.default_rng(2).integers(0, 30_000, 23)).tolist(),
    ]
    with_line, without = planted(firsts, 4166, 1.0), planted(firsts, 4166, 1.0, 0.0)
    parts = [
        p if k % (24 // carry) == 0 else (q[0], q[1] - math.sin(0.4))
        for k, (p, q) in enumerate(zip(with_line, without, strict=True))
    ]
    found = lines(parts, PERIOD, 20.0, 1500.0)
    span = PERIOD * (firsts[-1] + 4166)
    assert abs(found[0] - LINE) < 0.25 / span  # a quarter of a turn over all of it


def test_parts_that_begin_their_recordings_are_one_periodogram():
    """As it always was: the largest bin of the sum's own transform, twice as long as the longest
    part."""
    parts = planted([0, 0, 0], 3000, 0.5)
    total = np.concatenate([sum(x for _, x in parts), np.zeros(3002)])
    peak = np.fft.rfftfreq(len(total), PERIOD)[np.argmax(np.abs(np.fft.rfft(total))[2:]) + 2]
    assert lines(parts, PERIOD, 20.0, 1500.0)[0] == pytest.approx(peak)


@pytest.mark.parametrize(("width", "stands_out"), [(40, True), (70, False)])
def test_a_band_stands_out_where_it_is_narrower_than_half_of_a_hundred_bins(width, stands_out):
    """Pulses in the middle of a part have a flat spectrum: one of every frequency of size 1 and one
    of a band of size 10, beside a line of 5.  A level is the median of 101 bins: a band of 70 is a
    level of its own, one of 40 is not."""
    rows, middle, at = 4095, 2000, 1500  # of 8192 bins at all
    n = np.arange(rows) - middle
    first = 3000 - width // 2
    band = (
        sum(np.cos(np.pi * k * n / (rows + 1)) for k in range(first, first + width))
        * 10.0
        / (rows + 1)
    )
    x = (n == 0) + band + 5.0 * np.cos(np.pi * at * n / (rows + 1)) / (rows / 2)
    bin_of = round(lines([(0, x)], PERIOD, 20.0, 4900.0)[0] * 2 * (rows + 1) * PERIOD)
    assert (first - 1 <= bin_of <= first + width) if stands_out else abs(bin_of - at) <= 1


def test_at_most_a_hundred_thousand_frequencies_are_tried_near_a_line():
    """Parts four hours apart would tell 57 600 at 1 Hz either way twice over: the answer is one of
    100 000 in a row."""
    rate, rows = 1.0 / PERIOD, 300
    firsts = [0, round(4 * 3600 * rate)]
    found = in_phase(planted(firsts, rows, 0.0), PERIOD, LINE - 0.3, 1.0)
    place = (found - (LINE - 1.3)) / 2.0 * (100_000 - 1)
    assert place == pytest.approx(round(place), abs=1e-4)
    assert abs(found - LINE) < 0.25


def test_of_many_recordings_some_spread_evenly_may_be_held_out():
    few = choices(["locked"] * 5 + ["free"] * 3)
    assert len(few) == 10 * 3  # two of five, one of three
    many = choices(["free"] * 200)
    used = sorted({k for one in many for k in one})
    assert 300 < len(many) <= CHOICES
    assert {len(one) for one in many} == {2}
    assert (used[0], used[-1]) == (0, 199)
    assert np.ptp(np.diff(used)) <= 1
    # pairs of 32; 33 have 528, above 500
    assert len(choices(["free"] * 32)) == len(choices(["free"] * 33)) == 496
    assert {len(one) for one in choices(["locked"] * 8 + ["driven"] * 8 + ["free"] * 8)} == {6}
