"""Configurations of drives as their tools write them: VESC, ODrive, moteus, SimpleFOC; into statements of a motor.

Where each key comes from: VESC firmware (`datatypes.h`, `mcpwm_foc.c`: L is the mean of L_d and L_q, which lie half of
`foc_motor_ld_lq_diff` beside it; centre-aligned PWM at half of `foc_f_zv`), ODrive's reference (phase values, torque
constant 8.27 / Kv), moteus' reference (`v_per_hz`: phase peak V per mechanical Hz), SimpleFOC's documentation
(BLDCMotor(pole pairs, phase resistance, Kv, phase inductance)).  Gains: VESC foc_current_kp, foc_current_ki (V/A,
V/(A s)), and foc_dt_us, which corrects the voltage that its observer sees and that it reports, not the switching;
ODrive current_control_bandwidth (rad/s); moteus servo.pid_dq, in newer firmware servo.pid_dq_hz (Hz, of both axes:
docs/reference/configuration.md); SimpleFOC PID_current_q.  Not checked on the drives themselves.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from model.errors import BadInput
from model.given import given_bytes

MOST = 4_000_000  # bytes of a configuration
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
DEFINED = re.compile(rf"^\s*#\s*define\s+MCCONF_(\w+)\s+\(?({NUMBER})f?\)?", re.MULTILINE)
ASSIGNED = re.compile(
    rf"^\s*(?:conf\s+set\s+)?([A-Za-z_][\w.\[\]]*)\s*[=: \t]\s*({NUMBER})\s*f?\s*[;,]?\s*(?:(?://|#).*)?$", re.MULTILINE
)
SIMPLE = re.compile(rf"BLDCMotor\s*\w*\s*(?:=\s*BLDCMotor\s*)?\(\s*({NUMBER})((?:\s*,\s*(?:{NUMBER}|NOT_SET)f?)*)\s*\)")
OF_ODRIVE = ("phase_resistance", "phase_inductance", "torque_constant")
VECTOR = 1.0 / (2.0 * math.pi)
# Seconds that a leg loses, for each of VESC's foc_dt_us: update_valpha_vbeta takes foc_dt_us foc_f_zv times 2/3 of the
# link off a leg; a leg that loses t once a PWM period, of 2 / foc_f_zv, loses t foc_f_zv / 2 of the link.
VESC_DEAD_TIME = 4.0 / 3.0


class Configuration(NamedTuple):
    """What program wrote it; statements: key of `model.tools.statements`, quantity as text; control: the current loop's
    current_kp (V/A), current_ki (V/(A s)), bandwidth (rad/s), and dead_time (s) of legs, taken off the voltage that is
    reported, as far as stated."""

    program: str
    stated: dict[str, str]
    control: dict[str, float]


def read_configuration(path: Path) -> Configuration:
    """Return what a tool's configuration states of the motor; BadInput where it is of none of the known tools."""
    remedy = "give a configuration of VESC, ODrive, moteus or SimpleFOC, or KEY=VALUE"
    text = given_bytes(path, MOST, remedy).decode("utf-8-sig", errors="replace")
    numbers = _numbers(text)
    for program in PROGRAMS:
        if any(_last(numbers, key) is not None for key in program.known_by):
            stated = {k: v for k, v in program.convert(numbers).items() if v}
            if stated:
                control = {k: v for k, v in program.control(numbers).items() if v is not None}
                return Configuration(program.name, stated, control)
    raise BadInput(f"{path.name}: nothing of a motor is known in it; {remedy}")


