"""Every parameter of the switched bench by its public name: neutral value, bounds, unit; and the compiled form.

Names and meanings are the effect library's (one meaning everywhere).  A neutral value of None means the motor's
own.  Giving a neutral value builds the very same `Bench`, so nothing changes by a bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from model.errors import BadInput, unknown
from model.parameters import Converter, Motor

SOFT_SIGN = 0.015  # of rated current: sign(i) goes linearly through zero within +-1.5 % (effect library, dead_time)
STEPS_A_PERIOD = 4.0  # longest integration step, a share of the period; halving it changes nothing seen (tests)


class Parameter(NamedTuple):
    """Neutral value (None: the motor's), closed bounds and unit."""

    neutral: float | None
    low: float
    high: float
    unit: str


INF = math.inf
PARAMETERS: dict[str, Parameter] = {
    "stator_resistance.resistance": Parameter(None, 0.0, 1e3, "ohm"),
    "magnet_flux.magnet_flux": Parameter(None, 0.0, 1e2, "Wb"),
    "inductance.scale_d": Parameter(1.0, 0.2, 5.0, ""),
    "inductance.scale_q": Parameter(1.0, 0.2, 5.0, ""),
    "saturation.alpha_30": Parameter(None, -1e9, 1e9, "A/Wb^2"),
    "saturation.alpha_12": Parameter(None, -1e9, 1e9, "A/Wb^2"),
    "saturation.alpha_40": Parameter(None, -1e12, 1e12, "A/Wb^3"),
    "saturation.alpha_22": Parameter(None, -1e12, 1e12, "A/Wb^3"),
    "saturation.alpha_04": Parameter(None, -1e12, 1e12, "A/Wb^3"),
    "cross_saturation.alpha_12": Parameter(None, -1e9, 1e9, "A/Wb^2"),
    "cross_saturation.alpha_22": Parameter(None, -1e12, 1e12, "A/Wb^3"),
    "flux_harmonics.psi_d6": Parameter(0.0, -1e2, 1e2, "Wb"),
    "flux_harmonics.psi_q6": Parameter(0.0, -1e2, 1e2, "Wb"),
    "inductance_harmonics.gamma_6": Parameter(0.0, -1e4, 1e4, "1/H"),
    "iron_loss.core_resistance": Parameter(INF, 1.0, INF, "ohm"),
    "iron_loss.time_constant": Parameter(2e-4, 1e-5, 1e-2, "s"),
    "skin_effect.resistance": Parameter(0.0, 0.0, 1e3, "ohm"),
    "skin_effect.time_constant": Parameter(2e-4, 1e-5, 1.0, "s"),
    "winding_asymmetry.delta_a": Parameter(0.0, -1e3, 1e3, "ohm"),
    "winding_asymmetry.delta_b": Parameter(0.0, -1e3, 1e3, "ohm"),
    "dead_time.time": Parameter(0.0, -5e-6, 5e-5, "s"),  # negative: over-compensated
    "device_drop.threshold": Parameter(0.0, 0.0, 50.0, "V"),
    "device_drop.on_resistance": Parameter(0.0, 0.0, 1e2, "ohm"),
    "dc_link_error.gain_error": Parameter(0.0, -0.5, 0.5, ""),
    "dc_link_ripple.amplitude": Parameter(0.0, 0.0, 1e3, "V"),
    "dc_link_ripple.frequency": Parameter(300.0, 0.0, 1e5, "Hz"),
    "dc_link_ripple.phase": Parameter(0.0, -INF, INF, "rad"),
    "pwm_delay.delay": Parameter(0.0, 0.0, 1e-2, "s"),
    "current_gain.gain_a": Parameter(1.0, 0.2, 5.0, ""),
    "current_gain.gain_b": Parameter(1.0, 0.2, 5.0, ""),
    "current_gain.gain_c": Parameter(1.0, 0.2, 5.0, ""),
    "current_offset.offset_a": Parameter(0.0, -1e4, 1e4, "A"),
    "current_offset.offset_b": Parameter(0.0, -1e4, 1e4, "A"),
    "current_filter.time_constant": Parameter(0.0, 0.0, 1e-2, "s"),
    "current_sampling.delay": Parameter(0.0, -1e-2, 1e-2, "s"),
    "current_sampling.jitter": Parameter(0.0, 0.0, 1e-3, "s rms"),
    "encoder_offset.offset": Parameter(0.0, -math.tau, math.tau, "rad"),
    "encoder_eccentricity.amplitude_mech": Parameter(0.0, -0.5, 0.5, "rad"),
    "encoder_eccentricity.phase": Parameter(0.0, -INF, INF, "rad"),
    "coulomb_friction.torque": Parameter(0.0, 0.0, 1e5, "N m"),
    "coulomb_friction.width": Parameter(2.0, 1e-3, 1e3, "rad/s"),
    "coulomb_friction.stribeck_torque": Parameter(0.0, 0.0, 1e5, "N m"),
    "coulomb_friction.stribeck_speed": Parameter(5.0, 1e-3, 1e3, "rad/s"),
    "viscous_friction.coefficient": Parameter(None, 0.0, 1e4, "N m s/rad"),
    "cogging_torque.amplitude": Parameter(0.0, 0.0, 1e5, "N m"),
    "cogging_torque.order_mech": Parameter(6.0, 0.0, 1e4, ""),
    "cogging_torque.phase": Parameter(0.0, -INF, INF, "rad"),
    "inertia.inertia": Parameter(None, 1e-9, 1e4, "kg m^2"),
    "shaft_compliance.stiffness": Parameter(INF, 1e-3, INF, "N m/rad"),
    "shaft_compliance.load_inertia": Parameter(0.0, 0.0, 1e4, "kg m^2"),
    "shaft_compliance.damping_ratio": Parameter(0.01, 0.0, 1.0, ""),
}


class Bench(NamedTuple):
    """All numbers of one switched bench as the kernels read them (SI, electrical angles)."""

    pole_pairs: float
    resistance: float
    magnet_flux: float
    psi_d6: float
    psi_q6: float
    g_0: float  # energy as a harmonic series of the flux vector, see machine.py
    g_2: float
    gamma_6: float
    c_1: float
    c_3: float
    q_0: float
    q_2: float
    q_4: float
    core_conductance: float
    core_time: float
    skin_resistance: float
    skin_time: float
    delta_a: float
    delta_b: float
    period: float
    soft_current: float
    dead_time: float
    threshold: float
    on_resistance: float
    link_voltage: float
    ripple_amplitude: float
    ripple_rate: float
    ripple_phase: float
    pwm_delay: float
    gain_a: float
    gain_b: float
    gain_c: float
    offset_a: float
    offset_b: float
    filter_time: float
    sampling_delay: float
    jitter: float
    noise: float
    resolution: float
    encoder_step: float
    encoder_offset: float
    eccentricity: float
    eccentricity_phase: float
    coulomb: float
    coulomb_width: float
    stribeck: float
    stribeck_speed: float
    viscous: float
    cogging: float
    cogging_order: float
    cogging_phase: float
    inertia: float  # on the motor's side of the shaft
    load_inertia: float  # 0: rigid shaft
    stiffness: float
    damping: float
    step: float  # longest integration step, s
    audit: float  # other than 0: sum up energies


def neutral(motor: Motor) -> dict[str, float]:
    """Return every parameter's neutral value for this motor."""
    own = {
        "stator_resistance.resistance": motor.resistance,
        "magnet_flux.magnet_flux": motor.magnet_flux,
        "viscous_friction.coefficient": motor.viscous_friction,
        "inertia.inertia": motor.inertia,
    }
    for name, parameter in PARAMETERS.items():
        if parameter.neutral is not None:
            own[name] = parameter.neutral
        elif "saturation." in name:
            own[name] = getattr(motor, name.rpartition(".")[2])
    return {name: float(own[name]) for name in PARAMETERS}


def bench(motor: Motor, converter: Converter, effects: Mapping[str, float] | None = None) -> Bench:
    """Return the compiled bench of a motor, a converter and effects such as {"dead_time.time": 2e-6}.

    BadInput names an unknown parameter (with the nearest), a value out of bounds, or effects that contradict
    each other.
    """
    given = dict(effects or {})
    values = neutral(motor)
    for name, value in given.items():
        values[name] = _checked(name, value)
    for alpha in ("alpha_12", "alpha_22"):  # cross_saturation is a part of saturation
        one, other = f"saturation.{alpha}", f"cross_saturation.{alpha}"
        if one in given and other in given and values[one] != values[other]:
            raise BadInput(f"{one} = {values[one]:g} and {other} = {values[other]:g} contradict each other; give one")
        values[one] = values[other] = values[other] if other in given else values[one]
    period = converter.sampling_period
    timing = abs(values["current_sampling.delay"]), values["pwm_delay.delay"] + values["dead_time.time"]
    if max(timing) >= 0.5 * period:
        raise BadInput(
            f"current_sampling.delay, or pwm_delay.delay + dead_time.time, = {max(timing):g} s is out of range; "
            f"give less than half the PWM period of {period:g} s"
        )
    return _compile(motor, converter, values)


def quiet(b: Bench) -> Bench:
    """Return the same bench without noise, jitter and quantisation, as a prediction needs it."""
    return b._replace(noise=0.0, jitter=0.0, resolution=0.0, encoder_step=0.0)


def _checked(name: str, value: float) -> float:
    if name not in PARAMETERS:
        raise unknown("effect parameter", name, PARAMETERS)
    _, low, high, unit = PARAMETERS[name]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise BadInput(f"{name} = {value!r} is out of range; give a number in [{low:g}, {high:g}] {unit}".rstrip())
    if math.isinf(low) and not math.isfinite(value):
        raise BadInput(f"{name} = {value!r} is not finite; give a number in {unit}")
    return float(value)


def _compile(motor: Motor, converter: Converter, v: Mapping[str, float]) -> Bench:
    counts = converter.encoder_counts
    m_load = v["shaft_compliance.load_inertia"] if math.isfinite(v["shaft_compliance.stiffness"]) else 0.0
    m_motor = v["inertia.inertia"] - m_load  # total inertia unchanged
    if not m_motor > 0.0:
        raise BadInput(
            f"shaft_compliance.load_inertia = {m_load:g} is out of range; give less than the total inertia of "
            f"{v['inertia.inertia']:g} kg m^2"
        )
    stiffness = v["shaft_compliance.stiffness"] if m_load else 0.0
    reduced = m_motor * m_load / (m_motor + m_load)
    period = converter.sampling_period
    values = {
        **_energy(motor, v),
        "pole_pairs": float(motor.pole_pairs),
        "resistance": v["stator_resistance.resistance"],
        "magnet_flux": v["magnet_flux.magnet_flux"],
        "psi_d6": v["flux_harmonics.psi_d6"],
        "psi_q6": v["flux_harmonics.psi_q6"],
        "gamma_6": v["inductance_harmonics.gamma_6"],
        "core_conductance": 1.0 / v["iron_loss.core_resistance"],
        "core_time": v["iron_loss.time_constant"],
        "skin_resistance": v["skin_effect.resistance"],
        "skin_time": v["skin_effect.time_constant"],
        "period": period,
        "soft_current": SOFT_SIGN * motor.rated_current,
        "dead_time": v["dead_time.time"],
        "link_voltage": (1.0 + v["dc_link_error.gain_error"]) * converter.dc_bus_voltage,
        "ripple_amplitude": v["dc_link_ripple.amplitude"],
        "ripple_rate": math.tau * v["dc_link_ripple.frequency"],
        "ripple_phase": v["dc_link_ripple.phase"],
        "pwm_delay": v["pwm_delay.delay"],
        "filter_time": v["current_filter.time_constant"],
        "sampling_delay": v["current_sampling.delay"],
        "jitter": v["current_sampling.jitter"],
        "noise": converter.current_noise,
        "resolution": converter.current_resolution,
        "encoder_step": math.tau * motor.pole_pairs / counts if counts else 0.0,
        "encoder_offset": v["encoder_offset.offset"],
        "eccentricity": motor.pole_pairs * v["encoder_eccentricity.amplitude_mech"],
        "eccentricity_phase": v["encoder_eccentricity.phase"],
        "coulomb": v["coulomb_friction.torque"],
        "coulomb_width": v["coulomb_friction.width"],
        "stribeck": v["coulomb_friction.stribeck_torque"],
        "stribeck_speed": v["coulomb_friction.stribeck_speed"],
        "viscous": v["viscous_friction.coefficient"],
        "cogging": v["cogging_torque.amplitude"],
        "cogging_order": v["cogging_torque.order_mech"],
        "cogging_phase": v["cogging_torque.phase"],
        "inertia": m_motor,
        "load_inertia": m_load,
        "stiffness": stiffness,
        "damping": 2.0 * v["shaft_compliance.damping_ratio"] * math.sqrt(stiffness * reduced),
        "audit": 0.0,
    }
    same_name = ("winding_asymmetry", "device_drop", "current_gain", "current_offset")
    values |= {key: v[name] for name in v for effect, _, key in [name.partition(".")] if effect in same_name}
    rate = math.sqrt(stiffness / reduced) if m_load else 0.0
    return Bench(**values, step=_longest_step(period, v, rate))


def _energy(motor: Motor, v: Mapping[str, float]) -> dict[str, float]:
    """Coefficients of the energy as a harmonic series of the flux vector: sums and differences of the paper's."""
    gamma_d = 1.0 / (v["inductance.scale_d"] * motor.inductance_d)
    gamma_q = 1.0 / (v["inductance.scale_q"] * motor.inductance_q)
    a_30, a_12, a_40, a_22, a_04 = (v[f"saturation.alpha_{n}"] for n in ("30", "12", "40", "22", "04"))
    return {
        "g_0": 0.5 * (gamma_d + gamma_q),
        "g_2": 0.5 * (gamma_d - gamma_q),
        "c_1": 0.25 * (3.0 * a_30 + a_12),
        "c_3": 0.25 * (a_30 - a_12),
        "q_0": 0.125 * (3.0 * a_40 + a_22 + 3.0 * a_04),
        "q_2": 0.5 * (a_40 - a_04),
        "q_4": 0.125 * (a_40 - a_22 + a_04),
    }


def _longest_step(period: float, v: Mapping[str, float], shaft_rate: float) -> float:
    """A quarter of the period, less where an effect has a shorter time constant (Runge-Kutta must resolve it)."""
    step = period / STEPS_A_PERIOD
    if math.isfinite(v["iron_loss.core_resistance"]):
        step = min(step, 0.5 * v["iron_loss.time_constant"])
    if v["skin_effect.resistance"] > 0.0:
        step = min(step, 0.5 * v["skin_effect.time_constant"])
    return min(step, 0.2 / shaft_rate) if shaft_rate > 0.0 else step
