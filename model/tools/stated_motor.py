"""A motor's file from statements of other tools and people: every value with where it comes from,
nothing hidden.

What nobody states is worked out where physics gives it, and assumed where a file cannot be without
it; both are said.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from model.errors import BadInput
from model.given import is_file
from model.parameters import Converter, Drive, Motor, build
from model.ratings import STANDS_IN, run_up_inertia
from model.tools.configurations import read_configuration
from model.tools.quantities import quantity_of
from model.tools.statements import STATEMENTS, Step, key_of, steps_of

NEEDED = {  # what no tool or law gives: how it is called, and how it is given
    "pole_pairs": ("the number of pole pairs", "pole_pairs=7"),
    "resistance": ("resistance", "resistance=0.05ohm"),
    "magnet_flux": ("magnet_flux", "kv=300"),
    "inductance_d": ("inductance_d", "inductance_d=30uH"),
    "inductance_q": ("inductance_q", "inductance_q=30uH"),
    "rated_current": ("rated_current", "current=20A"),
    "dc_bus_voltage": ("the link's voltage", "voltage=24V"),
}
BY_MAGNETS = {  # what the magnets tell, where there are some
    "rated_torque": ("rated_torque", "torque=2Nm"),
    "rated_speed_rpm": ("rated_speed_rpm", "speed=3000"),
}
PERIOD = 5e-5  # s: assumed sampling of a drive that does not say, 20 kHz
FULL = 0.9  # of the voltage at the link's end that rated speed without load may take
OTHERS = {
    "inertia": 1e-3,
    "rated_torque": 1.0,
    "rated_speed_rpm": 1000.0,
}  # inside their bounds, while others are checked
QUIET = {"current_resolution": 0.0, "current_noise": 0.0}


@dataclass(frozen=True)
class StatedMotor:
    """A drive and the conversions that made it; program: whose configuration was read ('' for
    none)."""

    drive: Drive
    steps: tuple[Step, ...]
    program: str


def stated_motor(words: Sequence[str], name: str = "motor") -> StatedMotor:
    """Return the drive of configurations (paths) and statements (KEY=VALUE), which come before what
    a file says.

    BadInput for a file of no known tool, an unknown key or unit, values that contradict each other,
    or missing ones.
    """
    stated: dict[str, str] = {}
    given: dict[str, str] = {}
    # of what a configuration states, and of what words say, as they say it
    origin: dict[str, str] = {}
    said: dict[str, str] = {}
    program = ""
    for word in words:
        key, equals, value = word.partition("=")
        if equals and not is_file(Path(word)):
            own = key_of(key)
            if own in given:
                raise BadInput(f"{own} is given twice ('{given[own]}' and '{value}'); give it once")
            given[own] = value
            said[own] = f"{key.strip()} = {value.strip()}"
        else:
            read = read_configuration(Path(word))
            if other := next((k for k, v in read.stated.items() if stated.get(k, v) != v), None):
                raise BadInput(
                    f"{word}: {read.origin[other]}, and another configuration says "
                    f"{origin[other]}; give one"
                )
            program, stated, origin = (
                read.program,
                {**stated, **read.stated},
                {**origin, **read.origin},
            )
    if not words:
        raise BadInput(
            "nothing is stated; give a configuration (VESC, ODrive, moteus, SimpleFOC) "
            "or KEY=VALUE, e.g. kv=300"
        )
    whole = {**stated, **given}
    if not {"pole_pairs", "poles"} & set(whole):
        for key, text in whole.items():  # what is wrong comes before what is missing
            quantity_of(text, STATEMENTS[key].kind, key)
        targets = {t.rpartition(".")[2] for key in whole for t in STATEMENTS[key].targets}
        _check_whole(targets, True, program)
    steps = _without_doubles(stated, given, {**origin, **said})
    values = {s.key: s.value for s in steps}
    _check_whole(values, values.get("magnet_flux", 1.0) > 0.0, program)
    return StatedMotor(_drive(steps, name), tuple(steps), program)


def _check_whole(there: Collection[str], magnets: bool, program: str) -> None:
    """Raise BadInput that names all values which are missing."""
    needed = NEEDED if magnets else NEEDED | BY_MAGNETS
    missing = {key: how for key, how in needed.items() if key not in there}
    if {"inductance_d", "inductance_q"} <= missing.keys():
        missing["inductance_d"] = ("the inductance", "inductance=30uH")
        del missing["inductance_q"]
    if not missing:
        return
    names = [name for name, _ in missing.values()]
    listed = f"{', '.join(names[:-1])} and {names[-1]} are" if names[1:] else f"{names[0]} is"
    where = f" in what {program} says" if program else ""
    if missing.keys() & BY_MAGNETS.keys():
        where += ", and there are no magnets to tell torque and speed"
    example = " ".join(how for _, how in missing.values())
    raise BadInput(f"{listed} missing{where}; give {'them' if names[1:] else 'it'}, e.g. {example}")


def _without_doubles(
    stated: dict[str, str], given: dict[str, str], origin: dict[str, str]
) -> list[Step]:
    """Return the conversions, those given by hand in place of a file's of the same value."""
    count = {k: v for k, v in (given or stated).items() if k in ("pole_pairs", "poles")}
    count = count or {k: v for k, v in stated.items() if k in ("pole_pairs", "poles")}
    by_hand = steps_of({**count, **given}, origin)
    taken = {(s.table, s.key) for s in by_hand if s.key != "pole_pairs"}
    rest = {k: v for k, v in stated.items() if k not in ("pole_pairs", "poles")}
    of_file = [
        s
        for s in steps_of({**count, **rest}, origin)
        if (s.table, s.key) not in taken and s.key != "pole_pairs"
    ]
    return [*by_hand, *of_file]


