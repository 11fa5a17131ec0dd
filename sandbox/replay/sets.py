"""Parameter sets for replay: effects by their public names, checked, compiled to the rows of `sandbox.replay.lanes`.

Beside the effect library's parameters a bench has deviations that are no effect, named `bench.*`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.effects import library
from model.effects.current_filter import sample_weights
from model.effects.dead_time import SOFT_SIGN
from model.errors import BadInput, unknown
from model.parameters import Converter, Motor
from sandbox.replay import lanes

Array = NDArray[np.float64]
LARGEST_RATE = 1e12  # 1/s: a lag without time constant


@dataclass(frozen=True)
class BenchParameter:
    """An ordinary deviation of a bench: neutral value (None: of the drive), bounds, unit."""

    unit: str
    neutral: float | None
    low: float
    high: float


BENCH = {
    "bench.lock_angle": BenchParameter("rad", 0.0, -math.pi, math.pi),  # added to a locked rotor's angle
    "bench.load_torque_gain": BenchParameter("", 0.0, -1.0, 1.0),  # relative error of the load machine's torque
    "bench.load_torque_offset": BenchParameter("N m", 0.0, -1e5, 1e5),
    "bench.common_offset": BenchParameter("A", 0.0, -1e4, 1e4),  # in all three current readings alike
    "bench.soft_current": BenchParameter("A", None, 1e-9, 1e5),  # half the width in which sign(i) goes through zero
}


def parameter_names() -> tuple[str, ...]:
    """Return all names a parameter set may use: every effect parameter, then `bench.*`."""
    return (*library.parameters(), *BENCH)


def complete(motor: Motor, converter: Converter, values: Mapping[str, float] | None = None) -> dict[str, float]:
    """Return every parameter of a set, checked; BadInput for an unknown name (with the nearest) or a wrong value."""
    given = dict(values or {})
    for name in given:
        if name not in BENCH and name not in library.parameters():
            raise unknown("parameter", name, parameter_names())
    effects = {name: value for name, value in given.items() if name not in BENCH}
    out = library.complete(motor, converter, effects)
    for name, p in BENCH.items():
        value = given.get(name, SOFT_SIGN * motor.rated_current if p.neutral is None else p.neutral)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not p.low <= value <= p.high:
            raise BadInput(
                f"{name} = {value!r} is out of range; give a number in [{p.low:g}, {p.high:g}] {p.unit}".rstrip()
            )
        out[name] = float(value)
    return out


def features_of(v: Mapping[str, float]) -> int:
    """Return the features (bits of `lanes`) that a completed set needs."""
    iron = math.isfinite(v["iron_loss.core_resistance"])
    compliant = math.isfinite(v["shaft_compliance.stiffness"]) and v["shaft_compliance.load_inertia"] > 0.0
    needs = (
        (lanes.ECCENTRIC, v["encoder_eccentricity.amplitude_mech"]),
        (lanes.HARMONICS, v["flux_harmonics.psi_d6"]),
        (lanes.HARMONICS, v["flux_harmonics.psi_q6"]),
        (lanes.HARMONICS, v["inductance_harmonics.gamma_6"]),
        (lanes.IRON, iron),
        (lanes.SKIN, v["skin_effect.resistance"]),
        (lanes.ASYMMETRY, v["winding_asymmetry.delta_a"]),
        (lanes.ASYMMETRY, v["winding_asymmetry.delta_b"]),
        (lanes.EDGES | lanes.LATE_PULSES, v["dead_time.time"]),
        (lanes.DROP, v["device_drop.threshold"]),
        (lanes.LATE_PULSES, v["pwm_delay.delay"]),
        (lanes.LINK_RIPPLE, v["dc_link_ripple.amplitude"]),
        (lanes.LINK_SAG, v["dc_link_error.sag"]),
        (lanes.FILTER, v["current_filter.time_constant"]),
        (lanes.SHIFTED_SAMPLE, v["current_sampling.delay"]),
        (lanes.SHAFT_TWIST, compliant),
        (lanes.DRY, v["coulomb_friction.torque"]),
        (lanes.DRY, v["coulomb_friction.stribeck_torque"]),
        (lanes.DRY, v["cogging_torque.amplitude"]),
    )
    out = 0
    for bit, on in needs:
        out |= bit if on else 0
    return out


def lag_weights(step: float, tau: float) -> tuple[float, float, float]:
    """Return decay, weight of old and of new input of a lag over a step, its input linear (tau 0: the new input)."""
    if tau <= 0.0:
        return 0.0, 0.0, 1.0
    x = step / tau
    decay = math.exp(-x)
    mean = -math.expm1(-x) / x if x > 1e-5 else 1.0 - 0.5 * x
    return decay, mean - decay, 1.0 - mean


def parabola_weights(step: float, tau: float) -> tuple[float, float, float, float]:
    """Return decay and weights of input at start, middle and end of a step, its input a parabola (tau 0: the end's)."""
    if tau <= 0.0:
        return 0.0, 0.0, 0.0, 1.0
    x = step / tau
    if x < 1e-3:
        zeroth = -math.expm1(-x)
        first = x * (1.0 / 2.0 - x * (1.0 / 6.0 - x / 24.0))
        second = x * (1.0 / 3.0 - x * (1.0 / 12.0 - x / 60.0))
    else:
        zeroth = -math.expm1(-x)
        first = 1.0 - zeroth / x
        second = 1.0 - 2.0 * first / x
    weights = zeroth - 3.0 * first + 2.0 * second, 4.0 * (first - second), 2.0 * second - first
    return math.exp(-x), *weights


def cubic_weight(step: float, tau: float) -> float:
    """Return the weight of the slope at a step's start beyond the parabola's: x (1 - x) (1 - 2 x), filtered."""
    if tau <= 0.0:
        return 0.0
    x = step / tau
    if x > 1.0:
        first = 1.0 + math.expm1(-x) / x
        second = 1.0 - 2.0 * first / x
        return first - 3.0 * second + 2.0 * (1.0 - 3.0 * second / x)
    term, third = x / 4.0, 0.0
    for n in range(5, 21):  # of the third moment; the lower ones by recursion, which is exact that way
        third, term = third + term, -term * x / n
    second = x / 3.0 * (1.0 - third)
    return x / 2.0 * (1.0 - second) - 3.0 * second + 2.0 * third


def compile_set(motor: Motor, converter: Converter, v: Mapping[str, float], steps: int) -> Array:
    """Return the rows (ROWS,) of one completed set; the states are zero.  steps: plant steps a sampling period."""
    row = np.zeros(lanes.ROWS)
    period, pairs = converter.sampling_period, float(motor.pole_pairs)
    half = 0.5 * period / steps
    a_30, a_12, a_40, a_22, a_04 = (v[f"saturation.alpha_{n}"] for n in ("30", "12", "40", "22", "04"))
    row[lanes.RESISTANCE] = v["stator_resistance.resistance"] + v["device_drop.on_resistance"]
    row[lanes.GAMMA_D] = 1.0 / (v["inductance.scale_d"] * motor.inductance_d)
    row[lanes.GAMMA_Q] = 1.0 / (v["inductance.scale_q"] * motor.inductance_q)
    row[[lanes.A3, lanes.B2, lanes.A4, lanes.C2, lanes.B4]] = 3.0 * a_30, a_12, 4.0 * a_40, a_22, 4.0 * a_04
    row[lanes.MAGNET], row[lanes.PAIRS] = v["magnet_flux.magnet_flux"], pairs
    row[lanes.PSI_D6], row[lanes.PSI_Q6] = v["flux_harmonics.psi_d6"], v["flux_harmonics.psi_q6"]
    row[lanes.GAMMA_6] = v["inductance_harmonics.gamma_6"]
    core, filter_time = v["iron_loss.time_constant"], v["current_filter.time_constant"]
    row[lanes.CORE_G], row[lanes.CORE_INV], row[lanes.CORE_TIME] = (
        1.0 / v["iron_loss.core_resistance"],
        1.0 / core,
        core,
    )
    row[lanes.CORE_DECAY : lanes.CORE_NEW + 1] = lag_weights(half, core)
    row[lanes.CORE_KEEP] = math.exp(-period / core)
    difference = core - filter_time
    row[lanes.CORE_FILTER] = 1.0 / (difference if abs(difference) > 1e-4 * core else 1e-4 * core)
    row[lanes.SKIN_R] = v["skin_effect.resistance"]
    row[lanes.SKIN_DECAY : lanes.SKIN_NEW + 1] = lag_weights(half, v["skin_effect.time_constant"])
    row[lanes.DELTA_A], row[lanes.DELTA_B] = v["winding_asymmetry.delta_a"], v["winding_asymmetry.delta_b"]
    _inverter(row, converter, v)
    row[lanes.FILTER_TIME] = filter_time
    row[lanes.FILTER_INV] = min(1.0 / filter_time, LARGEST_RATE) if filter_time > 0.0 else LARGEST_RATE
    places = [lanes.FILTER_DECAY, lanes.FILTER_OLD, lanes.FILTER_MID, lanes.FILTER_NEW]
    row[places] = parabola_weights(2.0 * half, filter_time)
    if not math.isfinite(v["iron_loss.core_resistance"]):  # its current has no slope a cubic could follow
        share = cubic_weight(2.0 * half, filter_time)
        row[places[1:]] += share * np.array([3.0, -4.0, 1.0])
        row[lanes.FILTER_SLOPE] = share
    row[lanes.FILTER_KEEP] = lag_weights(period, filter_time)[0]
    s = v["current_sampling.delay"]
    row[lanes.SAMPLING] = s
    row[lanes.CORE_SHIFT] = math.expm1(-max(s, -core) / core)
    seen = sample_weights(s, filter_time) if filter_time > 0.0 else (0.0, 0.0, 1.0)
    row[lanes.BACK_DECAY : lanes.BACK_NEW + 1] = seen
    for j, phase in enumerate("abc"):
        row[lanes.GAIN_A + j] = v[f"current_gain.gain_{phase}"]
    row[lanes.OFFSET_A], row[lanes.OFFSET_B] = v["current_offset.offset_a"], v["current_offset.offset_b"]
    row[lanes.COMMON] = v["bench.common_offset"]
    offset = v["encoder_offset.offset"]
    row[lanes.OFFSET], row[lanes.OFF_C], row[lanes.OFF_S] = offset, math.cos(offset), math.sin(offset)
    amplitude, phase_ = pairs * v["encoder_eccentricity.amplitude_mech"], v["encoder_eccentricity.phase"]
    row[lanes.ECC_COS], row[lanes.ECC_SIN] = amplitude * math.cos(phase_), amplitude * math.sin(phase_)
    _shaft(row, pairs, period, v)
    return row


def _inverter(row: Array, converter: Converter, v: Mapping[str, float]) -> None:
    row[lanes.LINK] = (1.0 + v["dc_link_error.gain_error"]) * converter.dc_bus_voltage
    row[lanes.SAG] = v["dc_link_error.sag"]
    row[lanes.RIPPLE], row[lanes.RIPPLE_PHASE] = v["dc_link_ripple.amplitude"], v["dc_link_ripple.phase"]
    row[lanes.RIPPLE_RATE] = math.tau * v["dc_link_ripple.frequency"]
    row[lanes.DEAD], row[lanes.THRESHOLD] = v["dead_time.time"], v["device_drop.threshold"]
    row[lanes.SOFT] = 1.0 / v["bench.soft_current"]
    row[lanes.DELAY] = v["pwm_delay.delay"]
    row[lanes.LATE] = v["pwm_delay.delay"] + 0.5 * abs(v["dead_time.time"])


def _shaft(row: Array, pairs: float, period: float, v: Mapping[str, float]) -> None:
    total, load, k = v["inertia.inertia"], v["shaft_compliance.load_inertia"], v["shaft_compliance.stiffness"]
    row[lanes.FRICTION], row[lanes.COULOMB] = v["viscous_friction.coefficient"], v["coulomb_friction.torque"]
    row[lanes.WIDTH_INV] = 1.0 / v["coulomb_friction.width"]
    row[lanes.STRIBECK] = v["coulomb_friction.stribeck_torque"]
    row[lanes.STRIBECK_INV] = 1.0 / v["coulomb_friction.stribeck_speed"]
    row[lanes.COG], row[lanes.COG_PHASE] = v["cogging_torque.amplitude"], v["cogging_torque.phase"]
    row[lanes.COG_ORDER] = v["cogging_torque.order_mech"]
    row[lanes.ACCELERATION] = pairs / total
    row[lanes.LOAD_GAIN], row[lanes.LOAD_OFFSET] = v["bench.load_torque_gain"], v["bench.load_torque_offset"]
    if not (math.isfinite(k) and load > 0.0):
        return
    motor_part = total - load
    reduced = motor_part * load / total
    rate, ratio = math.sqrt(k / reduced), min(v["shaft_compliance.damping_ratio"], 0.999)
    swing, decay = rate * math.sqrt(1.0 - ratio * ratio), math.exp(-ratio * rate * period)
    c, s = math.cos(swing * period), math.sin(swing * period) / swing
    row[lanes.LOAD_SHARE] = load / total
    row[lanes.OSC_11], row[lanes.OSC_12] = decay * (c + ratio * rate * s), decay * s
    row[lanes.OSC_21], row[lanes.OSC_22] = -decay * rate * rate * s, decay * (c - ratio * rate * s)
    row[lanes.OSC_REST], row[lanes.MOTOR_INV], row[lanes.LOAD_INV] = 1.0 / rate**2, 1.0 / motor_part, 1.0 / load


def compile_sets(motor: Motor, converter: Converter, sets: Sequence[Mapping[str, float]], steps: int) -> Array:
    """Return the rows (ROWS, sets) of completed sets."""
    return np.stack([compile_set(motor, converter, v, steps) for v in sets], axis=1)
