"""A shaft with backlash over a step: pieces of a damped swing beyond the gap's edges and of free
flight between them, each exact, joined where the twist crosses an edge.

The twist x counts from the gap's middle.  Inside both masses fly freely: x'' = push, the difference
of their accelerations.  Beyond an edge the shaft pulls back: x'' = push - rate^2 (x - edge) - 2
ratio rate x'.  (Dead zone with damping in contact alone: Nordin, Gutman, Automatica 38 (2002)
1633.)
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel
from model.lanes import fading, sine_cosine

# of a step.  A stay beyond an edge lasts at least half a swing of the shaft, which no step exceeds
# (`model.effects.shaft_compliance.limits`), but where the torque pushes it out at once
PIECES = 6
NEWTON = 40  # steps at most; bisection where Newton leaves its bracket
MISS = 1e-13  # of the step: an instant is known to


@inlined
def swung(x, v, rate, ratio, root, h):
    """Return a damped swing's distance from rest (rad) and slope (rad/s) h (s) on; root: sqrt(1 -
    ratio^2)."""
    decay = fading(-ratio * rate * h)
    s, c = sine_cosine(rate * root * h)
    s /= rate * root
    return (
        decay * ((c + ratio * rate * s) * x + s * v),
        decay * ((c - ratio * rate * s) * v - rate * rate * s * x),
    )


@inlined
def side_of(x, v, push, half):
    """Return beyond which edge of the gap (1, -1; 0: none) a shaft moves from here on."""
    side = 1.0 if x > 0.0 else -1.0
    y, u, a = side * x - half, side * v, side * push
    if y > 0.0:
        return side
    if y == 0.0 and (u > 0.0 or (u == 0.0 and a > 0.0)):
        return side
    return 0.0


@inlined
def flight(distance, u, a):
    """Return when (s) a body that flies at a speed u under an acceleration a has gone a distance of
    at least 0; infinity where it never does."""
    square = u * u + 2.0 * a * distance
    if square < 0.0:
        return math.inf
    if u < 0.0:  # it turns back first
        return (math.sqrt(square) - u) / a if a > 0.0 else math.inf
    reach = u + math.sqrt(square)
    return 2.0 * distance / reach if reach > 0.0 else math.inf


@inlined
def contact(y, u, a, rate, ratio, root, h):
    """Return when (s) a shaft that is y >= 0 beyond an edge comes back to it, h where it does not
    in a step of h; u: its speed away from it, a: the push away."""
    rest = a / (rate * rate)
    z = y - rest
    last, speed = swung(z, u, rate, ratio, root, h)
    if last + rest >= 0.0 and (u >= 0.0 or speed <= 0.0):
        return h
    turn = math.atan2(rate * root * u, ratio * rate * u + rate * rate * z)
    turn = (turn if turn > 0.0 else turn + math.pi) / (rate * root)  # there the speed is zero
    low, high = (turn, h) if u > 0.0 else (0.0, min(turn, h))
    if not low < high or swung(z, u, rate, ratio, root, high)[0] + rest >= 0.0:
        return h
    t = 0.5 * (low + high)
    for _ in range(NEWTON):
        miss, speed = swung(z, u, rate, ratio, root, t)
        miss += rest
        low, high = (t, high) if miss > 0.0 else (low, t)
        on = t - miss / speed if speed < 0.0 else low
        on = on if low < on and on < high else 0.5 * (low + high)
        moved, t = abs(on - t), on
        if moved < MISS * h:
            break
    return t


@kernel
def swing_across(x, v, push, half, rate, ratio, h):
    """Return twist (rad) and slip (rad/s) h (s) on; half: of the gap, rad; push: rad/s^2."""
    root, left, edge = math.sqrt(1.0 - ratio * ratio), h, half
    for piece in range(PIECES):
        side, span = side_of(x, v, push, half), left
        if side == 0.0:
            before, after = flight(half + x, -v, -push), flight(half - x, v, push)
            if min(before, after) < left and piece < PIECES - 1:
                span, edge = min(before, after), (half if after < before else -half)
            x, v = x + span * (v + 0.5 * span * push), v + span * push
        else:
            edge = side * half
            if piece < PIECES - 1:
                span = contact(side * x - half, side * v, side * push, rate, ratio, root, left)
            rest = edge + push / (rate * rate)
            x, v = swung(x - rest, v, rate, ratio, root, span)
            x += rest
        left -= span
        if not left > 0.0:
            break
        x = edge
    return x, v