def _numbers(text: str) -> dict[str, float]:
    """Return a configuration's numbers by their lower-case name, dots between levels."""
    head = text.lstrip()[:1]
    if head == "<" and "<!DOCTYPE" not in text and "<!ENTITY" not in text:
        try:
            root = ElementTree.fromstring(text)
        except (ElementTree.ParseError, ValueError) as error:
            raise BadInput(f"a configuration that is no whole XML ({error}); export it again") from None
        return {e.tag.lower(): x for e in root.iter() if (x := _float(e.text)) is not None}
    if head == "{":
        try:
            return dict(_flat(json.loads(text), ""))
        except (ValueError, RecursionError) as error:
            raise BadInput(f"a configuration that is no whole JSON ({error}); export it again") from None
    out = {m[1].lower(): float(m[2]) for m in ASSIGNED.finditer(text)}
    out |= {m[1].lower(): float(m[2]) for m in DEFINED.finditer(text)}
    if found := SIMPLE.search(text):
        rest = [_float(x.strip().rstrip("f")) for x in found[2].split(",")[1:]]
        names = ("simplefoc.r", "simplefoc.kv", "simplefoc.l")
        out |= {"simplefoc.p": float(found[1])} | {n: x for n, x in zip(names, rest, strict=False) if x is not None}
    return out


def _flat(tree: Any, above: str) -> list[tuple[str, float]]:
    out: list[tuple[str, float]] = []
    for key, value in tree.items() if isinstance(tree, dict) else ():
        name = f"{above}.{key}".strip(".").lower()
        if isinstance(value, dict):
            out += _flat(value, name)
        elif (x := _float(value)) is not None:
            out.append((name, x))
    return out


def _float(value: Any) -> float | None:
    if isinstance(value, bool):
        return None
    try:
        x = float(value)
    except (TypeError, ValueError):
        return None
    return x if math.isfinite(x) else None


def _last(numbers: Mapping[str, float], *names: str) -> float | None:
    """Return the number whose dotted name ends with one of these, the first of them that is there."""
    for name in names:
        for own, value in numbers.items():
            if own == name or own.endswith(f".{name}"):
                return value
    return None


def _text(value: float | None, unit: str = "") -> str:
    return "" if value is None or value <= 0.0 else f"{value:.10g} {unit}".strip()


def _vesc(n: Mapping[str, float]) -> dict[str, str]:
    mean, off = _last(n, "foc_motor_l"), _last(n, "foc_motor_ld_lq_diff") or 0.0
    zero = _last(n, "foc_f_zv")
    speed, poles = _last(n, "l_max_erpm", "l_rpm_max"), _last(n, "si_motor_poles")
    cells = _last(n, "si_battery_cells")
    out = {
        "poles": _text(poles), "resistance": _text(_last(n, "foc_motor_r"), "ohm"),
        "magnet_flux": _text(_last(n, "foc_motor_flux_linkage"), "Wb"),
        "rated_current": _text(_last(n, "l_current_max"), "A"),
        "rated_speed_rpm": _text(speed / (0.5 * poles) if speed and poles and speed < 99_000 else None, "rpm"),
        "dc_bus_voltage": _text(3.7 * cells if cells else None, "V"),
        "sampling_period": _text(2.0 / zero if zero else None, "s"),
        "pwm_frequency": _text(zero / 2.0 if zero else None, "Hz"),
    }  # fmt: skip
    if mean is None:
        return out
    return out | {"inductance_d": _text(mean - 0.5 * off, "H"), "inductance_q": _text(mean + 0.5 * off, "H")}


def _odrive(n: Mapping[str, float]) -> dict[str, str]:
    speed = _last(n, "config.vel_limit", "controller.config.vel_limit")
    return {
        "pole_pairs": _text(_last(n, "pole_pairs")), "resistance": _text(_last(n, "phase_resistance"), "ohm"),
        "inductance": _text(_last(n, "phase_inductance"), "H"),
        "torque_constant": _text(_last(n, "torque_constant"), "Nm/A"),
        "rated_current": _text(_last(n, "current_soft_max", "current_lim"), "A"),
        "rated_speed_rpm": _text(60.0 * speed if speed else None, "rpm"),
    }  # fmt: skip


