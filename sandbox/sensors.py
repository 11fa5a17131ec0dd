"""What the sensors read: currents beside the sampling instant and behind a filter, gains and offsets, the encoder.

Closed forms of `sandbox/switched/AVERAGING.md`: 2 sampling instant, 3 filter, 4 iron loss.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from model.compiled import kernel
from model.effects import current_filter, encoder_eccentricity, encoder_offset, iron_loss
from model.frames import stationary
from model.pulses import duties, flux_after
from sandbox.full import (
    CLOCK,
    CORE_D,
    CORE_Q,
    CORE_RIPPLE,
    DUTY,
    FILTER_ALPHA,
    FILTER_BETA,
    FILTER_RIPPLE,
    magnetic,
    stiffness,
)
from sandbox.inverter import late_by, leg_links
from sandbox.oldplant import OMEGA, PHI_D, PHI_Q, THETA, turn

LARGEST_GROWTH = 1.0  # a sample before t_k looks back at the iron-loss current: by at most one time constant


class Sensors(NamedTuple):
    """Three current sensors and an encoder."""

    gain_a: float
    gain_b: float
    gain_c: float
    offset_a: float  # A
    offset_b: float
    filter_time: float  # s
    sampling_delay: float  # s
    jitter: float  # s rms
    encoder_offset: float  # rad
    eccentricity: float  # rad, mechanical
    eccentricity_phase: float  # rad
    encoder_step: float  # rad, electrical, of one count; 0: no counts


@kernel
def encoder(e, pole_pairs, theta, omega):
    """Return angle (rad) as the encoder reads it, and its slope (rad/s, electrical) without counts."""
    deviation = 0.0
    if e.eccentricity != 0.0:
        deviation = encoder_eccentricity.deviation(e.eccentricity, e.eccentricity_phase, pole_pairs, theta)
        omega *= 1.0 + e.eccentricity * math.cos(theta / pole_pairs + e.eccentricity_phase)
    return encoder_offset.read(theta, e.encoder_offset, deviation, e.encoder_step), omega


@kernel
def shifted(x, p, m, v, s, i_d, i_q, u_alpha, u_beta, c, n):
    """Return i_alpha, i_beta (A, magnetising) s after t_k, before it where s < 0, and the mean flux slope (V) between.

    The command acts from t_k on.
    """
    late, last = late_by(v), v.period
    duty = duties(u_alpha, u_beta, v.read_voltage)
    links = leg_links(v, x[CLOCK], duty, c * i_d + n * i_q, c * i_q - n * i_d)
    f_alpha, f_beta = stationary(
        links[0] * flux_after(duty[0], x[DUTY], last, late, s),
        links[1] * flux_after(duty[1], x[DUTY + 1], last, late, s),
        links[2] * flux_after(duty[2], x[DUTY + 2], last, late, s),
    )
    drop = s * (p.resistance + m.on_resistance)
    psi_d = x[PHI_D] + p.magnet_flux + c * f_alpha - n * f_beta - drop * i_d
    psi_q = x[PHI_Q] + c * f_beta + n * f_alpha - drop * i_q
    turned = x[OMEGA] * s
    psi_d, psi_q = turn(psi_d, psi_q, turned)
    ahead = turn(c, n, turned)
    j_d, j_q, _ = magnetic(p, m, ahead[0], -ahead[1], psi_d - p.magnet_flux, psi_q)
    v_alpha = (f_alpha - drop * (c * i_d + n * i_q)) / s
    v_beta = (f_beta - drop * (c * i_q - n * i_d)) / s
    c, n = turn(c, n, turned)
    return c * j_d + n * j_q, c * j_q - n * j_d, v_alpha, v_beta


@kernel
def filtered(x, p, m, v, e, c, n, core_ripple):
    """Return what the filter holds at t_k (A): its averaged state and the lagged ripple of the pulses."""
    dd, dq, qq = stiffness(p, m, c, -n, x[PHI_D], x[PHI_Q])
    r_alpha, r_beta = x[FILTER_RIPPLE], x[FILTER_RIPPLE + 1]
    r_d, r_q = c * r_alpha - n * r_beta, c * r_beta + n * r_alpha
    g_d, g_q = dd * r_d + dq * r_q, dq * r_d + qq * r_q
    i_alpha, i_beta = x[FILTER_ALPHA] + c * g_d + n * g_q, x[FILTER_BETA] + c * g_q - n * g_d
    if core_ripple:
        k, t = m.core_conductance, m.core_time
        i_alpha += iron_loss.reading_filtered(k, t, x[CORE_RIPPLE], e.filter_time, r_alpha)
        i_beta += iron_loss.reading_filtered(k, t, x[CORE_RIPPLE + 1], e.filter_time, r_beta)
    return i_alpha, i_beta


@kernel
def sampled(x, p, m, v, e, u_alpha, u_beta, rng):
    """Return i_alpha, i_beta (A) that the samplers hold for t_k, and the true i_d, i_q (averaged)."""
    c, n = math.cos(x[THETA]), -math.sin(x[THETA])
    m_d, m_q, _ = magnetic(p, m, c, -n, x[PHI_D], x[PHI_Q])
    i_d, i_q = m_d + x[CORE_D], m_q + x[CORE_Q]
    i_alpha, i_beta = c * i_d + n * i_q, c * i_q - n * i_d
    iron = m.core_conductance != 0.0
    if iron:
        i_alpha += iron_loss.reading(m.core_conductance, m.core_time, x[CORE_RIPPLE])
        i_beta += iron_loss.reading(m.core_conductance, m.core_time, x[CORE_RIPPLE + 1])
    s = e.sampling_delay
    if e.jitter > 0.0:
        s = min(max(s + e.jitter * rng.standard_normal(), -0.45 * v.period), 0.45 * v.period)
    j_alpha, j_beta = i_alpha, i_beta
    if s != 0.0:
        j_alpha, j_beta, v_alpha, v_beta = shifted(x, p, m, v, s, i_d, i_q, u_alpha, u_beta, c, n)
        if iron:
            decay = math.exp(min(-s / m.core_time, LARGEST_GROWTH))
            core_alpha, core_beta = i_alpha - (c * m_d + n * m_q), i_beta - (c * m_q - n * m_d)
            j_alpha += decay * core_alpha + (1.0 - decay) * m.core_conductance * v_alpha
            j_beta += decay * core_beta + (1.0 - decay) * m.core_conductance * v_beta
    if e.filter_time > 0.0:
        f_alpha, f_beta = filtered(x, p, m, v, e, c, n, iron)
        if s != 0.0:
            f_alpha = current_filter.after(f_alpha, i_alpha, j_alpha, s, e.filter_time)
            f_beta = current_filter.after(f_beta, i_beta, j_beta, s, e.filter_time)
        j_alpha, j_beta = f_alpha, f_beta
    return j_alpha, j_beta, i_d, i_q
