"""Pages of all effects and estimators, from their cards."""

from __future__ import annotations

import ast
import math
import re
from pathlib import Path

from markdown import cell, code, table

from estimators import contract
from estimators.registry import MODULES
from model.effects.card import SUBSYSTEMS, Effect, Parameter
from model.effects.library import effect_names, load_effect, places

ROOT = Path(__file__).resolve().parents[2]
EFFECTS = """# Effects

An effect is something a real drive has and the nominal model lacks. Give it to a run with
`--effects NAME.PARAMETER=VALUE` or `simulate(..., effects={"name.parameter": value})`; let a
[diagnosis](../../explanation/diagnosis.md) look for it in recordings. Units are SI, angles are electrical unless a name
says `mech`. *Neutral* is the value that leaves the plant as it is; *typical* is a size that is common on real drives.
An effect of your own: [tutorial](../../gallery/plot_8_effect.rst).

![The drive as blocks, each with the effects that act in it](drive.svg)

Symbols in the equations (formulas have $\\phi_d, \\phi_q$ for `d`, `q`): `theta` is the rotor's electrical angle (rad),
`omega` its electrical and `w` its mechanical
speed (rad/s), `p` the number of pole pairs, `n` an order; `i` currents (A), `u` voltages (V), `R` the resistance of a
phase (ohm), `L` inductances (H) and `Gamma` = 1/L (1/H). `d` and `q` are the fluxes that the currents cause along the
magnet and across it (Wb), `psi_d` and `psi_q` all the flux there, `phi_m` the magnets' flux (Wb). `H(d, q)` is the
energy of the currents (J): its slopes by `d` and `q` are the currents along these axes. `+=`
says what an effect adds. `T_s` is the sampling period, `tau` and `t_d` times (s), `D` the duty cycle of a leg, `x` a
quantity that lags. Names with a dot, such as `dead_time.time`, are the parameters in the tables.

"""
EXPERIMENTS = r"experiment [`\1`](../../results/made/experiments.md)"
EXPERIMENT = re.compile(r"experiments/(\w+)\.py")
ESTIMATORS = """# Estimators

An estimator turns commanded voltages and measured currents into position and speed. Every estimator *believes* a model
of the motor, saturated or linear; it never knows the truth. Which one suits which motor, with the figures of the
[protocol](../../results/estimators.md), is a page of its own; an estimator of your own:
[tutorial](../../gallery/plot_7_estimator.rst).

"""


def number(value: float | None) -> str:
    """Return a number of a card in a few digits."""
    if value is None:
        return "of the motor"
    return "∞" if math.isinf(value) and value > 0 else "−∞" if math.isinf(value) else f"{value:.4g}"


def typical(p: Parameter) -> str:
    """Return a parameter's typical size in words."""
    if p.fit == "fixed" or not p.typical:
        return "–"
    return f"{p.typical:g}" + (f" × {p.relative_to}" if p.relative_to else "")


def effect(card: Effect) -> str:
    """Return the part of one effect."""
    rows = [
        (
            code(f"{card.name}.{p.name}"),
            cell(p.unit) or "1",
            number(p.neutral),
            f"{number(p.low)} … {number(p.high)}",
            cell(typical(p)),
        )
        for p in card.parameters
    ]
    text = f"### `{card.name}`\n\n{cell(card.summary)}\n\n"
    text += table(("parameter", "unit", "neutral", "allowed", "typical"), rows) + "\n"
    if card.repeats > 1:
        further = ", ".join(code(card.public(2, p.name)) for p in card.part(2).parameters)
        text += f"Up to {card.repeats} at once; the second one's parameters are {further}.\n\n"
    text += "".join(f"$$ {formula} $$\n\n" for formula in card.formulas)
    alike = ", ".join(f"[`{n}`](#{n.replace('_', '-')})" for n in card.confused_with) or "nothing"
    lines = (
        ("In words" if card.formulas else "Equation", cell(card.equation)),
        ("Enters at", "; ".join(map(cell, places(card)))),
        ("Shows", f"{cell(card.axis)}; order {cell(card.order)}; {cell(card.region)}"),
        ("Confused with", alike),
        ("Told apart by", cell(card.separated_by)),
        ("Source", EXPERIMENT.sub(EXPERIMENTS, cell(card.source))),
    )
    return text + "\n".join(f"**{head}**\n: {said}\n" for head, said in lines) + "\n"


def effects() -> str:
    """Return the page of all effects."""
    cards = [load_effect(name) for name in effect_names()]
    text = EFFECTS
    for subsystem in SUBSYSTEMS:
        text += f"## {subsystem.capitalize()}\n\n" + "".join(
            effect(c) for c in cards if c.subsystem == subsystem
        )
    return text


def card_of(tree: ast.Module) -> dict[str, str]:
    """Return what ESTIMATOR = Estimator(name, summary, ...) of a file says, without compiling the
    file."""
    (own,) = (
        n.value
        for n in tree.body
        if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "ESTIMATOR"
    )
    assert isinstance(own, ast.Call)
    found = {"summary": ast.literal_eval(own.args[1]), "injection": contract.PULSATING}
    for word in own.keywords:
        value = word.value
        found[str(word.arg)] = (
            getattr(contract, value.id) if isinstance(value, ast.Name) else ast.literal_eval(value)
        )
    return found


def estimators() -> str:
    """Return the page of all estimators; each with the text of its file, which has its
    equations."""
    text = ESTIMATORS
    for name, module in MODULES.items():
        path = f"{module.replace('.', '/')}.py"
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        card = card_of(tree)
        rows = [
            (key.capitalize(), card.get(key, ""))
            for key in ("injection", "delay", "speeds", "source")
        ]
        text += f"## `{name}`\n\n{card['summary'][:1].upper()}{cell(card['summary'])[1:]}.\n\n"
        text += "\n".join(f"**{head}**\n: {cell(said)}\n" for head, said in rows if said)
        text += f"\nWhat its file says (`{path}`):\n\n```text\n{ast.get_docstring(tree)}\n```\n\n"
    return text
