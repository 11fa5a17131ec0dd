"""What may be stated of a motor, and how each statement becomes a value of [motor] or [drive].

A statement is key = quantity, as a person, a data sheet or a tool's configuration gives it.
Equations, with p pole pairs and amplitude-invariant vectors:

    between two terminals R_ll = 2 R, L_ll = 2 L at standstill;  rms: peak = sqrt(2) rms;
    Kv (rpm per V between terminals, peak, without load): psi = 1 / (sqrt(3) p Kv);
    back-EMF constant K_e (V between terminals, peak, per mechanical rad/s): psi = K_e / (sqrt(3)
    p); torque constant (N m per A of peak current): psi = K_t / (3/2 p); per A rms it is sqrt(2)
    larger.

Checked: two statements of one motor give one flux (tests); ODrive's torque constant is 8.27 / Kv
(its documentation).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from model.errors import BadInput, brief, unknown
from model.tools.quantities import RPM, Quantity, quantity_of

ROOT_3, ROOT_2 = math.sqrt(3.0), math.sqrt(2.0)


class Given(NamedTuple):
    """A statement in numbers: its key, the value, its unit as written or else ours ('': none), and
    whether it is an rms value."""

    key: str
    value: float
    unit: str
    rms: bool


class Step(NamedTuple):
    """One conversion: the value of the motor's file that it gives, it in words, and the statement
    behind it (None: worked out or assumed)."""

    table: str
    key: str
    value: float
    said: str
    given: Given | None = None

    @property
    def unit(self) -> str:
        """Its unit in the file."""
        return UNIT_OF.get(self.key, "")


class Statement(NamedTuple):
    """What a key says: unit's kind, the values that it gives ([table], key), the factor (of pole
    pairs) to them, the factor in words, whether the value is one over it, and whether its current
    (or voltage) stands below the line."""

    kind: str
    targets: tuple[str, ...]
    factor: Callable[[float], float] = lambda p: 1.0
    said: str = ""
    inverse: bool = False
    below: bool = False


PLAIN = {
    "pole_pairs": Statement("", ("pole_pairs",)),
    "resistance": Statement("ohm", ("resistance",)),
    "magnet_flux": Statement("Wb", ("magnet_flux",)),
    "inductance": Statement("H", ("inductance_d", "inductance_q")),
    "inductance_d": Statement("H", ("inductance_d",)),
    "inductance_q": Statement("H", ("inductance_q",)),
    "inertia": Statement("kg m^2", ("inertia",)),
    "rated_current": Statement("A", ("rated_current",)),
    "rated_torque": Statement("N m", ("rated_torque",)),
    "rated_speed_rpm": Statement("rpm", ("rated_speed_rpm",)),
    "dc_bus_voltage": Statement("V", ("drive.dc_bus_voltage",)),
    "sampling_period": Statement("s", ("drive.sampling_period",)),
    "pwm_frequency": Statement("Hz", ("drive.pwm_frequency",)),
}
UNIT_OF = {target.rpartition(".")[2]: s.kind for s in PLAIN.values() for target in s.targets}
UNIT_OF |= dict.fromkeys(("current_resolution", "current_noise"), "A")
STATEMENTS = PLAIN | {
    "poles": Statement("", ("pole_pairs",), lambda p: 0.5, "half of the poles"),
    "resistance_ll": Statement(
        "ohm", ("resistance",), lambda p: 0.5, "half of the value between two terminals"
    ),
    "inductance_ll": Statement(
        "H",
        ("inductance_d", "inductance_q"),
        lambda p: 0.5,
        "half of the value between two terminals",
    ),
    "kv": Statement(
        "rpm/V",
        ("magnet_flux",),
        lambda p: 1.0 / (ROOT_3 * p * RPM),
        "1 / (sqrt(3) pole_pairs Kv), Kv in rad/s",
        True,
        True,
    ),
    "back_emf": Statement(
        "V s/rad", ("magnet_flux",), lambda p: 1.0 / (ROOT_3 * p), "K_e / (sqrt(3) pole_pairs)"
    ),
    "torque_constant": Statement(
        "N m/A",
        ("magnet_flux",),
        lambda p: 1.0 / (1.5 * p),
        "torque constant / (3/2 pole_pairs)",
        below=True,
    ),
}
OTHER_NAMES = {
    "p": "pole_pairs",
    "r": "resistance",
    "rs": "resistance",
    "r_phase": "resistance",
    "l": "inductance",
    "ld": "inductance_d",
    "l_d": "inductance_d",
    "lq": "inductance_q",
    "l_q": "inductance_q",
    "flux": "magnet_flux",
    "psi": "magnet_flux",
    "lambda": "magnet_flux",
    "r_ll": "resistance_ll",
    "rll": "resistance_ll",
    "l_ll": "inductance_ll",
    "lll": "inductance_ll",
    "ke": "back_emf",
    "k_e": "back_emf",
    "kt": "torque_constant",
    "k_t": "torque_constant",
    "j": "inertia",
    "current": "rated_current",
    "torque": "rated_torque",
    "speed": "rated_speed_rpm",
    "rated_speed": "rated_speed_rpm",
    "voltage": "dc_bus_voltage",
    "link": "dc_bus_voltage",
    "u_dc": "dc_bus_voltage",
    "pwm": "pwm_frequency",
    "k_v": "kv",
}


def key_of(name: str) -> str:
    """Return a statement's key by its name or one of its other ones; BadInput with the nearest."""
    plain = name.strip().lower().replace("-", "_").replace(" ", "_")
    key = OTHER_NAMES.get(plain, plain)
    if key not in STATEMENTS:
        raise unknown("value of a motor", name, [*STATEMENTS, *OTHER_NAMES])
    return key


