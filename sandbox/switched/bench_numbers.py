"""The switched bench's numbers in compiled form, from a motor, a converter and effects by their
public names.

Names, bounds and neutral values are the effect library's (`model.effects.library`), and so are the
forms of the effects; their equations are written and integrated anew, apart from the plant.  Giving
a neutral value builds the very same `SwitchedBench`, so nothing changes by a bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from model.effects.library import check_inside, complete, neutral
from model.errors import BadInput
from model.parameters import MODULATIONS, OVERMODULATIONS, Converter, Motor
from sandbox.switched.flux_map import FluxMap, flux_map_of
from sandbox.switched.harmonics import (
    CoggingHarmonic,
    FluxHarmonic,
    Harmonics,
    InductanceHarmonic,
    harmonics,
)
from sandbox.switched.layers import Modes, modes
from sandbox.switched.leg import LINEAR, leg_table

# of rated current: sign(i) goes linearly through zero within +-1.5 % (effect library, dead_time)
SOFT_SIGN = 0.015
EXCESS_WIDTH = 1e-4  # of the rated slope of the flux: there the root of excess loss begins straight
INDUCTANCES = ("gamma", "back", "pulse", "alpha_30", "alpha_12", "alpha_21", "alpha_03")
# longest integration step, a share of the period; halving it changes nothing seen (tests)
STEPS_A_PERIOD = 4.0
# of a current of reference
LEG_CORNERS = (0.0125, 0.02, 0.032, 0.05, 0.08, 0.125, 0.2, 0.32, 0.5, 0.8, 1.25, 2.0)
RUBBING_CORNERS = (0.01, 0.025, 0.064, 0.16, 0.4, 1.0, 2.5)  # of a speed of reference
NOWHERE = np.zeros(1)
LEAST_SLICES = 64.0  # of a dead time in which a leg slews
MOST_SWING = 50.0  # rad of a leg's swing in a dead time: faster ones are as good as no capacitance
# a current that reaches a corner of its sign and turns back inside a step is not seen, nor is a
# shaft that does so at an edge of its gap
STEPS_WITH_CORNERS = 16.0
SWUNG = 0.05  # rad of a swing on bristles in a step, whose rate is then 1e-4 of itself off
# the bench's numbers that are a parameter of an effect as it is
SAME = {
    "resistance": "stator_resistance.resistance",
    "magnet_flux": "magnet_flux.magnet_flux",
    "psi_d6": "flux_harmonics.psi_d6",
    "psi_q6": "flux_harmonics.psi_q6",
    "gamma_6": "inductance_harmonics.gamma_6",
    "core_time": "iron_loss.time_constant",
    "skin_time": "skin_effect.time_constant",
    "zone_width": "dead_time.zone_width",
    "zone_tanh": "dead_time.zone_shape",
    "zone_center": "dead_time.zone_center",
    "ripple_amplitude": "dc_link_ripple.amplitude",
    "ripple_phase": "dc_link_ripple.phase",
    "pwm_delay": "pwm_delay.delay",
    "threshold": "device_drop.threshold",
    "threshold_knee": "device_drop.knee_current",
    "on_resistance": "device_drop.on_resistance",
    "filter_time": "current_filter.time_constant",
    "sampling_delay": "current_sampling.delay",
    "jitter": "current_sampling.jitter",
    "encoder_offset": "encoder_offset.offset",
    "encoder_latency": "encoder_offset.latency",
    "eccentricity_phase": "encoder_eccentricity.phase",
    "coulomb": "coulomb_friction.torque",
    "coulomb_width": "coulomb_friction.width",
    "stribeck": "coulomb_friction.stribeck_torque",
    "stribeck_speed": "coulomb_friction.stribeck_speed",
    "viscous": "viscous_friction.coefficient",
    "cogging": "cogging_torque.amplitude",
    "cogging_order": "cogging_torque.order_mech",
    "cogging_phase": "cogging_torque.phase",
    "backlash": "shaft_compliance.backlash",
}
# effects whose parameters have the same names there
SAME_NAMES = ("winding_asymmetry", "current_gain", "current_offset")


class SwitchedBench(NamedTuple):
    """All numbers of one switched bench as the kernels read them (SI, electrical angles)."""

    pole_pairs: float
    resistance: float
    magnet_flux: float
    psi_d6: float
    psi_q6: float
    g_0: float  # energy as a harmonic series of the flux vector, see `phase_machine`
    g_2: float
    gamma_6: float
    c_1: float
    c_3: float
    q_0: float
    q_2: float
    q_4: float
    core_conductance: float
    core_time: float
    core_branch: float  # conductance by which the state has the lagged slope of the flux, 1/ohm
    excess: float  # of excess loss, A/V^(1/2)
    excess_width: float  # V, of the slope within which its root begins straight
    grip: float  # magnetic hysteresis, 1/H, and its radius in Wb
    grip_radius: float
    skin_resistance: float
    skin_time: float
    delta_a: float
    delta_b: float
    period: float
    soft_current: float
    dead_time: float
    threshold: float
    threshold_knee: float
    on_resistance: float
    link_voltage: float
    sag: float
    ripple_amplitude: float
    ripple_rate: float
    ripple_phase: float
    pwm_delay: float
    gain_a: float
    gain_b: float
    gain_c: float
    bend_2: float  # of current sensors: 1/A, 1/A^2, 1/A^3
    bend_3: float
    bend_4: float
    offset_a: float
    offset_b: float
    filter_time: float
    sampling_delay: float
    jitter: float
    common_offset: float  # in all three readings alike
    noise: float
    resolution: float
    encoder_step: float
    encoder_offset: float
    encoder_latency: float
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
    backlash: float  # rad that the shaft turns freely, from end to end
    step: float  # longest integration step, s
    audit: float  # other than 0: sum up energies (all effects but hysteresis and shorted turns)
    # The rest stands in no library and is off by default; `unlisted` has units and bounds.
    # turns of phase a short-circuited, and the time constant of their loop
    short_conductance: float = 0.0
    short_time: float = 0.0
    knee: float = 0.0  # saturation with a knee, beyond a flux of knee_flux
    knee_flux: float = 0.0
    curvature: float = 0.0  # of current sensors
    fan: float = 0.0  # load torque by the square of the load's speed
    resolver: float = 0.0  # error of second order of the angle's reading
    resolver_phase: float = 0.0
    least_pulse: float = 0.0  # shorter pulses are dropped
    least_vector: float = 0.0  # legs whose edges would follow each other faster switch together
    link_rate: float = 0.0  # resonance of the link
    link_impedance: float = 0.0
    link_damping: float = 0.0
    one_sided: float = 0.0  # devices that lose more for currents out of the leg
    channel_lag: float = 0.0  # s, by which each phase's current is read after the one before it
    # of current sensors' cores: a play, its share of the current, and its radius in A
    remanence: float = 0.0
    remanence_radius: float = 0.0
    crank: float = 0.0  # kg m^2, by which the load's inertia swings twice a turn
    crank_phase: float = 0.0
    lobe: float = 0.0  # N m, of a load out of true, once in so many turns
    lobe_turns: float = 0.0
    lobe_phase: float = 0.0
    load_lag: float = 0.0  # s, by which a load machine's torque lags what it is told
    # how the sign of a current goes through zero, soft_current its half-width
    sign_shape: float = LINEAR
    # A, of the sign by which edges are late: half-width of its own, share of a tanh in it, and its
    # middle in half-widths of the current that keeps a leg where it is
    zone_width: float = 0.0
    zone_tanh: float = 0.0
    zone_center: float = 0.0
    # F across each switch: legs slew in the dead time, and are clamped; edges know no sign
    capacitance: float = 0.0
    slices: float = LEAST_SLICES  # steps over a dead time, in which legs slew
    reluctant: float = 0.0  # H: a current changes by twice the link's voltage over it at most
    # how the drive modulates, and what it does beyond the hexagon: see `modulation`
    pattern: int = 0
    beyond: int = 0
    drive_least_pulse: float = 0.0  # s: the drive itself leaves out shorter pulses
    # N m/rad, N m s/rad: bristles of dry friction, which bend before it slides; 0: it has none
    bristle_stiffness: float = 0.0
    bristle_damping: float = 0.0
    # rad/s, N m: friction beside dry and viscous one, straight between points
    rubbing_speed: Any = NOWHERE
    rubbing_torque: Any = NOWHERE
    # of the encoder's reading, beside once a turn: rad electrical, orders of the mechanical angle
    wobble: Any = NOWHERE
    wobble_order: Any = NOWHERE
    wobble_phase: Any = NOWHERE
    leg_table: Any = None  # voltage error of a leg, in place of dead time and device drop
    modes: Modes = Modes()  # of layers of conductors
    harmonics: Harmonics | None = None  # of any orders, beside the sixth ones above
    flux_map: FluxMap | None = None  # to which the harmonic series holds what effects add


def bench(
    motor: Motor, converter: Converter, effects: Mapping[str, float] | None = None
) -> SwitchedBench:
    """Return the compiled bench of a motor, a converter and effects such as {"dead_time.time":
    2e-6}.

    A motor with a flux map (`model.mapped`) keeps its map: effects on its magnetics are out of
    bounds. BadInput names an unknown parameter (with the nearest), a value out of bounds, or
    effects that contradict each other.
    """
    return _compile(motor, converter, complete(motor, converter, effects))


def quiet(b: SwitchedBench) -> SwitchedBench:
    """Return the same bench without noise, jitter and quantisation, as a prediction needs it."""
    return b._replace(noise=0.0, jitter=0.0, resolution=0.0, encoder_step=0.0)


def _compile(motor: Motor, converter: Converter, v: Mapping[str, float]) -> SwitchedBench:
    check_inside(motor, converter, v)
    period, flux_map = converter.sampling_period, flux_map_of(motor.energy)
    shaft, shaft_rate = _shaft(v)
    values: dict[str, Any] = {
        **(_energy(motor, v) if flux_map is None else _added_to_map(motor, v)),
        **{own: v[name] for own, name in SAME.items()},
        **{n.partition(".")[2]: x for n, x in v.items() if n.partition(".")[0] in SAME_NAMES},
        **_drive(motor, converter),
        **shaft,
        **_skin(v),
        **_core(motor, v),
        "capacitance": _capacitance(motor, v),
        "dead_time": _dead_time(v),
        "slices": _slices(motor, v),
        "link_voltage": (1.0 + v["dc_link_error.gain_error"]) * converter.dc_bus_voltage,
        **_source(v),
        "channel_lag": v["current_sampling.channel_lag"],
        "ripple_rate": math.tau * v["dc_link_ripple.frequency"],
        "eccentricity": motor.pole_pairs * v["encoder_eccentricity.amplitude_mech"],
        "audit": 0.0,
        "common_offset": 0.0,
        **_bends(motor, v),
        **_rubbing(motor, v),
        **_bristles(v, shaft["inertia"]),
        **_wobbles(motor, v),
    }
    table = _leg_table(motor, converter, v)
    step = _longest_step(period, v, shaft_rate, values["inertia"])
    step = step if table is None else min(step, period / STEPS_WITH_CORNERS)
    return SwitchedBench(
        **values, step=step, leg_table=table, harmonics=_orders(motor, v), flux_map=flux_map
    )


def _source(v: Mapping[str, float]) -> dict[str, float]:
    """Return what feeds the link: a resistance while a capacitor holds it, or one that the
    capacitor rings with through an inductance."""
    ohm, sag = v["dc_link_error.impedance"], v["dc_link_error.sag"]
    if not ohm:
        return {"sag": sag}
    rate = math.tau * v["dc_link_error.resonance"]
    return {
        "sag": 0.0,
        "link_rate": rate,
        "link_impedance": ohm,
        "link_damping": 0.5 * sag / ohm,
    }


def _rated_flux(motor: Motor) -> float:
    """Return the flux (Wb) that hysteresis' reach is a share of: the magnets', or without magnets
    what rated current links by the mean of both inductances, geometrically."""
    linked = math.sqrt(motor.inductance_d * motor.inductance_q) * motor.rated_current
    return motor.magnet_flux or linked


def _core(motor: Motor, v: Mapping[str, float]) -> dict[str, float]:
    """Return what the core loses by: eddy currents, excess loss, hysteresis."""
    flux, current = _rated_flux(motor), v["iron_loss.hysteresis_current"]
    slope, excess = motor.rated_omega * flux, v["iron_loss.excess_current"]
    conductance = 1.0 / v["iron_loss.core_resistance"]
    radius = v["iron_loss.hysteresis_reach"] * flux if current else 0.0
    return {
        "core_conductance": conductance,
        "core_branch": conductance or (1.0 if excess else 0.0),
        "excess": excess / math.sqrt(slope),
        "excess_width": EXCESS_WIDTH * slope,
        "grip": current / radius if current else 0.0,
        "grip_radius": radius,
    }


def _drive(motor: Motor, converter: Converter) -> dict[str, float]:
    """Return what the motor and the converter alone say."""
    counts, beyond = converter.encoder_counts, converter.overmodulation
    return {
        "pole_pairs": float(motor.pole_pairs),
        "period": converter.sampling_period,
        "soft_current": SOFT_SIGN * motor.rated_current,
        "reluctant": min(motor.inductance_d, motor.inductance_q),
        "noise": converter.current_noise,
        "resolution": converter.current_resolution,
        "encoder_step": math.tau * motor.pole_pairs / counts if counts else 0.0,
        "pattern": MODULATIONS.index(converter.modulation),
        "beyond": 1 + OVERMODULATIONS.index(beyond) if beyond else 0,
        "drive_least_pulse": converter.least_pulse,
    }


def _shaft(v: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """Return the inertias and what joins them, and how fast (rad/s) they swing against each other
    (0: rigid)."""
    elastic = math.isfinite(v["shaft_compliance.stiffness"])
    m_load = v["shaft_compliance.load_inertia"] if elastic else 0.0
    m_motor = v["inertia.inertia"] - m_load  # total inertia unchanged
    stiffness = v["shaft_compliance.stiffness"] if m_load else 0.0
    reduced = m_motor * m_load / (m_motor + m_load)
    values = {
        "inertia": m_motor,
        "load_inertia": m_load,
        "stiffness": stiffness,
        "damping": 2.0 * v["shaft_compliance.damping_ratio"] * math.sqrt(stiffness * reduced),
    }
    return values, math.sqrt(stiffness / reduced) if m_load else 0.0


def _skin(v: Mapping[str, float]) -> dict[str, Any]:
    """Return the skin effect's one branch, or the modes of layers."""
    ohm, layers = v["skin_effect.resistance"], v["skin_effect.layers"]
    if not (ohm and layers):
        return {"skin_resistance": ohm}
    return {
        "skin_resistance": 0.0,
        "modes": modes(ohm, layers, v["skin_effect.time_constant"]),
    }


