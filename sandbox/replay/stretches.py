"""What of a campaign is worked on at once: recordings side by side, or a long one cut in time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple


class Stretch(NamedTuple):
    """Samples first to last - 1 of a recording (its place in the campaign) of n."""

    recording: int
    first: int
    last: int
    n: int

    @property
    def whole(self) -> bool:
        """Whether it is all of the recording."""
        return self.last - self.first == self.n


def stretches(samples: Sequence[int], most: float, cut: int = 1) -> list[list[Stretch]]:
    """Return all samples of recordings, in groups of at most so many: recordings side by side, or
    part of a longer one.

    Parts are cut at multiples of `cut` and no shorter than that, so a group may be as long as two
    cuts.
    """
    out: list[list[Stretch]] = [[]]
    for r, n in enumerate(samples):
        if n > most:
            size = cut * max(1, int(most) // cut)
            starts = [first for first in range(0, n, size) if not first or n - first >= cut]
            out += [[Stretch(r, a, b, n)] for a, b in zip(starts, [*starts[1:], n], strict=True)]
        elif sum(s.n for s in out[-1]) + n > most:
            out.append([Stretch(r, 0, n, n)])
        else:
            out[-1].append(Stretch(r, 0, n, n))
    return [group for group in out if group]


def side_by_side(
    samples: Sequence[int], most: Sequence[float], cut: int, count: int
) -> list[list[Stretch]]:
    """Return all samples of recordings, each in stretches of at most so many (no shorter than
    `cut`, at multiples of it), those of `count` recordings side by side."""
    own = [
        [Stretch(r, s.first, s.last, n) for (s,) in stretches([n], m, cut)]
        for r, (n, m) in enumerate(zip(samples, most, strict=True))
    ]
    return [
        [parts[k] for parts in own[first : first + count] if k < len(parts)]
        for first in range(0, len(own), count)
        for k in range(max(map(len, own[first : first + count])))
    ]


def whole_blocks(least: int, cut: int) -> int:
    """Return the samples of the fewest whole blocks that hold so many: one at least."""
    return cut * max(1, math.ceil(least / cut))


def blocks(n: int, cut: int) -> list[tuple[int, int]]:
    """Return first and last sample of each block of n samples; the last block is half to one and a
    half long."""
    starts = range(0, max(1, n - cut // 2), cut)
    return [(first, n if first == starts[-1] else first + cut) for first in starts]
