"""Prior over sets of effects, and posterior over sets of candidates by algebra on one point's
equations.

A set is a choice of priors on the same equations: wide for its candidates (slab), narrow for all
others (spike).  With M = A + P^-1 for no candidate, b = g at the priors' means, C = M^-1 and c = C
b, a set S whose k coordinates get the deviations w in place of n changes the log evidence by

    1/2 y'K^-1 y - 1/2 log det K - sum log(w / n),   K = I - r (C_SS / n n') r,   y = r c_S / n,   r^2 = 1 - (n / w)^2,

k equations instead of p (the matrix determinant lemma; Woodbury).  A size that can only be positive
has half a Gaussian as prior: the factor 2 Phi(x / s) with its posterior mean x and deviation s.  A
hundred thousand
sets take a second, so the sets near the best one are enumerated: best first, each by adding,
dropping and exchanging a candidate, until none that is left lies within reach.  Checked against
`LinearModel.log_evidence` and against brute force.
"""  # noqa: E501

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import combinations

import numpy as np

from model.array_types import Array
from model.compiled import kernel
from model.effects import library
from sandbox.gap.posterior.candidates import Candidate
from sandbox.gap.posterior.linear_model import LinearModel
from sandbox.gap.settings import USUAL, Settings

Set = tuple[str, ...]  # of effects
Chosen = tuple[int, ...]  # places of candidates
# nats behind the best set within which sets are enumerated: beyond, a thousand of them make 1 %
REACH = 12.0
PARENTS = 80  # sets whose neighbours are looked at; the best first
KEPT = 24  # neighbours of each that are weighed with sizes averaged over


def log_prior(effects: Sequence[str], settings: Settings = USUAL) -> float:
    """Return the log prior of a set: its number of effects is geometric, all sets of one size are
    alike."""
    n, whole = len(effects), len(library.causes())
    return math.log((1.0 - settings.more) * settings.more**n / math.comb(whole, n))


@cache
def contained(effect: str) -> frozenset[str]:
    """Return the effects whose parameters are part of an effect's own: never claimed together with
    it."""
    whole = {
        own.partition(".")[0]: double.partition(".")[0]
        for double, own in library.same_numbers().items()
    }
    return frozenset({whole[effect]} if effect in whole else ())


def possible(effects: Iterable[str]) -> bool:
    """Return whether no effect of a set is part of another of it."""
    chosen = set(effects)
    return not any(contained(e) & chosen for e in chosen)


