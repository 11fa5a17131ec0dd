"""Configurations of drives as their tools write them: VESC, ODrive, moteus, SimpleFOC; into
statements of a motor.

Where each key comes from: VESC firmware (`datatypes.h`, `mcpwm_foc.c`: L is the mean of L_d and
L_q, which lie half of `foc_motor_ld_lq_diff` beside it; centre-aligned PWM at half of `foc_f_zv`),
ODrive's reference (phase values, torque constant 8.27 / Kv), moteus' reference (`v_per_hz`: phase
peak V per mechanical Hz), SimpleFOC's documentation (BLDCMotor(pole pairs, phase resistance, Kv,
phase inductance)).  Gains: VESC foc_current_kp, foc_current_ki (V/A, V/(A s)), and foc_dt_us, which
corrects the voltage that its observer sees and that it reports, not the switching; ODrive
current_control_bandwidth (rad/s); moteus servo.pid_dq, in newer firmware servo.pid_dq_hz (Hz, of
both axes: docs/reference/configuration.md); SimpleFOC PID_current_q.  Not checked on the drives
themselves.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from model.errors import BadInput
from model.given import given_bytes
from model.tools.written_numbers import NUMBER, numbers_of

MAX_BYTES = 4_000_000  # bytes of a configuration
AXIS = re.compile(r"(?:^|\.)(axis\d+)\.")
OF_ODRIVE = ("phase_resistance", "phase_inductance", "torque_constant")
VECTOR = 1.0 / (2.0 * math.pi)
# Seconds that a leg loses, for each of VESC's foc_dt_us: update_valpha_vbeta takes foc_dt_us
# foc_f_zv times 2/3 of the link off a leg; a leg that loses t once a PWM period, of 2 / foc_f_zv,
# loses t foc_f_zv / 2 of the link.
VESC_DEAD_TIME = 4.0 / 3.0


class Configuration(NamedTuple):
    """What program wrote it; statements: key of `model.tools.statements`, quantity as text;
    control: the current loop's current_kp (V/A), current_ki (V/(A s)), bandwidth (rad/s), and
    dead_time (s) of legs, taken off the voltage that is reported, as far as stated; origin: of each
    statement, the configuration's own names and numbers, and the law."""

    program: str
    stated: dict[str, str]
    control: dict[str, float]
    origin: dict[str, str]


class StatedNumber(NamedTuple):
    """A number in a unit, and which names and numbers of a configuration give it."""

    value: float
    unit: str
    origin: str


def read_configuration(path: Path) -> Configuration:
    """Return what a tool's configuration states of the motor; BadInput where it is of none of the
    known tools, or of two motors."""
    remedy = "give a configuration of VESC, ODrive, moteus or SimpleFOC, or KEY=VALUE"
    text = given_bytes(path, MAX_BYTES, remedy).decode("utf-8-sig", errors="replace")
    numbers = _one_axis(path.name, numbers_of(text, path.name))
    for program in PROGRAMS:
        if any(_last(numbers, key) is not None for key in program.known_by):
            stated = {k: t for k, t in program.convert(numbers).items() if t}
            for key, t in stated.items():
                if not math.isfinite(t.value):
                    raise BadInput(
                        f"{path.name}: {t.origin}, which is no finite number; measure it again and "
                        f"save the configuration, or write the number there ({key} comes from it)"
                    )
            quantities = {k: t for k, t in stated.items() if t.value > 0.0}
            if quantities:
                control = {k: v for k, v in program.control(numbers).items() if v is not None}
                written = {k: f"{t.value!r} {t.unit}".strip() for k, t in quantities.items()}
                return Configuration(
                    program.name, written, control, {k: t.origin for k, t in quantities.items()}
                )
    raise BadInput(f"{path.name}: nothing of a motor is known in it; {remedy}")


def _one_axis(file: str, numbers: dict[str, float]) -> dict[str, float]:
    """Return a configuration without the axes that drive no motor; BadInput where two drive motors
    that differ."""
    axes: dict[str, dict[str, float]] = {}
    for name, value in numbers.items():
        if found := AXIS.search(name):
            axes.setdefault(found[1], {})[name.rpartition(".")[2]] = value
    measured = {a: own for a, own in axes.items() if own.get("phase_resistance", 0.0) > 0.0}
    of_motor = [{n: own.get(n) for n in (*OF_ODRIVE, "pole_pairs")} for own in measured.values()]
    if any(other != of_motor[0] for other in of_motor[1:]):
        raise BadInput(
            f"{file} holds {len(measured)} motors that differ ({', '.join(measured)}); "
            "leave the lines of one in a copy"
        )
    kept = next(iter(measured), None)
    return {
        n: v
        for n, v in numbers.items()
        if kept is None or not (m := AXIS.search(n)) or m[1] == kept
    }


