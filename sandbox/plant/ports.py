"""Where effects enter the plant: what their equations add at each port, for lane j.

Written by `python -m sandbox.plant.compose` from the effects' cards; do not edit.
"""

from __future__ import annotations

from model.compiled import inlined
from model.effects import (
    cogging_torque,
    coulomb_friction,
    current_filter,
    current_gain,
    current_linearity,
    current_offset,
    current_sampling,
    dc_link_error,
    dc_link_ripple,
    dead_time,
    device_drop,
    encoder_eccentricity,
    encoder_offset,
    flux_harmonics,
    friction_torque,
    inductance_harmonics,
    iron_loss,
    leg_voltage,
    pwm_delay,
    shaft_compliance,
    skin_effect,
    viscous_friction,
    winding_asymmetry,
)
from model.lanes import one_branch, one_lag
from model.spline import currents as map_currents

__all__ = ["FURTHER", "NUMBERS", "map_currents", "one_branch", "one_lag"]


NUMBERS = {  # rows of the batch that hold effects' parameters
    "flux_harmonics_psi_d6": "Wb",
    "flux_harmonics_psi_q6": "Wb",
    "inductance_harmonics_gamma_6": "1/H",
    "iron_loss_core_resistance": "ohm",
    "iron_loss_time_constant": "s",
    "skin_effect_resistance": "ohm",
    "skin_effect_time_constant": "s",
    "winding_asymmetry_delta_a": "ohm",
    "winding_asymmetry_delta_b": "ohm",
    "dc_link_error_gain_error": "",
    "dc_link_error_sag": "ohm",
    "dc_link_ripple_amplitude": "V",
    "dc_link_ripple_frequency": "Hz",
    "dc_link_ripple_phase": "rad",
    "dead_time_time": "s",
    "dead_time_capacitance": "F",
    "dead_time_residual": "s",
    "dead_time_zone_width": "A",
    "dead_time_zone_shape": "",
    "dead_time_zone_center": "",
    "device_drop_threshold": "V",
    "device_drop_on_resistance": "ohm",
    "leg_voltage_v_1": "V",
    "leg_voltage_v_2": "V",
    "leg_voltage_v_3": "V",
    "leg_voltage_v_4": "V",
    "leg_voltage_v_5": "V",
    "leg_voltage_v_6": "V",
    "leg_voltage_v_7": "V",
    "leg_voltage_v_8": "V",
    "leg_voltage_v_9": "V",
    "leg_voltage_v_10": "V",
    "leg_voltage_v_11": "V",
    "leg_voltage_v_12": "V",
    "leg_voltage_reference": "A",
    "pwm_delay_delay": "s",
    "current_filter_time_constant": "s",
    "current_gain_gain_a": "",
    "current_gain_gain_b": "",
    "current_gain_gain_c": "",
    "current_linearity_second": "",
    "current_linearity_third": "",
    "current_linearity_fourth": "",
    "current_linearity_reference": "A",
    "current_offset_offset_a": "A",
    "current_offset_offset_b": "A",
    "current_sampling_delay": "s",
    "current_sampling_jitter": "s rms",
    "encoder_eccentricity_amplitude_mech": "rad",
    "encoder_eccentricity_phase": "rad",
    "encoder_offset_offset": "rad",
    "encoder_offset_latency": "s",
    "cogging_torque_amplitude": "N m",
    "cogging_torque_order_mech": "",
    "cogging_torque_phase": "rad",
    "coulomb_friction_torque": "N m",
    "coulomb_friction_width": "rad/s",
    "coulomb_friction_stribeck_torque": "N m",
    "coulomb_friction_stribeck_speed": "rad/s",
    "friction_torque_t_1": "N m",
    "friction_torque_t_2": "N m",
    "friction_torque_t_3": "N m",
    "friction_torque_t_4": "N m",
    "friction_torque_t_5": "N m",
    "friction_torque_t_6": "N m",
    "friction_torque_t_7": "N m",
    "friction_torque_reference": "rad/s",
    "shaft_compliance_stiffness": "N m/rad",
    "shaft_compliance_load_inertia": "kg m^2",
    "shaft_compliance_damping_ratio": "",
    "shaft_compliance_backlash": "rad",
    "viscous_friction_coefficient": "N m s/rad",
}
FURTHER = {  # those of further parts, so many rows each
    "flux_harmonics_further_psi_d": 5,
    "flux_harmonics_further_psi_q": 5,
    "flux_harmonics_further_order": 5,
    "flux_harmonics_further_phase": 5,
    "inductance_harmonics_further_gamma": 5,
    "inductance_harmonics_further_back": 5,
    "inductance_harmonics_further_pulse": 5,
    "inductance_harmonics_further_alpha_30": 5,
    "inductance_harmonics_further_alpha_12": 5,
    "inductance_harmonics_further_alpha_21": 5,
    "inductance_harmonics_further_alpha_03": 5,
    "inductance_harmonics_further_order": 5,
    "inductance_harmonics_further_phase": 5,
    "encoder_eccentricity_further_amplitude_mech": 3,
    "encoder_eccentricity_further_order_mech": 3,
    "encoder_eccentricity_further_phase": 3,
    "cogging_torque_further_amplitude": 5,
    "cogging_torque_further_order_mech": 5,
    "cogging_torque_further_phase": 5,
}