def _bends(motor: Motor, v: Mapping[str, float]) -> dict[str, float]:
    """Return the terms of the sensors' linearity error."""
    own = v["current_linearity.reference"] or motor.rated_current
    return {
        f"bend_{k}": v[f"current_linearity.{name}"] / own ** (k - 1)
        for k, name in ((2, "second"), (3, "third"), (4, "fourth"))
    }


def _rubbing(motor: Motor, v: Mapping[str, float]) -> dict[str, Any]:
    """Return the points of friction's curve: each of its torques rises straight to a share of a
    speed and stays there."""
    torques = np.array([v[f"friction_torque.t_{k + 1}"] for k in range(len(RUBBING_CORNERS))])
    if not torques.any():
        return {}
    shares = np.array([0.0, *RUBBING_CORNERS])
    risen = np.minimum(shares[:, None] / np.array(RUBBING_CORNERS), 1.0)
    own = v["friction_torque.reference"] or motor.rated_omega / motor.pole_pairs
    return {"rubbing_speed": own * shares, "rubbing_torque": risen @ torques}


def _bristles(v: Mapping[str, float], inertia: float) -> dict[str, float]:
    """Return what bristles are that bend by `presliding` under all of dry friction at rest, and are
    damped by a ratio as a spring under the motor's inertia."""
    bend = v["coulomb_friction.presliding"]
    stiff = (v["coulomb_friction.torque"] + v["coulomb_friction.stribeck_torque"]) / (bend or 1.0)
    if not bend:
        return {}
    damping = 2.0 * v["coulomb_friction.presliding_damping"] * math.sqrt(stiff * inertia)
    return {"bristle_stiffness": stiff, "bristle_damping": damping}


