"""How current sensors read beside gain, offset and noise: cores that remember, phases read one
after another.

- remanence: a core of the sensor holds a current h, dragged along by i within remanence_radius r (a
  play); the reading is i - remanence (i - h): high by remanence r after a fall of more than 2 r,
  low after a rise.  The core follows the current from sample to sample, not its ripple in between.
- channel_lag: one converter reads phase a at t_k (plus the sampling delay), b by channel_lag later,
  c by as much again.
"""

from __future__ import annotations

from model.compiled import inlined, kernel


@inlined
def within_play(ahead, radius):
    """Return how far a current is ahead of what a core holds (A), at most its radius."""
    return min(max(ahead, -radius), radius)


@kernel
def remembered(state, b, first, currents):
    """Return the phases' currents (A) as their sensors' cores show them; state[first:first + 3]:
    what these hold."""
    if b.remanence == 0.0:
        return currents
    i_a, i_b, i_c = currents
    a = within_play(i_a - state[first], b.remanence_radius)
    b_ = within_play(i_b - state[first + 1], b.remanence_radius)
    c = within_play(i_c - state[first + 2], b.remanence_radius)
    state[first], state[first + 1], state[first + 2] = i_a - a, i_b - b_, i_c - c
    return i_a - b.remanence * a, i_b - b.remanence * b_, i_c - b.remanence * c


@inlined
def channels(b):
    """Return how many instants a sample of the currents has."""
    return 3 if b.channel_lag > 0.0 else 1