@inlined
def link(w, j, time):
    """Return V added to the link's voltage at an instant of the recording (s)."""
    return dc_link_ripple.ripple(
        w.dc_link_ripple_amplitude[j],
        w.dc_link_ripple_frequency[j],
        w.dc_link_ripple_phase[j],
        time,
    )


@inlined
def drawn(w, j, d_a, d_b, d_c, i_alpha, i_beta):
    """Return V that the link sags by over a period: duties, current (A)."""
    return dc_link_error.sag(w.dc_link_error_sag[j], d_a, d_b, d_c, i_alpha, i_beta)


@inlined
def edge(w, j, hold, before, after, link):
    """Return s that an edge acts late; right at slopes 0 any, 1 these, else with `commutation` (< 1
    any); hold: A."""
    return dead_time.late(
        w.dead_time_time[j],
        w.dead_time_capacitance[j],
        w.dead_time_residual[j],
        w.dead_time_zone_width[j],
        w.dead_time_zone_shape[j],
        w.dead_time_zone_center[j],
        hold,
        before,
        after,
        link,
    )


@inlined
def commutation(w, j, hold, before, after, link):
    """Return s by which an edge acts later than `edge` says, its current near zero."""
    return dead_time.commutated(
        w.dead_time_time[j],
        w.dead_time_capacitance[j],
        w.dead_time_residual[j],
        w.dead_time_zone_width[j],
        w.dead_time_zone_shape[j],
        w.dead_time_zone_center[j],
        hold,
        before,
        after,
        link,
    )


@inlined
def leg(w, j, before, after, shape):
    """Return V a leg loses on average while its current over its sign's width changes; shape: 0
    linear, 1 tanh."""
    return device_drop.lost(w.device_drop_threshold[j], before, after, shape)


@inlined
def leg_curve(w, j, before, after):
    """Return V a leg loses on average while its current (A) goes straight from before to after."""
    return leg_voltage.lost(
        w.leg_voltage_v_1[j],
        w.leg_voltage_v_2[j],
        w.leg_voltage_v_3[j],
        w.leg_voltage_v_4[j],
        w.leg_voltage_v_5[j],
        w.leg_voltage_v_6[j],
        w.leg_voltage_v_7[j],
        w.leg_voltage_v_8[j],
        w.leg_voltage_v_9[j],
        w.leg_voltage_v_10[j],
        w.leg_voltage_v_11[j],
        w.leg_voltage_v_12[j],
        w.leg_voltage_reference[j],
        before,
        after,
    )


@inlined
def winding(w, j, i_alpha, i_beta):
    """Return V lost in the windings, stationary frame, at a current (A)."""
    return winding_asymmetry.drop(
        w.winding_asymmetry_delta_a[j], w.winding_asymmetry_delta_b[j], i_alpha, i_beta
    )


@inlined
def magnets(w, j, c, s):
    """Return harmonic flux d, q (Wb) and its slope (Wb/rad) at cos, sin of the rotor's angle."""
    return flux_harmonics.harmonic(w.flux_harmonics_psi_d6[j], w.flux_harmonics_psi_q6[j], c, s)


@inlined
def energy(w, j, c, s, d, q):
    """Return further current i_d, i_q (A) and dH/dtheta (J/rad) at a flux (Wb)."""
    return inductance_harmonics.further(w.inductance_harmonics_gamma_6[j], c, s, d, q)


@inlined
def torque(w, j, turn, omega):
    """Return N m on the rotor at its mechanical angle (rad) and speed (rad/s)."""
    return cogging_torque.helping(
        w.cogging_torque_amplitude[j],
        w.cogging_torque_order_mech[j],
        w.cogging_torque_phase[j],
        turn,
        omega,
    )


@inlined
def friction(w, j, omega):
    """Return N m that the motor's side loses at a mechanical speed (rad/s)."""
    return (
        coulomb_friction.drag(
            w.coulomb_friction_torque[j],
            w.coulomb_friction_width[j],
            w.coulomb_friction_stribeck_torque[j],
            w.coulomb_friction_stribeck_speed[j],
            omega,
        )
        + friction_torque.drag(
            w.friction_torque_t_1[j],
            w.friction_torque_t_2[j],
            w.friction_torque_t_3[j],
            w.friction_torque_t_4[j],
            w.friction_torque_t_5[j],
            w.friction_torque_t_6[j],
            w.friction_torque_t_7[j],
            w.friction_torque_reference[j],
            omega,
        )
        + viscous_friction.drag(w.viscous_friction_coefficient[j], omega)
    )


@inlined
def load(w, j, omega):
    """Return N m that the load takes beside what it is asked for, at its speed (rad/s)."""
    return 0.0