def _last(numbers: Mapping[str, float], *names: str) -> float | None:
    """Return the number whose dotted name ends with one of these, the first of them that is
    there."""
    for name in names:
        for own, value in numbers.items():
            if own == name or own.endswith(f".{name}"):
                return value
    return None


def _entry(
    n: Mapping[str, float], names: str, unit: str = "", factor: float = 1.0, law: str = ""
) -> StatedNumber | None:
    """Return what the first of some names (a blank between) says, times a factor (its law in
    words), in a unit."""
    for name in names.split():
        if (value := _last(n, name)) is not None:
            said = f"{name.removeprefix('bldcmotor.')} = {value:.6g}"
            return StatedNumber(
                factor * value, unit, f"{said}, {law}" if law else f"{said} {unit}".strip()
            )
    return None


def _vesc(n: Mapping[str, float]) -> dict[str, StatedNumber | None]:
    mean, off = _last(n, "foc_motor_l"), _last(n, "foc_motor_ld_lq_diff") or 0.0
    speed, poles = _last(n, "l_max_erpm") or _last(n, "l_rpm_max"), _last(n, "si_motor_poles")
    zero = "foc_f_zv foc_f_sw"  # the older firmware's name
    out = {
        "poles": _entry(n, "si_motor_poles"),
        "resistance": _entry(n, "foc_motor_r", "ohm"),
        "magnet_flux": _entry(n, "foc_motor_flux_linkage", "Wb"),
        "rated_current": _entry(n, "l_current_max", "A"),
        "dc_bus_voltage": _entry(n, "si_battery_cells", "V", 3.7, "3.7 V a cell"),
        "pwm_frequency": _entry(n, zero, "Hz", 0.5, "half of it: centre-aligned"),
    }
    if (pwm := out["pwm_frequency"]) and pwm.value > 0.0:
        out["sampling_period"] = StatedNumber(1.0 / pwm.value, "s", "1 / pwm_frequency")
    if speed and poles and speed < 99_000:
        out["rated_speed_rpm"] = StatedNumber(
            speed / (0.5 * poles), "rpm", f"largest erpm = {speed:.6g} / pole pairs"
        )
    if mean is not None:
        both = f" (foc_motor_l = {mean:.6g} H, foc_motor_ld_lq_diff = {off:.6g} H)"
        out["inductance_d"] = StatedNumber(
            mean - 0.5 * off, "H", f"L - diff/2{both}" if off else f"foc_motor_l = {mean:.6g} H"
        )
        out["inductance_q"] = StatedNumber(
            mean + 0.5 * off, "H", f"L + diff/2{both}" if off else f"foc_motor_l = {mean:.6g} H"
        )
    return out


def _odrive(n: Mapping[str, float]) -> dict[str, StatedNumber | None]:
    return {
        "pole_pairs": _entry(n, "pole_pairs"),
        "resistance": _entry(n, "phase_resistance", "ohm"),
        "inductance": _entry(n, "phase_inductance", "H"),
        "torque_constant": _entry(n, "torque_constant", "Nm/A"),
        "rated_current": _entry(n, "current_soft_max current_lim", "A"),
        "rated_speed_rpm": _odrive_speed(n),
    }


def _odrive_speed(n: Mapping[str, float]) -> StatedNumber | None:
    """Return the limit of speed: turns/s, before firmware 0.5, which has no torque constant,
    counts/s of the encoder."""
    said, turn = "turns/s: a limit, perhaps below the rating", 1.0
    if _last(n, "torque_constant") is None and (turn := _last(n, "encoder.config.cpr") or 0.0):
        said = f"counts/s of an encoder of {turn:.6g}: a limit, perhaps below the rating"
    names = "config.vel_limit controller.config.vel_limit"
    return _entry(n, names, "rpm", 60.0 / turn, said) if turn else None


