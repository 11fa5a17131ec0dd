"""Parts of sentences about a diagnosis: effects, hypotheses, probabilities, shares and quantities
in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from model.effects import library, said
from model.effects.said import PREFIXED, PREFIXES
from sandbox.gap.posterior.estimates import Estimate

SIGNS = said.SIGNS | {"A/Wb^2": "A/Wb²", "A/Wb^3": "A/Wb³"}


def likely(p: float) -> str:
    """Return a probability in words a sentence can hold."""
    if p > 0.995:
        return "more than 99 % probable"
    return "less than 1 % probable" if p < 0.005 else f"{100.0 * p:.0f} % probable"


def times(x: float) -> str:
    """Return a multiple of the noise floor: "12.3 times", near one with enough digits."""
    return f"{x:.2f} times" if x < 10.0 else f"{x:.3g} times" if x < 1000.0 else f"{x:,.0f} times"


def amperes(x: float, *, sign: bool = False) -> str:
    """Return a current with two digits and a unit a person uses: "17 mA", with its sign "+17
    mA"."""
    size = abs(x)
    scale, prefix = (
        next(((s, p) for s, p in PREFIXES if size >= s), (1e-9, "n")) if size else (1.0, "")
    )
    two = float(f"{size / scale:.2g}")
    return f"{('−' if x < 0.0 else '+') if sign else ''}{two:g} {prefix}A"


def percent_fine(x: float) -> str:
    """Return a share with enough digits near one."""
    return tenths(x) if x < 0.9995 else "more than 99.9 %"


def words(effect: str) -> str:
    """Return an effect's name as words."""
    return effect.replace("_", " ").replace("pwm", "PWM").replace("dc link", "DC link")


def names(effects: Sequence[str]) -> str:
    """Return a hypothesis as words."""
    return " + ".join(words(e) for e in effects) if effects else "no effect"


def listing(texts: Sequence[str]) -> str:
    """Return names as a sentence lists them: "a, b and c"."""
    return " and ".join(x for x in (", ".join(texts[:-1]), *texts[-1:]) if x)


def sizes(parameters: dict[str, Estimate]) -> str:
    """Return the parameters of a hypothesis as one clause."""
    return (
        ", ".join(f"{library.title(name)} {quantity(e)}" for name, e in parameters.items())
        or "no parameter"
    )


def quantity(e: Estimate) -> str:
    """Return value and interval with a unit a person uses, e.g. "1.14 µs [1.12, 1.16]"."""
    scale, prefix = 1.0, ""
    sizes = [abs(x) for x in (e.value, e.low, e.high) if math.isfinite(x) and x]
    if e.unit in PREFIXED and sizes:
        scale, prefix = next(((s, p) for s, p in PREFIXES if max(sizes) >= s), PREFIXES[-1])
    exact = e.low == e.high  # told by a file, not estimated: as many digits as it has
    value, low, high = (
        _exact(x / scale) if exact else _digits(x / scale, (e.high - e.low) / scale)
        for x in (e.value, e.low, e.high)
    )
    unit = prefix + SIGNS.get(e.unit, e.unit)
    interval = "" if exact else f" [{low}, {high}]"
    return f"{value}{' ' + unit if unit else ''}{interval}{' (at the bound of the search)' if e.at_bound else ''}"  # noqa: E501


def _exact(x: float) -> str:
    return f"{x:.6g}" if math.isfinite(x) else "∞"


def _digits(x: float, width: float) -> str:
    """Return a number with two digits of its interval's width, at least three of its own."""
    if not math.isfinite(x):
        return "∞"
    if x == 0.0:
        return "0"
    own = math.floor(math.log10(abs(x)))
    fine = math.floor(math.log10(width)) - 1 if math.isfinite(width) and width > 0.0 else own - 2
    places = max(0, min(-fine, 2 - own + 4))
    return f"{x:.{places}f}" if -5 < own < 7 else f"{x:.4g}"


def interval(value: float, low: float, high: float) -> str:
    """Return a share with its interval, to a tenth of a percent; "< 0.1 %" where that leaves
    nothing of it to see."""
    texts = [tenths(x) for x in (value, low, high)]
    return (
        "< 0.1 %"
        if value and set(texts) == {tenths(0.0)}
        else f"{texts[0]} [{texts[1]}, {texts[2]}]"
    )


def tenths(x: float) -> str:
    """Return a share in percent, to a tenth of one; nothing has no sign."""
    return "–" if not math.isfinite(x) else f"{round(100.0 * x, 1) + 0.0:.1f} %"