@inlined
def reading(w, j, a, b, c):
    """Return what the sensors make of three phase currents (A)."""
    a, b, c = current_gain.scaled(
        w.current_gain_gain_a[j], w.current_gain_gain_b[j], w.current_gain_gain_c[j], a, b, c
    )
    a, b, c = current_linearity.bent(
        w.current_linearity_second[j],
        w.current_linearity_third[j],
        w.current_linearity_fourth[j],
        w.current_linearity_reference[j],
        a,
        b,
        c,
    )
    a, b, c = current_offset.shifted(
        w.current_offset_offset_a[j], w.current_offset_offset_b[j], a, b, c
    )
    return a, b, c


@inlined
def angle(w, j, turn, pairs):
    """Return rad electrical that the angle's reading is off at a mechanical angle (rad)."""
    return encoder_eccentricity.off(
        w.encoder_eccentricity_amplitude_mech[j], w.encoder_eccentricity_phase[j], turn, pairs
    )


@inlined
def supply(w, j):
    """Return share of its nominal voltage that the link has more, on average."""
    return dc_link_error.off(w.dc_link_error_gain_error[j])


@inlined
def resistance(w, j):
    """Return ohm in series with the winding."""
    return device_drop.slope(w.device_drop_on_resistance[j])


@inlined
def iron(w, j):
    """Return conductance across the slope of the flux (1/ohm), time constant of its lag (s)."""
    return iron_loss.branch(w.iron_loss_core_resistance[j], w.iron_loss_time_constant[j])


@inlined
def skin(w, j):
    """Return ohm for what the current has beside its lagged part, time constant (s)."""
    return skin_effect.ladder(w.skin_effect_resistance[j], w.skin_effect_time_constant[j])


@inlined
def filter(w, j):
    """Return time constant (s) of the low-pass between sensors and samplers."""
    return current_filter.low_pass(w.current_filter_time_constant[j])


@inlined
def delay(w, j):
    """Return s by which pulses come later than the recording says."""
    return pwm_delay.later(w.pwm_delay_delay[j])


@inlined
def instant(w, j):
    """Return s by which samples are taken later than t_k, variance of their jitter (s^2)."""
    return current_sampling.taken(w.current_sampling_delay[j], w.current_sampling_jitter[j])


@inlined
def offset(w, j):
    """Return rad electrical that all readings of the angle are off."""
    return encoder_offset.turned(w.encoder_offset_offset[j])


@inlined
def latency(w, j):
    """Return s by which readings of the angle are older than their rows."""
    return encoder_offset.old(w.encoder_offset_latency[j])


@inlined
def shaft(w, j, inertia):
    """Return of the inertia (kg m^2) what a shaft that twists drives, rate (rad/s) and damping
    ratio of its swing."""
    return shaft_compliance.two_masses(
        w.shaft_compliance_stiffness[j],
        w.shaft_compliance_load_inertia[j],
        w.shaft_compliance_damping_ratio[j],
        inertia,
    )


@inlined
def backlash(w, j):
    """Return rad that such a shaft turns freely, from end to end."""
    return shaft_compliance.gap(w.shaft_compliance_backlash[j])


@inlined
def further_magnets(w, k, j, c, s):
    """Return the same of the k-th further part of each effect."""
    return flux_harmonics.of_order(
        w.flux_harmonics_further_psi_d[k, j],
        w.flux_harmonics_further_psi_q[k, j],
        w.flux_harmonics_further_order[k, j],
        w.flux_harmonics_further_phase[k, j],
        c,
        s,
    )


@inlined
def further_energy(w, k, j, c, s, d, q):
    """Return the same of the k-th further part of each effect."""
    return inductance_harmonics.of_order(
        w.inductance_harmonics_further_gamma[k, j],
        w.inductance_harmonics_further_back[k, j],
        w.inductance_harmonics_further_pulse[k, j],
        w.inductance_harmonics_further_alpha_30[k, j],
        w.inductance_harmonics_further_alpha_12[k, j],
        w.inductance_harmonics_further_alpha_21[k, j],
        w.inductance_harmonics_further_alpha_03[k, j],
        w.inductance_harmonics_further_order[k, j],
        w.inductance_harmonics_further_phase[k, j],
        c,
        s,
        d,
        q,
    )


@inlined
def further_torque(w, k, j, turn, omega):
    """Return the same of the k-th further part of each effect."""
    return cogging_torque.helping(
        w.cogging_torque_further_amplitude[k, j],
        w.cogging_torque_further_order_mech[k, j],
        w.cogging_torque_further_phase[k, j],
        turn,
        omega,
    )


@inlined
def further_angle(w, k, j, turn, pairs):
    """Return the same of the k-th further part of each effect."""
    return encoder_eccentricity.of_order(
        w.encoder_eccentricity_further_amplitude_mech[k, j],
        w.encoder_eccentricity_further_order_mech[k, j],
        w.encoder_eccentricity_further_phase[k, j],
        turn,
        pairs,
    )
