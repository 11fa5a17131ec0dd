"""What a sweep may vary: every key with its type, unit and meaning, and how a value is checked
before anything runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

from estimators.registry import MODULES
from model.errors import BadInput, as_toml, unknown
from model.mapped import ALPHAS
from model.parameters import Converter, Injection, Motor

Value = str | bool | int | float
LARGEST_SEED = 2**31 - 1
MAGNETICS = ("inductance_d", "inductance_q", *ALPHAS)
OF_BELIEF = ("resistance", "magnet_flux", *MAGNETICS, "inertia")
OF_PLANT = (*OF_BELIEF, "viscous_friction")
LARGEST_FACTOR = 100.0
HELD = ("pwm_frequency",)  # follows from sampling_period
CHOICES = {"belief": ("saturated", "linear"), "plant": ("exact", "switched")}
USUAL: dict[str, Value] = {
    "motor": "ipm_exchanged",
    "scenario": "staircase",
    "estimator": "qnull",
    "belief": "saturated",
    "closed_loop": True,
    "seed": 0,
}


@dataclass(frozen=True)
class Key:
    """One thing that a sweep may set: its type, bounds where it is a number, unit, and what it
    means."""

    kind: type
    what: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf


@cache
def keys() -> dict[str, Key]:
    """Return every key by its name, families as `family.name`."""
    from model.effects.library import parameters

    found = {
        "motor": Key(str, "name of the motor, or a TOML file"),
        "scenario": Key(
            str, "name of the scenario, or a TOML file; 'own': the one in the sweep's file"
        ),
        "estimator": Key(str, "name of the estimator, or a Python file"),
        "belief": Key(str, "which model of the motor the estimator believes: saturated or linear"),
        "plant": Key(str, "exact or switched"),
        "closed_loop": Key(bool, "whether the estimate controls; otherwise the encoder"),
        "injection_cost": Key(
            bool, "whether to work out what the injection costs (5 ms for each scored segment)"
        ),
        "seed": Key(int, "of the sensors' noise", low=0, high=LARGEST_SEED),
        "duration": Key(float, "of the scenario that is run", "s", 1e-3, 3600.0),
    }
    for kind, family, what in (
        (Motor, "motor_value", "of the motor: plant, belief and design"),
        (Converter, "drive_value", "of converter and sensors"),
        (Injection, "injection_value", "of the injection"),
    ):
        found |= {f"{family}.{n}": key for n, key in _numbers(kind, what).items()}
    factor = {"low": 0.0, "high": LARGEST_FACTOR}
    for name in OF_PLANT:
        found[f"true_factor.{name}"] = Key(
            float, f"the plant's {name} over the motor's", "1", **factor
        )
    for name in OF_BELIEF:
        found[f"believed_factor.{name}"] = Key(
            float, f"the belief's {name} over the motor's", "1", **factor
        )
    for name in ("current", "tracking", "speed"):
        found[f"bandwidth_factor.{name}"] = Key(
            float, f"bandwidth of the {name} loop over the designed one", "1", 1e-3, LARGEST_FACTOR
        )
    for name in ("load", "speed"):
        found[f"scenario_factor.{name}"] = Key(
            float, f"every {name} of the scenario times this", "1", -10.0, 10.0
        )
    for name, p in parameters().items():
        found[f"effects.{name}"] = Key(
            float, "what the plant has and the model lacks", p.unit, p.low, p.high
        )
    return found


def _numbers(kind: Any, what: str) -> dict[str, Key]:
    """Return the fields of a table that are numbers."""
    found = {}
    for f in fields(kind):
        if "low" in f.metadata and f.name not in HELD:
            number = float if str(f.type).startswith("float") else int
            found[f.name] = Key(
                number,
                f"{f.name} {what}",
                f.metadata["unit"],
                f.metadata["low"],
                f.metadata["high"],
            )
    return found


def check_key(name: str, table: str) -> Key:
    """Return a key; BadInput with the nearest one for an unknown name."""
    if name not in keys():
        family = name.partition(".")[0]
        near = [k for k in keys() if k.startswith(f"{family}.")] or list(keys())
        raise unknown(f"key in [{table}]", name, near)
    return keys()[name]


def check_value(name: str, value: object, table: str) -> Value:
    """Return a value in its key's type; BadInput says what is wrong with it."""
    key = check_key(name, table)
    said = f"[{table}] {name} = {as_toml(value)}"
    if key.kind is str:
        if not isinstance(value, str):
            raise BadInput(f"{said} is not a text; put it in quotes")
        if name in CHOICES and value not in CHOICES[name]:
            raise unknown(name, value, CHOICES[name])
        return value
    if key.kind is bool:
        if not isinstance(value, bool):
            raise BadInput(f"{said} is neither true nor false")
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise BadInput(
            f"{said} is not a finite number; give one{f' ({key.unit})' if key.unit else ''}"
        )
    if key.kind is int and value != int(value):
        raise BadInput(f"{said} is not whole; give a whole number")
    if not key.low <= value <= key.high:
        raise BadInput(
            f"{said} is out of range; give a number in [{key.low:g}, {key.high:g}] "
            f"{key.unit}".rstrip()
        )
    return int(value) if key.kind is int else float(value)


def flat(
    table: Mapping[str, Any], leaf: Any = lambda value: False, head: str = ""
) -> dict[str, Any]:
    """Return nested tables as one with keys `family.name`; leaf: tells a table that is a value."""
    found: dict[str, Any] = {}
    for name, value in table.items():
        whole = f"{head}{name}"
        if isinstance(value, Mapping) and not leaf(value):
            found |= flat(value, leaf, f"{whole}.")
        else:
            found[whole] = value
    return found


def check_names(values: Mapping[str, Iterable[Value]]) -> None:
    """Raise BadInput for motors, scenarios and estimators that cannot be used; nothing is
    downloaded before all is read.  values: what each key takes in the sweep.
    """
    from estimators.registry import load_estimator
    from model.drive_files import fetched, load_drive
    from sandbox.drive.scenario import load_scenario

    for name in values.get("estimator", ()):
        if str(name) not in MODULES:
            # a built-in one is known to load, and would bring in the compiler
            load_estimator(str(name))
    for name in values.get("scenario", ()):
        if name != "own":
            load_scenario(str(name))
    for name in sorted(map(str, values.get("motor", ())), key=fetched):
        load_drive(name)