@dataclass
class SetPosterior:
    """Log posterior of sets of candidates at a point, up to one constant; known: those weighed so
    far."""

    model: LinearModel
    known: dict[Chosen, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        m, wide, eq = self.model, self.model.wide.deviation, self.model.equations
        self.narrow = np.maximum(m.narrow.deviation, 1e-12 * wide)
        shift = eq.x - m.narrow.mean
        scaled = self.narrow[:, None] * eq.a * self.narrow + np.eye(len(shift))
        # no direction is told less than by the prior alone (1), whatever rounding leaves
        value, vector = np.linalg.eigh(scaled)
        value = np.maximum(value, 1.0)
        self.c = (vector / value) @ vector.T  # covariance in narrow deviations
        pull = self.narrow * (eq.g + eq.a @ shift)
        self.mean = self.c @ pull
        level = eq.ssr + 2.0 * shift @ eq.g + shift @ eq.a @ shift
        self.none = float(-0.5 * level + 0.5 * pull @ self.mean - 0.5 * np.sum(np.log(value)))
        self.ratio = np.maximum(wide / self.narrow, 1.0)
        one_sided = (m.wide.low == m.wide.mean) | (m.wide.high == m.wide.mean)
        self.sign = np.where(
            one_sided & (wide > self.narrow), np.where(m.wide.low == m.wide.mean, 1.0, -1.0), 0.0
        )
        self.effects = [c.effect for c in m.candidates]
        self.clash = [
            frozenset(j for j, d in enumerate(m.candidates) if _clash(c, d)) for c in m.candidates
        ]
        self.of_size = [
            log_prior(tuple(map(str, range(n))), m.settings)
            for n in range(len(library.causes()) + 1)
        ]
        self.price = [
            math.log(c.tried) + math.log(sum(_rival(c, d) for d in m.candidates))
            for c in m.candidates
        ]

    def weigh(self, chosen: Iterable[int]) -> float:
        """Return the log posterior of a set, sizes averaged over."""
        key = tuple(sorted(chosen))
        if key not in self.known:
            self._weigh_all([key])
        return self.known[key]

    def enumerate(self, start: Iterable[int] = ()) -> dict[Chosen, float]:
        """Return the sets within REACH of the best one, with their log posterior; start: a set to
        begin at."""
        self.climb(start)
        seen: set[Chosen] = set()
        for _ in range(PARENTS):
            top = max(self.known.values())
            open_ = [k for k, v in self.known.items() if k not in seen and v > top - REACH]
            if not open_:
                break
            here = max(open_, key=lambda k: (self.known[k], k))
            seen.add(here)
            self._look_around(here)
        return self.known

    def climb(self, start: Iterable[int] = ()) -> Chosen:
        """Return the set to which steps to the best neighbour lead, from the better of none and a
        set."""
        self.weigh(())
        self.weigh(start)
        here = self.best()
        while True:
            self._look_around(here)
            if self.best() == here:
                return here
            here = self.best()

    def _look_around(self, here: Chosen) -> None:
        """Weigh the best neighbours of a set."""
        prior = self.neighbours(here)
        near = sorted(k for k in prior if k not in self.known)
        if near:
            posterior = self._evidence(near, np.array([0.5])) + [prior[k] for k in near]
            self._weigh_all([near[k] for k in np.argsort(-posterior, kind="stable")[:KEPT]])

    def neighbours(self, chosen: Chosen) -> dict[Chosen, float]:
        """Return the sets with one candidate more, one fewer, or one exchanged, each sorted, and
        their log prior."""
        rests = [chosen, *(tuple(k for k in chosen if k != gone) for gone in chosen)]
        out = {rest: self._prior(rest) for rest in rests[1:]}
        for rest in rests:
            barred = frozenset(chosen).union(*(self.clash[k] for k in rest))
            names, price = {self.effects[k] for k in rest}, sum(self.price[k] for k in rest)
            of_size = [
                self.of_size[min(len(names) + more, len(self.of_size) - 1)] for more in (0, 1)
            ]
            for k, effect in enumerate(self.effects):
                if k not in barred:
                    level = of_size[effect not in names] - price - self.price[k]
                    out[tuple(sorted((*rest, k)))] = level
        whole = self.allowed(chosen)  # then so is what comes of it
        return {
            k: v
            for k, v in out.items()
            if len(k) < len(self.of_size) and (whole or self.allowed(k))
        }

    def allowed(self, chosen: Chosen) -> bool:
        """Return whether a set holds each effect (and part) once, and none that is part of
        another."""
        return not any(j in self.clash[k] for k, j in combinations(chosen, 2))

    def names(self, chosen: Iterable[int]) -> Set:
        """Return the effects of a set."""
        return tuple(sorted({self.effects[k] for k in chosen}))

    def parts(self, chosen: Iterable[int]) -> tuple[tuple[str, int], ...]:
        """Return the effects of a set, each with its parts."""
        own = (self.model.candidates[k] for k in chosen)
        return tuple(sorted({(c.effect, c.part) for c in own}))

    def by_name(self) -> dict[Set, float]:
        """Return the log posterior of the sets weighed so far by their effects, candidates summed
        over."""
        out: dict[Set, float] = {}
        for k, v in self.known.items():
            out[self.names(k)] = np.logaddexp(out.get(self.names(k), -math.inf), v)
        return {k: float(v) for k, v in out.items()}

    def best(self) -> Chosen:
        """Return the most probable set weighed so far."""
        return max(self.known, key=lambda k: (self.known[k], k))

    def most_probable(self, chosen: Chosen) -> Array:
        """Return the most probable value (p,) of every coordinate with a set, bounds aside."""
        m = self.model
        places = [k for c in chosen for k in m.places[c]]
        deviation = self.narrow.copy()
        deviation[places] = np.maximum(m.wide.deviation[places], deviation[places])
        eq, mean = m.equations, m.narrow.mean
        scaled = deviation[:, None] * eq.a * deviation + np.eye(len(mean))
        return mean + deviation * np.linalg.solve(scaled, deviation * (eq.g + eq.a @ (eq.x - mean)))

    def _weigh_all(self, sets: Sequence[Chosen]) -> None:
        """Weigh sets, sizes averaged over."""
        evidences = self._evidence(sets, np.array(self.model.settings.sizes))
        for key, own in zip(sets, evidences, strict=True):
            self.known[key] = self.none + float(own) + self._prior(key)

    def _prior(self, chosen: Chosen) -> float:
        effects = len({self.effects[k] for k in chosen})
        return self.of_size[effects] - sum(self.price[k] for k in chosen)

    def _evidence(self, sets: Sequence[Chosen], sizes: Array) -> Array:
        """Return by how much sets (m,) change the log evidence."""
        places = self.model.places
        members = [[(k, c) for c, one in enumerate(chosen) for k in places[one]] for chosen in sets]
        most = max(1, max(map(len, members)))
        index, group = (
            np.zeros((len(sets), most), dtype=np.int64),
            np.full((len(sets), most), -1, dtype=np.int64),
        )
        for row, own in enumerate(members):
            for j, (k, c) in enumerate(own):
                index[row, j], group[row, j] = k, c
        out = np.empty(len(sets))
        _weigh(index, group, self.c, self.mean, self.ratio, self.sign, sizes, out)
        return out


def _clash(a: Candidate, b: Candidate) -> bool:
    """Return whether no set holds both of two candidates: of one effect, the same kind of part, or
    one's effect part of the other's."""
    return _rival(a, b) or not possible((a.effect, b.effect))


def _rival(a: Candidate, b: Candidate) -> bool:
    """Return whether two candidates are of one effect, the same kind of part."""
    return a.effect == b.effect and (a.part > 1) == (b.part > 1)


@kernel
def _widened(ratio, size):
    """Return the deviation of a named size, in its trace's; 1 of a shape (ratio 1), which has one
    prior."""
    return math.hypot(1.0, size * ratio) if ratio > 1.0 else 1.0


@kernel
def _weigh(index, group, c, mean, ratio, sign, sizes, out):
    """Write the change of the log evidence of sets (m,): places (m, k), which of the set's
    candidates each belongs to (-1: none), covariance (p, p) and mean (p,) in narrow deviations,
    wide over narrow deviation, sign of a size that has one; each candidate's size averaged over one
    after the other."""
    most = index.shape[1]
    w = np.ones(most)
    gains = np.empty(sizes.size)
    for row in range(index.shape[0]):
        k, candidates = 0, 0
        while k < most and group[row, k] >= 0:
            candidates = max(candidates, group[row, k] + 1)
            w[k] = _widened(ratio[index[row, k]], sizes[0])
            k += 1
        level, averaged = _change(index[row], k, w, c, mean, ratio, sign), 0.0
        if sizes.size > 1:
            for own in range(candidates):
                best = 0
                for s in range(sizes.size):
                    for j in range(k):
                        if group[row, j] == own:
                            w[j] = _widened(ratio[index[row, j]], sizes[s])
                    gains[s] = _change(index[row], k, w, c, mean, ratio, sign)
                    if gains[s] > gains[best]:
                        best = s
                total = 0.0
                for s in range(sizes.size):
                    total += math.exp(gains[s] - gains[best])
                averaged += math.log(total / sizes.size)
                level = gains[best]
                for j in range(k):
                    if group[row, j] == own:
                        w[j] = _widened(ratio[index[row, j]], sizes[best])
        out[row] = level + averaged


@kernel
def _change(index, k, w, c, mean, ratio, sign):
    """Return the change of the log evidence for deviations w (k,) in narrow ones."""
    f, y = np.empty((k, k)), np.empty(k)
    r = np.empty(k)
    out = 0.0
    for i in range(k):
        r[i] = math.sqrt(1.0 - 1.0 / (w[i] * w[i]))
        out -= math.log(w[i])
    for i in range(k):
        y[i] = r[i] * mean[index[i]]
        for j in range(i + 1):
            f[i, j] = (1.0 if i == j else 0.0) - r[i] * c[index[i], index[j]] * r[j]
    for i in range(k):  # Cholesky, K = L L'
        for j in range(i + 1):
            s = f[i, j]
            for m in range(j):
                s -= f[i, m] * f[j, m]
            if i == j:
                if not s > 1e-14:
                    return -math.inf
                f[i, i] = math.sqrt(s)
                out -= math.log(f[i, i])
            else:
                f[i, j] = s / f[j, j]
    for i in range(k):
        s = y[i]
        for m in range(i):
            s -= f[i, m] * y[m]
        y[i] = s / f[i, i]
        out += 0.5 * y[i] * y[i]
    for i in range(k - 1, -1, -1):  # y = K^-1 r c
        s = y[i]
        for m in range(i + 1, k):
            s -= f[m, i] * y[m]
        y[i] = s / f[i, i]
    z = np.empty(k)
    for i in range(k):  # a size that has a sign: posterior mean and deviation
        if sign[index[i]] == 0.0 or w[i] <= 1.0:
            continue
        at, variance = mean[index[i]], c[index[i], index[i]]
        for j in range(k):
            z[j] = r[j] * c[index[j], index[i]]
            at += z[j] * y[j]
        for j in range(k):
            s = z[j]
            for m in range(j):
                s -= f[j, m] * z[m]
            z[j] = s / f[j, j]
            variance += z[j] * z[j]
        out += math.log(2.0) + _log_phi(sign[index[i]] * at / math.sqrt(variance))
    return out


@kernel
def _log_phi(x):
    """Return the log of the normal distribution function; far below zero by its asymptotic
    series."""
    if x > -8.0:
        return math.log(0.5 * math.erfc(-x / math.sqrt(2.0)))
    return -0.5 * x * x - math.log(-x * math.sqrt(2.0 * math.pi)) - 1.0 / (x * x)