def _wobbles(motor: Motor, v: Mapping[str, float]) -> dict[str, Any]:
    """Return the further orders of the encoder's error; nothing where there are none."""
    there = given(v, "encoder_eccentricity", "amplitude_mech")
    if not there:
        return {}
    return {
        "wobble": motor.pole_pairs * np.array([f["amplitude_mech"] for f in there]),
        "wobble_order": np.array([f["order_mech"] for f in there]),
        "wobble_phase": np.array([f["phase"] for f in there]),
    }


def given(v: Mapping[str, float], effect: str, *sizes: str) -> list[dict[str, float]]:
    """Return the parameters of an effect's further parts that have a size."""
    found = [
        {n.split(".")[2]: x for n, x in v.items() if n.startswith(f"{effect}.{k}.")}
        for k in range(2, 10)
    ]
    return [f for f in found if any(f.get(s) for s in sizes)]


def _leg_table(motor: Motor, converter: Converter, v: Mapping[str, float]) -> Any:
    """Return what a leg loses by the drive's table and by the effect's curve, whose terms rise
    straight to a share of a current and stay there, at the points of both; None where neither is
    there."""
    volts = np.array([v[f"leg_voltage.v_{k + 1}"] for k in range(len(LEG_CORNERS))])
    if not (converter.inverter_table or volts.any()):
        return None
    i, u = np.array(converter.inverter_table or ((0.0, 0.0),)).T
    bends = (v["leg_voltage.reference"] or motor.rated_current) * np.array(LEG_CORNERS)
    current = np.unique(np.concatenate([[0.0], i, bends if volts.any() else []]))
    terms = sum(
        (
            x * np.interp(current, (0.0, bend), (0.0, 1.0))
            for x, bend in zip(volts, bends, strict=True)
        ),
        0.0,
    )
    return leg_table(current, np.interp(current, i, u) + terms)


