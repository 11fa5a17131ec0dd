"""The few numbers of the statistical model, each with where it comes from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Prior chances and sizes; what the simulator is known to miss.

    shapes: independent shapes that the misfit of one recording takes.  In 12 recordings of one
    campaign with a large misfit (s10 of the independent bench, whose truth is not known) apparent
    sizes of effects that were not named have a mean z^2 between E/28 and E/3300, half of them
    between E/160 and E/1300; single ones reach 0.4 E.  60 leans to that tail, since one recording
    with such a size names a false effect.  It is chosen, not derived.

    more: chance of one more effect; the number of effects is geometric, so no effect at all has
    1 - more.  unknown: chance that something outside the library is at work.  Both are choices that
    state how often a bench is asked about without a gap; answers rest on the data where they hold
    any.

    trace, trace_grows, trace_most: standard deviation of a trace of an effect that nobody named, as
    a share of a named effect's, at no gap; the J of ordinary deviations alone that doubles it; its
    largest value.  Two to three times the error of the replay, as fits to five other simulators
    show it (`experiments/ordinary_size.py`: 0.3 % below J = 3, 1 % to 30, 2.6 % beyond, rms).

    sizes: multiples of an effect's wide prior, alike in probability: how large an effect is nobody
    knows beforehand.

    misses, misses_of_gap, tail: mean excess J^2 - 1 of a recording's currents that the replay
    leaves with all effects right, its share of the gap that it closes, and the exponent of its
    tail.  Of 72 recordings of six campaigns of the independent bench the mean is 1.2 %, nine in ten
    are below 2.6 %, the largest are 8 % and 17 %; the switched bench leaves less than half of that.
    farthest: excess beyond which nobody asks for causes, the end of `unknown`'s prior.

    imitated: odds, for each effect of a set, that the set only imitates a cause outside: of 24
    single effects taken out of the library on an opened check, three were imitated down to the
    noise, each by three others.

    stretch: standard deviations of an ordinary deviation that makes up for a cause outside the
    library.

    rounds, rivals, near: fits of the most probable set at most; sets that are fitted beside it at
    most; nats behind it up to which they are.  tries: sets that are fitted roughly in a round far
    from the noise, until one is better; chosen.  bend: of what an effect moves, how far slopes err
    on the way to none of it: two effects that are closer than that are both fitted.

    samples, gap: of a campaign of twice as many samples and more, whose ordinary deviations alone
    leave a J above `gap`, the first rounds look at excerpts of so many.  They only choose where the
    rounds on all of it begin.
    Chosen, not derived: of six practice campaigns made again none answered otherwise; with p05 (169
    920 samples) the rounds on all of it fell from three to two.
    """

    shapes: float = 60.0
    more: float = 0.15
    unknown: float = 0.05
    trace: float = 0.01
    trace_grows: float = 7.0
    trace_most: float = 0.06
    sizes: tuple[float, ...] = (8.0, 2.0, 0.5, 0.125)
    misses: float = 0.008
    tail: float = 3.0
    misses_of_gap: float = 3e-5
    farthest: float = 1e4
    imitated: float = 0.002
    stretch: float = 4.0
    rounds: int = 8
    rivals: int = 4
    near: float = 5.0
    tries: int = 8
    bend: float = 0.02
    samples: int = 40_000
    gap: float = 1.02

    def trace_at(self, rms: float) -> float:
        """Return the standard deviation of traces where ordinary deviations alone leave that
        normalised rms."""
        return min(self.trace_most, self.trace * (1.0 + rms / self.trace_grows))


USUAL = Settings()
