"""To how many counts a drive's PWM timer rounds duties, where [drive] does not say so.

A rounded duty is off by up to half a count, and where resistance is small the current that this
adds is many times the noise.  No effect of the library looks like it, but each number of counts N
predicts it whole, x(N): duties are known, and the plant's own transitions say how a voltage goes
on.  Nothing of it is free, so beside what a fit leaves, y, the log Bayes factor of N against no
rounding is (y x - x x / 2) / v.  v is the variance of `evidence.misfit` of what the best number
leaves: what else is missing counts as few shapes, however many readings there are.  It
is larger where that is like x of other numbers, too: a dead time that is not fitted is, to some
degree.  What a fit took
of x is missing in y, which makes the factor a lower bound.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.compiled import inlined, kernel
from model.parameters import Drive
from sandbox.gap.evidence.misfit import met, whitened
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.evidence.spectrum import shown
from sandbox.replay.inputs import LEGS
from sandbox.replay.segments import Colour, loudest
from sandbox.replay.transitions import SHARE, displaced, transitions

Counts = NDArray[np.int64]
FEWEST_COUNTS, MOST_COUNTS = 16, 20_000  # counts: what [drive] pwm_counts may be; 200 MHz at 5 kHz
SURE = 0.95  # posterior probability of some number of counts
# nats: log of all numbers tried, and some; numbers that could not reach it are left away
NEEDED = 20.0
SAMPLES = 150_000  # that are looked at: the first ones of each recording
WORK = 5e8  # samples times numbers in the first look: two seconds
FINALISTS = 64  # numbers that are weighed on all samples
# numbers that say what the residual has alike with any rounding, an octave to either side
OTHERS = 128
ROUNDS = 4  # times at most that what the best number leaves says how far data count
LANES = 256  # numbers side by side
# Added to a number and taken off again it rounds that, half to even: as `np.round` does, but in
# vector code.
WHOLE = 1.5 * 2.0**52


class Counted(NamedTuple):
    """Counts of half a PWM period that duties are rounded to: the most probable number, the range
    of those that hold 95 % of the probability; timer's clock (Hz); share of what it predicts that
    is there; nats against no rounding."""

    value: int
    low: int
    high: int
    clock: float
    share: float
    log_bayes_factor: float

    @property
    def text(self) -> str:
        """Return it as a sentence, with what to do."""
        exact = self.low == self.high
        numbers = (
            f"{self.value} counts"
            if exact
            else f"about {self.value} counts ({self.low} to {self.high})"
        )
        return (
            f"The drive rounds duties to {numbers} of half a PWM period, a timer of "
            f"{self.clock / 1e6:.4g} MHz, which [drive] does not say. The simulator does so from "
            f"here on; state pwm_counts = {self.value}."
        )

    def as_json(self) -> dict[str, Any]:
        """Return it as `diagnosis.json` has it."""
        return {
            "value": self.value,
            "range": [self.low, self.high],
            "clock": self.clock,
            "share": self.share,
            "log_bayes_factor": self.log_bayes_factor,
        }


class RecordingSlopes(NamedTuple):
    """A recording's first n samples: duties (n, 3), flux that a whole duty of each leg adds (n, 3,
    2) in Wb, transitions a (n, 2, 2) and c (n, 3, 2) in standard deviations of the
    noise/Wb, residuals (n, 3) in standard deviations."""

    duty: Array
    kick: Array
    a: Array
    c: Array
    y: Array

    def first(self, share: float) -> RecordingSlopes:
        """Return a share of its samples, the first ones."""
        n = max(1, int(share * len(self.duty)))
        return RecordingSlopes(*(x[:n] for x in self))


def pwm_counts(point: ParameterPoint) -> Counted | None:
    """Return the counts that duties were rounded to, from what a fit leaves; None where recordings
    show none, where [drive] states them, and for logs whose rows are several PWM periods apart."""
    converter = point.prepared.campaign.drive.converter
    if converter.pwm_counts is not None or converter.periods_a_row > 1:
        return None
    likely = settled(parts_of(point), point.prepared.colour)
    if likely is None or not sure(likely.log_posterior):
        return None
    best, own = int(np.argmax(likely.log_posterior)), likely.counts[credible(likely.log_posterior)]
    value, share = int(likely.counts[best]), float(likely.share[best])
    clock = 2.0 * value / (converter.sampling_period * converter.samples_a_period)
    return Counted(
        value,
        int(own.min()),
        int(own.max()),
        clock,
        share,
        float((likely.log_posterior - log_prior(likely.counts))[best]),
    )


class Likely(NamedTuple):
    """The most probable numbers of counts (m,), their log posterior odds against no rounding (m,),
    and the shares (m,) of what they predict that are there."""

    counts: Counts
    log_posterior: Array
    share: Array


def settled(parts: Sequence[RecordingSlopes], colour: Colour = ()) -> Likely | None:
    """Return the likeliest numbers of counts, where data count as far as what the best of them
    leaves says: a residual that rounding makes is no misfit of a model that has it.  None where
    recordings cannot show any, and where they would not even if what is left was noise.

    colour: of the readings' errors, which count as much everywhere as where they have most power.
    """
    first, left, before = first_look(parts), list(parts), 0
    most = loudest(colour)
    if first is None:
        return None
    for _ in range(ROUNDS):
        variance = [most * met(whitened(p.y, colour)) for p in left]
        counts = first.finalists(variance)
        along, square = weighed(parts, variance, counts)
        factor = along - 0.5 * square
        if not sure(np.maximum(factor, max(variance) * factor) + log_prior(counts)):
            return None
        best = int(np.argmax(factor + log_prior(counts)))
        left = [p._replace(y=p.y - added(p, counts[best])) for p in parts]
        log_posterior = factor / alike(left, variance, counts[best]) + log_prior(counts)
        before, same = counts[best], counts[best] == before
        if same:
            break
    return Likely(counts, log_posterior, along / square)


class FirstLook(NamedTuple):
    """All numbers of counts (m,) that recordings may show, and the sums (`products`) of the first
    samples of each recording, (recordings, 2, m)."""

    counts: Counts
    sums: Array

    def finalists(self, variance: Sequence[float]) -> Counts:
        """Return those that stand out most under variances of the recordings."""
        along, square = np.tensordot(1.0 / np.asarray(variance), self.sums, 1)
        likely = along - 0.5 * square + log_prior(self.counts)
        return np.sort(self.counts[np.argsort(likely)[-FINALISTS:]])


def first_look(parts: Sequence[RecordingSlopes]) -> FirstLook | None:
    """Return the first look at recordings; None where no number of counts would show in them."""
    counts = numbers(parts)
    if not len(counts):
        return None
    some = min(1.0, WORK / (len(counts) * sum(len(p.duty) for p in parts)))
    return FirstLook(counts, products([p.first(some) for p in parts], counts))


def with_counts(drive: Drive, value: int) -> Drive:
    """Return a drive that rounds duties to so many counts."""
    return replace(drive, converter=replace(drive.converter, pwm_counts=value))


def parts_of(point: ParameterPoint) -> list[RecordingSlopes]:
    """Return the parts of all recordings."""
    prepared, out = point.turned(), []
    drive = prepared.campaign.drive
    size = SHARE * drive.motor.inductance_q * drive.motor.rated_current
    share = min(1.0, SAMPLES / prepared.samples)
    whole = drive.converter.sampling_period * drive.converter.dc_bus_voltage * (2.0 / 3.0) * LEGS
    for k, (r, left) in enumerate(zip(prepared.recordings, shown(point), strict=True)):
        n = max(1, int(share * r.samples))
        running = displaced(prepared, point.values, k)
        own = transitions(running, n, size)
        track = running.track[len(running.track) - r.samples :][:n]
        duty = np.stack([track[f"d_{x}"] for x in "abc"], axis=1)
        kick = track["link"][:, None, None] * whole
        out.append(
            RecordingSlopes(
                duty,
                kick,
                own.a,
                own.c / prepared.noise_std,
                np.ascontiguousarray(left.current[:n, :, 0]),
            )
        )
    return out


def numbers(parts: Sequence[RecordingSlopes]) -> Counts:
    """Return the numbers of counts whose rounding these recordings would show if all else was
    noise: what it adds falls as their square."""
    few = np.arange(500, 516)
    square = float(np.median(np.sum(products(parts, few)[:, 1], axis=0) * few**2.0))
    most = min(MOST_COUNTS, math.floor(math.sqrt(0.5 * square / NEEDED)))
    return np.arange(FEWEST_COUNTS, most + 1)


def products(parts: Sequence[RecordingSlopes], counts: Counts) -> Array:
    """Return for numbers of counts (m,) what they predict times the residual, and its own square:
    (recordings, 2, m)."""
    sums = np.zeros((len(parts), 2, len(counts)))
    for p, own in zip(parts, sums, strict=True):
        add_predicted(p, counts.astype(float), LANES, own, np.empty((0, 3)))
    return sums


def weighed(
    parts: Sequence[RecordingSlopes], variance: Sequence[float], counts: Counts
) -> tuple[Array, Array]:
    """Return `products` summed over recordings (m,), each over its variance."""
    along, square = np.tensordot(1.0 / np.asarray(variance), products(parts, counts), 1)
    return along, square


def added(part: RecordingSlopes, count: int) -> Array:
    """Return what rounding to a number of counts adds to readings (n, 3), in standard deviations of
    the noise."""
    out = np.empty_like(part.y)
    add_predicted(part, np.array([float(count)]), LANES, np.zeros((2, 1)), out)
    return out


def alike(parts: Sequence[RecordingSlopes], variance: Sequence[float], count: int) -> float:
    """Return how large a square, in its own variance, residuals have along what other numbers near
    one predict; 1 and more.  Where something else is missing that looks like rounding, it looks
    like that to any number."""
    octave = np.exp(math.log(2.0) * np.linspace(-1.0, 1.0, OTHERS))
    other = np.unique(np.round(count * octave).astype(np.int64))
    along, square = weighed(parts, variance, other[(other != count) & (other > 1)])
    return max(1.0, float(np.mean(along**2 / square)))


def sure(log_posterior: Array) -> bool:
    """Return whether some number of counts (m,) is as probable as it takes to state it."""
    return bool(np.logaddexp.reduce(log_posterior) > math.log(SURE / (1.0 - SURE)))


def log_prior(counts: Counts) -> Array:
    """Return the log prior odds (m,) of numbers of counts against no rounding: a timer that shows
    is as likely as none, and its number in every octave (density 1/N)."""
    return np.asarray(-np.log(counts) - math.log(math.log((MOST_COUNTS + 1.0) / FEWEST_COUNTS)))


def credible(log_posterior: Array) -> NDArray[np.int64]:
    """Return the places of the fewest numbers that hold SURE of the posterior, none left aside."""
    chance = np.exp(log_posterior - np.logaddexp.reduce(log_posterior))
    order = np.argsort(-chance)
    return order[: 1 + int(np.searchsorted(np.cumsum(chance[order]), SURE))]


@kernel
def add_predicted(part, counts, lanes, sums, readings):
    """Add to sums (2, m) the products of residuals with what rounding to counts (m,) adds to
    readings, and its squares; write the first number's readings (n, 3) where there is room for
    them."""
    for first in range(0, len(counts), lanes):
        own = counts[first : first + lanes]
        one = 1.0 / own
        psi = np.zeros((2, len(own)))
        found = sums[:, first : first + lanes]
        for k in range(len(part.duty)):
            if len(readings):
                for j in range(3):
                    readings[k, j] = part.c[k, j, 0] * psi[0, 0] + part.c[k, j, 1] * psi[1, 0]
            one_period(
                part.duty[k], part.kick[k], part.a[k], part.c[k], part.y[k], own, one, psi, found
            )


@inlined
def one_period(duty, kick, a, c, y, counts, one, psi, sums):
    """Add a sample to sums (2, m) and go on with fluxes psi (2, m) to the next one; one: 1 /
    counts."""
    d_a, d_b, d_c = duty[0], duty[1], duty[2]
    (u_a, v_a), (u_b, v_b), (u_c, v_c) = (
        (kick[0, 0], kick[0, 1]),
        (kick[1, 0], kick[1, 1]),
        (kick[2, 0], kick[2, 1]),
    )
    a_00, a_01, a_10, a_11 = a[0, 0], a[0, 1], a[1, 0], a[1, 1]
    # of the three readings only their products are needed
    g_0 = c[0, 0] * y[0] + c[1, 0] * y[1] + c[2, 0] * y[2]
    g_1 = c[0, 1] * y[0] + c[1, 1] * y[1] + c[2, 1] * y[2]
    h_00 = c[0, 0] ** 2 + c[1, 0] ** 2 + c[2, 0] ** 2
    h_01 = 2.0 * (c[0, 0] * c[0, 1] + c[1, 0] * c[1, 1] + c[2, 0] * c[2, 1])
    h_11 = c[0, 1] ** 2 + c[1, 1] ** 2 + c[2, 1] ** 2
    p, q, along, square = psi[0], psi[1], sums[0], sums[1]
    for m in range(len(counts)):  # two loops: of more arrays in one LLVM makes no vector code
        x, z = p[m], q[m]
        along[m] += g_0 * x + g_1 * z
        square[m] += (h_00 * x + h_01 * z) * x + h_11 * z * z
    for m in range(len(counts)):
        n, each = counts[m], one[m]
        e = ((d_a * n + WHOLE) - WHOLE) * each - d_a
        f = ((d_b * n + WHOLE) - WHOLE) * each - d_b
        g = ((d_c * n + WHOLE) - WHOLE) * each - d_c
        x = p[m] + e * u_a + f * u_b + g * u_c
        z = q[m] + e * v_a + f * v_b + g * v_c
        p[m] = a_00 * x + a_01 * z
        q[m] = a_10 * x + a_11 * z