def _moteus(n: Mapping[str, float]) -> dict[str, StatedNumber | None]:
    poles = _last(n, "poles")
    flux = _entry(n, "fit.lambda_m", "Wb")
    if flux is None and poles:
        pairs = 0.5 * poles
        flux = _entry(
            n, "v_per_hz", "Wb", VECTOR / pairs, "V of a phase per Hz: / (2 pi pole pairs)"
        )
        kv = _last(n, "motor.kv") or _last(n, "calibration.kv") or _last(n, "kv")
        if flux is None and kv:
            flux = StatedNumber(
                30.0 / kv * VECTOR / pairs,
                "Wb",
                f"Kv = {kv:.6g} by moteus' law: 30 / (Kv 2 pi pole pairs)",
            )
    both = "cal_inductance_d_h calibration.inductance winding_inductance inductance"
    d = _entry(n, f"fit.b motor.inductance_d_h {both}", "H")
    levels = [
        float(m[1]) for name in n if (m := re.match(rf"regressions\.({NUMBER})\.slope$", name))
    ]
    swept = max(map(abs, levels), default=None)
    rate = _entry(n, "pwm_rate_hz", "Hz")
    return {
        "poles": _entry(n, "poles"),
        "resistance": _entry(n, "motor.resistance_ohm params.r winding_resistance", "ohm"),
        "magnet_flux": flux,
        "inductance_d": d,
        "inductance_q": _entry(n, "motor.inductance_q_h", "H") or d,
        "rated_current": _entry(n, "max_current_a", "A")
        or (
            StatedNumber(swept, "A", f"the sweep of d-currents went to {swept:.6g} A")
            if swept
            else None
        ),
        "pwm_frequency": rate,
        "sampling_period": StatedNumber(1.0 / rate.value, "s", "1 / pwm_rate_hz")
        if rate and rate.value > 0.0
        else None,
    }


def _simplefoc(n: Mapping[str, float]) -> dict[str, StatedNumber | None]:
    return {
        "pole_pairs": _entry(n, "bldcmotor.pole_pairs motor.pole_pairs"),
        "resistance": _entry(n, "motor.phase_resistance bldcmotor.phase_resistance", "ohm"),
        "kv": _entry(n, "motor.kv_rating bldcmotor.kv", "rpm/V"),
        "inductance": _entry(n, "motor.phase_inductance bldcmotor.phase_inductance", "H"),
        "inductance_d": _entry(n, "motor.axis_inductance.d", "H"),
        "inductance_q": _entry(n, "motor.axis_inductance.q", "H"),
        "rated_current": _entry(n, "motor.current_limit", "A"),
        "dc_bus_voltage": _entry(n, "driver.voltage_power_supply", "V"),
        "pwm_frequency": _entry(n, "driver.pwm_frequency", "Hz"),
        "rated_speed_rpm": _entry(
            n,
            "motor.velocity_limit",
            "rpm",
            30.0 / math.pi,
            "rad/s: a limit, perhaps below the rating",
        ),
    }


def _vesc_control(n: Mapping[str, float]) -> dict[str, float | None]:
    lost = _last(n, "foc_dt_us")
    return {
        "current_kp": _last(n, "foc_current_kp"),
        "current_ki": _last(n, "foc_current_ki"),
        "dead_time": None if lost is None else VESC_DEAD_TIME * 1e-6 * lost,
    }


def _odrive_control(n: Mapping[str, float]) -> dict[str, float | None]:
    return {"bandwidth": _last(n, "current_control_bandwidth")}


def _moteus_control(n: Mapping[str, float]) -> dict[str, float | None]:
    rate = _last(n, "pid_dq_hz")
    return {
        "current_kp": _last(n, "pid_dq.kp"),
        "current_ki": _last(n, "pid_dq.ki"),
        "bandwidth": None if rate is None else math.tau * rate,
    }


def _simplefoc_control(n: Mapping[str, float]) -> dict[str, float | None]:
    return {"current_kp": _last(n, "pid_current_q.p"), "current_ki": _last(n, "pid_current_q.i")}


class Program(NamedTuple):
    """A tool: its name, by which keys its configuration is known, how they become statements, and
    its control."""

    name: str
    known_by: tuple[str, ...]
    convert: Callable[[Mapping[str, float]], dict[str, StatedNumber | None]]
    control: Callable[[Mapping[str, float]], dict[str, float | None]]


PROGRAMS = (
    Program("VESC", ("foc_motor_r", "foc_motor_l", "foc_motor_flux_linkage"), _vesc, _vesc_control),
    Program(
        "ODrive",
        tuple(f"{where}.{n}" for where in ("motor.config", "config.motor") for n in OF_ODRIVE),
        _odrive,
        _odrive_control,
    ),
    Program(
        "SimpleFOC",
        ("bldcmotor.pole_pairs", "motor.phase_resistance", "motor.kv_rating"),
        _simplefoc,
        _simplefoc_control,
    ),
    Program(
        "moteus",
        ("v_per_hz", "motor.poles", "motor.resistance_ohm", "winding_resistance"),
        _moteus,
        _moteus_control,
    ),
)
