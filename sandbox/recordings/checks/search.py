"""The search for the mistakes that recordings contradict: single changes of the table (`changes`),
then pairs, then three, each more only where it could pay.

A reading costs the mean logarithm of what it leaves, and FALLS times for each of its mistakes; what
a right reading leaves is FLOOR, so that the search ends where one more could not be worth it.
Changes go together where they change different things.  A zero of the angle is one of them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Hashable, Iterable, Iterator, Sequence

import numpy as np

from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import Balance
from sandbox.recordings.checks.changes import (
    ANGLE,
    CURRENT,
    DUTIES,
    MOTOR,
    VOLTAGE,
    Change,
    changes,
    of_base,
    source_of,
    voltages_held,
)
from sandbox.recordings.checks.pace import paces
from sandbox.recordings.checks.readings import (
    BETTER,
    FALLS,
    FLOOR,
    ZEROS,
    Products,
    Reading,
    count_of,
    terms_of,
)

# factors, or their inverse, beyond any gain of a sensor or a link
BASE = {CURRENT: 5.0, VOLTAGE: 3.0}
ALIKE = 0.2  # of the logarithm: two mistakes that cannot be told apart
SMALLEST_ZERO = math.radians(10.0)  # a smaller one is a gap: an encoder's offset
ROUND = math.radians(4.0)  # a zero so near to a whole twelfth of a turn is that
ROUNDING = 1e-9  # relative, of what two equal zeros leave
SAME = 0.01  # relative, of the angle's factors
MOST_MISTAKES = 3  # mistakes at once
SOME = 4  # recordings of which several mistakes are tried
BEAM = 64  # readings of two mistakes to which a third is added

AsItIs = tuple[Change, ...]


def explanations(
    doubtful: Sequence[tuple[CampaignRecording, Balance]], drive: Drive
) -> list[Reading]:
    """Return the likeliest reading that explains a recording, and one that does as well."""
    parts = [Products(r, drive, b.share, b.noise) for r, b in doubtful]
    if not parts:
        return []
    good = [x for x in readings(parts, drive) if x.answered.any()]
    best = min(good, key=lambda x: x.cost, default=None)
    alike = [x for x in good if best and x.cost <= best.cost + ALIKE and x.count == best.count]
    return likeliest(alike)


def likeliest(alike: Sequence[Reading]) -> list[Reading]:
    """Return the likeliest of readings that cannot be told apart, and the next one where each is
    one mistake.

    A factor or a zero may be anything, a unit is what it is; of two conventions the data sheet's is
    the commoner.
    """

    def rank(x: Reading) -> tuple[bool, bool, int]:
        """Return what less likely readings have more of."""
        own = sum(c.convention and c.part != MOTOR for c in x.changes)
        return any(c.fitted for c in x.changes), x.zero != 0.0, own

    done = dict[tuple[Hashable, ...], Reading]()
    for x in sorted(alike, key=lambda x: len(x.changes)):  # of what does the same, the fewest
        done.setdefault(x.does, x)
    some = sorted((x for x in alike if x is done[x.does]), key=rank)
    return some[: 2 if some and some[0].count == 1 else 1]


def readings(parts: Sequence[Products], drive: Drive) -> list[Reading]:
    """Return readings of one mistake, of two where one does not settle it, of three where two do
    not; those of several of SOME recordings, the best of them of all."""
    table = changes(drive, source_of(parts[0].recording))
    tried = list(single(parts, table))
    if _settled(tried, 1):
        return tried
    some = _some(parts)
    more = list(two(some, drive, table))
    if not _settled(more, 2):
        more += three(some, table, sorted(more, key=_likelier)[:BEAM])
    best = sorted((x for x in more if x.answered.any()), key=_likelier)[:BEAM]
    for x in best:
        tried += readings_of(parts, [x.changes], x.zero)
    return tried


def _some(parts: Sequence[Products]) -> Sequence[Products]:
    """Return SOME recordings of all kinds, from the one that turns least to the one that turns
    most."""
    by_turn = sorted(parts, key=lambda p: float(np.ptp(p.columns["theta"])))
    chosen = np.unique(np.linspace(0, len(parts) - 1, SOME).round().astype(int))
    return [by_turn[k] for k in chosen]


def two(parts: Sequence[Products], drive: Drive, table: Sequence[Change]) -> Iterator[Reading]:
    """Yield the readings of two changes, or of one and a zero, and of a base beside one."""
    yield from readings_of(parts, _pairs(table))
    for others in ((), *((c,) for c in table)):
        if others and (zero := _zero(parts, others)):
            yield from readings_of(parts, [others], zero)
        yield from readings_of(parts, ((*others, c) for c in bases(parts, drive, others)))


def three(
    parts: Sequence[Products], table: Sequence[Change], found: Sequence[Reading]
) -> Iterator[Reading]:
    """Yield the readings of a further change, or of a zero, beside those found."""
    for x in found:
        if x.count < MOST_MISTAKES:
            more = ((*x.changes, c) for c in table if all(together(c, own) for own in x.changes))
            yield from readings_of(parts, (m for m in more if _few(m, x.zero)), x.zero)
            if not x.zero and (zero := _zero(parts, x.changes)):
                yield from readings_of(parts, [x.changes], zero)


def single(parts: Sequence[Products], table: Sequence[Change]) -> Iterator[Reading]:
    """Yield the readings of one change alone, of a zero of the angle, and of an angle that turns at
    another pace."""
    yield from readings_of(parts, ((c,) for c in table))
    known = [abs(c.turn) for c in table if c.part == ANGLE]
    other = (c for c in paces(parts) if not np.any(np.isclose(known, abs(c.turn), rtol=SAME)))
    yield from readings_of(parts, ((c,) for c in other))
    if zero := _zero(parts, ()):
        yield from readings_of(parts, [()], zero)


def readings_of(
    parts: Sequence[Products], every: Iterable[AsItIs], zero: float = 0.0
) -> Iterator[Reading]:
    """Yield what some changes together leave, where the link could give the commands as they read
    them."""
    before, noise = np.array([p.before for p in parts]), np.array([p.noise for p in parts])
    for own in every:
        if all(p.possible(own) for p in parts):
            read = terms_of(own, parts[0].drive.motor)
            shares = np.array([p.share(read, zero) for p in parts])
            yield Reading(own, zero, shares, before, noise)


def _likelier(x: Reading) -> float:
    """Return what readings are put in order by: those that rounding alone tells apart stay as they
    were tried."""
    return round(x.cost, 9)


def _settled(tried: Sequence[Reading], count: int) -> bool:
    """Tell whether no reading of more than so many mistakes could cost less than the best."""
    least = math.log(FLOOR) + math.log(FALLS) * (count + 1)
    return min((x.cost for x in tried if x.answered.any()), default=math.inf) <= least


def _few(own: AsItIs, zero: float = 0.0) -> bool:
    """Tell whether changes and a zero are MOST_MISTAKES mistakes or fewer."""
    return count_of(own, zero) <= MOST_MISTAKES


def _pairs(table: Sequence[Change]) -> Iterator[AsItIs]:
    """Yield pairs of changes that change different things."""
    pairs = itertools.combinations(table, 2)
    return ((a, b) for a, b in pairs if together(a, b) and _few((a, b)))


def together(a: Change, b: Change) -> bool:
    """Tell whether two changes change different things."""
    return not a.changed & b.changed


def bases(
    parts: Sequence[Products], drive: Drive, others: AsItIs = (), zero: float = 0.0
) -> Iterator[Change]:
    """Yield the factors of all currents, and of all voltages, that leave least beside other
    changes, where they are no gain of a sensor.

    What is left is a parabola in the factor of the currents, and in one over that of the voltages.
    A factor of currents is told where currents that are none leave BETTER times more.
    """
    source, motor = source_of(parts[0].recording), drive.motor

    def left(*own: Change) -> float:
        """Return what all recordings leave with these changes."""
        return sum(p.share(terms_of((*others, *own), motor), zero) for p in parts)

    for part in (CURRENT, VOLTAGE):
        if part == VOLTAGE and voltages_held(source) == DUTIES:
            continue
        low, high = (left(Change(part, "", "", "", scale=x)) for x in (-1.0, 1.0))
        none = left(Change(CURRENT, "", "", "", scale=0.0))
        middle = none if part == CURRENT else float(len(parts))
        bend, slope = 0.5 * (high + low) - middle, 0.5 * (high - low)
        if bend <= 0.0 or slope >= 0.0:
            continue
        best = -0.5 * slope / bend
        found = of_base(part, best if part == CURRENT else 1.0 / best, drive, source)
        clear = part == VOLTAGE or left(found) * BETTER < none
        far = abs(math.log(found.scale)) > math.log(BASE[part])
        if clear and far and all(together(found, c) for c in others):
            yield found


def _zero(parts: Sequence[Products], own: AsItIs) -> float:
    """Return the zero of the angle (rad) that leaves least of all recordings; 0 where that is none
    to speak of.  An angle that was made has its own already, but not at another speed."""
    made = any(c.part == ANGLE for c in own)
    if all("theta" in source_of(p.recording) or made for p in parts):
        total = sum(p.shares(own, ZEROS) for p in parts)
        # half a turn more is the same where all vectors were made with the angle
        best = float(min(ZEROS[total <= np.min(total) * (1.0 + ROUNDING)], key=abs))
        near = round(best / (math.pi / 6.0)) * math.pi / 6.0
        best = near if abs(best - near) < ROUND else best
        if abs(best) >= SMALLEST_ZERO and float(np.ptp(total)) > FLOOR:
            return math.pi if best < -math.pi + 1e-9 else best
    return 0.0