def _orders(motor: Motor, v: Mapping[str, float]) -> Harmonics | None:
    """Return the library's further orders as lists; None where there are none."""
    flux = [FluxHarmonic(**f) for f in given(v, "flux_harmonics", "psi_d", "psi_q")]
    inductance = [InductanceHarmonic(**f) for f in given(v, "inductance_harmonics", *INDUCTANCES)]
    cogging = [
        CoggingHarmonic(f["order_mech"], f["amplitude"], f["phase"])
        for f in given(v, "cogging_torque", "amplitude")
    ]
    return harmonics(motor, flux, inductance, cogging) if flux or inductance or cogging else None


def _energy(motor: Motor, v: Mapping[str, float]) -> dict[str, float]:
    """Coefficients of the energy as a harmonic series of the flux vector: sums and differences of
    the paper's."""
    gamma_d = 1.0 / (v["inductance.scale_d"] * motor.inductance_d)
    gamma_q = 1.0 / (v["inductance.scale_q"] * motor.inductance_q)
    a_30, a_12, a_40, a_22, a_04 = (
        v[f"saturation.alpha_{n}"] for n in ("30", "12", "40", "22", "04")
    )
    return {
        "g_0": 0.5 * (gamma_d + gamma_q),
        "g_2": 0.5 * (gamma_d - gamma_q),
        "c_1": 0.25 * (3.0 * a_30 + a_12),
        "c_3": 0.25 * (a_30 - a_12),
        "q_0": 0.125 * (3.0 * a_40 + a_22 + 3.0 * a_04),
        "q_2": 0.5 * (a_40 - a_04),
        "q_4": 0.125 * (a_40 - a_22 + a_04),
    }


