"""The plant's ports from the effects' cards: Python source that adds up what all effects do at each
port.

Composed whenever the plant is imported, which takes a millisecond; `python -m
sandbox.plant.compose` prints it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import textwrap
from collections.abc import Iterable
from types import ModuleType

from model.effects import own
from model.effects.card import PORTS, REPEATED, At, Effect, Port
from model.effects.library import effect_names, load_effect
from model.kernels.folders import kernel_folder

HEAD = '''"""Where effects enter the plant: what their equations add at each port, for lane j.

Composed of the effects' cards (sandbox/plant/compose.py).
"""

from __future__ import annotations

from model.compiled import inlined
{imports}
from model.lanes import one_branch, one_lag
from model.spline import currents as map_currents

__all__ = ["FURTHER", "NUMBERS", "map_currents", "one_branch", "one_lag"]
'''
RESULTS = ("x", "y", "z", "t")
LIBRARY = "model.effects"


def field(effect: str, number: str) -> str:
    """Return the name of the batch's row that holds an effect's number."""
    return f"{effect}_{number}"


def further_field(effect: str, number: str) -> str:
    """Return the name of the batch's rows that hold a number of an effect's second part, third
    part, ..."""
    return f"{effect}_further_{number}"


def source(cards: Iterable[Effect], modules: dict[str, str]) -> str:
    """Return the module's text; modules: where each effect's equations are imported from."""
    chosen = [c for c in cards if c.at]
    imports = _imports({c.name: modules[c.name] for c in sorted(chosen, key=lambda c: c.name)})
    numbers = {field(c.name, n): _unit(c, 1, n) for c in chosen for at in c.at for n in at.numbers}
    rows = "\n".join(f'    "{name}": "{unit}",' for name, unit in numbers.items())
    several = [c for c in chosen if c.repeats > 1]
    more = {
        further_field(c.name, n): c.repeats - 1
        for c in several
        for at in c.part(2).at
        for n in at.numbers
    }
    counts = "\n".join(f'    "{name}": {count},' for name, count in more.items())
    parts = [
        HEAD.format(imports=imports),
        f"NUMBERS = {{  # rows of the batch that hold effects' parameters\n{rows}\n}}\n"
        f"FURTHER = {{  # those of further parts, so many rows each\n{counts}\n}}",
    ]
    ports = [_port(name, chosen) for name in PORTS] + [_further(name, several) for name in REPEATED]
    return "\n\n".join([*parts, *ports]) + "\n"


def _imports(modules: dict[str, str]) -> str:
    """Return the lines that make effects' modules known by the effects' names."""
    library = "".join(f"    {effect},\n" for effect, module in modules.items() if module == LIBRARY)
    others = [
        f"import {module} as {effect}" for effect, module in modules.items() if module != LIBRARY
    ]
    return "\n".join([*others, f"from {LIBRARY} import (\n{library})"])


def _unit(card: Effect, part: int, number: str) -> str:
    return next(p.unit for p in card.part(part).parameters if p.name == number)


def _port(name: str, cards: list[Effect]) -> str:
    port = PORTS[name]
    args = ", ".join(("w", "j", *port.quantities))
    calls = [
        _call(c, at, [f"w.{field(c.name, n)}[j]" for n in at.numbers], port.quantities)
        for c in cards
        for at in c.at
        if at.port == name
    ]
    return f"\n@inlined\ndef {name}({args}):\n{_said(port.what)}" + _body(name, calls)


def _said(what: str) -> str:
    """Return a function's docstring, of lines that fit."""
    lines = textwrap.wrap(f'"""Return {what}."""', 96, break_on_hyphens=False)
    return textwrap.indent("\n".join(lines), "    ") + "\n"


def _further(name: str, cards: list[Effect]) -> str:
    port = PORTS[name]
    calls = [
        _call(c, at, [f"w.{further_field(c.name, n)}[k, j]" for n in at.numbers], port.quantities)
        for c in cards
        for at in c.part(2).at
        if at.port == name
    ]
    args = ", ".join(("w", "k", "j", *port.quantities))
    said = _said("the same of the k-th further part of each effect")
    return f"\n@inlined\ndef further_{name}({args}):\n{said}" + _body(name, calls)


def _call(card: Effect, at: At, numbers: list[str], quantities: tuple[str, ...]) -> str:
    return f"{card.name}.{at.equation.__name__}({', '.join([*numbers, *quantities])})"


def _body(name: str, calls: list[str]) -> str:
    port = PORTS[name]
    if port.joined == "chain":
        chained = "".join(f"    {', '.join(port.quantities)} = {call}\n" for call in calls)
        return f"{chained}    return {', '.join(port.quantities)}"
    if not calls:
        return f"    return {', '.join(['0.0'] * port.returns)}"
    if port.returns == 1:
        return f"    return {' + '.join(calls)}"
    if len(calls) == 1:
        return f"    return {calls[0]}"
    places = [f"{r}_{k}" for k in range(len(calls)) for r in RESULTS[: port.returns]]
    lines = [
        f"    {', '.join(places[k * port.returns : (k + 1) * port.returns])} = {call}\n"
        for k, call in enumerate(calls)
    ]
    return "".join(lines) + f"    return {_joined(port, len(calls))}"


def _joined(port: Port, count: int) -> str:
    """Return in words of Python what several equations at a port make together, of their results
    x_0, x_1, ..."""
    each = [", ".join(f"{r}_{k}" for r in RESULTS[: port.returns]) for k in range(count)]
    if port.joined in ("lags", "branches"):
        together, function = each[0], "one_lag" if port.joined == "lags" else "one_branch"
        for more in each[1:]:
            together = f"{function}({'*' * (together != each[0])}{together}, {more})"
        return together
    if port.joined == "last":
        return (
            " ".join(f"({each[k]}) if x_{k} > 0.0 else" for k in range(count - 1, 0, -1))
            + f" ({each[0]})"
        )
    return ", ".join(" + ".join(f"{r}_{k}" for k in range(count)) for r in RESULTS[: port.returns])


def ports_source() -> str:
    """Return the text for the effects of the library, those taken over (`model.effects.own`)
    included."""
    modules = {card.name: module for card, module in own.cards()}
    cards = [load_effect(name) for name in effect_names()]
    return source(cards, dict.fromkeys((c.name for c in cards), LIBRARY) | modules)


def ports_module() -> ModuleType:
    """Return the ports as the module `sandbox.plant.ports`; its text is kept beside the compiled
    kernels."""
    text = ports_source().encode()
    folder = kernel_folder(f"ports-{hashlib.sha256(text).hexdigest()[:16]}")
    file = folder / "ports.py"
    if not file.is_file() or file.read_bytes() != text:
        aside = folder / f"ports-{os.getpid()}.part"
        aside.write_bytes(text)
        aside.replace(file)
    spec = importlib.util.spec_from_file_location(f"{__package__}.ports", file)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    sys.stdout.write(ports_source() + "\n")
