"""Drivers that leave out what is too short: pulses and gaps of a leg, active vectors of the
pattern."""

from __future__ import annotations

from model.compiled import kernel


@kernel
def kept(b, duty):
    """Return a leg's duty after its driver: a pulse, or the gap that its period leaves, below
    least_pulse is dropped.

    The gap's two halves lie at either end of the period; a dropped gap joins the pulse with its
    neighbours.
    """
    return no_short(b, b.least_pulse, duty)


@kernel
def no_short(b, least, duty):
    """Return a leg's duty where pulses and gaps shorter than the least (s) are left out."""
    on = duty * b.period
    if on < least:
        return 0.0
    return 1.0 if b.period - on < least else duty


@kernel
def together(b, d_a, d_b, d_c):
    """Return the legs' duties after a driver that drops active vectors shorter than least_vector.

    Legs whose edges would follow each other faster switch together, at the mean of their duties;
    both active vectors of a half period may go, which leaves no voltage.
    """
    if b.least_vector == 0.0:
        return d_a, d_b, d_c
    least = 2.0 * b.least_vector / b.period
    low, middle, high = (
        min(d_a, d_b, d_c),
        max(min(d_a, d_b), min(max(d_a, d_b), d_c)),
        max(d_a, d_b, d_c),
    )
    first, second = high - middle < least, middle - low < least
    if first and second:
        mean = (d_a + d_b + d_c) / 3.0
        return mean, mean, mean
    if first:
        mean = 0.5 * (high + middle)
        return (
            d_a if d_a < middle else mean,
            d_b if d_b < middle else mean,
            d_c if d_c < middle else mean,
        )
    if second:
        mean = 0.5 * (middle + low)
        return (
            d_a if d_a > middle else mean,
            d_b if d_b > middle else mean,
            d_c if d_c > middle else mean,
        )
    return d_a, d_b, d_c