def _added_to_map(motor: Motor, v: Mapping[str, float]) -> dict[str, float]:
    """Coefficients of what effects add to a flux map: the series with them less that of the map at
    zero current."""
    with_effects, own = _energy(motor, v), _energy(motor, neutral(motor))
    return {name: value - own[name] for name, value in with_effects.items()}


def _capacitance(motor: Motor, v: Mapping[str, float]) -> float:
    """Return the capacitance across each switch (F), the least that can be told from none; 0 where
    none is given: edges then know no switches, but a sign of the current."""
    if v["dead_time.time"] <= 0.0 or not v["dead_time.capacitance"]:
        return 0.0
    least = (v["dead_time.time"] / MOST_SWING) ** 2 / (
        3.0 * min(motor.inductance_d, motor.inductance_q)
    )
    return max(v["dead_time.capacitance"], least)


def _dead_time(v: Mapping[str, float]) -> float:
    """Return the dead time (s), with what a compensation leaves where edges know a sign of the
    current, too; BadInput for that beside switches with a capacitance."""
    time, residual = v["dead_time.time"], v["dead_time.residual"]
    if residual and time > 0.0 and v["dead_time.capacitance"]:
        raise BadInput(
            f"dead_time.residual = {residual:g} s: the switched bench has no compensation beside "
            "switches with a capacitance; give residual = 0, or capacitance = 0"
        )
    return time + residual


