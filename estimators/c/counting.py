"""What a step costs in arithmetic: the very functions that are translated, run on numbers that
count."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from types import FunctionType, SimpleNamespace
from typing import Any, cast

import numpy as np

from estimators.c.translate import of_quartic
from estimators.contract import Belief, Sample, Tuning
from model.quartic import Energy

KINDS = ("mul", "add", "div", "sqrt", "trig", "compare")


@dataclass(frozen=True)
class Operations:
    """Operations of a step: the mean over those counted, and the most of each kind."""

    period: int  # samples in an injection period
    steps: int
    mean: dict[str, float]
    most: dict[str, int]

    def said(self) -> str:
        """Return it as a phrase."""
        parts = [f"{self.mean[k]:.0f} {k}" for k in KINDS]
        return (
            f"{', '.join(parts)} (mean of {self.steps} steps at rated load, {self.period} "
            "samples a period)"
        )


COUNTED: Counter[str] = Counter()


class Number(float):
    """A float that counts what is done with it."""

    __slots__ = ()


def _counting(kind: str, name: str) -> Any:
    plain = getattr(float, name)

    def operator(self: Number, other: Any) -> Any:
        """Do it, and count it."""
        COUNTED[kind] += 1
        found = plain(self, float(other))
        return found if isinstance(found, bool) else Number(found)

    return operator


for _kind, _names in {
    "add": ("add", "radd", "sub", "rsub"),
    "mul": ("mul", "rmul"),
    "div": ("truediv", "rtruediv"),
    "compare": ("lt", "le", "gt", "ge", "eq", "ne"),
}.items():
    for _name in _names:
        setattr(Number, f"__{_name}__", _counting(_kind, f"__{_name}__"))


def _negative(self: Number) -> Number:
    return Number(-float(self))


def _power(self: Number, n: int) -> Number:
    COUNTED["mul"] += n // 2 + n % 2 if n > 2 else 1  # as the helpers in C multiply
    return Number(float(self) ** n)


def _hash(self: Number) -> int:
    return float.__hash__(self)


Number.__neg__, Number.__pow__, Number.__hash__ = _negative, _power, _hash  # type: ignore[method-assign,assignment]


def _trig(function: Any) -> Any:
    def counted(*x: Any) -> Number:
        """Count one call."""
        COUNTED["trig"] += 1
        return Number(function(*map(float, x)))

    return counted


def _root(x: Any) -> Number:
    COUNTED["sqrt"] += 1
    return Number(math.sqrt(float(x)))


MATHS = SimpleNamespace(
    cos=_trig(math.cos),
    sin=_trig(math.sin),
    atan2=_trig(math.atan2),
    sqrt=_root,
    pi=math.pi,
    hypot=lambda x, y: _root(x * x + y * y),
    floor=lambda x: Number(math.floor(float(x))),
)


def _counted(function: Any, done: dict[Any, Any]) -> Any:
    """Return a kernel as a Python function that counts, and so all that it calls."""
    plain = of_quartic(function)
    plain = getattr(plain, "py_func", plain)
    if plain not in done:
        world = {**plain.__globals__, "math": MATHS}
        done[plain] = FunctionType(plain.__code__, world, plain.__name__, plain.__defaults__)
        for name in plain.__code__.co_names:
            if hasattr(world.get(name), "py_func") or isinstance(world.get(name), FunctionType):
                world[name] = _counted(world[name], done)
    return done[plain]


def operations(
    step: Any, setup: tuple[Belief, Tuning], state: np.ndarray, samples: np.ndarray
) -> Operations:
    """Return what a step costs over the later half of samples (n, 5), from a state of its own."""
    counted_step = _counted(step, {})
    belief, tuning = setup
    energy = Energy(*(Number(v) for v in cast(Energy, belief.energy)))
    counting = Belief(energy, *map(Number, belief[1:]))
    tuned = Tuning._make(Number(v) if isinstance(v, float) else v for v in tuning)
    memory: list[Number] = [Number(v) for v in state]
    counts = []
    for row in samples:
        COUNTED.clear()
        counted_step(memory, Sample._make(Number(v) for v in row), counting, tuned)
        counts.append(dict(COUNTED))
    late = counts[len(counts) // 2 :]
    every = {k: [c.get(k, 0) for c in late] for k in KINDS}
    return Operations(
        tuning.period,
        len(late),
        {k: float(np.mean(v)) for k, v in every.items()},
        {k: max(v) for k, v in every.items()},
    )