def _moteus(n: Mapping[str, float]) -> dict[str, str]:
    poles = _last(n, "poles")
    per_hz, flux, kv = _last(n, "v_per_hz"), _last(n, "fit.lambda_m"), _last(n, "motor.kv", "calibration.kv", "kv")
    if per_hz is None and kv:
        per_hz = 30.0 / kv
    if flux is None and per_hz and poles:
        flux = per_hz * VECTOR / (0.5 * poles)
    rate = _last(n, "pwm_rate_hz")
    both = _last(n, "cal_inductance_d_h", "calibration.inductance", "winding_inductance", "inductance")
    d = _last(n, "fit.b", "motor.inductance_d_h") or both
    levels = [float(m[1]) for name in n if (m := re.match(rf"regressions\.({NUMBER})\.slope$", name))]
    swept = max(map(abs, levels), default=None)  # a sweep of d-currents went so far
    return {
        "poles": _text(poles),
        "resistance": _text(_last(n, "motor.resistance_ohm", "params.r", "winding_resistance"), "ohm"),
        "magnet_flux": _text(flux, "Wb"), "inductance_d": _text(d, "H"),
        "inductance_q": _text(_last(n, "motor.inductance_q_h") or d, "H"),
        "rated_current": _text(_last(n, "max_current_a") or swept, "A"), "pwm_frequency": _text(rate, "Hz"),
        "sampling_period": _text(1.0 / rate if rate else None, "s"),
    }  # fmt: skip


def _simplefoc(n: Mapping[str, float]) -> dict[str, str]:
    speed = _last(n, "motor.velocity_limit")
    return {
        "pole_pairs": _text(_last(n, "simplefoc.p", "motor.pole_pairs")),
        "resistance": _text(_last(n, "motor.phase_resistance", "simplefoc.r"), "ohm"),
        "kv": _text(_last(n, "motor.kv_rating", "simplefoc.kv"), "rpm/V"),
        "inductance": _text(_last(n, "motor.phase_inductance", "simplefoc.l"), "H"),
        "rated_current": _text(_last(n, "motor.current_limit"), "A"),
        "dc_bus_voltage": _text(_last(n, "driver.voltage_power_supply"), "V"),
        "pwm_frequency": _text(_last(n, "driver.pwm_frequency"), "Hz"),
        "rated_speed_rpm": _text(speed * 30.0 / math.pi if speed else None, "rpm"),
    }  # fmt: skip


def _vesc_control(n: Mapping[str, float]) -> dict[str, float | None]:
    lost = _last(n, "foc_dt_us")
    return {
        "current_kp": _last(n, "foc_current_kp"), "current_ki": _last(n, "foc_current_ki"),
        "dead_time": None if lost is None else VESC_DEAD_TIME * 1e-6 * lost,
    }  # fmt: skip


def _odrive_control(n: Mapping[str, float]) -> dict[str, float | None]:
    return {"bandwidth": _last(n, "current_control_bandwidth")}


def _moteus_control(n: Mapping[str, float]) -> dict[str, float | None]:
    rate = _last(n, "pid_dq_hz")
    return {
        "current_kp": _last(n, "pid_dq.kp"), "current_ki": _last(n, "pid_dq.ki"),
        "bandwidth": None if rate is None else math.tau * rate,
    }  # fmt: skip


def _simplefoc_control(n: Mapping[str, float]) -> dict[str, float | None]:
    return {"current_kp": _last(n, "pid_current_q.p"), "current_ki": _last(n, "pid_current_q.i")}


class Program(NamedTuple):
    """A tool: its name, by which keys its configuration is known, how they become statements, and its control."""

    name: str
    known_by: tuple[str, ...]
    convert: Callable[[Mapping[str, float]], dict[str, str]]
    control: Callable[[Mapping[str, float]], dict[str, float | None]]


PROGRAMS = (
    Program("VESC", ("foc_motor_r", "foc_motor_l", "foc_motor_flux_linkage"), _vesc, _vesc_control),
    Program(
        "ODrive",
        tuple(f"{where}.{n}" for where in ("motor.config", "config.motor") for n in OF_ODRIVE),
        _odrive,
        _odrive_control,
    ),
    Program("SimpleFOC", ("simplefoc.p", "motor.phase_resistance", "motor.kv_rating"), _simplefoc, _simplefoc_control),
    Program(
        "moteus", ("v_per_hz", "motor.poles", "motor.resistance_ohm", "winding_resistance"), _moteus, _moteus_control
    ),
)