def _drive(steps: list[Step], name: str) -> Drive:
    motor = {s.key: s.value for s in steps if s.table == "motor"}
    drive = {s.key: s.value for s in steps if s.table == "drive"}
    _in_bounds(steps, motor, drive)
    _fill(steps, motor, drive)
    values = {**motor, "pole_pairs": int(motor["pole_pairs"]), "name": name}
    converter = QUIET | drive
    rated = float(motor["rated_current"])
    for key, share in (("current_resolution", 0.002), ("current_noise", 0.0017)):
        converter[key] = share * rated
        steps.append(
            Step("drive", key, share * rated, f"assumed: {100 * share:g} % of rated current")
        )
    built = build(Motor, values, "motor"), build(Converter, converter, "drive")
    from model.drive_files import injection_defaults
    from model.parameters import Injection

    injection = build(Injection, injection_defaults(*built), "injection")
    return Drive(*built, injection, {s.key: s.said for s in steps})


def _in_bounds(steps: list[Step], motor: dict[str, float], drive: dict[str, float]) -> None:
    """Check what is stated by the bounds of a motor's file, before anything is worked out of it."""
    try:
        build(
            Motor,
            {**OTHERS, **motor, "pole_pairs": int(motor["pole_pairs"]), "name": "motor"},
            "motor",
        )
        period = 1.0 / drive["pwm_frequency"] if "pwm_frequency" in drive else PERIOD
        build(Converter, {**QUIET, "sampling_period": period, **drive}, "drive")
    except BadInput as error:
        said = next((s.said for s in steps if f"{s.key} = " in str(error)), "")
        raise BadInput(f"{error} (from '{said}')" if said else str(error)) from None


def _fill(steps: list[Step], motor: dict[str, float], drive: dict[str, float]) -> None:
    """Add what physics gives, and what has to be assumed."""

    def add(table: str, key: str, value: float, said: str) -> None:
        """Add a value to a table, with what it comes from."""
        (motor if table == "motor" else drive)[key] = value
        steps.append(Step(table, key, value, said))

    flux, pairs, current = motor["magnet_flux"], motor["pole_pairs"], motor["rated_current"]
    if "rated_torque" not in motor:
        add(
            "motor",
            "rated_torque",
            1.5 * pairs * flux * current,
            "3/2 pole_pairs magnet_flux rated_current",
        )
    if "rated_speed_rpm" not in motor:
        omega = FULL * drive["dc_bus_voltage"] / math.sqrt(3.0) / flux / pairs
        add(
            "motor",
            "rated_speed_rpm",
            omega * 30.0 / math.pi,
            f"{100 * FULL:g} % of the link's voltage is back-EMF there",
        )
    if "inertia" not in motor:
        add(
            "motor",
            "inertia",
            run_up_inertia(motor["rated_torque"], motor["rated_speed_rpm"]),
            f"assumed: {STANDS_IN}; free rotors alone use it",
        )
    if "sampling_period" not in drive:
        period = 1.0 / drive["pwm_frequency"] if "pwm_frequency" in drive else PERIOD
        add(
            "drive",
            "sampling_period",
            period,
            "1 / pwm_frequency" if "pwm_frequency" in drive else "assumed: 20 kHz",
        )