def _slices(motor: Motor, v: Mapping[str, float]) -> float:
    """Return the steps that a dead time is cut into: a leg swings with sqrt(1/(3 C L)), a quarter
    radian each at most; 64 leave (1/64)^2 of the dead time."""
    capacitance, inductance = _capacitance(motor, v), min(motor.inductance_d, motor.inductance_q)
    if not capacitance:
        return LEAST_SLICES
    return max(
        LEAST_SLICES,
        math.ceil(4.0 * v["dead_time.time"] / math.sqrt(3.0 * capacitance * inductance)),
    )


def _longest_step(
    period: float, v: Mapping[str, float], shaft_rate: float, inertia: float
) -> float:
    """A quarter of the period, less where an effect has a shorter time constant (Runge-Kutta must
    resolve it).

    inertia: on the motor's side, which dry friction brings to rest within its width.
    """
    step = period / STEPS_A_PERIOD
    if v["device_drop.threshold"] > 0.0 or v["shaft_compliance.backlash"] > 0.0:
        step = period / STEPS_WITH_CORNERS
    if math.isfinite(v["iron_loss.core_resistance"]) or v["iron_loss.excess_current"]:
        step = min(step, 0.25 * v["iron_loss.time_constant"])
    if v["skin_effect.resistance"] > 0.0:
        skin = _skin(v)
        fastest = min(skin["modes"].times) if "modes" in skin else v["skin_effect.time_constant"]
        step = min(step, 0.5 * fastest)
    dry = v["coulomb_friction.torque"] + v["coulomb_friction.stribeck_torque"]
    bend = v["coulomb_friction.presliding"]
    if dry > 0.0 and bend > 0.0:
        step = min(step, SWUNG * math.sqrt(bend * inertia / dry))
    elif dry > 0.0:
        step = min(step, 1.0 / (dry / (v["coulomb_friction.width"] * inertia)))
    return min(step, 0.2 / shaft_rate) if shaft_rate > 0.0 else step