def steps_of(stated: Mapping[str, str], origin: Mapping[str, str] | None = None) -> list[Step]:
    """Return the conversions of statements (key as in STATEMENTS: quantity as written); BadInput
    where two contradict each other, or pole pairs are missing.  origin: what a configuration says
    in place of a statement, by key."""
    pairs = _pairs(stated)
    out: list[Step] = []
    for key, text in stated.items():
        statement, given = STATEMENTS[key], quantity_of(text, STATEMENTS[key].kind, key)
        if given.value < 0.0:
            raise BadInput(f"{key} = {brief(text)} is negative; give its size")
        if given.value == 0.0 and key != "magnet_flux":
            raise BadInput(f"{key} = {brief(text)} must be above 0")
        for step in _steps(key, statement, given, pairs, (origin or {}).get(key)):
            _same(out, step)
            out.append(step)
    return out


def _pairs(stated: Mapping[str, str]) -> float:
    for key, factor in (("pole_pairs", 1.0), ("poles", 0.5)):
        if key in stated:
            pairs = factor * quantity_of(stated[key], "", key).value
            if pairs != int(pairs) or pairs < 1:
                raise BadInput(
                    f"{key} = {brief(stated[key])} makes {pairs:g} pole pairs; give a "
                    "whole number of pairs"
                )
            return pairs
    raise BadInput("the number of pole pairs is missing; give it, e.g. pole_pairs=7 (or poles=14)")


def _steps(key: str, s: Statement, given: Quantity, pairs: float, origin: str | None) -> list[Step]:
    value, said = given.value, []
    if given.rms:
        value = value / ROOT_2 if s.below else value * ROOT_2
        said.append("1/sqrt(2) for rms" if s.below and not s.inverse else "sqrt(2) for rms")
    value = s.factor(pairs) / value if s.inverse else s.factor(pairs) * value
    said += [s.said] if s.said else []
    how = f": {', '.join(said)}" if said else ""
    steps = []
    for target in s.targets:
        table, _, name = target.rpartition(".")
        steps.append(
            Step(
                table or "motor",
                name,
                value,
                f"{origin or f'{key} = {given.written}'}{how}",
                Given(key, given.number, given.unit or s.kind, given.rms),
            )
        )
    return steps


def _same(out: list[Step], step: Step) -> None:
    """Raise BadInput where a value is given twice and differently."""
    for other in out:
        if (other.table, other.key) == (step.table, step.key) and not math.isclose(
            other.value, step.value, rel_tol=0.02
        ):
            raise BadInput(
                f"{step.key}: '{other.said}' gives {other.value:.4g}, '{step.said}' "
                f"gives {step.value:.4g}; give one"
            )
